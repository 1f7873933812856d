"""Steadying of maps: each is averaged with the map of the previous frame where the two agree."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from pydantic import Field

from stereolag.core.arrays import FloatMap, Mask
from stereolag.core.inputs import Image, as_eight_bit, as_grey
from stereolag.core.settings import Settings
from stereolag.sequences.flicker import same_picture_size, still_pixels
from stereolag.stereo.matcher import DisparityMap
from stereolag.stereo.reasons import Reason

SMALLEST = 16
"""Least width and height of a frame, px: the optical flow needs about that much."""

SAME_LEVELS = 12
"""Mean change of a neighbourhood along the motion up to which both frames show the same, grey levels of 255."""

SAME_SIZE = 7
"""Side of that neighbourhood, px."""

DRIFT_SIZE, DRIFT_LIMITS, DRIFT_SHRINKAGE = 45, (3.0, 1.5), 0.05
"""Side of the window over which the change of disparity is averaged, px; largest deviation of the pixels used from the
estimate so far, px; weight of the whole scene's change where little is measured, as a share of a neighbourhood."""

QUIET_SIZE, QUIET_SHARE, QUIET_LIMITS = 91, 0.9, 2.0
"""Side of the neighbourhood of a guessed pixel, px; share of its measured pixels that must be unchanged; and the
tolerance for that, as a multiple of the agreement limit."""

EVERY, LEAST = 5, 200
"""Spacing of the pixels that give the change of the whole scene, px, and the least number of them."""


class Steadiness(Settings):
    """Averages the map of a frame with that of the previous frame, carried over, where the two agree."""

    limit: float = Field(
        default=1.0,
        title="Agreement",
        description="Largest difference at which the map carried over from the previous frame is averaged with this "
        "one, px.",
        gt=0,
        le=16,
        json_schema_extra={"step": 0.25},
    )


class Motion(NamedTuple):
    """Motion of the picture since the previous frame; each (H, W)."""

    col: FloatMap
    """Position of each pixel in the previous frame, px."""
    row: FloatMap
    same: Mask
    """Whether it looks the same there."""
    still: Mask
    """Whether the picture did not change at this pixel."""


def motion_since(before: Image, now: Image) -> Motion | None:
    """Return the motion of the picture, by dense inverse search; None if the frames cannot be compared.

    Parameters
    ----------
    before, now
        (H, W), (H, W, 3) or (H, W, 4): two frames of one camera.
    """
    if not same_picture_size(before, now) or min(now.shape[:2]) < SMALLEST:
        return None
    old, new = as_eight_bit(as_grey(before), as_grey(now))
    # Identical bit for bit on any number of threads, as it always uses eight stripes.
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
    """Return the disparities of a frame, averaged with those of the previous frame where both agree.

    Parameters
    ----------
    before, now
        A matcher's maps of the two frames, each by itself.
    motion
        From :func:`motion_since`.
    settings
        The limit of agreement.

    Returns
    -------
    ndarray
        (H, W) float32, px; NaN where `now` has none.

    Notes
    -----
    Disparities of approaching points grow, so the carried-over map is first corrected by the mean change of the
    measured pixels nearby; averaging removes their individual errors. Guesses, pixels filled in both maps, are averaged
    even if they differ, provided neither the picture nor the measured pixels around them changed.
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
    """Return the smooth growth of the disparities since the previous frame, px, from the pixels measured in both.

    Where these are few, it is the growth expected when approaching a static scene, in which 1/d shrinks by the same
    amount everywhere.
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
    """Return the decrease of 1/d, per px: a median weighted towards near pixels, which are the most accurate."""
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
    """Return the mask of pixels around which nearly all measured pixels kept their disparity."""
    both, size = _measured(before) & _measured(now), (QUIET_SIZE, QUIET_SIZE)
    with np.errstate(invalid="ignore"):
        kept = both & (np.abs(now.disparity - before.disparity) <= limit)
    counts = [cv2.blur(one.astype(np.float32), size) for one in (kept, both)]
    return np.asarray(counts[0] >= np.float32(QUIET_SHARE) * counts[1])
