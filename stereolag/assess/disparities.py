"""The disparities in a pair: the search range that covers them, and the scale factor of an 8-bit ground truth."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt
import scipy  # scipy.spatial is loaded on first use

from stereolag.assess.features import FEWEST_MATCHES, Chosen, Correspondences, Points
from stereolag.assess.orientation import robust_fit
from stereolag.core.arrays import DoubleMap
from stereolag.core.inputs import Image
from stereolag.geometry.rectification import cropped_alike, scaled_disparity, scaled_image
from stereolag.stereo.opencv import StereoSGBM

COARSE_WIDTH = 320
"""Width to which a pair is reduced for the coarse search, px."""

FARTHEST, NEAREST = 0.12, 0.28
"""Reach of the coarse search behind and in front of infinity, as shares of the width."""

COARSE_ROW_PX = 0.5
"""Row errors up to this size in the coarse images are left uncorrected."""

FEWEST_MEASURED = 0.02
"""Share of coarse pixels that must be matched for the search to count."""

LEAST_TAIL, FAR_TAIL, NEAR_TAIL = 0.5, 10.0, 5.0
"""Least percentage of disparities trimmed at each end, and how it grows at the far and near ends with the share not
measured: the less can be matched, the more matches are wrong. Missing near objects hurts more."""

FEATURE_TAIL, FEATURES_LEFT_OUT = 2.0, 3
"""Percentage of features trimmed at each end, and their least number."""

NEIGHBOURS, LEAST_ALIKE, ALIKE = 8, 3, 0.01
"""Nearest features compared, number that must have the same disparity, and the tolerance as a share of the width."""

INFINITY_SLACK_PX = 4.0
"""Disparities no more than this below 0 still count as infinity on a rectified pair."""

RANGE_MARGIN = 0.15
"""Margin of the suggested range beyond the disparities seen, as a share of their span."""


def disparities_seen(left: Image, right: Image, points: Correspondences) -> tuple[float, float] | None:
    """Return the range of disparities in a pair, px; None if neither pixels nor features reveal it.

    Combines a coarse semi-global search, far wider than any pair should need, with the matched features. Features alone
    would miss near objects, which fill few but important pixels; they help if the search is too narrow or rows are too
    far off.

    Parameters
    ----------
    left, right
        Checked images of one size, with matched exposure.
    points
        Matches between them; if there are enough, they are used to align the rows first.
    """
    scale = min(1.0, COARSE_WIDTH / left.shape[1])
    height, width = (max(1, round(side * scale)) for side in left.shape[:2])
    coarse = [cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA) for image in (left, right)]
    count, first = 16 * max(1, -(-int((FARTHEST + NEAREST) * width) // 16)), -int(FARTHEST * width)
    ends: list[tuple[float, float]] = []
    if len(points) >= FEWEST_MATCHES:
        coarse[1] = _rows_aligned(coarse[1], points, scale)
        ends.append(disparities_of(points))
    framed = [cv2.copyMakeBorder(image, 8, 8, count + 8, 8 - first, cv2.BORDER_REPLICATE) for image in coarse]
    matcher = StereoSGBM(
        num_disparities=count,
        min_disparity=first,
        p2=1600,
        uniqueness_ratio=15,
        speckle_window_size=60,
        speckle_range=1,
    )
    found = matcher.compute(*framed).disparity[8:-8, count + 8 : count + 8 + width]
    seen = found[np.isfinite(found)]
    if seen.size >= FEWEST_MEASURED * found.size:
        far, near = (max(LEAST_TAIL, tail * (1 - seen.size / found.size)) for tail in (FAR_TAIL, NEAR_TAIL))
        low, high = np.percentile(seen, (far, 100 - near)) / scale
        ends.append((float(low), float(high)))
    return (min(low for low, _ in ends), max(high for _, high in ends)) if ends else None


def disparities_of(points: Correspondences) -> tuple[float, float]:
    """Return the range of the disparities of matched features, px, without a few outliers.

    Features with few neighbours of similar disparity do not count: a match with the wrong picket of a fence is on the
    same row as the right one, but can have any disparity.
    """
    disparities = -points.dx
    known = disparities[_supported(points)]
    if known.size < FEWEST_MATCHES:
        known = disparities
    tail = max(FEATURE_TAIL, 100 * FEATURES_LEFT_OUT / known.size)
    low, high = np.percentile(known, (tail, 100 - tail))
    return float(low), float(high)


def _supported(points: Correspondences) -> Chosen:
    """Return the mask of features that have enough neighbours of similar disparity."""
    _, found = scipy.spatial.cKDTree(points.left).query(points.left, k=min(NEIGHBOURS + 1, len(points)))
    near = np.asarray(found)[:, 1:]  # the first is the feature itself
    apart = np.abs(points.dx[near] - points.dx[:, np.newaxis])
    return np.asarray((apart <= ALIKE * points.shape[1]).sum(axis=1) >= LEAST_ALIKE)


def range_for(low: float, high: float) -> tuple[int, int]:
    """Return the search range for the disparities seen, with a margin; from 0 (infinity) if they begin near it."""
    margin = RANGE_MARGIN * max(high - low, 8.0)
    first = 0 if -INFINITY_SLACK_PX <= low - margin <= 16 or -INFINITY_SLACK_PX <= low <= 16 else int(low - margin)
    count = int(np.ceil(high + margin)) - first + 1
    return first, max(16, 16 * -(-count // 16))


def _rows_aligned(right: Image, points: Correspondences, scale: float) -> Image:
    """Return the coarse right image with its rows moved to match the left one; columns stay.

    A quadratic surface corrects the offset, roll and yaw of a raw pair, and most of the lens distortion.
    """
    size = points.shape[1]
    seen = np.column_stack([points.right[:, 0], points.left[:, 1]]) / size
    surface = robust_fit(_terms(seen), points.dy.astype(np.float64))
    rows, cols = np.indices(right.shape[:2])
    places = (np.column_stack([cols.ravel(), rows.ravel()]) + 0.5) / (scale * size)
    away = (_terms(places) @ surface).reshape(rows.shape) * scale
    if np.abs(away).max() <= COARSE_ROW_PX:
        return right
    x, y = (np.asarray(where, dtype=np.float32) for where in (cols, rows + away))
    return np.asarray(cv2.remap(right, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))


def _terms(places: Points | DoubleMap) -> DoubleMap:
    x, y = places.astype(np.float64).T
    return np.column_stack([np.ones(len(places)), x, y, x * x, x * y, y * y])


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
