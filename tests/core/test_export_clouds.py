"""Point clouds: the PLY is read by an independent reader, and flying pixels are found where they were placed."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from ply_reader import read_ply

from stereolag import Calibration
from stereolag.geometry.scene import clean_point_cloud, flying_pixels, subsampled
from stereolag.io.disparities import ply


@given(
    hnp.arrays(np.float32, st.tuples(st.integers(0, 20), st.just(3)), elements=st.floats(-1e6, 1e6, width=32)),
    st.integers(0, 255),
)
def test_ply_holds_the_points_and_their_colours(points, shade):
    colours = np.arange(points.size, dtype=np.uint8).reshape(points.shape) + np.uint8(shade)
    vertices = read_ply(ply(points, colours))
    assert list(vertices) == ["x", "y", "z", "red", "green", "blue"]
    np.testing.assert_array_equal(np.array([vertices[axis] for axis in "xyz"], dtype=np.float32).T, points)
    np.testing.assert_array_equal(np.array([vertices[name] for name in ("red", "green", "blue")]).T, colours)


@pytest.mark.parametrize(
    ("points", "colours", "message"),
    [
        (np.zeros((4, 3)), np.zeros((3, 3), np.uint8), "shape"),
        (np.zeros((4, 2)), np.zeros((4, 2), np.uint8), "shape"),
        (np.zeros(3), np.zeros(3, np.uint8), "shape"),
        (np.zeros((4, 3)), np.zeros((4, 3)), "float64"),
        ([[0, 0, np.nan], [0, 0, 1]], np.zeros((2, 3), np.uint8), "1 points that are NaN"),
    ],
)
def test_ply_refuses_what_is_no_cloud(points, colours, message):
    with pytest.raises(ValueError, match=message):
        ply(points, colours)


def two_walls() -> np.ndarray:
    disparity = np.full((30, 40), 10, dtype=np.float32)
    disparity[:, 20:] = 30
    return disparity


def test_surfaces_with_sharp_edges_and_corners_are_kept():
    disparity = two_walls()
    disparity[5:12, 5:9] = 50
    assert not flying_pixels(disparity).any()


def test_the_smear_between_near_and_far_flies():
    disparity = two_walls()
    disparity[:, 18:22] = [14, 18, 22, 26]
    expected = np.zeros(disparity.shape, dtype=bool)
    expected[:, 18:22] = True
    np.testing.assert_array_equal(flying_pixels(disparity), expected)


def test_a_slanted_surface_is_none():
    cols = np.arange(60, dtype=np.float32)
    assert not flying_pixels(np.tile(cols, (20, 1))).any()


@pytest.mark.parametrize("hole", [np.nan, np.inf, -np.inf])
def test_islands_fly_and_holes_do_not(hole):
    disparity = np.full((20, 20), hole, dtype=np.float32)
    disparity[4:6, 4:7] = 12
    disparity[10:15, 10:15] = 12
    flying = flying_pixels(disparity)
    assert flying.sum() == 6
    assert flying[4:6, 4:7].all()


@given(hnp.arrays(np.float32, (7, 9), elements=st.just(float("nan")) | st.floats(-50, 50, width=32)), st.floats(0, 9))
def test_flying_pixels_are_those_with_fewer_than_nine_alike_of_25(disparity, tolerance):
    flying = flying_pixels(disparity, tolerance=tolerance)
    rows, cols = ([*range(2, 0, -1), *range(size), size - 2, size - 3] for size in disparity.shape)  # mirrored
    for row, col in np.ndindex(disparity.shape):
        square = disparity[np.ix_(rows[row : row + 5], cols[col : col + 5])]
        alike = np.count_nonzero(np.abs(square - disparity[row, col]) <= np.float32(tolerance))
        assert flying[row, col] == (np.isfinite(disparity[row, col]) and alike < 9)


@pytest.mark.parametrize(("shape", "tolerance"), [((4,), 1.0), ((4, 4), -1.0), ((4, 4), np.nan)])
def test_flying_pixels_refuses(shape, tolerance):
    with pytest.raises(ValueError, match="allowed"):
        flying_pixels(np.zeros(shape), tolerance=tolerance)


def test_a_subsample_is_the_same_every_time_and_spread_evenly():
    points = np.arange(30_000, dtype=np.float32).reshape(10_000, 3)
    colours = (points % 256).astype(np.uint8)
    some, their_colours = subsampled(points, colours, 1000)
    np.testing.assert_array_equal(some, subsampled(points, colours, 1000)[0])
    assert len(np.unique(some[:, 0])) == 1000
    np.testing.assert_array_equal(some % 256, their_colours)
    counts = np.histogram(some[:, 0], bins=10, range=(0, 30_000))[0]
    assert counts.min() > 60


@pytest.mark.parametrize("most", [3, 4])
def test_few_points_are_all_kept_in_order(most):
    points, colours = np.eye(3, dtype=np.float32), np.eye(3, dtype=np.uint8)
    np.testing.assert_array_equal(subsampled(points, colours, most)[0], points)


def test_no_points_at_all_is_refused():
    with pytest.raises(ValueError, match="max_points is 0"):
        subsampled(np.zeros((1, 3), np.float32), np.zeros((1, 3), np.uint8), 0)


def test_a_clean_cloud_leaves_out_what_flies_and_keeps_colours_in_place():
    disparity = two_walls()
    disparity[:, 19] = 20
    colour = np.full((30, 40, 3), 200, dtype=np.uint8)
    colour[:, 19] = 7
    calibration = Calibration(100.0, 0.5)
    points, colours = clean_point_cloud(calibration, disparity, colour)
    assert len(points) == 30 * 39
    np.testing.assert_allclose(np.unique(points[:, 2]), [50 / 30, 5])
    assert (colours == 200).all()
    assert len(clean_point_cloud(calibration, disparity, colour, max_points=100)[0]) == 100
    assert len(clean_point_cloud(calibration, np.ones((400, 400)), np.ones((400, 400)), max_points=None)[0]) == 160_000
