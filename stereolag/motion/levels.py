"""One level of optical flow: its images, and the smoothing and the tests of the flow."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import Any

import cv2
import numpy as np
from pydantic import Field

from stereolag.core.arrays import Array, EightBit, FloatMap
from stereolag.core.inputs import Image
from stereolag.core.settings import Settings
from stereolag.loops.bands import over_image
from stereolag.loops.compilation import compiled
from stereolag.loops.vector_lanes import item
from stereolag.motion.candidates import HALF, Flow


@dataclass(frozen=True, eq=False)
class Frame:
    """One frame at one pyramid level.

    Attributes
    ----------
    grey
        (H, W) image to correlate.
    guide
        (H, W) uint8 image at whose edges the smoothing stops.
    grey_level
        One grey level of 255 in the units of `grey`.
    """

    grey: Image
    guide: EightBit
    grey_level: float

    @property
    def shape(self) -> tuple[int, int]:
        """Return (rows, cols)."""
        return self.guide.shape[0], self.guide.shape[1]

    def pyramid(self, levels: int) -> list[Frame]:
        """Return the frame at each level, finest first, each half as large as the one before."""
        frames = [self]
        for _ in range(levels - 1):
            last = frames[-1]
            guide: EightBit = np.asarray(cv2.pyrDown(last.guide), np.uint8)
            grey = guide if last.grey is last.guide else cv2.pyrDown(last.grey)
            frames.append(Frame(grey, guide, self.grey_level))
        return frames


def count_levels(shape: tuple[int, int], window: int, search: int, max_levels: int) -> int:
    """Return the number of useful levels: at the coarsest, three windows fit and the search exceeds 2 px."""
    levels, side = 1, min(shape)
    while levels < max_levels and side // 2 >= 3 * window and search >> levels > 2:
        levels, side = levels + 1, (side + 1) // 2
    return levels


def doubled(flow: Flow, shape: tuple[int, int]) -> Flow:
    """Return a flow scaled up to the next finer level, of a given (rows, cols)."""
    return np.stack([cv2.resize(part, shape[::-1], interpolation=cv2.INTER_LINEAR) for part in flow * np.float32(2)])


SMOOTHING_PX = 4.0
"""Standard deviation of the averaging kernel on a uniform surface, px."""

EDGE_LEVELS = 15.0
"""Height of an edge that counts as much as a distance of :data:`SMOOTHING_PX`, grey levels of 255."""

MIN_WEIGHT = np.float32(1e-6)
"""Least weight of a pixel, so that even an area without any reliable pixel has a mean."""


def edge_aware_mean(flow: Flow, weight: FloatMap, guide: EightBit) -> Flow:
    """Return the weighted mean of the flow around every pixel, over neighbours on the same image surface.

    Pixels without weight are filled from those with weight, however far away: a neighbour's share falls with its
    distance along the surface, which edges of the guide increase (normalised convolution with the recursive filter of
    Gastal & Oliveira, "Domain transform for edge-aware image and video processing", 2011).

    Parameters
    ----------
    flow
        (2, H, W) px, finite.
    weight
        (H, W) float32, at least 0.
    guide
        (H, W) uint8.
    """
    distance = 1 + SMOOTHING_PX / EDGE_LEVELS * np.arange(256)
    share_of = np.exp(-math.sqrt(2) / SMOOTHING_PX * distance).astype(np.float32)
    positive = np.maximum(weight, MIN_WEIGHT)
    planes = np.empty((3, *guide.shape), np.float32)
    np.multiply(flow, positive, out=planes[:2])
    planes[2] = positive
    over_image(partial(_along_rows, planes, guide, share_of), guide.shape)
    over_image(partial(_along_columns, planes, guide, share_of), guide.shape[::-1])
    return np.asarray(np.divide(planes[:2], planes[2], out=planes[:2]))


@compiled(fastmath={"reassoc", "contract"})
def _along_rows(planes: Array, guide: Array, share_of: Array, first: int, end: int) -> None:
    """Filter rows `first` to `end` in both directions.

    Each pixel passes a share of its value to the next, ``share_of[height of the edge between them]``.
    """
    cols = guide.shape[1]
    share = np.empty(cols, np.float32)
    for row in range(first, end):
        for col in range(1, cols):
            share[col] = share_of[abs(np.int64(guide[row, col]) - np.int64(guide[row, col - 1]))]
        # Only one fused step of the processor waits for the pixel before.
        a, b, c = planes[0, row], planes[1, row], planes[2, row]
        last_a, last_b, last_c = a[0], b[0], c[0]
        for col in range(1, cols):
            passed, own = share[col], np.float32(1) - share[col]
            last_a = own * a[col] + passed * last_a
            last_b = own * b[col] + passed * last_b
            last_c = own * c[col] + passed * last_c
            a[col], b[col], c[col] = last_a, last_b, last_c
        for back in range(1, cols):
            col = cols - 1 - back
            passed, own = share[col + 1], np.float32(1) - share[col + 1]
            last_a = own * a[col] + passed * last_a
            last_b = own * b[col] + passed * last_b
            last_c = own * c[col] + passed * last_c
            a[col], b[col], c[col] = last_a, last_b, last_c


@compiled(fastmath={"reassoc", "contract"})
def _along_columns(planes: Array, guide: Array, share_of: Array, first: int, end: int) -> None:
    """Filter columns `first` to `end` in both directions, row by row to follow the memory layout."""
    rows = guide.shape[0]
    share = np.empty(end - first, np.float32)
    for row in range(1, rows):
        _set_shares(guide, row, share_of, first, share)
        for plane in range(3):
            _pass_on(planes[plane, row - 1, first:end], planes[plane, row, first:end], share)
    for back in range(1, rows):
        row = rows - 1 - back
        _set_shares(guide, row + 1, share_of, first, share)
        for plane in range(3):
            _pass_on(planes[plane, row + 1, first:end], planes[plane, row, first:end], share)


@compiled
def _set_shares(guide: Array, row: int, share_of: Array, first: int, share: Array) -> None:
    """Set the shares passed between a row and the one above it."""
    for col in range(share.size):
        share[col] = share_of[abs(np.int64(guide[row, first + col]) - np.int64(guide[row - 1, first + col]))]


@compiled(fastmath={"reassoc", "contract"})
def _pass_on(source: Array, target: Array, share: Array) -> None:
    """Set ``target = share * source + (1 - share) * target``."""
    for col in range(target.size):
        target[col] += share[col] * (source[col] - target[col])


def edge_aware_mean_reference(flow: Flow, weight: FloatMap, guide: EightBit) -> Flow:
    """Return the result of :func:`edge_aware_mean` up to rounding, computed line by line in float64 for reference."""
    positive = np.maximum(weight, MIN_WEIGHT).astype(np.float64)
    planes = np.stack([flow[0] * positive, flow[1] * positive, positive])
    levels: Any = guide.astype(np.float64)
    for axis in (2, 1):
        line, edges = np.moveaxis(planes, axis, 0), np.moveaxis(levels, axis - 1, 0)
        share = np.exp(-math.sqrt(2) / SMOOTHING_PX * (1 + SMOOTHING_PX / EDGE_LEVELS * np.abs(np.diff(edges, axis=0))))
        for place in range(1, len(line)):
            line[place] += share[place - 1] * (line[place - 1] - line[place])
        for place in range(len(line) - 2, -1, -1):
            line[place] += share[place] * (line[place + 1] - line[place])
    return np.asarray(planes[:2] / planes[2], dtype=np.float32)


NO_RETURN_PX = np.float32(1e4)
"""Return error where the flow leads out of the frame, px."""


class ForwardBackwardCheck(Settings):
    """Requires that a pixel followed to the second frame and back returns to its start."""

    tolerance: float = Field(
        default=1.5,
        title="Forward-backward tolerance",
        description="How far from its start a pixel may end when matched to the second frame and back, px. Pixels that "
        "fail are mostly hidden in the second frame.",
        gt=0,
        le=64,
        json_schema_extra={"step": 0.5},
    )


class MedianTest(Settings):
    """Requires a displacement to be similar to its neighbours (universal median test of particle image velocimetry)."""

    threshold: float = Field(
        default=6.0,
        title="Median test",
        description="How far a displacement may differ from the median of its eight neighbours, as a multiple of "
        "their own median deviation. 2 is usual for particles; photographs have edges of motion and need more.",
        gt=0,
        le=100,
        json_schema_extra={"step": 0.5},
    )
    noise: float = Field(
        default=0.3,
        title="Median test: noise",
        description="Fluctuation allowed where all neighbours agree, px.",
        gt=0,
        le=10,
        json_schema_extra={"step": 0.1},
    )


def return_error(flow: Flow, back: Flow) -> FloatMap:
    """Return the (H, W) distance of every pixel from its start after following both flows, there and back, px.

    Parameters
    ----------
    flow
        From the first frame to the second.
    back
        From the second frame to the first.
    """
    error = np.empty(flow.shape[1:], np.float32)
    over_image(partial(_return_rows, flow, back, error), error.shape)
    return error


@compiled
def _return_rows(flow: Flow, back: Flow, error: FloatMap, first: int, end: int) -> None:
    """Set the errors of rows `first` to `end`; the flow back is that of the pixel nearest to the end point."""
    height, width = error.shape
    lowest, rightmost = np.float32(height - 1), np.float32(width - 1)
    nearest, inside = np.empty(width, np.int32), np.empty(width, np.bool_)
    for row in range(first, end):
        for col in range(width):
            y, x = flow[0, row, col] + np.float32(row), flow[1, row, col] + np.float32(np.int32(col))
            inside[col] = (y >= -HALF) & (y <= lowest + HALF) & (x >= -HALF) & (x <= rightmost + HALF)
            y, x = min(max(y, np.float32(0)), lowest), min(max(x, np.float32(0)), rightmost)
            nearest[col] = np.int32(np.rint(y)) * np.int32(width) + np.int32(np.rint(x))
        for col in range(width):
            place = np.int64(nearest[col])
            dy = flow[0, row, col] + item(back, place)
            dx = flow[1, row, col] + item(back, place + height * width)
            distance = np.sqrt(dy * dy + dx * dx)
            error[row, col] = distance if inside[col] else NO_RETURN_PX


def median_residual(flow: Flow, spacing: int, noise: float) -> FloatMap:
    """Return the deviation of each displacement from the median of its eight neighbours, in units of their scatter.

    Parameters
    ----------
    flow
        (2, H, W) px.
    spacing
        Distance to the neighbours, px: windows that share most of their pixels are not independent evidence.
    noise
        Noise level added to the scatter, px.

    Returns
    -------
    ndarray
        (H, W) float32, both components combined; above about 2 for an outlier.

    Notes
    -----
    J. Westerweel & F. Scarano, "Universal outlier detection for PIV data", Experiments in Fluids 39, 2005. The flow is
    mirrored at its borders.
    """
    out = np.zeros(flow.shape[1:], np.float32)
    for part in flow:
        framed = cv2.copyMakeBorder(part, spacing, spacing, spacing, spacing, cv2.BORDER_REFLECT_101)
        over_image(partial(_add_squares, framed, spacing, np.float32(noise), out), out.shape)
    return np.asarray(np.sqrt(out))


@compiled
def _median_of_eight(a: Any, b: Any, c: Any, d: Any, e: Any, f: Any, g: Any, h: Any) -> Any:
    """Return the mean of the middle two of eight numbers, by a branch-free sorting network without its last step."""
    a, c = min(a, c), max(a, c)
    b, d = min(b, d), max(b, d)
    e, g = min(e, g), max(e, g)
    f, h = min(f, h), max(f, h)
    a, e = min(a, e), max(a, e)
    b, f = min(b, f), max(b, f)
    c, g = min(c, g), max(c, g)
    d, h = min(d, h), max(d, h)
    b = max(a, b)
    c, d = min(c, d), max(c, d)
    e, f = min(e, f), max(e, f)
    g = min(g, h)
    c, e = min(c, e), max(c, e)
    d, f = min(d, f), max(d, f)
    e = max(b, e)
    d = min(d, g)
    return HALF * (max(c, d) + min(e, f))


@compiled
def _add_squares(part: Array, spacing: int, noise: Any, out: Array, first: int, end: int) -> None:
    """Add the squared residuals of one component to rows `first` to `end`."""
    for row in range(first, end):
        above, own, below = part[row], part[row + spacing], part[row + 2 * spacing]
        for col in range(out.shape[1]):
            right = col + 2 * spacing
            a, b, c = above[col], above[col + spacing], above[right]
            d, e = own[col], own[right]
            f, g, h = below[col], below[col + spacing], below[right]
            median = _median_of_eight(a, b, c, d, e, f, g, h)
            scatter = _median_of_eight(
                abs(a - median),
                abs(b - median),
                abs(c - median),
                abs(d - median),
                abs(e - median),
                abs(f - median),
                abs(g - median),
                abs(h - median),
            )
            residual = (own[col + spacing] - median) / (scatter + noise)
            out[row, col] += residual * residual


def median_residual_reference(flow: Flow, spacing: int, noise: float) -> FloatMap:
    """Return the result of :func:`median_residual`, computed with NumPy's median as a reference."""
    rows, cols = flow.shape[1:]
    padded = np.pad(flow, ((0, 0), (spacing, spacing), (spacing, spacing)), mode="reflect")
    shifts = [(y, x) for y in (0, spacing, 2 * spacing) for x in (0, spacing, 2 * spacing) if (y, x) != (spacing,) * 2]
    around = np.stack([padded[:, y : y + rows, x : x + cols] for y, x in shifts])
    median = np.median(around, axis=0)
    scatter = np.median(np.abs(around - median), axis=0)
    return np.asarray(np.hypot(*((flow - median) / (scatter + noise))), dtype=np.float32)
