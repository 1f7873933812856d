"""A scene: what there is to see, who looks at it and how the picture is developed."""

from dataclasses import dataclass
from typing import Any

import mitsuba as mi

from .camera import StereoCamera


@dataclass(frozen=True)
class StereoScene:
    """`objects` are Mitsuba shapes and lights by name; `exposure` scales their light to white at 1."""

    title: str
    description: str
    camera: StereoCamera
    objects: dict[str, Any]
    num_disparities: int = 64
    exposure: float = 1.0
    max_depth: int = 6
    sensor_noise: float = 0.8  # standard deviation, 8-bit levels

    def load(self) -> mi.Scene:
        return mi.load_dict(
            {
                "type": "scene",
                "integrator": {"type": "path", "max_depth": self.max_depth},
                **self.objects,
            }
        )
