"""Image pyramids: the frames at half, quarter ... size, and the transfer of a flow between levels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import FloatMap
from stereolag.core.inputs import Image

Guide: TypeAlias = npt.NDArray[np.uint8]
"""(H, W) uint8."""

Flow: TypeAlias = npt.NDArray[np.float32]
"""(2, H, W) float32: dy and dx, px of the level."""


@dataclass(frozen=True, eq=False)
class Frame:
    """One frame at one pyramid level.

    Attributes
    ----------
    grey
        (H, W) image to correlate.
    guide
        (H, W) uint8 image whose edges bound the smoothing.
    """

    grey: Image
    guide: Guide

    @property
    def shape(self) -> tuple[int, int]:
        """Return (rows, cols)."""
        return self.guide.shape[0], self.guide.shape[1]

    @property
    def halved(self) -> Frame:
        """Return the frame at half size."""
        guide: Guide = np.asarray(cv2.pyrDown(self.guide), np.uint8)
        return Frame(guide if self.grey is self.guide else cv2.pyrDown(self.grey), guide)


def pyramid(frame: Frame, levels: int) -> list[Frame]:
    """Return the pyramid of a frame, finest level first."""
    frames = [frame]
    for _ in range(levels - 1):
        frames.append(frames[-1].halved)
    return frames


def count_levels(shape: tuple[int, int], window: int, search: int, most: int) -> int:
    """Return the number of useful levels: the coarsest still fits three windows and more than 2 px of the search."""
    levels, side = 1, min(shape)
    while levels < most and side // 2 >= 3 * window and search >> levels > 2:
        levels, side = levels + 1, (side + 1) // 2
    return levels


def doubled(flow: Flow, shape: tuple[int, int]) -> Flow:
    """Return a flow scaled up to the next finer level, of a given (rows, cols)."""
    size = (shape[1], shape[0])
    return np.stack([cv2.resize(part, size, interpolation=cv2.INTER_LINEAR) for part in flow]) * np.float32(2)


def places(flow: Flow) -> tuple[FloatMap, FloatMap]:
    """Return the end point of every pixel as (rows, cols), each (H, W)."""
    rows, cols = flow.shape[1:]
    row, col = np.arange(rows, dtype=np.float32)[:, None], np.arange(cols, dtype=np.float32)
    return flow[0] + row, flow[1] + col


def fetched(image: Image, flow: Flow) -> Image:
    """Return the image warped back along a flow, with bilinear interpolation and replicated borders."""
    row, col = places(flow)
    return np.asarray(cv2.remap(image, col, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))


def leaves_frame(flow: Flow) -> npt.NDArray[np.bool_]:
    """Return the (H, W) mask of pixels whose flow leads out of the frame, beyond its half-pixel border."""
    row, col = places(flow)
    rows, cols = row.shape
    return np.asarray((row < -0.5) | (row > rows - 0.5) | (col < -0.5) | (col > cols - 0.5))
