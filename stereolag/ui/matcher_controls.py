"""The controls of a stereo method, built from its settings class, and the settings built from its controls.

No method needs code here: the fields of its settings class make its controls, whose initial values fit the pair. A
setting that belongs to the pair, such as the disparities searched, has a separate control for each pair.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable
from contextlib import nullcontext
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, TypeVar, cast

import streamlit as st
from pydantic.fields import FieldInfo

from stereolag.core.settings import (
    KIND,
    Applies,
    FitsImage,
    Number,
    OfThePair,
    Settings,
    SettingsError,
    SliderRange,
    choices,
    marker,
    nested,
)
from stereolag.pair import Pair
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS, preset
from stereolag.ui.controls import adopt_value, class_of, control, kept_value, persistent, visitor_memory
from stereolag.ui.elements import show_refused
from stereolag.ui.sentences import CHOICE_NAMES
from stereolag.ui.streamlit_inside import Expander

# The keys


def setting_key(method: str, name: str, source: str | None = None) -> str:
    """Return the key of the control of one setting.

    Parameters
    ----------
    method
        Short name of the method.
    name
        Name of the setting, dotted if nested, with the kind where there is a choice of kinds:
        "search.rectified.num_disparities".
    source
        :attr:`stereolag.pair.PairId.searched`, for a setting that belongs to the pair.
    """
    key = f"depth.{method}.{name}"
    return key if source is None else f"{key}.{source}"


def more_key(method: str) -> str:
    """Return the key of the expander that holds a method's less common settings."""
    return f"depth.{method}.more"


def preset_key(name: str) -> str:
    """Return the key of the button of a preset."""
    return f"depth.preset.{name}"


# The settings

DEFAULT_DISPARITIES = 64
"""Number of disparities searched in a pair whose range is not known."""

Matcher = TypeVar("Matcher", bound=StereoMatcher)


def default_settings(kind: type[Matcher], pair: Pair) -> Matcher:
    """Return the initial settings for a pair: for a visitor's own, the fast preset, if it is one of this method.

    Those for an example leave visible errors, for the visitor to mend.
    """
    return cast(
        Matcher, _default_settings(kind, pair.min_disparity, pair.num_disparities or DEFAULT_DISPARITIES, pair.shared)
    )


@functools.lru_cache
def _default_settings(kind: type[StereoMatcher], first: int, count: int, shared: bool) -> StereoMatcher:
    if not shared:
        matcher = preset("fast", count, first)
        if isinstance(matcher, kind):
            return matcher
    return kind().with_search_range(first, count)


MAX_WINDOW_PX = 101
"""Largest window that a slider offers, px."""


@functools.cache
def _fields(kind: type[Settings]) -> dict[str, FieldInfo]:
    """Return the fields that have controls, by name: all but the discriminator `KIND`."""
    return {name: field for name, field in kind.model_fields.items() if name != KIND}


@functools.cache
def _kinds(kind: type[Settings], name: str) -> dict[str, type[Settings]]:
    """Return {kind: its class} for a field that holds nested settings; empty for other fields."""
    return {
        str(one.model_fields[KIND].default) if KIND in one.model_fields else "": one
        for one in cast(tuple[type[Settings], ...], nested(kind.model_fields[name]))
    }


def _first_shown(kind: type[Settings]) -> Iterable[str]:
    """Return the settings shown outside the expander, in the order of their controls."""
    return cast(Iterable[str], getattr(kind, "first_shown", ()) or _fields(kind))


