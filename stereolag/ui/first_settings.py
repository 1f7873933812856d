"""The initial settings of the depth page for a pair."""

from __future__ import annotations

from functools import lru_cache
from typing import TypeVar, cast

from stereolag.pair import Pair
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import PresetName, preset

DISPARITIES_AT_FIRST = 64
FIRST_PRESET: PresetName = "fast"
"""Initial preset for a visitor's own pair."""

Matcher = TypeVar("Matcher", bound=StereoMatcher)


def first_settings(kind: type[Matcher], pair: Pair) -> Matcher:
    """Return the initial settings for a pair; those of an example leave visible errors to mend."""
    own = None if pair.shared else FIRST_PRESET
    return cast(Matcher, _first_settings(kind, pair.min_disparity, pair.num_disparities or DISPARITIES_AT_FIRST, own))


@lru_cache(maxsize=256)
def _first_settings(kind: type[StereoMatcher], first: int, count: int, preset_name: PresetName | None) -> StereoMatcher:
    """Return the preset if it is of this kind, else the defaults; cached, because every control asks for them."""
    if preset_name is not None:
        matcher = preset(preset_name, count, first)
        if type(matcher) is kind:
            return matcher
    return kind().with_search_range(first, count)
