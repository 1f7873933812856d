"""Example pixels, on a scene with walls, fences and hidden strips in known places."""

from __future__ import annotations

import numpy as np
import pytest
from pairs import texture

from stereolag.assess.explaining import ExampleKind, MatchKind, example_pixel, explain_match
from stereolag.io.disparities import read_disparity
from stereolag.io.images import read_image
from stereolag.samples import stereo_pairs
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.stereo.windows.search import SearchArea

MATCHER = CorrelationMatcher(window_size=11, search=SearchArea.rectified(40))

WALL, FENCE, SQUARE = slice(120, 160), slice(70, 110), (slice(10, 60), slice(120, 200))
BEHIND, NEAR = 5, 25


def scene(*, wall: bool = True, fence: bool = True, near: bool = True) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(3)
    left = texture(170, 280, seed=1)
    if wall:
        left[WALL] = 90
    if fence:
        left[FENCE] = 128 + 60 * np.sin(np.arange(280) * 2 * np.pi / 14)
    right = np.roll(left, -BEHIND, axis=1)
    if near:
        rows, cols = SQUARE
        left[rows, cols] = texture(50, 80, seed=2)
        right[rows, cols.start - NEAR : cols.stop - NEAR] = left[rows, cols]
    noisy = [np.clip(np.rint(image + rng.normal(0, 1, image.shape)), 0, 255) for image in (left, right)]
    return noisy[0].astype(np.uint8), noisy[1].astype(np.uint8)


def test_a_clear_match_is_clear_and_right() -> None:
    left, right = scene()
    pixel = example_pixel(ExampleKind.CLEAR, MATCHER, left, right)
    assert pixel is not None
    seen = explain_match(MATCHER, left, right, *pixel)
    assert seen.kind is MatchKind.CLEAR
    assert min(abs(seen.disparity - shift) for shift in (BEHIND, NEAR)) < 0.1


def test_the_fence_and_the_wall_are_found() -> None:
    left, right = scene()
    repeats = example_pixel(ExampleKind.REPEATS, MATCHER, left, right)
    assert repeats is not None
    assert FENCE.start <= repeats[0] < FENCE.stop
    bare = example_pixel(ExampleKind.BARE, MATCHER, left, right)
    assert bare is not None
    assert WALL.start <= bare[0] < WALL.stop


def test_the_hidden_strip_lies_left_of_the_near_square() -> None:
    left, right = scene(wall=False, fence=False)
    pixel = example_pixel(ExampleKind.HIDDEN, MATCHER, left, right)
    assert pixel is not None
    rows, cols = SQUARE
    assert rows.start <= pixel[0] < rows.stop
    assert cols.start - (NEAR - BEHIND) <= pixel[1] < cols.start


@pytest.mark.parametrize("search", [SearchArea.rectified(64), SearchArea.centred(60)])
def test_a_repeating_pattern_of_the_fence_is_its_pickets(search: SearchArea) -> None:
    pair = stereo_pairs()["fence"]
    left, right, truth = read_image(pair.left), read_image(pair.right), read_disparity(pair.disparity)
    pixel = example_pixel(ExampleKind.REPEATS, CorrelationMatcher(window_size=15, search=search), left, right)
    assert pixel is not None
    row, col = pixel
    on_pickets = np.abs(truth[row, col - 8 : col + 8] - 26.5) < 0.3
    assert on_pickets.any()
    seen = explain_match(CorrelationMatcher(window_size=15, search=search), left, right, row, col)
    assert seen.runner_up is not None
    assert seen.peak is not None
    assert max(abs(np.subtract(seen.runner_up, seen.peak))) > 5


def test_a_bare_wall_is_no_smooth_sky() -> None:
    pair = stereo_pairs()["fence"]
    left, right, truth = read_image(pair.left), read_image(pair.right), read_disparity(pair.disparity)
    matcher = CorrelationMatcher(window_size=15, search=SearchArea.rectified(64))
    pixel = example_pixel(ExampleKind.BARE, matcher, left, right)
    assert pixel is not None
    assert truth[pixel] == pytest.approx(15.1, abs=0.3)
    assert explain_match(matcher, left, right, *pixel).kind is MatchKind.BARE


@pytest.mark.parametrize("search", [SearchArea.rectified(40), SearchArea.centred(31)])
def test_shifted_noise_repeats_nowhere(search: SearchArea) -> None:
    noise = np.random.default_rng(7).integers(0, 256, (120, 200), dtype=np.uint8)
    matcher = CorrelationMatcher(window_size=11, search=search)
    assert example_pixel(ExampleKind.REPEATS, matcher, noise, np.roll(noise, -7, axis=1)) is None


@pytest.mark.parametrize("kind", [ExampleKind.REPEATS, ExampleKind.BARE, ExampleKind.HIDDEN])
def test_a_scene_without_it_has_none(kind: ExampleKind) -> None:
    assert example_pixel(kind, MATCHER, *scene(wall=False, fence=False, near=False)) is None


@pytest.mark.parametrize("matcher", [MATCHER.model_copy(update={"score": "phase"}), CorrelationMatcher(window_size=16)])
def test_every_score_and_search_can_be_asked(matcher: CorrelationMatcher) -> None:
    left, right = scene(near=False)
    assert example_pixel(ExampleKind.CLEAR, matcher, left, right) is not None
