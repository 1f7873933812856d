"""Matching by a volume of costs: from the cheapest paths to a displacement, or a reason, for every pixel."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.inputs import Image, grey_level
from stereolag.progress import Progress
from stereolag.stereo.checks import FLAT_TEXTURE, Checks, ambiguous, left_right_disagree
from stereolag.stereo.costs import MatchingCost, eight_bit
from stereolag.stereo.matcher import Displacements
from stereolag.stereo.optimisation import SemiGlobal
from stereolag.stereo.result import Reason
from stereolag.stereo.search import RectifiedSearch
from stereolag.stereo.semi_global import match_semi_global

LARGEST_COST = 8 * 250
"""What eight paths through nothing but the worst mismatches would cost a pixel."""


def match_by_volume(
    left: Image,
    right: Image,
    *,
    window_size: int,
    search: RectifiedSearch,
    cost: MatchingCost,
    optimisation: SemiGlobal,
    checks: Checks,
    progress: Progress,
) -> Displacements:
    """Match two grey images along their rows by semi-global optimisation and check what was found.

    Parameters
    ----------
    left, right
        (H, W) grey images of one type.
    window_size
        Side of the correlation's window, px.
    search
        The disparities.
    cost, optimisation
        What is weighed, and how.
    checks
        Which of the matches found are believed.
    progress
        Called with the fraction done.

    Returns
    -------
    Displacements
        The score is 1 less the cost of the paths as a share of the highest there can be.
    """
    first, count = search.min_disparity, search.num_disparities
    found = match_semi_global(
        *eight_bit(left, right),
        window_size=window_size,
        min_disparity=first,
        num_disparities=count,
        cost=cost,
        optimisation=optimisation,
        progress=progress,
    )
    reason = np.full(left.shape, Reason.MEASURED, dtype=np.uint8)
    if checks.left_right is not None:
        reason[left_right_disagree(found.dx, found.right_dx, checks.left_right.tolerance)] = Reason.LEFT_RIGHT
    if checks.ambiguity is not None:
        reason[ambiguous(found.lowest, found.runner_up, round(checks.ambiguity.lead * LARGEST_COST))] = Reason.AMBIGUOUS
    # Disparity 0 is infinity: an end of the world and not of the search.
    reason[(found.dx == -(first + count - 1)) | ((found.dx == -first) & (first != 0))] = Reason.AT_SEARCH_EDGE
    match = np.arange(left.shape[1], dtype=np.int32) + found.dx
    reason[(match < 0) | (match >= left.shape[1])] = Reason.OUT_OF_FRAME
    flat = (checks.texture.least if checks.texture else FLAT_TEXTURE) * grey_level(left, right)
    reason[_deviation(left, window_size) <= flat] = Reason.LOW_TEXTURE
    nothing = np.float32(np.nan)
    measured = reason == Reason.MEASURED
    return Displacements(
        dy=np.where(measured, np.float32(0), nothing),
        dx=np.where(measured, -found.disparity, nothing),
        score=(1 - found.lowest / np.float32(LARGEST_COST)).astype(np.float32),
        reason=reason,
    )


def _deviation(image: Image, window_size: int) -> npt.NDArray[np.float64]:
    """Return the standard deviation of the window around every pixel, grey levels."""
    centred = image - float(np.round(np.mean(image)))
    mean, square = (cv2.blur(part, (window_size, window_size)) for part in (centred, centred * centred))
    return np.asarray(np.sqrt(np.maximum(square - mean * mean, 0)))
