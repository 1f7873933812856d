"""A template search to do by hand: reduced, narrowed as one would by looking, and packed without loss."""

import io
from typing import Any

import cv2
import numpy as np
import PIL.Image
import pytest
from sprites import SPRITE_PLACE, sprite_scene

from stereolag.core.arrays import Array
from stereolag.figures.templates import relief
from stereolag.templates import match_template
from stereolag.templates.by_hand import (
    MAX_ANCHORS,
    MAX_DOTS,
    Anchor,
    ReducedSearch,
    anchors,
    best_of_blocks,
    reduced_search,
)
from stereolag.ui.components import SCORE_STEPS, packed_score_map, packed_search
from tests.packed import unpacked

PLACE = (97, 290)


def scene(rows: int = 600, cols: int = 900, *, dtype: Any = np.uint8) -> tuple[Array, Array]:
    """Return a smooth picture of noise, and 48 × 60 pixels of it as an RGBA template with clear corners."""
    noise = np.random.default_rng(1).normal(size=(rows, cols, 3))
    smooth = cv2.GaussianBlur(noise, (0, 0), 3)
    picture = np.rint(cv2.normalize(smooth, None, 10, 240, cv2.NORM_MINMAX)).astype(np.uint8)
    row, col = PLACE
    cut = picture[row : row + 48, col : col + 60]
    down, right = np.mgrid[:48, :60]
    alpha = 255 * ((down / 23.5 - 1) ** 2 + (right / 29.5 - 1) ** 2 < 1.2)
    template = np.dstack([cut, alpha]).astype(np.uint8)
    scale = 100 if dtype == np.uint16 else 1
    return picture.astype(dtype) * scale, template.astype(dtype) * scale


def pearson(search: ReducedSearch, row: int, col: int) -> float:
    height, width = search.opaque.shape
    window = search.picture[row : row + height, col : col + width][search.opaque].astype(float)
    template = search.template[search.opaque].astype(float)
    return float(np.corrcoef((window - window.mean(0)).ravel(), (template - template.mean(0)).ravel())[0, 1])


# Reduced


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_the_place_falls_on_a_pixel_and_scores_as_before_it_was_reduced(dtype: Any) -> None:
    picture, template = scene(dtype=dtype)
    search = reduced_search(picture, template, None, near=PLACE, pixels=70_000)
    assert search.factor == 3
    row, col, score = search.leaders[0]
    assert (search.row + 3 * row, search.col + 3 * col) == PLACE
    assert score > 0.995
    if dtype == np.uint8:
        block = np.s_[search.row + 15 : search.row + 18, search.col + 21 : search.col + 24]
        np.testing.assert_allclose(search.picture[5, 7], picture[block].mean((0, 1)), atol=0.51)


def test_the_scores_are_those_of_the_reduced_pixels_and_leaders_are_a_template_apart() -> None:
    search = reduced_search(*scene(), None, pixels=70_000)
    for row, col in [(0, 0), (40, 100), (52, 97), (search.score_map.shape[0] - 1, search.score_map.shape[1] - 1)]:
        assert search.score_map[row, col] == pytest.approx(pearson(search, row, col), abs=1e-5)
    leaders = search.leaders
    assert len(leaders) == 4
    assert [score for _, _, score in leaders] == sorted((score for _, _, score in leaders), reverse=True)
    for number, (row, col, _) in enumerate(leaders):
        assert all(abs(row - r) >= 16 or abs(col - c) >= 20 for r, c, _ in leaders[:number])


@pytest.mark.parametrize("near", [(107, 310), (0, 0), (884, 1384)])
def test_a_small_template_in_a_large_picture_is_shown_in_a_part_around_its_place(near: tuple[int, int]) -> None:
    picture, _ = scene(900, 1400)
    template = picture[near[0] : near[0] + 16, near[1] : near[1] + 16]
    search = reduced_search(picture, template, None, near=near, pixels=50_000)
    assert search.part and search.factor == 1
    assert search.picture.shape[0] * search.picture.shape[1] < 2 * 50_000
    row, col, score = search.leaders[0]
    assert (search.row + row, search.col + col) == near and score > 0.999


