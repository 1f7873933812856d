"""Arbitrary pictures become a pair of one size, with a matching calibration."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereolag.geometry.calibration import Calibration
from stereolag.geometry.rectification import calibration_for, cropped_alike, halves, preview_divisor
from stereolag.io.pairing import natural_order

CALIBRATION = Calibration(900.0, 0.1, 3.0, 319.5, 239.5, width=640, height=480, num_disparities=64)


@pytest.mark.parametrize("cols", [2, 3, 10, 11])
@pytest.mark.parametrize("channels", [(), (3,), (4,)])
def test_a_side_by_side_picture_is_split_down_the_middle(cols: int, channels: tuple[int, ...]) -> None:
    image = np.random.default_rng(0).integers(0, 255, (4, cols, *channels), dtype=np.uint8)
    left, right = halves(image)
    assert left.shape == right.shape == (4, cols // 2, *channels)
    np.testing.assert_array_equal(left, image[:, : cols // 2])
    np.testing.assert_array_equal(right, image[:, cols - cols // 2 :])


def test_one_column_cannot_be_split() -> None:
    with pytest.raises(ValueError, match="1 pixel wide"):
        halves(np.zeros((4, 1)))


@given(rows=st.integers(40, 60), cols=st.integers(40, 60))
def test_what_differs_by_a_few_pixels_is_cropped_and_nothing_else(rows: int, cols: int) -> None:
    left, right = np.arange(50 * 50).reshape(50, 50), np.zeros((rows, cols))
    if abs(rows - 50) > 0.03 * max(rows, 50) or abs(cols - 50) > 0.03 * max(cols, 50):
        with pytest.raises(ValueError, match=f"left is 50 × 50 and right is {cols} × {rows} pixels"):
            cropped_alike(left, right)
    else:
        cropped = cropped_alike(left, right)
        assert cropped[0].shape == cropped[1].shape == (min(rows, 50), min(cols, 50))
        assert cropped[0][0, 0] == left[0, 0]


def test_a_calibration_fits_the_images_it_was_made_for_resized_or_cropped_a_little() -> None:
    assert calibration_for(CALIBRATION, 640, 480) is CALIBRATION
    assert calibration_for(CALIBRATION, 636, 478) is CALIBRATION
    half = calibration_for(CALIBRATION, 320, 240)
    assert (half.focal_px, half.doffs_px, half.width, half.num_disparities) == (450, 1.5, 320, 32)
    unsized = Calibration(900.0, 0.1)
    assert calibration_for(unsized, 11, 7) is unsized


def test_a_calibration_for_another_shape_is_refused() -> None:
    with pytest.raises(ValueError, match="for 640 × 480 pixels and the images are 640 × 360"):
        calibration_for(CALIBRATION, 640, 360)


@pytest.mark.parametrize(
    ("size", "divisor"), [((881, 400), 1), ((1000, 1000), 1), ((1001, 1000), 2), ((3000, 2000), 3)]
)
def test_a_preview_has_at_most_a_megapixel(size: tuple[int, int], divisor: int) -> None:
    assert preview_divisor(*size) == divisor
    assert size[0] * size[1] / divisor**2 <= 1_000_000


def test_a_raised_two_in_a_name_is_a_letter_like_others() -> None:
    assert sorted(["a10", "a²", "a2"], key=natural_order) == ["a2", "a10", "a²"]
