"""The searches of the benchmarks: the template is at its true places and no other, and an answer is judged by all."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from benchmarks import rocketman
from benchmarks.pairs import DATA
from benchmarks.searches import KINDS, Place, Trial, trial

Array = npt.NDArray[Any]

LOCAL = [kind for kind in KINDS if kind != "public pictures" or DATA.is_dir()]


def brought_back(given: Trial, place: Place) -> tuple[Array, Array]:
    """Return what the picture shows in a place, with the size and angle of the template; and which pixels it shows."""
    height, width = given.template.shape[:2]
    matrix = cv2.getRotationMatrix2D((width / 2 - 0.5, height / 2 - 0.5), place.rotation, place.scale)
    matrix[:, 2] += np.array([place.col + place.width / 2 - width / 2, place.row + place.height / 2 - height / 2])
    flags = cv2.INTER_AREA | cv2.WARP_INVERSE_MAP
    picture = given.picture.astype(np.float32)
    seen = cv2.warpAffine(picture, matrix, (width, height), flags=flags)
    inside = cv2.warpAffine(np.ones(picture.shape[:2], np.float32), matrix, (width, height), flags=flags)
    return seen, inside > 0.99


def agreement(given: Trial, place: Place) -> float:
    """Return Pearson's coefficient of the template and what is in a place."""
    seen, inside = brought_back(given, place)
    template = given.template.astype(np.float64)
    weight = inside.astype(np.float64)
    if template.ndim == 3 and template.shape[2] == 4:
        alpha, template = template[:, :, 3], template[:, :, :3]
        has_contrast = template[alpha > 0].std(axis=0).max() > 10
        if has_contrast:
            weight *= alpha
        else:
            template = np.dstack([alpha] * 3)
    if given.mask is not None:
        weight *= given.mask
    seen, template = seen.reshape(weight.size, -1)[:, :3], template.reshape(weight.size, -1)
    if seen.shape[1] != template.shape[1]:
        seen, template = seen.mean(axis=1, keepdims=True), template.mean(axis=1, keepdims=True)
    weights = weight.reshape(-1, 1) / weight.sum()
    seen, template = (one - (weights * one).sum(axis=0) for one in (seen, template))
    product, *squares = ((weights * one).sum() for one in (seen * template, seen**2, template**2))
    return float(abs(product) / np.sqrt(np.prod(squares)))


def exact_places(given: Trial) -> list[tuple[int, int]]:
    """Return the (row, col) of every place whose pixels are the template's."""
    away = cv2.matchTemplate(given.picture, given.template, cv2.TM_SQDIFF)
    near = ((int(row), int(col)) for row, col in np.argwhere(away < given.template.size))
    height, width = given.template.shape[:2]
    return [
        (row, col)
        for row, col in near
        if np.array_equal(given.picture[row : row + height, col : col + width], given.template)
    ]


@pytest.mark.parametrize("kind", LOCAL)
def test_the_template_is_where_the_truth_says(kind: str) -> None:
    given = trial(kind, 1)
    for place in given.places[:5]:
        here = agreement(given, place)
        aside = [
            agreement(given, replace(place, row=place.row + down, col=place.col + right))
            for down, right in ((-6, 0), (6, 0), (0, -6), (0, 6))
        ]
        assert here > max(0.1, *aside), kind
    if not given.places and given.template.shape[-1] == given.picture.shape[-1] == 3:
        assert exact_places(given) == []


@pytest.mark.parametrize("kind", ["copies", "rows of a list", "small templates"])
def test_there_are_as_many_copies_as_the_truth_says(kind: str) -> None:
    for given in (trial(kind, seed) for seed in range(2)):
        assert exact_places(given) == sorted((place.row, place.col) for place in given.places)


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
def test_an_answer_is_right_if_it_names_every_place_once_and_no_other(
    named: list[tuple[int, int]], reason: str, expected: str
) -> None:
    places = tuple(Place(*corner, 20, 30) for corner in ((10, 20), (50, 60)))
    given = Trial(np.zeros((120, 200)), np.zeros((20, 30)), places)
    answer = rocketman.Answer(tuple(Place(*corner, 20, 30) for corner in named), reason, 0.0)
    assert rocketman.outcome(given, answer, posed=True) == expected


def test_a_pale_form_alone_is_found_only_with_a_reason() -> None:
    place = Place(10, 20, 20, 30)
    given = Trial(np.zeros((120, 200)), np.zeros((20, 30)), (), pale=(place,))
    outcomes = {
        reason: rocketman.outcome(given, rocketman.Answer((place,), reason, 0.0), posed=True)
        for reason in ("clear", "paler")
    }
    assert outcomes == {"clear": "absent found", "paler": "right"}
    elsewhere = rocketman.Answer((replace(place, row=60),), "paler", 0.0)
    assert rocketman.outcome(given, elsewhere, posed=True) == "absent found"


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
