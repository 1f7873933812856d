"""The pairs with ground truth on which accuracy is measured."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from stereolag.io.disparities import read_disparity
from stereolag.io.images import read_image

DATA = Path(os.environ.get("STEREOLAG_DATA", Path(__file__).resolve().parents[2] / "shared" / "data"))

FAMILIES = {
    "Middlebury": ("tsukuba", "teddy", "cones", "aloe_half", "motorcycle_q"),
    "KITTI": ("kitti2015_000046",),
    "DrivingStereo": ("drivingstereo_00", "drivingstereo_06", "drivingstereo_12", "drivingstereo_18"),
}
THRESHOLDS = {"Middlebury": 1.0, "KITTI": 3.0, "DrivingStereo": 3.0}


@dataclass(frozen=True)
class TruePair:
    """A stereo pair, its ground truth, and the number of disparities it needs, rounded up to a multiple of 16."""

    name: str
    family: str
    left: npt.NDArray[np.uint8]
    right: npt.NDArray[np.uint8]
    truth: npt.NDArray[np.float32]
    num_disparities: int

    @property
    def threshold(self) -> float:
        return THRESHOLDS[self.family]


def true_pairs() -> Iterator[TruePair]:
    """Yield every pair with ground truth, one at a time."""
    for family, names in FAMILIES.items():
        for name in names:
            folder = DATA / "stereo" / name
            calibration = json.loads((folder / "calib.json").read_text())
            left, right, truth = (next(folder.glob(f"{part}.*")) for part in ("left", "right", "gt"))
            yield TruePair(
                name,
                family,
                read_image(left),
                read_image(right),
                read_disparity(truth, divisor=calibration["disparity_divisor"]),
                -(-calibration["max_disparity"] // 16) * 16,
            )
