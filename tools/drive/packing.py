"""Conversion of rendered frames to ``assets/drive``: compressed pictures, lossless ground truth, poses in one JSON."""

import json
import shutil
from pathlib import Path

import cv2
import numpy as np

from .course import BASELINE_M, FOCAL_PX, FRAME_RATE, FRAMES, RUNS, camera, camera_pose
from .frames import EYES

DESTINATION = Path(__file__).parents[2] / "assets" / "drive" / "motorway"
QUALITY = 95  # of WebP: its effect on the matchers is in benchmarks/NOTES.md
TRUTHS = ("disparity", "occlusion", "objects")


def pack(work: Path, destination: Path = DESTINATION) -> None:
    """Rewrite the folder from the frames in `work`, which must be complete."""
    if destination.exists():
        shutil.rmtree(destination)
    for part in (*EYES, *TRUTHS):
        (destination / part).mkdir(parents=True)
    for number in range(FRAMES):
        for eye in EYES:
            picture = _read(work / eye / f"{number:06d}.png")
            _write(destination / eye / f"{number:06d}.webp", picture, [cv2.IMWRITE_WEBP_QUALITY, QUALITY])
        for part in TRUTHS:
            image = _read(work / part / f"{number:06d}.png")
            _write(destination / part / f"{number:06d}.png", image, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    _describe(destination)


def poses() -> dict[str, object]:
    """Return the 4 × 4 poses of camera and objects to world in every frame; object 0 is the stationary world."""
    times = np.arange(FRAMES) / FRAME_RATE
    cameras = [camera_pose(camera(time)) for time in times]
    objects = [[np.eye(4), *(run.pose(time) for run in RUNS.values())] for time in times]
    return {
        "frame_rate": FRAME_RATE,
        "object_names": ["world", *RUNS],
        "camera": np.round(cameras, 9).tolist(),
        "objects": np.round(objects, 9).tolist(),
    }


def _describe(destination: Path) -> None:
    view = camera(0.0)
    cx, cy = view.principal_point
    calibration = {
        "focal_px": FOCAL_PX,
        "baseline_m": BASELINE_M,
        "doffs_px": 0.0,
        "cx": cx,
        "cy": cy,
        "width": view.width,
        "height": view.height,
        "num_disparities": 64,
        "title": "Motorway drive",
        "description": "Six seconds on a motorway: a change of lanes, traffic on both sides, and a bridge.",
    }
    (destination / "calibration.json").write_text(json.dumps(calibration, indent=2) + "\n")
    (destination / "poses.json").write_text(json.dumps(poses()) + "\n")


def _read(path: Path) -> np.ndarray:
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise FileNotFoundError(f"{path} is missing or no picture: render it by python -m tools.drive first")
    return image


def _write(path: Path, image: np.ndarray, options: list[int]) -> None:
    if not cv2.imwrite(str(path), image, options):
        raise OSError(f"could not write {path}")
