"""Explanations of a match compared with the map that it explains; example pixels; the reasons of blank pixels."""

from typing import Any

import cv2
import numpy as np
import pytest
from pairs import bundled, shifted_pair, texture

from stereolag import CorrelationMatcher, Reason, SearchArea
from stereolag.assess.explaining import (
    Box,
    ExampleKind,
    MatchKind,
    blank_reasons,
    example_pixel,
    explain_match,
    lobe,
    passes,
    with_rows_around,
)
from stereolag.stereo.opencv import BlockMatcher, StereoBM, StereoSGBM


def test_window_and_search_lie_where_they_should_and_near_the_border_the_nearest_stands_in() -> None:
    pair = shifted_pair(90, 120, 0, -6)
    seen = explain_match(CorrelationMatcher(window_size=20, search=SearchArea.centred(40)), *pair, 45, 60)
    assert (seen.window, seen.search) == (Box(36, 51, 20, 20), Box(26, 41, 40, 40))
    assert seen.surface.shape == (21, 21)
    corner = explain_match(CorrelationMatcher(window_size=21, search=SearchArea.rectified(16)), *pair, 0, 0)
    assert corner.window == Box(0, 0, 21, 21)
    assert np.isfinite(corner.surface[0]).tolist() == [False] * 15 + [True]


@pytest.mark.parametrize(("pitch", "score"), [(6.0, "cross"), (9.5, "zncc"), (14.5, "ncc"), (21.0, "zncc")])
def test_the_runner_up_of_a_periodic_texture_is_one_period_away(pitch: float, score: str) -> None:
    rng = np.random.default_rng(2)
    pattern = 128 + 60 * np.sin(np.arange(160) * 2 * np.pi / pitch) + 10 * np.sin(np.arange(80) / 5)[:, None]
    left, right = (pattern + rng.normal(0, 1, pattern.shape), np.roll(pattern, -26, axis=1))
    matcher = CorrelationMatcher(window_size=13, search=SearchArea.rectified(48), score=score)
    seen = explain_match(matcher, left, right + rng.normal(0, 1, pattern.shape), 40, 90)
    assert seen.kind is MatchKind.REPEATS
    apart = abs(seen.runner_up[1] - seen.peak[1]) / pitch
    assert apart == pytest.approx(max(1, round(apart)), abs=0.6 / pitch)


@pytest.mark.parametrize("search", [SearchArea.rectified(40), SearchArea.centred(51)])
def test_the_flank_of_a_broad_peak_is_no_runner_up(search: SearchArea) -> None:
    left, right = shifted_pair(90, 160, 0, -8, seed=6)
    blurred = [cv2.GaussianBlur(image, (0, 0), 5) for image in (left, right)]
    noise = np.random.default_rng(1).normal(0, 0.05, (2, *left.shape))
    seen = explain_match(
        CorrelationMatcher(window_size=21, search=search), *(blurred[at] + noise[at] for at in (0, 1)), 45, 90
    )
    assert seen.kind in (MatchKind.CLEAR, MatchKind.SMOOTH)
    if seen.runner_up:
        assert seen.valley < seen.runner_up_score - seen.score_tolerance
        assert max(abs(np.subtract(seen.runner_up, seen.peak))) > 4


def walls() -> list[np.ndarray]:
    edge = np.where(np.arange(100) < 10, 0.0, 100.0) + np.zeros((60, 1))
    return [edge + np.random.default_rng(seed).normal(0, 1, edge.shape) for seed in (1, 2)]


SMOOTH = np.tile(128 + 100 * np.sin(np.arange(100) / 100), (60, 1))


@pytest.mark.parametrize(
    ("pair", "kind"),
    [
        (shifted_pair(60, 100, 0, -6), MatchKind.CLEAR),
        ((SMOOTH, np.roll(SMOOTH, -4, axis=1)), MatchKind.SMOOTH),
        (walls(), MatchKind.BARE),
        ([texture(60, 100, seed=seed) for seed in (1, 2)], MatchKind.UNLIKE),
        ([np.full((60, 100), 80, np.uint8)] * 2, MatchKind.NOTHING),
        (shifted_pair(60, 100, 0, -24), MatchKind.AT_EDGE),  # just beyond the search
    ],
)
def test_kinds_of_matches_are_told_apart(pair: Any, kind: MatchKind) -> None:
    seen = explain_match(CorrelationMatcher(window_size=11, search=SearchArea.rectified(24)), *pair, 30, 60)
    assert seen.kind is kind
    if kind is MatchKind.NOTHING:
        assert seen.peak is seen.found is seen.runner_up is None
        assert np.isnan(seen.disparity)
    if kind is MatchKind.AT_EDGE:
        assert seen.peak == (0, -23) and np.isnan(seen.disparity)


