"""Every setting of every method and search is a flag, which changes it and nothing else."""

from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import pytest
from commanded import Command

from stereolag import CorrelationMatcher, SearchArea, SemiGlobalMatcher
from stereolag.commands.arguments import CommandParser, SettingsFlags
from stereolag.core.searches import LagSearch, TemplateQuery
from stereolag.core.settings import Bounds, Settings, SettingsError, base_type, changed, choices, nested, setting
from stereolag.stereo.finishing.stages import AmbiguityTest, LeftRightCheck, MedianFilter, SpeckleFilter, TextureTest
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS, preset

STAGES = {"texture": TextureTest(), "speckle": SpeckleFilter(), "median": MedianFilter(), "ambiguity": AmbiguityTest()}
STARTS: list[StereoMatcher] = [
    CorrelationMatcher(**STAGES, left_right=LeftRightCheck()),
    CorrelationMatcher(search=SearchArea.centred(64, vertical=2)),
    SemiGlobalMatcher(**STAGES, left_right=LeftRightCheck()),
    *(kind(speckle_window_size=50) for kind in METHODS if "speckle_window_size" in kind.model_fields),
    *(kind() for kind in METHODS if kind not in (CorrelationMatcher, SemiGlobalMatcher)),
]
"""Matchers such that every setting of every method has an effect in one of them."""


def leaves(settings: Settings, path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the full name and the field of every setting."""
    for name, field in type(settings).model_fields.items():
        value = getattr(settings, name)
        if isinstance(value, Settings):
            yield from leaves(value, f"{path}{name}.")
        elif not nested(field) and name != "kind":
            yield f"{path}{name}", field


def others(field: Any, value: Any) -> list[Any]:
    """Return some values that a field allows, other than the given one."""
    if options := choices(field):
        return [one for one in options if one != value]
    if base_type(field) is bool:
        return [not value]
    bounds = Bounds.of(field)
    near = [(value or 0) + sign * steps * bounds.step for steps in (1, 2) for sign in (1, -1)]
    return [
        round(one, 6)
        for one in near
        if (bounds.low is None or one >= bounds.low) and (bounds.high is None or one <= bounds.high)
    ]


def possible(settings: Settings, name: str, field: Any) -> list[tuple[Any, Settings]]:
    """Return other values of a setting and the settings with them; none if the others allow no other value."""
    cases = []
    for value in others(field, setting(settings, name)):
        with suppress(SettingsError):
            cases.append((value, changed(settings, {name: value})))
    return cases


def flag_of(name: str, value: Any) -> list[str]:
    flag = name.replace("_", "-")
    if isinstance(value, bool):
        return [f"--{flag}" if value else f"--no-{flag}"]
    return [f"--{flag}", str(value)]


def flagged(start: Settings, *arguments: str) -> Settings:
    return SettingsFlags(CommandParser("test"), start).parsed(arguments)[1]


@pytest.mark.parametrize("start", [*STARTS, LagSearch(), LagSearch(max_lag=5), TemplateQuery()], ids=str)
def test_a_flag_changes_its_setting_and_nothing_else(start: Settings) -> None:
    for name, field in leaves(start):
        for value, expected in possible(start, name, field):
            assert flagged(start, *flag_of(name, value)) == expected != start


def test_every_setting_of_every_method_can_be_changed_in_one_of_the_starts() -> None:
    every = [(type(start), name, possible(start, name, field)) for start in STARTS for name, field in leaves(start)]
    assert {(kind, name) for kind, name, cases in every if cases} == {(kind, name) for kind, name, _ in every}
    assert {kind for kind, *_ in every} == set(METHODS)


def test_a_stage_is_switched_on_by_its_flag_or_any_of_its_own_and_off_by_none() -> None:
    bare = SemiGlobalMatcher()
    assert flagged(bare, "--median") == changed(bare, {"median": {}})
    assert flagged(bare, "--median.radius", "4") == changed(bare, {"median": {"radius": 4}})
    assert flagged(bare, "--median", "--median.radius", "4") == changed(bare, {"median": {"radius": 4}})
    full = changed(bare, {"median": {"radius": 4, "contrast": 9}})
    assert flagged(full, "--median") == full
    assert flagged(full, "--median.radius", "8") == changed(bare, {"median": {"radius": 8, "contrast": 9}})
    assert flagged(full, "--median", "none") == bare


def test_the_kind_of_search_is_the_one_that_has_what_is_given() -> None:
    square = CorrelationMatcher(search=SearchArea.centred(64, vertical=2))
    strip = CorrelationMatcher(search=SearchArea.rectified(32, -8, 1))
    assert flagged(square, "--search.num-disparities", "48").search == SearchArea.rectified(48, 0, 2)
    assert flagged(strip, "--search.search-size", "50").search == SearchArea.centred(50, vertical=1)
    assert flagged(strip, "--search.vertical", "3").search == SearchArea.rectified(32, -8, 3)
    assert flagged(square, "--search.vertical", "none").search == SearchArea.centred(64)
    assert flagged(strip, "--search.kind", "centred", "--search.search-size", "80").search.lags(20).dx_last == 30


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("--median none --median.radius 4", "--median is switched off, but --median.radius is given"),
        ("--median strong", "--median is 'strong'; its settings have flags of their own, such as --median.radius."),
        ("--optimisation none", "--optimisation is None; allowed are settings of SemiGlobal."),
        ("--window-size 8", "--window-size is 8; allowed are odd sizes"),
        ("--window-size 1e400", "--window-size is '1e400'; allowed are whole numbers from 3 to 255."),
        ("--num-disparities 0", "--num-disparities is 0; allowed are whole numbers from 1 to 1024."),
        ("--cost.gradient 0 --cost.gradient-limit 9", "--cost.gradient-limit is 9 and needs gradient above 0."),
        ("--cost.census 300", "--cost.census is 300; allowed are whole numbers from 0 to 100."),
        ("--median.radius -1", "--median.radius is -1; allowed are multiples of 2 from 2 to 30."),
        ("--window-sise 9", "Semi-global has no setting '--window-sise'; did you mean --window-size?"),
        ("--nonsense", "Semi-global has no setting '--nonsense'; it has --window-size, --num-disparities, "),
    ],
)
def test_a_flag_is_refused_in_words_of_settings(arguments: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        flagged(SemiGlobalMatcher(), *arguments.split())
    assert ended.value.code == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize(
    "choice",
    [["--preset", name] for name in ("fast", "accurate", "report")]
    + [["--method", kind.short_name] for kind in METHODS],
    ids=str,
)
def test_help_tells_every_setting_with_its_bounds_and_what_holds(choice: list[str], ran: Command) -> None:
    kinds = {kind.short_name: kind() for kind in METHODS}
    start = kinds[choice[1]] if choice[0] == "--method" else preset(choice[1])
    said = " ".join(ran("depth", *choice, "--help").out.split())
    for name, field in leaves(start):
        assert f"--{name.replace('_', '-')}" in said
        if base_type(field) is int and Bounds.of(field).high is not None and "multiple" not in str(field.metadata):
            bounds = Bounds.of(field)
            assert f"from {bounds.low} to {bounds.high}." in said or f"from {bounds.low} to {bounds.high} or" in said
    side = next(value for value in dict(start).values() if isinstance(value, int))
    assert f"(default: {side})" in said
    assert "exit codes: 0 done; 2 wrong usage" in said and "4 an input is refused" in said
