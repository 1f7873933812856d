"""The controls of the stereo matchers, and the settings with which they begin."""

from __future__ import annotations

from contextlib import nullcontext
from functools import lru_cache
from typing import Any, TypeVar, cast

import streamlit as st
from streamlit.elements.lib.mutable_expander_container import ExpanderContainer

from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.opencv import SUBPIXEL, BlockMatcher, StereoBM, StereoSGBM
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.stereo.windows.search import AnySearch, CentredSearch, RectifiedSearch, SearchArea
from stereolag.ui.controls import control, last_valid
from stereolag.ui.matcher_controls import PREFIXES, SEARCH_KEY, Values, ask, search_key
from stereolag.ui.pairs import StereoPair

SEARCH_AREAS = {"rectified": "Strip along the row", "centred": "Square"}
SCORES = {"zncc": "ZNCC", "ncc": "NCC", "cross": "Plain", "phase": "Phase"}
ENGINES = {"auto": "Automatic", "window_sums": "Window sums", "fft": "FFT"}

LARGEST_WINDOW = 101
LARGEST_REACH = 256
NEGATIVE_REACH = 64
LARGEST_VERTICAL = 16
DISPARITIES_AT_FIRST = 64
ROOM_FOR_WINDOW = 32

FIRST_SHOWN: dict[type[BlockMatcher], tuple[str, ...]] = {
    StereoBM: ("block_size", "num_disparities", "uniqueness_ratio", "texture_threshold"),
    StereoSGBM: ("block_size", "num_disparities", "uniqueness_ratio", "p1", "p2"),
}
"""The settings that most visitors want; the others are folded away below them."""

Matcher = TypeVar("Matcher", bound=StereoMatcher)
OpenCvMatcher = TypeVar("OpenCvMatcher", bound=BlockMatcher)


def ask_correlation(pair: StereoPair) -> CorrelationMatcher | None:
    """Return the correlation matcher as the visitor set it; what was valid before where the settings are refused."""
    values: Values = {}
    ask(CorrelationMatcher, "window_size", values, pair, high=_largest_window(pair))
    ask(CorrelationMatcher, "overlap", values, pair)
    area, scores, more = st.container(), st.container(), _more_settings(CorrelationMatcher)
    with area:
        values["search"] = _ask_search(pair, more)
    with scores:
        ask(CorrelationMatcher, "score", values, pair, names=SCORES)
    with more:
        for name in CorrelationMatcher.model_fields:
            if name not in values:
                names = {"names": ENGINES} if name == "engine" else {}
                ask(CorrelationMatcher, name, values, pair, drawn=bool(more.open), **names)
    return last_valid(lambda: CorrelationMatcher(**values), _kept_key(CorrelationMatcher))


def ask_block_matcher(pair: StereoPair) -> StereoBM | None:
    """Return OpenCV's StereoBM as the visitor set it."""
    return _ask_opencv(StereoBM, pair)


def ask_semi_global(pair: StereoPair, *, drawn: bool = True) -> StereoSGBM | None:
    """Return OpenCV's StereoSGBM as the visitor set it; `drawn` is False where its controls are folded away."""
    return _ask_opencv(StereoSGBM, pair, drawn=drawn)


def first_settings(kind: type[Matcher], pair: StereoPair) -> Matcher:
    """Return the settings with which the page begins for a pair."""
    return cast(Matcher, _first_settings(kind, pair.num_disparities or DISPARITIES_AT_FIRST))


