"""The state of the depth page, saved and restored: in its address, in a session, and as settings handed over."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable
from typing import Any

import streamlit as st

from stereolag import samples
from stereolag.core.settings import scaled_settings
from stereolag.figures.legends import PALETTES
from stereolag.io.sessions import Colours, Session
from stereolag.pair import SIZES, Pair
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS
from stereolag.ui.addresses import Address, Choice, example_choice, warn_ignored
from stereolag.ui.depth.maps import DEFAULT_SHOWN, SHOWN, TAB, show_method, shown_methods
from stereolag.ui.depth.view import DEFAULT_PALETTE, INVERTED, OUTLINED, PAIR, PALETTE, SIZE, DepthView, range_key
from stereolag.ui.elements import refusals_shown
from stereolag.ui.matcher_controls import default_settings, matchers_in_use, set_controls

MAPS = "maps"
"""The parameter that names the maps shown."""

ADOPTED = "depth.adopt"
"""Session-state key of the settings to adopt."""

RESTORED = "depth.restore"
"""Session-state key of the settings and colours of a session that are still to be set, for its full-size pair."""


# The address


@functools.cache  # listing the examples reads their folder, and every run of the page asks
def _choices() -> dict[str, Choice]:
    """Return the choices that an address can name, by parameter."""
    return {"pair": example_choice(PAIR, samples.stereo_pairs()), "size": Choice(SIZE, [*SIZES])}


def _prefix(kind: type[StereoMatcher]) -> str:
    """Return the parameter prefix of a method's settings; empty for the first method."""
    return "" if kind is METHODS[0] else f"{kind.short_name}."


DEPTH_ADDRESS: Address[Pair] = Address(
    "depth.address",
    _choices,
    lambda pair: {_prefix(kind): default_settings(kind, pair) for kind in METHODS},
    set_controls,
)


def recall_pair_and_maps() -> None:
    """Apply the example, size and maps that a new address names, and keep its settings for later."""
    found = DEPTH_ADDRESS.recall_choices()
    if found is not None:
        _recall_maps(found.pop(MAPS, None))


def _recall_maps(value: str | None) -> None:
    """Choose the maps that an address names; the default ones if it names none."""
    allowed, named = [method.short_name for method in METHODS], (value or "").split(",")
    if set(named) <= set(allowed):
        st.session_state.update({SHOWN: [name for name in allowed if name in named], TAB: named[0]})
        return
    if SHOWN in st.session_state:
        st.session_state[SHOWN] = [*DEFAULT_SHOWN]
    if st.session_state.get(TAB, DEFAULT_SHOWN[0]) not in DEFAULT_SHOWN:
        st.session_state[TAB] = DEFAULT_SHOWN[0]
    if value is not None:
        warn_ignored(MAPS, value, allowed)


def write_address(pair: Pair, matchers: Iterable[StereoMatcher | None]) -> None:
    """Write the choices and settings that differ from their defaults into the address."""
    shown = [method.short_name for method in shown_methods()]
    maps = {MAPS: ",".join(shown)} if shown and shown != DEFAULT_SHOWN else {}
    DEPTH_ADDRESS.write(pair, {_prefix(type(one)): one for one in filter(None, matchers)}, **maps)


# A session, and settings handed over


def saved_state(view: DepthView, factor: float) -> dict[str, Any]:
    """Return the state of the page, as arguments of :func:`stereolag.io.sessions.session_json`.

    Settings and colours are for the pair at full size, `factor` times the size shown; settings that are not allowed
    at that size are left out.
    """
    state, shown = st.session_state, view.pair
    used = {type(matcher): matcher for matcher in matchers_in_use()}
    for result in view.results.values():
        used.setdefault(type(result.settings), result.settings)
    colours = {
        "palette": state.get(PALETTE, DEFAULT_PALETTE),
        "inverted": bool(state.get(INVERTED, False)),
        "outlined": bool(state.get(OUTLINED, False)),
    }
    if (ends := state.get(range_key(shown.digest))) is not None:
        colours |= {end: value * factor for end, value in zip(("low", "high"), ends, strict=True)}
    scaled = [for_size(matcher, factor)[0] for matcher in used.values()]
    return {
        "matchers": [*filter(None, scaled)],
        "shown": [method.short_name for method in shown_methods()],
        "size": state.get(SIZE, "Automatic"),
        "colours": colours,
        "num_disparities": shown.num_disparities and math.ceil(shown.num_disparities * factor),
        "min_disparity": math.floor(shown.min_disparity * factor),
    }


def at_size(settings: StereoMatcher, factor: float) -> StereoMatcher:
    """Return settings for images enlarged by `factor`; ValueError if they are not allowed there."""
    return settings if factor == 1 else scaled_settings(settings, factor)


def for_size(settings: StereoMatcher, factor: float) -> tuple[StereoMatcher | None, str]:
    """Return settings for images enlarged by `factor`, or None and why they are not allowed."""
    try:
        return at_size(settings, factor), ""
    except ValueError as error:
        return None, str(error)


def restore(session: Session) -> None:
    """Restore the page from a session whose pair is in use; its controls must not have been drawn yet in this run."""
    saved = session.document
    st.session_state.update(
        {
            SIZE: saved.size if saved.size in SIZES else "Automatic",
            INVERTED: saved.colours.inverted,
            OUTLINED: saved.colours.outlined,
            RESTORED: (session.left.shape[1], session.matchers, saved.colours),
        }
    )
    if saved.shown:
        st.session_state.update({SHOWN: [*saved.shown], TAB: saved.shown[0]})
    if saved.colours.palette in PALETTES:
        st.session_state[PALETTE] = saved.colours.palette


def adopt(matcher: StereoMatcher) -> None:
    """Rerun the page with its controls set to these settings."""
    st.session_state[ADOPTED] = matcher
    st.rerun(scope="app")


def recall_settings(pair: Pair) -> None:
    """Set the controls to the settings that are waiting for this pair; none must have been drawn yet in this run.

    They come from a new address, which resets all settings that it does not name, from :func:`adopt`, or from
    :func:`restore`.
    """
    DEPTH_ADDRESS.recall_settings(pair)
    adopted: StereoMatcher | None = st.session_state.pop(ADOPTED, None)
    if adopted is not None:
        set_controls(adopted, pair)
        st.session_state[TAB] = adopted.short_name
        show_method(type(adopted))
    if RESTORED in st.session_state:
        _restore_settings(pair, *st.session_state.pop(RESTORED))


def _restore_settings(pair: Pair, width: int, matchers: Iterable[StereoMatcher], colours: Colours) -> None:
    """Set the controls to a session's settings and colours, which are for an image of this width, px."""
    factor = pair.left.shape[1] / width
    for matcher in matchers:
        with refusals_shown(f"The settings of {matcher.title} could not be scaled with the images. {{}}"):
            set_controls(at_size(matcher, factor), pair)
    if colours.low is not None and colours.high is not None:
        st.session_state[range_key(pair.digest)] = colours.low * factor, colours.high * factor
