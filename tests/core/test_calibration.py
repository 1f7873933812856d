"""Disparity to metres, checked by hand-computed numbers, by OpenCV's reprojectImageTo3D, and by properties."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from straight_and_raw import RIG

from stereolag.geometry.calibration import Calibration, Rectification, StereoRig

sizes = st.floats(0.01, 1e4)


def rig(**changes: object) -> StereoRig:
    straight = {"rotation": np.eye(3), "translation": [-0.1, 0, 0]}
    return replace(RIG, **(straight | changes))


@pytest.mark.parametrize("dtype", [np.uint8, np.int32, np.float16, np.float32, np.float64])
def test_depth_is_focal_times_baseline_over_disparity_and_doffs(dtype):
    depth = Calibration(700.0, 0.5, 30.0).depth(np.array([[5, 40]], dtype))
    assert depth.dtype == np.float32
    np.testing.assert_allclose(depth, [[10.0, 5.0]])


@pytest.mark.parametrize("disparity", [0.0, -1.0, np.nan, np.inf, -np.inf, 1e-40])
def test_no_depth_where_the_disparity_is_unknown_or_not_in_front_of_infinity(disparity):
    assert np.isnan(Calibration(700.0, 0.5).depth([disparity])).all()
    assert np.isnan(Calibration(700.0, 0.5).depth_uncertainty([disparity], 0.5)).all()


def test_uncertainty_is_the_slope_of_the_depth():
    calibration = Calibration(700.0, 0.5, 3.0)
    disparity = np.array([10.0, 40.0, 90.0])
    step = 1e-3
    slope = (calibration.depth(disparity - step) - calibration.depth(disparity + step)) / (2 * step)
    for error in (0.25, np.array([0.0, 0.25, 0.5])):
        np.testing.assert_allclose(calibration.depth_uncertainty(disparity, error), slope * error, rtol=2e-3)


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
    for colour, expected in (
        (np.full((1, 1), 65535, np.uint16), 255),
        (np.full((1, 1, 4), 200, np.uint8), 200),
        (np.full((1, 1, 3), 0.5), 128),
    ):
        _, colours = Calibration(1.0, 1.0).point_cloud([[1.0]], colour)
        assert colours.dtype == np.uint8
        np.testing.assert_array_equal(colours, [[expected] * 3])


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
    half = Calibration(700.0, 0.5, 0.0, 49.5, 19.5, width=100, height=40, num_disparities=33).scaled(0.5)
    assert (half.cx, half.cy, half.width, half.height, half.num_disparities) == (24.5, 9.5, 50, 20, 17)


@given(disparity=st.floats(0.5, 300), distance=st.floats(0.1, 500), focal=st.floats(1, 5000), doffs=st.floats(0, 50))
def test_a_known_distance_sets_the_depth_there(disparity, distance, focal, doffs):
    calibration = Calibration(focal, 1.0, doffs).with_known_distance(disparity, distance)
    assert calibration.focal_px == focal
    np.testing.assert_allclose(calibration.depth(disparity), distance, rtol=1e-5)


def rectification(**changes: object) -> Rectification:
    projection = np.array([[500.0, 0, 160, 0], [0, 500, 120, 0], [0, 0, 1, 0]])
    whole = Rectification(np.eye(3), np.eye(3), projection, projection - np.eye(3, 4, 3) * 50)
    return replace(whole, **changes)


def test_a_calibration_is_a_value_and_a_rectification_has_a_baseline():
    assert len({Calibration(700.0, 0.5), Calibration(700.0, 0.5), Calibration(701.0, 0.5)}) == 2
    assert rectification().baseline_m == rectification().scaled(0.5).baseline_m == pytest.approx(0.1)
    assert rig(rectification=rectification()).rectification is not None


PLAIN = Calibration(700.0, 0.5)
TURNED = cv2.Rodrigues(np.array([0.0, 0.1, 0.0]))[0]


@pytest.mark.parametrize(
    ("act", "message"),
    [
        (lambda: Calibration(0, 0.5), "focal_px is 0"),
        (lambda: Calibration(700, -0.5), "baseline_m is -0.5"),
        (lambda: Calibration(700, float("inf")), "baseline_m is inf"),
        (lambda: Calibration(700, 0.5, float("nan")), "doffs_px is nan"),
        (lambda: Calibration(700, 0.5, 0, float("inf")), "cx is inf"),
        (lambda: Calibration(700.0, 0.5, width=0), "width is 0"),
        (lambda: PLAIN.scaled(0), "factor is 0"),
        (lambda: PLAIN.depth_uncertainty([10.0], -1), r"disparity_error is -1\.0"),
        (lambda: PLAIN.with_known_distance(10.0, 0), "distance_m is 0"),
        (lambda: PLAIN.with_known_distance(-3.0, 2.0), r"disparity \+ doffs_px is -3"),
        (lambda: PLAIN.point_cloud(np.ones((2, 2)), np.zeros((2, 3), np.uint8)), r"colour has \(2, 3\).*\(2, 2\)"),
        (lambda: PLAIN.point_cloud(np.ones((2, 2)), np.full((2, 2), 7.0)), "allowed are 0 to 1"),
        (lambda: PLAIN.point_cloud(np.ones(4), np.zeros((2, 2), np.uint8)), r"needs \(rows, cols\)"),
        (lambda: rig(left_matrix=np.eye(2)), r"left_matrix has shape \(2, 2\)"),
        (lambda: rig(right_matrix=-np.eye(3)), "right_matrix is not"),
        (lambda: rig(left_distortion=np.zeros(6)), "left_distortion holds 6"),
        (lambda: rig(rotation=np.eye(3) * 2), "rotation is not a rotation"),
        (lambda: rig(rotation=np.diag([1.0, 1, -1])), "rotation is not a rotation"),
        (lambda: rig(translation=[0.1, 0.05, 0]), "second camera stands to the right"),
        (lambda: rig(translation=[np.nan, 0, 0]), "finite"),
        (
            lambda: rig(rectification=rectification(left_rotation=TURNED)),
            r"not fit the rotation \(R\).*turned by 5\.7°",
        ),
        (lambda: rectification(left_rotation=np.eye(3) * 2), "left_rotation is not a rotation"),
        (lambda: rectification(right_rotation=np.eye(2)), r"right_rotation has shape \(2, 2\)"),
        (lambda: rectification(left_projection=np.zeros((3, 4))), "The focal length in left_projection is 0"),
        (lambda: rectification(left_projection=np.full((3, 4), np.nan)), "finite"),
        (lambda: rectification(right_projection=np.eye(3, 4) * 503), "the rows of such a pair"),
    ],
)
def test_what_makes_no_sense_is_refused(act, message):
    with pytest.raises(ValueError, match=message):
        act()
