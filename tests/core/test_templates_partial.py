"""Templates of which not all counts or shows: soft alpha, blurred masks, shapes of one colour, pixels without data."""

import cv2
import numpy as np
import pytest
from PIL import Image as PillowImage
from skimage.data import chelsea, coffee

from stereolag import match_template
from stereolag.core.arrays import Array
from stereolag.core.jobs import silent
from stereolag.core.searches import TemplateMethod
from stereolag.templates.hidden_parts import hidden_places
from stereolag.templates.patterns import opacity, pattern_of, weights_of
from stereolag.templates.score_maps import scores_at

METHODS: tuple[TemplateMethod, ...] = ("fft", "direct")


def photograph(seed: int, rows: int = 200, cols: int = 260) -> Array:
    random = np.random.default_rng(seed)
    whole = (chelsea, coffee)[seed % 2]()
    top, left = (random.integers(0, length - side) for length, side in zip(whole.shape, (rows, cols), strict=False))
    return np.asarray(whole[top : top + rows, left : left + cols])


def distance(side: int) -> Array:
    """Return the distance from the centre of a square over half its side."""
    rows, cols = np.mgrid[:side, :side] - (side - 1) / 2
    return np.asarray(np.hypot(rows, cols) / (side / 2))


def shown(picture: Array, sprite: Array, row: int, col: int) -> Array:
    """Return the picture with an RGBA sprite drawn over it."""
    drawn = picture.astype(np.float64)
    cover, side = sprite[:, :, 3:] / 255, np.s_[row : row + sprite.shape[0], col : col + sprite.shape[1]]
    drawn[side] = cover * sprite[:, :, :3] + (1 - cover) * drawn[side]
    return np.rint(drawn).astype(np.uint8)


