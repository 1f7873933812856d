"""Things that a screen draws over a place, or with it: a sibling of the template in the same box is not found."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from stereolag.templates.identity import identity
from stereolag.templates.patterns import pattern_of
from stereolag.templates.verdict import FOUND

Array = npt.NDArray[np.uint8]
Thing = Callable[[Array, np.random.Generator], None]
Look = Callable[[Array], Array]
WORDS = ("Save", "Open", "Close", "Print", "Export", "Import", "Search", "Reset", "Undo", "Help", "Filter", "Apply")


def is_found(template: Array, picture: Array, row: int, col: int) -> bool:
    """Return whether a place of the picture, which no search needs to find, shows the template."""
    pattern = pattern_of(template, np.ones(template.shape[:2]))
    return identity(picture, pattern, row, col).kind in FOUND


def screen(words: list[str]) -> Array:
    """Return a screen of three columns of buttons of 96 × 30 px, 48 px apart, with these words."""
    picture = np.full((124, 360, 3), 245, np.uint8)
    for number, word in enumerate(words):
        left, top = 16 + 112 * (number % 3), 16 + 48 * (number // 3)
        cv2.rectangle(picture, (left, top), (left + 96, top + 30), (225, 230, 235), -1)
        cv2.rectangle(picture, (left, top), (left + 96, top + 30), (150, 155, 165), 1)
        cv2.putText(picture, word, (left + 14, top + 20), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (30, 30, 40), 1, cv2.LINE_AA)
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


@pytest.mark.parametrize(("seed", "thing"), [*enumerate((None, *THINGS))])
def test_another_word_in_the_same_box_is_not_found_with_or_without_it(thing: Thing | None, seed: int) -> None:
    random = np.random.default_rng(seed)
    words, number, (row, col) = words_of(random)
    template = screen(words)[row : row + 44, col : col + 110].copy()
    words[number] = words[number - 1]
    picture = screen(words)
    if thing is not None:
        thing(picture[row : row + 44, col : col + 110], random)
    assert not is_found(template, picture, row, col)


def as_it_is(picture: Array) -> Array:
    return picture


def in_jpeg(picture: Array) -> Array:
    return np.asarray(cv2.imdecode(cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 55])[1], 1), np.uint8)


def darker(picture: Array) -> Array:
    return np.asarray(np.rint(0.8 * picture + 25), np.uint8)


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
    assert not is_found(rows(chosen)[top : top + 28, 6:206], seen(rows(1)), top, 6)


@pytest.mark.parametrize(("seed", "reach"), [(0, 7), (1, 9), (2, 7), (3, 9)])
def test_another_digit_in_the_badge_of_the_template_is_a_sibling(seed: int, reach: int) -> None:
    random = np.random.default_rng(seed)
    words, _, (row, col) = words_of(random)
    one, other = (str(digit) for digit in random.permutation(9)[:2] + 1)

    def shown(digit: str) -> Array:
        picture = screen(words)
        cv2.circle(picture, (col + 102, row + 9), reach, (220, 30, 40), -1, cv2.LINE_AA)
        at = col + 98, row + 13
        cv2.putText(picture, digit, at, cv2.FONT_HERSHEY_PLAIN, 0.8, (255, 255, 255), 1, cv2.LINE_AA)
        return picture

    template = shown(one)[row : row + 44, col : col + 110]
    assert is_found(template, shown(one), row, col) and not is_found(template, shown(other), row, col)
