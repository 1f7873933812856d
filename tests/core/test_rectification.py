"""Rectified pairs: rows and depths are those of OpenCV; pairs are split, cropped and reduced."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from straight_and_raw import D1, D2, M1, M2, P1, P2, R1, R2, RIG, SIZE, R, T, raw_pair

from stereolag.geometry.calibration import Calibration, Rectification, StereoRig
from stereolag.geometry.rectification import (
    as_same_bit_depth,
    calibration_for,
    cropped_to_common_size,
    preview_divisor,
    rectified_calibration,
    rectify,
    scaled_disparity,
    scaled_image,
    turned,
)
from stereolag.io.calibrations import calibration_json, opencv_calibration, read_calibration

WIDTH, HEIGHT = SIZE
PAIR = raw_pair()
OF_NO_SIZE = Calibration(900.0, 0.1, cx=320.0, cy=240.0)


def unrectified(rig: StereoRig) -> Calibration:
    """Return a calibration as read from a file with both cameras."""
    return replace(rectified_calibration(rig, (WIDTH, HEIGHT)), rig=rig)


def test_colour_and_alpha_are_rectified_like_grey():
    rgba = [np.dstack([image, 255 - image, image, np.full_like(image, 255)]) for image in PAIR]
    left, right, _ = rectify(*PAIR, unrectified(RIG))
    left_rgba, right_rgba, _ = rectify(*rgba, unrectified(RIG))
    np.testing.assert_array_equal(left_rgba[:, :, 0], left)
    np.testing.assert_array_equal(right_rgba[:, :, 2], right)
    assert (left_rgba[:, :, 3] == 255).mean() > 0.98


def test_what_does_not_fit_is_refused():
    calibration = unrectified(RIG)
    rectified = rectify(*PAIR, calibration)
    assert rectified[0] is rectified.left and rectified[1] is rectified.right
    for act, message in (
        (lambda: rectify(*rectified), "calibration has no rig"),
        (lambda: rectify(PAIR[0], PAIR[1][:-1], calibration), "left is 320 × 240 and right is 320 × 239"),
        (lambda: rectify(PAIR[0][:220], PAIR[1][:220], calibration), "320 × 220 pixels and .* calibrated at 320 × 240"),
        (lambda: rectify(*PAIR, calibration, alpha=-0.1), "alpha is -0.1; allowed are numbers from 0 to 1"),
        (lambda: rectify(*PAIR, calibration, alpha=float("nan")), "alpha is nan"),
        (lambda: calibration_for(CALIBRATION, 640, 360), "for 640 × 480 pixels and the images are 640 × 360"),
        (
            lambda: calibration_for(OF_NO_SIZE, 320, 240),
            "images of about 641 × 481 pixels, and these are 320 × 240: give",
        ),
        (lambda: calibration_for(OF_NO_SIZE, 1280, 960), "images of about 641 × 481 pixels, and these are 1280 × 960"),
        *((lambda factor=factor: scaled_image(PAIR[0], factor), f"factor is {factor}") for factor in (0.0, 1.5, 0.001)),
    ):
        with pytest.raises(ValueError, match=message):
            act()


def by_hand(rig: StereoRig, images, alpha: float, zero_disparity: bool = True):
    """Rectify with OpenCV alone; return both images and the result of `stereoRectify`."""
    cameras = (rig.left_matrix, rig.left_distortion), (rig.right_matrix, rig.right_distortion)
    flags = cv2.CALIB_ZERO_DISPARITY if zero_disparity else 0
    made = cv2.stereoRectify(
        *cameras[0], *cameras[1], (WIDTH, HEIGHT), rig.rotation, rig.translation[:, None], flags=flags, alpha=alpha
    )
    maps = [
        cv2.initUndistortRectifyMap(*camera, made[side], made[2 + side], (WIDTH, HEIGHT), cv2.CV_32FC1)
        for side, camera in enumerate(cameras)
    ]
    return [cv2.remap(image, *one, cv2.INTER_LINEAR) for image, one in zip(images, maps, strict=True)], made


@pytest.mark.parametrize(("alpha", "dtype"), [(None, np.uint8), (0.0, np.uint16), (0.4, np.float32), (1.0, np.uint8)])
def test_every_type_is_rectified_as_by_opencv_with_this_alpha(alpha, dtype):
    pair = [image.astype(dtype) * dtype(1 if dtype == np.uint8 else 200) for image in PAIR]
    expected, made = by_hand(RIG, pair, alpha or 0.0)
    left, right, calibration = rectify(*pair, unrectified(RIG), alpha=alpha)
    assert left.dtype == right.dtype == dtype
    np.testing.assert_array_equal(left, expected[0])
    np.testing.assert_array_equal(right, expected[1])
    assert calibration.focal_px == made[2][0, 0]
    assert (calibration.cx, calibration.cy) == (made[2][0, 2], made[2][1, 2])
    assert calibration.baseline_m == pytest.approx(np.linalg.norm(RIG.translation))
    assert (calibration.doffs_px, calibration.width, calibration.height) == (0, WIDTH, HEIGHT)
    assert rectified_calibration(RIG, (WIDTH, HEIGHT), alpha=alpha) == calibration


@pytest.mark.parametrize("zero_disparity", [True, False])
def test_how_its_maker_rectified_the_pair_is_used_unless_alpha_is_given(zero_disparity):
    expected, made = by_hand(RIG, PAIR, 0.6, zero_disparity)
    known = replace(RIG, rectification=Rectification(*made[:4]))
    left, right, calibration = rectify(*PAIR, unrectified(known))
    np.testing.assert_array_equal(left, expected[0])
    np.testing.assert_array_equal(right, expected[1])
    disparity = np.full((HEIGHT, WIDTH), 30, np.float32)
    depth = cv2.reprojectImageTo3D(disparity, made[4])[:, :, 2]
    np.testing.assert_allclose(calibration.depth(disparity), depth, rtol=1e-5)
    np.testing.assert_array_equal(
        rectify(*PAIR, unrectified(known), alpha=0).left, rectify(*PAIR, unrectified(RIG)).left
    )


def test_resized_images_scale_how_its_maker_rectified_the_pair():
    known = replace(RIG, rectification=Rectification(R1, R2, P1, P2))
    pair = [cv2.GaussianBlur(image.astype(np.float32), (0, 0), 3) for image in PAIR]
    small = [cv2.resize(image, (WIDTH // 2, HEIGHT // 2), interpolation=cv2.INTER_AREA) for image in pair]
    full, half = rectify(*pair, unrectified(known)), rectify(*small, unrectified(known))
    assert half.calibration.focal_px == pytest.approx(full.calibration.focal_px / 2)
    assert half.calibration.baseline_m == pytest.approx(full.calibration.baseline_m)
    expected = cv2.resize(full.left, (WIDTH // 2, HEIGHT // 2), interpolation=cv2.INTER_AREA)
    assert np.abs(half.left - expected)[4:-4, 4:-4].mean() < 0.5


FISHEYE = np.array([-0.02, 0.004, -0.003, 0.0005])


@pytest.mark.parametrize("alpha", [None, 0.5])
def test_fisheyes_are_rectified_as_by_opencv_by_hand(alpha):
    matrix = np.array([[200.0, 0, 239], [0, 201, 181], [0, 0, 1]])
    rig = StereoRig(matrix, FISHEYE, matrix, FISHEYE * 1.1, R, T, *SIZE, fisheye=True)
    r1, r2, p1, p2, _ = cv2.fisheye.stereoRectify(
        matrix, FISHEYE, matrix, FISHEYE * 1.1, SIZE, R, T[:, None], cv2.CALIB_ZERO_DISPARITY, balance=alpha or 0.0
    )
    maps = [
        cv2.fisheye.initUndistortRectifyMap(matrix, lens, turn, projection, SIZE, cv2.CV_32FC1)
        for lens, turn, projection in ((FISHEYE, r1, p1), (FISHEYE * 1.1, r2, p2))
    ]
    made = rectify(*PAIR, unrectified(rig), alpha=alpha)
    for found, image, one in zip(made[:2], PAIR, maps, strict=True):
        np.testing.assert_array_equal(found, cv2.remap(image, *one, cv2.INTER_LINEAR))
    assert made.calibration.focal_px == p1[0, 0]
    assert made.calibration.baseline_m == pytest.approx(np.linalg.norm(T))
    for read in (calibration_json(unrectified(rig)), opencv_calibration(unrectified(rig))):
        again = read_calibration(read.encode()).rig
        assert again.fisheye
        np.testing.assert_allclose(again.left_distortion, FISHEYE)


@pytest.mark.parametrize("quarters", [1, -1])
@pytest.mark.parametrize("lens", [D1, np.array([-0.2, 0.05, 0.001, -0.002, 0.01, 0, 0, 0, 0.01, 0.002, -0.004, 0.001])])
def test_cameras_one_above_the_other_are_turned_and_rectified_like_those_side_by_side(quarters, lens):
    rig = StereoRig(M1, lens, M2, D2, R, T, *SIZE)
    upright = rig.turned(-quarters, SIZE)
    assert upright.turn == quarters
    assert (upright.width, upright.height) == SIZE[::-1]
    pair = raw_pair()
    expected = rectify(*pair, unrectified(rig))
    predicted = replace(rectified_calibration(upright, SIZE[::-1]), rig=upright)
    found = rectify(*(turned(image, -quarters) for image in pair), predicted)
    for one, other in zip(found[:2], expected[:2], strict=True):
        assert np.abs(one.astype(float) - other).mean() < 0.1
    assert found.calibration.focal_px == pytest.approx(expected.calibration.focal_px, rel=1e-6)
    assert (predicted.turn, predicted.focal_px) == (quarters, pytest.approx(expected.calibration.focal_px))


def test_a_rectification_that_leaves_hardly_anything_is_refused_with_its_numbers():
    for angle, refused in ((10, False), (55, True)):
        turn = cv2.Rodrigues(np.array([0.0, np.radians(angle), 0]))[0]
        apart = -turn @ [np.cos(np.radians(angle / 2)), 0, np.sin(np.radians(angle / 2)) * (1 if refused else -1)]
        cameras = unrectified(replace(RIG, rotation=turn, translation=0.1 * apart))
        if refused:
            with pytest.raises(
                ValueError, match=r"would be magnified .* times, show .* and fill .*allowed are up to 3"
            ):
                rectify(*PAIR, cameras)
        else:
            rectify(*PAIR, cameras)


CALIBRATION = Calibration(900.0, 0.1, 3.0, 319.5, 239.5, width=640, height=480, num_disparities=64)


@pytest.mark.parametrize(("rows", "cols"), [(50, 50), (49, 51), (51, 49)])
def test_what_differs_by_a_few_pixels_is_cropped_and_nothing_else(rows: int, cols: int) -> None:
    left = np.arange(50 * 50).reshape(50, 50)
    cropped = cropped_to_common_size(left, np.zeros((rows, cols)))
    assert cropped[0].shape == cropped[1].shape == (min(rows, 50), min(cols, 50))
    assert cropped[0][0, 0] == left[0, 0]
    for shape in ((rows + 4, cols), (rows, cols - 4)):
        with pytest.raises(ValueError, match=f"left is 50 × 50 and right is {shape[1]} × {shape[0]} pixels"):
            cropped_to_common_size(left, np.zeros(shape))


def test_a_calibration_fits_the_images_it_was_made_for_resized_or_cropped_a_little() -> None:
    assert calibration_for(CALIBRATION, 640, 480) is CALIBRATION
    assert calibration_for(CALIBRATION, 636, 478) is CALIBRATION
    half = calibration_for(CALIBRATION, 320, 240)
    assert (half.focal_px, half.doffs_px, half.width, half.num_disparities) == (450, 1.5, 320, 32)
    for unsized in (Calibration(900.0, 0.1), OF_NO_SIZE, replace(OF_NO_SIZE, cx=1600.0)):  # turned towards each other
        assert calibration_for(unsized, 600, 500) is unsized


@pytest.mark.parametrize(
    ("size", "divisor"), [((881, 400), 1), ((1000, 1000), 1), ((1001, 1000), 2), ((3000, 2000), 3)]
)
def test_a_preview_has_at_most_a_megapixel(size: tuple[int, int], divisor: int) -> None:
    assert preview_divisor(*size) == divisor
    assert size[0] * size[1] / divisor**2 <= 1_000_000


@pytest.mark.parametrize(
    ("dtype", "shape"), [(np.uint8, (60, 90)), (np.uint16, (60, 90, 3)), (np.float32, (61, 91, 4))]
)
def test_an_image_keeps_its_type_and_its_mean(dtype: type, shape: tuple[int, ...]) -> None:
    image = np.random.default_rng(0).integers(0, 200, shape).astype(dtype)
    small = scaled_image(image, 0.5)
    assert small.dtype == dtype
    assert small.shape[:2] == (30, round(shape[1] * 0.5))
    assert small.mean() == pytest.approx(image.mean(), rel=0.02)


def test_a_disparity_shrinks_with_its_picture_and_invents_nothing() -> None:
    disparity = np.full((40, 60), np.nan)
    disparity[:20] = 10
    disparity[:, 30:] = 40
    small = scaled_disparity(disparity, 0.5)
    assert small.shape == (20, 30)
    assert set(small[np.isfinite(small)]) == {5.0, 20.0}
    assert np.isnan(small[10:, :15]).all()


@pytest.mark.parametrize("bits", [8, 10, 12, 14, 16])
@pytest.mark.parametrize("deep_is_left", [True, False])
def test_8_bits_beside_16_become_one_range(bits: int, deep_is_left: bool) -> None:
    shallow = np.random.default_rng(0).integers(20, 230, (40, 60, 3), dtype=np.uint8)
    deep = np.rint(shallow / 255 * (2**bits - 1)).astype(np.uint16)
    found = as_same_bit_depth(deep, shallow) if deep_is_left else as_same_bit_depth(shallow, deep)
    assert [image.dtype for image in found] == [np.uint16, np.uint16]
    same = deep, deep
    assert all(one is deep for one in as_same_bit_depth(*same))
    # One grey level of a camera with this many bits is the tolerance.
    assert np.abs(found[0].astype(float) - found[1]).max() <= 65535 / (2**bits - 1)
