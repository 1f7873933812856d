"""The explanation of a match, compared with the map that it explains."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest
from pairs import shifted_pair, texture

from stereolag.assess.explaining import Box, MatchExplanation, MatchKind, explain_match, with_rows_around
from stereolag.io.disparities import read_disparity
from stereolag.io.images import read_image
from stereolag.samples import stereo_pairs
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.stereo.windows.search import SearchArea


@pytest.mark.parametrize(("window_size", "overlap"), [(16, 0.95), (20, 0.8), (21, 0.5), (9, 0.0)])
def test_the_window_is_the_one_the_matcher_used(window_size: int, overlap: float) -> None:
    left, right = shifted_pair(70, 90, 0, -5, seed=3)
    matcher = CorrelationMatcher(window_size=window_size, overlap=overlap, search=SearchArea.rectified(12))
    result = matcher.compute(left, right)
    for row, col in zip(*np.nonzero(result.valid), strict=True):
        if (row + col) % 37 == 0:
            seen = explain_match(matcher, left, right, int(row), int(col))
            assert seen.peak_score == pytest.approx(float(result.score[row, col]), rel=1e-4)


@pytest.mark.parametrize("search", [SearchArea.centred(41), SearchArea.rectified(20, vertical=2)])
@pytest.mark.parametrize("score", ["zncc", "ncc", "cross"])
def test_the_peak_is_the_matchers_own(search: SearchArea, score: str) -> None:
    left, right = shifted_pair(90, 120, 1, -6)
    matcher = CorrelationMatcher(window_size=15, search=search, score=score)
    result = matcher.compute(left, right)
    for row, col in [(40, 60), (30, 80), (55, 71)]:
        seen = explain_match(matcher, left, right, row, col)
        assert seen.peak is not None
        assert seen.peak == (round(float(result.dy[row, col])), round(float(result.dx[row, col])))
        assert seen.peak_score == pytest.approx(float(result.score[row, col]), rel=1e-4)
        assert seen.found == Box(seen.window.row + seen.peak[0], seen.window.col + seen.peak[1], 15, 15)
        assert seen.row.max() == pytest.approx(seen.peak_score, rel=1e-5)
        assert seen.runner_up_score < seen.peak_score
        assert max(map(abs, seen.offset)) <= 1


def test_window_and_search_lie_where_they_should() -> None:
    left, right = shifted_pair(90, 120, 0, -6)
    seen = explain_match(CorrelationMatcher(window_size=20, search=SearchArea.centred(40)), left, right, 45, 60)
    assert seen.window == Box(36, 51, 20, 20)
    assert seen.search == Box(26, 41, 40, 40)
    assert seen.surface.shape == (21, 21)


def test_near_the_border_the_nearest_whole_window_stands_in() -> None:
    left, right = shifted_pair(90, 120, 0, -6)
    seen = explain_match(CorrelationMatcher(window_size=21, search=SearchArea.rectified(16)), left, right, 0, 0)
    assert seen.window == Box(0, 0, 21, 21)
    assert np.isnan(seen.surface[0, :-1]).all()
    assert np.isfinite(seen.surface[0, -1])


def test_unpadded_search_is_inspected_circularly() -> None:
    tile = texture(24, 24, seed=4)
    left = np.tile(tile, (3, 3))
    seen = explain_match(
        CorrelationMatcher(window_size=24, search=SearchArea.centred(24)), left, np.roll(left, -5, axis=1), 36, 36
    )
    assert seen.peak == (0, -5)
    assert seen.peak_score == pytest.approx(1)


def test_a_flat_wall_and_a_fence_are_explained() -> None:
    flat = np.full((60, 100), 80, np.uint8)
    matcher = CorrelationMatcher(window_size=11, search=SearchArea.rectified(24))
    wall = explain_match(matcher, flat, flat, 30, 60)
    assert wall.peak is None
    assert wall.found is None
    assert wall.kind is MatchKind.NOTHING
    assert wall.runner_up is None
    assert np.isnan(wall.disparity)
    stripes = np.tile((np.sin(np.arange(100) * 2 * np.pi / 8) * 90 + 128).astype(np.uint8), (60, 1))
    stripes = np.clip(stripes + np.random.default_rng(0).normal(0, 1, stripes.shape), 0, 255).astype(np.uint8)
    fence = explain_match(matcher, stripes, np.roll(stripes, -4, axis=1), 30, 60)
    assert fence.kind is MatchKind.REPEATS
    assert explain_match(matcher, *shifted_pair(60, 100, 0, -6), 30, 60).kind is MatchKind.CLEAR


@pytest.mark.parametrize("pitch", [6.0, 9.5, 14.5, 21.0])
@pytest.mark.parametrize("score", ["zncc", "ncc", "cross"])
def test_the_runner_up_of_a_periodic_texture_is_one_period_away(pitch: float, score: str) -> None:
    rng = np.random.default_rng(2)
    pattern = 128 + 60 * np.sin(np.arange(160) * 2 * np.pi / pitch) + 10 * np.sin(np.arange(80) / 5)[:, None]
    left, right = (pattern + rng.normal(0, 1, pattern.shape), np.roll(pattern, -26, axis=1))
    matcher = CorrelationMatcher(window_size=13, search=SearchArea.rectified(48), score=score)
    seen = explain_match(matcher, left, right + rng.normal(0, 1, pattern.shape), 40, 90)
    assert seen.kind is MatchKind.REPEATS
    assert seen.peak is not None
    assert seen.runner_up is not None
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
    assert seen.peak is not None
    if seen.runner_up:
        assert seen.valley < seen.runner_up_score - seen.as_good
        assert max(abs(np.subtract(seen.runner_up, seen.peak))) > 4


def test_on_the_fence_a_wrong_match_is_called_a_repetition() -> None:
    pair = stereo_pairs()["fence"]
    left, right, truth = read_image(pair.left), read_image(pair.right), read_disparity(pair.disparity)
    matcher = CorrelationMatcher(window_size=15, search=SearchArea.rectified(pair.num_disparities))
    seen = [explain_match(matcher, left, right, row, col) for row in (310, 330) for col in range(190, 380, 2)]
    pickets = [truth[row, col] for row in (310, 330) for col in range(190, 380, 2)]
    wrong = [one for one, true in zip(seen, pickets, strict=True) if 26 < true < 27 and abs(one.disparity - true) > 1]
    assert len(wrong) > 30
    assert all(one.kind is MatchKind.REPEATS for one in wrong)
    apart = [abs(one.runner_up[1] - one.peak[1]) / 14.5 for one in wrong if one.runner_up and one.peak]
    np.testing.assert_allclose(apart, np.rint(apart), atol=0.1)
    assert min(apart) > 0.9


def test_smooth_windows_bare_walls_and_hidden_places_are_told_apart() -> None:
    rng = np.random.default_rng(1)
    matcher = CorrelationMatcher(window_size=11, search=SearchArea.rectified(24))
    smooth = np.tile(128 + 100 * np.sin(np.arange(100) / 100), (60, 1))
    assert explain_match(matcher, smooth, np.roll(smooth, -4, axis=1), 30, 60).kind is MatchKind.SMOOTH
    edge = np.where(np.arange(100) < 10, 0.0, 100.0) + np.zeros((60, 1))
    walls = [edge + rng.normal(0, 1, edge.shape) for _ in range(2)]
    assert explain_match(matcher, walls[0], walls[1], 30, 60).kind is MatchKind.BARE
    strangers = [texture(60, 100, seed=seed) for seed in (1, 2)]
    assert explain_match(matcher, strangers[0], strangers[1], 30, 61).kind is MatchKind.UNLIKE


def test_rows_around_are_added_and_never_taken_away() -> None:
    strip = CorrelationMatcher(search=SearchArea.rectified(20))
    assert with_rows_around(strip, 6).search == SearchArea.rectified(20, vertical=6)
    square = CorrelationMatcher(search=SearchArea.centred(60))
    assert with_rows_around(square, 6) is square
    unpadded = CorrelationMatcher(search=SearchArea.centred(20))
    assert with_rows_around(unpadded, 6) is unpadded


@pytest.mark.parametrize(("row", "col"), [(-1, 0), (0, 100), (60, 0)])
def test_a_pixel_outside_is_refused(row: int, col: int) -> None:
    left, right = shifted_pair(60, 100, 0, -6)
    with pytest.raises(ValueError, match="outside the image"):
        explain_match(CorrelationMatcher(window_size=9), left, right, row, col)


@pytest.mark.parametrize("score", ["zncc", "cross"])
def test_the_fit_goes_through_the_peak_and_its_neighbours_and_is_highest_at_the_offset(score: str) -> None:
    left, right = shifted_pair(60, 100, 0, -6.3)
    matcher = CorrelationMatcher(window_size=15, search=SearchArea.rectified(20), score=score)
    seen = explain_match(matcher, left, right, 30, 60)
    assert seen.peak is not None
    at = seen.peak[1] - seen.dx[0]
    np.testing.assert_allclose(seen.fit([-1, 0, 1]), seen.row[at - 1 : at + 2], rtol=1e-5)
    assert top_of(seen) == pytest.approx(seen.offset[1], abs=3e-3)
    assert seen.disparity == pytest.approx(6.3, abs=0.05)


def test_the_fit_of_a_square_search_is_highest_at_the_offset() -> None:
    left, right = shifted_pair(60, 100, 1.4, -6.3)
    seen = explain_match(CorrelationMatcher(window_size=15, search=SearchArea.centred(41)), left, right, 30, 60)
    assert top_of(seen) == pytest.approx(seen.offset[1], abs=3e-3)
    assert seen.disparity == pytest.approx(6.3, abs=0.05)


def top_of(seen: MatchExplanation) -> float:
    fine = np.linspace(-1, 1, 2001)
    return float(fine[np.argmax(seen.fit(fine))])


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
    ],
    ids=str,
)
def test_the_disparity_is_that_of_the_map(settings: dict[str, Any]) -> None:
    pair = stereo_pairs()["road"]
    left, right = (read_image(side)[160:400] for side in (pair.left, pair.right))
    matcher = CorrelationMatcher(**settings)
    disparity = matcher.compute(left, right).disparity
    margin = matcher.window_size  # nearer the border, pixels are in no cell, and the nearest window is explained
    pixels = np.random.default_rng(5).integers(margin, np.array(disparity.shape) - margin, (40, 2))
    explained = [explain_match(matcher, left, right, *map(int, pixel)).disparity for pixel in pixels]
    expected = disparity[tuple(pixels.T)]
    assert np.isfinite(expected).sum() > 10
    np.testing.assert_allclose(explained, expected, atol=1e-5)


def test_a_better_score_just_beyond_the_search_is_an_edge() -> None:
    left, right = shifted_pair(60, 100, 0, -8)
    matcher = CorrelationMatcher(window_size=15, search=SearchArea.rectified(8))
    seen = explain_match(matcher, left, right, 30, 60)
    assert seen.kind is MatchKind.AT_EDGE
    assert seen.peak == (0, -7)
    assert np.isnan(seen.disparity)
    assert np.isnan(matcher.compute(left, right).disparity[30, 60])
