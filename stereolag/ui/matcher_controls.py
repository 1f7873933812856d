"""The controls of any stereo method, built from its settings class, and functions that set them."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, TypeVar, cast

import streamlit as st
from streamlit.elements.lib.mutable_expander_container import ExpanderContainer

from stereolag.core.settings import FitsImage, OfThePair, Settings, SettingsError, Usual, marker
from stereolag.core.settings.fields import Number, choices, nested
from stereolag.pair import Pair
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS
from stereolag.ui.controls import adopt_value, control, last_valid
from stereolag.ui.first_settings import DISPARITIES_AT_FIRST, first_settings
from stereolag.ui.keys import method_key, more_key, setting_key
from stereolag.ui.persistence import persistent
from stereolag.ui.sentences import CHOICE_NAMES

LARGEST_WINDOW = 101

KIND = "kind"
"""The discriminator field of settings that come in several kinds."""

Matcher = TypeVar("Matcher", bound=StereoMatcher)
Values = dict[str, Any]


@dataclass(frozen=True)
class _Place:
    """The context in which the controls of one settings class are drawn.

    Attributes
    ----------
    kind, first
        The settings class, and the initial values of its controls.
    method, path
        The method, and the names leading to these settings, each followed by a dot.
    pair
        The pair the matcher will work on.
    more, more_drawn
        Container for the settings that are folded away, and whether they are drawn in it.
    drawn, disabled
        Whether the other settings are drawn, and whether all of them are disabled.
    refused
        Called with the error if nested settings conflict.
    """

    kind: type[Settings]
    first: Settings
    method: type[StereoMatcher]
    path: str
    pair: Pair
    more: AbstractContextManager[Any]
    more_drawn: bool
    drawn: bool
    disabled: bool
    refused: Callable[[SettingsError], None]

    def key(self, name: str) -> str:
        return _key(self.method, self.kind, self.path, name, self.pair)

    def folded(self) -> _Place:
        """Return this place for settings that are folded away."""
        return replace(self, more=nullcontext(), drawn=self.more_drawn)


def ask_matcher(kind: type[Matcher], pair: Pair, *, drawn: bool = True) -> Matcher | None:
    """Return the settings of a method as the visitor set them; the last valid ones if they are refused.

    Parameters
    ----------
    kind
        The method.
    pair
        The pair it will work on.
    drawn
        False if its controls are folded away: they are not drawn, to save time, and keep their values.
    """
    return last_valid(_asked(kind, pair, drawn=drawn), _in_use_key(kind))


def matcher_as_set(kind: type[Matcher], pair: Pair) -> Matcher | None:
    """Return the settings that :func:`ask_matcher` is about to return, for work done before the controls are drawn."""
    try:
        return _asked(kind, pair, drawn=False)()
    except SettingsError:
        return cast(Matcher | None, st.session_state.get(_in_use_key(kind)))


def _asked(kind: type[Matcher], pair: Pair, *, drawn: bool) -> Callable[[], Matcher]:
    """Draw the controls of a method if `drawn`, and return a function that makes its settings from them."""
    refusals: list[SettingsError] = []
    top = st.container() if drawn else nullcontext()
    folds = drawn and set(kind.model_fields) > set(_first_shown(kind))
    expander = _more_settings(more_key(kind.short_name)) if folds else None
    place = _Place(
        kind,
        first_settings(kind, pair),
        kind,
        "",
        pair,
        expander or nullcontext(),
        bool(expander and expander.open),
        drawn,
        False,
        refusals.append,
    )
    values = _ask_all(place, top)

    def make() -> Matcher:
        for refusal in refusals:
            raise refusal
        return kind(**values)

    return make


def _more_settings(key: str) -> ExpanderContainer:
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
    _set(matcher, type(matcher), "", pair)
    st.session_state[_in_use_key(type(matcher))] = matcher


def matchers_in_use() -> list[StereoMatcher]:
    """Return the settings of all methods whose controls were drawn or set before."""
    kept = (st.session_state.get(_in_use_key(kind)) for kind in METHODS)
    return [matcher for matcher in kept if isinstance(matcher, StereoMatcher)]


def _in_use_key(kind: type[StereoMatcher]) -> str:
    return f"{method_key(kind.short_name)}.valid"


def _first_shown(kind: type[Settings]) -> tuple[str, ...]:
    shown: tuple[str, ...] = getattr(kind, "first_shown", ())
    return shown or tuple(kind.model_fields)


def _ask_all(place: _Place, top: AbstractContextManager[Any]) -> Values:
    """Draw the controls of all settings of a place, those shown first in `top`; return their values."""
    values: Values = {}
    shown = _first_shown(place.kind)
    folded = [name for name in place.kind.model_fields if name not in shown and name != KIND]
    with top:
        for name in shown:
            if name != KIND:
                _ask(place, name, values)
    with place.more:
        for name in folded:
            _ask(place.folded(), name, values)
    return values


def _ask(place: _Place, name: str, values: Values) -> None:
    """Draw the control of one setting, and store its value in `values`.

    An optional stage is a switch with the controls of the stage below it; a choice of kinds is a row of buttons with
    the controls of the chosen kind. A setting that does not apply is disabled and takes its default.
    """
    field = place.kind.model_fields[name]
    kinds = cast(tuple[type[Settings], ...], nested(field))
    others = SimpleNamespace(**{**dict(place.first), **values})
    try:
        applies = place.kind.obstacle(name, others) is None
    except ValueError:  # the other settings conflict, which is reported elsewhere
        applies = True
    disabled = place.disabled or not applies
    value = getattr(place.first, name)
    if not kinds:
        found: Any = control(
            place.kind,
            name,
            key=place.key(name),
            value=value,
            beside=place.method.other_name(name) if place.kind is place.method else "",
            names=CHOICE_NAMES if choices(field) else None,
            disabled=disabled,
            drawn=place.drawn,
            **_ends(place, name),
        )
    elif len(kinds) > 1:
        found = _ask_kind(place, name, value, kinds)
    elif field.default is not None:
        found = _ask_within(place, name, value, kinds[0], disabled=disabled)
    elif _switched_on(place, name, disabled=disabled):
        found = _ask_within(place, name, value or kinds[0](), kinds[0], disabled=disabled)
    else:
        found = None
    values[name] = found if applies else field.default


def _switched_on(place: _Place, name: str, *, disabled: bool) -> bool:
    """Draw the switch of an optional stage, and return whether it is on."""
    field, key = place.kind.model_fields[name], place.key(name)
    at_first = getattr(place.first, name) is not None
    if not place.drawn:
        return bool(st.session_state.get(key, at_first))
    return st.toggle(field.title or name, at_first, help=field.description, **persistent(key), disabled=disabled)


def _ask_kind(place: _Place, name: str, value: Settings, kinds: tuple[type[Settings], ...]) -> Settings:
    """Ask for the kind of settings, and draw the controls of that kind."""
    by_name = {str(kind.model_fields[KIND].default): kind for kind in kinds}
    usual = str(getattr(value, KIND))
    key = f"{place.key(name)}.{KIND}"
    chosen: str = st.session_state.get(key, usual)
    if place.drawn:
        field = place.kind.model_fields[name]
        chosen = st.segmented_control(
            field.title or name,
            [*by_name],
            default=usual,
            format_func=lambda one: str(getattr(by_name[one], "title", one)),
            required=True,
            **persistent(key),
            help=field.description,
        )
    kind = by_name[chosen]
    at_first = value if isinstance(value, kind) else _alternative(kind, place.pair)
    return _ask_within(place, f"{name}.{chosen}", at_first, kind)


def _ask_within(place: _Place, name: str, first: Settings, kind: type[Settings], *, disabled: bool = False) -> Settings:
    """Draw the controls of nested settings, and return them; the initial ones if they are refused."""
    within = replace(place, kind=kind, first=first, path=f"{place.path}{name}.", disabled=disabled)
    values = _ask_all(within, nullcontext())
    try:
        return kind(**values)
    except SettingsError as error:
        place.refused(error)
        return first


def _alternative(kind: type[Settings], pair: Pair) -> Settings:
    """Return the initial settings of a kind other than the method's default."""
    reaching = getattr(kind, "reaching", None)
    return kind() if reaching is None else cast(Settings, reaching(pair.num_disparities or DISPARITIES_AT_FIRST))


