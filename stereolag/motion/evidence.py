"""The evidence for a motion between two frames: how well their detail agrees, and whether other motions fit as well."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import cv2
import numpy as np
from scipy import fft

from stereolag.core.arrays import FloatMap, Mask
from stereolag.core.inputs import Image
from stereolag.motion.candidates import Flow, leaves_frame, places
from stereolag.motion.levels import Frame
from stereolag.stereo.windows.pixels import fit_peaks

DETAIL, NEIGHBOURHOOD = 9, 31
"""Sides of squares, px of the level: the mean that is removed, so that detail remains, and the area over which detail
is compared."""

STEP = 2
"""Distance of the pixels at which frames are compared, px: a quarter of them tells as much."""

OWN_AGREES = 0.3
"""Least correlation of a pixel's surroundings under its own flow."""

UNSURE, JUDGED = 0.25, (1, 2)
"""Standard deviation of a motion, px, from which noise may have made it, and the levels at which it is judged: over a
larger area it is smaller, and one of them will do."""

REPEATS, OF_ITS_OWN, ALIKE, AS_WELL = 3, 5, 0.25, 0.95
"""Most repeats tried; lags up to which every picture resembles itself, px of the level; the least correlation of a
picture with itself at a repeat; and the share of the agreement from which another motion fits as well."""

RIM, SAME, JUMP, SURROUNDED, MOSTLY = 0.08, 0.5, 1.5, 0.25, 0.7
"""Least shares of both sides at a rim; difference up to which their motions are one, and from which a part ends, px of
the level; least area of the surroundings, of that of the part; and the share of the rim along which it has to go on."""


