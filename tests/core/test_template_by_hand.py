from __future__ import annotations

import json
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from stereolag import samples
from stereolag.io.images import read_image
from stereolag.templates.by_hand import PIXELS, ReducedSearch, best_of_blocks, reduced_search
from stereolag.ui.packing import SCORE_STEPS, packed_score_map, packed_search
from tests.packed import unpacked

PLACE = (97, 290)


def scene(rows: int = 600, cols: int = 900, *, dtype: Any = np.uint8) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Return a smooth picture of noise, and 48 × 60 pixels of it as an RGBA template with clear corners."""
    noise = np.random.default_rng(1).normal(size=(rows, cols, 3))
    smooth = cv2.GaussianBlur(noise, (0, 0), 3)
    picture = np.rint(cv2.normalize(smooth, None, 10, 240, cv2.NORM_MINMAX)).astype(np.uint8)
    row, col = PLACE
    cut = picture[row : row + 48, col : col + 60]
    down, right = np.mgrid[:48, :60]
    alpha = 255 * ((down / 23.5 - 1) ** 2 + (right / 29.5 - 1) ** 2 < 1.2)
    template = np.dstack([cut, alpha]).astype(np.uint8)
    if dtype == np.uint16:
        return picture.astype(dtype) * 100, template.astype(dtype) * 100
    return picture.astype(dtype), template.astype(dtype)


def pearson(search: ReducedSearch, row: int, col: int) -> float:
    height, width = search.opaque.shape
    window = search.picture[row : row + height, col : col + width][search.opaque].astype(float)
    template = search.template[search.opaque].astype(float)
    return float(np.corrcoef((window - window.mean(0)).ravel(), (template - template.mean(0)).ravel())[0, 1])


def test_a_small_picture_is_left_as_it_is() -> None:
    picture, template = scene(200, 400)
    search = reduced_search(picture, template, None)
    assert (search.factor, search.row, search.col, search.part) == (1, 0, 0, False)
    np.testing.assert_array_equal(search.picture, picture)
    np.testing.assert_array_equal(search.opaque, template[:, :, 3] == 255)
    assert search.leaders()[0] == (*PLACE, pytest.approx(1))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_the_place_falls_on_a_pixel_and_scores_as_before_it_was_reduced(dtype: Any) -> None:
    picture, template = scene(dtype=dtype)
    search = reduced_search(picture, template, None, near=PLACE, pixels=70_000)
    assert search.factor == 3
    row, col, score = search.leaders()[0]
    assert (search.row + 3 * row, search.col + 3 * col) == PLACE
    assert score > 0.995
    block = np.s_[search.row + 15 : search.row + 18, search.col + 21 : search.col + 24]
    if dtype == np.uint8:
        np.testing.assert_allclose(search.picture[5, 7], picture[block].mean((0, 1)), atol=0.51)


def test_the_scores_are_those_of_the_reduced_pixels() -> None:
    search = reduced_search(*scene(), None, pixels=70_000)
    for row, col in [(0, 0), (40, 100), (52, 97), (search.score_map.shape[0] - 1, search.score_map.shape[1] - 1)]:
        assert search.score_map[row, col] == pytest.approx(pearson(search, row, col), abs=1e-5)


def test_a_small_template_in_a_large_picture_is_shown_in_a_part_of_it() -> None:
    picture, template = scene(900, 1400)
    search = reduced_search(picture, template[10:26, 20:36, :3], None, near=(107, 310), pixels=50_000)
    assert search.part and search.factor == 1
    assert search.picture.shape[0] * search.picture.shape[1] < 2 * 50_000
    row, col, score = search.leaders()[0]
    assert (search.row + row, search.col + col) == (107, 310) and score > 0.999


def test_a_part_stays_within_the_picture_wherever_the_place_is() -> None:
    picture, template = scene(900, 1400)
    for near in [(0, 0), (884, 1384)]:
        search = reduced_search(picture, template[10:26, 20:36, :3], None, near=near, pixels=50_000)
        row, col = near[0] - search.row, near[1] - search.col
        assert 0 <= row < search.score_map.shape[0] and 0 <= col < search.score_map.shape[1]


def test_a_template_as_large_as_the_picture_has_one_place() -> None:
    picture, _ = scene(601, 902)
    search = reduced_search(picture, picture, None, pixels=70_000)
    assert search.score_map.shape == (1, 1) and search.score_map[0, 0] == pytest.approx(1)


@pytest.mark.parametrize("size", [(1, 2), (2, 1), (2, 2), (40, 3), (5, 300)])
def test_a_template_may_be_as_narrow_as_a_pixel(size: tuple[int, int]) -> None:
    picture = np.random.default_rng(0).integers(0, 256, (300, 500), dtype=np.uint8)
    for image in (picture, np.dstack([picture, picture.T[:300, :300].repeat(2, 1)[:, :500], picture])):
        template = image[20 : 20 + size[0], 30 : 30 + size[1]]
        search = reduced_search(image, template, None, near=(20, 30), pixels=20_000)
        row, col = 20 - search.row, 30 - search.col
        assert search.factor == 1 and search.part
        assert search.score_map[row, col] == pytest.approx(1)
        assert packed_search(search, name="here", words={})


def test_grey_beside_colour_is_compared_by_luminance() -> None:
    picture, template = scene(200, 400)
    search = reduced_search(picture[:, :, 1], template, None)
    assert (search.picture[..., 0] == search.picture[..., 2]).all()
    assert search.leaders()[0][:2] == PLACE


def test_leaders_are_a_template_apart() -> None:
    leaders = reduced_search(*scene(), None, pixels=70_000).leaders()
    assert len(leaders) == 4
    assert [score for _, _, score in leaders] == sorted((score for _, _, score in leaders), reverse=True)
    for number, (row, col, _) in enumerate(leaders):
        assert all(abs(row - r) >= 16 or abs(col - c) >= 20 for r, c, _ in leaders[:number])


def test_a_template_that_becomes_constant_is_refused() -> None:
    picture, _ = scene(1200, 1500)
    stripes = np.tile(np.array([[0, 255]], dtype=np.uint8), (48, 24))
    with pytest.raises(ValueError, match="constant"):
        reduced_search(picture[:, :, 0], stripes, None, pixels=450_000)


def test_the_browser_gets_the_pixels_and_scores_without_loss() -> None:
    picture, template = scene(200, 400)
    picture[:60, :90] = 77
    search = reduced_search(picture, template, None)
    header, parts = unpacked(packed_search(search, name="here", words={"said": "so"}))
    found = [cv2.imdecode(np.frombuffer(part, np.uint8), cv2.IMREAD_COLOR)[:, :, ::-1].astype(int) for part in parts]
    np.testing.assert_array_equal(found[0], search.picture)
    np.testing.assert_array_equal(found[1], search.template)
    np.testing.assert_array_equal(found[2][..., 0] > 0, search.opaque)
    codes = 256 * found[3][..., 0] + found[3][..., 1]
    scores = np.where(codes > 0, (codes - 1) / SCORE_STEPS - 1, np.nan)
    assert np.isnan(scores[0, 0])
    np.testing.assert_allclose(scores, search.score_map, atol=1 / SCORE_STEPS)
    assert header["leaders"][0]["row"] == PLACE[0] and header["words"] == {"said": "so"}


@pytest.mark.parametrize("factor", [1, 3, 4])
@pytest.mark.parametrize("rows_of_map", [31, 200])
def test_a_block_is_read_at_its_best_place(factor: int, rows_of_map: int) -> None:
    scores = np.random.default_rng(0).uniform(-1, 1, (rows_of_map, 46)).astype(np.float32)
    scores[:5, :5] = np.nan
    best, down, right = best_of_blocks(scores, factor)
    rows, cols = np.indices(best.shape) * factor
    assert np.isnan(best[0, 0]) and np.isnan(best).sum() == (5 // factor) ** 2
    there = scores[rows + down, cols + right]
    np.testing.assert_array_equal(np.where(np.isnan(best), np.nan, there), best)
    assert all(
        best[row, col] >= np.nanmax(scores[row * factor : (row + 1) * factor, col * factor : (col + 1) * factor])
        for row, col in np.argwhere(~np.isnan(best))
    )


def test_a_wide_score_map_travels_in_blocks() -> None:
    scores = np.zeros((20, 1500), dtype=np.float32)
    data = packed_score_map(b"a picture", scores, name="here", words={})
    length = int.from_bytes(data[:4], "little")
    header = json.loads(data[4 : 4 + length])
    assert header["factor"] == 3 and header["parts"][0] == [0, 9]
    start, size = header["parts"][1]
    codes = cv2.imdecode(np.frombuffer(data[4 + length + start :][:size], np.uint8), cv2.IMREAD_COLOR)
    assert codes.shape == (7, 500, 3)


def test_rocketman_stays_himself_when_he_is_reduced() -> None:
    example = samples.mazes()["maze"]
    found = reduced_search(
        read_image(example.picture), read_image(example.template), None, near=(example.row, example.col)
    )
    assert found.picture.shape[0] * found.picture.shape[1] < PIXELS
    best, rival, *_ = found.leaders()
    assert (found.row + found.factor * best[0], found.col + found.factor * best[1]) == (example.row, example.col)
    assert best[2] > 0.999 and rival[2] < 0.6
