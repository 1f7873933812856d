"""The settings with which the page begins for a pair."""

from __future__ import annotations

from functools import lru_cache
from typing import TypeVar, cast

from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import PresetName, preset
from stereolag.ui.pairs import StereoPair

DISPARITIES_AT_FIRST = 64
FIRST_PRESET: PresetName = "fast"
"""With which a pair of the visitor's own begins."""

Matcher = TypeVar("Matcher", bound=StereoMatcher)


def first_settings(kind: type[Matcher], pair: StereoPair) -> Matcher:
    """Return the settings with which the page begins for a pair: those of an example show what there is to mend."""
    own = None if pair.shared else FIRST_PRESET
    return cast(Matcher, _first_settings(kind, pair.min_disparity, pair.num_disparities or DISPARITIES_AT_FIRST, own))


@lru_cache(maxsize=256)
def _first_settings(kind: type[StereoMatcher], first: int, count: int, preset_name: PresetName | None) -> StereoMatcher:
    """Return them, those of the preset where it is of this kind; asked for by every control, they are made once."""
    if preset_name is not None:
        matcher = preset(preset_name, count, first)
        if type(matcher) is kind:
            return matcher
    return kind().with_search_range(first, count)
