"""The scale factor of an 8-bit ground truth, which such files do not record, estimated from the pair itself."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from stereolag.core.inputs import Image
from stereolag.geometry.rectification import cropped_alike, scaled_disparity, scaled_image
from stereolag.stereo.opencv import StereoSGBM

DIVISORS = (1, 2, 4, 8, 16)
"""Factors by which data sets scale disparities to use the 8 bits: Middlebury 1, 2, 4 and 8, Tsukuba 16."""

LARGEST_STORED = 255
QUICK_WIDTH = 480
"""Px; a map this wide is enough to find the divisor, and takes a few hundredths of a second."""
SEARCHED_SHARE = 0.5
"""Share of the width."""
AGREEMENT_PX, AGREEMENT_SHARE = 1.0, 0.05
"""Two disparities agree if they differ by no more than the larger of this distance and this share; neighbouring
divisors differ by a factor of two."""


def likely_divisor(stored: npt.ArrayLike, left: Image, right: Image) -> int:
    """Return the divisor, one of :data:`DIVISORS`, that makes the stored values agree best with a quick map.

    Parameters
    ----------
    stored
        (H, W) values as stored in the file, NaN where unknown; the size of the left image.
    left, right
        The pair, of any sizes that :func:`stereolag.geometry.rectification.cropped_alike` allows; its rows must match.

    Returns
    -------
    divisor
        The divisor with the most agreeing pixels; the smallest if there is a tie or no agreement.
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
    """Return disparities, NaN where unmatched; all NaN if the images are too narrow for a search."""
    cols = left.shape[1]
    reach = min(LARGEST_STORED, int(SEARCHED_SHARE * cols))
    matcher = StereoSGBM(num_disparities=max(16, reach // 16 * 16))
    try:
        return matcher.compute(left, right).disparity
    except ValueError:
        return np.full(left.shape[:2], np.nan, np.float32)
