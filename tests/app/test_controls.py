from __future__ import annotations

from typing import Any, get_args

import pytest
from pydantic import Field

from stereolag.core.searches import LagSearch, TemplateQuery
from stereolag.core.settings import Bounds, Settings, SettingsError
from stereolag.stereo.methods import METHODS
from stereolag.stereo.opencv import StereoBM
from stereolag.stereo.windows.search import CentredSearch, RectifiedSearch
from stereolag.ui.sentences import (
    CURVES,
    LAG_METHODS,
    LAG_METHODS_EXPLAINED,
    TEMPLATE_METHODS,
    TEMPLATE_METHODS_EXPLAINED,
)

CLASSES = (*METHODS, CentredSearch, RectifiedSearch, LagSearch, TemplateQuery)


def numeric_fields() -> list[tuple[type[Settings], str]]:
    return [
        (settings, name)
        for settings in CLASSES
        for name, field in settings.model_fields.items()
        if isinstance(field.default, int | float)
    ]


@pytest.mark.parametrize(("settings", "name"), numeric_fields())
def test_what_a_slider_can_be_set_to_is_what_the_field_allows(settings: type[Settings], name: str) -> None:
    field = settings.model_fields[name]
    bounds = Bounds.of(field).through(field.default)
    for value in (bounds.low, bounds.high, field.default + bounds.step):
        if value is not None and value <= (bounds.high or value):
            one_field = {name: value}
            try:
                settings(**one_field)
            except SettingsError as error:  # fields that constrain each other may refuse; the field itself must not
                assert not any("allowed" in problem.sentence and problem.name for problem in error.problems), error


class Example(Settings):
    odd: int = Field(7, ge=2, le=12, json_schema_extra={"step": 2})
    sixteens: int = Field(64, ge=1, le=100, multiple_of=16)
    share: float = Field(0.95, ge=0, lt=1, json_schema_extra={"step": 0.05})
    open_end: float = Field(1.0, gt=0)
    perhaps: int | None = Field(None, ge=0)


def bounds_of(name: str) -> Bounds:
    return Bounds.of(Example.model_fields[name])


def test_sliders_move_in_whole_steps_through_the_default_within_bounds_that_are_never_widened() -> None:
    assert bounds_of("odd").through(7) == Bounds(3, 11, 2)
    assert bounds_of("sixteens").through(64) == Bounds(16, 96, 16)
    assert bounds_of("share").through(0.95) == Bounds(0.0, 0.95, 0.05)
    assert bounds_of("open_end") == Bounds(1.0, None, 1.0)
    assert bounds_of("perhaps") == Bounds(0, None, 1)
    assert bounds_of("odd").narrowed(5, 20) == Bounds(5, 12, 2)
    assert bounds_of("open_end").narrowed(None, 9.0) == Bounds(1.0, 9.0, 1.0)


@pytest.mark.parametrize(
    ("kind", "bad", "said"),
    [
        (Example, {"odd": 13}, "odd is 13; allowed are whole numbers from 2 to 12."),
        (Example, {"sixteens": 15}, "sixteens is 15; allowed are multiples of 16 from 1 to 100."),
        (Example, {"share": "much"}, "share is 'much'; allowed are numbers from 0 below 1."),
        (StereoBM, {"block_size": 20}, "block_size is 20; OpenCV allows odd sizes only."),
    ],
)
def test_a_refusal_is_one_sentence(kind: type[Settings], bad: dict[str, Any], said: str) -> None:
    with pytest.raises(SettingsError) as refusal:
        kind(**bad)
    assert str(refusal.value) == said


def test_every_method_has_a_name_and_an_explanation() -> None:
    lag_methods = set(get_args(LagSearch.model_fields["method"].annotation))
    assert lag_methods == LAG_METHODS.keys() == LAG_METHODS_EXPLAINED.keys() == CURVES.keys()
    template_methods = set(get_args(TemplateQuery.model_fields["method"].annotation))
    assert template_methods == TEMPLATE_METHODS.keys() == TEMPLATE_METHODS_EXPLAINED.keys()


@pytest.mark.parametrize(
    ("low", "high", "value", "nearest"),
    [(5, 99, 21, 21), (5, 6, 21, 5), (5, 3, 21, 5), (3, 8, 20, 8), (16, 40, 64, 32), (5, 99, 1, 5)],
)
def test_a_value_moves_by_whole_steps_into_narrower_bounds(low: int, high: int, value: int, nearest: int) -> None:
    steps = {21: 2, 20: 1, 64: 16, 1: 2}
    assert Bounds(low, high, steps[value]).nearest(value) == nearest