@dataclass(frozen=True)
class _Place:
    """The place of one settings class in a method: its initial values, and the keys of its controls.

    Attributes
    ----------
    kind, initial
        The settings class, and the initial values of its controls.
    method, path
        The method, and the names that lead to these settings, each followed by a dot.
    pair
        The pair that the method will match.
    refusals
        Errors of nested settings that conflict; the list is shared with all places nested in this one.
    moved
        The class of a slider that has been moved, and its value.
    """

    kind: type[Settings]
    initial: Settings
    method: type[StereoMatcher]
    path: str
    pair: Pair
    refusals: list[SettingsError]
    moved: tuple[str, Any] = ("", None)

    @classmethod
    def of(cls, kind: type[StereoMatcher], pair: Pair) -> _Place:
        """Return the place of the settings of a whole method, for a pair."""
        return cls(kind, default_settings(kind, pair), kind, "", pair, [])

    def key(self, name: str) -> str:
        of_the_pair = marker(self.kind.model_fields[name], OfThePair)
        return setting_key(self.method.short_name, self.path + name, self.pair.id.searched if of_the_pair else None)

    def nested(self, name: str) -> _Place | None:
        """Return the place of nested settings, of the kind chosen; None for an optional stage that is off."""
        kinds, initial = _kinds(self.kind, name), getattr(self.initial, name)
        if len(kinds) > 1:
            chosen: str = st.session_state.get(f"{self.key(name)}.{KIND}", getattr(initial, KIND))
            kind = kinds[chosen]
            initial = initial if isinstance(initial, kind) else _initial_alternative(kind, self.pair)
            return replace(self, kind=kind, initial=initial, path=f"{self.path}{name}.{chosen}.")
        optional = self.kind.model_fields[name].default is None
        if optional and not st.session_state.get(self.key(name), initial is not None):
            return None
        (kind,) = kinds.values()
        return replace(self, kind=kind, initial=initial or kind(), path=f"{self.path}{name}.")

    def applies(self, name: str, values: Any) -> bool:
        """Return whether a setting has an effect with these values of the others."""
        if marker(self.kind.model_fields[name], Applies) is None:
            return True
        try:
            return self.kind.obstacle(name, values) is None
        except ValueError:  # the other settings conflict, which is reported elsewhere
            return True

    def slider_bounds(self, name: str) -> tuple[Number | None, Number | None]:
        """Return the bounds of a slider where they are narrower than those of the field; None: as the field's."""
        field = self.kind.model_fields[name]
        usual = marker(field, SliderRange) or SliderRange()
        if marker(field, FitsImage):
            return usual.low, min(MAX_WINDOW_PX, *(int(side) - 1 for side in self.pair.left.shape[:2]))
        return usual.low, usual.high

    def values(self) -> dict[str, Any]:
        """Return the values of all controls, drawn or not; a setting that does not apply has its default."""
        values = SimpleNamespace(**dict(self.initial))
        for name, field in _fields(self.kind).items():
            if _kinds(self.kind, name):
                place = self.nested(name)
                value = place and place.settings()
            elif self.moved[0] and class_of(self.key(name)) == self.moved[0]:
                value = self.moved[1]
            else:
                initial, bounds = getattr(self.initial, name), self.slider_bounds(name)
                value = kept_value(self.kind, name, self.key(name), initial, *bounds)
            setattr(values, name, value if self.applies(name, values) else field.default)
        return {name: getattr(values, name) for name in _fields(self.kind)}

    def settings(self) -> Settings:
        """Return the settings that the controls are set to; the initial ones if these are refused."""
        try:
            return cast(Settings, _cached_settings(self.kind, tuple(self.values().items())))
        except SettingsError as error:
            self.refusals.append(error)
            return self.initial


@functools.lru_cache(maxsize=1024)
def _cached_settings(kind: type[Settings], values: tuple[tuple[str, Any], ...]) -> Any:
    """Return settings made of values; cached, since every move needs those of all methods and changes few."""
    return kind(**dict(values))


@dataclass(frozen=True)
class ControlState:
    """The controls of a method and the settings made of their values.

    Attributes
    ----------
    place
        The place of all settings of the method.
    values
        The values of the controls, by name of the setting.
    matcher
        The settings; the last valid ones if these are refused, None if none were valid before.
    refusal
        The error if they are refused, else None.
    """

    place: _Place
    values: dict[str, Any]
    matcher: StereoMatcher | None
    refusal: SettingsError | None


def control_state(kind: type[StereoMatcher], pair: Pair) -> ControlState:
    """Return the state of the controls of a method without drawing them, also right after the visitor moved one."""
    memory, name, place = visitor_memory(), kind.short_name, _Place.of(kind, pair)
    depends_on = place.initial, pair.id, pair.left.shape, pair.num_disparities
    previously, *state = memory.untouched.get(name, (None,))
    if previously == depends_on:
        return ControlState(place, *state)
    values = place.values()
    if not place.refusals:
        try:
            memory.matchers[name] = _cached_settings(kind, tuple(values.items()))
        except SettingsError as error:
            place.refusals.append(error)
    state = [values, memory.matchers.get(name), next(iter(place.refusals), None)]
    if name not in memory.opened:
        memory.untouched[name] = depends_on, *state
    return ControlState(place, *state)


def matcher_with_moved_slider(pair: Pair, slider: str, value: Any) -> StereoMatcher | None:
    """Return the settings of the method whose slider has been moved; None if no method has this slider.

    Parameters
    ----------
    pair
        The pair that the method will match.
    slider
        The CSS class of the slider, as :func:`stereolag.ui.controls.class_of` returns it.
    value
        Its value, which Streamlit may not know yet.

    Raises
    ------
    SettingsError
        The settings are refused.
    """
    for kind in METHODS:
        if slider.startswith(class_of(setting_key(kind.short_name, ""))):
            place = replace(_Place.of(kind, pair), moved=(slider, value))
            return cast(StereoMatcher, _cached_settings(kind, tuple(place.values().items())))
    return None


