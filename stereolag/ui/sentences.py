"""Results in plain words."""

from __future__ import annotations

import numpy as np

from stereolag.signals import SignalLag
from stereolag.stereo.reasons import Reason
from stereolag.templates import TemplateSearch


def lag_in_words(result: SignalLag) -> str:
    """Return who hears it when, and how far apart that puts the sensors."""
    if result.lag == 0:
        return "Both sensors hear it **at the same time**: neither is nearer to it."
    later, earlier = (2, 1) if result.lag > 0 else (1, 2)
    time, distance = f"{abs(result.time_s):.4g} s", f"{result.distance_m:,.2f} m"
    return f"Sensor {later} hears it **{time}** after sensor {earlier}: **{distance}**."


def why_not_found(result: TemplateSearch, min_score: float) -> str:
    """Return how near the best place came, and what to try."""
    if result.score_map is None:
        return (
            "No place in the picture has these very pixels and scores enough. “FFT” also finds a template that was "
            "dulled, recoloured or recompressed."
        )
    scores = result.score_map[np.isfinite(result.score_map)]
    best = f"The best place scores {scores.max():.2f}" if scores.size else "No place has anything to correlate"
    return (
        f"{best}, and the least score asked for is {min_score:.2f}. The template is not in the picture, or it is "
        "turned, resized or hidden there. Lower the least score to see the place that comes nearest."
    )


def duration(seconds: float) -> str:
    """Return a duration with the unit that suits it."""
    return f"{seconds * 1e3:.0f} ms" if seconds < 1 else f"{seconds:,.2f} s"


def percent(share: float) -> str:
    """Return a share, 0..1, as a percentage."""
    return f"{share * 100:.0f} %"


REASON_WORDS = {
    Reason.MEASURED: "measured",
    Reason.FILLED: "filled in",
    Reason.OUT_OF_FRAME: "out of frame",
    Reason.LOW_TEXTURE: "too little texture",
    Reason.AMBIGUOUS: "ambiguous",
    Reason.LEFT_RIGHT: "left and right disagree",
    Reason.SPECKLE: "speckle",
    Reason.AT_SEARCH_EDGE: "at the edge of the search",
}

REASONS_EXPLAINED = {
    Reason.FILLED: "Not measured: the surface behind was continued.",
    Reason.OUT_OF_FRAME: "The window, or the place where it should be found, lies outside the right image.",
    Reason.LOW_TEXTURE: "The window is as good as blank, like a bare wall: nothing to compare.",
    Reason.AMBIGUOUS: "Another place fits nearly as well: a fence, a repeated pattern, or something too smooth.",
    Reason.LEFT_RIGHT: "Matched from the right image the answer is another: mostly hidden behind something nearer.",
    Reason.SPECKLE: "A small island of disparities unlike all around it: mostly a chance match.",
    Reason.AT_SEARCH_EDGE: "The best match lies on the edge of the search area: the true one may lie beyond.",
}
