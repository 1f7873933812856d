"""The scene in metres: distances, clouds without flying pixels, their view from above, and rigid motions."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from benchmarks.drive_motion import rigid_motion
from stereolag import Calibration
from stereolag.geometry import scene

CAMERA = Calibration(800.0, 0.1, doffs_px=3.0, cx=320.0, cy=240.0)
SIZE = {"width": 640, "height": 480}

places = st.tuples(st.floats(-2, 2), st.floats(-2, 2), st.floats(1, 20))


def seen(place: tuple[float, float, float]) -> scene.ImagePoint:
    x, y, z = place
    return scene.ImagePoint(240 + 800 * y / z, 320 + 800 * x / z, 800 * 0.1 / z - 3)


@given(places, places)
def test_the_distance_of_projected_points_is_that_of_the_points(first: tuple, second: tuple) -> None:
    apart = scene.distance_between(CAMERA, seen(first), seen(second), **SIZE)
    assert apart.metres == pytest.approx(math.dist(first, second), abs=1e-4)
    back = scene.distance_between(CAMERA, seen(second), seen(first), **SIZE)
    assert (back.metres, back.error) == pytest.approx((apart.metres, apart.error))


def test_its_error_is_what_noisy_disparities_spread_it_by() -> None:
    rng = np.random.default_rng(0)
    first, second = seen((-1.0, 0.2, 4.0)), seen((1.5, -0.5, 6.0))

    def noisy(point: scene.ImagePoint) -> scene.ImagePoint:
        return scene.ImagePoint(point.row, point.col, point.disparity + rng.normal(0, 0.05))

    spread = [scene.distance_between(CAMERA, noisy(first), noisy(second), **SIZE).metres for _ in range(2000)]
    apart = scene.distance_between(CAMERA, first, second, **SIZE, disparity_error=0.05)
    assert apart.error == pytest.approx(np.std(spread), rel=0.06)


def test_the_middle_of_the_picture_stands_in_for_a_centre_but_nothing_for_a_depth() -> None:
    plain, told = Calibration(800.0, 0.1), Calibration(800.0, 0.1, cx=319.5, cy=239.5)
    points = scene.ImagePoint(10, 20, 8.0), scene.ImagePoint(300, 500, 16.0)
    assert scene.distance_between(plain, *points, **SIZE) == scene.distance_between(told, *points, **SIZE)
    apart = scene.distance_between(CAMERA, scene.ImagePoint(1, 1, math.nan), points[1], **SIZE)
    assert math.isnan(apart.metres) and math.isnan(apart.error)


def test_a_known_distance_makes_depths_metric_whatever_was_known_before() -> None:
    for known in (None, CAMERA):
        calibration = scene.calibration_from_distance(known, 25.0, 3.0, width=640)
        assert float(calibration.depth(25.0)) == pytest.approx(3.0)
    assert scene.calibration_from_distance(CAMERA, 25.0, 3.0, width=640).focal_px == 800
    # With a 60° field of view, half the picture is tan 30° times the focal length wide.
    assert 320 / scene.calibration_from_distance(None, 25.0, 3.0, width=640).focal_px == pytest.approx(
        math.tan(math.radians(30))
    )


@pytest.mark.parametrize("count", [1, 2, 9, 10])
def test_the_typical_error_is_the_median_where_both_are_known(count: int) -> None:
    disparity, truth = np.random.default_rng(count).uniform(0, 64, (2, count)).astype(np.float32)
    expected = np.median(np.abs(disparity.astype(float) - truth))
    unknown = np.float32([np.nan, 3.0])
    assert scene.typical_error(np.append(disparity, unknown), np.append(truth, unknown[::-1])) == expected
    assert math.isnan(scene.typical_error(disparity, np.full(count, np.nan)))


UNKNOWN = st.sampled_from([np.nan, np.inf, -np.inf])


@given(hnp.arrays(np.float32, (7, 9), elements=UNKNOWN | st.floats(-5, 5, width=32)))
def test_flying_pixels_are_those_with_fewer_than_nine_alike_of_25(disparity):
    flying = scene.flying_pixels(disparity)
    rows, cols = ([*range(2, 0, -1), *range(size), size - 2, size - 3] for size in disparity.shape)  # mirrored
    for row, col in np.ndindex(disparity.shape):
        square = disparity[np.ix_(rows[row : row + 5], cols[col : col + 5])]
        square = square[np.isfinite(square)]
        alike = np.count_nonzero(np.abs(square - disparity[row, col]) <= 1)
        assert flying[row, col] == (np.isfinite(disparity[row, col]) and alike < 9)


def test_a_subsample_is_the_same_every_time_and_spread_evenly():
    points = np.arange(30_000, dtype=np.float32).reshape(10_000, 3)
    colours = (points % 256).astype(np.uint8)
    some, their_colours = scene.subsampled(points, colours, 1000)
    np.testing.assert_array_equal(some, scene.subsampled(points, colours, 1000)[0])
    assert len(np.unique(some[:, 0])) == 1000
    np.testing.assert_array_equal(some % 256, their_colours)
    np.testing.assert_array_equal(scene.subsampled(points[:1000], colours, 1000)[0], points[:1000])
    counts = np.histogram(some[:, 0], bins=10, range=(0, 30_000))[0]
    assert counts.min() > 60


def test_a_clean_cloud_leaves_out_what_flies_and_keeps_colours_in_place():
    disparity = np.full((30, 40), 10, dtype=np.float32)
    disparity[:, 20:] = 30
    disparity[:, 19] = 20
    colour = np.full((30, 40, 3), 200, dtype=np.uint8)
    colour[:, 19] = 7
    calibration = Calibration(100.0, 0.5)
    points, colours = scene.clean_point_cloud(calibration, disparity, colour)
    assert len(points) == 30 * 39
    np.testing.assert_allclose(np.unique(points[:, 2]), [50 / 30, 5])
    assert (colours == 200).all()
    assert len(scene.clean_point_cloud(calibration, disparity, colour, max_points=100)[0]) == 100
    assert (
        len(scene.clean_point_cloud(calibration, np.ones((400, 400)), np.ones((400, 400)), max_points=None)[0])
        == 160_000
    )


GREY = np.uint8([[100, 100, 100]])


def test_points_fall_into_their_cells_whatever_their_height_and_more_of_them_are_more_opaque() -> None:
    points = np.array([[0, 5, 1], [0, -5, 1], [9.9, 0, 1], *[[0, 0, 10.9]] * 40])
    colours = np.uint8([[10, 20, 30], [30, 40, 50], [0, 0, 255], *[[255, 0, 0]] * 40])
    view = scene.birds_eye_view(points, colours, cells=10)
    assert view.picture.shape == (10, 10, 4)
    assert view.cell == pytest.approx(0.99)
    assert (view.left, view.near) == (0, 1)
    opacity = view.picture[:, :, 3]
    for place, colour in (((0, 0), [20, 30, 40]), ((0, 9), [0, 0, 255]), ((9, 0), [255, 0, 0])):
        assert view.picture[place][:3].tolist() == colour
    assert np.count_nonzero(opacity) == 3
    assert opacity[9, 0] == 255 > opacity[0, 0] > opacity[0, 9]


@given(st.integers(1, 300), st.integers(1, 64), st.integers(0, 2**32 - 1))
def test_every_point_is_in_the_picture(count: int, cells: int, seed: int) -> None:
    points = np.random.default_rng(seed).normal(0, 5, (count, 3)).astype(np.float32)
    view = scene.birds_eye_view(points, GREY.repeat(count, axis=0), cells=cells)
    rows, cols = view.picture.shape[:2]
    assert max(rows, cols) <= cells
    reach = np.array([view.left, view.near]) + view.cell * np.array([cols, rows])
    assert np.all(points[:, [0, 2]] <= reach + 1e-4)
    assert 1 <= np.count_nonzero(view.picture[:, :, 3]) <= count


CALIBRATION = Calibration(400.0, 0.3, cx=21.0, cy=13.5)
SHAPE = (30, 40)
BODY, CLOUD = np.zeros(SHAPE, np.uint8), np.ones((1, 3), np.float32)


def turn_and_move(turn: tuple[float, ...], move: tuple[float, ...]) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3] = cv2.Rodrigues(np.array(turn, dtype=float))[0]
    pose[:3, 3] = move
    return pose


def test_what_is_passed_lands_nowhere() -> None:
    passed = turn_and_move((0, 0, 0), (0, 0, -11))[None]
    behind = rigid_motion(np.full(SHAPE, 400.0 * 0.3 / 10), BODY, passed, CALIBRATION)
    assert all(np.isnan(one).all() for one in (behind.dx, behind.dy, behind.disparity_change))


@pytest.mark.parametrize("nothing", [0.0, np.nan])
def test_the_sky_follows_the_rotation_alone(nothing: float) -> None:
    moved, still = (
        rigid_motion(np.full(SHAPE, nothing), BODY, turn_and_move((0, 0.01, 0), move)[None], CALIBRATION)
        for move in ((3.0, -2.0, -5.0), (0.0, 0.0, 0.0))
    )
    np.testing.assert_array_equal(moved.dx, still.dx)
    np.testing.assert_array_equal(moved.dy, still.dy)
    assert moved.dx.mean() == pytest.approx(4.0, abs=0.1)
    assert not moved.disparity_change.any()


@pytest.mark.parametrize(
    ("act", "message"),
    [
        *(
            (lambda given=given: scene.calibration_from_distance(None, *given, width=640), "above 0")
            for given in [(0, 3), (-2, 3), (25, 0)]
        ),
        (lambda: scene.flying_pixels(np.zeros(4)), "allowed"),
        (lambda: scene.subsampled(CLOUD, BODY[:1, :3], 0), "max_points is 0"),
        (lambda: scene.birds_eye_view(CLOUD[:0], BODY[:0, :3]), r"must be \(n, 3\)"),
        (lambda: scene.birds_eye_view(CLOUD, GREY, cells=0), "cells is 0"),
    ],
)
def test_what_makes_no_sense_is_refused(act, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        act()