@pytest.mark.parametrize("size", [(1, 2), (2, 1), (2, 2), (40, 3), (5, 300)])
def test_a_template_may_be_as_narrow_as_a_pixel(size: tuple[int, int]) -> None:
    picture = np.random.default_rng(0).integers(0, 256, (300, 500), dtype=np.uint8)
    for image in (picture, np.dstack([picture, picture.T[:300, :300].repeat(2, 1)[:, :500], picture])):
        template = image[20 : 20 + size[0], 30 : 30 + size[1]]
        search = reduced_search(image, template, None, near=(20, 30), pixels=20_000)
        assert search.factor == 1 and search.part
        assert search.score_map[20 - search.row, 30 - search.col] == pytest.approx(1)


def test_a_template_as_large_as_the_picture_has_one_place_and_a_constant_one_none() -> None:
    picture, _ = scene(601, 902)
    search = reduced_search(picture, picture, None, pixels=70_000)
    assert search.score_map.shape == (1, 1) and search.score_map[0, 0] == pytest.approx(1)
    stripes = np.tile(np.array([[0, 255]], dtype=np.uint8), (48, 24))
    with pytest.raises(ValueError, match="constant"):
        reduced_search(picture[:, :, 0], stripes, None, pixels=140_000)


def test_grey_beside_colour_is_compared_by_luminance() -> None:
    picture, template = scene(200, 400)
    search = reduced_search(picture[:, :, 1], template, None)
    assert (search.picture[..., 0] == search.picture[..., 2]).all()
    assert search.leaders[0][:2] == PLACE


# Packed


def decoded(part: bytes) -> Array:
    return np.asarray(PIL.Image.open(io.BytesIO(part))).astype(int)


def test_the_browser_gets_the_pixels_and_scores_without_loss() -> None:
    picture, template = scene(200, 400)
    picture[:60, :90] = 77
    search = reduced_search(picture, template, None)
    assert (search.factor, search.row, search.col, search.part) == (1, 0, 0, False)
    np.testing.assert_array_equal(search.picture, picture)
    np.testing.assert_array_equal(search.opaque, template[:, :, 3] == 255)
    header, parts = unpacked(packed_search(search, name="here", words={"said": "so"}))
    shown, sought, codes, colours = map(decoded, parts)
    np.testing.assert_array_equal(shown, search.picture)
    np.testing.assert_array_equal(sought, np.dstack([search.template, 255 * search.opaque]))
    assert colours.shape[:2] == search.score_map.shape
    whole = 256 * codes[..., 0] + codes[..., 1]
    scores = np.where(whole > 0, (whole - 1) / SCORE_STEPS - 1, np.nan)
    assert np.isnan(scores[0, 0])
    np.testing.assert_allclose(scores, search.score_map, atol=1 / SCORE_STEPS)
    assert header["leaders"][0]["row"] == PLACE[0] and header["words"] == {"said": "so"}


def test_a_relief_is_as_high_as_its_scores() -> None:
    search = reduced_search(*scene(200, 400), None)
    reliefs = [relief(search, row, col)[..., 3].any(axis=1) for row, col in (PLACE, (0, 0))]
    side = len(reliefs[0])
    peak, corner = (side - np.flatnonzero(shown)[0] for shown in reliefs)
    assert peak - corner > 0.2 * side and all(np.flatnonzero(shown)[-1] > 0.9 * side for shown in reliefs)


