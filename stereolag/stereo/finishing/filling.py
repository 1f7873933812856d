"""Filling of gaps along their rows, from the measurements around their two ends."""

from __future__ import annotations

from typing import Any

import numpy as np

from stereolag.core.arrays import Array, FloatMap, ReasonMap
from stereolag.loops.bands import over_bands
from stereolag.loops.compilation import compiled
from stereolag.loops.memory import fill
from stereolag.loops.vector_lanes import item
from stereolag.stereo.matcher import Reason

END_COLS = 6
"""Columns, away from the gap, of the surface at an end of a gap."""

END_ROWS = 3
"""Rows of that surface, both up and down."""

MIN_AVERAGED_GAP_PX = 4
"""Width from which the surface at an end is averaged, px. Narrower gaps use their end pixels alone: they are many, and
a mean gains nothing."""

MAX_SURFACE_STEP_PX = 4.0
"""Largest difference between a pixel of a surface and the end of the gap, px of disparity."""

SLANT_COLS = 24
"""Columns, to the right of the gap, of the surface that is continued to the left edge."""

SLANT_ROWS = 12
"""Rows of that surface, both up and down."""

MAX_SLANT = 0.1
"""Largest slant of that surface, px of disparity per column."""

MIN_SLANT_COVERAGE = 0.85
"""Share of that surface that must be measured to continue its slant; the slant of a ragged surface is misleading."""

FILLED = np.uint8(Reason.FILLED)


def filled_from_ends(disparity: FloatMap, reason: ReasonMap) -> tuple[FloatMap, ReasonMap]:
    """Return the map with the gaps of each row filled from the farther of the surfaces at their two ends.

    The surface at an end is the mean of the measurements near it: a single pixel is noisy and causes stripes. The gap
    at the left edge, which the right camera does not see, continues the slant of the surface beside it if that is well
    measured, but no farther than the farthest measurement in the map. A row without a value stays NaN.

    Parameters
    ----------
    disparity
        (H, W) float32 px; NaN = none.
    reason
        (H, W) uint8; FILLED in the result wherever nothing was measured.
    """
    out, reasons = np.empty_like(disparity), np.empty_like(reason)
    farthest = np.fmin.reduce(disparity, axis=None)

    def fill_rows(first: int, end: int) -> None:
        out[first:end], reasons[first:end] = disparity[first:end], reason[first:end]
        fill_between_ends(disparity, farthest, first, end, out, reasons)

    over_bands(fill_rows, len(out))
    return out, reasons


@compiled(counted=False)
def fill_between_ends(disparity: Array, farthest: Any, first: int, end: int, out: Array, reason: Array) -> None:
    """Fill the gaps of rows `first` to `end`. Equals :func:`fill_between_ends_reference`."""
    width = disparity.shape[1]
    for y in range(first, end):
        start = 0
        for x in range(width + 1):
            if x < width and np.isnan(disparity[y, x]):
                continue
            if start < x:
                fill(reason[y, start:x], FILLED)
            if start < x and not (start == 0 and x == width):
                value = np.float32(np.inf)
                averaged = x - start >= MIN_AVERAGED_GAP_PX
                if start > 0:
                    value = _surface(disparity, y, start - 1, -1) if averaged else disparity[y, start - 1]
                if x < width:
                    value = min(value, _surface(disparity, y, x, 1) if averaged else disparity[y, x])
                slant = _slant(disparity, y, x, value) if start == 0 else np.float32(0)
                # The mean of a surface is its value at its middle.
                middle = np.float32(x + (END_COLS - 1) / 2 if averaged else x)
                for gap in range(start, x):
                    out[y, gap] = max(value - slant * (middle - np.float32(gap)), farthest)
            start = x + 1


@compiled(fastmath={"reassoc", "contract"}, counted=False)
def _surface(disparity: Array, y: int, x: int, inward: int) -> np.float32:
    """Return the mean of the measurements near an end of a gap that are close to the end in disparity."""
    height, width = disparity.shape
    left = x if inward > 0 else max(0, x - END_COLS + 1)
    right = min(width, x + END_COLS) if inward > 0 else x + 1
    end = disparity[y, x]
    total, count = np.float32(0), np.float32(0)
    for row in range(max(0, y - END_ROWS), min(height, y + END_ROWS + 1)):
        for place in range(row * width + left, row * width + right):
            step = item(disparity, place) - end
            belongs = abs(step) <= np.float32(MAX_SURFACE_STEP_PX)  # false for NaN
            total += step if belongs else np.float32(0)
            count += np.float32(1) if belongs else np.float32(0)
    return np.float32(end + total / count)


