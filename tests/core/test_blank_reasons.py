"""The reasons found for OpenCV's blank pixels, compared with the pixels that each filter alone removes."""

from __future__ import annotations

import numpy as np
import pytest
from pairs import shifted_pair, texture

from stereolag.assess.explaining import blank_reasons
from stereolag.stereo.matcher import Reason
from stereolag.stereo.opencv import BlockMatcher, StereoBM, StereoSGBM
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.stereo.windows.search import SearchArea

OPEN_BM = {"uniqueness_ratio": 0, "texture_threshold": 0}
OPEN_SGBM = {"uniqueness_ratio": 0, "speckle_window_size": 0, "disp12_max_diff": 64}


def hard_pair() -> tuple[np.ndarray, np.ndarray]:
    """Return a pair with a flat strip, a striped one, and a near square that hides part of the background."""
    rng = np.random.default_rng(0)
    left = texture(150, 220, seed=1)
    left[100:130] = 90
    left[65:95] = 128 + 60 * np.sin(np.arange(220) * 2 * np.pi / 11)
    right = np.roll(left, -6, axis=1)
    left[15:55, 90:150] = texture(40, 60, seed=2)
    right[15:55, 70:130] = left[15:55, 90:150]
    noisy = [np.clip(image + rng.normal(0, 1.5, image.shape), 0, 255) for image in (left, right)]
    return noisy[0].astype(np.uint8), noisy[1].astype(np.uint8)


@pytest.mark.parametrize(
    ("matcher", "reason"),
    [
        (StereoBM(num_disparities=32, block_size=9, **OPEN_BM | {"uniqueness_ratio": 20}), Reason.AMBIGUOUS),
        (StereoBM(num_disparities=32, block_size=9, **OPEN_BM | {"texture_threshold": 400}), Reason.LOW_TEXTURE),
        (StereoBM(num_disparities=32, block_size=9, **OPEN_BM, disp12_max_diff=1), Reason.LEFT_RIGHT),
        (
            StereoBM(num_disparities=32, block_size=9, **OPEN_BM, speckle_window_size=80, speckle_range=16),
            Reason.SPECKLE,
        ),
        (StereoSGBM(num_disparities=32, **OPEN_SGBM | {"uniqueness_ratio": 20}), Reason.AMBIGUOUS),
        (StereoSGBM(num_disparities=32, **OPEN_SGBM | {"disp12_max_diff": 1}), Reason.LEFT_RIGHT),
        (StereoSGBM(num_disparities=32, **OPEN_SGBM | {"speckle_window_size": 400}), Reason.SPECKLE),
    ],
)
def test_a_filter_alone_is_the_reason_of_all_that_it_takes_away(matcher: BlockMatcher, reason: Reason) -> None:
    left, right = hard_pair()
    result = matcher.compute(left, right)
    found = blank_reasons(result, left, right)
    everything = type(matcher)(num_disparities=32, block_size=matcher.block_size, **_open(matcher)).compute(left, right)
    taken = everything.valid & ~result.valid
    assert taken.sum() > 100
    assert (found[taken] == reason).all()
    assert (found[~everything.valid & ~result.valid] == Reason.OUT_OF_FRAME).all()
    assert (found[result.valid] == Reason.MEASURED).all()


def _open(matcher: BlockMatcher) -> dict[str, int]:
    return OPEN_BM if isinstance(matcher, StereoBM) else OPEN_SGBM


@pytest.mark.parametrize(
    "matcher",
    [
        StereoBM(num_disparities=32, block_size=9, texture_threshold=700, disp12_max_diff=1, speckle_window_size=80),
        StereoSGBM(num_disparities=32),
    ],
)
def test_each_filter_answers_for_what_it_is_the_first_to_blank(matcher: BlockMatcher) -> None:
    left, right = hard_pair()
    result = matcher.compute(left, right)
    found = blank_reasons(result, left, right)
    assert ((found == Reason.MEASURED) == result.valid).all()
    causes = {Reason(cause) for cause in np.unique(found)}
    assert causes >= {Reason.MEASURED, Reason.OUT_OF_FRAME, Reason.AMBIGUOUS, Reason.LEFT_RIGHT}
    if isinstance(matcher, StereoBM):
        assert (found[110:120, 60:200] == Reason.LOW_TEXTURE).mean() > 0.9


def test_a_matcher_that_knows_its_reasons_is_believed() -> None:
    left, right = shifted_pair(60, 90, 0, -5)
    result = CorrelationMatcher(window_size=9, search=SearchArea.rectified(16)).compute(left, right)
    assert blank_reasons(result, left, right) is result.reason
