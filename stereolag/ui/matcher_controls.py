"""The controls of a stereo method, built from its settings class, and the settings built from its controls.

A stereo method needs no code of its own here: its controls start from the settings that fit the pair. A setting of the
pair, such as the disparities searched, has a control of its own for each pair.
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
from stereolag.stereo.methods import METHODS, PresetName, preset
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
        Name of the setting, dotted if nested; the kind follows a choice of kinds: "search.rectified.num_disparities".
    source
        :attr:`stereolag.pair.PairId.searched`, for a setting that belongs to the pair.
    """
    key = f"depth.{method}.{name}"
    return key if source is None else f"{key}.{source}"


def more_key(method: str) -> str:
    """Return the key of the expander with a method's initially hidden settings."""
    return f"depth.{method}.more"


def preset_key(name: str) -> str:
    """Return the key of the button of a preset."""
    return f"depth.preset.{name}"


# The settings

DISPARITIES_AT_FIRST = 64
FIRST_PRESET: PresetName = "fast"
"""Initial preset for a visitor's own pair."""

Matcher = TypeVar("Matcher", bound=StereoMatcher)


def default_settings(kind: type[Matcher], pair: Pair) -> Matcher:
    """Return the initial settings for a pair; those of an example leave visible errors to mend."""
    return cast(
        Matcher, _default_settings(kind, pair.min_disparity, pair.num_disparities or DISPARITIES_AT_FIRST, pair.shared)
    )


@functools.lru_cache
def _default_settings(kind: type[StereoMatcher], first: int, count: int, shared: bool) -> StereoMatcher:
    if not shared:
        matcher = preset(FIRST_PRESET, count, first)
        if isinstance(matcher, kind):
            return matcher
    return kind().with_search_range(first, count)


LARGEST_WINDOW = 101


@functools.cache
def _fields(kind: type[Settings]) -> dict[str, FieldInfo]:
    """Return the fields that have controls, by name: all but the kind."""
    return {name: field for name, field in kind.model_fields.items() if name != KIND}


@functools.cache
def _kinds(kind: type[Settings], name: str) -> dict[str, type[Settings]]:
    """Return the kinds of settings that a field may hold, by the names of the kinds; empty for other fields."""
    allowed = cast(tuple[type[Settings], ...], nested(kind.model_fields[name]))
    return {str(one.model_fields[KIND].default) if KIND in one.model_fields else "": one for one in allowed}


def _first_shown(kind: type[Settings]) -> Iterable[str]:
    """Return the settings that are not folded away, in the order of their controls."""
    first_shown: tuple[str, ...] = getattr(kind, "first_shown", ())
    return first_shown or _fields(kind)


@dataclass(frozen=True)
class _Place:
    """One settings class of a method, its initial values, and where its controls keep theirs.

    Attributes
    ----------
    kind, first
        The settings class, and the initial values of its controls.
    method, path
        The method, and the names leading to these settings, each followed by a dot.
    pair
        The pair the matcher will work on.
    refusals
        Why nested settings were refused, if they conflict; one list for this place and all within it.
    moved
        The class of a slider that has been moved, and its value there.
    """

    kind: type[Settings]
    first: Settings
    method: type[StereoMatcher]
    path: str
    pair: Pair
    refusals: list[SettingsError]
    moved: tuple[str, Any] = ("", None)

    @classmethod
    def of(cls, kind: type[StereoMatcher], pair: Pair) -> _Place:
        """Return the place of all settings of a method, for a pair."""
        return cls(kind, default_settings(kind, pair), kind, "", pair, [])

    def key(self, name: str) -> str:
        of_the_pair = marker(self.kind.model_fields[name], OfThePair)
        return setting_key(self.method.short_name, self.path + name, self.pair.id.searched if of_the_pair else None)

    def within(self, name: str) -> _Place | None:
        """Return the place of nested settings, of the kind chosen; None for an optional stage that is off."""
        kinds, first = _kinds(self.kind, name), getattr(self.first, name)
        if len(kinds) > 1:
            chosen: str = st.session_state.get(f"{self.key(name)}.{KIND}", getattr(first, KIND))
            kind = kinds[chosen]
            first = first if isinstance(first, kind) else _alternative(kind, self.pair)
            return replace(self, kind=kind, first=first, path=f"{self.path}{name}.{chosen}.")
        optional = self.kind.model_fields[name].default is None
        if optional and not st.session_state.get(self.key(name), first is not None):
            return None
        (kind,) = kinds.values()
        return replace(self, kind=kind, first=first or kind(), path=f"{self.path}{name}.")

    def applies(self, name: str, values: Any) -> bool:
        """Return whether a setting has an effect with these values of the others."""
        if marker(self.kind.model_fields[name], Applies) is None:
            return True
        try:
            return self.kind.obstacle(name, values) is None
        except ValueError:  # the other settings conflict, which is reported elsewhere
            return True

    def ends(self, name: str) -> tuple[Number | None, Number | None]:
        """Return the bounds of a slider where the field allows more than the inputs can use."""
        field = self.kind.model_fields[name]
        usual = marker(field, SliderRange) or SliderRange()
        if marker(field, FitsImage):
            return usual.low, min(LARGEST_WINDOW, *(int(side) - 1 for side in self.pair.left.shape[:2]))
        return usual.low, usual.high

    def values(self) -> dict[str, Any]:
        """Return the values of all controls, drawn or not; a setting that does not apply has its default."""
        values = SimpleNamespace(**dict(self.first))
        for name, field in _fields(self.kind).items():
            if _kinds(self.kind, name):
                place = self.within(name)
                found = place and place.settings()
            elif self.moved[0] and class_of(self.key(name)) == self.moved[0]:
                found = self.moved[1]
            else:
                found = kept_value(self.kind, name, self.key(name), getattr(self.first, name), *self.ends(name))
            setattr(values, name, found if self.applies(name, values) else field.default)
        return {name: getattr(values, name) for name in _fields(self.kind)}

    def settings(self) -> Settings:
        """Return these settings; the initial ones if they are refused."""
        try:
            return cast(Settings, _made(self.kind, tuple(self.values().items())))
        except SettingsError as error:
            self.refusals.append(error)
            return self.first


