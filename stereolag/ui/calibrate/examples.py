"""Calibration examples: boards drawn as a stereo camera of known geometry would see them."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import streamlit as st

from stereolag.geometry.boards import Board, Grey8, Markers
from stereolag.geometry.calibration import StereoRig
from stereolag.geometry.drawn_boards import drawn_pairs

PAIRS = 11
WRONG_PAIR = 6
"""Index of the pair whose right picture is from another moment, so that it contradicts the others."""


@dataclass(frozen=True)
class DrawnExample:
    """A drawn example: its board, and the side of the squares, metres."""

    title: str
    board: Board
    square_m: float
    partly: bool


EXAMPLES = {
    "chessboard": DrawnExample("Drawn chessboard", Board(9, 6), 0.03, partly=False),
    "charuco": DrawnExample("Drawn ChArUco board", Board(8, 5, Markers("DICT_5X5_1000", 0.72)), 0.035, partly=True),
}


def drawn_rig() -> StereoRig:
    """Return the stereo camera that draws the examples."""
    return StereoRig(
        np.array([[520.0, 0, 326], [0, 521, 237], [0, 0, 1]]),
        np.array([-0.28, 0.09, 0.0006, -0.0004, 0.0]),
        np.array([[524.0, 0, 314], [0, 525, 243], [0, 0, 1]]),
        np.array([-0.27, 0.08, -0.0003, 0.0005, 0.0]),
        np.asarray(cv2.Rodrigues(np.array([0.012, -0.03, 0.009]))[0], dtype=np.float64),
        np.array([-0.06, 0.0008, 0.001]),
        640,
        480,
    )


@st.cache_resource(show_spinner="Drawing the example …")
def example_pairs(name: str) -> list[tuple[Grey8, Grey8]]:
    """Return the picture pairs of an example."""
    example = EXAMPLES[name]
    drawn = drawn_pairs(drawn_rig(), example.board, PAIRS + 1, square_m=example.square_m, seed=5, partly=example.partly)
    *pairs, another = drawn
    pairs[WRONG_PAIR] = pairs[WRONG_PAIR][0], another[1]
    return pairs