def shape_of(seed: int, side: int = 48) -> Array:
    """Return the alpha of a random icon, 0..1, smooth at its rim."""
    random = np.random.default_rng(seed)
    fine = np.zeros((8 * side, 8 * side), dtype=np.uint8)
    for _ in range(4):
        cv2.line(fine, *random.integers(side, 7 * side, (2, 2)).tolist(), 255, side // 2)
    cv2.circle(fine, random.integers(2 * side, 6 * side, 2).tolist(), side, 255, side // 3)
    return np.asarray(cv2.resize(fine, (side, side), interpolation=cv2.INTER_AREA) / 255)


@pytest.mark.parametrize("seed", range(6))
def test_both_maps_are_the_weighted_definition(seed: int) -> None:
    """Under a mask, as far as single precision goes: in windows with little contrast beside others with much."""
    image, template = photograph(seed, 40, 50), photograph(seed + 1, 12, 15)
    mask = np.random.default_rng(seed).random((12, 15))
    pattern = pattern_of(template, weights_of(opacity(template, mask)))
    rows, cols = np.indices((29, 36)).reshape(2, -1)
    expected = scores_at(image, pattern.deviations, pattern.weights, rows, cols).reshape(29, 36)
    fast, exact = (np.asarray(match_template(image, template, mask=mask, method=one).score_map) for one in METHODS)
    np.testing.assert_allclose(exact, expected, atol=1e-6)
    np.testing.assert_allclose(fast, expected, atol=2.5e-5)


def test_a_shape_of_one_colour_is_found_turned() -> None:
    alpha = np.rint(shape_of(1) * 255).astype(np.uint8)
    turned = cv2.warpAffine(alpha, cv2.getRotationMatrix2D((23.5, 23.5), 30, 1), (48, 48), flags=cv2.INTER_CUBIC)
    white = np.full((48, 48, 3), 255, dtype=np.uint8)
    picture = shown(photograph(0, 120, 140), np.dstack([white, turned]), 40, 50)
    best = match_template(picture, np.dstack([white, alpha]), rotations=(10, 50)).best
    assert abs(best.rotation - 30) < 3
    assert np.hypot(best.row + best.height / 2 - 64, best.col + best.width / 2 - 74) < 2


def coloured(alpha: Array, colour: tuple[int, int, int]) -> Array:
    """Return a shape of one colour as RGBA from its alpha, 0..1."""
    return np.dstack([np.full((*alpha.shape, 3), colour), np.rint(255 * alpha)]).astype(np.uint8)


@pytest.mark.parametrize("way", ["rings", "fringe of black", "fringe of white", "times alpha"])
@pytest.mark.parametrize("seed", range(3))
def test_a_shape_of_one_colour_is_found_whatever_resampling_made_of_its_rim(seed: int, way: str) -> None:
    large = coloured(shape_of(seed, 160), (200, 90, 60))
    sprite = coloured(cv2.resize(large[:, :, 3], (32, 32), interpolation=cv2.INTER_AREA) / 255, (200, 90, 60))
    picture = shown(photograph(seed), sprite, 70, 100)
    if way == "rings":
        sprite = np.asarray(PillowImage.fromarray(large).resize((32, 32), PillowImage.Resampling.LANCZOS))
    elif way == "times alpha":
        sprite[:, :, :3] = sprite[:, :, :3] * (sprite[:, :, 3:] / 255)
    else:
        large[large[:, :, 3] == 0, :3] = 255 if way == "fringe of white" else 0
        sprite = cv2.resize(large, (32, 32), interpolation=cv2.INTER_AREA)
    search = match_template(picture, sprite)
    assert search.found and (search.matches[0].row, search.matches[0].col) == (70, 100)


@pytest.mark.parametrize("seed", range(4))
def test_a_shape_in_another_colour_is_not_the_template_and_half_transparent_it_is(seed: int) -> None:
    alpha, white = shape_of(seed, 40), np.full((200, 260, 3), 235, dtype=np.uint8)
    red, others = coloured(alpha, (200, 40, 50)), [(40, 160, 60), (50, 70, 200), (220, 170, 30), (150, 60, 180)]
    for number, colour in enumerate(others):
        white = shown(white, coloured(alpha, colour), 20 + 90 * (number // 2), 20 + 90 * (number % 2))
    search = match_template(white, red)
    assert not search.found and search.reason == "other_colours"
    for cover in (1.0, 0.5):
        search = match_template(shown(white, coloured(alpha * cover, (200, 40, 50)), 60, 205), red)
        assert search.found and (search.matches[0].row, search.matches[0].col) == (60, 205)


@pytest.mark.parametrize("seed", [6, 14])
def test_another_soft_sprite_is_not_found_anywhere(seed: int) -> None:
    sprite, other = (
        np.dstack([photograph(number, 32, 32), 255 * np.clip(1 - distance(32), 0, 1) ** 0.7]).round().astype(np.uint8)
        for number in (seed + 1, seed + 51)
    )
    row, col = map(int, np.random.default_rng(seed).integers(10, 150, 2))
    assert not match_template(shown(photograph(seed), other, row, col), sprite).found


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("mark", [np.nan, -32768, 1e6, -np.finfo(np.float32).max])
@pytest.mark.parametrize("masked", [False, True])
def test_pixels_without_data_hide_only_the_windows_that_hold_them(method, mark, masked):
    image = photograph(0, 60, 80)[:, :, 0].astype(np.float32) / 255
    template = image[20:32, 50:65].copy()
    image[5:9, :20] = mark
    image[55, 70] = mark
    mask = distance(15)[1:13] < 1 if masked else None
    search = match_template(image, template, method=method, mask=mask)
    assert search.found and (search.matches[0].row, search.matches[0].col) == (20, 50)
    assert np.isnan(search.score_map[:9, :20]).all()
    assert np.isnan(search.score_map).sum() == 9 * 20 + 5 * 10  # of the region, and of the single pixel
    assert search.left_out == pytest.approx((9 * 20 + 5 * 10) / search.score_map.size)
    unmarked = match_template(np.where(image == mark, 0, image), template, method=method, mask=mask).score_map
    np.testing.assert_allclose(search.score_map[10:40], unmarked[10:40], atol=1e-4)


def test_one_hot_pixel_leaves_all_other_places_their_scores() -> None:
    image = photograph(1, 60, 80)[:, :, 0].astype(np.float32) / 255
    hot = image.copy()
    hot[50, 10] = 500
    plain, spoilt = (match_template(one, image[20:32, 50:65]).score_map for one in (image, hot))
    assert np.isfinite(spoilt).all()
    np.testing.assert_allclose(spoilt[:38, 25:], plain[:38, 25:], atol=1e-4)


def test_the_alpha_of_a_grey_template_is_its_mask_in_a_grey_and_in_a_coloured_picture() -> None:
    part, alpha = photograph(2, 40, 50), np.rint(255 * (distance(50)[5:45] < 0.8))
    picture = shown(photograph(0), np.dstack([part, alpha]), 30, 100)
    template = np.dstack([cv2.cvtColor(part, cv2.COLOR_RGB2GRAY), alpha]).astype(np.uint8)
    for one in (picture, cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)):
        search = match_template(one, template)
        assert search.found and (search.matches[0].row, search.matches[0].col) == (30, 100)


def test_pixels_without_data_hide_a_part_too() -> None:
    picture = photograph(1, 240, 300).astype(np.float32)
    template = picture[60:130, 90:170].copy()
    picture[100:200, 20:130] = np.nan
    places = hidden_places(picture, pattern_of(template, np.ones((70, 80))), silent)
    near = (np.abs(places.rows - 60) <= 1) & (np.abs(places.cols - 90) <= 1)
    assert places.scores[near].max() > 0.9


def test_nothing_is_told_of_templates_with_too_little_in_a_block() -> None:
    picture = photograph(0)
    assert hidden_places(picture, pattern_of(picture[50:62, 60:75], np.ones((12, 15))), silent).rows.size == 0


@pytest.mark.parametrize("seed", [0, 2, 3, 4, 5])
def test_another_shape_of_the_same_outline_is_not_found(seed: int) -> None:
    ring = np.where(np.abs(distance(48) - 0.85) < 0.12, 1.0, 0.0)
    inner = [cv2.resize(shape_of(number, 28), (24, 24), interpolation=cv2.INTER_AREA) for number in (seed, seed + 9)]
    white = np.full((48, 48, 3), 255)
    sprites = []
    for mark in inner:
        alpha = ring.copy()
        alpha[12:36, 12:36] = np.maximum(alpha[12:36, 12:36], mark)
        sprites.append(np.dstack([white, np.rint(255 * alpha)]).astype(np.uint8))
    assert match_template(shown(photograph(seed), sprites[0], 70, 100), sprites[0]).found
    assert not match_template(shown(photograph(seed), sprites[1], 70, 100), sprites[0]).found


@pytest.mark.parametrize("side", (43, 133))
def test_a_template_that_is_flat_but_for_its_rim_is_searched_for_hidden_parts_too(side: int) -> None:
    picture = np.random.default_rng(0).integers(0, 255, (200, 200), dtype=np.uint8)
    template = np.full((side, side + 7), 100, dtype=np.uint8)
    template[0, 0] = 255
    assert match_template(picture, template).reason == "low_score"
