"""Lags in words: metres only if a lag is sure, otherwise why none can be given."""

from __future__ import annotations

from stereolag.signals import SignalLag
from stereolag.ui.sentences import length

LEAST_SPREAD = 0.01
"""Samples; a smaller spread is reported as less than this."""


def lag_in_words(result: SignalLag) -> str:
    """Return which sensor hears the sound later, by how much, and the path difference."""
    if result.lag == 0:
        return "Both sensors hear it **at the same time**: neither is nearer to it."
    later, earlier = (2, 1) if result.lag > 0 else (1, 2)
    time, distance = f"{abs(result.time_s):.4g} s", f"{result.distance_m:,.2f} m"
    return f"Sensor {later} hears it **{time}** after sensor {earlier}: its path is **{distance}** longer."


def verdict_in_words(result: SignalLag) -> str:
    """Return the lag if it is sure, otherwise why none can be given."""
    judgement = result.judgement
    if judgement is None or judgement.verdict == "sure":
        return lag_in_words(result)
    if judgement.reason == "repeats" and judgement.spacing is not None:
        return f"Cannot tell: it repeats every **{_samples(judgement.spacing)} samples**."
    if judgement.verdict == "ambiguous":
        others = len(judgement.rivals)
        return f"Cannot tell: **{others} other {'lag fits' if others == 1 else 'lags fit'}** as well."
    return _NOTHING_WORDS[judgement.reason]


_NOTHING_WORDS = {
    "chance": "Nothing in common found: the highest point is at chance level.",
    "too_little": "Nothing in common found: so few samples stand out that chance could line them up.",
    "few_votes": "Nothing in common found: hardly two samples vote for the same lag.",
    "opposite_sign": "Nothing in common found, but **the opposite sign fits**: one microphone is reversed.",
}


def verdict_explained(result: SignalLag, sampling_rate: float, speed: float) -> list[str]:
    """Return the details of a verdict: rivals, drift, uncertainty, a reversed microphone, advice."""
    judgement = result.judgement
    if judgement is None:
        return []
    said = []
    drift = judgement.drift
    if drift is not None and judgement.reason == "drift":
        said.append(
            f"The clocks differ by **{drift.ppm:+.1f} ppm** (± {drift.error_ppm:.1g}): the lag goes from "
            f"{drift.start:,.1f} to {drift.start + drift.span:,.1f} samples, which smears the peak."
        )
    if drift is not None:
        samples = max(drift.spread, LEAST_SPREAD)
        said.append(
            f"Over {drift.blocks} blocks the lag varies by {'±' if samples == drift.spread else 'less than ±'} "
            f"{samples:.2g} samples, ± {length(samples / sampling_rate * speed)} of path."
        )
    if judgement.opposite_lag is not None:
        said.append(
            f"With its sign reversed, recording 2 fits at {judgement.opposite_lag:,} samples: swap the wires of one "
            "microphone, or negate one file."
        )
    elif judgement.verdict == "ambiguous":
        said.append(
            f"The lags {_listed(sorted((result.lag, *judgement.rivals)))} fit about equally well. A stretch that does "
            "not repeat, or a smaller largest lag, can decide."
        )
    elif judgement.verdict == "nothing":
        said.append(
            "Use a longer stretch with a distinct sound that both sensors hear, and check that both files cover it."
        )
    return said


_MOST_LISTED = 5


def _listed(lags: list[int]) -> str:
    shown = [f"{lag:,}" for lag in lags[:_MOST_LISTED]]
    more = len(lags) - len(shown)
    return "; ".join(shown) + (f" and {more} more" if more else "")


def _samples(spacing: float) -> str:
    whole = round(spacing)
    return f"{whole:,}" if abs(spacing - whole) < 0.05 or spacing >= 100 else f"{spacing:.1f}"


RIBBON_EXPLAINED = {
    "fair": "Grey: chance level. The curve is Pearson’s correlation times √(overlap ÷ longest "
    "overlap): 0.5 over many samples counts more than 0.9 over ten. The score above is the plain one at the peak.",
    "plain": "Grey: chance level, wider toward the ends, where few samples overlap. The curve is "
    "plain Pearson even there: over two or three samples it swings to ±1, which means nothing.",
    "phat": "Grey: chance level. Every frequency counts the same, whatever its loudness: the peak is "
    "the share of them that agrees on the lag, so it is lower than the score.",
}
"""Caption of the curve for each way to draw it."""
