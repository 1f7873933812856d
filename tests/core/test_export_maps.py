"""Exported maps and pictures, read back by this library, by OpenCV and by Pillow."""

from __future__ import annotations

import io

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from pairs import shifted_pair
from PIL import Image

from stereolag import StereoBM, read_disparity, read_image
from stereolag.io.disparities import check_kitti, image_png, image_tiff, kitti_png, npy, pfm, valid_mask_png

DISPARITY = np.array([[1.5, np.nan, 30.25], [255.99, 1 / 1024, 0.0]], dtype=np.float32)

maps = hnp.arrays(
    np.float32,
    hnp.array_shapes(min_dims=2, max_dims=2, max_side=12),
    elements=st.just(float("nan")) | st.floats(-1e6, 1e6, width=32),
).filter(lambda disparity: np.isfinite(disparity).any())


def opencv(data: bytes) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)


@given(maps)
def test_pfm_and_npy_come_back_bit_for_bit(disparity):
    for write in (pfm, npy):
        np.testing.assert_array_equal(read_disparity(write(disparity)), disparity)


def test_opencv_and_pillow_read_the_pfm_as_it_is():
    disparity = np.random.default_rng(0).uniform(-40, 300, (40, 50)).astype(np.float32)
    data = pfm(disparity)
    np.testing.assert_array_equal(opencv(data), disparity)
    np.testing.assert_array_equal(np.array(Image.open(io.BytesIO(data))), disparity)


def test_no_answer_is_infinite_in_a_pfm_as_middlebury_has_it():
    data = pfm([[1.0, np.nan], [-np.inf, 4.0]])
    stored = np.frombuffer(data[-16:], "<f4").reshape(2, 2)[::-1]
    np.testing.assert_array_equal(stored, [[1, np.inf], [np.inf, 4]])
    np.testing.assert_array_equal(np.isfinite(opencv(data)), [[True, False], [False, True]])


def test_the_trap_is_the_scale_by_whose_size_opencv_divides():
    """Middlebury's files have 0.00392157 (1/255), others 1/256: OpenCV multiplies the others by 256, we do not."""
    ours = pfm([[10.0, 20.0]])
    theirs = ours.replace(b"-1.0", b"-0.00390625")
    np.testing.assert_array_equal(opencv(theirs), [[2560, 5120]])
    np.testing.assert_array_equal(read_disparity(theirs), [[10, 20]])


@pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.float64])
def test_pfm_takes_any_number(dtype):
    np.testing.assert_array_equal(read_disparity(pfm(np.array([[3, 7]], dtype))), [[3, 7]])


def test_kitti_png_is_the_disparity_times_256_for_everyone():
    expected = np.array([[384, 0, 7744], [65533, 1, 1]], dtype=np.uint16)
    data = kitti_png(DISPARITY)
    for pixels in (opencv(data), np.array(Image.open(io.BytesIO(data))), read_image(data)):
        assert pixels.dtype == np.uint16
        np.testing.assert_array_equal(pixels, expected)


@given(hnp.arrays(np.float32, (3, 4), elements=st.just(float("nan")) | st.floats(-0.484375, 255.984375, width=32)))
def test_kitti_png_comes_back_within_half_a_step(disparity):
    disparity[0, 0] = 5.0
    back = read_disparity(kitti_png(disparity))
    np.testing.assert_array_equal(np.isfinite(back), np.isfinite(disparity))
    known = np.isfinite(disparity)
    np.testing.assert_allclose(back[known], np.maximum(disparity[known], 1 / 256), atol=1 / 512)


@pytest.mark.parametrize("value", [-0.51, -3.0, 256.0, 255.9985, 1e6])
def test_kitti_png_refuses_what_it_cannot_hold(value):
    with pytest.raises(ValueError, match=f"{min(value, 9.0):.2f} to {max(value, 9.0):.2f} px"):
        kitti_png([[9.0, value]])


def test_kitti_png_holds_the_end_of_the_sub_pixel_fit():
    assert opencv(kitti_png(np.array([[-0.5, np.nextafter(-0.5, -1), 3]]))).tolist() == [[1, 1, 768]]


def test_kitti_png_of_nothing_is_all_zero():
    assert not opencv(kitti_png(np.full((2, 3), np.nan))).any()


@pytest.mark.parametrize("write", [pfm, kitti_png])
@pytest.mark.parametrize("shape", [(3,), (2, 2, 1), (0, 4)])
def test_a_map_has_rows_and_columns(write, shape):
    with pytest.raises(ValueError, match="rows, cols"):
        write(np.zeros(shape))


def test_npy_writes_no_objects():
    with pytest.raises(ValueError, match="Object arrays"):
        npy(np.array([{}]))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("shape", [(5, 4), (5, 4, 3), (5, 4, 4)])
def test_pictures_come_back_without_loss(dtype, shape):
    image = np.random.default_rng(1).integers(0, np.iinfo(dtype).max, shape, dtype, endpoint=True)
    back = read_image(image_png(image))
    assert back.dtype == dtype
    np.testing.assert_array_equal(back, image)
    opencv_order = image if len(shape) == 2 else image[:, :, [2, 1, 0, 3][: shape[2]]]
    np.testing.assert_array_equal(opencv(image_png(image)), opencv_order)


def test_a_png_holds_no_floats():
    with pytest.raises(ValueError, match="float32"):
        image_png(np.zeros((2, 2), np.float32))


def test_masks_hold_what_the_result_says():
    result = StereoBM(num_disparities=16, block_size=9).compute(*shifted_pair(40, 90, 0, -5))
    assert 0 < result.coverage < 1
    np.testing.assert_array_equal(opencv(valid_mask_png(result)), np.where(result.valid, 255, 0))


@pytest.mark.parametrize("worst", [-0.6, 256.0])
def test_what_kitti_cannot_hold_is_told_before_it_is_written(worst):
    disparity = np.array([[1, worst]], dtype=np.float32)
    for act in (check_kitti, kitti_png):
        with pytest.raises(ValueError, match="KITTI's PNG holds 0 to"):
            act(disparity)
    check_kitti(DISPARITY)
    check_kitti(np.full((2, 2), np.nan))


def test_floats_come_back_from_a_tiff_bit_for_bit():
    image = np.random.default_rng(0).normal(0, 1e3, (7, 9)).astype(np.float32)
    np.testing.assert_array_equal(read_image(image_tiff(image)), image)
    for bad in (image.astype(np.uint8), np.stack([image] * 3, axis=-1)):
        with pytest.raises(ValueError, match="allowed is"):
            image_tiff(bad)
