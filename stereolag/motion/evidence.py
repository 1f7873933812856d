"""The evidence for a motion between two frames: the correlation of their detail, and other motions that fit as well."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import cv2
import numpy as np
from scipy import fft

from stereolag.core.arrays import FloatMap, Mask
from stereolag.core.inputs import Image
from stereolag.motion.candidates import Flow, end_points, leaves_frame, warped
from stereolag.motion.levels import Frame
from stereolag.stereo.windows.pixels import fit_peaks

MEAN_PX = 9
"""Side of the square over which the local mean is taken, px of the level; subtracting it leaves the detail."""

NEIGHBOURHOOD_PX = 31
"""Side of the square over which detail is compared, px of the level."""

STEP = 2
"""Spacing of the pixels at which frames are compared, px: a quarter of the pixels is as informative as all."""

MIN_OWN_AGREEMENT = 0.3
"""Least correlation of a pixel's surroundings under its own flow."""

MAX_DEVIATION_PX = 0.25
"""Standard deviation from which a motion may be due to noise, px."""

PRECISION_LEVELS = (1, 2)
"""Levels at which that deviation is estimated: one of them suffices, as it is smaller over a larger area."""

SELF_SIMILAR_PX = 5
"""Lag up to which any image correlates with itself, px of the level."""

MIN_AUTOCORRELATION = 0.25
"""Least correlation of an image with itself at a repeat."""

RIVAL_AGREEMENT = 0.95
"""Share of a motion's correlation from which another motion fits as well."""

MIN_RIM_SHARE = 0.08
"""Share of a window that each side must cover for its centre to be on the rim between them."""