@lru_cache(maxsize=256)
def _first_settings(kind: type[StereoMatcher], disparities: int) -> StereoMatcher:
    """Return them; asked for by every control, they are validated once."""
    if issubclass(kind, CorrelationMatcher):
        return kind(search=SearchArea.rectified(disparities))
    return kind.model_validate({"num_disparities": -(-disparities // SUBPIXEL) * SUBPIXEL})


def matchers_in_use() -> list[StereoMatcher]:
    """Return the settings of all methods whose controls were drawn before."""
    kept = (st.session_state.get(_kept_key(kind)) for kind in PREFIXES)
    return [matcher for matcher in kept if isinstance(matcher, StereoMatcher)]


def searched_disparities() -> tuple[int, int] | None:
    """Return (the first disparity, how many) of the convolution's strip in use; None of a square or before any."""
    for matcher in matchers_in_use():
        if isinstance(matcher, CorrelationMatcher) and isinstance(matcher.search, RectifiedSearch):
            return matcher.search.min_disparity, matcher.search.num_disparities
    return None


def _kept_key(kind: type[StereoMatcher]) -> str:
    return f"{PREFIXES[kind]}.valid"


def _ask_opencv(kind: type[OpenCvMatcher], pair: StereoPair, *, drawn: bool = True) -> OpenCvMatcher | None:
    values: Values = {}
    for name in FIRST_SHOWN[kind]:
        _ask_opencv_setting(kind, name, values, pair, drawn=drawn)
    more = _more_settings(kind) if drawn else None
    with more or nullcontext():
        for name in kind.model_fields:
            if name not in values:
                _ask_opencv_setting(kind, name, values, pair, drawn=more is not None and bool(more.open))
    return last_valid(lambda: kind(**values), _kept_key(kind))


def _more_settings(kind: type[StereoMatcher]) -> ExpanderContainer:
    """Return where the settings of a method are that are seldom changed; folded away, they are not drawn."""
    return st.expander("More settings", key=f"{PREFIXES[kind]}.more", on_change="rerun")


def _ask_opencv_setting(kind: type[BlockMatcher], name: str, values: Values, pair: StereoPair, *, drawn: bool) -> None:
    ends: dict[str, dict[str, Any]] = {
        "num_disparities": {"high": LARGEST_REACH},
        "min_disparity": {"low": -NEGATIVE_REACH, "high": NEGATIVE_REACH},
        "block_size": {"high": _largest_window(pair)},
    }
    first = getattr(first_settings(kind, pair), name)
    ask(kind, name, values, pair, value=first, drawn=drawn, **ends.get(name, {}))


def _ask_search(pair: StereoPair, more: ExpanderContainer) -> AnySearch:
    """Return the search area, what is seldom changed of it asked for in `more`.

    Whether the window fits into it is checked with all settings together.
    """
    kind = st.segmented_control(
        "Search",
        [*SEARCH_AREAS],
        default="rectified",
        format_func=lambda name: SEARCH_AREAS[name],
        required=True,
        key=SEARCH_KEY,
        persist_state="session",
        help="A strip to one side suits rectified pairs, as OpenCV assumes; the square around the window’s own place "
        "is the report’s choice and forgives cameras that were not aligned.",
    )
    disparities = pair.num_disparities or DISPARITIES_AT_FIRST
    if kind == "centred":
        return SearchArea.centred(
            control(
                CentredSearch,
                "search_size",
                key=search_key(CentredSearch, "search_size", pair),
                value=2 * disparities + ROOM_FOR_WINDOW,
                high=LARGEST_REACH,
            ),
            vertical=control(
                CentredSearch,
                "vertical",
                key=search_key(CentredSearch, "vertical", pair),
                high=LARGEST_REACH,
                when_empty="as far as sideways",
            ),
        )
    ends: dict[str, dict[str, Any]] = {
        "num_disparities": {"value": disparities, "high": LARGEST_REACH},
        "vertical": {"high": LARGEST_VERTICAL},
        "min_disparity": {"low": -NEGATIVE_REACH, "high": NEGATIVE_REACH},
    }
    found = {}
    for name, narrower in ends.items():
        folded = name == "min_disparity"
        with more if folded else nullcontext():
            key = search_key(RectifiedSearch, name, pair)
            found[name] = control(RectifiedSearch, name, key=key, drawn=bool(more.open) or not folded, **narrower)
    return RectifiedSearch(**found)


def _largest_window(pair: StereoPair) -> int:
    """Return the side of the largest window that is of use, px."""
    rows, cols = pair.left.shape[:2]
    return min(LARGEST_WINDOW, int(rows) - 1, int(cols) - 1)
