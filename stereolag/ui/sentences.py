"""Sentences about results: the core returns codes and numbers, and this module puts them into words."""

from __future__ import annotations

import math
from collections.abc import Mapping

from stereolag.assess.orientation import RowEvidence
from stereolag.core.typography import typeset
from stereolag.stereo.reasons import Reason


def duration(seconds: float) -> str:
    """Return a duration with a suitable unit."""
    return typeset(f"{seconds * 1e3:.0f} ms" if seconds < 1 else f"{seconds:,.2f} s")


def percent(share: float) -> str:
    """Return a share, 0..1, as a percentage."""
    return typeset(f"{share * 100:.0f} %")


def length(metres: float) -> str:
    """Return a length with a suitable unit, to two significant digits."""
    value, unit = (1000 * metres, "mm") if metres < 0.01 else (100 * metres, "cm") if metres < 1 else (metres, "m")
    return typeset(f"{float(f'{value:.2g}'):,.10g} {unit}")


# Maps


def beyond_the_colours(shares: Mapping[str, float]) -> str:
    """Return a sentence on how much of each map lies outside the colour range; the shares are 0..1."""
    said = " and ".join(f"**{percent(share)}** of {name}" for name, share in shares.items())
    return f"{said} is beyond the colour range."


def started_in_words(min_disparity: int, num_disparities: int) -> str:
    """Return a sentence about the initial settings of a visitor's own pair."""
    return (
        f"Searched from {min_disparity} to {min_disparity + num_disparities - 1} px, the range found for this pair, "
        "with the fast preset."
    )


# Rectification


def rectification_in_words(
    evidence: RowEvidence, rectified: bool, asked: bool, drops_truth: bool, subject: str = "The pair"
) -> str:
    """Return whether a pair was rectified with its calibration, and the row differences as evidence."""
    given, after = (_apart(median) for median in (evidence.given_px, evidence.rectified_px))
    because = ", as you said" if asked else ""
    if rectified:
        done = f"{subject} was undistorted and rectified with its calibration{because}"
        said = f"{done}: rows differ {after}, before {given}"
        counts = evidence.rectified_matches, evidence.given_matches
    else:
        said = f"{subject} is rectified already{because}: rows differ {given}, and {after} if rectified again"
        counts = evidence.given_matches, evidence.rectified_matches
    dropped = " Its ground truth belongs to the image before that and is left out." if drops_truth else ""
    return f"{said} (medians of {counts[0]} and {counts[1]} matched features).{dropped}"


def _apart(median: float) -> str:
    return "by an unknown amount" if math.isnan(median) else f"by {median:.2g} px"


# Why is it blank?

CHOICE_NAMES = {
    "zncc": "ZNCC",
    "ncc": "NCC",
    "cross": "Plain",
    "phase": "Phase",
    "auto": "Automatic",
    "window_sums": "Window sums",
    "fft": "FFT",
    "sgbm": "5",
    "hh": "8",
    "sgbm_3way": "3",
    "hh4": "4",
}
"""Display names of the choices in settings."""

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
    Reason.FILLED: "Not measured: filled in from the surface behind.",
    Reason.OUT_OF_FRAME: "The window, or the place where it should be found, lies outside the right image.",
    Reason.LOW_TEXTURE: "The window is nearly blank, like a bare wall: there is nothing to compare.",
    Reason.AMBIGUOUS: "Another place fits nearly as well: a fence, a repeating pattern, or a smooth surface.",
    Reason.LEFT_RIGHT: "Matched from the right image, the disparity differs: usually something nearer hides the point.",
    Reason.SPECKLE: "A small island of disparities unlike its surroundings: usually a chance match.",
    Reason.AT_SEARCH_EDGE: "The best match is on the edge of the search area: the true one may be beyond it.",
}

OPENCV_REASONS = (
    "StereoBM and StereoSGBM do not give reasons. Theirs were found by matching again with one filter after another "
    "switched off: the filter whose absence brings a pixel back had blanked it."
)
