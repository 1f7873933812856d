"""The description of a scene: its objects, its camera and the development of the picture."""

from dataclasses import dataclass
from typing import Any

import mitsuba as mi

from .camera import StereoCamera


@dataclass(frozen=True)
class StereoScene:
    """`objects` are Mitsuba shapes and lights by name; `exposure` scales their light so that white is 1."""

    title: str
    description: str
    camera: StereoCamera
    objects: dict[str, Any]
    num_disparities: int = 64
    exposure: float = 1.0
    max_depth: int = 6
    sensor_noise: float = 0.8  # standard deviation, 8-bit levels
    sampler: str = "independent"
    brightest: float | None = None  # limit for the light of one path; None: no limit

    def load(self) -> mi.Scene:
        return mi.load_dict(
            {
                "type": "scene",
                "integrator": self._integrator(),
                **self.objects,
            }
        )

    def _integrator(self) -> dict[str, Any]:
        if self.brightest is None:
            return {"type": "path", "max_depth": self.max_depth}
        return {"type": "bounded_paths", "max_depth": self.max_depth, "brightest": self.brightest}
