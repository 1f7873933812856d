"""Flow from rigid motions, compared with OpenCV's projection of the same points."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stereolag import Calibration
from stereolag.geometry.scene import rigid_motion

CALIBRATION = Calibration(400.0, 0.3, cx=21.0, cy=13.5)
SHAPE = (30, 40)


def turn_and_move(turn: tuple[float, ...], move: tuple[float, ...]) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3] = cv2.Rodrigues(np.array(turn, dtype=float))[0]
    pose[:3, 3] = move
    return pose


def moving_scene(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    disparity = rng.uniform(0.5, 60, SHAPE)
    objects = rng.integers(0, 3, SHAPE).astype(np.uint8)
    motions = [turn_and_move(rng.normal(0, 0.03, 3), rng.normal(0, 0.2, 3)) for _ in range(3)]
    return disparity, objects, np.stack(motions)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_points_land_where_opencv_projects_them(seed: int) -> None:
    disparity, objects, motions = moving_scene(seed)
    found = rigid_motion(disparity, objects, motions, CALIBRATION)
    camera = np.array([[400.0, 0, 21.0], [0, 400.0, 13.5], [0, 0, 1]])
    rows, columns = np.indices(SHAPE)
    depth = 400.0 * 0.3 / disparity
    points = np.stack([(columns - 21.0) / 400 * depth, (rows - 13.5) / 400 * depth, depth], -1)
    for body, motion in enumerate(motions):
        chosen = objects == body
        turn = cv2.Rodrigues(motion[:3, :3])[0]
        left, _ = cv2.projectPoints(points[chosen], turn, motion[:3, 3], camera, None)
        right, _ = cv2.projectPoints(points[chosen], turn, motion[:3, 3] - [0.3, 0, 0], camera, None)
        np.testing.assert_allclose(columns[chosen] + found.dx[chosen], left[:, 0, 0], atol=1e-3)
        np.testing.assert_allclose(rows[chosen] + found.dy[chosen], left[:, 0, 1], atol=1e-3)
        disparity_after = left[:, 0, 0] - right[:, 0, 0]
        np.testing.assert_allclose(disparity[chosen] + found.disparity_change[chosen], disparity_after, atol=1e-3)


def test_driving_ahead_spreads_the_picture_and_raises_disparities() -> None:
    """From 10 m away to 9 m after one metre: everything grows by 10/9 about the principal point."""
    disparity = np.full(SHAPE, 400.0 * 0.3 / 10)
    found = rigid_motion(disparity, np.zeros(SHAPE, np.uint8), turn_and_move((0, 0, 0), (0, 0, -1))[None], CALIBRATION)
    assert found.dx[0, 39] == pytest.approx((39 - 21.0) / 9, abs=1e-4)
    assert found.dy[0, 39] == pytest.approx((0 - 13.5) / 9, abs=1e-4)
    assert found.disparity_change[0, 0] == pytest.approx(12 / 9, abs=1e-4)


@pytest.mark.parametrize("nothing", [0.0, np.nan])
def test_the_sky_follows_the_rotation_alone(nothing: float) -> None:
    objects = np.zeros(SHAPE, np.uint8)
    moved, still = (
        rigid_motion(np.full(SHAPE, nothing), objects, turn_and_move((0, 0.01, 0), move)[None], CALIBRATION)
        for move in ((3.0, -2.0, -5.0), (0.0, 0.0, 0.0))
    )
    np.testing.assert_array_equal(moved.dx, still.dx)
    np.testing.assert_array_equal(moved.dy, still.dy)
    assert moved.dx.mean() == pytest.approx(4.0, abs=0.1)
    assert not moved.disparity_change.any()


def test_what_ends_up_behind_the_camera_has_no_flow() -> None:
    disparity = np.full(SHAPE, 400.0 * 0.3 / 10)
    found = rigid_motion(disparity, np.zeros(SHAPE, np.uint8), turn_and_move((0, 0, 0), (0, 0, -11))[None], CALIBRATION)
    assert np.isnan(found.dx).all()
    assert np.isnan(found.dy).all()
    assert np.isnan(found.disparity_change).all()


def test_errors_name_what_is_wrong() -> None:
    flat, body = np.ones(SHAPE), np.zeros(SHAPE, np.uint8)
    with pytest.raises(ValueError, match=r"objects is \(2, 2\)"):
        rigid_motion(flat, np.zeros((2, 2), np.uint8), np.eye(4)[None], CALIBRATION)
    with pytest.raises(ValueError, match=r"motions is \(4, 4\)"):
        rigid_motion(flat, body, np.eye(4), CALIBRATION)
    with pytest.raises(ValueError, match="number 2; allowed are 0 to 0"):
        rigid_motion(flat, body + np.uint8(2), np.eye(4)[None], CALIBRATION)