@pytest.mark.parametrize("factor", [1, 3, 4])
@pytest.mark.parametrize("rows_of_map", [31, 200])
def test_a_block_is_read_at_its_best_place(factor: int, rows_of_map: int) -> None:
    scores = np.random.default_rng(0).uniform(-1, 1, (rows_of_map, 46)).astype(np.float32)
    scores[:5, :5] = np.nan
    best, down, right = best_of_blocks(scores, factor)
    rows, cols = np.indices(best.shape) * factor
    assert np.isnan(best[0, 0]) and np.isnan(best).sum() == (5 // factor) ** 2
    np.testing.assert_array_equal(np.where(np.isnan(best), np.nan, scores[rows + down, cols + right]), best)
    for row, col in np.argwhere(~np.isnan(best)):
        block = scores[row * factor : (row + 1) * factor, col * factor : (col + 1) * factor]
        assert best[row, col] == np.nanmax(block)


def test_a_wide_score_map_travels_in_blocks() -> None:
    scores = np.zeros((20, 1500), dtype=np.float32)
    header, parts = unpacked(packed_score_map(b"a picture", scores, name="here", words={}))
    assert header["factor"] == 3 and parts[0] == b"a picture"
    assert decoded(parts[1]).shape == (7, 500, 3)


# By anchors


def by_looking(image: Array, sprite: Array, anchor: Anchor) -> tuple[set[Any], set[Any], set[Any]]:
    """Return the positions left by every stage, each position tried in turn."""
    height, width = sprite.shape[:2]
    places = [(row, col) for row in range(image.shape[0] - height + 1) for col in range(image.shape[1] - width + 1)]

    def agrees(place: tuple[int, int], col: int) -> bool:
        return bool((image[place[0] + anchor.row, place[1] + col] == sprite[anchor.row, col, :3]).all())

    coloured = {place for place in places if agrees(place, anchor.col)}
    agreeing = {place for place in coloured if all(agrees(place, end) for end in anchor.run)}
    scored = {(row + down, col + right) for row, col in agreeing for down in (-1, 0, 1) for right in (-1, 0, 1)}
    return coloured, agreeing, scored & set(places)


def test_each_stage_keeps_the_places_that_one_finds_by_looking() -> None:
    image, sprite = sprite_scene(0)
    found = anchors(image, sprite, None, seed=5)
    assert 8 <= len(found) <= MAX_ANCHORS
    assert len({anchor.colour for anchor in found}) == len(found)
    assert match_template(image, sprite, method="sampled", seed=5).candidates == found[0].counts[3]
    for anchor in found:
        stages = by_looking(image, sprite, anchor)
        assert anchor.counts == (90 * 120, *map(len, stages))
        for places, dots in zip(stages, anchor.dots, strict=True):
            held = {(row + anchor.row, col + anchor.col) for row, col in places}
            assert held >= set(dots) and len(dots) == len(set(dots))
            assert held == set(dots) or MAX_DOTS / 2 < len(dots) <= MAX_DOTS
        assert anchor.colour == tuple(sprite[anchor.row, anchor.col, :3].tolist())
        assert sprite[anchor.row, anchor.run[0] : anchor.run[1] + 1, 3].all()
        assert anchor.best == (*SPRITE_PLACE, pytest.approx(1))
    mask = np.zeros(sprite.shape[:2], dtype=np.uint8)
    mask[3:9, 5:12] = 1
    assert {(3 <= anchor.row < 9, anchor.run) for anchor in anchors(image, sprite, mask)} == {(True, (5, 11))}
    with pytest.raises(ValueError, match="image holds uint16 and template uint8"):
        anchors(image.astype(np.uint16), sprite, None)


def test_many_dots_are_thinned_many_places_not_scored_and_of_many_colours_rare_and_common_ones_are_offered() -> None:
    image = np.random.default_rng(0).integers(0, 3, (400, 500), dtype=np.uint8)
    for anchor in anchors(image, image[100:220, 200:330], None):
        assert anchor.counts[1] > 20_000
        assert MAX_DOTS / 2 < len(anchor.dots[0]) <= MAX_DOTS
        assert anchor.best is None
    image = (np.random.default_rng(0).normal(128, 25, (200, 300)).clip(0, 255)).astype(np.uint8)
    counts = [anchor.counts[1] for anchor in anchors(image, image[40:90, 60:130], None)]
    assert len(counts) == MAX_ANCHORS
    assert max(counts) > 20 * min(counts)
    assert np.mean(counts[:8]) < np.mean(counts[8:])
