"""Every sentence about results: the core gives codes and numbers, and this module puts them into words."""

from __future__ import annotations

import math
from collections.abc import Mapping

from stereolag.doctor.row_evidence import RowEvidence
from stereolag.signals import SignalLag
from stereolag.stereo.reasons import Reason


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


def verdict_in_words(result: SignalLag) -> str:
    """Return what the verdict on a lag is: the lag where it is sure, otherwise why none can be named."""
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
    "chance": "Nothing in common found: the highest point is what chance gives.",
    "too_little": "Nothing in common found: so few samples stand out that chance could line them up.",
    "few_votes": "Nothing in common found: hardly two samples vote for the same lag.",
    "opposite_sign": "Nothing in common found, but **the opposite sign fits**: one microphone is reversed.",
}


def verdict_explained(result: SignalLag, sampling_rate: float, speed: float) -> list[str]:
    """Return what else is to be said of the verdict: the drift, how far the lag can be off, where the opposite fits."""
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
        metres = drift.spread / sampling_rate * speed
        said.append(
            f"Over {drift.blocks} blocks the lag varies by ± {drift.spread:.2g} samples, ± {metres:.2g} m of path."
        )
    if judgement.opposite_lag is not None:
        said.append(f"With its sign turned, recording 2 fits at {judgement.opposite_lag:,} samples.")
    return said


def _samples(spacing: float) -> str:
    whole = round(spacing)
    return f"{whole:,}" if abs(spacing - whole) < 0.05 or spacing >= 100 else f"{spacing:.1f}"


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
"""What the choices of settings are called on a page."""

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
