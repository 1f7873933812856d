"""The searches of the benchmarks: an answer is judged by all true places; found at all of them, and nowhere else."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks import rocketman
from benchmarks.rocketman import our_answer, outcome
from benchmarks.searches import KINDS, Place, Trial, cut, screen_piece, trial


@pytest.mark.parametrize(
    ("named", "reason", "expected"),
    [
        ([(10, 20), (50, 60)], "clear", "right"),
        ([(50, 61), (11, 20)], "clear", "right"),
        ([(10, 20)], "clear", "missed"),
        ([], "look_alikes", "missed"),
        ([(10, 20), (50, 60), (90, 20)], "clear", "wrong"),
        ([(10, 20), (10, 21)], "clear", "wrong"),
        ([(10, 24), (50, 60)], "clear", "wrong"),
    ],
)
def test_an_answer_is_right_if_it_names_every_place_once_and_no_other(named, reason, expected):
    places = tuple(Place(*corner, 20, 30) for corner in ((10, 20), (50, 60)))
    given = Trial(np.zeros((120, 200)), np.zeros((20, 30)), places)
    answer = rocketman.Answer(tuple(Place(*corner, 20, 30) for corner in named), reason, 0.0)
    assert outcome(given, answer, posed=True) == expected


def test_a_pale_form_alone_is_found_only_with_a_reason() -> None:
    place = Place(10, 20, 20, 30)
    given = Trial(np.zeros((120, 200)), np.zeros((20, 30)), (), pale=(place,))
    for named, reason, expected in (
        (place, "clear", "absent found"),
        (place, "paler", "right"),
        (replace(place, row=60), "paler", "absent found"),
    ):
        assert outcome(given, rocketman.Answer((named,), reason, 0.0), posed=True) == expected


def test_what_is_cut_off_is_near_by_its_visible_part_and_a_pose_by_size_and_angle() -> None:
    beyond = Place(-20, 5, 40, 60)
    assert beyond.is_near(Place(0, 5, 20, 60), (100, 100)) and not beyond.is_near(Place(0, 5, 40, 60), (100, 100))
    turned = replace(beyond, scale=1.2, rotation=178.0)
    assert turned.has_pose(replace(turned, scale=1.24, rotation=-178.0))
    assert not turned.has_pose(replace(turned, scale=1.3)) and not turned.has_pose(replace(turned, rotation=170.0))


def test_the_table_counts_both_searches_and_lists_each_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    blind = SimpleNamespace(found=False, matches=[], clear=0, reason="low_score", best=None, rivals=[])
    monkeypatch.setattr(rocketman, "match_template", lambda *_, **__: blind)
    table, figures = rocketman.rocketman_table(
        ["the right one of siblings", "lamps of another colour"], trials=2, seed=9200
    )
    assert "| the right one of siblings | 2 | 0 of 2 | **0 of 2** |  | 2 of 2 |" in table
    assert "| absent, found | 0.0 % | 50.0 % | ≤ 1 % |" in table
    assert table.count("\n- the right one of siblings, seed") == 2 and "\n- lamps" not in table
    assert [one["ours"] for one in figures] == ["missed", "missed", "right", "right"]


# Searches of every kind that users bring.

QUICKER = {
    "photographs turned and resized": 1,
    "other photographs": 2,
    "siblings at other sizes": 3,
    "rows of a list": 3,
}
QUICKER |= {"no rocketman": 4, "other states": 1, "copies": 1, "focus rings": 1}
SEARCHES = [*((kind, QUICKER.get(kind, 0)) for kind in KINDS), ("scroll bars", 1), ("other messages", 1)]
"""One of each kind, by a seed whose pictures are small, a whole scroll bar, and a message that the border cuts off."""

MISSED = "covered by 30 to 40 percent"
"""A search whose template is there and said not to be; the tables of the benchmarks tell how often that is so."""


@pytest.mark.usefixtures("data_dir")  # without public pictures other photographs are drawn
@pytest.mark.parametrize(("kind", "seed"), SEARCHES)
def test_a_template_is_found_wherever_it_is_and_nowhere_else(kind: str, seed: int) -> None:
    given = trial(kind, seed)
    answer = our_answer(given)
    assert outcome(given, answer, posed=True) == ("missed" if kind == MISSED else "right"), answer


@pytest.mark.usefixtures("data_dir")
@pytest.mark.parametrize("seed", [16, 34, 48])
def test_a_strong_gamma_leaves_a_piece_of_a_screen_the_template(seed: int) -> None:
    random = np.random.default_rng([seed, 9])
    picture, there = screen_piece(random)
    gamma = np.exp(random.choice([-1, 1]) * random.uniform(0.6, 0.85))
    given = Trial(np.rint(255 * (picture / 255) ** gamma).astype(np.uint8), cut(picture, there), (there,))
    assert outcome(given, our_answer(given), posed=True) == "right"
