"""The verdict on two frames: whether they show the same scene, and at which pixels their flow is reliable."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple, TypeAlias

import cv2
import numpy as np

from stereolag.core.arrays import FloatMap, Mask
from stereolag.core.inputs import Image
from stereolag.motion.candidates import Flow, leaves_frame
from stereolag.motion.evidence import (
    MIN_OWN_AGREEMENT,
    NEIGHBOURHOOD_PX,
    STEP,
    agreement_of,
    at_full_size,
    detail_of,
    unambiguous,
)
from stereolag.motion.levels import Frame

FlowVerdict: TypeAlias = Literal["related", "unrelated", "blank", "static background", "identical"]

OWN_PX = 15
"""Side of the square around a single pixel over which its detail is compared, px of the level."""

BLOCK_PX = 10
"""Side of the blocks of which 5 × 5 predict the flow of the middle one, px of the level."""

AGREEING_PX = 63
"""Side of the square around a supported pixel in which some area agrees with its prediction, px of the level."""

MIN_AGREEMENT = 0.4
"""Least correlation of the detail under the predicted flow."""

MIN_AGREEING_SHARE = 0.3
"""Least share of the textured area that agrees in related frames: 0.44 or more if half of a photograph is exchanged, at
most 0.05 in unrelated photographs and particles, and up to 0.34 on screens, whose straight edges fit anywhere."""

VERDICT_LEVELS = 3
"""Levels tried, finest first: noise has detail at the first and hardly any at the third."""

NOISE_CORRELATION = (0.2, 0.45)
"""Largest correlation of noise with itself shifted by 1 px, at full size and below: for white noise it is 0, and 0.35
once the pyramid has smoothed it."""

WEAK_AGREEMENT = 0.5
"""Median agreement below which a static background is looked for."""


class FrameRelation(NamedTuple):
    """What two frames have in common."""

    verdict: FlowVerdict
    supported: Mask
    """(H, W), the pixels whose flow is confirmed by their surroundings."""
    agreement: float = 1.0
    """Median correlation of the detail under the predicted flow."""
    may_hide_a_motion: bool = False
    """Whether objects may be moving in front of a static background."""


def related_frames(firsts: Sequence[Frame], seconds: Sequence[Frame], flow: Flow, reach: int) -> FrameRelation:
    """Return whether the flow between two frames is more than chance, and where.

    A flow can be fitted to any two frames. Each area is therefore compared under the flow of the blocks around it, to
    which it has contributed almost nothing: this predicts the area's detail if something has moved there, and does no
    better than chance otherwise. The finest level at which both frames are more than noise decides, since coarse
    structure, such as lines of text, fits anywhere.

    Parameters
    ----------
    firsts, seconds
        The pyramids of both frames, finest first, of :data:`VERDICT_LEVELS` levels or more.
    flow
        (2, H, W) px, finite.
    reach
        Largest motion that was searched for, px.
    """
    no_pixel, full_flow = np.zeros(firsts[0].shape, np.bool_), flow
    median_agreement, may_hide = 0.0, False
    step = STEP if min(no_pixel.shape) >= 4 * NEIGHBOURHOOD_PX else 1
    for level, (first, second) in enumerate(zip(firsts[:VERDICT_LEVELS], seconds[:VERDICT_LEVELS], strict=True)):
        if level:
            flow = np.stack([cv2.resize(part / 2, first.shape[::-1], interpolation=cv2.INTER_AREA) for part in flow])
            step = 1
        details = [detail_of(one.grey, one.grey_level) for one in (first, second)]
        detail = np.ascontiguousarray(details[0][::step, ::step])
        predicted = _predicted(flow, detail.shape)
        agreement, energy = agreement_of(detail, details[1], predicted, NEIGHBOURHOOD_PX, step)
        textured = (energy > 0.01 * energy.mean()) & ~leaves_frame(flow[:, ::step, ::step], first.shape, step)
        if level == 0:
            sampled = agreement[::2, ::2][textured[::2, ::2]]
            median_agreement = float(np.median(sampled)) if sampled.size else 0.0
            agreement[~textured] = 1
            may_hide = median_agreement < WEAK_AGREEMENT or _may_hide_a_motion(
                first, second, predicted, agreement, step
            )
        agreeing = textured & (agreement >= MIN_AGREEMENT)
        if np.count_nonzero(agreeing) >= MIN_AGREEING_SHARE * (int(textured.sum()) or 1):
            square = np.ones((AGREEING_PX // step | 1,) * 2, np.uint8)
            near_agreeing = np.asarray(cv2.dilate(agreeing.astype(np.uint8), square)) > 0
            own, _ = agreement_of(detail, details[1], flow[:, ::step, ::step], OWN_PX, step)
            supported = at_full_size(near_agreeing & (own >= MIN_OWN_AGREEMENT), no_pixel.shape)
            supported = unambiguous(firsts, seconds, full_flow, supported, reach)
            return FrameRelation("related", supported, median_agreement, may_hide)
        if all(_autocorrelation(one) > NOISE_CORRELATION[min(level, 1)] for one in details):
            return FrameRelation("unrelated", no_pixel, median_agreement, may_hide)
        if min(first.shape) < 2 * NEIGHBOURHOOD_PX:
            break
    return FrameRelation("blank", no_pixel)


def moves_everywhere(flow: Flow, found: FrameRelation) -> bool:
    """Return whether two frames are related over half of their area or more, by a median motion above 0.25 px."""
    related = found.verdict == "related" and found.supported.mean() >= 0.5
    return bool(related and np.median(np.hypot(*flow[:, found.supported])) > 0.25)


def without_minimum(first: Image, second: Image) -> tuple[Image, Image]:
    """Return both frames minus the smaller value of each pixel: bright moving objects without a static background."""
    minimum = np.minimum(first, second)
    return first - minimum, second - minimum


def unchanged(first: Image, second: Image, window: int) -> Mask:
    """Return the (H, W) mask of pixels whose windows are equal in both frames, to the last bit."""
    changed = cv2.dilate((first != second).astype(np.uint8), np.ones((window, window), np.uint8))
    return np.asarray(changed == 0)


def _may_hide_a_motion(first: Frame, second: Frame, flow: Flow, agreement: FloatMap, step: int) -> bool:
    """Return whether the flow of the frames minus their minimum is worth computing, judged by the middle third.

    It is if 2 % of that area agrees better, or if a fifth of the frame moves by less than half a px although the frames
    differ by more than noise.
    """
    still = np.mean(np.hypot(*flow[:, ::2, ::2]) < 0.5)
    begin = first.shape[1] // 3 // step * step
    middle = np.s_[:, begin : max(first.shape[1] - begin, begin + NEIGHBOURHOOD_PX)]
    details = [detail_of(one, first.grey_level) for one in without_minimum(first.grey[middle], second.grey[middle])]
    detail = np.ascontiguousarray(details[0][::step, ::step])
    compared = np.s_[:, begin // step : begin // step + detail.shape[1]]
    agreement_without, _ = agreement_of(detail, details[1], flow[:, *compared], NEIGHBOURHOOD_PX, step)
    changed = np.mean(agreement_without > np.maximum(agreement[compared], MIN_AGREEMENT))
    return bool(changed >= 0.02 or (still >= 0.2 and _autocorrelation(details[0]) > NOISE_CORRELATION[1]))


def _predicted(flow: Flow, shape: tuple[int, ...]) -> Flow:
    """Return the median flow of the 5 × 5 blocks around each pixel, at the pixels of a grid of that shape."""
    blocks = -(-flow.shape[2] // BLOCK_PX), -(-flow.shape[1] // BLOCK_PX)
    medians = [cv2.medianBlur(cv2.resize(part, blocks, interpolation=cv2.INTER_AREA), 5) for part in flow]
    return np.stack([cv2.resize(part, shape[::-1], interpolation=cv2.INTER_LINEAR) for part in medians])


def _autocorrelation(detail: FloatMap) -> float:
    """Return the correlation of the detail with itself shifted by 1 px; 0 without detail."""
    energy = float(np.mean(detail * detail))
    shifted = (np.mean(detail[:, 1:] * detail[:, :-1]) + np.mean(detail[1:] * detail[:-1])) / 2
    return float(shifted) / energy if energy > 1e-4 else 0.0
