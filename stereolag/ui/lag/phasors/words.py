"""Texts of the phasor panel and its examples."""

from __future__ import annotations

from typing import Any, Final

from stereolag.core.typography import typeset
from stereolag.signals.phasors import (
    LAG,
    LENGTH,
    Phasors,
    correlation,
)

INTRODUCTION: Final = (
    "Two recordings have one arrow for each frequency: their cross-spectrum. A shift in time turns each arrow in "
    "proportion to its frequency: twice the frequency, twice the angle. The slider turns all of them back by its lag. "
    "At the true lag they all point the same way, and nothing cancels."
)

WORDS: Final[dict[str, Any]] = {
    "captions": {
        "magnitudes": ["Magnitudes", "how much of each frequency the recordings contain"],
        "phases": [
            "Phase difference",
            "by how many turns recording 2 is behind; its slope is the lag. Whole turns look alike, so each dot is "
            "drawn again above and below. The ruler’s slope is the slider’s lag.",
        ],
        "chain": [
            "Arrows, head to tail",
            "as long as the product of its two magnitudes, and turned as far as its dot is from the ruler. How far "
            "right the chain ends is the correlation.",
        ],
        "lags": ["Correlation over lag, in samples", "at the lags tried"],
    },
    "recordings": ["recording 1", "recording 2"],
    "frequency": "frequency, turns a sample",
    "in_line": "all arrows in line",
    "lag": "Lag",
    "there": "in the recordings",
    "plain": "correlation",
    "whitened": "whitened correlation",
}

EXAMPLES: Final[dict[str, dict[str, Any]]] = {
    "knock": {
        "title": "Knock",
        "try": "One short sound, 4 samples later in recording 2. Move the lag until the ruler runs through the dots.",
        "said": {
            "plain": "At lag 4 the ruler runs through the dots, every arrow points right, and the chain is straight. "
            "That is the peak.",
            "whitened": "The same peak at lag 4. All arrows are equal now: every frequency counts alike.",
        },
    },
    "coast": {
        "title": "Coast, up close",
        "try": "Move the lag: the peak is broad. Then whiten.",
        "said": {
            "plain": "The chain is straight at lag 4: 50,082 samples in the recordings. The peak is broad because the "
            "few long arrows are low frequencies, which turn slowly. Now whiten.",
            "whitened": "The hill became a needle at the same lag: high frequencies count as much now, and they turn "
            "fast.",
        },
    },
    "harbour": {
        "title": "Harbour, up close",
        "try": "Each sensor hears its own wind. Do the dots still lie on a line?",
        "said": {
            "plain": "Wind scatters the arrows, so the chain never gets quite straight. It still reaches furthest at "
            "lag 4: −31,234 samples in the recordings.",
            "whitened": "Still lag 4, but a shorter reach: frequencies with only wind count as much as the horns.",
        },
    },
    "tone": {
        "title": "One tone",
        "try": "A tone has one frequency, and so one arrow. How many lags turn it back?",
        "said": {
            "plain": "The arrow points right again after every full turn: a peak every 5 samples, all equal. One arrow "
            "cannot tell them apart.",
            "whitened": "Nothing changes: one arrow stays one arrow. A single peak needs many frequencies.",
        },
    },
    "noise": {
        "title": "Two noises",
        "try": "Two noises that share nothing. Does any lag line the arrows up?",
        "said": {
            "plain": "No lag lines the arrows up: the dots are not on a line, so the arrows always cancel. The "
            "highest point, 0.18, is chance.",
            "whitened": "Equal arrows do not line up either: 0.17 at most.",
        },
    },
}

_EQUAL = 1e-6

OWN_TITLE: Final = "Your recordings"
_FOUND = "The chain reaches furthest at lag {}, as in the whole recordings."
_MISSED = "In this short stretch the chain reaches furthest at lag {}, not at 4 as in the whole recordings."


def excerpt_in_words(found: Phasors) -> str:
    """Return where the stretches were cut from the two recordings, and the lag left between them."""
    means = "" if found.step == 1 else f", each the mean of {found.step} samples of the recording"
    later = "later" if found.offset >= 0 else "earlier"
    return (
        f"{LENGTH} samples{means}. Those of recording 2 begin {abs(found.offset):,} samples {later}, so that a lag of "
        f"{LAG} is left."
    )


def own_in_words(found: Phasors) -> dict[str, Any]:
    """Return the texts for the visitor's own recordings."""
    return {
        "title": OWN_TITLE,
        "try": "The loudest stretch of your recordings, up close.",
        "said": {name: _peak_in_words(found, whiten=name == "whitened") for name in ("plain", "whitened")},
    }


def _peak_in_words(found: Phasors, *, whiten: bool) -> str:
    lags, heights = correlation(found, whiten=whiten)
    peak = min(lags[heights > heights.max() - _EQUAL], key=abs)
    said = _FOUND if abs(peak - LAG) <= 0.5 else _MISSED
    return said.format(typeset(f"{peak:g}"))
