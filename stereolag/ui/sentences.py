"""Every sentence about results: the core gives codes and numbers, and this module puts them into words."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from stereolag.doctor.row_evidence import RowEvidence
from stereolag.explaining.example_pixels import ExampleKind
from stereolag.explaining.match import MatchExplanation, MatchKind
from stereolag.signals import SignalLag
from stereolag.stereo.reasons import Reason
from stereolag.templates import TemplateSearch


def duration(seconds: float) -> str:
    """Return a duration with the unit that suits it."""
    return f"{seconds * 1e3:.0f} ms" if seconds < 1 else f"{seconds:,.2f} s"


def percent(share: float) -> str:
    """Return a share, 0..1, as a percentage."""
    return f"{share * 100:.0f} %"


# Maps


def beyond_the_colours(shares: Mapping[str, float]) -> str:
    """Return how much of which maps lies beyond the range of the colours; the shares are 0..1."""
    said = " and ".join(f"**{percent(share)}** of {name}" for name, share in shares.items())
    return f"{said} lies beyond the colours."


def started_in_words(min_disparity: int, num_disparities: int) -> str:
    """Return with which settings a pair of the visitor's own began."""
    return (
        f"Searched from {min_disparity} to {min_disparity + num_disparities - 1} px, the range found for this pair, "
        "with the fast preset."
    )


# Recordings


def lag_in_words(result: SignalLag) -> str:
    """Return who hears it when, and how far apart that puts the sensors."""
    if result.lag == 0:
        return "Both sensors hear it **at the same time**: neither is nearer to it."
    later, earlier = (2, 1) if result.lag > 0 else (1, 2)
    time, distance = f"{abs(result.time_s):.4g} s", f"{result.distance_m:,.2f} m"
    return f"Sensor {later} hears it **{time}** after sensor {earlier}: **{distance}**."


# Templates


def why_not_found(result: TemplateSearch, min_score: float) -> str:
    """Return how close the best place came, and what to try."""
    if result.score_map is None:
        return (
            "No place in the image has exactly these pixels and a high enough score. “FFT” also finds a template that "
            "was dimmed, recoloured or recompressed."
        )
    scores = result.score_map[np.isfinite(result.score_map)]
    best = f"The best place scores {scores.max():.2f}" if scores.size else "No place has anything to correlate"
    return (
        f"{best}; the minimum score is {min_score:.2f}. The template is not in the image, or it is rotated, resized or "
        "hidden there. Lower the minimum score to see the place that comes closest."
    )


# Rectification


def rectification_in_words(evidence: RowEvidence, rectified: bool, asked: bool, drops_truth: bool) -> str:
    """Return whether a pair was rectified with its calibration, with the rows as evidence."""
    given, after = (_apart(median) for median in (evidence.given_px, evidence.rectified_px))
    because = ", as you said" if asked else ""
    if rectified:
        said = (
            f"The pair was undistorted and rectified with its calibration{because}: rows differ {after}, before {given}"
        )
        counts = evidence.rectified_matches, evidence.given_matches
    else:
        said = f"The pair is rectified already{because}: rows differ {given}, rectified once more {after}"
        counts = evidence.given_matches, evidence.rectified_matches
    dropped = " Its ground truth belongs to the image before that and is left out." if drops_truth else ""
    return f"{said} (medians of {counts[0]} and {counts[1]} matched features).{dropped}"


def _apart(median: float) -> str:
    return "by an unknown amount" if math.isnan(median) else f"by {median:.2g} px"


# Why this match?

EXAMPLE_LABELS = {
    ExampleKind.CLEAR: "A clear match",
    ExampleKind.REPEATS: "A repeating pattern",
    ExampleKind.BARE: "A bare wall",
    ExampleKind.HIDDEN: "Hidden from the right camera",
}
NO_CORRELATION = "Correlation has no result to explain yet."
NO_EXAMPLE = "This pair has none with these window and search settings."

BEFORE_OPTIMISATION = (
    "These are the raw scores of the windowed correlation. Semi-global optimisation weighs them, together with its "
    "other costs, against those of the neighbours along eight paths, and may choose another peak."
)
ROW_FIT = "A bell curve through the best score and its two neighbours: its peak is the disparity."
SQUARE_FIT = "A section through the bell fitted to the best score and its eight neighbours: its peak is the disparity."
NO_FIT = "A match at the edge has no sub-pixel position: its neighbour on one side is missing."
HIDDEN_FROM_RIGHT = "The right camera cannot see this point: something nearer hides it."
RIGHT_PX = 1.0
"""A match is called right up to this error, px."""


def match_in_words(seen: MatchExplanation) -> str:
    """Return in a sentence what the scores show of the match."""
    scores = f"{seen.peak_score:.3f} and {seen.runner_up_score:.3f}"
    match seen.kind:
        case MatchKind.NOTHING:
            return "Nothing to correlate: the window is flat, or every place it could match lies outside the image."
        case MatchKind.AT_EDGE:
            return (
                "The best score lies on the edge of the search area or of the image: the true match may be beyond it."
            )
        case MatchKind.BARE:
            return (
                f"A bare wall: the window has {seen.contrast:.0%} of the image’s contrast, and its best score is "
                f"{seen.peak_score:.2f}. It compares mostly noise."
            )
        case MatchKind.UNLIKE:
            return (
                f"Nothing looks like this: the best score is {seen.peak_score:.2f}. Perhaps the other camera cannot "
                "see it, or sees it in another light."
            )
        case MatchKind.REPEATS:
            return (
                f"Two places fit almost equally well ({scores}), with worse ones between them: the pattern repeats, "
                "like a fence, and chance decides."
            )
        case MatchKind.SMOOTH:
            return (
                f"Two places fit almost equally well ({scores}), and so do those between them: the window is too "
                "smooth to tell neighbours apart, and noise decides."
            )
    if math.isnan(seen.runner_up_score):
        return f"One clear peak: {seen.peak_score:.3f}."
    return f"One clear peak: {seen.peak_score:.3f}; the next best place scores {seen.runner_up_score:.3f}."


def match_against_truth(disparity: float, truth: float) -> str:
    """Return how far the disparity of a match is from the ground truth, both px and known."""
    error = abs(disparity - truth)
    verdict = "**right**" if error <= RIGHT_PX else f"**wrong** by {error:.1f} px"
    return f"The match gives {disparity:.2f} px and the ground truth is {truth:.2f} px: it is {verdict}."


# Why is it blank?

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
    Reason.LOW_TEXTURE: "The window is nearly blank, like a bare wall: there is nothing to compare.",
    Reason.AMBIGUOUS: "Another place fits nearly as well: a fence, a repeating pattern, or a smooth surface.",
    Reason.LEFT_RIGHT: "Matched from the right image, the disparity differs: usually something nearer hides the point.",
    Reason.SPECKLE: "A small island of disparities unlike its surroundings: usually a chance match.",
    Reason.AT_SEARCH_EDGE: "The best match lies on the edge of the search area: the true one may be beyond it.",
}

OPENCV_REASONS = (
    "StereoBM and StereoSGBM do not give reasons. Theirs were found by matching again with one filter after another "
    "switched off: the filter whose absence brings a pixel back had blanked it."
)
