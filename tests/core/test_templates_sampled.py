"""Template search from rare exact pixels."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stereolag.templates import match_template


def busy_picture(seed: int) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Return a picture with few colours, and a round RGBA sprite drawn into it at (23, 41)."""
    random = np.random.default_rng(seed)
    palette = random.integers(0, 256, (40, 3), dtype=np.uint8)
    image = palette[random.integers(0, 40, (90, 120))]
    sprite = np.zeros((15, 17, 4), dtype=np.uint8)
    rows, cols = np.mgrid[:15, :17]
    opaque = (rows - 7) ** 2 + (cols - 8) ** 2 <= 49
    sprite[opaque, :3] = palette[random.integers(0, 40, opaque.sum())]
    sprite[opaque, 3] = 255
    image[23:38, 41:58][opaque] = sprite[opaque, :3]
    return image, sprite


@settings(max_examples=40)
@given(st.integers(0, 2**32), st.integers(0, 2**32))
def test_a_sprite_is_found_whatever_the_seed(picture_seed: int, seed: int) -> None:
    image, sprite = busy_picture(picture_seed)
    search = match_template(image, sprite, method="sampled", seed=seed)
    assert [(match.row, match.col) for match in search.matches] == [(23, 41)]
    assert search.matches[0].score == pytest.approx(1)
    assert search.score_map is None


def test_few_places_are_scored_and_they_are_counted() -> None:
    image, sprite = busy_picture(0)
    search = match_template(image, sprite, method="sampled", seed=1)
    assert 9 <= search.candidates < 76 * 104 / 10


def test_the_same_seed_scores_the_same_places() -> None:
    image, sprite = busy_picture(0)
    searches = [match_template(image, sprite, method="sampled", seed=3) for _ in range(2)]
    assert searches[0].candidates == searches[1].candidates
    assert searches[0].matches == searches[1].matches


def test_scores_are_those_of_the_full_search() -> None:
    image, sprite = busy_picture(2)
    image[30:33, 45:49] = 0
    every = match_template(image, sprite, method="fft")
    exact = match_template(image, sprite, method="sampled", seed=0)
    assert (exact.matches[0].row, exact.matches[0].col) == (every.matches[0].row, every.matches[0].col) == (23, 41)
    assert exact.matches[0].score == pytest.approx(every.matches[0].score, abs=1e-6)
    assert exact.matches[0].score < 0.99


def test_a_partly_covered_sprite_is_found_by_another_anchor() -> None:
    image, sprite = busy_picture(4)
    image[23:28, 41:58] = 0
    for seed in range(10):
        search = match_template(image, sprite, method="sampled", seed=seed)
        assert [(match.row, match.col) for match in search.matches] == [(23, 41)]


def test_every_copy_is_found() -> None:
    image, sprite = busy_picture(5)
    opaque = sprite[:, :, 3] > 0
    image[60:75, 90:107][opaque] = sprite[opaque, :3]
    image[0:15, 0:17][opaque] = sprite[opaque, :3]
    search = match_template(image, sprite, method="sampled", max_matches=9)
    assert {(match.row, match.col) for match in search.matches} == {(0, 0), (23, 41), (60, 90)}


@pytest.mark.parametrize("sides", [(20, 30), (90, 70)])
@pytest.mark.parametrize(("gain", "offset"), [(1.0, 10), (0.5, 60)])
def test_a_copy_of_another_brightness_is_a_rival_of_an_exact_one(
    sides: tuple[int, int], gain: float, offset: int
) -> None:
    noise = np.random.default_rng(1).integers(0, 200, (260, 280), dtype=np.uint8)
    image = cv2.GaussianBlur(noise, (0, 0), 1.0)
    template = image[40 : 40 + sides[0], 70 : 70 + sides[1]].copy()
    assert match_template(image, template, method="sampled", seed=0).found
    image[150 : 150 + sides[0], 20 : 20 + sides[1]] = np.rint(template * gain + offset)
    for method in ("fft", "sampled"):
        search = match_template(image, template, method=method, seed=0)  # type: ignore[arg-type]
        assert (search.found, search.reason, search.clear) == (False, "look_alikes", 0), method
        assert [(place.row, place.col) for place in search.look_alikes] == [(40, 70), (150, 20)], method


def test_pixels_that_are_not_exact_are_honestly_not_found() -> None:
    image, sprite = busy_picture(6)
    sprite[:, :, :3] ^= 1
    assert match_template(image, sprite, method="fft").found
    search = match_template(image // 2 * 2, sprite | 1, method="sampled")
    assert not search.found
    assert search.candidates == 0


def test_a_dark_template_of_bright_integers_is_found() -> None:
    image, sprite = busy_picture(7)
    image = image.astype(np.int32)
    image[0, 0] = 300
    assert match_template(image, sprite.astype(np.int32), method="sampled").matches[0].row == 23


def test_the_alpha_of_the_picture_is_ignored() -> None:
    image, sprite = busy_picture(7)
    rgba = np.dstack([image, np.full(image.shape[:2], 77, dtype=np.uint8)])
    assert match_template(rgba, sprite, method="sampled").matches[0].row == 23


@pytest.mark.parametrize("levels", [2, 3])
def test_a_picture_of_few_values_has_no_rare_pixel_and_is_still_searched(levels: int) -> None:
    image = np.random.default_rng(0).integers(0, levels, (60, 70), dtype=np.uint8)
    search = match_template(image, image[20:32, 30:45], method="sampled")
    assert (search.matches[0].row, search.matches[0].col) == (20, 30)
