"""The bundled pairs and the bundled drive: ground truth, checked against the pictures independently of the renderer."""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest

from benchmarks.drive_motion import rigid_motion
from stereolag import read_calibration, samples


def moved(image: np.ndarray, dx: np.ndarray, dy: np.ndarray, method: int = cv2.INTER_LINEAR) -> np.ndarray:
    """Return the values of `image` at ``(row + dy, column + dx)``."""
    rows, columns = np.mgrid[: image.shape[0], : image.shape[1]].astype(np.float32)
    return cv2.remap(image, columns + dx, rows + dy, method, borderMode=cv2.BORDER_REPLICATE)


def assert_fits(
    first: np.ndarray, second: np.ndarray, dx: np.ndarray, dy: np.ndarray | None, chosen: np.ndarray
) -> None:
    """Check that `second` moved by the truth looks like `first`, worse when moved on, and best without a bias.

    Without `dy`, the pair is rectified, and its truth is held to half the bias.
    """
    down = np.zeros_like(dx) if dy is None else dy

    def disagreement(across: float, more: float = 0.0) -> float:
        taken = moved(second, dx + np.float32(across), down + np.float32(more))
        return float(cv2.absdiff(taken, first).max(axis=2)[chosen].mean())

    exact, ways = disagreement(0.0), ((1.0, 0.0),) if dy is None else ((1.0, 0.0), (0.0, 1.0))
    assert exact < 13
    for across, more in ways:
        two_off = min(disagreement(sign * 2 * across, sign * 2 * more) for sign in (-1, 1))
        assert two_off > (1.3 if dy is None else 1.15) * exact
        before, after = (disagreement(sign * across, sign * more) for sign in (-0.5, 0.5))
        best = 0.5 * (before - after) / (2 * (before - 2 * exact + after))  # the vertex of a parabola through the three
        assert abs(best) < (0.05 if dy is None else 0.1)


@dataclass(frozen=True)
class View:
    """A pair, 256 times the disparity of each pixel of its left image, 0 if unknown, and 255 if the right hides it."""

    left: np.ndarray
    right: np.ndarray
    codes: np.ndarray
    occlusion: np.ndarray

    @property
    def disparity(self) -> np.ndarray:
        return self.codes / np.float32(256)

    @property
    def matchable(self) -> np.ndarray:
        return (self.codes > 0) & (self.occlusion == 0)


def read(*files: Path) -> list[np.ndarray]:
    return [cv2.imread(str(file), cv2.IMREAD_UNCHANGED) for file in files]


PAIRS = samples.stereo_pairs()
DRIVE = samples.drives()["motorway"]
FRAMES = 60
LOOKED_AT = (0, 36, 58)  # not where the sun appears from behind the bridge, with new glare


@cache
def view(name: str | int) -> View:
    """Return a bundled pair, or a frame of the drive."""
    if isinstance(name, int):
        return View(*read(*(files[name] for files in (DRIVE.left, DRIVE.right, DRIVE.disparity, DRIVE.occlusion))))
    folder = PAIRS[name].left.parent
    return View(*read(*(folder / f"{part}.png" for part in ("left", "right", "disparity", "occlusion"))))


SIZES = {"cube": (640, 480), "fence": (640, 480), "giraffes": (640, 480), "square": (480, 480), "road": (881, 400)}
SIZES |= dict.fromkeys(LOOKED_AT, (881, 400))
"""Width and height of every pair, and of the frames of the drive that are looked at."""


@pytest.mark.parametrize("name", SIZES)
def test_pictures_have_the_promised_formats(name: str | int) -> None:
    here, (width, height) = view(name), SIZES[name]
    for picture in (here.left, here.right):
        assert (picture.shape, picture.dtype) == ((height, width, 3), np.uint8)
    assert (here.codes.shape, here.codes.dtype) == ((height, width), np.uint16)
    assert (here.occlusion.shape, here.occlusion.dtype) == ((height, width), np.uint8)
    assert set(np.unique(here.occlusion)) <= {0, 255}


@pytest.mark.parametrize("name", PAIRS)
def test_calibrations_hold_what_is_promised(name: str) -> None:
    calibration = json.loads((PAIRS[name].left.parent / "calibration.json").read_text())
    assert set(calibration) == CALIBRATION_KEYS
    width, height = SIZES[name]
    assert (calibration["width"], calibration["height"]) == (width, height)
    assert (calibration["cx"], calibration["cy"]) == ((width - 1) / 2, (height - 1) / 2)
    assert calibration["focal_px"] > 0 and calibration["baseline_m"] > 0
    assert calibration["num_disparities"] % 16 == 0


CALIBRATION_KEYS = {
    "focal_px", "baseline_m", "doffs_px", "cx", "cy", "width", "height", "num_disparities", "title", "description",
}  # fmt: skip


@pytest.mark.parametrize(("folder", "megabytes"), [("stereo", 9), ("drive", 25), ("maze", 9), ("signals", 2.5)])
def test_files_stay_small(folder: str, megabytes: float) -> None:
    files = (samples.ASSETS / folder).rglob("*")
    assert sum(file.stat().st_size for file in files if file.is_file()) <= megabytes * 1e6


