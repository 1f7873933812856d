"""Controls built from the fields of a settings class, and settings built from controls.

Their values outlive the part of the page that draws them. A stereo method needs no code of its own here: its controls
follow from its settings class, and start from the settings that fit the pair.
"""

from __future__ import annotations

import functools
import math
import re
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from contextvars import ContextVar
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, TypeVar, cast

import streamlit as st
from pydantic.fields import FieldInfo

from stereolag.core.settings import (
    Applies,
    Bounds,
    FitsImage,
    Number,
    OfThePair,
    Settings,
    SettingsError,
    Usual,
    choices,
    marker,
    nested,
)
from stereolag.core.typography import typeset
from stereolag.pair import Pair
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS, PresetName, preset
from stereolag.ui.elements import refusals_shown, show_refused
from stereolag.ui.sentences import CHOICE_NAMES
from stereolag.ui.streamlit_inside import Expander

# Their keys


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


def class_of(key: str) -> str:
    """Return the class that Streamlit gives to the element with this key."""
    return "st-key-" + re.sub(r"[^\w-]", "-", key, flags=re.ASCII)


def exact_key(key: str) -> str:
    """Return the key of the box for an exact value beside a slider."""
    return f"{key}.exact"


# The runs that draw them

ANY_PAGE = "page"

Run = tuple[tuple[str, int], ...]
"""The page and the nested fragments of a run, each with its run number; an interrupted run has the same number as the
next one."""

_current: ContextVar[Run] = ContextVar("run", default=())


class _Box:
    """The box beside a slider: the value drawn in it last, and the times at which earlier ones were replaced."""

    def __init__(self) -> None:
        self.value: Any = None
        self.replaced: dict[Any, float] = {}


class _Memory:
    """What is known of the controls of one visitor.

    Attributes
    ----------
    page, page_before
        The page that ran last, and the one before this run.
    ended
        Number of completed runs of each fragment, and of any page.
    within
        The run in whose container a fragment was drawn.
    drawn
        The run that drew a control last, by its key.
    boxes, adopted
        The boxes beside sliders, and the values that controls were set to, by key.
    matchers
        The last valid settings of each method, by its short name.
    """

    def __init__(self) -> None:
        self.page = self.page_before = ""
        self.ended: Counter[str] = Counter()
        self.within: dict[str, Run] = {}
        self.drawn: dict[str, Run] = {}
        self.boxes: defaultdict[str, _Box] = defaultdict(_Box)
        self.adopted: dict[str, Any] = {}
        self.matchers: dict[str, StereoMatcher] = {}


_remembered: ContextVar[_Memory | None] = ContextVar("memory", default=None)


def _memory() -> _Memory:
    """Return what is known of this visitor's controls; in one entry, since Streamlit walks over all in every run.

    Within a counted run it is looked up once: every control asks for it several times.
    """
    memory: _Memory = _remembered.get() or st.session_state.setdefault("controls", _Memory())
    return memory


@contextmanager
def run_of_page(title: str) -> Iterator[None]:
    """Count a run of a page; the page is drawn inside the ``with`` block."""
    memory = _memory()
    memory.page_before = memory.page or title
    if memory.page_before != title:
        memory.ended[ANY_PAGE] += 1  # this run does not directly follow the last run of this page
    memory.page = title
    with _counted(ANY_PAGE, ()):
        yield


def from_another_page() -> bool:
    """Return whether the previous run was of another page."""
    return _memory().page_before != _memory().page


@contextmanager
def run_of_part(name: str) -> Iterator[None]:
    """Count a run of a fragment; the fragment is drawn inside the ``with`` block."""
    within = _memory().within
    within[name] = _current.get() or within.get(name, ())
    with _counted(name, within[name]):
        yield


@contextmanager
def _counted(name: str, outer: Run) -> Iterator[None]:
    memory = _memory()
    number = memory.ended[name]
    run, remembered = _current.set((*outer, (name, number))), _remembered.set(memory)
    try:
        yield
    finally:
        _current.reset(run)
        _remembered.reset(remembered)
    memory.ended[name] = number + 1


def persistent(key: str) -> dict[str, Any]:
    """Return the arguments for a control whose value outlives it: its key, and how long the value is kept."""
    if drawn_anew(key) and key in st.session_state:
        st.session_state[key] = st.session_state[key]
    return {"key": key, "persist_state": "session"}


def drawn_anew(key: str) -> bool:
    """Return whether a control about to be drawn was drawn before, but not in the previous run.

    Its value must then be assigned again, even unchanged. Streamlit does not send back a value that came from the
    browser; but a browser that sent it before it learned that the control was gone has forgotten it since, and would
    show the initial value.
    """
    run, drawn = _current.get(), _memory().drawn
    before = drawn.get(key, run)
    drawn[key] = run
    return len(run) != len(before) or any(
        name != old or number > last + 1 for (name, number), (old, last) in zip(run, before, strict=True)
    )


T = TypeVar("T")