def _ends(place: _Place, name: str) -> dict[str, Any]:
    """Return the bounds of a slider where the field allows more than the inputs can use."""
    field = place.kind.model_fields[name]
    usual = marker(field, Usual) or Usual()
    ends: dict[str, Number | None] = {"low": usual.low, "high": usual.high}
    if marker(field, FitsImage):
        ends["high"] = min(LARGEST_WINDOW, *(int(side) - 1 for side in place.pair.left.shape[:2]))
    return {end: value for end, value in ends.items() if value is not None}


def _key(method: type[StereoMatcher], kind: type[Settings], path: str, name: str, pair: Pair) -> str:
    of_the_pair = marker(kind.model_fields[name], OfThePair) is not None
    return setting_key(method.short_name, f"{path}{name}", pair.id.searched if of_the_pair else None)


def _set(settings: Settings, method: type[StereoMatcher], path: str, pair: Pair) -> None:
    kind = type(settings)
    for name, field in kind.model_fields.items():
        if name == KIND:
            continue
        value, key, kinds = getattr(settings, name), _key(method, kind, path, name, pair), nested(field)
        if not kinds:
            adopt_value(key, value)
        elif len(kinds) > 1:
            st.session_state[f"{key}.{KIND}"] = getattr(value, KIND)
            _set(value, method, f"{path}{name}.{getattr(value, KIND)}.", pair)
        else:
            if field.default is None:
                st.session_state[key] = value is not None
            if value is not None:
                _set(value, method, f"{path}{name}.", pair)
