"""Steadier maps: what the frame before says goes into the map of this one, where both agree."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from pydantic import Field

from stereolag.arrays import FloatMap, Mask
from stereolag.inputs import Image, as_eight_bit, as_grey
from stereolag.sequences.flicker import same_picture_size, still_pixels
from stereolag.settings import Settings
from stereolag.stereo.matcher import DisparityMap
from stereolag.stereo.reasons import Reason

SMALLEST = 16
"""Px, of either side: the optical flow needs about as much."""

SAME_LEVELS = 12
"""Grey levels of 255; the mean change of a neighbourhood along the motion up to which both frames show the same."""

SAME_SIZE = 7
"""Side of that neighbourhood, px."""

DRIFT_SIZE, DRIFT_LIMITS, DRIFT_SHRINKAGE = 45, (3.0, 1.5), 0.05
"""Side, px, over which the change of disparity is averaged; how far from the change known so far a pixel may lie to
take part; the share of a neighbourhood that speaks for the change of the whole scene where little is measured."""

QUIET_SIZE, QUIET_SHARE, QUIET_LIMITS = 91, 0.9, 2.0
"""Side, px, of the neighbourhood of a guess; the share of its measured pixels that must have stayed, and within how
many limits of agreement."""

EVERY, LEAST = 5, 200
"""Every so manieth pixel along both axes tells the change of the whole scene, if there are so many."""


class Steadiness(Settings):
    """The map of a frame uses the map of the frame before, carried over, where the two agree."""

    limit: float = Field(
        default=1.0,
        title="Agreement",
        description="How far the map carried over from the frame before may lie from this one and still be averaged "
        "with it, px.",
        gt=0,
        le=16,
        json_schema_extra={"step": 0.25},
    )


class Motion(NamedTuple):
    """How the picture moved since the frame before; each (H, W)."""

    col: FloatMap
    """Where in the frame before a pixel was, px."""
    row: FloatMap
    same: Mask
    """Whether it looks the same there."""
    still: Mask
    """Whether the picture did not change at this place."""


def motion_since(before: Image, now: Image) -> Motion | None:
    """Return how the picture moved, by dense inverse search; None of frames that cannot be compared.

    Parameters
    ----------
    before, now
        (H, W), (H, W, 3) or (H, W, 4): two frames of one camera.
    """
    if not same_picture_size(before, now) or min(now.shape[:2]) < SMALLEST:
        return None
    old, new = as_eight_bit(as_grey(before), as_grey(now))
    # The same to the bit on any number of threads, for its stripes are always eight.
    search = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST)
    flow = search.calc(new, old, None)  # type: ignore[call-overload]
    rows, cols = new.shape
    col = flow[:, :, 0] + np.arange(cols, dtype=np.float32)
    row = flow[:, :, 1] + np.arange(rows, dtype=np.float32)[:, None]
    inside = (col >= 0) & (col <= cols - 1) & (row >= 0) & (row <= rows - 1)
    fetched = cv2.remap(old, col, row, cv2.INTER_LINEAR)
    change = cv2.blur(cv2.absdiff(fetched, new), (SAME_SIZE, SAME_SIZE))
    return Motion(col, row, inside & (change <= SAME_LEVELS), still_pixels(before, now))


def steadied(before: DisparityMap, now: DisparityMap, motion: Motion, settings: Steadiness) -> FloatMap:
    """Return the disparities of a frame, with those of the frame before where both agree.

    Parameters
    ----------
    before, now
        What a matcher made of the two frames, each by itself.
    motion
        From :func:`motion_since`.
    settings
        What counts as agreement.

    Returns
    -------
    ndarray
        (H, W) float32, px; NaN where `now` has none.

    Notes
    -----
    Disparities of what comes nearer grow. What is carried over is therefore first changed as the measured pixels of the
    neighbourhood changed: averaging takes away what is theirs alone. Guesses, pixels filled in both maps, are averaged
    even if they differ where neither the picture nor the measured pixels around changed.
    """
    carried = _fetched(before.disparity, motion, cv2.INTER_LINEAR)
    measured = _measured(now)
    witnesses = measured & motion.same & (_fetched(_measured(before).astype(np.uint8), motion, cv2.INTER_NEAREST) > 0)
    carried += _drift(carried, now.disparity, witnesses)
    with np.errstate(invalid="ignore"):
        agreeing = motion.same & (np.abs(carried - now.disparity) <= np.float32(settings.limit))
    out = np.where(agreeing, (carried + now.disparity) / 2, now.disparity)
    guessed = motion.still & ~agreeing & now.filled & before.filled
    if guessed.any():
        guessed &= _quiet(before, now, np.float32(QUIET_LIMITS * settings.limit))
        out[guessed] = (before.disparity[guessed] + now.disparity[guessed]) / 2
    return np.asarray(out, np.float32)


def _measured(one: DisparityMap) -> Mask:
    return np.asarray((one.reason == Reason.MEASURED) & one.valid)


def _fetched(values: FloatMap | np.ndarray, motion: Motion, interpolation: int) -> np.ndarray:
    return np.asarray(cv2.remap(values, motion.col, motion.row, interpolation))


def _drift(carried: FloatMap, now: FloatMap, witnesses: Mask) -> FloatMap:
    """Return by how much disparities grew since the frame before, px: smooth, from the pixels measured in both.

    Where these are few it is what the approach to a static scene makes of the disparity: 1/d shrinks by the same
    everywhere.
    """
    change = now - carried
    approach = _approach(carried[::EVERY, ::EVERY], now[::EVERY, ::EVERY], witnesses[::EVERY, ::EVERY])
    near = np.maximum(np.nan_to_num(carried), 0)
    scale = np.maximum(1 - approach * near, np.float32(0.25))
    expected = np.asarray(approach * near * near / scale, np.float32)
    drift, size = expected, (DRIFT_SIZE, DRIFT_SIZE)
    for limit in DRIFT_LIMITS:
        with np.errstate(invalid="ignore"):
            taking_part = witnesses & (np.abs(change - drift) <= np.float32(limit))
        more = cv2.blur(np.where(taking_part, change - expected, np.float32(0)), size)
        share = cv2.blur(taking_part.astype(np.float32), size)
        drift = np.asarray(expected + more / (share + np.float32(DRIFT_SHRINKAGE)), np.float32)
    return drift


def _approach(carried: FloatMap, now: FloatMap, witnesses: Mask) -> np.float32:
    """Return by how much 1/d shrank, per px: the weighted median, for near pixels tell it best."""
    chosen = witnesses & (carried > 1) & (now > 1)
    if np.count_nonzero(chosen) < LEAST:
        return np.float32(0)
    before, after = carried[chosen].astype(np.float64), now[chosen].astype(np.float64)
    weight = before * after
    found = (after - before) / weight
    order = np.argsort(found, kind="stable")
    total = np.cumsum(weight[order])
    return np.float32(found[order][np.searchsorted(total, total[-1] / 2)])


def _quiet(before: DisparityMap, now: DisparityMap, limit: np.float32) -> Mask:
    """Return where nearly all measured pixels of the neighbourhood kept their disparity."""
    both, size = _measured(before) & _measured(now), (QUIET_SIZE, QUIET_SIZE)
    with np.errstate(invalid="ignore"):
        kept = both & (np.abs(now.disparity - before.disparity) <= limit)
    counts = [cv2.blur(one.astype(np.float32), size) for one in (kept, both)]
    return np.asarray(counts[0] >= np.float32(QUIET_SHARE) * counts[1])