@compiled(fastmath={"reassoc", "contract"}, counted=False)
def _slant(disparity: Array, y: int, x: int, value: Any) -> np.float32:
    """Return the slant per column of the plane fitted to the right of (y, x); 0 where too little was measured."""
    height, width = disparity.shape
    top, bottom, right = max(0, y - SLANT_ROWS), min(height, y + SLANT_ROWS + 1), min(width, x + SLANT_COLS)
    n: Any = 0.0
    sx = sy = sz = sxx = sxy = syy = sxz = syz = n
    for row in range(top, bottom):
        v, begin = float(row - y), row * width + x
        # The sums of a row depend on the columns only; without branches the loop vectorises.
        m = mu = muu = mz = muz = np.float32(0)
        for col in range(right - x):
            step, u = item(disparity, begin + col) - np.float32(value), np.float32(col)
            belongs = abs(step) <= np.float32(MAX_SURFACE_STEP_PX)
            w, z = np.float32(1) if belongs else np.float32(0), step if belongs else np.float32(0)
            m, mu, muu, mz, muz = m + w, mu + w * u, muu + w * u * u, mz + z, muz + u * z
        n, sx, sy, sz = n + m, sx + mu, sy + v * m, sz + mz
        sxx, sxy, syy = sxx + muu, sxy + v * mu, syy + v * v * m
        sxz, syz = sxz + muz, syz + v * mz
    if n < MIN_SLANT_COVERAGE * (bottom - top) * SLANT_COLS:
        return np.float32(0)
    cxx, cxy, cyy = sxx - sx * sx / n, sxy - sx * sy / n, syy - sy * sy / n
    cxz, cyz = sxz - sx * sz / n, syz - sy * sz / n
    scale = cxx * cyy - cxy * cxy
    if scale <= 0:
        return np.float32(0)
    return np.float32(min(max((cxz * cyy - cyz * cxy) / scale, -MAX_SLANT), MAX_SLANT))


def fill_between_ends_reference(disparity: FloatMap) -> FloatMap:
    """Return the expected result of :func:`fill_between_ends` for all rows, up to rounding, with plain NumPy."""
    out = disparity.copy()

    def surface(y: int, x: int, cols: slice) -> Any:
        around = disparity[max(0, y - END_ROWS) : y + END_ROWS + 1, cols]
        return around[np.abs(around - disparity[y, x]) <= MAX_SURFACE_STEP_PX].mean(dtype=np.float64)

    def slant(y: int, x: int, value: float) -> float:
        top = max(0, y - SLANT_ROWS)
        steps = disparity[top : y + SLANT_ROWS + 1, x : x + SLANT_COLS] - value
        rows, cols = np.nonzero(np.abs(steps) <= MAX_SURFACE_STEP_PX)
        if len(rows) < MIN_SLANT_COVERAGE * len(steps) * SLANT_COLS:
            return 0.0
        terms = np.column_stack([cols, rows, np.ones(len(rows))])
        return float(np.clip(np.linalg.lstsq(terms, steps[rows, cols])[0][0], -MAX_SLANT, MAX_SLANT))

    width = disparity.shape[1]
    for y, row in enumerate(disparity):
        edges = np.flatnonzero(np.diff(np.isnan(row), prepend=False, append=False))
        for start, x in edges.reshape(-1, 2):
            if x - start < MIN_AVERAGED_GAP_PX:
                ends = [row[place] for place in (start - 1, x) if 0 <= place < width]
            else:
                ends = [surface(y, start - 1, slice(max(0, start - END_COLS), start))] if start > 0 else []
                ends += [surface(y, x, slice(x, x + END_COLS))] if x < width else []
            if ends:
                distance = np.arange(x - start, 0, -1) + (0 if x - start < MIN_AVERAGED_GAP_PX else (END_COLS - 1) / 2)
                slanted = min(ends) - (slant(y, x, min(ends)) * distance if start == 0 else 0)
                out[y, start:x] = np.maximum(slanted, np.nanmin(disparity))
    return out


def filled_from_behind(disparity: FloatMap, reason: ReasonMap) -> tuple[FloatMap, ReasonMap]:
    """Return the map with every gap filled.

    A gap takes the smaller disparity of its two ends along the row (`filled_from_ends`): areas hidden from one camera
    belong to the farther surface, and the ground, to which most gaps in street scenes belong, has one depth along a
    row. Filling from eight or sixteen directions was worse there. A row without any measurement repeats the nearest row
    that has one.

    Parameters
    ----------
    disparity
        (H, W) float32 px; NaN = none.
    reason
        (H, W) uint8.

    Returns
    -------
    tuple of ndarray
        The map, and its reasons with FILLED where it was filled. A map without any measurement is returned unchanged.
    """
    filled, reasons = filled_from_ends(disparity, reason)
    known = np.flatnonzero(np.isfinite(filled[:, 0]))
    if known.size == 0:
        return disparity, reason
    rows, halfway = np.flatnonzero(np.isnan(filled[:, 0])), (known[:-1] + known[1:]) / 2
    filled[rows] = filled[known[np.searchsorted(halfway, rows)]]
    return filled, reasons
