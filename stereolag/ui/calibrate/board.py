"""The board in the pictures: guessed, and corrected by the visitor if the guess is wrong."""

from __future__ import annotations

from dataclasses import dataclass

import streamlit as st

from stereolag.geometry.boards import FEWEST_CORNERS, GUESSED_FROM, MOST_CORNERS, Board, guess_board
from stereolag.ui import prose
from stereolag.ui.calibrate.examples import EXAMPLES
from stereolag.ui.calibrate.pictures import KEY, BoardPictures
from stereolag.ui.persistence import persistent
from stereolag.ui.results import computed_in_turn
from stereolag.ui.states import show_refused

SQUARE_MM = (0.1, 10_000.0)


@dataclass(frozen=True)
class Unseen:
    """The reason why no board was guessed."""

    sentence: str


def ask_board(pictures: BoardPictures) -> tuple[Board, float] | None:
    """Ask for the board, initially the guessed one, and the side of its squares, metres; None while it is unknown."""
    guessed = _guess(pictures, None)
    if guessed is None:
        return None
    if isinstance(guessed, Unseen):
        prose.warning(guessed.sentence, icon=":material/grid_off:")
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
    if isinstance(asked, Unseen):
        show_refused(asked.sentence)
    if not isinstance(asked, Board):
        return None
    prose.caption(f"{_in_words(asked)} {'Guessed from the pictures.' if asked == at_first else 'As entered.'}")
    return asked, float(side or SQUARE_MM[0]) / 1000


def _guess(pictures: BoardPictures, size: tuple[int, int] | None) -> Board | Unseen | None:
    """Return the board or why there is none, or None while looking for it; a known size leaves only its kind open."""

    def guess(_: object) -> Board | Unseen:
        try:
            return guess_board(pictures.pairs, size)
        except ValueError as error:
            return Unseen(str(error))

    return computed_in_turn(
        "board",
        guess,
        pictures.estimate(min(GUESSED_FROM, len(pictures.names))),
        inputs=pictures.digest,
        settings=f"{size} {GUESSED_FROM}",
        shared=pictures.shared,
        label="Looking for the board …",
    )


def _in_words(board: Board) -> str:
    if board.markers is None:
        return f"A chessboard of {board.columns + 1} × {board.rows + 1} squares."
    kind = board.markers.dictionary.removeprefix("DICT_").rpartition("_")[0].replace("_", " ") or "ArUco"
    return (
        f"A ChArUco board of {board.columns + 1} × {board.rows + 1} squares, markers of the {kind} dictionary "
        f"{100 * board.markers.share:.0f} % as wide as a square"
        f"{', laid out as OpenCV did before 4.6' if board.markers.legacy else ''}."
    )