@functools.lru_cache(maxsize=1024)
def _made(kind: type[Settings], values: tuple[tuple[str, Any], ...]) -> Any:
    """Return settings; all settings of all methods are needed at every move, and most of them did not change."""
    return kind(**dict(values))


@dataclass(frozen=True)
class AsSet:
    """The settings of a method as its controls are set.

    Attributes
    ----------
    place
        Where the controls keep their values.
    values
        The values of the controls.
    matcher
        The settings; the last valid ones if these are refused, None if there are none.
    refusal
        Why they are refused.
    """

    place: _Place
    values: dict[str, Any]
    matcher: StereoMatcher | None
    refusal: SettingsError | None


def matcher_as_set(kind: type[StereoMatcher], pair: Pair) -> AsSet:
    """Return the settings of a method as its controls are set, without drawing them; the visitor may have moved one."""
    memory, name, place = visitor_memory(), kind.short_name, _Place.of(kind, pair)
    follows_from = place.first, pair.id, pair.left.shape, pair.num_disparities
    before, *found = memory.untouched.get(name, (None,))
    if before == follows_from:
        return AsSet(place, *found)
    values = place.values()
    if not place.refusals:
        try:
            memory.matchers[name] = _made(kind, tuple(values.items()))
        except SettingsError as error:
            place.refusals.append(error)
    found = [values, memory.matchers.get(name), next(iter(place.refusals), None)]
    if name not in memory.opened:
        memory.untouched[name] = follows_from, *found
    return AsSet(place, *found)


def matcher_moved(pair: Pair, slider: str, value: Any) -> StereoMatcher | None:
    """Return the settings of a method where one of its sliders has been moved; None if that is no slider of any.

    Parameters
    ----------
    pair
        The pair the matcher will work on.
    slider
        The class of the slider, as :func:`stereolag.ui.controls.class_of` returns it.
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
            return cast(StereoMatcher, _made(kind, tuple(place.values().items())))
    return None


def ask_matcher(as_set: AsSet) -> StereoMatcher | None:
    """Draw the controls of a method, and return its settings; the last valid ones if they are refused."""
    place, top = as_set.place, st.container()
    memory, name = visitor_memory(), place.method.short_name
    memory.opened.add(name)
    memory.untouched.pop(name, None)
    folds = _fields(place.kind).keys() > set(_first_shown(place.kind))
    more = _more_settings(more_key(name)) if folds else None
    with top:
        _draw(place, SimpleNamespace(**as_set.values), more)
    if as_set.refusal is not None:
        show_refused(as_set.refusal)
    return as_set.matcher


def _more_settings(key: str) -> Expander:
    """Return the expander for rarely used settings; it is open or closed as when its tab was left.

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
    """Return the settings of all methods whose controls were drawn or set before."""
    matchers = visitor_memory().matchers
    return [matchers[kind.short_name] for kind in METHODS if kind.short_name in matchers]


def _draw(place: _Place, values: Any, more: Expander | None, *, disabled: bool = False) -> None:
    """Draw the controls of the settings of a place: those shown first here, the others in `more` while it is open."""
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
    key, first = place.key(name), getattr(place.first, name)
    title, meaning = field.title or name, field.description
    disabled = disabled or not place.applies(name, values)
    if not kinds:
        low, high = place.ends(name)
        beside = place.method.other_name(name) if place.kind is place.method else ""
        named = CHOICE_NAMES if choices(field) else None
        control(
            place.kind, name, key=key, value=first, low=low, high=high, names=named, beside=beside, disabled=disabled
        )
        return
    if len(kinds) > 1:
        st.segmented_control(
            title,
            [*kinds],
            default=str(getattr(first, KIND)),
            format_func=lambda one: str(getattr(kinds[one], "title", one)),
            required=True,
            **persistent(f"{key}.{KIND}"),
            help=meaning,
        )
    elif field.default is None:
        st.toggle(title, first is not None, help=meaning, **persistent(key), disabled=disabled)
    within = place.within(name)
    if within is not None:
        found = getattr(values, name)
        _draw(within, found if isinstance(found, within.kind) else within.first, more, disabled=disabled)


def _alternative(kind: type[Settings], pair: Pair) -> Settings:
    """Return the initial settings of a kind other than the method's default."""
    reaching = getattr(kind, "reaching", None)
    return kind() if reaching is None else cast(Settings, reaching(pair.num_disparities or DISPARITIES_AT_FIRST))


def _set(place: _Place, settings: Settings) -> None:
    """Set the controls of a place."""
    for name, field in _fields(place.kind).items():
        key, value, kinds = place.key(name), getattr(settings, name), _kinds(place.kind, name)
        if not kinds:
            adopt_value(key, value)
            continue
        if len(kinds) > 1:
            st.session_state[f"{key}.{KIND}"] = getattr(value, KIND)
        elif field.default is None:
            st.session_state[key] = value is not None
        within = place.within(name)
        if within is not None:
            _set(within, value)
