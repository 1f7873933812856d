"""Maps judged against a reference: the pixels that count, and the certainty of a gain."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pairs import shifted_pair
from scenes import steps_pair

from stereolag.assess.judging import (
    SEAM_ROWS,
    STRIP_ROWS,
    Criterion,
    Gain,
    Judgement,
    TuningPair,
    Unjudged,
    criterion_of,
    estimate_reference,
    measured_reference,
    widest_range,
)
from stereolag.stereo.evaluation import evaluate
from stereolag.stereo.matcher import Reason
from stereolag.stereo.methods import preset
from stereolag.stereo.opencv import StereoBM, StereoSGBM
from stereolag.stereo.semi_global.matcher import SemiGlobalMatcher
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.stereo.windows.search import SearchArea


def random_maps(shape: tuple[int, int], seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    reference = rng.uniform(0, 30, shape).astype(np.float32)
    disparity = reference + rng.normal(0, 2, shape).astype(np.float32)
    disparity[rng.random(shape) < 0.1] = np.nan
    reference[rng.random(shape) < 0.3] = np.nan
    return disparity, reference


@pytest.mark.parametrize("shape", [(5, 7), (8, 8), (61, 90), (120, 33)])
def test_bad_is_that_of_the_evaluation_whatever_the_blocks(shape: tuple[int, int]) -> None:
    disparity, reference = random_maps(shape)
    judged = Judgement.of(disparity, reference)
    assert judged.bad == pytest.approx(evaluate(disparity, reference, thresholds=(2.0,)).bad[2.0])
    assert judged.judged.sum() == np.isfinite(reference).sum()
    assert judged.dense == np.isfinite(disparity).all()
    assert len(judged.wrong) == min(8, shape[0]) * min(8, shape[1])


def test_nothing_judged_is_no_figure() -> None:
    assert math.isnan(Judgement.of(np.zeros((9, 9), np.float32), np.full((9, 9), np.nan, np.float32)).bad)
    with pytest.raises(ValueError, match="both must be the same"):
        Judgement.of(np.zeros((9, 9), np.float32), np.zeros((9, 8), np.float32))


def test_a_gain_everywhere_is_sure_and_one_in_a_corner_is_not() -> None:
    reference = np.zeros((160, 160), np.float32)
    start = np.where(np.random.default_rng(0).random(reference.shape) < 0.3, 9, 0).astype(np.float32)
    everywhere, corner = start.copy(), start.copy()
    everywhere[::5] = 0
    corner[:70, :75] = 0
    before, spread, local = (Judgement.of(one, reference) for one in (start, everywhere, corner))
    sure, chance = Gain.between([before], [spread]), Gain.between([before], [local])
    assert sure.points == pytest.approx(before.bad - spread.bad)
    assert chance.points == pytest.approx(before.bad - local.bad)
    assert sure.points == pytest.approx(chance.points, rel=0.1)
    assert sure.sure > 0.8 * sure.points
    assert chance.sure < 0.6 * chance.points
    assert Gain.between([before], [before]) == Gain(0.0, 0.0)
    twice = Gain.between([before, before], [spread, before])
    assert twice.points == pytest.approx(sure.points / 2)
    assert twice.error == pytest.approx(sure.error / 2)


def test_one_block_alone_is_never_sure() -> None:
    one = [Judgement.of(np.full((1, 1), value, np.float32), np.zeros((1, 1), np.float32)) for value in (9, 0)]
    assert Gain.between([one[0]], [one[1]]).points == 100
    assert Gain.between([one[0]], [one[1]]).sure == -math.inf


def test_without_truth_what_the_accurate_preset_measured_is_the_judge() -> None:
    left, right, truth = steps_pair()
    accurate = preset("accurate", 32).compute(left, right)
    reference = measured_reference(left, right, search_range=(0, 32))
    measured = accurate.reason == Reason.MEASURED
    assert (accurate.reason == Reason.FILLED).any()
    np.testing.assert_array_equal(np.isfinite(reference), measured)
    np.testing.assert_array_equal(reference[measured], accurate.disparity[measured])
    blind, seeing = TuningPair.of(left, right, search_range=(0, 32)), TuningPair.of(left, right, truth)
    np.testing.assert_array_equal(blind.reference, reference)
    assert (blind.criterion, seeing.criterion) == (Criterion.ESTIMATED_BAD_2, Criterion.TRUE_BAD_2)
    assert criterion_of([seeing]) is Criterion.TRUE_BAD_2
    assert criterion_of([seeing, blind]) is Criterion.ESTIMATED_BAD_2


def test_the_estimate_orders_settings_as_the_truth_does() -> None:
    left, right, truth = steps_pair()
    search = SearchArea.rectified(32)
    settings = [
        preset("fast", 32),
        *(CorrelationMatcher(window_size=size, search=search) for size in (3, 5, 11, 31)),
        *(StereoBM(num_disparities=32, block_size=size) for size in (5, 15, 31)),
        StereoSGBM(num_disparities=32),
    ]
    blind, seeing = TuningPair.of(left, right, search_range=(0, 32)), TuningPair.of(left, right, truth)
    ranks = [np.argsort(np.argsort([pair.judge(one).bad for one in settings])) for pair in (blind, seeing)]
    assert np.corrcoef(ranks)[0, 1] > 0.9


def test_nothing_judges_itself_or_where_little_was_measured() -> None:
    left, right, truth = steps_pair()
    blind, seeing = TuningPair.of(left, right, search_range=(0, 32)), TuningPair.of(left, right, truth)
    assert blind.unjudged(StereoBM()) is None
    assert blind.unjudged(SemiGlobalMatcher()) is Unjudged.JUDGES_ITSELF
    assert seeing.unjudged(SemiGlobalMatcher()) is None
    noise = np.random.default_rng(0).integers(0, 256, (2, 100, 150), dtype=np.uint8)
    assert TuningPair.of(*noise).unjudged(StereoBM()) is Unjudged.TOO_LITTLE_MEASURED


def test_strips_are_matched_as_the_whole_is() -> None:
    left, right = shifted_pair(400, 120, 0, -9)
    pair = TuningPair.of(left, right, np.full(left.shape, 9.0))
    strips = pair.strips(0.5)
    assert strips.left.shape == strips.right.shape == strips.reference.shape == (3 * STRIP_ROWS, 120)
    matcher = CorrelationMatcher(window_size=11, search=SearchArea.rectified(16))
    whole, part = matcher.compute(left, right).disparity, strips.map_of(matcher)
    judged = np.isfinite(strips.reference)
    assert judged.mean() == pytest.approx(1 - 2 * SEAM_ROWS / STRIP_ROWS)
    tops = [round(400 / 3 * number + (400 / 3 - STRIP_ROWS) / 2) for number in range(3)]
    rows = np.concatenate([np.arange(top, top + STRIP_ROWS) for top in tops])
    np.testing.assert_array_equal(part[judged], whole[rows][judged])
    assert pair.strips(0.9) is pair
    sparse = np.full(left.shape, np.nan)
    sparse[0] = 9
    assert len(TuningPair.of(left, right, sparse).strips(0.2).reference) == 400


def test_a_truth_that_does_not_fit_is_refused() -> None:
    pair = shifted_pair(20, 30, 0, -2)
    with pytest.raises(ValueError, match="truth has shape"):
        TuningPair.of(*pair, np.zeros((20, 31)))
    with pytest.raises(ValueError, match="no finite disparity"):
        TuningPair.of(*pair, np.full((20, 30), np.nan))


def test_the_widest_range_holds_all() -> None:
    ranges = [StereoBM(min_disparity=-16, num_disparities=32), StereoBM(num_disparities=64)]
    assert widest_range(ranges) == (-16, 80)
    unpadded = CorrelationMatcher(window_size=20, search=SearchArea.centred(20))
    assert widest_range([unpadded]) is None
    assert estimate_reference(None, (100, 100)) == estimate_reference((0, 64), (100, 100))
