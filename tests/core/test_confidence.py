"""Confidence of a disparity: between 0 and 1, only for measured pixels, and higher where it is right."""

from __future__ import annotations

import numpy as np
import pytest
from pairs import shifted_pair

import stereolag as sl
from stereolag.stereo.evaluation import confidence
from stereolag.stereo.matcher import StereoMatcher

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
    assert sure.dtype == np.float32
    assert not np.isfinite(sure[~measured]).any()
    known = np.isfinite(sure)
    assert known.sum() > 0.9 * measured.sum()
    assert sure[known].min() >= 0
    assert sure[known].max() <= 1
    good = known & (np.abs(result.disparity - 6) < 0.5)
    assert good.mean() > 0.4
    assert np.median(sure[good]) > 0.7
    if (known & ~good).sum() > 50:
        assert np.median(sure[known & ~good]) < np.median(sure[good]) - 0.2


def test_a_flat_image_is_trusted_nowhere() -> None:
    flat = np.full((60, 90), 80, np.uint8)
    result = sl.StereoSGBM(num_disparities=16, disp12_max_diff=-1, uniqueness_ratio=0).compute(flat, flat)
    assert not np.nan_to_num(confidence(result, flat, flat)).any()


@pytest.mark.parametrize("matcher", [sl.StereoBM(num_disparities=16, block_size=9), sl.preset("fast", 16)])
def test_a_pair_of_another_size_is_refused(matcher: sl.StereoMatcher) -> None:
    left, right = shifted_pair(60, 90, 0, -5)
    result = matcher.compute(left, right)
    with pytest.raises(ValueError, match="must be of one size"):
        confidence(result, left[:50], right[:50])