def test_rows_around_are_added_and_never_taken_away() -> None:
    strip = CorrelationMatcher(search=SearchArea.rectified(20))
    assert with_rows_around(strip, 6).search == SearchArea.rectified(20, vertical=6)
    for size in (60, 20):  # a square, and one that wraps
        square = CorrelationMatcher(search=SearchArea.centred(size))
        assert with_rows_around(square, 6) is square


def test_a_pixel_outside_is_refused() -> None:
    for row, col in ((-1, 0), (0, 100), (60, 0)):
        with pytest.raises(ValueError, match="outside the image"):
            explain_match(CorrelationMatcher(window_size=9), *shifted_pair(60, 100, 0, -6), row, col)


STRIP, SQUARE = SearchArea.rectified(64), SearchArea.centred(40)


@pytest.mark.parametrize(
    "settings",
    [
        {"window_size": 11, "search": STRIP},
        {"window_size": 20, "search": SQUARE},
        {"window_size": 9, "overlap": 0.5, "search": SearchArea.rectified(48, 3, vertical=2)},
        {"window_size": 15, "search": STRIP, "score": "ncc"},
        {"search": STRIP, "score": "cross"},
        {"window_size": 16, "overlap": 0.7, "search": SQUARE, "engine": "fft"},
        {"window_size": 16, "overlap": 0.7, "search": STRIP, "score": "phase"},
        {"window_size": 24, "overlap": 0.8, "search": SearchArea.centred(24)},
        {"window_size": 9, "overlap": 0.0, "search": STRIP},
    ],
    ids=str,
)
def test_disparity_and_score_are_those_of_the_map(settings: dict[str, Any]) -> None:
    left, right = (side[160:340, 100:420] for side in bundled("road")[:2])
    matcher = CorrelationMatcher(**settings)
    result = matcher.compute(left, right)
    disparity = result.disparity
    margin = matcher.window_size  # nearer the border, pixels are in no cell, and the nearest window is explained
    pixels = np.random.default_rng(5).integers(margin, np.array(disparity.shape) - margin, (20, 2))
    explained = [explain_match(matcher, left, right, *map(int, pixel)) for pixel in pixels]
    expected, scores = (of_map[tuple(pixels.T)] for of_map in (disparity, result.score))
    known = np.isfinite(expected)
    assert known.sum() >= 8
    np.testing.assert_allclose([seen.disparity for seen in explained], expected, atol=1e-5)
    np.testing.assert_allclose(np.array([seen.peak_score for seen in explained])[known], scores[known], rtol=1e-4)


@pytest.mark.parametrize(
    ("search", "dy"), [(SearchArea.rectified(20), 0), (SearchArea.centred(41), 1.4)], ids=["strip", "square"]
)
@pytest.mark.parametrize("score", ["zncc", "cross"])
def test_the_fit_goes_through_the_scores_and_is_highest_at_the_offset(search: Any, dy: float, score: str) -> None:
    matcher = CorrelationMatcher(window_size=15, search=search, score=score)
    seen = explain_match(matcher, *shifted_pair(60, 100, dy, -6.3), 30, 60)
    if dy == 0:
        at = seen.peak[1] - seen.dx[0]
        np.testing.assert_allclose(seen.fit([-1, 0, 1]), seen.row[at - 1 : at + 2], rtol=1e-5)
    fine = np.linspace(-1, 1, 2001)
    assert fine[np.argmax(seen.fit(fine))] == pytest.approx(seen.offset[1], abs=3e-3)
    assert seen.disparity == pytest.approx(6.3, abs=0.05)
    assert seen.found == seen.window_at(seen.peak)


# The lobe of a peak


def test_a_place_beyond_a_gap_lies_outside_and_beyond_the_border_inside_if_the_search_wraps() -> None:
    scores = np.array([[1.0, 0.9, 0.5, np.nan, 0.7, 0.8]])
    assert lobe(scores, passes(scores, (0, 0)), 0.03).tolist() == [[True, True, True, False, False, False]]
    around = lobe(scores, passes(scores, (0, 0), wrapped=True), 0.03)
    assert around.tolist() == [[True, True, True, False, True, True]]


# Example pixels, on a scene with walls, fences and hidden strips in known places


MATCHER = CorrelationMatcher(window_size=11, search=SearchArea.rectified(40))

WALL, PICKETS, NEAR_SQUARE = slice(120, 160), slice(70, 110), (slice(10, 60), slice(120, 200))
BEHIND, NEAR = 5, 25


def scene(*, wall: bool = True, fence: bool = True, near: bool = True) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(3)
    left = texture(170, 280, seed=1)
    if wall:
        left[WALL] = 90
    if fence:
        left[PICKETS] = 128 + 60 * np.sin(np.arange(280) * 2 * np.pi / 14)
    right = np.roll(left, -BEHIND, axis=1)
    if near:
        rows, cols = NEAR_SQUARE
        left[rows, cols] = texture(50, 80, seed=2)
        right[rows, cols.start - NEAR : cols.stop - NEAR] = left[rows, cols]
    noisy = [np.clip(np.rint(image + rng.normal(0, 1, image.shape)), 0, 255) for image in (left, right)]
    return noisy[0].astype(np.uint8), noisy[1].astype(np.uint8)