def detail_of(image: Image, grey_level: float) -> FloatMap:
    """Return an image without its local mean, grey levels of 255; 0 at the border, where slopes would look like it."""
    grey = image if grey_level == 1 else image.astype(np.float32) / np.float32(grey_level)
    mean = cv2.boxFilter(grey, cv2.CV_32F, (DETAIL, DETAIL), borderType=cv2.BORDER_REFLECT)
    return _without_border(np.asarray(cv2.subtract(grey, mean, dtype=cv2.CV_32F), np.float32), DETAIL // 2)


def agreement_of(
    detail: FloatMap, second: FloatMap, flow: Flow, side: int, step: int = STEP
) -> tuple[FloatMap, FloatMap]:
    """Return how the detail around some pixels correlates with that of the second frame, and its energy.

    Parameters
    ----------
    detail
        The detail of the first frame at every `step`-th pixel of every `step`-th row.
    second
        The detail of the second frame at every pixel.
    flow
        At the same pixels as `detail`.
    side
        Side of the area around a pixel, px.
    step
        Distance of the pixels, px.
    """
    row, col = places(flow, step)
    other = cv2.remap(second, col, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    area = side // step | 1, side // step | 1
    joint = np.asarray(cv2.blur(detail * other, area, borderType=cv2.BORDER_REFLECT), np.float32)
    own, others = (
        np.asarray(cv2.sqrBoxFilter(one, cv2.CV_32F, area, borderType=cv2.BORDER_REFLECT), np.float32)
        for one in (detail, other)
    )
    return joint / np.sqrt(np.maximum(own * others, np.float32(1e-6))), own


def at_full_size(some: Mask, shape: tuple[int, ...]) -> Mask:
    """Return a mask of some pixels for all those of the full size."""
    return np.asarray(cv2.resize(some.astype(np.uint8), shape[::-1], interpolation=cv2.INTER_NEAREST) > 0)


def determined(firsts: Sequence[Frame], seconds: Sequence[Frame], flow: Flow, supported: Mask, reach: int) -> Mask:
    """Return the supported pixels whose motion is the only one that fits, of those up to `reach` px.

    Noise decides how far straight stripes and smooth slopes seem to have moved. A pattern that repeats fits at each of
    its repeats; its motion is known only if it goes on in surroundings without repeats.

    Parameters
    ----------
    firsts, seconds
        The pyramids of both frames, finest first.
    flow
        (2, H, W) px, finite.
    supported
        (H, W) mask.
    reach
        Largest motion that was searched for, px.
    """
    levels = [
        _Level.of(firsts[number], seconds[number], flow, 2**number)
        for number in JUDGED
        if min(firsts[number].shape) >= NEIGHBOURHOOD
    ]
    if not levels:
        return supported
    supported = supported & np.logical_or.reduce([at_full_size(one.is_sharp(), supported.shape) for one in levels])
    finest = levels[0]
    elsewhere = finest.fits_elsewhere(reach)
    if elsewhere.any():
        step = STEP * finest.factor
        elsewhere &= ~finest.goes_on(elsewhere, supported[::step, ::step])
    return supported & ~at_full_size(elsewhere, supported.shape)


class _Level(NamedTuple):
    """Two frames at a level of their pyramids.

    Attributes
    ----------
    factor
        Pixels of the full size along the side of one.
    flow
        At every :data:`STEP`-th pixel of every such row, px of the level.
    first, second
        Their detail at every pixel.
    """

    factor: int
    flow: Flow
    first: FloatMap
    second: FloatMap

    @classmethod
    def of(cls, first: Frame, second: Frame, flow: Flow, factor: int) -> _Level:
        """Return the frames of a level, and a flow of the full size at it."""
        step = STEP * factor
        details = (detail_of(one.grey, one.grey_level) for one in (first, second))
        return cls(factor, flow[:, ::step, ::step] / np.float32(factor), *details)

    def is_sharp(self) -> Mask:
        """Return where the detail determines the motion to :data:`UNSURE`.

        The least standard deviation that an estimate can have (Cramér-Rao) follows from what the flow leaves over of
        the detail, and from the slopes that both frames share, in the direction in which they are least.
        """
        area = (NEIGHBOURHOOD // STEP | 1,) * 2
        row, col = places(self.flow, STEP)

        def mean(one: FloatMap, two: FloatMap) -> FloatMap:
            return np.asarray(cv2.blur(one * two, area, borderType=cv2.BORDER_REFLECT), np.float32)

        one, down, right = (part[::STEP, ::STEP] for part in (self.first, *_slopes(self.first)))
        other, other_down, other_right = (
            np.asarray(cv2.remap(part, col, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.float32)
            for part in (self.second, *_slopes(self.second))
        )
        joint, others = mean(one, other), np.maximum(mean(other, other), np.float32(1e-6))
        left_over = mean(one, one) - joint * joint / others
        yy, xx, both = mean(down, other_down), mean(right, other_right), mean(down, other_right)
        least = (yy + xx - np.hypot(yy - xx, both + mean(right, other_down))) / 2
        return np.asarray(least * (NEIGHBOURHOOD * UNSURE / self.factor) ** 2 > left_over)

    def fits_elsewhere(self, reach: int) -> Mask:
        """Return where the first frame repeats, so that a motion a repeat away, up to `reach` px, would fit as well."""
        found = np.zeros(self.flow.shape[1:], np.bool_)
        # What is left at the finer levels can lead beyond the reach.
        largest = np.maximum(np.abs(self.flow).max(axis=0), np.float32(reach / self.factor))
        for lag in self._repeats(math.ceil(2 * reach / self.factor)):
            side = max(NEIGHBOURHOOD, int(2 * np.abs(lag).max()))
            least = np.maximum(AS_WELL * self._agreement(self.second, self.flow, side), OWN_AGREES)
            repeated, possible = np.zeros_like(found), np.zeros_like(found)
            for aside in (lag, -lag):
                outside = leaves_frame(np.broadcast_to(aside, self.flow.shape), self.first.shape, STEP)
                repeated |= ~outside & (self._agreement(self.first, aside, side) >= least)
                possible |= np.abs(self.flow + aside).max(axis=0) <= largest
            found |= repeated & possible
        return found

    def goes_on(self, found: Mask, reliable: Mask) -> Mask:
        """Return the parts of a mask along whose rims the flow is that of reliable surroundings."""
        side = NEIGHBOURHOOD // STEP | 1
        square, border = np.ones((side, side), np.uint8), (side,) * 4
        padded = cv2.copyMakeBorder(found.astype(np.uint8), *border, cv2.BORDER_CONSTANT, value=0)
        # Pixels within a part that happen to fit only once are no surroundings.
        whole = cv2.morphologyEx(padded, cv2.MORPH_CLOSE, square)[side:-side, side:-side]
        sides = found & reliable, reliable & (whole == 0)
        shares = [_mean(one.astype(np.float32), side) for one in sides]
        rim = (shares[0] > RIM) & (shares[1] > RIM)
        inner, outer = (
            np.stack([_mean(part * one, side)[rim] for part in self.flow]) / share[rim]
            for one, share in zip(sides, shares, strict=True)
        )
        alike = rim.copy()
        alike[rim] = np.abs(inner - outer).max(axis=0) < SAME
        near = np.ones((3, 3), np.uint8)
        jumps = np.max([cv2.dilate(part, near) - cv2.erode(part, near) for part in self.flow], axis=0) > JUMP
        count, parts = cv2.connectedComponents(np.where(jumps, np.uint8(0), whole))
        beside = cv2.dilate(parts.astype(np.float32), square).astype(np.intp)
        area, rims, going_on = (
            np.bincount(one.ravel(), minlength=count) for one in (parts, beside[rim], beside[alike])
        )
        goes_on = (sides[1].sum() >= SURROUNDED * area) & (going_on > MOSTLY * rims)
        return np.asarray(goes_on[parts] & (parts > 0))

    def _agreement(self, other: FloatMap, flow: Flow, side: int) -> FloatMap:
        """Return how the first frame's detail correlates with other detail under a flow, or one for all."""
        flow = np.broadcast_to(flow, self.flow.shape)
        return agreement_of(np.ascontiguousarray(self.first[::STEP, ::STEP]), other, flow, side)[0]

    def _repeats(self, reach: int) -> Iterator[FloatMap]:
        """Yield the lags at which the first frame resembles itself, (2, 1, 1) px of the level, the most alike first."""
        rows, cols = self.first.shape
        alike = fft.fftshift(fft.irfft2(np.abs(fft.rfft2(self.first)) ** 2, self.first.shape))
        peaks = np.where(alike < cv2.dilate(alike, np.ones((3, 3), np.uint8)), 0, alike)
        peaks[: rows // 2] = peaks[rows // 2 + reach + 1 :] = 0
        peaks[:, : max(0, cols // 2 - reach)] = peaks[:, cols // 2 + reach + 1 :] = 0
        least, lag = ALIKE * alike.max(), (0, 0)
        for _ in range(REPEATS):
            for sign in (1, -1):
                cv2.circle(peaks, (cols // 2 + sign * lag[1], rows // 2 + sign * lag[0]), OF_ITS_OWN, 0, -1)
            row, col = map(int, np.unravel_index(int(peaks[1:-1, 1:-1].argmax()), (rows - 2, cols - 2)))
            if peaks[row + 1, col + 1] <= least:
                break
            offset = np.stack(fit_peaks(np.ascontiguousarray(alike[row : row + 3, col : col + 3, None, None]), None))
            lag = row + 1 - rows // 2, col + 1 - cols // 2
            yield np.array(lag, np.float32)[:, None, None] + offset


def _mean(values: FloatMap, side: int) -> FloatMap:
    """Return the means over squares, with 0 outside."""
    return np.asarray(cv2.blur(values, (side, side), borderType=cv2.BORDER_CONSTANT), np.float32)


def _slopes(detail: FloatMap) -> list[FloatMap]:
    """Return the slopes of detail downwards and to the right, per px."""
    slopes = [cv2.Sobel(detail, cv2.CV_32F, *axis, ksize=1, scale=0.5) for axis in ((0, 1), (1, 0))]
    return [_without_border(np.asarray(one, np.float32), DETAIL // 2 + 1) for one in slopes]


def _without_border(values: FloatMap, width: int) -> FloatMap:
    """Return the same array, with 0 along its border."""
    for edge in (np.s_[:width], np.s_[-width:], np.s_[:, :width], np.s_[:, -width:]):
        values[edge] = 0
    return values
