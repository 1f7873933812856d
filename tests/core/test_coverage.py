"""Error against coverage, for an informative score, an uninformative one, and none."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereolag.stereo.evaluation import MOST_POINTS, error_against_coverage, evaluate

RNG = np.random.default_rng(1)
TRUTH = np.full((40, 50), 10.0)
ERROR = RNG.exponential(2.0, TRUTH.shape)


def test_a_score_that_knows_gives_up_the_worst_first() -> None:
    curve = error_against_coverage(TRUTH + ERROR, TRUTH, -ERROR)
    assert np.all(np.diff(curve.bad) >= 0)
    assert curve.bad[0] == 0
    assert curve.coverage.size <= MOST_POINTS


def test_a_score_that_knows_nothing_stays_flat() -> None:
    curve = error_against_coverage(TRUTH + ERROR, TRUTH, RNG.random(TRUTH.shape))
    half = np.searchsorted(curve.coverage, 0.5)
    assert curve.bad[half] == pytest.approx(curve.bad[-1], rel=0.15)


def test_the_first_points_are_the_surest_pixels_by_hand() -> None:
    disparity = np.array([[10.0, 13.0, 10.5, np.nan]])
    score = np.array([[0.9, 0.2, 0.5, np.nan]])
    curve = error_against_coverage(disparity, np.full((1, 4), 10.0), score)
    np.testing.assert_allclose(curve.coverage, [0.25, 0.5, 0.75])
    np.testing.assert_allclose(curve.bad, [0, 0, 100 / 3])


def test_no_score_is_one_point_and_what_was_filled_comes_last() -> None:
    nothing = np.full(TRUTH.shape, np.nan)
    assert error_against_coverage(TRUTH + ERROR, TRUTH, nothing).coverage.tolist() == [1.0]
    score = np.array([[np.nan, 0.1, np.nan, 0.8]])
    curve = error_against_coverage(np.array([[20.0, 10, 20, 10]]), np.full((1, 4), 10.0), score)
    np.testing.assert_allclose(curve.coverage, [0.25, 0.5, 1.0])
    np.testing.assert_allclose(curve.bad, [0, 0, 50])


def test_pixels_of_one_score_are_kept_together() -> None:
    score = np.where(np.arange(50) < 20, 1.0, 0.0)[None].repeat(40, axis=0)
    curve = error_against_coverage(TRUTH + ERROR, TRUTH, score)
    np.testing.assert_allclose(curve.coverage, [0.4, 1.0])


@given(st.integers(0, 2**32 - 1), st.floats(0, 1), st.floats(0.1, 5))
def test_the_last_point_is_the_evaluation(seed: int, missing: float, threshold: float) -> None:
    rng = np.random.default_rng(seed)
    truth = np.where(rng.random((12, 15)) < 0.1, np.nan, 5.0)
    truth[0, 0] = 5.0
    disparity = np.where(rng.random(truth.shape) < missing, np.nan, truth + rng.normal(0, 3, truth.shape))
    mask = rng.random(truth.shape) < 0.8
    mask[0, 0] = True
    curve = error_against_coverage(disparity, truth, rng.integers(0, 9, truth.shape), threshold=threshold, mask=mask)
    whole = evaluate(disparity, truth, thresholds=(threshold,), mask=mask)
    if whole.density == 0:
        assert curve.coverage.size == 0
        return
    assert curve.coverage[-1] == pytest.approx(whole.density)
    assert curve.bad[-1] == pytest.approx(whole.bad_measured[threshold])


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((TRUTH[1:], TRUTH, TRUTH), "both must be"),
        ((TRUTH, TRUTH, TRUTH[1:]), "both must be"),
        ((TRUTH, np.full(TRUTH.shape, np.nan), TRUTH), "no finite disparity"),
    ],
)
def test_what_does_not_fit_is_named(arguments: tuple[np.ndarray, ...], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        error_against_coverage(*arguments)


def test_a_threshold_of_nothing_is_named() -> None:
    with pytest.raises(ValueError, match=r"threshold is 0\.0 px"):
        error_against_coverage(TRUTH, TRUTH, TRUTH, threshold=0.0)
