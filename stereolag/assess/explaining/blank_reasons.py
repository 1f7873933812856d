"""Reasons for pixels left blank by OpenCV's matchers, which do not record any themselves."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import ReasonMap
from stereolag.core.progress import Progress, silent
from stereolag.stereo.matcher import DisparityMap
from stereolag.stereo.reasons import Reason

FILTERS: tuple[tuple[Reason, str, int], ...] = (
    (Reason.SPECKLE, "speckle_window_size", 0),
    # StereoSGBM reads a tolerance of -1 or 0 as 1; only a tolerance that no two disparities exceed disables the check.
    (Reason.LEFT_RIGHT, "disp12_max_diff", 1 << 20),
    (Reason.AMBIGUOUS, "uniqueness_ratio", 0),
    (Reason.LOW_TEXTURE, "texture_threshold", 0),
)
"""OpenCV's filters, last to run first: the reason each gives, its setting, and the value that switches it off."""


def blank_reasons(
    result: DisparityMap, left: npt.ArrayLike, right: npt.ArrayLike, *, progress: Progress = silent
) -> ReasonMap:
    """Return the reason of every pixel of a map, inferring those of blank pixels for OpenCV's matchers.

    This library's own matchers record their reasons. For OpenCV's, the pair is matched again with the filters switched
    off one after another, from the last to the first: the filter whose absence brings a pixel back had blanked it. A
    pixel that no filter blanked is too close to the border for the search.

    Parameters
    ----------
    result
        The map computed from the pair with its ``settings``.
    left, right
        The pair.
    progress
        Called with the fraction done after every run.

    Returns
    -------
    ndarray
        (H, W) uint8 of :class:`~stereolag.stereo.reasons.Reason`.
    """
    matcher = result.settings
    if matcher.gives_reasons:
        return result.reason
    reason = np.where(result.valid, result.reason, Reason.OUT_OF_FRAME).astype(np.uint8)
    unexplained = ~result.valid
    switches = [one for one in FILTERS if one[1] in type(matcher).model_fields]
    for done, (cause, setting, switched_off) in enumerate(switches, start=1):
        # Not validated: the value that disables the left-right check is outside the setting's range.
        matcher = matcher.model_copy(update={setting: switched_off})
        returned = unexplained & matcher.compute(left, right).valid
        reason[returned] = cause
        unexplained &= ~returned
        progress(done / len(switches))
    return reason
