"""Degraded parts of an image: their position, and the effect of each setting."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from stereolag.templates.trials import Degradation, DegradedPart, degraded_part

RANDOM = np.random.default_rng(7)
SCENE = RANDOM.integers(60, 190, (700, 900, 3), dtype=np.uint8)
SMOOTH = ndimage.gaussian_filter(RANDOM.normal(size=(700, 900)), 6).astype(np.float32)
SHAPE = (31, 40)


def degraded(**settings: float) -> DegradedPart:
    return degraded_part(SCENE, (300, 420), SHAPE, Degradation(**settings))


def window(part: DegradedPart, shape: tuple[int, int] = SHAPE) -> np.ndarray:
    return part.pixels[part.row : part.row + shape[0], part.col : part.col + shape[1]]


@settings(max_examples=40)
@given(
    row=st.integers(0, 700 - 31), col=st.integers(0, 900 - 40), dtype=st.sampled_from(["uint8", "uint16", "float64"])
)
def test_by_default_the_part_is_the_image_itself_wherever_it_is_cut(row: int, col: int, dtype: str) -> None:
    image = SCENE.astype(dtype)
    part = degraded_part(image, (row, col), SHAPE, Degradation())
    rows, cols = part.pixels.shape[:2]
    assert (rows, cols) == (480, 640)
    assert part.pixels.dtype == image.dtype
    np.testing.assert_array_equal(part.pixels, image[part.top : part.top + rows, part.left : part.left + cols])
    assert (part.top + part.row, part.left + part.col) == (row, col)


def test_a_small_image_is_taken_whole_and_alpha_is_dropped() -> None:
    small = np.dstack([SCENE[:50, :60], SCENE[:50, :60, :1]])
    part = degraded_part(small, (19, 20), SHAPE, Degradation())
    np.testing.assert_array_equal(part.pixels, small[:, :, :3])


def test_a_large_template_lies_in_a_part_of_twice_its_size() -> None:
    part = degraded_part(SCENE, (100, 100), (300, 400), Degradation())
    assert part.pixels.shape == (600, 800, 3)


def test_contrast_and_brightness_are_linear() -> None:
    plain, dull = degraded().pixels.astype(float), degraded(contrast=0.5, brightness=-20).pixels.astype(float)
    np.testing.assert_allclose(dull, (plain - plain.mean()) / 2 + plain.mean() - 20, atol=0.5 + 1e-9)


def test_a_level_of_brightness_is_a_255th_of_the_range() -> None:
    deep = degraded_part(SCENE.astype(np.uint16) * 257, (300, 420), SHAPE, Degradation(brightness=10)).pixels
    np.testing.assert_array_equal(deep, degraded(brightness=10).pixels.astype(np.uint16) * 257)


def test_bright_pixels_do_not_wrap_round() -> None:
    part = degraded_part(np.where(SCENE > 100, 250, SCENE).astype(np.uint8), (0, 0), SHAPE, Degradation(brightness=90))
    assert part.pixels.min() >= 150


def test_noise_has_the_spread_asked_for_and_is_the_same_each_time() -> None:
    difference = degraded(noise=8).pixels.astype(float) - degraded().pixels
    assert difference.std() == pytest.approx(8, rel=0.02)
    assert difference.mean() == pytest.approx(0, abs=0.1)
    np.testing.assert_array_equal(degraded(noise=8).pixels, degraded(noise=8).pixels)


@pytest.mark.parametrize("cover", [0.25, 0.5, 1.0])
def test_a_grey_box_covers_its_share_from_below(cover: float) -> None:
    part, plain = degraded(cover=cover), degraded()
    hidden = round(SHAPE[0] * cover)
    assert len(np.unique(window(part)[SHAPE[0] - hidden :])) == 1
    changed = (part.pixels != plain.pixels).any(axis=2)
    # Some pixels of the scene already have the grey of the box.
    assert 0.9 * hidden * SHAPE[1] <= changed.sum() <= hidden * SHAPE[1]
    assert not changed[: part.row].any()


@pytest.mark.parametrize(("turn", "resize"), [(30, 1), (-17, 1), (0, 0.7), (0, 1.4), (25, 1.3)])
def test_turning_and_resizing_keep_the_centre_in_place(turn: float, resize: float) -> None:
    row, col = 320, 430
    height, width = 41, 61  # odd, so that a pixel is in the middle
    part = degraded_part(SMOOTH, (row, col), (height, width), Degradation(turn=turn, resize=resize))
    middle = part.row + height // 2, part.col + width // 2
    assert part.pixels[middle] == pytest.approx(SMOOTH[row + height // 2, col + width // 2], abs=1e-5)
    # The step in the image for a step to the right in the part: y points down, so a turn to the left is negative.
    away = 12
    angle = np.deg2rad(turn)
    here = part.pixels[middle[0], middle[1] + away]
    at = (
        row + height // 2 + away / resize * np.sin(angle),
        col + width // 2 + away / resize * np.cos(angle),
    )
    assert here == pytest.approx(ndimage.map_coordinates(SMOOTH, np.array(at)[:, None], order=1)[0], abs=0.01)


def test_a_wide_image_is_turned_too() -> None:
    wide = np.tile(SMOOTH[:60], (1, 40))  # 36,000 px wide; OpenCV warps at most 32,767
    part = degraded_part(wide, (5, 30_000), SHAPE, Degradation(turn=10))
    assert part.pixels.shape == (60, 640)
    assert part.pixels.std() > 0


@pytest.mark.parametrize("place", [(-1, 0), (0, 861), (670, 0)])
def test_a_place_beyond_the_image_is_refused(place: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match="does not lie within"):
        degraded_part(SCENE, place, SHAPE, Degradation())


@pytest.mark.parametrize("settings", [{"contrast": 0}, {"noise": -1}, {"resize": 3}, {"cover": 1.1}, {"turn": 60}])
def test_settings_are_checked(settings: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(settings))):
        Degradation(**settings)
