"""The controls of any stereo method, built from its settings class, and functions that set them."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, NamedTuple, cast

import streamlit as st
from pydantic.fields import FieldInfo

from stereolag.core.settings import Applies, FitsImage, OfThePair, Settings, SettingsError, Usual, marker
from stereolag.core.settings.fields import Number, choices, nested
from stereolag.pair import Pair
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS
from stereolag.streamlit_inside import Expander
from stereolag.ui.controls import adopt_value, control, kept_value
from stereolag.ui.first_settings import DISPARITIES_AT_FIRST, first_settings
from stereolag.ui.keys import more_key, setting_key
from stereolag.ui.persistence import persistent
from stereolag.ui.sentences import CHOICE_NAMES
from stereolag.ui.states import show_refused

LARGEST_WINDOW = 101

KIND = "kind"
"""The discriminator field of settings that come in several kinds."""

Values = dict[str, Any]


class AsSet(NamedTuple):
    """The settings of a method as its controls are set.

    Attributes
    ----------
    matcher
        The settings; the last valid ones if these are refused, None if there are none.
    refusal
        Why they are refused.
    values
        The values of the controls.
    """

    matcher: StereoMatcher | None
    refusal: SettingsError | None
    values: Values


class _Field(NamedTuple):
    """A field of a settings class, with everything its control needs; looked up once."""

    info: FieldInfo
    kinds: tuple[type[Settings], ...]
    conditional: bool
    of_the_pair: bool
    fits_image: bool
    usual: Usual


@functools.cache
def _fields(kind: type[Settings]) -> Mapping[str, _Field]:
    return {
        name: _Field(
            info,
            cast(tuple[type[Settings], ...], nested(info)),
            marker(info, Applies) is not None,
            marker(info, OfThePair) is not None,
            marker(info, FitsImage) is not None,
            marker(info, Usual) or Usual(),
        )
        for name, info in kind.model_fields.items()
        if name != KIND
    }


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
    refused
        Called with the error if nested settings conflict.
    """

    kind: type[Settings]
    first: Settings
    method: type[StereoMatcher]
    path: str
    pair: Pair
    refused: Callable[[SettingsError], None]

    def key(self, name: str) -> str:
        of_the_pair = _fields(self.kind)[name].of_the_pair
        return setting_key(self.method.short_name, self.path + name, self.pair.id.searched if of_the_pair else None)

    def within(self, name: str) -> _Place | None:
        """Return the place of nested settings, of the kind chosen; None for an optional stage that is off."""
        field, first = _fields(self.kind)[name], getattr(self.first, name)
        if len(field.kinds) > 1:
            by_name = {str(kind.model_fields[KIND].default): kind for kind in field.kinds}
            chosen: str = st.session_state.get(f"{self.key(name)}.{KIND}", getattr(first, KIND))
            kind = by_name[chosen]
            first = first if isinstance(first, kind) else _alternative(kind, self.pair)
            return replace(self, kind=kind, first=first, path=f"{self.path}{name}.{chosen}.")
        if field.info.default is None and not st.session_state.get(self.key(name), first is not None):
            return None
        kind = field.kinds[0]
        return replace(self, kind=kind, first=first or kind(), path=f"{self.path}{name}.")

    def applies(self, name: str, values: Any) -> bool:
        """Return whether a setting has an effect with these values of the others."""
        if not _fields(self.kind)[name].conditional:
            return True
        try:
            return self.kind.obstacle(name, values) is None
        except ValueError:  # the other settings conflict, which is reported elsewhere
            return True

    def ends(self, name: str) -> tuple[Number | None, Number | None]:
        """Return the bounds of a slider where the field allows more than the inputs can use."""
        field = _fields(self.kind)[name]
        if field.fits_image:
            return field.usual.low, min(LARGEST_WINDOW, *(int(side) - 1 for side in self.pair.left.shape[:2]))
        return field.usual.low, field.usual.high

    def values(self) -> Values:
        """Return the values of all controls, drawn or not; a setting that does not apply has its default."""
        values = SimpleNamespace(**dict(self.first))
        for name, field in _fields(self.kind).items():
            if field.kinds:
                place = self.within(name)
                found = place and place.settings()
            else:
                found = kept_value(self.kind, name, self.key(name), getattr(self.first, name), *self.ends(name))
            setattr(values, name, found if self.applies(name, values) else field.info.default)
        return {name: getattr(values, name) for name in _fields(self.kind)}

    def settings(self) -> Settings:
        """Return these settings; the initial ones if they are refused."""
        try:
            return self.kind(**self.values())
        except SettingsError as error:
            self.refused(error)
            return self.first


