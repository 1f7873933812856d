"""The bundled examples: the paths of their files, and their ground truth.

Nothing is decoded here: `stereolag.io` reads the paths. The examples were made by the scripts in ``tools/``, so
the ground truth is exact. Every function returns its examples by name, always in the same order.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

Float64Array = npt.NDArray[np.float64]

PACKAGE = Path(__file__).resolve().parent
INSTALLED = PACKAGE / "assets"
ASSETS = INSTALLED if INSTALLED.is_dir() else PACKAGE.parent / "assets"
"""The folder of the examples: inside the installed package, or beside it in a checkout."""


@dataclass(frozen=True)
class Example:
    """A bundled example: its key, a heading, and a sentence or two."""

    name: str
    title: str
    description: str


@dataclass(frozen=True)
class RecordingExample(Example):
    """Two recordings of one sound scene.

    Attributes
    ----------
    signal_1, signal_2
        FLAC files with one channel each and the same length.
    lag
        Samples; positive: `signal_2` hears the scene later.
    sampling_rate
        Hz.
    speed
        Speed of sound at the place of recording, m/s.
    """

    signal_1: Path
    signal_2: Path
    lag: int
    sampling_rate: float
    speed: float


@dataclass(frozen=True)
class MazeExample(Example):
    """An image in which a template is hidden.

    Attributes
    ----------
    picture, template
        An RGB PNG, and an RGBA PNG whose alpha is its mask.
    row, col
        Position of the template's top-left pixel in the image.
    """

    picture: Path
    template: Path
    row: int
    col: int


@dataclass(frozen=True)
class StereoExample(Example):
    """A rectified stereo pair with exact ground truth.

    Attributes
    ----------
    left, right
        RGB PNGs of the same size.
    disparity
        Ground truth in the left view: a 16-bit PNG of px × 256, 0 for unknown.
    occlusion
        A PNG, non-zero for pixels of the left view that are hidden from the right one.
    calibration
        A JSON file with focal length, baseline and principal point.
    num_disparities
        Px; every disparity of the pair is smaller.
    """

    left: Path
    right: Path
    disparity: Path
    occlusion: Path
    calibration: Path
    num_disparities: int


@dataclass(frozen=True)
class DriveExample(Example):
    """The frames of a drive: rectified stereo pairs in order of time, with the exact disparity and motion of each.

    Attributes
    ----------
    left, right
        RGB pictures, one per frame, all of the same size.
    disparity
        Ground truth in the left view: 16-bit PNGs of px × 256, 0 at infinity.
    occlusion
        PNGs, non-zero for pixels of the left view that are hidden from the right one.
    objects
        8-bit PNGs: the number of the body that each left pixel shows, 0 for everything stationary.
    object_names
        Names of the bodies by number; the first is the world.
    calibration
        A JSON file with focal length, baseline and principal point.
    poses
        A JSON file: the poses of the left camera and of every body in each frame.
    frame_rate
        Frames per second.
    num_disparities
        Px; every disparity of the drive is smaller.
    """

    left: tuple[Path, ...]
    right: tuple[Path, ...]
    disparity: tuple[Path, ...]
    occlusion: tuple[Path, ...]
    objects: tuple[Path, ...]
    object_names: tuple[str, ...]
    calibration: Path
    poses: Path
    frame_rate: float
    num_disparities: int

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.left)

    def read_poses(self) -> Any:
        """Return the parsed `poses`, with the 4 × 4 to-world matrices of camera and objects for every frame."""
        return _read(self.poses)

    def motions(self, frame: int) -> Float64Array:
        """Return the motion of every body from `frame` to the next, relative to the left camera.

        Returns
        -------
        motions
            ``(bodies, 4, 4)``, for `stereolag.geometry.scene`, which turns them into exact flow.

        Raises
        ------
        ValueError
            There is no such frame, or no next one.
        """
        if not 0 <= frame < len(self) - 1:
            raise ValueError(f"frame is {frame}; allowed are 0 to {len(self) - 2}, which have one after them.")
        entry = self.read_poses()
        cameras = np.asarray(entry["camera"], dtype=np.float64)
        bodies = np.asarray(entry["objects"], dtype=np.float64)
        here, there = bodies[frame], bodies[frame + 1]
        return np.asarray(np.linalg.inv(cameras[frame + 1]) @ there @ np.linalg.inv(here) @ cameras[frame])


def recordings() -> dict[str, RecordingExample]:
    """Return the pairs of recordings by name.

    Raises
    ------
    FileNotFoundError
        The examples are neither inside the package nor beside it.
    """
    folder = _folder("signals")
    return {
        entry["name"]: RecordingExample(
            name=entry["name"],
            title=entry["title"],
            description=entry["description"],
            signal_1=folder / entry["files"][0],
            signal_2=folder / entry["files"][1],
            lag=entry["true_lag_samples"],
            sampling_rate=float(entry["sampling_rate"]),
            speed=entry["speed"],
        )
        for entry in _read(folder / "recordings.json")
    }


def mazes() -> dict[str, MazeExample]:
    """Return the mazes by name.

    Raises
    ------
    FileNotFoundError
        The examples are neither inside the package nor beside it.
    """
    folder = _folder("maze")
    return {
        entry["name"]: MazeExample(
            **entry | {"picture": folder / entry["picture"], "template": folder / entry["template"]}
        )
        for entry in _read(folder / "mazes.json")
    }


def stereo_pairs() -> dict[str, StereoExample]:
    """Return the stereo pairs by name, in alphabetical order.

    Raises
    ------
    FileNotFoundError
        The examples are neither inside the package nor beside it.
    """
    found = {}
    for calibration in sorted(_folder("stereo").glob("*/calibration.json")):
        folder, entry = calibration.parent, _read(calibration)
        found[folder.name] = StereoExample(
            folder.name,
            entry["title"],
            entry["description"],
            **{part: folder / f"{part}.png" for part in ("left", "right", "disparity", "occlusion")},
            calibration=calibration,
            num_disparities=entry["num_disparities"],
        )
    return found


def drives() -> dict[str, DriveExample]:
    """Return the drives by name; FileNotFoundError if the examples are missing."""
    found = {}
    for poses in sorted(_folder("drive").glob("*/poses.json")):
        folder, entry = poses.parent, _read(poses)
        calibration = folder / "calibration.json"
        about, parts = _read(calibration), ("left", "right", "disparity", "occlusion", "objects")
        found[folder.name] = DriveExample(
            folder.name,
            about["title"],
            about["description"],
            **{part: tuple(sorted((folder / part).iterdir())) for part in parts},
            object_names=tuple(entry["object_names"]),
            calibration=calibration,
            poses=poses,
            frame_rate=float(entry["frame_rate"]),
            num_disparities=about["num_disparities"],
        )
    return found


def _folder(kind: str) -> Path:
    folder = ASSETS / kind
    if not folder.is_dir():
        raise FileNotFoundError(
            f"The bundled examples are not at {folder}; they come with the installed package and with the checkout."
        )
    return folder


@cache
def _read(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))
