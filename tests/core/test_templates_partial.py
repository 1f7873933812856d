"""Templates of which not all counts or shows: soft alpha, blurred masks, shapes of one colour, pixels without data."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from skimage.data import chelsea, coffee

from stereolag import match_template
from stereolag.core.jobs import silent
from stereolag.core.searches import TemplateMethod
from stereolag.templates.hidden_parts import hidden_places
from stereolag.templates.patterns import opacity, pattern_of, weights_of
from stereolag.templates.score_maps import scores_at

Array = npt.NDArray[Any]
METHODS: tuple[TemplateMethod, ...] = ("fft", "direct")


def photograph(seed: int, rows: int = 200, cols: int = 260) -> Array:
    """Return a part of a photograph."""
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


@pytest.mark.parametrize("seed", range(4))
def test_a_glow_is_found_by_its_bright_centre(seed: int) -> None:
    random, away = np.random.default_rng(seed), distance(45)[:, :, np.newaxis]
    inner, outer = np.array([255, 255, 200]), np.array([255, random.integers(0, 120), 0])
    colours = inner * np.maximum(1 - away, 0) + outer * np.minimum(away, 1)
    sprite = np.rint(np.dstack([colours, 255 * np.maximum(1 - away, 0)])).astype(np.uint8)
    picture = shown(photograph(seed), sprite, 61, 90)
    search = match_template(picture, sprite)
    assert search.reason == "clear"
    assert np.hypot(search.matches[0].row - 61, search.matches[0].col - 90) <= 1
    other = sprite[:, :, [2, 1, 0, 3]]
    assert not match_template(picture, other).found


def test_an_alpha_of_254_but_for_one_pixel_is_opaque() -> None:
    picture = photograph(1)
    sprite = np.dstack([photograph(0, 40, 40), np.where(distance(40) < 0.9, 254, 0)]).astype(np.uint8)
    sprite[20, 20, 3] = 255
    search = match_template(shown(picture, sprite, 50, 70), sprite)
    assert search.found and (search.matches[0].row, search.matches[0].col) == (50, 70)


@pytest.mark.parametrize("kind", ["blurred", "jpeg"])
@pytest.mark.parametrize("seed", range(3))
def test_a_blurred_or_recompressed_mask_hides_the_background_all_the_same(kind: str, seed: int) -> None:
    template, hard = photograph(seed, 50, 50), np.where(distance(50) < 0.8, 255, 0).astype(np.uint8)
    mask = cv2.GaussianBlur(hard, (0, 0), 3)
    if kind == "jpeg":
        mask = np.asarray(cv2.imdecode(cv2.imencode(".jpg", hard, [cv2.IMWRITE_JPEG_QUALITY, 60])[1], 0))
        assert (np.unique(mask[hard == 0]) > 0).any()
    picture = shown(photograph(seed + 5), np.dstack([template, hard]), 33, 140)
    search = match_template(picture, template, mask=mask)
    assert search.found and (search.matches[0].row, search.matches[0].col) == (33, 140)


@pytest.mark.parametrize("seed", range(6))
def test_a_shape_of_one_colour_is_found_by_its_edges(seed: int) -> None:
    colour = np.random.default_rng(seed).choice([(255, 255, 255), (20, 20, 20), (40, 160, 60)])
    alpha = np.rint(shape_of(seed) * (255 if seed % 2 else 150))
    sprite = np.dstack([np.broadcast_to(colour, (48, 48, 3)), alpha]).astype(np.uint8)
    picture = shown(photograph(seed), sprite, 70, 100)
    for method in METHODS[: 1 + (seed == 0)]:
        search = match_template(picture, sprite, method=method)
        assert search.reason == "clear" and (search.matches[0].row, search.matches[0].col) == (70, 100)
    absent = match_template(photograph(seed), sprite)
    assert absent.best is not None and absent.best.score < 0.5


def test_a_shape_of_one_colour_is_found_turned() -> None:
    alpha = np.rint(shape_of(1) * 255).astype(np.uint8)
    turned = cv2.warpAffine(alpha, cv2.getRotationMatrix2D((23.5, 23.5), 30, 1), (48, 48), flags=cv2.INTER_CUBIC)
    white = np.full((48, 48, 3), 255, dtype=np.uint8)
    picture = shown(photograph(0, 120, 140), np.dstack([white, turned]), 40, 50)
    best = match_template(picture, np.dstack([white, alpha]), rotations=(10, 50)).best
    assert best is not None
    assert abs(best.rotation - 30) < 3
    assert np.hypot(best.row + best.height / 2 - 64, best.col + best.width / 2 - 74) < 2


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("mark", [np.nan, -32768, 1e6, -np.finfo(np.float32).max])
@pytest.mark.parametrize("masked", [False, True])
def test_pixels_without_data_hide_only_the_windows_that_hold_them(
    method: TemplateMethod, mark: float, masked: bool
) -> None:
    image = photograph(0, 60, 80)[:, :, 0].astype(np.float32) / 255
    template = image[20:32, 50:65].copy()
    image[5:9, :20] = mark
    image[55, 70] = mark
    mask = distance(15)[1:13] < 1 if masked else None
    search = match_template(image, template, method=method, mask=mask)
    assert search.found and (search.matches[0].row, search.matches[0].col) == (20, 50)
    assert search.score_map is not None
    assert np.isnan(search.score_map[:9, :20]).all()
    assert np.isnan(search.score_map).sum() == 9 * 20 + 5 * 10  # of the region, and of the single pixel
    assert search.left_out == pytest.approx((9 * 20 + 5 * 10) / search.score_map.size)
    unmarked = match_template(np.where(image == mark, 0, image), template, method=method, mask=mask).score_map
    assert unmarked is not None
    np.testing.assert_allclose(search.score_map[10:40], unmarked[10:40], atol=1e-4)


def test_one_hot_pixel_leaves_all_other_places_their_scores() -> None:
    image = photograph(1, 60, 80)[:, :, 0].astype(np.float32) / 255
    hot = image.copy()
    hot[50, 10] = 500
    plain, spoilt = (match_template(one, image[20:32, 50:65]).score_map for one in (image, hot))
    assert plain is not None and spoilt is not None
    assert np.isfinite(spoilt).all()
    np.testing.assert_allclose(spoilt[:38, 25:], plain[:38, 25:], atol=1e-4)


def test_the_alpha_of_a_grey_template_is_its_mask() -> None:
    image, template = photograph(0)[:, :, 0], photograph(2, 40, 50)[:, :, :2].copy()
    template[:, :, 1] = np.where(distance(50)[5:45] < 0.8, 255, 0)
    image[30:70, 100:150] = np.where(template[:, :, 1] > 0, template[:, :, 0], image[30:70, 100:150])
    search = match_template(image, template)
    assert search.found and (search.matches[0].row, search.matches[0].col) == (30, 100)


def test_signed_integers_are_searched() -> None:
    image = photograph(0, 90, 90)[:, :, 0].astype(np.int16) * 40 - 9999
    search = match_template(image, image[20:40, 30:52])
    assert search.found and (search.matches[0].row, search.matches[0].col) == (20, 30)


def score_near(image: Array, template: Array, row: int, col: int) -> float:
    """Return the score of the place of a template of which a part is hidden, if it is among the likeliest."""
    places = hidden_places(image, pattern_of(template, np.ones(template.shape[:2])), silent)
    near = (np.abs(places.rows - row) <= 1) & (np.abs(places.cols - col) <= 1)
    return float(places.scores[near].max(initial=-1))


@pytest.mark.parametrize("share", [0.2, 0.4])
@pytest.mark.parametrize("seed", [0, 1, 6, 7])
def test_a_covered_template_is_told_by_the_blocks_that_agree(seed: int, share: float) -> None:
    picture, random = photograph(seed, 240, 300), np.random.default_rng(seed)
    template = picture[60:130, 90:170].copy()
    wide = round(80 * share)
    picture[60:130, 170 - wide : 170] = photograph(seed + 1, 70, wide) if seed % 2 else random.integers(0, 256, 3)
    assert score_near(picture, template, 60, 90) > 0.9


@pytest.mark.parametrize(("side", "dtype"), [(0, np.uint8), (1, np.float32), (2, np.uint8), (3, np.float32)])
def test_a_template_may_be_outside_by_nearly_a_half(side: int, dtype: type) -> None:
    picture = photograph(side, 240, 300).astype(dtype)
    template = picture[80:160, 100:190].copy()
    shown, (row, col) = (
        (picture[115:], (-35, 100)),
        (picture[:125], (80, 100)),
        (picture[:, 140:], (80, -40)),
        (picture[:, :150], (80, 100)),
    )[side]
    assert score_near(shown, template, row, col) > 0.9


def test_pixels_without_data_hide_a_part_too() -> None:
    picture = photograph(1, 240, 300).astype(np.float32)
    template = picture[60:130, 90:170].copy()
    picture[100:200, 20:130] = np.nan
    assert score_near(picture, template, 60, 90) > 0.9


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


def test_a_place_beside_pixels_without_data_is_found() -> None:
    image = photograph(1, 90, 120).astype(np.float32)
    template = image[30:62, 40:80].copy()
    image[25:33, 70:90] = np.nan
    search = match_template(image, template)
    assert search.found and (search.matches[0].row, search.matches[0].col) == (30, 40)
