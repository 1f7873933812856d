"""Figures, coverage, agreement and confidence of disparity maps, counted by hand and by plain formulas."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from pairs import shifted_pair

import stereolag as sl
from stereolag.stereo.evaluation import MAX_CURVE_POINTS, confidence, consensus, error_against_coverage, evaluate
from stereolag.stereo.matcher import StereoMatcher

NAN = float("nan")


def test_counts_by_hand() -> None:
    truth = np.array([[10.0, 10, 10, 10], [100, 10, NAN, np.inf]])
    estimate = np.array([[10.0, 10.7, 13.0, NAN], [104.5, 14, 1, 2]])
    figures = evaluate(estimate, truth)
    assert figures.truth_pixels == 6
    assert figures.density == pytest.approx(5 / 6)
    assert figures.epe == pytest.approx((0 + 0.7 + 3 + 4.5 + 4) / 5)
    assert figures.bad == pytest.approx({0.5: 500 / 6, 1.0: 400 / 6, 2.0: 400 / 6, 4.0: 200 / 6})
    assert figures.bad_measured == pytest.approx({0.5: 80, 1.0: 60, 2.0: 60, 4.0: 20})
    # 104.5 is off by more than 3 px but less than 5 %; the missing pixel counts as wrong.
    assert figures.d1_all == pytest.approx(200 / 6)
    assert evaluate(estimate, truth, mask=estimate == 10).bad[1.0] == 0
    nothing = evaluate(np.full(truth.shape, NAN), truth)
    assert nothing.density == 0
    assert nothing.bad[1.0] == nothing.d1_all == 100
    assert np.isnan([nothing.epe, nothing.bad_measured[1.0]]).all()


@given(arrays.arrays(np.float32, (4, 2, 2), elements=st.one_of(st.just(NAN), st.floats(0, 6, width=16))))
def test_agreement_equals_the_count_around_each_answer_in_any_order(maps: np.ndarray) -> None:
    found = consensus(list(maps))
    for row, col in np.ndindex(2, 2):
        answers = maps[:, row, col]
        groups = [int(((answers >= one) & (answers <= one + 1)).sum()) for one in answers]
        assert found[row, col] == max(groups)
    np.testing.assert_array_equal(consensus(list(maps[::-1])), found)


TRUTH = np.full((40, 50), 10.0)


def test_a_score_that_knows_gives_up_the_worst_first_in_a_curve_of_few_points() -> None:
    error = np.random.default_rng(1).exponential(2.0, TRUTH.shape)
    curve = error_against_coverage(TRUTH + error, TRUTH, -error)
    assert np.all(np.diff(curve.bad) >= 0) and curve.bad[0] == 0
    assert curve.coverage.size <= MAX_CURVE_POINTS


@pytest.mark.parametrize(
    ("disparity", "score", "coverage", "bad"),
    [
        ([10.0, 13.0, 10.5, NAN], [0.9, 0.2, 0.5, NAN], [0.25, 0.5, 0.75], [0, 0, 100 / 3]),
        ([20.0, 10, 20, 10], [NAN, 0.1, NAN, 0.8], [0.25, 0.5, 1.0], [0, 0, 50]),
        ([20.0, 10, 20, 10], [NAN] * 4, [1.0], [50]),
    ],
)
def test_the_surest_pixels_come_first_equals_together_and_those_without_a_score_last(disparity, score, coverage, bad):
    curve = error_against_coverage(np.array([disparity]), np.full((1, 4), 10.0), np.array([score]))
    np.testing.assert_allclose(curve.coverage, coverage)
    np.testing.assert_allclose(curve.bad, bad)


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
    ("judge", "arguments", "options", "said"),
    [
        (evaluate, (TRUTH, TRUTH[1:]), {}, "shape"),
        (evaluate, (np.ones(4), np.ones(4)), {}, "shape"),
        (evaluate, (TRUTH, np.full(TRUTH.shape, NAN)), {}, "no finite disparity"),
        (evaluate, (TRUTH, TRUTH), {"thresholds": (1.0, 0.0)}, "thresholds"),
        (evaluate, (TRUTH, TRUTH), {"mask": np.ones((3, 2), bool)}, "mask"),
        (error_against_coverage, (TRUTH[1:], TRUTH, TRUTH[1:]), {}, "both must be"),
        (error_against_coverage, (TRUTH, TRUTH, TRUTH[1:]), {}, "both must be"),
        (error_against_coverage, (TRUTH, TRUTH, TRUTH), {"threshold": 0.0}, r"threshold is 0\.0 px"),
        (consensus, ([np.zeros((2, 2), np.float32), np.zeros((2, 3), np.float32)],), {}, "same size"),
        (consensus, ([],), {}, "one or more"),
    ],
)
def test_what_does_not_fit_is_named(judge, arguments, options, said):
    with pytest.raises(ValueError, match=said):
        judge(*arguments, **options)


MATCHERS: list[StereoMatcher] = [
    sl.CorrelationMatcher(window_size=11, overlap=0.9, search=sl.SearchArea.rectified(16)),
    sl.CorrelationMatcher(window_size=11, overlap=0.9, search=sl.SearchArea.rectified(16), score="cross"),
    sl.StereoBM(num_disparities=16, block_size=11, uniqueness_ratio=0, texture_threshold=0),
    sl.StereoSGBM(num_disparities=16, disp12_max_diff=-1, uniqueness_ratio=0),
    sl.preset("fast", 16),
    sl.preset("accurate", 16),
]


@pytest.mark.parametrize("matcher", MATCHERS, ids=["ZNCC", "plain", "BM", "SGBM", "fast", "accurate"])
def test_it_is_higher_where_the_match_is_right(matcher: StereoMatcher) -> None:
    left, right = shifted_pair(90, 140, 0, -6)
    right = right.copy()
    right[30:60, 40:90] = np.random.default_rng(5).integers(0, 255, (30, 50))  # nothing there matches
    result = matcher.compute(left, right)
    sure = confidence(result, left, right)
    measured = result.valid & ~result.filled
    known = np.isfinite(sure)
    assert sure.dtype == np.float32 and not known[~measured].any()
    assert known.sum() > 0.9 * measured.sum()
    assert sure[known].min() >= 0 and sure[known].max() <= 1
    good = known & (np.abs(result.disparity - 6) < 0.5)
    assert good.mean() > 0.4
    assert np.median(sure[good]) > 0.7
    if (known & ~good).sum() > 50:
        assert np.median(sure[known & ~good]) < np.median(sure[good]) - 0.2


def test_a_flat_image_is_trusted_nowhere() -> None:
    flat = np.full((60, 90), 80, np.uint8)
    result = sl.StereoSGBM(num_disparities=16, disp12_max_diff=-1, uniqueness_ratio=0).compute(flat, flat)
    assert not np.nan_to_num(confidence(result, flat, flat)).any()
    with pytest.raises(ValueError, match="must be of one size"):
        confidence(result, flat[:50], flat[:50])
