"""A pair packed for the browser, and unpacked as the browser does it."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest

from stereolag.core.inputs import as_grey
from stereolag.ui.packing import TRUTH_SCALE, TRUTH_ZERO, packed_grey_pair
from tests.packed import unpacked


def images_of(item: bytes) -> tuple[dict[str, Any], list[np.ndarray]]:
    header, parts = unpacked(item)
    return header, [cv2.imdecode(np.frombuffer(part, np.uint8), cv2.IMREAD_UNCHANGED) for part in parts]


def test_eight_bit_images_arrive_as_the_grey_that_is_matched() -> None:
    left, right = np.random.default_rng(1).integers(0, 256, (2, 30, 40, 3), dtype=np.uint8)
    header, images = images_of(packed_grey_pair(left, right, None, name="here", digest="this pair"))
    assert (header["name"], header["digest"], header["rows"], header["cols"]) == ("here", "this pair", 30, 40)
    assert len(images) == 2
    np.testing.assert_array_equal(images[0], as_grey(left))
    np.testing.assert_array_equal(images[1], as_grey(right))


@pytest.mark.parametrize("dtype", [np.uint16, np.float32])
def test_other_images_are_spread_over_eight_bits_together(dtype: type) -> None:
    left = np.linspace(0, 1000, 1200).reshape(30, 40).astype(dtype)
    _, (eight_bit, right) = images_of(packed_grey_pair(left, left // 2, None, name="", digest=""))
    assert eight_bit.dtype == np.uint8
    assert eight_bit.max() == 255
    assert 120 < right.max() < 135


def test_the_ground_truth_arrives_to_a_sixty_fourth_of_a_pixel() -> None:
    image = np.zeros((2, 3), np.uint8)
    truth = np.array([[26.5, np.nan, 0.0], [-13.27, 300.1, 600.0]], np.float32)
    _, images = images_of(packed_grey_pair(image, image, truth, name="", digest=""))
    codes = images[2][..., 2].astype(int) * 256 + images[2][..., 1]
    found = np.where(codes > 0, codes / TRUTH_SCALE - TRUTH_ZERO, np.nan)
    expected = np.where(truth < 512, truth, np.nan)
    np.testing.assert_allclose(found, expected, atol=0.5 / TRUTH_SCALE)
