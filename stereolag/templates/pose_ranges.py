"""Which sizes and angles of a template are searched."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

Range = tuple[float, float]

SCALE_STEP = 1.1
ROTATION_STEP = 10.0
"""Of the coarse grid, a ratio and degrees: half of it moves the rim of a template of that size by about 2 px."""

COARSE_SIDE = 20
"""Px of the smallest template's side, the root of its area, in the reduced image."""

SCALES_ALLOWED = 0.1, 10.0
ROTATIONS_ALLOWED = -180.0, 180.0


@dataclass(frozen=True)
class PoseRange:
    """Sizes and angles.

    Parameters
    ----------
    scales, rotations
        Least and largest, as for :func:`~stereolag.templates.match_template`.
    """

    scales: Range
    rotations: Range

    def grid(self) -> list[tuple[float, float]]:
        """Return the scales and rotations that the coarse search tries, both ends among them."""
        sizes = math.ceil(math.log(self.scales[1] / self.scales[0]) / math.log(SCALE_STEP) - 1e-9) + 1
        angles = math.ceil((self.rotations[1] - self.rotations[0]) / ROTATION_STEP - 1e-9) + 1
        return [
            (float(scale), float(rotation))
            for scale in np.geomspace(*self.scales, sizes)
            for rotation in np.linspace(*self.rotations, angles)
        ]

    def within(self, scale: float, rotation: float) -> tuple[float, float]:
        """Return the nearest scale and rotation that are searched."""
        (least, most), (first, last) = self.scales, self.rotations
        return min(max(scale, least), most), min(max(rotation, first), last)

    def coarse_factor(self, shape: tuple[int, ...]) -> float:
        """Return by how much the image is made smaller for the coarse search for a template of that shape."""
        sides = shape[:2]
        return max(1.0, self.scales[0] * min(math.sqrt(sides[0] * sides[1]) / COARSE_SIDE, min(sides) / 5))


def checked_poses(method: str, scales: Range | None, rotations: Range | None) -> PoseRange | None:
    """Return the sizes and angles to search, None where only the template's own is.

    Raises
    ------
    ValueError
        Not two numbers in order, out of bounds, or another method than "fft".
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
        raise ValueError(f"{name} is {given!r}; allowed are a least and a largest number.")
    low, high = (float(end) for end in given)
    if not allowed[0] <= low <= high <= allowed[1]:
        raise ValueError(
            f"{name} is ({low:g}, {high:g}); allowed are a least and a largest number from {allowed[0]:g} to "
            f"{allowed[1]:g}."
        )
    return low, high
