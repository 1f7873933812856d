"""The figures of a disparity map, on maps small enough to count by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from stereolag.stereo.evaluation import consensus, evaluate

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


def test_a_mask_narrows_the_judgement() -> None:
    truth, estimate = np.full((2, 2), 5.0), np.array([[5.0, 9], [5, 9]])
    assert evaluate(estimate, truth, mask=estimate == 5).bad[1.0] == 0
    assert evaluate(estimate, truth).bad[1.0] == 50


def test_nothing_measured() -> None:
    figures = evaluate(np.full((2, 2), NAN), np.ones((2, 2)))
    assert figures.density == 0
    assert figures.bad[1.0] == figures.d1_all == 100
    assert np.isnan(figures.epe)
    assert np.isnan(figures.bad_measured[1.0])


@pytest.mark.parametrize(
    ("estimate", "truth", "options", "says"),
    [
        (np.ones((2, 2)), np.ones((2, 3)), {}, "shape"),
        (np.ones(4), np.ones(4), {}, "shape"),
        (np.ones((2, 2)), np.full((2, 2), NAN), {}, "no finite"),
        (np.ones((2, 2)), np.ones((2, 2)), {"thresholds": (1.0, 0.0)}, "thresholds"),
        (np.ones((2, 2)), np.ones((2, 2)), {"mask": np.ones((3, 2), bool)}, "mask"),
    ],
)
def test_refused(estimate: np.ndarray, truth: np.ndarray, options: dict, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        evaluate(estimate, truth, **options)


@given(st.lists(st.floats(-20, 20), min_size=4, max_size=4), st.floats(0.1, 5))
def test_missing_pixels_never_help(errors: list[float], threshold: float) -> None:
    truth = np.full((2, 2), 50.0)
    estimate = truth + np.array(errors).reshape(2, 2)
    blanked = estimate.copy()
    blanked[0, 0] = NAN
    whole, holed = (evaluate(each, truth, thresholds=(threshold,)) for each in (estimate, blanked))
    assert holed.bad[threshold] >= whole.bad[threshold]


# The agreement of maps


@pytest.mark.parametrize(
    ("answers", "agreeing"),
    [
        ((10.0, 10.9, 10.5), 3),
        ((10.0, 11.0, 12.0), 2),
        ((10.0, 20.0, 30.0), 1),
        ((10.0, NAN, 10.2), 2),
        ((NAN, 5.0, NAN), 1),
        ((NAN, NAN, NAN), 0),
    ],
)
def test_the_largest_group_that_agrees_is_counted(answers: tuple[float, ...], agreeing: int) -> None:
    maps = [np.full((2, 3), answer, np.float32) for answer in answers]
    np.testing.assert_array_equal(consensus(maps), np.full((2, 3), agreeing))


@given(arrays.arrays(np.float32, (4, 2, 2), elements=st.one_of(st.just(NAN), st.floats(0, 6, width=16))))
def test_agreement_equals_the_count_around_each_answer_in_any_order(maps: np.ndarray) -> None:
    found = consensus(list(maps))
    for row, col in np.ndindex(2, 2):
        answers = maps[:, row, col]
        groups = [int(((answers >= one) & (answers <= one + 1)).sum()) for one in answers]
        assert found[row, col] == max(groups)
    np.testing.assert_array_equal(consensus(list(maps[::-1])), found)


def test_maps_of_different_size_are_refused() -> None:
    with pytest.raises(ValueError, match="same size"):
        consensus([np.zeros((2, 2), np.float32), np.zeros((2, 3), np.float32)])
    with pytest.raises(ValueError, match="one or more"):
        consensus([])
