"""The disparities in a pair, rectified or not, and the range to search for them."""

from __future__ import annotations

import cv2
import numpy as np
import scipy  # its spatial.* is not loaded before it is used

from stereolag.arrays import DoubleMap
from stereolag.doctor.features import Chosen, Correspondences, Points
from stereolag.doctor.findings import FEWEST_MATCHES, INFINITY_SLACK_PX
from stereolag.doctor.rows import robust_fit
from stereolag.inputs import Image
from stereolag.stereo.opencv import StereoSGBM

COARSE_WIDTH = 320
"""Width to which a pair is reduced to look for its range of disparities, px."""

FARTHEST, NEAREST = 0.12, 0.28
"""Ends of the coarse search, as shares of the width: behind infinity and in front of it."""

COARSE_ROW_PX = 0.5
"""Rows that are no farther off than this in the coarse images are left alone."""

FEWEST_MEASURED = 0.02
"""Share of the coarse pixels without which nothing was measured."""

LEAST_TAIL, FAR_TAIL, NEAR_TAIL = 0.5, 10.0, 5.0
"""Percentage of the disparities left out at each end, and how it grows with the share that was not measured: where much
cannot be matched, more of what is matched is wrong. Near objects that are missed hurt more."""

FEATURE_TAIL, FEATURES_LEFT_OUT = 2.0, 3
"""Percentage of the features left out at each end, and how many at least."""

NEIGHBOURS, LEAST_ALIKE, ALIKE = 8, 3, 0.01
"""Of so many nearest features so many must have the same disparity, but for this share of the width."""

RANGE_MARGIN = 0.15
"""How far beyond the disparities seen the suggested range reaches, as a share of their span."""


def disparities_seen(left: Image, right: Image, points: Correspondences) -> tuple[float, float] | None:
    """Return the range of disparities in a pair, px; None where neither pixels nor features tell.

    A coarse semi-global search far wider than any pair should need, for sparse matches would miss near objects, which
    fill few but important pixels; and the features, where that search is not wide enough or rows are too far off.

    Parameters
    ----------
    left, right
        Checked images of one size, exposed alike.
    points
        Matches between them; where there are enough, rows are aligned by them first.
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
    """Return the range of the disparities of matched features, px, but for a few of them.

    Features with few neighbours of their disparity do not count: matches with another picket of a fence lie along the
    row as right ones do, but at all distances.
    """
    disparities = -points.dx
    known = disparities[_supported(points)]
    if known.size < FEWEST_MATCHES:
        known = disparities
    tail = max(FEATURE_TAIL, 100 * FEATURES_LEFT_OUT / known.size)
    low, high = np.percentile(known, (tail, 100 - tail))
    return float(low), float(high)


def _supported(points: Correspondences) -> Chosen:
    """Return which features have enough neighbours with about their disparity."""
    _, found = scipy.spatial.cKDTree(points.left).query(points.left, k=min(NEIGHBOURS + 1, len(points)))
    near = np.asarray(found)[:, 1:]  # the first is the feature itself
    apart = np.abs(points.dx[near] - points.dx[:, np.newaxis])
    return np.asarray((apart <= ALIKE * points.shape[1]).sum(axis=1) >= LEAST_ALIKE)


def range_for(low: float, high: float) -> tuple[int, int]:
    """Return the range to search for the disparities seen, with a margin; from 0 (infinity) if they begin near it."""
    margin = RANGE_MARGIN * max(high - low, 8.0)
    first = 0 if -INFINITY_SLACK_PX <= low - margin <= 16 or -INFINITY_SLACK_PX <= low <= 16 else int(low - margin)
    count = int(np.ceil(high + margin)) - first + 1
    return first, max(16, 16 * -(-count // 16))


def _rows_aligned(right: Image, points: Correspondences, scale: float) -> Image:
    """Return the coarse right image with its rows moved to those of the left one; columns stay.

    A surface of the second degree takes the offset, the rotation and the turn of a raw pair, and most of a lens.
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
