"""Disparity to metres, checked by hand-computed numbers, by OpenCV's reprojectImageTo3D, and by properties."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereolag.geometry.calibration import Calibration, Rectification, StereoRig

sizes = st.floats(0.01, 1e4)


def rig(**changes: object) -> StereoRig:
    matrix = np.array([[500.0, 0, 160], [0, 500, 120], [0, 0, 1]])
    parts = {
        "left_matrix": matrix,
        "left_distortion": np.zeros(5),
        "right_matrix": matrix,
        "right_distortion": np.zeros(0),
        "rotation": np.eye(3),
        "translation": [-0.1, 0, 0],
        "width": 321,
        "height": 241,
    }
    return StereoRig(**(parts | changes))


def test_depth_is_focal_times_baseline_over_disparity():
    depth = Calibration(700.0, 0.5).depth([[35.0, 70.0]])
    assert depth.dtype == np.float32
    np.testing.assert_allclose(depth, [[10.0, 5.0]])


def test_doffs_is_added_to_the_disparity():
    np.testing.assert_allclose(Calibration(700.0, 0.5, 30.0).depth([5.0, -29.0]), [10.0, 350.0])


@pytest.mark.parametrize("disparity", [0.0, -1.0, np.nan, np.inf, -np.inf, 1e-40])
def test_no_depth_where_the_disparity_is_unknown_or_not_in_front_of_infinity(disparity):
    assert np.isnan(Calibration(700.0, 0.5).depth([disparity])).all()
    assert np.isnan(Calibration(700.0, 0.5).depth_uncertainty([disparity], 0.5)).all()


@pytest.mark.parametrize("dtype", [np.uint8, np.int32, np.float16, np.float32, np.float64])
def test_any_dtype_of_disparity_gives_float32(dtype):
    depth = Calibration(100, 1).depth(np.array([[10, 20]], dtype))
    assert depth.dtype == np.float32
    np.testing.assert_allclose(depth, [[10, 5]])


def test_uncertainty_is_the_slope_of_the_depth():
    calibration = Calibration(700.0, 0.5, 3.0)
    disparity = np.array([10.0, 40.0, 90.0])
    step = 1e-3
    slope = (calibration.depth(disparity - step) - calibration.depth(disparity + step)) / (2 * step)
    np.testing.assert_allclose(calibration.depth_uncertainty(disparity, 0.25), slope * 0.25, rtol=2e-3)


def test_uncertainty_takes_one_error_for_each_disparity_and_refuses_a_negative_one():
    calibration = Calibration(100.0, 1.0)
    np.testing.assert_allclose(calibration.depth_uncertainty([10.0, 10.0], [0.0, 1.0]), [0.0, 1.0])
    with pytest.raises(ValueError, match=r"disparity_error is -1\.0"):
        calibration.depth_uncertainty([10.0], -1)


def test_point_cloud_agrees_with_opencv():
    rng = np.random.default_rng(1)
    disparity = rng.uniform(5, 60, (12, 17)).astype(np.float32)
    focal, baseline, doffs, cx, cy = 300.0, 0.2, 4.0, 7.5, 6.0
    q = np.array([[1, 0, 0, -cx], [0, 1, 0, -cy], [0, 0, 0, focal], [0, 0, 1 / baseline, doffs / baseline]])
    expected = cv2.reprojectImageTo3D(disparity, q.astype(np.float32)).reshape(-1, 3)
    colour = rng.integers(0, 256, (12, 17, 3), dtype=np.uint8)
    points, colours = Calibration(focal, baseline, doffs, cx, cy).point_cloud(disparity, colour)
    assert points.dtype == np.float32
    np.testing.assert_allclose(points, expected, rtol=1e-4, atol=1e-5)
    np.testing.assert_array_equal(colours, colour.reshape(-1, 3))


def test_point_cloud_keeps_valid_pixels_alone_and_centres_by_itself():
    disparity = np.full((3, 5), np.nan)
    disparity[1, 2], disparity[0, 4] = 10.0, 20.0
    points, colours = Calibration(100.0, 1.0).point_cloud(disparity, np.arange(15, dtype=np.uint8).reshape(3, 5))
    np.testing.assert_allclose(points, [[0.1, -0.05, 5.0], [0.0, 0.0, 10.0]])
    np.testing.assert_array_equal(colours, [[4, 4, 4], [7, 7, 7]])


@pytest.mark.parametrize(
    ("colour", "expected"),
    [
        (np.full((1, 1), 65535, np.uint16), 255),
        (np.full((1, 1, 4), 200, np.uint8), 200),
        (np.full((1, 1, 3), 0.5), 128),
    ],
)
def test_point_cloud_colours_become_uint8(colour, expected):
    _, colours = Calibration(1.0, 1.0).point_cloud([[1.0]], colour)
    assert colours.dtype == np.uint8
    np.testing.assert_array_equal(colours, [[expected] * 3])


def test_point_cloud_refuses_what_does_not_fit():
    calibration = Calibration(1.0, 1.0)
    with pytest.raises(ValueError, match=r"colour has \(2, 3\).*disparity \(2, 2\)"):
        calibration.point_cloud(np.ones((2, 2)), np.zeros((2, 3), np.uint8))
    with pytest.raises(ValueError, match="allowed are 0 to 1"):
        calibration.point_cloud(np.ones((2, 2)), np.full((2, 2), 7.0))
    with pytest.raises(ValueError, match=r"needs \(rows, cols\)"):
        calibration.point_cloud(np.ones(4), np.zeros((2, 2), np.uint8))


@given(focal=sizes, baseline=sizes, disparity=st.floats(0.1, 1e3), factor=st.floats(0.1, 10))
def test_scaling_image_and_disparity_together_keeps_the_depth(focal, baseline, disparity, factor):
    calibration = Calibration(focal, baseline, 2.5)
    scaled = calibration.scaled(factor)
    np.testing.assert_allclose(scaled.depth(disparity * factor), calibration.depth(disparity), rtol=1e-5)


@given(factor=st.floats(0.1, 10))
def test_scaling_back_returns_the_calibration(factor):
    calibration = Calibration(700.0, 0.5, 2.0, 99.5, 50.0, rig=rig())
    back = calibration.scaled(factor).scaled(1 / factor)
    for name in ("focal_px", "baseline_m", "doffs_px", "cx", "cy"):
        assert getattr(back, name) == pytest.approx(getattr(calibration, name), abs=1e-9)
    np.testing.assert_allclose(back.rig.left_matrix, calibration.rig.left_matrix, atol=1e-9)


def test_scaling_keeps_the_centre_of_the_image_in_the_centre():
    scaled = Calibration(700.0, 0.5, 0.0, 49.5, 19.5, width=100, height=40, num_disparities=33).scaled(0.5)
    assert (scaled.cx, scaled.cy, scaled.width, scaled.height, scaled.num_disparities) == (24.5, 9.5, 50, 20, 17)


@given(disparity=st.floats(0.5, 300), distance=st.floats(0.1, 500), focal=st.floats(1, 5000), doffs=st.floats(0, 50))
def test_a_known_distance_sets_the_depth_there(disparity, distance, focal, doffs):
    calibration = Calibration(focal, 1.0, doffs).with_known_distance(disparity, distance)
    assert calibration.focal_px == focal
    np.testing.assert_allclose(calibration.depth(disparity), distance, rtol=1e-5)


def test_a_known_distance_must_be_one():
    calibration = Calibration(700.0, 0.5)
    with pytest.raises(ValueError, match=r"distance_m is 0"):
        calibration.with_known_distance(10.0, 0)
    with pytest.raises(ValueError, match=r"disparity \+ doffs_px is -3"):
        calibration.with_known_distance(-3.0, 2.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0, 0.5), "focal_px is 0"),
        ((700, -0.5), "baseline_m is -0.5"),
        ((float("nan"), 0.5), "focal_px is nan"),
        ((700, float("inf")), "baseline_m is inf"),
        ((700, 0.5, float("nan")), "doffs_px is nan"),
        ((700, 0.5, 0, float("inf")), "cx is inf"),
    ],
)
def test_a_calibration_that_makes_no_sense_is_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        Calibration(*arguments)


def test_a_calibration_is_a_value():
    assert Calibration(700.0, 0.5) == Calibration(700.0, 0.5)
    assert len({Calibration(700.0, 0.5), Calibration(700.0, 0.5), Calibration(701.0, 0.5)}) == 2
    with pytest.raises(ValueError, match="width is 0"):
        Calibration(700.0, 0.5, width=0)
    with pytest.raises(ValueError, match="factor is 0"):
        Calibration(700.0, 0.5).scaled(0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"left_matrix": np.eye(2)}, r"left_matrix has shape \(2, 2\)"),
        ({"right_matrix": -np.eye(3)}, "right_matrix is not"),
        ({"left_distortion": np.zeros(6)}, "left_distortion holds 6"),
        ({"rotation": np.eye(3) * 2}, "rotation is not a rotation"),
        ({"rotation": np.diag([1.0, 1, -1])}, "rotation is not a rotation"),
        ({"translation": [0.1, 0, 0]}, "second camera stands to the right"),
        ({"translation": [-0.1, 0.2, 0]}, "second camera stands to the right"),
        ({"translation": [np.nan, 0, 0]}, "finite"),
    ],
)
def test_a_rig_that_makes_no_sense_is_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        rig(**changes)


def rectification(**changes: object) -> Rectification:
    projection = np.array([[500.0, 0, 160, 0], [0, 500, 120, 0], [0, 0, 1, 0]])
    parts = {
        "left_rotation": np.eye(3),
        "right_rotation": np.eye(3),
        "left_projection": projection,
        "right_projection": projection - np.eye(3, 4, 3) * 50,
    }
    return Rectification(**(parts | changes))


def test_the_baseline_is_that_of_the_projections():
    assert rectification().baseline_m == pytest.approx(0.1)
    assert rectification().scaled(0.5).baseline_m == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"left_rotation": np.eye(3) * 2}, "left_rotation is not a rotation"),
        ({"right_rotation": np.eye(2)}, r"right_rotation has shape \(2, 2\)"),
        ({"left_projection": np.zeros((3, 4))}, "The focal length in left_projection is 0"),
        ({"left_projection": np.full((3, 4), np.nan)}, "finite"),
        ({"right_projection": rectification().left_projection + np.eye(3, 4) * 3}, "the rows of such a pair"),
    ],
)
def test_a_rectification_that_makes_no_sense_is_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        rectification(**changes)


def test_a_rectification_of_other_cameras_is_refused():
    turned = cv2.Rodrigues(np.array([0.0, 0.1, 0.0]))[0]
    assert rig(rectification=rectification()).rectification is not None
    with pytest.raises(ValueError, match=r"does not fit the rotation \(R\).*turned by 5\.7°"):
        rig(rectification=rectification(left_rotation=turned))
