"""Both cameras and their pose, fitted to the pairs that agree (by ``cv2.stereoCalibrate``)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from stereolag.core.arrays import DoubleMap, Vector
from stereolag.geometry.lenses import without_zeros
from stereolag.geometry.relative_poses import Camera, SeenPair, agreement, pair_errors
from stereolag.geometry.rig import StereoRig

FEWEST_PAIRS = 3

MOST_TIMES_USUAL = 4.0
LEAST_ERROR_PX = 0.75
"""A pair contradicts the others if its error exceeds this multiple of the median and this many px per 1000 of width."""

MOST_ROUNDS = 5

BEST_SHARE = 0.6
"""Share of the pairs, those that agree best, from which the errors of the others are judged."""


@dataclass(frozen=True, eq=False)
class JointFit:
    """Both cameras, the pose of the right one with lengths in squares, and the pairs that were used."""

    left: Camera
    right: Camera
    rotation: DoubleMap
    translation: Vector
    rms: float
    used: tuple[int, ...]
    orders: dict[int, int]
    errors: dict[int, tuple[float, float]]


def agreeing_fit(seen: dict[int, SeenPair], left: Camera, right: Camera, size: tuple[int, int], flags: int) -> JointFit:
    """Return both cameras fitted together to the pairs that agree."""
    numbers = list(seen)
    found = agreement(list(seen.values()), left, right, size[0])
    orders = dict(zip(numbers, found.orders.tolist(), strict=True))
    used = tuple(number for number, agrees in zip(numbers, found.agreeing, strict=True) if agrees)
    _check_majority(used, numbers)
    # The cameras were calibrated separately, which no contradiction between left and right can spoil: they stay fixed
    # until the agreeing pairs are known. The best of these are fitted first, or a fit would bend to one that does not.
    fixed = flags | cv2.CALIB_FIX_INTRINSIC
    fit = _fit(seen, used, orders, left, right, size, fixed)
    best = sorted(used, key=lambda number: max(fit.errors[number]))[: max(FEWEST_PAIRS, round(BEST_SHARE * len(used)))]
    fit = _fit(seen, tuple(sorted(best)), orders, left, right, size, fixed)
    for _ in range(MOST_ROUNDS):
        usual = float(np.median([max(fit.errors[number]) for number in fit.used]))
        limit = max(LEAST_ERROR_PX * size[0] / 1000, MOST_TIMES_USUAL * usual)
        used = tuple(number for number in numbers if max(fit.errors[number]) <= limit)
        _check_majority(used, numbers)
        if used == fit.used:
            break
        fit = _fit(seen, used, orders, left, right, size, fixed)
    return _fit(seen, fit.used, orders, left, right, size, flags)


def _check_majority(used: Sequence[int], numbers: Sequence[int]) -> None:
    if len(used) < FEWEST_PAIRS or 2 * len(used) <= len(numbers):
        raise ValueError(
            f"The pairs contradict each other: no more than {len(used)} of {len(numbers)} agree on where the right "
            "camera stands. Both pictures of a pair must be taken at the same moment, and neither camera may be moved "
            "or refocused in between."
        )


def _fit(
    seen: dict[int, SeenPair],
    used: tuple[int, ...],
    orders: dict[int, int],
    left: Camera,
    right: Camera,
    size: tuple[int, int],
    flags: int,
) -> JointFit:
    """Return both cameras fitted to these pairs, and the errors of all pairs."""
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-9)
    rms, *cameras, rotation, translation, _, _, _, _, errors = cv2.stereoCalibrateExtended(
        [seen[number].points.astype(np.float32) for number in used],
        [seen[number].left.astype(np.float32) for number in used],
        [seen[number].right[orders[number]].astype(np.float32) for number in used],
        left.matrix.copy(),
        left.distortion.copy(),
        right.matrix.copy(),
        right.distortion.copy(),
        size,
        np.eye(3),
        np.zeros((3, 1)),
        flags=flags | cv2.CALIB_USE_INTRINSIC_GUESS,
        criteria=criteria,
    )
    numbers = [np.asarray(one, dtype=np.float64) for one in (*cameras, rotation, translation)]
    both = Camera(numbers[0], numbers[1].ravel()), Camera(numbers[2], numbers[3].ravel())
    turn, place = numbers[4], numbers[5].ravel()
    found = {number: (float(one[0]), float(one[1])) for number, one in zip(used, errors, strict=True)}
    for number in set(seen) - set(used):
        found[number] = pair_errors(seen[number], orders[number], *both, turn, place)
    return JointFit(*both, turn, place, float(rms), used, orders, found)


def rig_of(fit: JointFit, size: tuple[int, int], square_m: float) -> StereoRig:
    """Return the cameras with lengths in metres, if they are side by side and in order."""
    across, up, _ = fit.translation
    if across > abs(up):
        raise ValueError(
            "Left and right are exchanged: the camera of the pictures given as right stands to the left of the other "
            f"by {across * square_m:.3g} m. Swap them."
        )
    if -across <= abs(up):
        raise ValueError(
            f"The right camera stands {abs(up) * square_m:.3g} m above or below the left one and "
            f"{-across * square_m:.3g} m beside it; allowed are cameras side by side: turn the pictures of cameras one "
            "above the other by 90°."
        )
    return StereoRig(
        fit.left.matrix,
        without_zeros(fit.left.distortion),
        fit.right.matrix,
        without_zeros(fit.right.distortion),
        fit.rotation,
        fit.translation * square_m,
        *size,
    )