def ask_matcher(state: ControlState) -> StereoMatcher | None:
    """Draw the controls of a method, and return its settings; the last valid ones if they are refused."""
    place, top = state.place, st.container()
    memory, name = visitor_memory(), place.method.short_name
    memory.opened.add(name)
    memory.untouched.pop(name, None)
    folds = _fields(place.kind).keys() > set(_first_shown(place.kind))
    more = _more_settings(more_key(name)) if folds else None
    with top:
        _draw(place, SimpleNamespace(**state.values), more)
    if state.refusal is not None:
        show_refused(state.refusal)
    return state.matcher


def _more_settings(key: str) -> Expander:
    """Draw the expander for less common settings, open or closed as when its tab was left, and return it.

    While closed, its controls are not drawn; opening it triggers a rerun that draws them.
    """
    if key not in st.session_state:
        st.session_state[key] = st.session_state.get(f"{key}.left", False)
    expander = st.expander("More settings", key=key, on_change="rerun")
    st.session_state[f"{key}.left"] = bool(expander.open)
    return expander


def set_controls(matcher: StereoMatcher, pair: Pair) -> None:
    """Set the controls of a method to these settings; they must not have been drawn yet in this run."""
    _set(_Place.of(type(matcher), pair), matcher)
    visitor_memory().matchers[matcher.short_name] = matcher


def matchers_in_use() -> list[StereoMatcher]:
    """Return the settings of all methods whose controls were drawn or set before, in the order of `METHODS`."""
    matchers = visitor_memory().matchers
    return [matchers[kind.short_name] for kind in METHODS if kind.short_name in matchers]


def _draw(place: _Place, values: Any, more: Expander | None, *, disabled: bool = False) -> None:
    """Draw the controls of a place: those shown first here, the others in the expander `more` while it is open."""
    shown = _first_shown(place.kind)
    for name in shown:
        _draw_setting(place, name, values, more, disabled=disabled)
    if more is None or more.open:
        with more or nullcontext():
            for name in _fields(place.kind):
                if name not in shown:
                    _draw_setting(place, name, values, None, disabled=disabled)


def _draw_setting(place: _Place, name: str, values: Any, more: Expander | None, *, disabled: bool) -> None:
    """Draw the control of one setting.

    An optional stage is a switch with the controls of the stage below it; a choice of kinds is a row of buttons with
    the controls of the chosen kind. A setting that does not apply is disabled.
    """
    field, kinds = place.kind.model_fields[name], _kinds(place.kind, name)
    key, initial = place.key(name), getattr(place.initial, name)
    title, meaning = field.title or name, field.description
    disabled = disabled or not place.applies(name, values)
    if not kinds:
        low, high = place.slider_bounds(name)
        control(
            place.kind,
            name,
            key=key,
            value=initial,
            low=low,
            high=high,
            names=CHOICE_NAMES if choices(field) else None,
            beside=place.method.other_name(name) if place.kind is place.method else "",
            disabled=disabled,
        )
        return
    if len(kinds) > 1:
        st.segmented_control(
            title,
            [*kinds],
            default=str(getattr(initial, KIND)),
            format_func=lambda kind: str(getattr(kinds[kind], "title", kind)),
            required=True,
            **persistent(f"{key}.{KIND}"),
            help=meaning,
        )
    elif field.default is None:
        st.toggle(title, initial is not None, help=meaning, **persistent(key), disabled=disabled)
    inner = place.nested(name)
    if inner is not None:
        value = getattr(values, name)
        _draw(inner, value if isinstance(value, inner.kind) else inner.initial, more, disabled=disabled)


def _initial_alternative(kind: type[Settings], pair: Pair) -> Settings:
    """Return the initial settings of a kind other than the method's default."""
    reaching = getattr(kind, "reaching", None)
    return kind() if reaching is None else cast(Settings, reaching(pair.num_disparities or DEFAULT_DISPARITIES))


def _set(place: _Place, settings: Settings) -> None:
    """Set the controls of a place to these settings."""
    for name, field in _fields(place.kind).items():
        key, value, kinds = place.key(name), getattr(settings, name), _kinds(place.kind, name)
        if not kinds:
            adopt_value(key, value)
            continue
        if len(kinds) > 1:
            st.session_state[f"{key}.{KIND}"] = getattr(value, KIND)
        elif field.default is None:
            st.session_state[key] = value is not None
        inner = place.nested(name)
        if inner is not None:
            _set(inner, value)
