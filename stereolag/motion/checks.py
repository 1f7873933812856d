"""Checks of displacements: the forward-backward check and the median test."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from pydantic import Field

from stereolag.core.arrays import Array, FloatMap
from stereolag.core.settings import Settings
from stereolag.loops.bands import over_bands
from stereolag.loops.compilation import compiled
from stereolag.motion.pyramid import Flow, places

FAR_OFF = 1e4
"""Return error assigned where no way back exists, px."""

HALF = np.float32(0.5)


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
    """Return how far from its start every pixel ends after following both flows, there and back, (H, W) px.

    Parameters
    ----------
    flow
        From the first frame to the second.
    back
        From the second frame to the first.
    """
    row, col = places(flow)
    returned = [
        cv2.remap(part, col, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=FAR_OFF)
        for part in back
    ]
    return np.asarray(np.hypot(flow[0] + returned[0], flow[1] + returned[1]))


def median_residual(flow: Flow, spacing: int, noise: float) -> FloatMap:
    """Return how far each displacement lies from the median of its eight neighbours, in units of their own scatter.

    Parameters
    ----------
    flow
        (2, H, W) px.
    spacing
        Distance to the neighbours, px: windows that share most of their pixels are no independent evidence.
    noise
        Noise level added to the scatter, px.

    Returns
    -------
    ndarray
        (H, W) float32, both components combined; above about 2 is an outlier.

    Notes
    -----
    J. Westerweel & F. Scarano, "Universal outlier detection for PIV data", Experiments in Fluids 39, 2005. The flow is
    mirrored at its borders.
    """
    border = (spacing, spacing, spacing, spacing)
    parts = [cv2.copyMakeBorder(part, *border, cv2.BORDER_REFLECT_101) for part in flow]
    out = np.zeros(flow.shape[1:], np.float32)
    for part in parts:
        _add_residuals(part, spacing, np.float32(noise), out)
    return np.asarray(np.sqrt(out))


def _add_residuals(part: Array, spacing: int, noise: Any, out: Array) -> None:
    over_bands(lambda first, end: _add_squares(part, spacing, noise, first, end, out), out.shape[0])


@compiled
def _middle(a: Any, b: Any, c: Any, d: Any, e: Any, f: Any, g: Any, h: Any) -> Any:
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
def _add_squares(part: Array, spacing: int, noise: Any, first: int, end: int, out: Array) -> None:
    """Add the squared residuals of one component to rows `first` to `end`."""
    for row in range(first, end):
        above, own, below = part[row], part[row + spacing], part[row + 2 * spacing]
        for col in range(out.shape[1]):
            there = col + 2 * spacing
            a, b, c = above[col], above[col + spacing], above[there]
            d, e = own[col], own[there]
            f, g, h = below[col], below[col + spacing], below[there]
            middle = _middle(a, b, c, d, e, f, g, h)
            scatter = _middle(
                abs(a - middle),
                abs(b - middle),
                abs(c - middle),
                abs(d - middle),
                abs(e - middle),
                abs(f - middle),
                abs(g - middle),
                abs(h - middle),
            )
            residual = (own[col + spacing] - middle) / (scatter + noise)
            out[row, col] += residual * residual


def median_residual_reference(flow: Flow, spacing: int, noise: float) -> FloatMap:
    """Return the result of :func:`median_residual`, computed with NumPy's median as a reference."""
    rows, cols = flow.shape[1:]
    padded = np.pad(flow, ((0, 0), (spacing, spacing), (spacing, spacing)), mode="reflect")
    shifts = [(y, x) for y in (0, spacing, 2 * spacing) for x in (0, spacing, 2 * spacing) if (y, x) != (spacing,) * 2]
    around = np.stack([padded[:, y : y + rows, x : x + cols] for y, x in shifts])
    middle = np.median(around, axis=0)
    scatter = np.median(np.abs(around - middle), axis=0)
    return np.asarray(np.hypot(*((flow - middle) / (scatter + noise))), dtype=np.float32)
