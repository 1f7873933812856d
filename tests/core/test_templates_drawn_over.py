"""Things that a screen draws over a place: the template is there; a sibling in the same box is not."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from stereolag import match_template
from stereolag.templates.drawn_over import drawn_over
from stereolag.templates.patterns import compared

Array = npt.NDArray[np.uint8]
Thing = Callable[[Array, np.random.Generator], None]
Look = Callable[[Array], Array]
WORDS = ("Save", "Open", "Close", "Print", "Export", "Import", "Search", "Reset", "Undo", "Help", "Filter", "Apply")
SEEDS = range(2)


def screen(random: np.random.Generator, words: list[str], ground: int = 245) -> Array:
    """Return a screen of three columns of buttons of 96 × 30 px, 48 px apart, with these words."""
    picture = np.full((124, 360, 3), ground, np.uint8)
    fill, ink = (225, 230, 235) if ground > 127 else (60, 64, 70), (30, 30, 40) if ground > 127 else (230, 230, 235)
    for number, word in enumerate(words):
        left, top = 16 + 112 * (number % 3), 16 + 48 * (number // 3)
        cv2.rectangle(picture, (left, top), (left + 96, top + 30), fill, -1)
        cv2.rectangle(picture, (left, top), (left + 96, top + 30), (150, 155, 165), 1)
        cv2.putText(picture, word, (left + 14, top + 20), cv2.FONT_HERSHEY_SIMPLEX, 0.5, ink, 1, cv2.LINE_AA)
    return picture


def words_of(random: np.random.Generator) -> tuple[list[str], int, tuple[int, int]]:
    """Return words of a screen, the number of one of them, and the (row, col) of a box of 44 × 110 px around it."""
    words = [str(word) for word in random.permutation(WORDS)[:6]]
    number = int(random.integers(6))
    return words, number, (16 + 48 * (number // 3) - 7, 16 + 112 * (number % 3) - 7)


def text_cursor(part: Array, random: np.random.Generator) -> None:
    row, col = int(random.integers(4, 22)), int(random.integers(12, 90))
    part[row : row + 17, col : col + int(random.integers(1, 3))] = 0


def arrow(part: Array, random: np.random.Generator) -> None:
    at = np.array([(1, 1), (1, 17), (5, 13.5), (8, 20), (10.5, 19), (7.5, 12.5), (12.5, 12.5)])
    corners = np.rint(16 * (at + random.uniform([4, 4], [part.shape[1] - 20, 20]))).astype(np.int32)
    cv2.fillPoly(part, [corners], (255, 255, 255), cv2.LINE_AA, 4)
    cv2.polylines(part, [corners], True, (0, 0, 0), 1, cv2.LINE_AA, 4)


def focus_ring(part: Array, random: np.random.Generator) -> None:
    away = int(random.integers(1, 5))
    cv2.rectangle(part, (away, away), (109 - away, 43 - away), (140, 165, 215), 1)


def selection(part: Array, random: np.random.Generator) -> None:
    rows = part[: int(random.integers(15, 36))]
    rows[:] = np.rint(0.7 * rows + 0.3 * np.array([0, 90, 220]))


def shadow(part: Array, random: np.random.Generator) -> None:
    away: npt.NDArray[np.floating] = np.zeros(part.shape[:2], np.float32)
    away[9:41, 8:106] = random.uniform(0.3, 0.5)
    away = np.asarray(cv2.GaussianBlur(away, (0, 0), float(random.uniform(2, 4))), np.float32)
    away[7:38, 7:104] = 0
    part[:] = np.rint(part * (1 - away[:, :, np.newaxis]))


def scroll_bar(part: Array, random: np.random.Generator) -> None:
    part[:, -int(random.integers(9, 15)) :] = 190
    part[8:24, -6:] = 110


def badge(part: Array, random: np.random.Generator) -> None:
    cv2.circle(part, (102, 8), 7, (220, 30, 40), -1, cv2.LINE_AA)


THINGS = (text_cursor, arrow, focus_ring, selection, shadow, scroll_bar, badge)


@pytest.mark.parametrize("thing", THINGS)
@pytest.mark.parametrize("seed", SEEDS)
def test_a_button_is_found_under_what_a_screen_draws_over_it(thing: Thing, seed: int) -> None:
    random = np.random.default_rng(seed)
    words, _, (row, col) = words_of(random)
    picture = screen(random, words)
    template = picture[row : row + 44, col : col + 110].copy()
    thing(picture[row : row + 44, col : col + 110], random)
    search = match_template(picture, template)
    assert search.found and (search.matches[0].row, search.matches[0].col) == (row, col)


@pytest.mark.parametrize(("seed", "thing"), [*enumerate((None, *THINGS))])
def test_another_word_in_the_same_box_is_not_found_with_or_without_it(thing: Thing | None, seed: int) -> None:
    random = np.random.default_rng(seed)
    words, number, (row, col) = words_of(random)
    template = screen(random, words)[row : row + 44, col : col + 110].copy()
    words[number] = words[number - 1]
    picture = screen(random, words)
    if thing is not None:
        thing(picture[row : row + 44, col : col + 110], random)
    assert not match_template(picture, template).found


@pytest.mark.parametrize("side", [24, 32, 48])
def test_an_icon_with_a_stroke_more_is_its_sibling(side: int) -> None:
    minus = np.full((side, side, 3), 240, np.uint8)
    cv2.rectangle(minus, (2, 2), (side - 3, side - 3), (90, 90, 100), 1)
    minus[side // 2 - 1 : side // 2 + 1, side // 5 : -(side // 5)] = 40
    plus = minus.copy()
    plus[side // 5 : -(side // 5), side // 2 - 1 : side // 2 + 1] = 40
    picture = np.full((200, 200, 3), 240, np.uint8)
    picture[70 : 70 + side, 90 : 90 + side] = plus
    assert not match_template(picture, minus).found
    if side < 48:
        assert drawn_over(*compared(picture, minus, None), 70, 90) is None


@pytest.mark.parametrize("seed", SEEDS)
def test_a_button_in_another_colour_whose_letters_stay_white_is_another(seed: int) -> None:
    """On a dark ground, gains of the channels make any colour of any other: teal is blue in another light."""
    random = np.random.default_rng(seed)

    def button(fill: tuple[int, int, int]) -> Array:
        shown = np.full((44, 110, 3), 28, np.uint8)
        cv2.rectangle(shown, (7, 7), (103, 37), fill, -1)
        word = str(np.random.default_rng(seed).choice(WORDS))
        cv2.putText(shown, word, (20, 27), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (255, 255, 255), 1, cv2.LINE_AA)
        return shown

    teal, blue = (int(random.integers(0, 40)), 150, 140), (int(random.integers(0, 40)), 100, 210)
    picture = np.full((160, 240, 3), 28, np.uint8)
    picture[50:94, 60:170] = button(blue)
    assert match_template(picture, button(teal)).reason == "other_colours"
    lit = np.rint(picture * [0.75, 0.9, 1.0]).astype(np.uint8)
    assert match_template(lit, button(blue)).found


@pytest.mark.parametrize("seed", SEEDS)
def test_a_button_is_found_under_a_tint_of_all_of_it(seed: int) -> None:
    random = np.random.default_rng(seed)
    words, _, (row, col) = words_of(random)
    picture = screen(random, words)
    template = picture[row : row + 44, col : col + 110].copy()
    tinted = np.rint(0.65 * picture + 0.35 * random.uniform([0, 60, 150], [90, 150, 255])).astype(np.uint8)
    search = match_template(tinted, template)
    assert search.found and (search.matches[0].row, search.matches[0].col) == (row, col)


def switch(on: bool, left: int, top: int, drawn: Array) -> None:
    fill = (60, 150, 40) if on else (150, 150, 150)
    cv2.rectangle(drawn, (left + 10, top), (left + 28, top + 20), fill, -1)
    for middle in (left + 10, left + 28):
        cv2.circle(drawn, (middle, top + 10), 10, fill, -1, cv2.LINE_AA)
    cv2.circle(drawn, (left + (28 if on else 10), top + 10), 7, (255, 255, 255), -1, cv2.LINE_AA)


def check_box(on: bool, left: int, top: int, drawn: Array) -> None:
    cv2.rectangle(drawn, (left, top), (left + 17, top + 17), (50, 90, 200) if on else (200, 200, 200), -1 if on else 1)
    if on:
        check = np.array([(left + 4, top + 9), (left + 8, top + 13), (left + 14, top + 5)])
        cv2.polylines(drawn, [check], False, (255, 255, 255), 2, cv2.LINE_AA)


def stroke(on: bool, left: int, top: int, drawn: Array) -> None:
    if on:
        drawn[top + 2 : top + 18, left + 2 : left + 4] = 40


def as_it_is(picture: Array) -> Array:
    return picture


def in_jpeg(picture: Array) -> Array:
    return np.asarray(cv2.imdecode(cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 55])[1], 1), np.uint8)


def darker(picture: Array) -> Array:
    return np.asarray(np.rint(0.8 * picture + 25), np.uint8)


@pytest.mark.parametrize(
    ("part", "on"), [(switch, False), (switch, True), (check_box, False), (check_box, True), (stroke, True)]
)
@pytest.mark.parametrize(
    ("ground", "seen", "seed"), [(250, as_it_is, 0), (250, in_jpeg, 1), (57, darker, 2), (57, in_jpeg, 3)]
)
def test_a_row_whose_switch_or_box_is_in_another_state_is_not_partly_covered(
    seed: int, seen: Look, ground: int, part: Callable[[bool, int, int, Array], None], on: bool
) -> None:
    random = np.random.default_rng(seed)
    words = [str(word) for word in random.permutation(WORDS)[:6]]
    ink = (40,) * 3 if ground > 127 else (210,) * 3

    def rows(*states: bool) -> Array:
        drawn = np.full((220, 200, 3), ground, np.uint8)
        for number, (word, state) in enumerate(zip(words, states, strict=True)):
            cv2.putText(drawn, word, (12, 32 + 34 * number), cv2.FONT_HERSHEY_SIMPLEX, 0.5, ink, 1, cv2.LINE_AA)
            part(state, 130, 18 + 34 * number, drawn)
        return drawn

    states, other = [bool(state) for state in random.integers(0, 2, 6)], int(random.integers(6))
    states[other] = on
    template = rows(*states)[14 + 34 * other : 42 + 34 * other, 6:190]
    states[other] = not on
    search = match_template(seen(rows(*states)), template)
    assert not search.found, search.best


@pytest.mark.parametrize(("seed", "seen"), [*enumerate((as_it_is, in_jpeg, darker))])
@pytest.mark.parametrize("chosen", [0, 2])
def test_another_choice_beside_that_of_the_template_is_not_in_front_of_it(seed: int, chosen: int, seen: Look) -> None:
    random = np.random.default_rng(seed)
    words = [str(word) for word in random.permutation(WORDS)[:6]]

    def rows(choice: int) -> Array:
        drawn = np.full((220, 220, 3), 250, np.uint8)
        for number, word in enumerate(words):
            top = 18 + 34 * number
            cv2.putText(drawn, word, (12, top + 14), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (40,) * 3, 1, cv2.LINE_AA)
            cv2.rectangle(drawn, (130, top), (190, top + 20), (235,) * 3, -1)
            cv2.rectangle(drawn, (130, top), (190, top + 20), (150,) * 3, 1)
            left = 132 + 20 * choice
            cv2.rectangle(drawn, (left, top + 2), (left + 16, top + 18), (90,) * 3, -1)
        return drawn

    top = 14 + 34 * int(random.integers(6))
    search = match_template(seen(rows(1)), rows(chosen)[top : top + 28, 6:206])
    assert not search.found, search.best


@pytest.mark.parametrize("seed", SEEDS)
def test_an_arrow_over_texture_has_no_outline_there(seed: int) -> None:
    random = np.random.default_rng(seed)
    texture = cv2.GaussianBlur(random.normal(size=(220, 300, 3)).astype(np.float32), (0, 0), 1.0)
    contrast = np.where(np.arange(300) > 150, 120, 4)[:, np.newaxis]
    picture = np.clip(120 + contrast * texture, 0, 255).astype(np.uint8)
    template = picture[40:170, 90:200].copy()
    arrow(picture[60 + 8 * seed :, 160:190], random)
    search = match_template(picture, template)
    assert search.found and (search.matches[0].row, search.matches[0].col) == (40, 90)


@pytest.mark.parametrize(("seed", "reach"), [(0, 7), (1, 9), (2, 7), (3, 9)])
def test_another_digit_in_the_badge_of_the_template_is_a_sibling(seed: int, reach: int) -> None:
    random = np.random.default_rng(seed)
    words, _, (row, col) = words_of(random)
    one, other = (str(digit) for digit in random.permutation(9)[:2] + 1)

    def shown(digit: str) -> Array:
        picture = screen(random, words)
        cv2.circle(picture, (col + 102, row + 9), reach, (220, 30, 40), -1, cv2.LINE_AA)
        at = col + 98, row + 13
        cv2.putText(picture, digit, at, cv2.FONT_HERSHEY_PLAIN, 0.8, (255, 255, 255), 1, cv2.LINE_AA)
        return picture

    template = shown(one)[row : row + 44, col : col + 110]
    assert match_template(shown(one), template).found
    search = match_template(shown(other), template)
    assert not search.found, search.best
