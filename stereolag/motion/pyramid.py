"""Coarse to fine: both frames in halves, quarters ..., and what takes a flow from one level to the next."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.arrays import FloatMap
from stereolag.inputs import Image

Guide: TypeAlias = npt.NDArray[np.uint8]
"""(H, W) uint8."""

Flow: TypeAlias = npt.NDArray[np.float32]
"""(2, H, W) float32: dy and dx, px of the level."""


@dataclass(frozen=True, eq=False)
class Frame:
    """One frame at one level.

    Attributes
    ----------
    grey
        (H, W), what is correlated.
    guide
        (H, W) uint8, whose edges are respected.
    """

    grey: Image
    guide: Guide

    @property
    def shape(self) -> tuple[int, int]:
        """Return (rows, cols)."""
        return self.guide.shape[0], self.guide.shape[1]

    @property
    def halved(self) -> Frame:
        """Return the frame at half its size."""
        guide: Guide = np.asarray(cv2.pyrDown(self.guide), np.uint8)
        return Frame(guide if self.grey is self.guide else cv2.pyrDown(self.grey), guide)


def pyramid(frame: Frame, levels: int) -> list[Frame]:
    """Return a frame and its halves, the finest first."""
    frames = [frame]
    for _ in range(levels - 1):
        frames.append(frames[-1].halved)
    return frames


def count_levels(shape: tuple[int, int], window: int, search: int, most: int) -> int:
    """Return how many levels pay: the coarsest still holds three windows, and more than 2 px of the search."""
    levels, side = 1, min(shape)
    while levels < most and side // 2 >= 3 * window and search >> levels > 2:
        levels, side = levels + 1, (side + 1) // 2
    return levels


def doubled(flow: Flow, shape: tuple[int, int]) -> Flow:
    """Return a flow at the next finer level, of a given (rows, cols)."""
    size = (shape[1], shape[0])
    return np.stack([cv2.resize(part, size, interpolation=cv2.INTER_LINEAR) for part in flow]) * np.float32(2)


def places(flow: Flow) -> tuple[FloatMap, FloatMap]:
    """Return (rows, cols), each (H, W): where every pixel goes."""
    rows, cols = flow.shape[1:]
    row, col = np.arange(rows, dtype=np.float32)[:, None], np.arange(cols, dtype=np.float32)
    return flow[0] + row, flow[1] + col


def fetched(image: Image, flow: Flow) -> Image:
    """Return what lies at the end of the flow of every pixel, bilinear; beyond the frame its border goes on."""
    row, col = places(flow)
    return np.asarray(cv2.remap(image, col, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))


def leaves_frame(flow: Flow) -> npt.NDArray[np.bool_]:
    """Return (H, W) where the flow leads out of the frame, by more than its half-pixel border."""
    row, col = places(flow)
    rows, cols = row.shape
    return np.asarray((row < -0.5) | (row > rows - 0.5) | (col < -0.5) | (col > cols - 0.5))
