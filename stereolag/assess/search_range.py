"""The range of disparities in a pair, from a coarse search and matched features, and the search that covers it."""

from __future__ import annotations

import math

import cv2
import numpy as np

from stereolag.assess.features import MIN_MATCHES, Correspondences
from stereolag.assess.orientation import nearest_neighbours, robust_fit
from stereolag.core.arrays import Array, DoubleMap, FloatMap, percentiles
from stereolag.core.inputs import Image
from stereolag.stereo.opencv import StereoSGBM

COARSE_WIDTH_PX = 320
"""Width to which a pair is reduced for the coarse search, px."""

REACH_BEHIND = 0.12
"""Reach of the coarse search behind infinity, as a share of the width."""

REACH_IN_FRONT = 0.28
"""Reach of the coarse search in front of infinity, as a share of the width."""

END_PARTS = 16
"""Part of the search, at either end, in which patches that reach the end are no matches."""

MAX_COARSE_ROW_ERROR_PX = 0.5
"""Row errors up to this size in the coarse images are left uncorrected, px."""

MIN_MEASURED_SHARE = 0.02
"""Share of coarse pixels that must be matched for the search to count."""

MIN_MEASURED_WITHOUT_FEATURES = 0.4
"""The same if no features show that the images are of one scene."""

MIN_TAIL_PERCENT = 0.5
"""Percentage of disparities trimmed at either end, at least."""

FAR_TAIL_PERCENT, NEAR_TAIL_PERCENT = 10.0, 5.0
"""Percentages trimmed at the far and near ends, times the share not measured: the fewer pixels can be matched, the more
matches are wrong. Missing near objects hurts more."""

GROUND_ROWS_SHARE = 0.12
"""Share of the rows, at the lower edge, that show the nearest ground."""

GROUND_PERCENTILE = 90.0
"""Percentile of the ground's disparities that is searched."""

FEATURE_TAIL_PERCENT = 2.0
"""Percentage of features trimmed at either end."""

MIN_FEATURES_TRIMMED = 3
"""Number of features trimmed at either end, at least."""

NEIGHBOURS = 8
"""Number of nearest features with which the disparity of a feature is compared."""

MIN_SIMILAR_NEIGHBOURS = 3
"""Number of these that must have a similar disparity."""

MAX_SIMILAR_DIFFERENCE = 0.01
"""Difference between similar disparities, as a share of the width."""

MIN_FEATURE_DISPARITY_PX = -1.0
"""Smallest disparity of features if none is beyond infinity, px."""

MAX_SHARE_BEYOND_INFINITY = 0.03
"""Share of pixels beyond infinity up to which they are wrong matches, as in a sky."""

INFINITY_SLACK_PX = 4.0
"""Disparities no more than this below 0 still count as infinity on a rectified pair, px."""

RANGE_MARGIN = 0.15
"""Margin of the suggested range beyond the measured disparities, as a share of their span."""


def coarse_range(left: Image, right: Image, points: Correspondences | None) -> tuple[float, float] | None:
    """Return the range of disparities in a pair; None if neither pixels nor features show it.

    Combines a coarse semi-global search, far wider than any pair should need, with the range of the matched features,
    by which the rows are aligned first. Features alone would miss near objects, which fill few but important pixels;
    they help if the search is too narrow or rows are too far off.

    Parameters
    ----------
    left, right
        Images of equal exposure.
    points
        The matched features; None if there are too few.
    """
    scale = min(1.0, COARSE_WIDTH_PX / left.shape[1])
    coarse = [reduced(image, COARSE_WIDTH_PX) for image in (left, right)]
    ends: list[tuple[float, float]] = []
    if points is not None:
        coarse[1] = _rows_aligned(coarse[1], points, scale)
        ends.append(disparities_of(points))
    disparity = quick_map(coarse[0], coarse[1], ends=False)
    measured = disparity[np.isfinite(disparity)]
    share = measured.size / disparity.size
    if share >= (MIN_MEASURED_WITHOUT_FEATURES if points is None else MIN_MEASURED_SHARE):
        far, near = (max(MIN_TAIL_PERCENT, tail * (1 - share)) for tail in (FAR_TAIL_PERCENT, NEAR_TAIL_PERCENT))
        low, high = percentiles(measured, far, 100 - near) / scale
        if (
            low < MIN_FEATURE_DISPARITY_PX
            and ends
            and ends[0][0] >= MIN_FEATURE_DISPARITY_PX
            and np.mean(measured < -INFINITY_SLACK_PX * scale) <= MAX_SHARE_BEYOND_INFINITY
        ):
            low = ends[0][0]
        ends.append((float(low), max(float(high), _nearest_ground(disparity) / scale)))
    return (min(low for low, _ in ends), max(high for _, high in ends)) if ends else None


def reduced(image: Image, width: int) -> Image:
    """Return an image reduced to a width, px, if it is wider."""
    scale = min(1.0, width / image.shape[1])
    height, width = (max(1, round(side * scale)) for side in image.shape[:2])
    return np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA))