def detail_of(image: Image, grey_level: float) -> FloatMap:
    """Return an image without its local mean, grey levels of 255; 0 at the border, where a slope would leave detail."""
    grey = image if grey_level == 1 else image.astype(np.float32) / np.float32(grey_level)
    mean = cv2.boxFilter(grey, cv2.CV_32F, (MEAN_PX, MEAN_PX), borderType=cv2.BORDER_REFLECT)
    return _without_border(np.asarray(cv2.subtract(grey, mean, dtype=cv2.CV_32F), np.float32), MEAN_PX // 2)


def agreement_of(
    detail: FloatMap, second: FloatMap, flow: Flow, side: int, step: int = STEP
) -> tuple[FloatMap, FloatMap]:
    """Return the correlation of the detail around each pixel with that of the second frame, and its energy.

    Parameters
    ----------
    detail
        The detail of the first frame at every `step`-th pixel of every `step`-th row.
    second
        The detail of the second frame at every pixel.
    flow
        (2, ...) px, at the same pixels as `detail`.
    side
        Side of the area around a pixel, px.
    step
        Spacing of the pixels, px.
    """
    other = warped(second, flow, step)
    area = side // step | 1, side // step | 1
    joint = np.asarray(cv2.blur(detail * other, area, borderType=cv2.BORDER_REFLECT), np.float32)
    own, others = (
        np.asarray(cv2.sqrBoxFilter(one, cv2.CV_32F, area, borderType=cv2.BORDER_REFLECT), np.float32)
        for one in (detail, other)
    )
    return joint / np.sqrt(np.maximum(own * others, np.float32(1e-6))), own


def at_full_size(mask: Mask, shape: tuple[int, ...]) -> Mask:
    """Return a mask of every n-th pixel scaled up to all pixels."""
    return np.asarray(cv2.resize(mask.astype(np.uint8), shape[::-1], interpolation=cv2.INTER_NEAREST) > 0)


def unambiguous(firsts: Sequence[Frame], seconds: Sequence[Frame], flow: Flow, supported: Mask, reach: int) -> Mask:
    """Return the supported pixels at which no other motion up to `reach` px fits as well.

    How far straight stripes and smooth slopes seem to have moved depends on noise. A repetitive pattern fits at each
    repeat; its motion is known only if surroundings without repeats move the same.

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
        for number in PRECISION_LEVELS
        if min(firsts[number].shape) >= NEIGHBOURHOOD_PX
    ]
    if not levels:
        return supported
    supported = supported & np.logical_or.reduce([at_full_size(one.is_precise(), supported.shape) for one in levels])
    finest = levels[0]
    repetitive = finest.has_rival(reach)
    if repetitive.any():
        step = STEP * finest.factor
        repetitive &= ~finest.moves_like_surroundings(repetitive, supported[::step, ::step])
    return supported & ~at_full_size(repetitive, supported.shape)


class _Level(NamedTuple):
    """Two frames at a level of their pyramids.

    Attributes
    ----------
    factor
        Side of a pixel of this level, in pixels at full size.
    flow
        (2, ...) px of the level, at every :data:`STEP`-th pixel of every :data:`STEP`-th row.
    first, second
        The detail of both frames at every pixel.
    """

    factor: int
    flow: Flow
    first: FloatMap
    second: FloatMap

    @classmethod
    def of(cls, first: Frame, second: Frame, flow: Flow, factor: int) -> _Level:
        """Return two frames at a level, with the flow at full size scaled down to it."""
        step = STEP * factor
        details = (detail_of(one.grey, one.grey_level) for one in (first, second))
        return cls(factor, flow[:, ::step, ::step] / np.float32(factor), *details)

    def is_precise(self) -> Mask:
        """Return where the detail determines the motion to within :data:`MAX_DEVIATION_PX`.

        The Cramér-Rao bound on the standard deviation of an estimate follows from the residual of the detail under the
        flow and from the gradients common to both frames, in the direction in which these are smallest.
        """
        area = (NEIGHBOURHOOD_PX // STEP | 1,) * 2
        row, col = end_points(self.flow, STEP)

        def mean_product(a: FloatMap, b: FloatMap) -> FloatMap:
            return np.asarray(cv2.blur(a * b, area, borderType=cv2.BORDER_REFLECT), np.float32)

        own, own_dy, own_dx = (part[::STEP, ::STEP] for part in (self.first, *_gradients(self.first)))
        other, other_dy, other_dx = (
            np.asarray(cv2.remap(part, col, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.float32)
            for part in (self.second, *_gradients(self.second))
        )
        joint, other_energy = mean_product(own, other), np.maximum(mean_product(other, other), np.float32(1e-6))
        residual = mean_product(own, own) - joint * joint / other_energy
        yy, xx, yx = mean_product(own_dy, other_dy), mean_product(own_dx, other_dx), mean_product(own_dy, other_dx)
        smaller_eigenvalue = (yy + xx - np.hypot(yy - xx, yx + mean_product(own_dx, other_dy))) / 2
        return np.asarray(smaller_eigenvalue * (NEIGHBOURHOOD_PX * MAX_DEVIATION_PX / self.factor) ** 2 > residual)

    def has_rival(self, reach: int) -> Mask:
        """Return where the first frame repeats, so that a motion a repeat away, up to `reach` px, would fit as well."""
        rivalled = np.zeros(self.flow.shape[1:], np.bool_)
        # The residuals found at the finer levels can lead beyond the reach.
        largest = np.maximum(np.abs(self.flow).max(axis=0), np.float32(reach / self.factor))
        for lag in self._repeats(math.ceil(2 * reach / self.factor)):
            side = max(NEIGHBOURHOOD_PX, int(2 * np.abs(lag).max()))
            own_agreement = self._agreement(self.second, self.flow, side)
            threshold = np.maximum(RIVAL_AGREEMENT * own_agreement, MIN_OWN_AGREEMENT)
            repeated, in_reach = np.zeros_like(rivalled), np.zeros_like(rivalled)
            for signed_lag in (lag, -lag):
                outside = leaves_frame(np.broadcast_to(signed_lag, self.flow.shape), self.first.shape, STEP)
                repeated |= ~outside & (self._agreement(self.first, signed_lag, side) >= threshold)
                in_reach |= np.abs(self.flow + signed_lag).max(axis=0) <= largest
            rivalled |= repeated & in_reach
        return rivalled

    def moves_like_surroundings(self, regions: Mask, reliable: Mask) -> Mask:
        """Return the regions of a mask along whose rims the flow is that of reliable surroundings.

        A region ends where the flow jumps. Its motion must be that of the surroundings, to within half a px of the
        level, along 70 % of its rim, and the surroundings must have a quarter of its area.
        """
        side = NEIGHBOURHOOD_PX // STEP | 1
        square, border = np.ones((side, side), np.uint8), (side,) * 4
        padded = cv2.copyMakeBorder(regions.astype(np.uint8), *border, cv2.BORDER_CONSTANT, value=0)
        # Pixels within a region that happen to have no rival do not belong to its surroundings.
        closed = cv2.morphologyEx(padded, cv2.MORPH_CLOSE, square)[side:-side, side:-side]
        sides = regions & reliable, reliable & (closed == 0)
        shares = [_mean(mask.astype(np.float32), side) for mask in sides]
        rim = (shares[0] > MIN_RIM_SHARE) & (shares[1] > MIN_RIM_SHARE)
        inner, outer = (
            np.stack([_mean(part * mask, side)[rim] for part in self.flow]) / share[rim]
            for mask, share in zip(sides, shares, strict=True)
        )
        continued = rim.copy()
        continued[rim] = np.abs(inner - outer).max(axis=0) < 0.5
        near = np.ones((3, 3), np.uint8)
        jumps = np.max([cv2.dilate(part, near) - cv2.erode(part, near) for part in self.flow], axis=0) > 1.5
        count, labels = cv2.connectedComponents(np.where(jumps, np.uint8(0), closed))
        nearest_label = cv2.dilate(labels.astype(np.float32), square).astype(np.intp)
        area, rim_length, continued_length = (
            np.bincount(pixels.ravel(), minlength=count)
            for pixels in (labels, nearest_label[rim], nearest_label[continued])
        )
        continuous = (sides[1].sum() >= 0.25 * area) & (continued_length > 0.7 * rim_length)
        return np.asarray(continuous[labels] & (labels > 0))

    def _agreement(self, other: FloatMap, flow: Flow, side: int) -> FloatMap:
        """Return the correlation of the first frame's detail with other detail under a flow, or one lag for all."""
        flow = np.broadcast_to(flow, self.flow.shape)
        return agreement_of(np.ascontiguousarray(self.first[::STEP, ::STEP]), other, flow, side)[0]

    def _repeats(self, reach: int) -> Iterator[FloatMap]:
        """Yield up to three lags, (2, 1, 1) px of the level, at which the first frame repeats, best first."""
        rows, cols = self.first.shape
        correlation = fft.fftshift(fft.irfft2(np.abs(fft.rfft2(self.first)) ** 2, self.first.shape))
        peaks = np.where(correlation < cv2.dilate(correlation, np.ones((3, 3), np.uint8)), 0, correlation)
        peaks[: rows // 2] = peaks[rows // 2 + reach + 1 :] = 0
        peaks[:, : max(0, cols // 2 - reach)] = peaks[:, cols // 2 + reach + 1 :] = 0
        threshold, lag = MIN_AUTOCORRELATION * correlation.max(), (0, 0)
        for _ in range(3):
            for sign in (1, -1):
                cv2.circle(peaks, (cols // 2 + sign * lag[1], rows // 2 + sign * lag[0]), SELF_SIMILAR_PX, 0, -1)
            row, col = map(int, np.unravel_index(int(peaks[1:-1, 1:-1].argmax()), (rows - 2, cols - 2)))
            if peaks[row + 1, col + 1] <= threshold:
                break
            around = np.ascontiguousarray(correlation[row : row + 3, col : col + 3, None, None])
            lag = row + 1 - rows // 2, col + 1 - cols // 2
            yield np.array(lag, np.float32)[:, None, None] + np.stack(fit_peaks(around, None))


def _mean(values: FloatMap, side: int) -> FloatMap:
    """Return the means over squares, with 0 outside the image."""
    return np.asarray(cv2.blur(values, (side, side), borderType=cv2.BORDER_CONSTANT), np.float32)


def _gradients(detail: FloatMap) -> list[FloatMap]:
    """Return the gradients of detail downwards and to the right, per px."""
    gradients = [cv2.Sobel(detail, cv2.CV_32F, *axis, ksize=1, scale=0.5) for axis in ((0, 1), (1, 0))]
    return [_without_border(np.asarray(one, np.float32), MEAN_PX // 2 + 1) for one in gradients]


def _without_border(values: FloatMap, width: int) -> FloatMap:
    """Set the border of an array to 0, in place, and return it."""
    for edge in (np.s_[:width], np.s_[-width:], np.s_[:, :width], np.s_[:, -width:]):
        values[edge] = 0
    return values
