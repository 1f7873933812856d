"""The matchers on the bundled pairs: accurate enough for the pages that teach with them."""

from __future__ import annotations

import numpy as np
import pytest

from stereolag.io.disparities import read_disparity
from stereolag.io.images import read_image
from stereolag.samples import stereo_pairs
from stereolag.stereo.evaluation import evaluate
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.stereo.windows.search import SearchArea


@pytest.mark.parametrize(
    ("name", "allowed"), [("cube", 15), ("fence", 50), ("giraffes", 45), ("square", 15), ("road", 25)]
)
def test_plain_correlation_measures_the_bundled_pairs(name: str, allowed: float) -> None:
    example = stereo_pairs()[name]
    truth = read_disparity(example.disparity)
    matcher = CorrelationMatcher(window_size=15, search=SearchArea.rectified(example.num_disparities))
    result = matcher.compute(read_image(example.left), read_image(example.right))
    seen = read_image(example.occlusion) == 0
    figures = evaluate(result.disparity, truth, mask=seen & np.isfinite(truth))
    assert figures.density > 0.9
    assert figures.bad_measured[2.0] < allowed


def test_windows_on_the_fence_are_matched_a_whole_number_of_pickets_away() -> None:
    example = stereo_pairs()["fence"]
    truth = read_disparity(example.disparity)
    matcher = CorrelationMatcher(window_size=15, search=SearchArea.rectified(example.num_disparities))
    found = matcher.compute(read_image(example.left), read_image(example.right)).disparity
    pickets = (np.abs(truth - 26.5) < 0.1) & np.isfinite(found)
    before_the_wall = pickets & (np.arange(truth.shape[0]) < 335)[:, None] & (np.arange(truth.shape[1]) < 380)
    away = (found - truth)[before_the_wall] / 14.5
    assert (np.abs(away) > 0.5).mean() > 0.5
    assert (np.abs(away - np.rint(away)) < 0.1).mean() > 0.8
