"""The range that a method searches is the one that its settings were given."""

from __future__ import annotations

import pytest
from stereolag.stereo.ranges import searched_range, with_range

from stereolag import CorrelationMatcher, SearchArea, StereoBM, StereoSGBM
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS

MATCHERS: list[StereoMatcher] = [
    *(kind() for kind in METHODS.values()),
    CorrelationMatcher.preset("accurate"),
    CorrelationMatcher(search=SearchArea.rectified(40, 5, 3)),
    CorrelationMatcher(window_size=20, search=SearchArea.centred(400)),
    CorrelationMatcher(window_size=20, search=SearchArea.centred(20)),
]


@pytest.mark.parametrize("matcher", MATCHERS, ids=str)
@pytest.mark.parametrize(("first", "count"), [(0, 64), (-32, 48), (20, 16)])
def test_a_range_that_was_set_is_searched_and_nothing_else_changes(
    matcher: StereoMatcher, first: int, count: int
) -> None:
    changed = with_range(matcher, first, count)
    assert searched_range(changed) == (first, count)
    for name in set(type(matcher).model_fields) - {"search", "num_disparities", "min_disparity"}:
        assert getattr(changed, name) == getattr(matcher, name)


@pytest.mark.parametrize("matcher", MATCHERS, ids=str)
def test_more_than_a_method_allows_is_cut_short(matcher: StereoMatcher) -> None:
    assert searched_range(with_range(matcher, -4000, 4096)) == (-512, 1024)


def test_the_rows_of_a_strip_and_of_a_square_stay() -> None:
    for search, rows in ((SearchArea.rectified(40, 5, 3), 3), (SearchArea.centred(60, vertical=7), 7)):
        changed = with_range(CorrelationMatcher(search=search), 0, 64)
        assert isinstance(changed, CorrelationMatcher)
        assert changed.search == SearchArea.rectified(64, 0, rows)


def test_ranges_as_they_are() -> None:
    assert searched_range(StereoBM(min_disparity=-16, num_disparities=32)) == (-16, 32)
    assert searched_range(StereoSGBM()) == (0, 64)
    assert searched_range(CorrelationMatcher(window_size=20, search=SearchArea.centred(40))) == (-10, 21)
    assert searched_range(CorrelationMatcher(window_size=20, search=SearchArea.centred(20))) is None