def test_a_clear_match_the_fence_the_wall_and_the_hidden_strip_are_found() -> None:
    left, right = scene()
    pixel = example_pixel(ExampleKind.CLEAR, MATCHER, left, right)
    seen = explain_match(MATCHER, left, right, *pixel)
    assert seen.kind is MatchKind.CLEAR
    assert min(abs(seen.disparity - shift) for shift in (BEHIND, NEAR)) < 0.1
    for kind, rows in ((ExampleKind.REPEATS, PICKETS), (ExampleKind.BARE, WALL)):
        pixel = example_pixel(kind, MATCHER, left, right)
        assert pixel is not None and rows.start <= pixel[0] < rows.stop
    pixel = example_pixel(ExampleKind.HIDDEN, MATCHER, *scene(wall=False, fence=False))
    rows, cols = NEAR_SQUARE  # hidden is the strip left of it
    assert rows.start <= pixel[0] < rows.stop
    assert cols.start - (NEAR - BEHIND) <= pixel[1] < cols.start


def test_a_bare_wall_is_no_smooth_sky() -> None:
    left, right, truth = bundled("fence")
    matcher = CorrelationMatcher(window_size=15, search=SearchArea.rectified(64))
    pixel = example_pixel(ExampleKind.BARE, matcher, left, right)
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


# Reasons of blank pixels


OPEN_BM = {"num_disparities": 32, "block_size": 9, "uniqueness_ratio": 0, "texture_threshold": 0}
OPEN_SGBM = {"num_disparities": 32, "uniqueness_ratio": 0, "speckle_window_size": 0, "disp12_max_diff": 64}


@pytest.mark.parametrize(
    ("matcher", "reason"),
    [
        (StereoBM(**OPEN_BM | {"uniqueness_ratio": 20}), Reason.AMBIGUOUS),
        (StereoBM(**OPEN_BM | {"texture_threshold": 400}), Reason.LOW_TEXTURE),
        (StereoBM(**OPEN_BM, disp12_max_diff=1), Reason.LEFT_RIGHT),
        (StereoBM(**OPEN_BM, speckle_window_size=80, speckle_range=16), Reason.SPECKLE),
        (StereoSGBM(**OPEN_SGBM | {"uniqueness_ratio": 20}), Reason.AMBIGUOUS),
        (StereoSGBM(**OPEN_SGBM | {"disp12_max_diff": 1}), Reason.LEFT_RIGHT),
        (StereoSGBM(**OPEN_SGBM | {"speckle_window_size": 400}), Reason.SPECKLE),
    ],
)
def test_a_filter_alone_is_the_reason_of_all_that_it_takes_away(matcher: BlockMatcher, reason: Reason) -> None:
    left, right = scene()
    result = matcher.compute(left, right)
    found = blank_reasons(result, left, right)
    switched_off = StereoBM(**OPEN_BM) if isinstance(matcher, StereoBM) else StereoSGBM(**OPEN_SGBM)
    everything = switched_off.compute(left, right)
    taken = everything.valid & ~result.valid
    assert taken.sum() > 100
    assert (found[taken] == reason).all()
    assert (found[~everything.valid & ~result.valid] == Reason.OUT_OF_FRAME).all()
    assert (found[result.valid] == Reason.MEASURED).all()


@pytest.mark.parametrize(
    "matcher",
    [
        StereoBM(num_disparities=32, block_size=9, texture_threshold=700, disp12_max_diff=1, speckle_window_size=80),
        StereoSGBM(num_disparities=32),
    ],
)
def test_each_filter_answers_for_what_it_is_the_first_to_blank(matcher: BlockMatcher) -> None:
    left, right = scene()
    result = matcher.compute(left, right)
    found = blank_reasons(result, left, right)
    assert ((found == Reason.MEASURED) == result.valid).all()
    causes = {Reason(cause) for cause in np.unique(found)}
    assert causes >= {Reason.MEASURED, Reason.OUT_OF_FRAME, Reason.AMBIGUOUS, Reason.LEFT_RIGHT}
    if isinstance(matcher, StereoBM):
        assert (found[135:145, 60:250] == Reason.LOW_TEXTURE).mean() > 0.9


def test_a_matcher_that_knows_its_reasons_is_believed() -> None:
    left, right = shifted_pair(60, 90, 0, -5)
    result = CorrelationMatcher(window_size=9, search=SearchArea.rectified(16)).compute(left, right)
    assert blank_reasons(result, left, right) is result.reason
