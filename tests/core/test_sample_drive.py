"""The bundled drive: disparity and motion, checked against the pictures independently of the renderer."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
import pytest

from stereolag import read_calibration, samples
from stereolag.geometry.scene import RigidMotion, rigid_motion

FOLDER = samples.ASSETS / "drive" / "motorway"
FRAMES, SIZE = 60, (400, 881)
LOOKED_AT = (0, 21, 36, 50, 58)  # not where the sun appears from behind the bridge, with new glare
MAX_BYTES = 25_000_000


@dataclass(frozen=True)
class Frame:
    left: np.ndarray
    right: np.ndarray
    disparity: np.ndarray
    occluded: np.ndarray
    objects: np.ndarray


@cache
def frame(number: int) -> Frame:
    drive = samples.drives()["motorway"]
    parts = (drive.left, drive.right, drive.disparity, drive.occlusion, drive.objects)
    left, right, codes, occlusion, objects = (cv2.imread(str(part[number]), cv2.IMREAD_UNCHANGED) for part in parts)
    assert codes.dtype == np.uint16
    assert left.dtype == right.dtype == occlusion.dtype == objects.dtype == np.uint8
    assert left.shape == right.shape == (*SIZE, 3)
    assert codes.shape == occlusion.shape == objects.shape == SIZE
    return Frame(left, right, codes / np.float32(256), occlusion > 0, objects)


@cache
def motion(number: int) -> RigidMotion:
    drive = samples.drives()["motorway"]
    here = frame(number)
    return rigid_motion(here.disparity, here.objects, drive.motions(number), read_calibration(drive.calibration))


def test_all_frames_are_there_in_order_and_small() -> None:
    drive = samples.drives()["motorway"]
    assert len(drive) == FRAMES
    assert drive.frame_rate == 10
    for part in (drive.left, drive.right, drive.disparity, drive.occlusion, drive.objects):
        assert [int(path.stem) for path in part] == list(range(FRAMES))
    assert sum(path.stat().st_size for path in FOLDER.rglob("*") if path.is_file()) < MAX_BYTES


def test_poses_are_rigid_and_the_world_stands_still() -> None:
    drive = samples.drives()["motorway"]
    entry = json.loads(drive.poses.read_text())
    cameras, objects = np.array(entry["camera"]), np.array(entry["objects"])
    assert cameras.shape == (FRAMES, 4, 4)
    assert objects.shape == (FRAMES, len(drive.object_names), 4, 4)
    for poses in (cameras, objects):
        turns = poses[..., :3, :3]
        np.testing.assert_allclose(
            turns @ np.swapaxes(turns, -1, -2), np.broadcast_to(np.eye(3), turns.shape), atol=1e-6
        )
        np.testing.assert_allclose(np.linalg.det(turns), 1, atol=1e-6)
    np.testing.assert_array_equal(objects[:, 0], np.broadcast_to(np.eye(4), (FRAMES, 4, 4)))
    speeds = np.linalg.norm(np.diff(cameras[:, :3, 3], axis=0), axis=1) * drive.frame_rate
    assert (np.abs(speeds - 25) < 0.5).all()


def test_every_body_is_seen_and_there_is_no_other() -> None:
    drive = samples.drives()["motorway"]
    seen = np.unique(np.concatenate([np.unique(cv2.imread(str(path), cv2.IMREAD_UNCHANGED)) for path in drive.objects]))
    np.testing.assert_array_equal(seen, np.arange(len(drive.object_names)))


@pytest.mark.parametrize("number", [FRAMES - 1, -1])
def test_there_is_no_motion_after_the_last_frame(number: int) -> None:
    with pytest.raises(ValueError, match=f"frame is {number}; allowed are 0 to 58"):
        samples.drives()["motorway"].motions(number)


@pytest.mark.parametrize("number", LOOKED_AT)
def test_disparities_lie_within_the_search_range(number: int) -> None:
    disparity = frame(number).disparity
    assert disparity.max() <= samples.drives()["motorway"].num_disparities - 1
    assert (disparity > 0).mean() > 0.6
    assert np.ptp(disparity[disparity > 0]) > 30


@pytest.mark.parametrize("number", LOOKED_AT)
def test_right_image_moved_by_the_truth_is_the_left_image(number: int) -> None:
    here = frame(number)
    matchable = (here.disparity > 0) & ~here.occluded
    assert_fits(here.left, here.right, -here.disparity, np.zeros_like(here.disparity), matchable)


@pytest.mark.parametrize("number", LOOKED_AT)
@pytest.mark.parametrize("moving", [False, True])
def test_next_frame_moved_by_the_flow_is_this_frame(number: int, moving: bool) -> None:
    here, there, flow = frame(number), frame(number + 1), motion(number)
    chosen = seen_again(number) & ((here.objects > 0) == moving) & (here.disparity > (4 if moving else 0))
    if chosen.sum() < 2000:
        pytest.skip(f"frame {number} shows only {chosen.sum()} px of moving bodies")
    assert_fits(here.left, there.left, flow.dx, flow.dy, chosen)


@pytest.mark.parametrize("number", LOOKED_AT)
def test_disparity_of_the_next_frame_follows(number: int) -> None:
    """Except at edges, where a pixel of the next frame may show another body than the point that moved there."""
    here, there, flow = frame(number), frame(number + 1), motion(number)
    there_disparity = moved(there.disparity, flow.dx, flow.dy, cv2.INTER_LINEAR)
    rows, columns = np.mgrid[: SIZE[0], : SIZE[1]]
    inside = (np.abs(columns + flow.dx - 440) < 438) & (np.abs(rows + flow.dy - 199.5) < 197) & (here.disparity > 0)
    error = np.abs(there_disparity - here.disparity - flow.disparity_change)
    assert np.median(error[inside]) < 0.02
    assert (error[inside] < 0.3).mean() > 0.85


def seen_again(number: int) -> np.ndarray:
    """Return which pixels the next frame shows too: same body, and at the expected disparity."""
    here, there, flow = frame(number), frame(number + 1), motion(number)
    rows, columns = np.mgrid[: SIZE[0], : SIZE[1]]
    inside = (np.abs(columns + flow.dx - 440) < 438) & (np.abs(rows + flow.dy - 199.5) < 197)
    same = moved(there.objects, flow.dx, flow.dy, cv2.INTER_NEAREST) == here.objects
    near = moved(there.disparity, flow.dx, flow.dy, cv2.INTER_LINEAR)
    agrees = np.abs(near - here.disparity - flow.disparity_change) < 0.5
    return inside & same & agrees & (here.disparity > 0)


def moved(image: np.ndarray, dx: np.ndarray, dy: np.ndarray, method: int = cv2.INTER_LINEAR) -> np.ndarray:
    """Return the values of `image` at ``(row + dy, column + dx)``."""
    rows, columns = np.mgrid[: image.shape[0], : image.shape[1]].astype(np.float32)
    return cv2.remap(image, columns + dx, rows + dy, method, borderMode=cv2.BORDER_REPLICATE)


def assert_fits(first: np.ndarray, second: np.ndarray, dx: np.ndarray, dy: np.ndarray, chosen: np.ndarray) -> None:
    """Check that `second` moved by the truth looks like `first`, worse when moved on, and best without a bias."""

    def disagreement(across: float, down: float = 0.0) -> float:
        taken = moved(second, dx + np.float32(across), dy + np.float32(down))
        return float(cv2.absdiff(taken, first).max(axis=2)[chosen].mean())

    exact = disagreement(0.0)
    assert exact < 13
    assert min(disagreement(-2.0), disagreement(2.0), disagreement(0, -2.0), disagreement(0, 2.0)) > 1.15 * exact
    for across, down in ((1.0, 0.0), (0.0, 1.0)):
        before, after = (disagreement(sign * across, sign * down) for sign in (-0.5, 0.5))
        best = 0.5 * (before - after) / (2 * (before - 2 * exact + after))  # the vertex of a parabola through the three
        assert abs(best) < 0.1
