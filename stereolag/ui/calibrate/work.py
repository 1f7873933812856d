"""From pictures to a calibration: the board, guessed or entered, its corners, the pairs that count, and the fit."""

from __future__ import annotations

import streamlit as st

from stereolag.core.jobs import Estimate
from stereolag.geometry.boards import (
    FEWEST_CORNERS,
    GUESSED_FROM,
    MOST_CORNERS,
    Board,
    BoardViews,
    find_boards,
    guess_board,
)
from stereolag.geometry.calibrating import StereoCalibration, calibrate_boards
from stereolag.ui import prose
from stereolag.ui.calibrate.pictures import EXAMPLES, KEY, BoardPictures
from stereolag.ui.calibrate.sentences import board_in_words
from stereolag.ui.controls import persistent
from stereolag.ui.elements import show_refused
from stereolag.ui.results import Refusal, attempted, computed_in_turn, computed_or_refused

SQUARE_MM = (0.1, 10_000.0)

MEMORY, PAIR_S = 64 * 2**20, 0.08
"""Cost of a calibration: memory, bytes, and time per pair, s."""


def ask_board(pictures: BoardPictures) -> tuple[Board, float] | None:
    """Ask for the board, initially the guessed one, and the side of its squares, metres; None while it is unknown."""
    guessed = _guess(pictures, None)
    if guessed is None:
        return None
    if isinstance(guessed, Refusal):
        prose.warning(guessed.reason, icon=":material/grid_off:")
    at_first = guessed if isinstance(guessed, Board) else None
    with st.container(horizontal=True, vertical_alignment="bottom", gap="medium"):
        columns, rows = (
            st.number_input(
                label,
                FEWEST_CORNERS,
                MOST_CORNERS,
                value,
                **persistent(f"{KEY}.{label}.{pictures.digest}"),
                width=190,
                help="Inner corners, where four squares meet: one fewer than squares. Guessed from the pictures.",
            )
            for label, value in (
                ("Inner corners across", at_first.columns if at_first else None),
                ("Inner corners down", at_first.rows if at_first else None),
            )
        )
        example = EXAMPLES.get(pictures.example or "")
        side = st.number_input(
            "Side of a square, mm",
            *SQUARE_MM,
            1000 * example.square_m if example else 25.0,
            format="%.3f",
            **persistent(f"{KEY}.square.{pictures.example or 'own'}"),
            width=190,
            help="Measured on the print. All lengths follow from it: if it is 1 % too long, so is every distance.",
        )
    if columns is None or rows is None:
        return None
    size = int(columns), int(rows)
    asked = at_first if at_first and size == (at_first.columns, at_first.rows) else _guess(pictures, size)
    if isinstance(asked, Refusal):
        show_refused(asked.reason)
    if not isinstance(asked, Board):
        return None
    prose.caption(f"{board_in_words(asked)} {'Guessed from the pictures.' if asked == at_first else 'As entered.'}")
    return asked, float(side or SQUARE_MM[0]) / 1000


def _guess(pictures: BoardPictures, size: tuple[int, int] | None) -> Board | Refusal | None:
    """Return the board or why there is none, or None while looking for it; a known size leaves only its kind open."""
    return computed_in_turn(
        "board",
        attempted(lambda _: guess_board(pictures.pairs, size)),
        pictures.estimate(min(GUESSED_FROM, len(pictures.names))),
        inputs=pictures.digest,
        settings=f"{size} {GUESSED_FROM}",
        shared=pictures.shared,
        label="Looking for the board …",
    )


def found_boards(pictures: BoardPictures, board: Board) -> BoardViews | None:
    """Return the corners in all pictures; None during the search, or if it is refused, with the reason shown."""
    return computed_or_refused(
        "corners",
        lambda progress: find_boards(pictures.pairs, board, progress=progress),
        pictures.estimate(len(pictures.names)),
        inputs=pictures.digest,
        settings=repr(board),
        shared=pictures.shared,
        label="Looking for corners …",
    )


def ask_pairs(pictures: BoardPictures, views: BoardViews) -> frozenset[int]:
    """Ask which of the pairs with a board in both pictures count; return the numbers of those to leave out."""
    usable = [
        number
        for number, both in enumerate(zip(views.left, views.right, strict=True))
        if both[0] is not None and both[1] is not None
    ]
    if not usable:
        return frozenset()
    counting = st.pills(
        "Pairs that count: a click leaves one out, and takes it in again",
        usable,
        selection_mode="multi",
        default=usable,
        format_func=lambda number: pictures.names[number],
        **persistent(f"{KEY}.count.{pictures.digest}.{views.board!r}"),
        wrap=True,
    )
    return frozenset(usable) - frozenset(counting)


def calibrated(
    pictures: BoardPictures, views: BoardViews, square_m: float, leave_out: frozenset[int]
) -> StereoCalibration | None:
    """Return the calibration; None while it is being computed, or if it is refused, with the reason shown."""
    return computed_or_refused(
        "calibration",
        lambda _: calibrate_boards(views, square_m, leave_out=leave_out),
        Estimate(MEMORY, PAIR_S * len(views)),
        inputs=pictures.digest,
        settings=f"{views.board!r} {square_m} {sorted(leave_out)}",
        shared=pictures.shared,
        label="Calibrating …",
    )
