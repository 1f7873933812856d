"""The range of disparities that a method searches, read from its settings and put into them."""

from __future__ import annotations

from stereolag.stereo.correlation import CorrelationMatcher
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.opencv import BlockMatcher
from stereolag.stereo.search import RectifiedSearch

LARGEST_COUNT = 1024
FARTHEST_FIRST = 512
LARGEST_VERTICAL = 64
"""Px; what the settings of every method allow."""


def searched_range(matcher: StereoMatcher) -> tuple[int, int] | None:
    """Return the first disparity that a method searches and how many, px.

    None for a correlation that wraps around, which has no ends, and for a method without a range.
    """
    if isinstance(matcher, BlockMatcher):
        return matcher.min_disparity, matcher.num_disparities
    if isinstance(matcher, CorrelationMatcher) and not matcher.search.circular(matcher.window_size):
        lags = matcher.search.lags(matcher.window_size)
        return -lags.dx_last, lags.dx_last - lags.dx_first + 1
    return None


def with_range(matcher: StereoMatcher, first: int, count: int) -> StereoMatcher:
    """Return the same settings with another range, or as much of it as the method allows.

    Parameters
    ----------
    matcher
        A square search area becomes a strip that reaches as many rows up and down, if the method allows as many.
    first
        The first disparity, px.
    count
        How many disparities, a multiple of 16.
    """
    first = min(max(first, -FARTHEST_FIRST), FARTHEST_FIRST)
    count = min(count, LARGEST_COUNT)
    if isinstance(matcher, BlockMatcher):
        changed = {"min_disparity": first, "num_disparities": count}
        return type(matcher).model_validate(matcher.model_dump() | changed)
    if isinstance(matcher, CorrelationMatcher):
        lags = matcher.search.lags(matcher.window_size)
        vertical = min(lags.dy_last, LARGEST_VERTICAL)
        search = RectifiedSearch(num_disparities=count, min_disparity=first, vertical=vertical)
        return type(matcher).model_validate(matcher.model_dump() | {"search": search.model_dump()})
    return matcher
