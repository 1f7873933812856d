"""Sizes and angles at which a template is searched."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

Range = tuple[float, float]

SCALE_STEP = 1.1
ROTATION_STEP = 10.0
"""Steps of the coarse grid, a ratio and degrees: half a step moves the rim of the reduced template by up to 2 px."""

COARSE_SIDE = 20
"""Side of the smallest template in the reduced image, the root of its area, px."""

SCALES_ALLOWED = 0.1, 10.0
ROTATIONS_ALLOWED = -180.0, 180.0


@dataclass(frozen=True)
class PoseRange:
    """A range of sizes and angles.

    Parameters
    ----------
    scales, rotations
        Smallest and largest, as for :func:`~stereolag.templates.match_template`.
    """

    scales: Range
    rotations: Range

    def grid(self) -> list[tuple[float, float]]:
        """Return the scales and rotations of the coarse search, both ends included."""
        sizes = math.ceil(math.log(self.scales[1] / self.scales[0]) / math.log(SCALE_STEP) - 1e-9) + 1
        angles = math.ceil((self.rotations[1] - self.rotations[0]) / ROTATION_STEP - 1e-9) + 1
        return [
            (float(scale), float(rotation))
            for scale in np.geomspace(*self.scales, sizes)
            for rotation in np.linspace(*self.rotations, angles)
        ]

    def within(self, scale: float, rotation: float) -> tuple[float, float]:
        """Return the nearest scale and rotation within the ranges."""
        (least, most), (first, last) = self.scales, self.rotations
        return min(max(scale, least), most), min(max(rotation, first), last)

    def coarse_factor(self, shape: tuple[int, ...]) -> float:
        """Return the factor by which the image is reduced in the coarse search for a template of that shape."""
        sides = shape[:2]
        return max(1.0, self.scales[0] * min(math.sqrt(sides[0] * sides[1]) / COARSE_SIDE, min(sides) / 5))


def checked_poses(method: str, scales: Range | None, rotations: Range | None) -> PoseRange | None:
    """Return the sizes and angles to search, None if only the template's own are.

    Raises
    ------
    ValueError
        Not two numbers in order, out of bounds, or a method other than "fft".
    """
    if scales is None and rotations is None:
        return None
    if method != "fft":
        raise ValueError(f"method is {method!r}; sizes and angles are searched by 'fft' alone.")
    return PoseRange(
        _checked_range(scales, "scales", SCALES_ALLOWED, 1.0),
        _checked_range(rotations, "rotations", ROTATIONS_ALLOWED, 0.0),
    )


def _checked_range(given: Range | None, name: str, allowed: Range, alone: float) -> Range:
    if given is None:
        return alone, alone
    if np.shape(given) != (2,):
        raise ValueError(f"{name} is {given!r}; allowed are a smallest and a largest number.")
    low, high = (float(end) for end in given)
    if not allowed[0] <= low <= high <= allowed[1]:
        raise ValueError(
            f"{name} is ({low:g}, {high:g}); allowed are a smallest and a largest number from {allowed[0]:g} to "
            f"{allowed[1]:g}."
        )
    return low, high
