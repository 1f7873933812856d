"""Estimates of a search for settings and of a sweep."""

from __future__ import annotations

import numpy as np

from stereolag.assess.judging import TuningPair, estimate_reference
from stereolag.assess.suggestion import candidates, estimate_suggestion
from stereolag.assess.sweep import estimate_sweep
from stereolag.stereo.opencv import StereoBM, StereoSGBM


def test_a_sweep_is_its_largest_cell_and_all_maps() -> None:
    left = np.random.default_rng(0).integers(0, 256, (500, 800), dtype=np.uint8)
    tuning_pair = TuningPair.of(left, left, np.zeros(left.shape))
    told = estimate_sweep(
        StereoSGBM(), [tuning_pair], rows=("block_size", (3, 4, 5)), cols=("num_disparities", (64, 256))
    )
    largest = tuning_pair.estimate(StereoSGBM(block_size=5, num_disparities=256))
    assert told.memory == largest.memory + 4 * 4 * left.size  # a block of 4 px is not allowed
    assert told.seconds > largest.seconds


def test_a_search_is_its_largest_trial_and_without_truth_its_judge() -> None:
    shape, grey = (500, 800), np.uint8
    seeing = estimate_suggestion(StereoBM(), shape, grey, blind=False, budget_s=1e9)
    blind = estimate_suggestion(StereoBM(), shape, grey, blind=True, budget_s=1e9)
    judge = estimate_reference((0, 64), shape, grey)
    assert seeing.memory == max(one.estimate(shape, grey).memory for one in (StereoBM(), *candidates(StereoBM())))
    assert blind.memory == judge.memory > seeing.memory
    assert blind.seconds == seeing.seconds + judge.seconds
    assert estimate_suggestion(StereoBM(), shape, grey, blind=True, budget_s=0.1).seconds == 0.1
