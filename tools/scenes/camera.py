"""The stereo camera: two identical pinholes side by side."""

from dataclasses import dataclass
from typing import Any

import mitsuba as mi
import numpy as np


@dataclass(frozen=True)
class StereoCamera:
    """A rectified pair: the right camera is the left one moved `baseline_m` to its right.

    Pixel centres have whole-number coordinates, so the principal point of an image
    of `width` columns is at ``(width - 1) / 2``.
    """

    width: int
    height: int
    focal_px: float
    baseline_m: float
    position: tuple[float, float, float]
    target: tuple[float, float, float]
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)

    @property
    def principal_point(self) -> tuple[float, float]:
        return (self.width - 1) / 2, (self.height - 1) / 2

    @property
    def forward(self) -> np.ndarray:
        return _unit(np.subtract(self.target, self.position))

    @property
    def rightward(self) -> np.ndarray:
        return _unit(np.cross(self.forward, self.up))

    @property
    def right_position(self) -> np.ndarray:
        return np.asarray(self.position) + self.baseline_m * self.rightward

    def sensor(self, eye: str) -> dict[str, Any]:
        """Return the Mitsuba description of the ``"left"`` or ``"right"`` camera."""
        position = np.asarray(self.position) if eye == "left" else self.right_position
        pose = mi.ScalarTransform4f().look_at(
            origin=position.tolist(),
            target=(position + self.forward).tolist(),
            up=list(self.up),
        )
        return {
            "type": "perspective",
            "to_world": pose,
            "fov": float(np.degrees(2 * np.arctan(self.width / 2 / self.focal_px))),
            "fov_axis": "x",
            "near_clip": 1e-3,
            "far_clip": 1e5,
            "film": {
                "type": "hdrfilm",
                "width": self.width,
                "height": self.height,
                "pixel_format": "rgb",
                "rfilter": {"type": "box"},
            },
            "sampler": {"type": "independent"},
        }


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.linalg.norm(vector)
