"""Picture pairs of a calibration board: a drawn example, or the visitor's own files matched by name."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np
import streamlit as st

from stereolag.core.jobs import Estimate, limits
from stereolag.geometry.boards import MOST_PAIRS, Board, Grey8, Markers, Pairs
from stereolag.geometry.calibration import StereoRig
from stereolag.geometry.drawn_boards import drawn_pairs
from stereolag.io.archives import is_archive, read_archive
from stereolag.io.guard import guarded
from stereolag.io.images import read_image
from stereolag.io.pairing import PicturesOfFiles, matched_pairs
from stereolag.io.sources import MAX_BYTES, escape
from stereolag.ui.choices import choose, own_or_example, show_limits
from stereolag.ui.uploads import PICTURE_TYPES, upload_named

KEY = "calibrate"

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


BYTES_PER_PIXEL = 24
"""Memory for two decoded pictures, their grey versions and the corner search."""

PICTURE_S, MEGAPIXEL_S = 0.15, 0.12
"""Time per picture, and per megapixel of it, s."""


@dataclass(frozen=True, eq=False)
class BoardPictures:
    """Pairs of pictures of one board.

    Attributes
    ----------
    names
        Name of each pair.
    pairs
        Left and right pictures, decoded on demand.
    pixels
        Number of pixels of one picture.
    description
        Text about them on the page.
    digest
        Identifies the pictures.
    shared
        Whether they are an example.
    example
        Name of the example; None for the visitor's own pictures.
    """

    names: tuple[str, ...]
    pairs: Pairs
    pixels: int
    description: str
    digest: str
    shared: bool
    example: str | None = None

    def estimate(self, pairs: int) -> Estimate:
        """Return the cost of looking for the board in a number of pairs."""
        seconds = 2 * pairs * (PICTURE_S + MEGAPIXEL_S * self.pixels / 1e6)
        return Estimate(BYTES_PER_PIXEL * self.pixels + 64 * 2**20, seconds)


def choose_board_pictures() -> BoardPictures:
    """Ask which pictures to calibrate from."""
    chosen = choose(EXAMPLES, key=KEY)
    return own_or_example(chosen, _own, _example, EXAMPLES, key=KEY, awaited="your pairs are")


def _example(name: str) -> BoardPictures:
    pairs = example_pairs(name)
    names = tuple(str(number) for number in range(1, len(pairs) + 1))
    description = (
        f"{len(pairs)} pairs **drawn by this app** with a camera whose lens and position are known, so that the result "
        f"can be checked. The right picture of pair {WRONG_PAIR + 1} is from another moment."
    )
    return BoardPictures(names, pairs, pairs[0][0].size, description, f"drawn {name}", True, name)


def _own() -> BoardPictures | None:
    given = upload_named(
        "Pairs of pictures of a chessboard or ChArUco board, or a ZIP of them",
        _matched,
        key=f"{KEY}.files",
        types=(*PICTURE_TYPES, "zip"),
        note="8 to 40 pairs, both pictures of each taken at the same moment. They are matched by name: left01 and "
        "right01, L_3 and R_3, or equal names in folders left and right of a ZIP.",
    )
    show_limits(
        f"At most {MOST_PAIRS} pairs, {MAX_BYTES // 2**20} MB together, and {limits().max_megapixels} megapixels each."
    )
    if given is None:
        return None
    names, pairs, pixels, alone = given.content
    description = f"{len(names)} pairs, matched by name."
    if alone:
        description += f" {alone} more {'picture has' if alone == 1 else 'pictures have'} no partner."
    digest = hashlib.sha256(given.digest.encode()).hexdigest()
    return BoardPictures(names, pairs, pixels, description, digest, False)


def _matched(files: Sequence[tuple[str, bytes]]) -> tuple[tuple[str, ...], Pairs, int, int]:
    """Return the names of the pairs, the pairs, the pixels of a picture, and the number of unmatched pictures."""
    readers: dict[str, Callable[[], bytes]] = {}
    for name, data in files:
        if is_archive(data):
            archive = read_archive(data)
            readers |= {one: partial(archive.read, one) for one in archive.names}
        else:
            readers[name] = partial(bytes, data)
    if sum(len(data) for _, data in files) > MAX_BYTES:
        raise ValueError(f"The files exceed {MAX_BYTES // 2**20} MB in total; upload fewer, or JPEGs.")
    pairs = matched_pairs([*readers])
    if not pairs:
        raise ValueError(
            f"No left and right pictures match by name (files given: {len(readers)}); name them left01 and right01, "
            "left02 and right02, and so on."
        )
    if len(pairs) > MOST_PAIRS:
        raise ValueError(f"These are {len(pairs)} pairs; at most {MOST_PAIRS} are accepted, and 8 to 40 are enough.")
    pictures = PicturesOfFiles(pairs, lambda name: readers[name](), guarded(read_image))
    pixels = max(image.shape[0] * image.shape[1] for image in pictures[0])
    alone = len([name for name in readers if name.lower().endswith(PICTURE_TYPES)]) - 2 * len(pairs)
    return tuple(escape(pair.name) for pair in pairs), pictures, pixels, max(0, alone)