@pytest.mark.parametrize("name", SIZES)
def test_right_image_moved_by_the_truth_is_the_left_image(name: str | int) -> None:
    here, searched = view(name), (PAIRS[name] if isinstance(name, str) else DRIVE).num_disparities
    known = here.disparity[here.codes > 0]
    assert known.size > 0.6 * here.codes.size
    assert known.max() <= searched - 1
    assert np.ptp(known) > (8 if isinstance(name, str) else 30)
    down = None if isinstance(name, str) else np.zeros_like(here.disparity)
    assert_fits(here.left, here.right, -here.disparity, down, here.matchable)


@pytest.mark.parametrize("name", PAIRS)
def test_occlusion_follows_from_the_disparities(name: str) -> None:
    sample = view(name)
    rows, columns = np.nonzero(sample.codes)
    disparity = sample.disparity[rows, columns]
    landing = np.round(columns - disparity).astype(int)
    inside = landing >= 0
    nearest = np.zeros(sample.codes.shape, dtype=np.float32)
    np.maximum.at(nearest, (rows[inside], landing[inside]), disparity[inside])

    hidden = sample.occlusion[rows, columns] > 0
    assert hidden[columns - disparity < -0.5].all()
    seen = inside & ~hidden
    in_front = nearest[rows[seen], landing[seen]] - disparity[seen] > 1.0
    assert in_front.mean() < 0.03

    covered = cv2.dilate(nearest, np.ones((1, 3), np.uint8))
    behind = inside & hidden
    explained = covered[rows[behind], landing[behind]] - disparity[behind] > 0
    assert explained.mean() > 0.8


def test_all_frames_are_there_in_order_and_small() -> None:
    assert len(DRIVE) == FRAMES
    assert DRIVE.frame_rate == 10
    for part in (DRIVE.left, DRIVE.right, DRIVE.disparity, DRIVE.occlusion, DRIVE.objects):
        assert [int(path.stem) for path in part] == list(range(FRAMES))


def test_poses_are_rigid_and_the_world_stands_still() -> None:
    entry = json.loads(DRIVE.poses.read_text())
    cameras, objects = np.array(entry["camera"]), np.array(entry["objects"])
    assert cameras.shape == (FRAMES, 4, 4)
    assert objects.shape == (FRAMES, len(DRIVE.object_names), 4, 4)
    for poses in (cameras, objects):
        turns = poses[..., :3, :3]
        np.testing.assert_allclose(
            turns @ np.swapaxes(turns, -1, -2), np.broadcast_to(np.eye(3), turns.shape), atol=1e-6
        )
        np.testing.assert_allclose(np.linalg.det(turns), 1, atol=1e-6)
    np.testing.assert_array_equal(objects[:, 0], np.broadcast_to(np.eye(4), (FRAMES, 4, 4)))
    speeds = np.linalg.norm(np.diff(cameras[:, :3, 3], axis=0), axis=1) * DRIVE.frame_rate
    assert (np.abs(speeds - 25) < 0.5).all()


def test_every_body_is_seen_and_there_is_no_other() -> None:
    seen = np.unique(np.concatenate([np.unique(cv2.imread(str(path), cv2.IMREAD_UNCHANGED)) for path in DRIVE.objects]))
    np.testing.assert_array_equal(seen, np.arange(len(DRIVE.object_names)))


@pytest.mark.parametrize("number", [FRAMES - 1, -1])
def test_there_is_no_motion_after_the_last_frame(number: int) -> None:
    with pytest.raises(ValueError, match=f"frame is {number}; allowed are 0 to 58"):
        DRIVE.motions(number)


@pytest.mark.parametrize("number", LOOKED_AT)
def test_next_frame_moved_by_the_flow_is_this_frame_and_its_disparity_follows(number: int) -> None:
    """Except at edges, where a pixel of the next frame may show another body than the point that moved there."""
    here, there = view(number), view(number + 1)
    objects, objects_there = read(DRIVE.objects[number], DRIVE.objects[number + 1])
    assert (objects.shape, objects.dtype) == (here.codes.shape, np.uint8)
    flow = rigid_motion(here.disparity, objects, DRIVE.motions(number), read_calibration(DRIVE.calibration))
    there_disparity = moved(there.disparity, flow.dx, flow.dy, cv2.INTER_LINEAR)
    rows, columns = np.mgrid[:400, :881]
    inside = (np.abs(columns + flow.dx - 440) < 438) & (np.abs(rows + flow.dy - 199.5) < 197) & (here.disparity > 0)
    error = np.abs(there_disparity - here.disparity - flow.disparity_change)
    assert np.median(error[inside]) < 0.02
    assert (error[inside] < 0.3).mean() > 0.85
    seen_again = inside & (error < 0.5) & (moved(objects_there, flow.dx, flow.dy, cv2.INTER_NEAREST) == objects)
    assert_fits(here.left, there.left, flow.dx, flow.dy, seen_again & (objects == 0))
    bodies = seen_again & (objects > 0) & (here.disparity > 4)
    assert bodies.sum() >= 2000
    assert_fits(here.left, there.left, flow.dx, flow.dy, bodies)
