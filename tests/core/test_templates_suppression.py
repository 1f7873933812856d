"""Several matches: the best of each place, none hidden, none counted twice."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stereolag.templates import TemplateMatch, match_template
from stereolag.templates.score_maps import peaks, suppress


def overlap(one: TemplateMatch, other: TemplateMatch) -> float:
    rows = max(0, one.height - abs(one.row - other.row))
    cols = max(0, one.width - abs(one.col - other.col))
    return rows * cols / (one.height * one.width)


@settings(max_examples=50)
@given(
    st.integers(0, 2**32), st.integers(2, 9), st.integers(2, 9), st.integers(1, 40), st.sampled_from([-1.0, 0.0, 0.3])
)
def test_matches_are_sorted_peaks_that_overlap_by_half_at_most(
    seed: int, height: int, width: int, max_matches: int, min_score: float
) -> None:
    random = np.random.default_rng(seed)
    image = random.integers(0, 4, (40, 50), dtype=np.uint8)
    template = image[20 : 20 + height, 30 : 30 + width].copy()
    template[0, :2] = [0, 3]
    search = match_template(image, template, max_matches=max_matches, min_score=min_score)
    assert search.score_map is not None
    scores = [match.score for match in search.matches]
    assert len(scores) <= max_matches
    assert scores == sorted(scores, reverse=True)
    assert all(score >= min_score for score in scores)
    assert scores[0] == np.nanmax(search.score_map)
    for index, match in enumerate(search.matches):
        assert match.score == search.score_map[match.row, match.col]
        around = search.score_map[max(0, match.row - 1) : match.row + 2, max(0, match.col - 1) : match.col + 2]
        assert match.score == np.nanmax(around)
        assert all(overlap(match, better) <= 0.5 for better in search.matches[:index])


@pytest.mark.parametrize("method", ["fft", "direct", "sampled"])
def test_every_copy_is_found_once(method: str) -> None:
    random = np.random.default_rng(0)
    image = random.integers(0, 256, (60, 80), dtype=np.uint8)
    template = random.integers(0, 256, (10, 12), dtype=np.uint8)
    places = {(0, 0), (0, 12), (25, 30), (50, 68), (40, 3)}
    for row, col in places:
        image[row : row + 10, col : col + 12] = template
    search = match_template(image, template, method=method, max_matches=20)
    assert {(match.row, match.col) for match in search.matches} == places
    assert len(match_template(image, template, method=method, max_matches=3).matches) == 3


def test_copies_that_overlap_by_exactly_half_are_both_kept() -> None:
    rows, cols = np.array([3, 3, 3]), np.array([0, 5, 9])
    assert suppress(rows, cols, np.array([0.8, 0.9, 0.7]), (4, 10), 9) == [1, 0]
    assert suppress(rows, cols, np.array([0.9, 0.7, 0.8]), (4, 10), 9) == [0, 2]


def test_of_equal_scores_the_first_wins() -> None:
    assert suppress(np.array([0, 0, 9]), np.array([0, 1, 0]), np.array([0.9, 0.9, 0.9]), (4, 4), 9) == [0, 2]


def test_the_slope_of_a_peak_is_no_peak() -> None:
    rows, cols = np.mgrid[:30, :40]
    score_map = np.exp(-((rows - 12) ** 2 + (cols - 20) ** 2) / 200).astype(np.float32)
    score_map[0, 0] = np.nan
    assert [index.tolist() for index in peaks(score_map, 0.1)] == [[12], [20]]


def test_a_map_without_scores_has_no_peak() -> None:
    assert all(index.size == 0 for index in peaks(np.full((3, 4), np.nan, dtype=np.float32), -1))
