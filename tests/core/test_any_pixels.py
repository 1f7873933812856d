"""Right numbers from any pixels: of 16 bits in any form, with black borders, and at the ends of the search."""

import cv2
import numpy as np
import pytest
from pairs import shifted_pair
from straight_and_raw import RIG, SIZE

import stereolag as sl
from stereolag.core.inputs import as_eight_bit, grey_level
from stereolag.geometry.rectification import rectified_calibration, rectify
from stereolag.stereo.methods import PRESETS, PresetName

PAIR = shifted_pair(80, 140, 0, -7)


def bad(disparity: np.ndarray, true: float = 7.0) -> float:
    """Return the share of pixels without a disparity within 1 px of the true one, the hidden left rim aside."""
    return float(1 - (np.abs(disparity[:, 24:] - true) <= 1).mean())


def deep(image: np.ndarray, pedestal: int, gain: float, seed: int = 0) -> np.ndarray:
    noise = np.random.default_rng(seed).uniform(0, 1, image.shape) if gain != int(gain) else 0.0
    return np.asarray(pedestal + np.floor(image.astype(float) * gain + noise)).astype(np.uint16)


@pytest.mark.parametrize("name", PRESETS)
@pytest.mark.parametrize(("pedestal", "gain"), [(0, 1), (7000, 16), (20000, 3.3), (60000, 4)])
def test_deep_pictures_give_the_maps_of_their_twins_of_8_bits(name: PresetName, pedestal: int, gain: float) -> None:
    matcher = sl.preset(name, num_disparities=16)
    pictures = [deep(image, pedestal, gain, seed) for seed, image in enumerate(PAIR)]
    found, twin = matcher.compute(*pictures).disparity, matcher.compute(*PAIR).disparity
    if gain == int(gain):
        np.testing.assert_array_equal(found, twin)
    assert abs(bad(found) - bad(twin)) < 0.03


@pytest.mark.parametrize(
    ("kind", "dtype"), [("hot", np.uint16), ("no data", np.uint16), ("hot", np.float32), ("no data", np.float64)]
)
def test_a_level_is_a_255th_of_the_range_in_use(kind: str, dtype: type) -> None:
    left, right = (np.rint(20000 + image.astype(float) * 2.7).astype(dtype) for image in PAIR)
    if kind == "hot":
        left[40, 80] = 65535
    else:
        left[:20], right[:20] = 0, 0
    assert grey_level(left, right) == pytest.approx(2.7, rel=0.1)
    assert np.unique(as_eight_bit(left, right)[0]).size > 200
    assert grey_level(*PAIR) == 1
    drawn = np.array([[0, 60000], [60000, 65535]], dtype)  # no mark, but a level
    assert grey_level(drawn, drawn) == pytest.approx(65535 / 255)


@pytest.mark.parametrize("name", ["fast", "accurate"])
@pytest.mark.parametrize("kind", ["black", "pedestal", "alpha", "colour"])
def test_nothing_is_measured_on_a_border_that_no_camera_took(name: PresetName, kind: str) -> None:
    left, right = (np.maximum(image, 1) for image in PAIR)
    outside = np.zeros(left.shape, np.bool_)
    outside[:12], outside[:, -9:] = True, True
    cv2.fillPoly(mask := np.zeros(left.shape, np.uint8), [np.array([[0, 0], [50, 0], [0, 60]])], 1)
    outside |= mask > 0
    if kind == "pedestal":
        left, right = (20000 + 3 * image.astype(np.uint16) for image in (left, right))
    if kind in ("alpha", "colour"):
        left, right = np.dstack([left] * 3), np.dstack([right] * 3)
    if kind == "alpha":
        left, right = (np.dstack([image, np.where(outside, 0, 255).astype(np.uint8)]) for image in (left, right))
    else:
        left[outside] = right[outside] = 0
    result = sl.preset(name, num_disparities=16).compute(left, right)
    assert not np.isfinite(result.disparity[outside]).any()
    assert (result.reason[outside] == sl.Reason.OUT_OF_FRAME).all()
    inside = result.disparity[20:, 60:-30]
    assert np.isfinite(inside).all()
    assert (np.abs(inside - 7) <= 1).mean() > 0.97


def test_rectification_leaves_black_what_no_camera_took_and_nothing_else() -> None:
    calibration = rectified_calibration(RIG, SIZE)
    dark = np.zeros(SIZE[::-1], np.uint8)
    light = np.full(SIZE[::-1], 255, np.uint8)
    given = sl.Calibration(calibration.focal_px, calibration.baseline_m, rig=RIG)
    night, day = (rectify(image, image, given, alpha=1.0).left for image in (dark, light))
    assert (day == 0).any()
    assert not night[day == 0].any()
    assert night[day == 255].all()


@pytest.mark.parametrize("name", ["fast", "accurate"])
@pytest.mark.parametrize(("first", "true"), [(0, 0.3), (0, 0.6), (0, 15.3), (5, 4.8), (5, 20.4), (-6, -5.7)])
def test_the_ends_of_the_search_are_measured_to_a_tenth_of_a_pixel(name: PresetName, first: int, true: float) -> None:
    rng = np.random.default_rng(1)
    fine = cv2.GaussianBlur(rng.uniform(0, 255, (80, 20 * 220)), (0, 0), 24, sigmaY=1.2)
    fine = (fine - fine.min()) / np.ptp(fine) * 255
    at = 20 * np.arange(30, 170)
    left, right = (fine[:, at + round(20 * moved)].astype(np.uint8) for moved in (0, true))
    found = sl.preset(name, num_disparities=16, min_disparity=first).compute(left, right)
    error = np.abs(found.disparity - true)[10:-10, 30:-30]
    assert np.median(error) < 0.1
    assert (error < 0.25).mean() > 0.9