def quick_map(left: Image, right: Image, reach: float = REACH_IN_FRONT, *, ends: bool = True) -> FloatMap:
    """Return the disparities of small images, up to `reach` of their width, that pass all checks.

    Both are framed, so that the whole width is searched. Without `ends`, patches that reach an end of the search are
    left out: bland ones are matched there, and around it, as disparities change smoothly.
    """
    width, first = left.shape[1], -int(REACH_BEHIND * left.shape[1])
    count = 16 * max(1, math.ceil(int((REACH_BEHIND + reach) * width) / 16))
    framed = [cv2.copyMakeBorder(image, 8, 8, count + 8, 8 - first, cv2.BORDER_REPLICATE) for image in (left, right)]
    matcher = StereoSGBM(
        num_disparities=count,
        min_disparity=first,
        p2=1600,
        uniqueness_ratio=15,
        speckle_window_size=60,
        speckle_range=1,
    )
    disparity = matcher.compute(*framed).disparity[8:-8, count + 8 : count + 8 + width]
    if ends:
        return disparity
    distance = np.fmin(disparity - first, first + count - 1 - disparity)
    _, parts = cv2.connectedComponents((distance < count / END_PARTS).astype(np.uint8), connectivity=4)
    at_end = np.isin(parts, parts[distance < 2]) & (parts > 0)
    return np.where(at_end, np.float32(np.nan), disparity)


def _nearest_ground(disparity: FloatMap) -> float:
    """Return the disparity of the ground at the lower edge, px; 0 if too little of it is measured.

    A bland road is measured at few pixels, so that its nearest part would be trimmed as wrong matches.
    """
    ground = disparity[-max(1, round(GROUND_ROWS_SHARE * disparity.shape[0])) :]
    known = ground[np.isfinite(ground)]
    return percentiles(known, GROUND_PERCENTILE).item() if known.size >= MIN_MEASURED_SHARE * ground.size else 0.0


def disparities_of(points: Correspondences) -> tuple[float, float]:
    """Return the range of the disparities of matched features, px, without a few outliers.

    Features with few neighbours of similar disparity are ignored: a match with the wrong picket of a fence is on the
    right row, but may have any disparity.
    """
    disparities = -points.dx
    near = nearest_neighbours(points.left, points.left, NEIGHBOURS + 1)[:, 1:]  # the first is the feature itself
    similar = np.abs(points.dx[near] - points.dx[:, np.newaxis]) <= MAX_SIMILAR_DIFFERENCE * points.shape[1]
    reliable = disparities[similar.sum(axis=1) >= MIN_SIMILAR_NEIGHBOURS]
    if reliable.size < MIN_MATCHES:
        reliable = disparities
    tail = max(FEATURE_TAIL_PERCENT, 100 * MIN_FEATURES_TRIMMED / reliable.size)
    low, high = percentiles(reliable, tail, 100 - tail)
    return float(low), float(high)


def range_for(low: float, high: float, width: int, repeats: float = 0.0) -> tuple[int, int]:
    """Return the search range (first disparity, number) for disparities `low` to `high`, with a margin, px.

    It starts at 0 (infinity) if `low` is near it, and is never wider than the picture or, where the picture repeats,
    than the distance of its repetition.
    """
    if repeats:
        # Disparities one repetition apart fit equally well; those of a rectified pair are 0 or more.
        return 0, 16 * math.ceil(min(width - 15, repeats) / 16)
    margin = RANGE_MARGIN * max(high - low, 8.0)
    first = 0 if -INFINITY_SLACK_PX <= low - margin <= 16 or -INFINITY_SLACK_PX <= low <= 16 else int(low - margin)
    count = int(np.ceil(high + margin)) - first + 1
    return first, max(16, 16 * min(-(-count // 16), width // 16))


def _rows_aligned(right: Image, points: Correspondences, scale: float) -> Image:
    """Return the coarse right image with its rows moved to match the left one; columns stay.

    A quadratic surface corrects the offset, roll and yaw of a raw pair, and most of the lens distortion.
    """

    def terms(x: Array, y: Array) -> DoubleMap:
        return np.column_stack([np.ones(len(x)), x, y, x * x, x * y, y * y])

    size = points.shape[1]
    positions = (np.column_stack([points.right[:, 0], points.left[:, 1]]) / size).astype(np.float64)
    surface = robust_fit(terms(*positions.T), points.dy.astype(np.float64))
    rows, cols = np.indices(right.shape[:2])
    x, y = ((index.ravel() + 0.5) / (scale * size) for index in (cols, rows))
    dy = (terms(x, y) @ surface).reshape(rows.shape) * scale
    if np.abs(dy).max() <= MAX_COARSE_ROW_ERROR_PX:
        return right
    source_x, source_y = (np.asarray(index, dtype=np.float32) for index in (cols, rows + dy))
    return np.asarray(cv2.remap(right, source_x, source_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))
