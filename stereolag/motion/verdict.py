"""The verdict on two frames: whether they show the same, and at which pixels that can be relied on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple, TypeAlias

import cv2
import numpy as np

from stereolag.core.arrays import FloatMap, Mask
from stereolag.core.inputs import Image
from stereolag.motion.candidates import Flow, leaves_frame
from stereolag.motion.evidence import (
    NEIGHBOURHOOD,
    OWN_AGREES,
    STEP,
    agreement_of,
    at_full_size,
    detail_of,
    determined,
)
from stereolag.motion.levels import Frame

FlowVerdict: TypeAlias = Literal["related", "unrelated", "blank", "static background", "identical"]

OWN, BLOCK, NEAR = 15, 10, 63
"""Sides of squares, px of the level: the area over which detail is compared around a single pixel; the blocks of which
5 × 5 predict the flow of the middle one; and the reach of a neighbourhood that agrees."""

AGREES = 0.4
"""Least correlation of the detail under the predicted flow."""

LEAST_SHARE = 0.3
"""Least share of the textured area that agrees in related frames: 0.44 or more if half of a photograph is exchanged, at
most 0.05 in unrelated photographs and particles, and up to 0.34 on screens, whose straight edges fit anywhere."""

FAINT = 0.01
"""Energy below which an area has no texture, as a share of the mean."""

LEVELS = 3
"""Levels tried, finest first: noise has detail at the first, and hardly any left at the third."""

NOISE_CORRELATES = (0.2, 0.45)
"""Least correlation of the detail with itself 1 px aside in a picture, at full size and below: white noise has 0, and
0.35 once the pyramid has smoothed it."""

WEAK, CHANGED, STANDING, STILL = 0.5, 0.02, 0.2, 0.5
"""A background is looked for below this median agreement; from this share of the area that agrees better without the
minimum; and from this share that moves less than `STILL`, px, although the frames differ by more than noise."""

DISPERSED, MOVES = 0.5, 0.25
"""Least share of the pixels that moves before a background, and the least median motion there, px."""


class FrameRelation(NamedTuple):
    """What two frames have in common."""

    verdict: FlowVerdict
    supported: Mask
    """(H, W), the pixels whose flow is confirmed by their surroundings."""
    agreement: float = 1.0
    """Median correlation of the detail under the predicted flow."""
    may_hide_a_motion: bool = False
    """Whether things may move before a background that stands still."""


def related_frames(firsts: Sequence[Frame], seconds: Sequence[Frame], flow: Flow, reach: int) -> FrameRelation:
    """Return whether the flow between two frames is more than chance, and where.

    A flow made to fit makes any two frames similar. Each area is therefore compared under the flow of the blocks around
    it, in which it has had next to no part: that predicts the area's detail if something has moved there, and does no
    better than chance otherwise. The finest level at which both frames are more than noise decides, since coarse
    structure, such as lines of text, fits anywhere.

    Parameters
    ----------
    firsts, seconds
        The pyramids of both frames, finest first, of :data:`LEVELS` levels or more.
    flow
        (2, H, W) px, finite.
    reach
        Largest motion that was searched for, px.
    """
    nowhere, whole_flow = np.zeros(firsts[0].shape, np.bool_), flow
    typical, hidden, step = 0.0, False, STEP if min(nowhere.shape) >= 4 * NEIGHBOURHOOD else 1
    for level, (first, second) in enumerate(zip(firsts[:LEVELS], seconds[:LEVELS], strict=True)):
        if level:
            flow = np.stack([cv2.resize(part / 2, first.shape[::-1], interpolation=cv2.INTER_AREA) for part in flow])
            step = 1
        details = [detail_of(one.grey, one.grey_level) for one in (first, second)]
        detail = np.ascontiguousarray(details[0][::step, ::step])
        predicted = _predicted(flow, detail.shape)
        agreement, energy = agreement_of(detail, details[1], predicted, NEIGHBOURHOOD, step)
        textured = (energy > FAINT * energy.mean()) & ~leaves_frame(flow[:, ::step, ::step], first.shape, step)
        area = int(textured.sum()) or 1
        if level == 0:
            sampled = agreement[::2, ::2][textured[::2, ::2]]
            typical = float(np.median(sampled)) if sampled.size else 0.0
            agreement[~textured] = 1
            hidden = typical < WEAK or _may_hide_a_motion(first, second, predicted, agreement, step)
        agreeing = textured & (agreement >= AGREES)
        if np.count_nonzero(agreeing) >= LEAST_SHARE * area:
            near = np.asarray(cv2.dilate(agreeing.astype(np.uint8), np.ones((NEAR // step | 1,) * 2, np.uint8)))
            own, _ = agreement_of(detail, details[1], flow[:, ::step, ::step], OWN, step)
            supported = at_full_size((near > 0) & (own >= OWN_AGREES), nowhere.shape)
            return FrameRelation("related", determined(firsts, seconds, whole_flow, supported, reach), typical, hidden)
        noise = NOISE_CORRELATES[min(level, 1)]
        if all(_continues(one) > noise for one in details):
            return FrameRelation("unrelated", nowhere, typical, hidden)
        if min(first.shape) < 2 * NEIGHBOURHOOD:
            break
    return FrameRelation("blank", nowhere)


def moves_everywhere(flow: Flow, found: FrameRelation) -> bool:
    """Return whether most of two frames shows the same, and most of that moves."""
    if found.verdict != "related" or found.supported.mean() < DISPERSED:
        return False
    return float(np.median(np.hypot(*flow[:, found.supported]))) > MOVES


def without_minimum(first: Image, second: Image) -> tuple[Image, Image]:
    """Return both frames less the smaller value of each pixel: what is bright and moves, without its background."""
    least = np.minimum(first, second)
    return first - least, second - least


def unchanged(first: Image, second: Image, window: int) -> Mask:
    """Return the (H, W) mask of pixels whose windows are the same in both frames, to the last bit."""
    changed = cv2.dilate((first != second).astype(np.uint8), np.ones((window, window), np.uint8))
    return np.asarray(changed == 0)


def _may_hide_a_motion(first: Frame, second: Frame, flow: Flow, agreement: FloatMap, step: int) -> bool:
    """Return whether the frames less their minimum are worth a look, by a third of the columns."""
    standing = np.mean(np.hypot(*flow[:, ::2, ::2]) < STILL)
    begin = first.shape[1] // 3 // step * step
    part = np.s_[:, begin : max(first.shape[1] - begin, begin + NEIGHBOURHOOD)]
    details = [detail_of(one, first.grey_level) for one in without_minimum(first.grey[part], second.grey[part])]
    detail = np.ascontiguousarray(details[0][::step, ::step])
    seen = np.s_[:, begin // step : begin // step + detail.shape[1]]
    other, _ = agreement_of(detail, details[1], flow[:, *seen], NEIGHBOURHOOD, step)
    changed = np.mean(other > np.maximum(agreement[seen], AGREES))
    return bool(changed >= CHANGED or (standing >= STANDING and _continues(details[0]) > NOISE_CORRELATES[1]))


def _predicted(flow: Flow, shape: tuple[int, ...]) -> Flow:
    """Return, for places on a grid of that shape, the median flow of the blocks around, in which they have no part."""
    blocks = -(-flow.shape[2] // BLOCK), -(-flow.shape[1] // BLOCK)
    medians = [cv2.medianBlur(cv2.resize(part, blocks, interpolation=cv2.INTER_AREA), 5) for part in flow]
    return np.stack([cv2.resize(part, shape[::-1], interpolation=cv2.INTER_LINEAR) for part in medians])


def _continues(detail: FloatMap) -> float:
    """Return the correlation of the detail with itself 1 px aside; 0 without detail."""
    energy = float(np.mean(detail * detail))
    aside = (np.mean(detail[:, 1:] * detail[:, :-1]) + np.mean(detail[1:] * detail[:-1])) / 2
    return float(aside) / energy if energy > 1e-4 else 0.0