def control(
    settings: type[Settings],
    name: str,
    *,
    key: str,
    value: Any = None,
    low: Number | None = None,
    high: Number | None = None,
    names: Mapping[str, str] | None = None,
    when_empty: str | None = None,
    beside: str = "",
    disabled: bool = False,
) -> Any:
    """Draw the control of one field and return its value.

    A number with both bounds gets a slider and a box for an exact value; a number with fewer bounds, or one that may be
    left empty, gets a number box. A choice is a row of buttons, a boolean a switch.

    Parameters
    ----------
    settings, name
        The settings class and its field, which provide the label, help, bounds and step.
    key
        Widget key; its value survives a visit to another page.
    value
        Initial value; the field's default unless given.
    low, high
        Narrower bounds, if the field allows more than these inputs can use.
    names
        Display names of the choices.
    when_empty
        Meaning of an empty number box.
    beside
        Another name of the field, shown beside its title.
    disabled
        Whether the control is inactive, because changing it would have no effect.
    """
    field = settings.model_fields[name]
    adopted = key in _memory().adopted
    at_first = _memory().adopted[key] if adopted else field.default if value is None else value
    title = field.title or name
    widget: dict[str, Any] = {
        "label": f"{title} `{beside}`" if beside else title,
        "help": typeset(field.description or ""),
        "disabled": disabled,
        **persistent(key),
    }
    if isinstance(at_first, bool):
        return st.toggle(value=at_first, **widget)
    options = choices(field)
    if options:
        named = (names or {}).get
        return st.segmented_control(
            options=options, default=at_first, format_func=lambda choice: named(choice, choice), required=True, **widget
        )
    bounds = Bounds.of(field).narrowed(low, high)
    if when_empty is not None or at_first is None or bounds.low is None or bounds.high is None:
        widget |= {"min_value": bounds.low, "max_value": bounds.high, "step": bounds.step, "value": at_first}
        number_format = "%g" if isinstance(bounds.step, float) else "%d"
        return st.number_input(format=number_format, placeholder=when_empty, **widget)
    if adopted:
        bounds = Bounds(min(bounds.low, at_first), max(bounds.high, at_first), bounds.step)
    at_first = bounds.nearest(at_first)
    bounds = bounds.through(at_first)
    if bounds.high == bounds.low:
        # A slider needs two distinct ends. A separate key leaves the value set for other inputs untouched.
        bounds = Bounds(at_first, at_first + bounds.step, bounds.step)
        widget |= {"key": f"{key}.only", "disabled": True}
    widget |= {"min_value": bounds.low, "max_value": bounds.high, "step": bounds.step, "value": at_first}
    return _slider_and_box(widget, Bounds.of(field))


def kept_value(
    settings: type[Settings], name: str, key: str, value: Any, low: Number | None = None, high: Number | None = None
) -> Any:
    """Return the value that :func:`control` would return with the same arguments, without drawing it."""
    adopted = _memory().adopted
    if key in adopted:
        return st.session_state.get(key, adopted[key])
    field = settings.model_fields[name]
    kept = st.session_state.get(key, field.default if value is None else value)
    if isinstance(kept, bool) or not isinstance(kept, int | float):
        return kept
    return Bounds.of(field).narrowed(low, high).nearest(kept)


EXACT_WIDTH = 76
"""Width of the box beside a slider, px; too narrow for step buttons."""


def _slider_and_box(widget: dict[str, Any], allowed: Bounds) -> Any:
    """Draw a slider and a box that shows its value and accepts any other value the field allows."""
    key, exact = widget["key"], exact_key(widget["key"])
    with st.container(horizontal=True, gap="small", vertical_alignment="bottom"):
        value = st.slider(**widget)
        if drawn_anew(exact) or st.session_state.get(exact) != value:  # assigning it makes the browser redraw it
            st.session_state[exact] = value
        box = _memory().boxes[key]
        if box.value != value:
            box.replaced[box.value] = time.monotonic()
            box.value = value
        st.number_input(
            widget["label"],
            min_value=allowed.low,
            max_value=allowed.high,
            step=0.01 if isinstance(value, float) else 1,
            format="%g" if isinstance(value, float) else "%d",
            key=exact,
            disabled=widget["disabled"],
            label_visibility="collapsed",
            width=EXACT_WIDTH,
            on_change=_take_exact,
            args=(key,),
        )
    return value


LATE_S = 2.0
"""How long after a box was set to a new value the browser may still send the previous one, s."""


def _take_exact(key: str) -> None:
    """Set a slider to the value typed beside it, which may be outside its range or between its steps.

    If the slider has just moved, the box value was not typed: the browser has not drawn the new value yet.
    """
    typed, box = st.session_state[exact_key(key)], _memory().boxes[key]
    moved = st.session_state[key] != box.value
    late = time.monotonic() - box.replaced.get(typed, -math.inf) < LATE_S
    if not moved and not late:
        adopt_value(key, typed)


def adopt_value(key: str, value: Any) -> None:
    """Set a control not yet drawn in this run; its bounds widen if needed to include the value."""
    st.session_state[key] = _memory().adopted[key] = value


def last_valid(make: Callable[[], T], key: str) -> T | None:
    """Return the result of `make`; if it refuses the settings, show why and return the last valid ones."""
    with refusals_shown():
        st.session_state[key] = make()
    settings: T | None = st.session_state.get(key)
    return settings


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

KIND = "kind"
"""The discriminator field of settings that come in several kinds."""


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
        usual = marker(field, Usual) or Usual()
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
    place, matchers = _Place.of(kind, pair), _memory().matchers
    values = place.values()
    if not place.refusals:
        try:
            matchers[kind.short_name] = _made(kind, tuple(values.items()))
        except SettingsError as error:
            place.refusals.append(error)
    return AsSet(place, values, matchers.get(kind.short_name), next(iter(place.refusals), None))


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
    folds = _fields(place.kind).keys() > set(_first_shown(place.kind))
    more = _more_settings(more_key(place.method.short_name)) if folds else None
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
    _memory().matchers[matcher.short_name] = matcher


def matchers_in_use() -> list[StereoMatcher]:
    """Return the settings of all methods whose controls were drawn or set before."""
    return [_memory().matchers[kind.short_name] for kind in METHODS if kind.short_name in _memory().matchers]


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
