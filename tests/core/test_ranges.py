"""Every method searches the range given in its settings."""

from __future__ import annotations

import pytest

from stereolag import CorrelationMatcher, SearchArea, StereoBM, StereoSGBM
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS, preset

MATCHERS: list[StereoMatcher] = [
    *(kind() for kind in METHODS),
    preset("fast"),
    CorrelationMatcher(search=SearchArea.rectified(40, 5, 3)),
    CorrelationMatcher(window_size=20, search=SearchArea.centred(400)),
    CorrelationMatcher(window_size=20, search=SearchArea.centred(20)),
]


@pytest.mark.parametrize("matcher", MATCHERS, ids=str)
def test_a_range_that_was_set_is_searched_and_nothing_else_changes(matcher: StereoMatcher) -> None:
    for first, count in ((0, 64), (-32, 48), (20, 16)):
        changed = matcher.with_search_range(first, count)
        assert changed.search_range() == (first, count)
        for name in set(type(matcher).model_fields) - {"search", "num_disparities", "min_disparity"}:
            assert getattr(changed, name) == getattr(matcher, name)
    assert matcher.with_search_range(-4000, 4096).search_range() == (-512, 1024)  # cut short to what is allowed


def test_ranges_as_they_are_and_rows_that_stay() -> None:
    for search, rows in ((SearchArea.rectified(40, 5, 3), 3), (SearchArea.centred(60, vertical=7), 7)):
        changed = CorrelationMatcher(search=search).with_search_range(0, 64)
        assert isinstance(changed, CorrelationMatcher)
        assert changed.search == SearchArea.rectified(64, 0, rows)
    assert CorrelationMatcher().search == SearchArea.rectified(64)
    assert preset("accurate", 48, -5).search_range() == (-5, 48)
    assert StereoBM(min_disparity=-16, num_disparities=32).search_range() == (-16, 32)
    assert StereoSGBM().search_range() == (0, 64)
    assert CorrelationMatcher(window_size=20, search=SearchArea.centred(40)).search_range() == (-10, 21)
    assert CorrelationMatcher(window_size=20, search=SearchArea.centred(20)).search_range() is None
