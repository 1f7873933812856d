"""Text alternatives for the maps and charts of the depth page, a sentence each."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from stereolag.assess.explaining import MatchExplanation
from stereolag.core.arrays import FloatMap, ReasonMap
from stereolag.core.inputs import Image
from stereolag.core.typography import typeset, typesets
from stereolag.figures.sweeps import ContactSheet
from stereolag.stereo.evaluation import CoverageCurve
from stereolag.stereo.reasons import Reason
from stereolag.ui.sentences import REASON_WORDS, percent

EVERY = 4
"""Sampling step of rows and columns: enough for the range of a map, in a sixteenth of the time."""


ERROR_COLOURS_IN_WORDS = typeset("Colours of the errors: blue at 0 px, red from 4 px on.")


@typesets
def map_in_words(disparity: FloatMap, what: str = "disparity map") -> str:
    """Return the share of a map that has a disparity, and the range of all but the outermost 2 %."""
    known = disparity[::EVERY, ::EVERY]
    known = known[np.isfinite(known)]
    if known.size == 0:
        return f"{what}, no pixel measured"
    low, high = np.percentile(known, (1, 99))
    share = float(np.isfinite(disparity).mean())
    return f"{what}, {percent(share)} measured, {low:.0f} to {high:.0f} px"


@typesets
def difference_in_words(difference: FloatMap) -> str:
    """Return how much two maps differ."""
    known = difference[np.isfinite(difference)]
    if known.size == 0:
        return "no pixel that both measured"
    return (
        f"{percent(float(np.mean(np.abs(known) <= 1)))} of the pixels that both measured differ by 1 px at most, "
        f"{percent(float(np.mean(known > 1)))} are larger in the first, {percent(float(np.mean(known < -1)))} smaller"
    )


@typesets
def photograph_in_words(image: Image) -> str:
    """Return the size of a photograph in words."""
    rows, cols = image.shape[:2]
    return f"photograph, {cols:,} by {rows:,} pixels"


@typesets
def blanks_in_words(reason: ReasonMap) -> str:
    """Return how much of a map has no measurement, and why, the most frequent reason first."""
    shares = {cause: float(np.mean(reason == cause)) for cause in Reason if cause is not Reason.MEASURED}
    found = sorted(((share, cause) for cause, share in shares.items() if share), reverse=True)
    if not found:
        return "every pixel is measured"
    said = ", ".join(f"{REASON_WORDS[cause]} {100 * share:.1f} %" for share, cause in found)
    return f"{100 * sum(shares.values()):.1f} % without a measurement: {said}"


@typesets
def all_blanks_in_words(reasons: Mapping[str, ReasonMap]) -> str:
    """Return the shares of the reasons for every method."""
    return "; ".join(f"{name}: {blanks_in_words(reason)}" for name, reason in reasons.items()) + "."


@typesets
def errors_in_words(disparity: FloatMap, truth: FloatMap, against: str) -> str:
    """Return the shares of wrong and of missing pixels of a map."""
    error = np.abs(disparity - truth)[np.isfinite(truth)]
    wrong = 100 * float(np.mean(error > 2))
    missing = 100 * float(np.mean(np.isnan(error)))
    return f"Error map against {against}: {wrong:.1f} % off by more than 2 px, {missing:.1f} % without a disparity."


@typesets
def coverage_curves_in_words(curves: Mapping[str, CoverageCurve]) -> str:
    """Return the error of each method at its full coverage and at half of it."""

    def told(name: str, curve: CoverageCurve) -> str:
        most = int(np.argmax(curve.coverage))
        whole = f"{name}: {curve.bad[most]:.1f} % wrong at {percent(float(curve.coverage[most]))} kept"
        if curve.coverage.size == 1:
            return whole
        half = int(np.argmin(np.abs(curve.coverage - curve.coverage[most] / 2)))
        return f"{whole}, {curve.bad[half]:.1f} % at {percent(float(curve.coverage[half]))}"

    return "Error against coverage. " + "; ".join(told(name, curve) for name, curve in curves.items()) + "."


@typesets
def scores_in_words(seen: MatchExplanation, shape: str) -> str:
    """Return the peak and the runner-up of one window's scores."""
    if seen.peak is None:
        return f"{shape}: no place has a score."
    said = f"{shape}: the peak, {seen.peak_score:.3f}, is at a disparity of {-seen.peak[1]} px"
    if seen.runner_up is None:
        return f"{said}, and no other place rivals it."
    return f"{said}; the runner-up, {seen.runner_up_score:.3f}, is at {-seen.runner_up[1]} px."


@typesets
def fit_in_words(seen: MatchExplanation) -> str:
    """Return the position of the maximum of the curve through the scores next to the peak."""
    found = "no disparity is taken" if math.isnan(seen.disparity) else f"its top is at {seen.disparity:.2f} px"
    return f"Curve through the scores next to the peak: {found}."


@typesets
def sheet_in_words(sheet: ContactSheet, titles: tuple[str, str]) -> str:
    """Return the values tried in a sweep, and its best cell if known."""
    tried = f"{len(sheet.rows)} values of {titles[0]} down, {len(sheet.cols)} of {titles[1]} across"
    if not sheet.judged:
        return f"{tried}."
    row, col = np.unravel_index(int(np.nanargmin(sheet.bad)), sheet.bad.shape)
    best = f"{titles[0]} {sheet.rows[int(row)]}, {titles[1]} {sheet.cols[int(col)]}"
    return f"{tried}. Best: {best}, {sheet.bad[row, col]:.1f} % off by more than 2 px or missing."
