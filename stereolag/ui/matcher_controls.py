"""The controls of any matcher's settings, those of its stages within them, and how they are set from outside."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import NoneType
from typing import Any, get_args

import streamlit as st

from stereolag.settings import Settings
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.opencv import BlockMatcher, StereoBM, StereoSGBM
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.stereo.windows.search import CentredSearch, RectifiedSearch
from stereolag.ui.controls import adopt_value, control
from stereolag.ui.pairs import StereoPair

SEARCH_KEY = "depth.search"
PREFIXES: dict[type[StereoMatcher], str] = {
    CorrelationMatcher: "depth",
    StereoBM: "depth.bm",
    StereoSGBM: "depth.sgbm",
}
SHORT_NAMES = {
    "window_size": "window",
    "block_size": "block",
    "num_disparities": "disparities",
    "min_disparity": "smallest",
    "uniqueness_ratio": "uniqueness",
    "texture_threshold": "texture",
}
OF_THE_PAIR = ("num_disparities", "search_size")
"""Settings that begin with what the pair needs, and so are kept for each pair apart."""

Values = dict[str, Any]


def _along_the_row(values: Mapping[str, Any]) -> bool:
    return bool(values["search"].vertical == 0)


def _window_at_every_pixel(values: Mapping[str, Any]) -> bool:
    step = max(1, round(values["window_size"] * (1 - values["overlap"])))
    return values["optimisation"] is not None or (
        step == 1 and values["score"] != "phase" and values["engine"] != "fft"
    )


APPLIES: dict[str, Callable[[Mapping[str, Any]], bool]] = {
    "speckle_range": lambda values: bool(values["speckle_window_size"] > 0),
    "engine": lambda values: bool(values["score"] != "phase"),
    "optimisation": lambda values: _along_the_row(values) and isinstance(values["search"], RectifiedSearch),
    "cost": lambda values: values["optimisation"] is not None,
    "left_right": lambda values: _along_the_row(values) and _window_at_every_pixel(values),
    "filling": _along_the_row,
    "median": _along_the_row,
}
"""When a setting matters at all, given those drawn before it."""


def ask(
    kind: type[StereoMatcher],
    name: str,
    values: Values,
    pair: StereoPair,
    *,
    value: Any = None,
    drawn: bool = True,
    **options: Any,
) -> None:
    """Draw the control of one setting of a matcher, and note in `values` what it is set to.

    A stage that can be left out is a switch with the stage's own controls below it. What does not apply is disabled
    and counts as its default.

    Parameters
    ----------
    kind, name
        The matcher and its field.
    values
        The fields drawn before.
    pair
        What the matcher will work on.
    value
        What the control is set to at first; the field's own default unless given.
    drawn
        False where it is folded away.
    **options
        As :func:`stereolag.ui.controls.control` takes them.
    """
    applies = name not in APPLIES or APPLIES[name](values)
    key = key_of(PREFIXES[kind], name, pair)
    field = kind.model_fields[name]
    stage = _stage(kind, name)
    if stage is None:
        beside = opencv_name(name) if issubclass(kind, BlockMatcher) else ""
        found = control(kind, name, key=key, value=value, beside=beside, disabled=not applies, drawn=drawn, **options)
    elif field.default is not None:
        found = _ask_stage(stage, key, pair, disabled=not applies, drawn=drawn)
    elif drawn:
        wanted = st.toggle(
            field.title or name, help=field.description, key=key, persist_state="session", disabled=not applies
        )
        found = _ask_stage(stage, key, pair, disabled=not applies, drawn=True) if wanted else None
    else:
        found = _ask_stage(stage, key, pair, disabled=False, drawn=False) if st.session_state.get(key) else None
    values[name] = found if applies else field.default


def set_controls(matcher: StereoMatcher, pair: StereoPair) -> None:
    """Set the controls of a method to these settings; they must not be drawn yet in this run."""
    _set(matcher, PREFIXES[type(matcher)], pair)


def key_of(prefix: str, name: str, pair: StereoPair) -> str:
    """Return the key of the control of one setting."""
    key = f"{prefix}.{SHORT_NAMES.get(name, name)}"
    return f"{key}.{pair.source}" if name in OF_THE_PAIR else key


def search_key(kind: type[Settings], name: str, pair: StereoPair) -> str:
    """Return the key of the control of one setting of a search area."""
    return key_of("depth", "reach" if kind is CentredSearch and name == "vertical" else name, pair)


def opencv_name(name: str) -> str:
    """Return what OpenCV calls a setting: ``num_disparities`` is ``numDisparities``, ``p1`` is ``P1``."""
    first, *others = name.split("_")
    return first + "".join(word.capitalize() for word in others) if others else name.capitalize()


def _ask_stage(stage: type[Settings], prefix: str, pair: StereoPair, *, disabled: bool, drawn: bool) -> Settings:
    """Draw the controls of a stage and return its settings, each of which is within its own bounds."""
    return stage(
        **{
            name: control(stage, name, key=key_of(prefix, name, pair), disabled=disabled, drawn=drawn)
            for name in stage.model_fields
        }
    )


def _set(settings: Settings, prefix: str, pair: StereoPair) -> None:
    for name in type(settings).model_fields:
        value, key = getattr(settings, name), key_of(prefix, name, pair)
        if isinstance(value, CentredSearch | RectifiedSearch):
            _set_search(value, pair)
        elif _stage(type(settings), name) is None:
            adopt_value(key, value)
        else:
            st.session_state[key] = value is not None
            if value is not None:
                _set(value, key, pair)


def _set_search(search: CentredSearch | RectifiedSearch, pair: StereoPair) -> None:
    st.session_state[SEARCH_KEY] = search.kind
    for name in set(type(search).model_fields) - {"kind"}:
        adopt_value(search_key(type(search), name, pair), getattr(search, name))


def _stage(kind: type[Settings], name: str) -> type[Settings] | None:
    """Return the settings class of a field that holds settings, perhaps None; None for all other fields."""
    annotation = kind.model_fields[name].annotation
    for one in (annotation, *(part for part in get_args(annotation) if part is not NoneType)):
        if isinstance(one, type) and issubclass(one, Settings):
            return one
    return None
