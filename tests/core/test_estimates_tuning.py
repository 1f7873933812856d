"""What a sweep tells before it starts."""

from __future__ import annotations

import numpy as np

from stereolag.stereo.opencv import StereoSGBM
from stereolag.tuning.objective import TuningPair
from stereolag.tuning.sweep import estimate_sweep


def test_a_sweep_is_its_largest_cell_and_all_maps() -> None:
    left = np.random.default_rng(0).integers(0, 256, (500, 800), dtype=np.uint8)
    tuning_pair = TuningPair.of(left, left, np.zeros(left.shape))
    told = estimate_sweep(
        StereoSGBM(), [tuning_pair], rows=("block_size", (3, 4, 5)), cols=("num_disparities", (64, 256))
    )
    largest = tuning_pair.estimate(StereoSGBM(block_size=5, num_disparities=256))
    assert told.memory == largest.memory + 4 * 4 * left.size  # a block of 4 px is no setting
    assert told.seconds > largest.seconds