def matcher_as_set(kind: type[StereoMatcher], pair: Pair) -> AsSet:
    """Return the settings of a method as its controls are set, without drawing them; the visitor may have moved one."""
    refusals: list[SettingsError] = []
    values = _place(kind, pair, refusals.append).values()
    if not refusals:
        try:
            matcher = _in_use()[kind.short_name] = kind(**values)
            return AsSet(matcher, None, values)
        except SettingsError as error:
            refusals.append(error)
    return AsSet(_in_use().get(kind.short_name), refusals[0], values)


def ask_matcher(kind: type[StereoMatcher], pair: Pair, as_set: AsSet | None = None) -> StereoMatcher | None:
    """Draw the controls of a method, and return its settings; the last valid ones if they are refused.

    Parameters
    ----------
    kind
        The method.
    pair
        The pair it will work on.
    as_set
        The settings of :func:`matcher_as_set`, if already known in this run.
    """
    as_set = as_set or matcher_as_set(kind, pair)
    top = st.container()
    folds = _fields(kind).keys() > set(_first_shown(kind))
    more = _more_settings(more_key(kind.short_name)) if folds else None
    with top:
        _draw(_place(kind, pair), SimpleNamespace(**as_set.values), more)
    if as_set.refusal is not None:
        show_refused(as_set.refusal)
    return as_set.matcher


def _place(
    kind: type[StereoMatcher], pair: Pair, refused: Callable[[SettingsError], None] = lambda error: None
) -> _Place:
    return _Place(kind, first_settings(kind, pair), kind, "", pair, refused)


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
    _set(_place(type(matcher), pair), matcher)
    _in_use()[matcher.short_name] = matcher


def matchers_in_use() -> list[StereoMatcher]:
    """Return the settings of all methods whose controls were drawn or set before."""
    return [_in_use()[kind.short_name] for kind in METHODS if kind.short_name in _in_use()]


def _in_use() -> dict[str, StereoMatcher]:
    """Return the last valid settings of the methods."""
    matchers: dict[str, StereoMatcher] = st.session_state.setdefault("depth.matchers", {})
    return matchers


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
    field, key, first = _fields(place.kind)[name], place.key(name), getattr(place.first, name)
    title, meaning = field.info.title or name, field.info.description
    disabled = disabled or not place.applies(name, values)
    if not field.kinds:
        low, high = place.ends(name)
        beside = place.method.other_name(name) if place.kind is place.method else ""
        named = CHOICE_NAMES if choices(field.info) else None
        control(
            place.kind, name, key=key, value=first, low=low, high=high, names=named, beside=beside, disabled=disabled
        )
        return
    if len(field.kinds) > 1:
        by_name = {str(kind.model_fields[KIND].default): kind for kind in field.kinds}
        st.segmented_control(
            title,
            [*by_name],
            default=str(getattr(first, KIND)),
            format_func=lambda one: str(getattr(by_name[one], "title", one)),
            required=True,
            **persistent(f"{key}.{KIND}"),
            help=meaning,
        )
    elif field.info.default is None:
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
        key, value = place.key(name), getattr(settings, name)
        if not field.kinds:
            adopt_value(key, value)
            continue
        if len(field.kinds) > 1:
            st.session_state[f"{key}.{KIND}"] = getattr(value, KIND)
        elif field.info.default is None:
            st.session_state[key] = value is not None
        within = place.within(name)
        if within is not None:
            _set(within, value)
