"""What a live camera takes of a board, without the browser: which frames it wants, and what it says meanwhile."""

import json
import math
from copy import deepcopy
from itertools import islice
from typing import Any

import cv2
import numpy as np
import pytest

from stereolag.core.arrays import Rgb
from stereolag.figures.pictures import jpeg
from stereolag.ui.calibrate import matched
from stereolag.ui.calibrate_live import UNKNOWN, Shown, Taking
from tests.held_boards import CHESSBOARD, held, obeying, taken

Pair = tuple[Rgb, Rgb]

FRAME_MS = 100.0


def answer(taking: Taking, *parts: Rgb, **header: float) -> dict[str, Any]:
    packed = taking.answer(Shown.model_validate({"parts": tuple(map(jpeg, parts))} | header))
    told: dict[str, Any] = json.loads(packed[4 : 4 + int.from_bytes(packed[:4], "little")])
    return told


def look(taking: Taking, pair: Pair, *, after: float = FRAME_MS) -> dict[str, Any]:
    """Return the answer to a frame that was taken so many milliseconds after the one before."""
    at = after + (taking.recent[-1].at if taking.recent else 0)
    return answer(taking, np.hstack(pair), at=at)


def hold(taking: Taking, pair: Pair) -> dict[str, Any]:
    """Hold a board still for two frames, as a browser sees it, and return the last answer."""
    look(taking, pair)
    told = look(taking, pair)
    return answer(taking, *pair) if told["wanted"] else told


@pytest.fixture(scope="module")
def middle() -> Pair:
    return taken(held())


@pytest.fixture(scope="module")
def begun(middle: Pair) -> Taking:
    one = Taking()
    for count in range(3):
        assert look(one, middle)["said"].startswith(UNKNOWN) is (count < 2)
    assert hold(one, middle)["count"] == 1
    return one


@pytest.fixture
def taking(begun: Taking) -> Taking:
    """Return what is known once the board is, and the first pair was taken."""
    return deepcopy(begun)


def test_what_is_taken_are_files_as_good_as_those_of_a_visitor() -> None:
    taking, pairs = Taking(), [taken(poses) for _, poses in islice(obeying(4), 2)]
    for number, pair in enumerate(pairs, start=1):
        for _ in range(3 if taking.board is None else 0):
            look(taking, pair)
        assert hold(taking, pair)["count"] == number
    names, pictures, _, alone = matched(taking.files)
    assert len(names) == len(pairs) and not alone
    assert [data for _, data in taking.files] == [jpeg(view) for pair in pairs for view in pair]
    assert np.abs(np.array(pictures, float) - pairs).mean() < 2


def test_a_pair_is_wanted_only_if_the_board_is_still_and_held_in_a_new_way(taking: Taking, middle: Pair) -> None:
    assert not look(taking, middle)["wanted"]
    aside = taken(held(0.1))
    told = look(taking, aside)
    assert not told["wanted"] and told["said"].startswith("Hold it still")
    moved = tuple(np.roll(view, 3, axis=1) for view in aside)
    assert not look(taking, moved)["wanted"]  # type: ignore[arg-type]
    assert look(taking, moved)["wanted"]  # type: ignore[arg-type]
    assert len(told["corners"][0]) == len(told["corners"][1]) == CHESSBOARD.corners


def test_whether_a_board_is_still_depends_on_its_speed_at_any_frame_rate(taking: Taking) -> None:
    aside = taken(held(0.1))
    for frames_a_second in (5, 30):
        for per_second, still in ((4.0, True), (10.0, False)):
            told = []
            for number in range(1 + math.ceil(0.2 * frames_a_second)):
                shift = np.array([[1.0, 0, number * per_second / frames_a_second], [0, 1, 0]])
                moved = (cv2.warpAffine(view, shift, view.shape[1::-1]) for view in aside)
                told.append(look(taking, tuple(moved), after=1000 / frames_a_second))  # type: ignore[arg-type]
            assert any(one["wanted"] for one in told) is still
            taking.recent.clear()


def test_a_view_without_the_board_is_named(taking: Taking, middle: Pair) -> None:
    blank = np.full_like(middle[0], 110)
    for pair, word in (((blank, middle[1]), "left"), ((middle[0], blank), "right"), ((blank, blank), "neither")):
        assert word in look(taking, pair)["said"].split(".")[0]


def test_another_camera_needs_another_start(taking: Taking) -> None:
    smaller = tuple(view[::2, ::2] for view in taken(held(0.1)))
    with pytest.raises(ValueError, match="start over"):
        answer(taking, *smaller)
