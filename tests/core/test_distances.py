"""Distances in metres, checked against known points and against random noise."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereolag.geometry.calibration import Calibration
from stereolag.geometry.scene import SeenPoint, calibrated_by, distance_between, typical_error

CAMERA = Calibration(800.0, 0.1, doffs_px=3.0, cx=320.0, cy=240.0)
SIZE = {"width": 640, "height": 480}

places = st.tuples(st.floats(-2, 2), st.floats(-2, 2), st.floats(1, 20))


def seen(place: tuple[float, float, float]) -> SeenPoint:
    x, y, z = place
    return SeenPoint(240 + 800 * y / z, 320 + 800 * x / z, 800 * 0.1 / z - 3)


@given(places, places)
def test_the_distance_of_projected_points_is_that_of_the_points(first: tuple, second: tuple) -> None:
    apart = distance_between(CAMERA, seen(first), seen(second), **SIZE)
    assert apart.metres == pytest.approx(math.dist(first, second), abs=1e-4)


@given(places, places)
def test_it_is_the_same_both_ways(first: tuple, second: tuple) -> None:
    there = distance_between(CAMERA, seen(first), seen(second), **SIZE)
    back = distance_between(CAMERA, seen(second), seen(first), **SIZE)
    assert back.metres == pytest.approx(there.metres)
    assert back.error == pytest.approx(there.error)


def test_its_error_is_what_noisy_disparities_spread_it_by() -> None:
    rng = np.random.default_rng(0)
    first, second = seen((-1.0, 0.2, 4.0)), seen((1.5, -0.5, 6.0))
    spread = [
        distance_between(
            CAMERA,
            SeenPoint(first.row, first.col, first.disparity + rng.normal(0, 0.05)),
            SeenPoint(second.row, second.col, second.disparity + rng.normal(0, 0.05)),
            **SIZE,
        ).metres
        for _ in range(2000)
    ]
    apart = distance_between(CAMERA, first, second, **SIZE, disparity_error=0.05)
    assert apart.error == pytest.approx(np.std(spread), rel=0.06)


def test_the_middle_of_the_picture_stands_in_for_an_unknown_principal_point() -> None:
    plain, told = Calibration(800.0, 0.1), Calibration(800.0, 0.1, cx=319.5, cy=239.5)
    points = SeenPoint(10, 20, 8.0), SeenPoint(300, 500, 16.0)
    assert distance_between(plain, *points, **SIZE) == distance_between(told, *points, **SIZE)


def test_a_point_without_depth_has_no_distance() -> None:
    apart = distance_between(CAMERA, SeenPoint(1, 1, math.nan), SeenPoint(2, 2, 10.0), **SIZE)
    assert math.isnan(apart.metres)
    assert math.isnan(apart.error)


def test_a_known_distance_makes_depths_metric_whatever_was_known_before() -> None:
    for known in (None, CAMERA):
        calibration = calibrated_by(known, 25.0, 3.0, width=640)
        assert float(calibration.depth(25.0)) == pytest.approx(3.0)
    assert calibrated_by(CAMERA, 25.0, 3.0, width=640).focal_px == 800
    # With a 60° field of view, half the picture is tan 30° times the focal length wide.
    assert 320 / calibrated_by(None, 25.0, 3.0, width=640).focal_px == pytest.approx(math.tan(math.radians(30)))


@pytest.mark.parametrize(("disparity", "metres"), [(0.0, 3.0), (-2.0, 3.0), (25.0, 0.0), (25.0, math.nan)])
def test_a_distance_that_says_nothing_is_refused(disparity: float, metres: float) -> None:
    with pytest.raises(ValueError, match="above 0"):
        calibrated_by(None, disparity, metres, width=640)


def test_the_typical_error_is_the_median_where_both_are_known() -> None:
    disparity = np.array([1.0, 2.5, np.nan, 4.0, 90.0])
    truth = np.array([1.1, 2.0, 3.0, np.nan, 5.0])
    assert typical_error(disparity, truth) == pytest.approx(0.5)
    assert math.isnan(typical_error(disparity, np.full(5, np.nan)))
