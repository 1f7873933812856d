"""The range of disparities in a pair, from a coarse search and from matched features, and the search that covers it."""

from __future__ import annotations

import math

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.assess.features import FEWEST_MATCHES, Correspondences
from stereolag.assess.orientation import nearest_neighbours, robust_fit
from stereolag.core.arrays import DoubleMap, FloatMap, percentiles
from stereolag.core.inputs import Image
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

LEAST_WITHOUT_FEATURES = 0.4
"""Share of coarse pixels that must be measured if features do not tell that the images show one scene."""

GROUND_SHARE, GROUND_PERCENTILE = 0.12, 90.0
"""Lower share of the rows that show the nearest ground, and the percentile of its disparities that is searched."""

FEATURE_TAIL, FEATURES_LEFT_OUT = 2.0, 3
"""Percentage of features trimmed at each end, and their least number."""

NEIGHBOURS, LEAST_ALIKE, ALIKE = 8, 3, 0.01
"""Nearest features compared, number that must have the same disparity, and the tolerance as a share of the width."""

BEYOND_PX, FEW_BEYOND = -1.0, 0.03
"""Where features begin if none lies beyond infinity, and the share of pixels beyond it up to which they are wrong, as
in a sky."""
INFINITY_SLACK_PX = 4.0
"""Disparities no more than this below 0 still count as infinity on a rectified pair."""

RANGE_MARGIN = 0.15
"""Margin of the suggested range beyond the disparities seen, as a share of their span."""


def coarse_range(left: Image, right: Image, points: Correspondences | None) -> tuple[float, float] | None:
    """Return the range of disparities in a pair; None if neither pixels nor features reveal it.

    Combines a coarse semi-global search, far wider than any pair should need, with the matched features, by which the
    rows are aligned first; None with too few of them. Features alone would miss near objects, which fill few but
    important pixels; they help if the search is too narrow or rows are too far off. Both images have one exposure.
    """
    scale = min(1.0, COARSE_WIDTH / left.shape[1])
    coarse = [reduced(image, COARSE_WIDTH) for image in (left, right)]
    ends: list[tuple[float, float]] = []
    if points is not None:
        coarse[1] = _rows_aligned(coarse[1], points, scale)
        ends.append(disparities_of(points))
    found = quick_map(coarse[0], coarse[1])
    seen = found[np.isfinite(found)]
    share = seen.size / found.size
    if share >= (LEAST_WITHOUT_FEATURES if points is None else FEWEST_MEASURED):
        far, near = (max(LEAST_TAIL, tail * (1 - share)) for tail in (FAR_TAIL, NEAR_TAIL))
        low, high = percentiles(seen, far, 100 - near) / scale
        if (
            low < BEYOND_PX
            and ends
            and ends[0][0] >= BEYOND_PX
            and np.mean(seen < -INFINITY_SLACK_PX * scale) <= FEW_BEYOND
        ):
            low = ends[0][0]
        ends.append((float(low), max(float(high), _nearest_ground(found) / scale)))
    return (min(low for low, _ in ends), max(high for _, high in ends)) if ends else None


def reduced(image: Image, width: int) -> Image:
    """Return an image at most so wide."""
    scale = min(1.0, width / image.shape[1])
    height, width = (max(1, round(side * scale)) for side in image.shape[:2])
    return np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA))


def quick_map(left: Image, right: Image, nearest: float = NEAREST) -> FloatMap:
    """Return the disparities of small images, up to this share of their width, that pass all checks.

    Both are framed, so that the whole width is searched.
    """
    width = left.shape[1]
    count, first = 16 * max(1, -(-int((FARTHEST + nearest) * width) // 16)), -int(FARTHEST * width)
    framed = [cv2.copyMakeBorder(image, 8, 8, count + 8, 8 - first, cv2.BORDER_REPLICATE) for image in (left, right)]
    matcher = StereoSGBM(
        num_disparities=count,
        min_disparity=first,
        p2=1600,
        uniqueness_ratio=15,
        speckle_window_size=60,
        speckle_range=1,
    )
    return matcher.compute(*framed).disparity[8:-8, count + 8 : count + 8 + width]


def _nearest_ground(found: FloatMap) -> float:
    """Return the disparity of the ground at the lower edge, px; 0 if too little of it is measured.

    A bland road is measured at few pixels, so the nearest of it would be taken for wrong matches.
    """
    foot = found[-max(1, round(GROUND_SHARE * found.shape[0])) :]
    seen = foot[np.isfinite(foot)]
    return percentiles(seen, GROUND_PERCENTILE).item() if seen.size >= FEWEST_MEASURED * foot.size else 0.0


def disparities_of(points: Correspondences) -> tuple[float, float]:
    """Return the range of the disparities of matched features, px, without a few outliers.

    Features with few neighbours of similar disparity do not count: a match with the wrong picket of a fence is on the
    same row as the right one, but can have any disparity.
    """
    disparities = -points.dx
    near = nearest_neighbours(points.left, points.left, NEIGHBOURS + 1)[:, 1:]  # the first is the feature itself
    apart = np.abs(points.dx[near] - points.dx[:, np.newaxis])
    known = disparities[(apart <= ALIKE * points.shape[1]).sum(axis=1) >= LEAST_ALIKE]
    if known.size < FEWEST_MATCHES:
        known = disparities
    tail = max(FEATURE_TAIL, 100 * FEATURES_LEFT_OUT / known.size)
    low, high = percentiles(known, tail, 100 - tail)
    return float(low), float(high)


def range_for(low: float, high: float, width: int, repeats: float = 0.0) -> tuple[int, int]:
    """Return the search range for the disparities seen, with a margin; from 0 (infinity) if they begin near it.

    It is never wider than the picture, nor, where the picture repeats, than one repetition.
    """
    if repeats:
        # All repetitions fit; of a rectified pair only disparities from 0 on are possible.
        return 0, 16 * math.ceil(min(width - 15, repeats) / 16)
    margin = RANGE_MARGIN * max(high - low, 8.0)
    first = 0 if -INFINITY_SLACK_PX <= low - margin <= 16 or -INFINITY_SLACK_PX <= low <= 16 else int(low - margin)
    count = int(np.ceil(high + margin)) - first + 1
    return first, max(16, 16 * min(-(-count // 16), width // 16))


def _rows_aligned(right: Image, points: Correspondences, scale: float) -> Image:
    """Return the coarse right image with its rows moved to match the left one; columns stay.

    A quadratic surface corrects the offset, roll and yaw of a raw pair, and most of the lens distortion.
    """

    def terms(x: npt.NDArray[np.floating], y: npt.NDArray[np.floating]) -> DoubleMap:
        return np.column_stack([np.ones(len(x)), x, y, x * x, x * y, y * y])

    size = points.shape[1]
    seen = (np.column_stack([points.right[:, 0], points.left[:, 1]]) / size).astype(np.float64)
    surface = robust_fit(terms(*seen.T), points.dy.astype(np.float64))
    rows, cols = np.indices(right.shape[:2])
    x, y = ((at.ravel() + 0.5) / (scale * size) for at in (cols, rows))
    away = (terms(x, y) @ surface).reshape(rows.shape) * scale
    if np.abs(away).max() <= COARSE_ROW_PX:
        return right
    columns, lines = (np.asarray(where, dtype=np.float32) for where in (cols, rows + away))
    return np.asarray(cv2.remap(right, columns, lines, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))
