"""By what a ground truth of 8 bits was multiplied, which such files do not say: told from the pair itself."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from stereolag.geometry.scaling import cropped_alike, scaled_disparity, scaled_image
from stereolag.inputs import Image
from stereolag.stereo.opencv import StereoSGBM

DIVISORS = (1, 2, 4, 8, 16)
"""By what data sets multiplied their disparities to use the 8 bits: Middlebury 1, 2, 4 and 8, Tsukuba 16."""

LARGEST_STORED = 255
QUICK_WIDTH = 480
"""Px; a map this wide tells the divisor, and takes some hundredths of a second."""
SEARCHED_SHARE = 0.5
"""Of the width."""
AGREEMENT_PX, AGREEMENT_SHARE = 1.0, 0.05
"""Two disparities agree that differ by less than the one, or by less than this share; neighbouring divisors differ by
half."""


def likely_divisor(stored: npt.ArrayLike, left: Image, right: Image) -> int:
    """Return by which of :data:`DIVISORS` the stored values become px, so that they agree best with a quick map.

    Parameters
    ----------
    stored
        (H, W) values as the file holds them, NaN where unknown; of the left image's size.
    left, right
        The pair, in any size that :func:`stereolag.geometry.scaling.cropped_alike` allows; its rows must match.

    Returns
    -------
    divisor
        The one on which most pixels agree; of several alike, and where none agree, the smallest.
    """
    left, right = cropped_alike(left, right)
    rows, cols = left.shape[:2]
    factor = min(1.0, QUICK_WIDTH / cols)
    values = scaled_disparity(np.asarray(stored)[:rows, :cols], factor)
    small = [scaled_image(image, factor) for image in (left, right)]
    found = _quick_map(*small)
    known = np.isfinite(values) & np.isfinite(found)
    tolerance = np.maximum(AGREEMENT_PX, AGREEMENT_SHARE * found[known])
    agreeing = [np.count_nonzero(np.abs(values[known] / divisor - found[known]) <= tolerance) for divisor in DIVISORS]
    return DIVISORS[int(np.argmax(agreeing))]


def _quick_map(left: Image, right: Image) -> npt.NDArray[np.float32]:
    """Return disparities, NaN where there are none; none at all of images too narrow for a search."""
    cols = left.shape[1]
    reach = min(LARGEST_STORED, int(SEARCHED_SHARE * cols))
    matcher = StereoSGBM(num_disparities=max(16, reach // 16 * 16))
    try:
        return matcher.compute(left, right).disparity
    except ValueError:
        return np.full(left.shape[:2], np.nan, np.float32)
