"""The calibration page: pictures of a board, its corners, the pairs used, the calibration and its accuracy.

The pictures are a drawn example or the visitor's own files, matched by name.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np
import streamlit as st

from stereolag.core.inputs import as_image
from stereolag.core.jobs import Estimate, limits
from stereolag.core.typography import percent, typesets
from stereolag.figures.boards import coverage_picture, error_bars, with_corners, with_row_lines
from stereolag.figures.pictures import jpeg, png
from stereolag.geometry.boards import (
    MAX_CORNERS,
    MAX_GUESS_PAIRS,
    MAX_PAIRS,
    MIN_CORNERS,
    Board,
    BoardViews,
    Markers,
    Pairs,
    find_boards,
    guess_board,
)
from stereolag.geometry.calibrating import LeftOut, PairReport, StereoCalibration, calibrate_boards
from stereolag.geometry.calibration import StereoRig
from stereolag.geometry.drawn_boards import drawn_pairs
from stereolag.geometry.rectification import rectify
from stereolag.io.calibrations import calibration_json, opencv_calibration, ros_calibration
from stereolag.io.guard import guarded
from stereolag.io.images import IMAGE_SUFFIXES, read_image
from stereolag.io.pairing import PicturesOfFiles, board_pairs
from stereolag.io.sources import MAX_BYTES, escape, is_archive, quote, read_archive
from stereolag.ui import prose
from stereolag.ui.controls import persistent
from stereolag.ui.depth.preparing import take_to_depth_page
from stereolag.ui.downloads import download_button
from stereolag.ui.elements import (
    Number,
    announce,
    in_columns,
    refusals_shown,
    show_numbers,
    show_picture,
    show_refused,
)
from stereolag.ui.navigation import HALF_WIDTH, head, show_try_first
from stereolag.ui.results import Inputs, Refusal, attempted, computed, computed_in_turn, computed_or_refused, kept_for
from stereolag.ui.streamlit_inside import Container
from stereolag.ui.uploads import (
    LIVE,
    choose,
    in_fold,
    own_or_example,
    show_limits,
    upload_named,
)

KEY = "calibrate"
FILES = f"{KEY}.files"

EXAMPLE_PAIRS = 11
"""Number of pairs of a drawn example."""

MISMATCHED_PAIR = 6
"""Index of the pair in an example whose right picture is from another moment, so that it contradicts the others."""


@dataclass(frozen=True)
class DrawnExample:
    """A drawn example: its board, the side of its squares, metres, and whether pictures show only parts of it."""

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


SEARCH_BYTES_PER_PIXEL = 24
"""Memory for two decoded pictures, their grey versions and the corner search, per pixel of a picture."""

SEARCH_S_PER_PICTURE = 0.15
"""Time to look for a board in a picture, s, apart from that for its pixels."""

SEARCH_S_PER_MEGAPIXEL = 0.12
"""Time to look for a board in a megapixel, s."""


@dataclass(frozen=True, eq=False)
class BoardPictures(Inputs):
    """Pairs of pictures of one board.

    Attributes
    ----------
    names
        Name of each pair.
    pairs
        Left and right pictures, decoded on demand.
    pixels
        Number of pixels of one picture.
    example
        Name of the example; None for the visitor's own pictures.
    """

    names: tuple[str, ...]
    pairs: Pairs
    pixels: int
    example: str | None = None

    def estimate(self, pairs: int) -> Estimate:
        """Return the cost of looking for the board in a number of pairs."""
        return Estimate(
            memory=SEARCH_BYTES_PER_PIXEL * self.pixels + 64 * 2**20,
            seconds=2 * pairs * (SEARCH_S_PER_PICTURE + SEARCH_S_PER_MEGAPIXEL * self.pixels / 1e6),
        )


def choose_board_pictures() -> BoardPictures | None:
    """Ask which pictures to calibrate from; return None if a live camera is to take them."""
    with head("Calibrate"):
        chosen = choose(EXAMPLES, key=KEY, live="Live camera")
        show_try_first(
            "start the camera, and hold a printed chessboard in front of it."
            if chosen == LIVE
            else "leave out a pair with a click, and see how the errors change."
        )
    if chosen == LIVE:
        return None
    return own_or_example(chosen, _own, _example, EXAMPLES, key=KEY, awaited="your pairs are")


@st.cache_resource(show_spinner="Drawing the example …")
def _example(name: str) -> BoardPictures:
    example = EXAMPLES[name]
    *pairs, another = drawn_pairs(
        drawn_rig(), example.board, EXAMPLE_PAIRS + 1, square_m=example.square_m, seed=5, partly=example.partly
    )
    pairs[MISMATCHED_PAIR] = pairs[MISMATCHED_PAIR][0], another[1]
    return BoardPictures(
        description=f"{len(pairs)} pairs **drawn by this app** with a camera whose lens and position are known, so "
        f"that the result can be checked. The right picture of pair {MISMATCHED_PAIR + 1} is from another moment.",
        digest=f"drawn {name}",
        shared=True,
        names=tuple(str(number) for number in range(1, len(pairs) + 1)),
        pairs=pairs,
        pixels=pairs[0][0].size,
        example=name,
    )


@in_fold(KEY)
def _own() -> BoardPictures | None:
    given = upload_named(
        "Pairs of pictures of a chessboard or ChArUco board, or a ZIP of them",
        matched,
        key=FILES,
        types=(*IMAGE_SUFFIXES, "zip"),
        note="8 to 40 pairs, both pictures of each taken at the same moment. They are matched by name: left01 and "
        "right01, L_3 and R_3, or equal names in folders left and right of a ZIP.",
    )
    show_limits(
        f"At most {MAX_PAIRS} pairs, {MAX_BYTES // 2**20} MB together, and {limits().max_megapixels} megapixels each."
    )
    if given is None:
        return None
    names, pairs, pixels, unused = given.content
    listed = ", ".join(map(quote, unused[:4]))
    remark = f" Not used, as they have no partner or are not pictures: {listed}." if unused else ""
    return BoardPictures(
        description=f"{len(names)} pairs, matched by name.{remark}",
        digest=hashlib.sha256(given.digest.encode()).hexdigest(),
        shared=False,
        names=names,
        pairs=pairs,
        pixels=pixels,
    )


def matched(files: Sequence[tuple[str, bytes]]) -> tuple[tuple[str, ...], Pairs, int, list[str]]:
    """Return the names of the pairs, the pairs, the number of pixels of a picture, and the unused files."""
    readers: dict[str, Callable[[], bytes]] = {}
    for name, data in files:
        if is_archive(data):
            archive = read_archive(data)
            readers |= {one: partial(archive.read, one) for one in archive.names}
        else:
            readers[name] = partial(bytes, data)
    if sum(len(data) for _, data in files) > MAX_BYTES:
        raise ValueError(f"The files exceed {MAX_BYTES // 2**20} MB in total; upload fewer, or JPEGs.")
    pairs = board_pairs([*readers], "left02 and right02, and so on")
    pictures = PicturesOfFiles(pairs, lambda name: readers[name](), guarded(read_image))
    pixels = max(image.shape[0] * image.shape[1] for image in pictures[0])
    used = {name for pair in pairs for name in (pair.left, pair.right)}
    return tuple(escape(pair.name) for pair in pairs), pictures, pixels, [name for name in readers if name not in used]


# The board, and the calibration

CALIBRATION_S_PER_PAIR = 0.35
"""Time of a calibration per pair, s, if the board is bent; a flat one takes a quarter."""


def ask_board(pictures: BoardPictures) -> tuple[Board, float | None] | None:
    """Ask for the board, initially the guessed one, and the side of its squares, metres; None while it is unknown.

    For own files the side is initially empty, since all lengths depend on it and only the visitor can measure it.
    """
    guessed = _guess(pictures, None)
    if guessed is None:
        return None
    if isinstance(guessed, Refusal):
        prose.warning(guessed.reason, icon=":material/grid_off:")
    initial = guessed if isinstance(guessed, Board) else None
    example = EXAMPLES.get(pictures.example or "")
    with st.container(horizontal=True, gap="small"):
        columns, rows = (
            st.number_input(
                label,
                MIN_CORNERS,
                MAX_CORNERS,
                value,
                **persistent(f"{KEY}.{label}.{pictures.digest}"),
                width=HALF_WIDTH,
                help="Inner corners, where four squares meet: one fewer than squares. Guessed from the pictures.",
            )
            for label, value in (
                ("Corners across", initial.columns if initial else None),
                ("Corners down", initial.rows if initial else None),
            )
        )
    side = st.number_input(
        "Side of a square, mm",
        0.1,
        10_000.0,
        1000 * example.square_m if example else None,
        format="%.3f",
        placeholder="measure it",
        **persistent(f"{KEY}.square.{pictures.example or 'own'}"),
        help="Measured on the print. All lengths follow from it: if it is 1 % too long, so is every distance.",
    )
    if columns is None or rows is None:
        return None
    size = int(columns), int(rows)
    board = initial if initial and size == (initial.columns, initial.rows) else _guess(pictures, size)
    if isinstance(board, Refusal):
        show_refused(board.reason)
    if not isinstance(board, Board):
        return None
    prose.caption(f"{board_in_words(board)} {'Guessed from the pictures.' if board == initial else 'As entered.'}")
    return board, None if side is None else float(side) / 1000


def _guess(pictures: BoardPictures, size: tuple[int, int] | None) -> Board | Refusal | None:
    """Return the board, or why none was found, or None during the search; with a known size, only guess its kind."""
    return computed_in_turn(
        "board",
        attempted(lambda _: guess_board(pictures.pairs, size)),
        pictures.estimate(min(MAX_GUESS_PAIRS, len(pictures.names))),
        **kept_for(pictures, f"{size} {MAX_GUESS_PAIRS}"),
        label="Looking for the board …",
    )


def found_boards(pictures: BoardPictures, board: Board) -> BoardViews | None:
    """Return the corners in all pictures; None during the search, or if it fails, in which case the reason is shown."""
    return computed_or_refused(
        "corners",
        lambda progress: find_boards(pictures.pairs, board, progress=progress),
        pictures.estimate(len(pictures.names)),
        **kept_for(pictures, repr(board)),
        label="Looking for corners …",
    )


def ask_pairs(pictures: BoardPictures, views: BoardViews) -> frozenset[int]:
    """Ask which of the pairs with a board in both pictures to use; return the numbers of those to leave out."""
    usable = [*views.both]
    if not usable:
        return frozenset()
    return frozenset(usable).difference(
        st.pills(
            "Pairs to use: click one to leave it out or to use it again",
            usable,
            selection_mode="multi",
            default=usable,
            format_func=lambda number: pictures.names[number],
            **persistent(f"{KEY}.count.{pictures.digest}.{views.board!r}"),
            wrap=True,
        )
    )


def calibrated(
    pictures: BoardPictures, views: BoardViews, square_m: float | None, leave_out: frozenset[int]
) -> StereoCalibration | None:
    """Return the calibration; None while it is computed, or if it fails, in which case the reason is shown."""
    if square_m is None:
        prose.info(
            "Measure a square of the board and enter its side: every length follows from it.",
            icon=":material/straighten:",
        )
        return None
    return computed_or_refused(
        "calibration",
        lambda _: calibrate_boards(views, square_m, leave_out=leave_out),
        Estimate(64 * 2**20, CALIBRATION_S_PER_PAIR * len(views)),
        **kept_for(pictures, f"{views.board!r} {square_m} {sorted(leave_out)}"),
        label="Calibrating …",
    )


# The result and its downloads


def show_figures(pictures: BoardPictures, result: StereoCalibration) -> None:
    """Show the accuracy of the calibration, and the figures of the cameras."""
    calibration = result.calibration
    headline = (
        f"Calibrated from {len(result.used)} of {len(result.pairs)} pairs: {result.rms:.2f} px reprojection error."
    )
    announce(headline)
    with st.container(horizontal=True, vertical_alignment="center"):
        prose.header(headline.removesuffix("."), anchor=False, width="stretch")
        if st.button("Use it on the depth page", key=f"{KEY}.use", type="primary", icon=":material/arrow_forward:"):
            take_to_depth_page(calibration)
    show_numbers(
        (
            Number("Baseline", f"{1000 * calibration.baseline_m:.2f} mm", "The distance between the cameras."),
            Number("Focal length", f"{calibration.focal_px:,.1f} px", "Of the rectified pair."),
            Number("Epipolar error", f"{result.row_error:.2f} px", "Row offset of matching corners, once rectified."),
            Number("Reprojection error", f"{result.rms:.2f} px", "Distance of detected from predicted corners, RMS."),
        )
    )
    sentences = weaknesses(pictures.names, result)
    if pictures.example:
        true, found = drawn_rig(), calibration.rig
        assert found is not None
        sentences.append(
            f"The camera that drew the pictures: left focal length {true.left_matrix[0, 0]:,.1f} px (found "
            f"{found.left_matrix[0, 0]:,.1f}), right camera {-1000 * true.translation[0]:.1f} mm beside it (found "
            f"{-1000 * found.translation[0]:.1f})."
        )
    if sentences:
        # A visitor cannot mend the weaknesses of an example.
        (prose.caption if pictures.example else prose.warning)("  \n".join(sentences))


def choose_shown(pictures: BoardPictures, result: StereoCalibration | None, place: Container) -> int:
    """Show the error of each pair; return the number of the pair picked by its bar or, in `place`, by its name."""
    key = f"{KEY}.shown.{pictures.digest}"
    shown = int(st.session_state.setdefault(key, result.used[0] if result and result.used else 0))
    if result is not None:
        clicks = st.session_state.setdefault(f"{key}.clicks", 0)
        event = st.plotly_chart(
            error_bars(
                pictures.names,
                [pair.left_rms for pair in result.pairs],
                [pair.right_rms for pair in result.pairs],
                [pair.left_out is None for pair in result.pairs],
                shown,
            ),
            key=f"{key}.bars.{clicks}",
            on_select="rerun",
            selection_mode="points",
            config={"displayModeBar": False},
            alt=errors_in_words(pictures.names, result),
        )
        if event.selection.points:
            # A chart keeps its selection; under a new key it starts without one.
            st.session_state[f"{key}.clicks"] = clicks + 1
            st.session_state[key] = int(event.selection.points[0]["x"])
            st.rerun(scope="fragment")
    return int(
        place.selectbox(
            "Pair shown",
            range(len(pictures.names)),
            format_func=lambda number: pictures.names[number],
            key=key,
        )
    )


def show_pair(pictures: BoardPictures, views: BoardViews, number: int, result: StereoCalibration | None) -> None:
    """Show both pictures of a pair with their corners, its errors, and whether it is used."""
    report = result.pairs[number] if result else None
    left, right = (report.left, report.right) if report else (views.left[number], views.right[number])

    def draw(_: object) -> list[bytes]:
        sides = zip(pictures.pairs[number], (views.left[number], views.right[number]), strict=True)
        return [jpeg(with_corners(as_image(picture, "The picture"), found, views.board)) for picture, found in sides]

    drawn = computed(
        "corners drawn",
        draw,
        **kept_for(pictures, f"{views.board!r} {number}"),
        label="Drawing the corners …",
    )
    for side, picture, corners in in_columns(zip(("Left", "Right"), drawn, (left, right), strict=True), gap="small"):
        found = "not found" if corners is None else f"{len(corners)} of {views.board.corners} corners"
        show_picture(picture, f"{side} picture of pair {pictures.names[number]}, its corners marked: {found}")
        prose.caption(f"{side}: {found}")
    if report is not None:
        prose.markdown(pair_in_words(report))


def show_rectified(pictures: BoardPictures, views: BoardViews, number: int, result: StereoCalibration) -> None:
    """Show a pair rectified by the calibration, with lines along its rows."""

    def draw(_: object) -> bytes:
        rectified = rectify(*pictures.pairs[number], result.calibration)
        return jpeg(with_row_lines(rectified.left, rectified.right))

    with refusals_shown():
        data = computed(
            "rectified",
            draw,
            **kept_for(pictures, f"{number} {result.board!r} {result.used} {result.square_m}"),
            label="Rectifying the pair …",
        )
        name = f"Pair {pictures.names[number]}, rectified"
        show_picture(data, f"{name}, with lines along its rows")
        prose.caption(f"{name}: a point on a line in the left picture lies on the same line in the right one.")


def show_coverage(pictures: BoardPictures, views: BoardViews, number: int, result: StereoCalibration) -> None:
    """Show where in the pictures the board has been."""
    calibration = result.calibration
    assert calibration.width is not None and calibration.height is not None
    used = [result.pairs[number] for number in result.used]
    sides = (
        ("Left", [pair.left for pair in used if pair.left], result.left_coverage),
        ("Right", [pair.right for pair in used if pair.right], result.right_coverage),
    )
    for side, corners, share in in_columns(sides, gap="small"):
        caption = f"{side}: boards covered {percent(share)} of the picture"
        show_picture(png(coverage_picture(corners, (calibration.width, calibration.height))), caption)
        prose.caption(caption)


def show_downloads(pictures: BoardPictures, views: BoardViews, number: int, result: StereoCalibration) -> None:
    """Offer the calibration as files."""
    left, right = ros_calibration(result.calibration)
    with st.container(horizontal=True, gap="small"):
        for name, label, content in (
            ("stereo.yml", "OpenCV YAML", opencv_calibration(result.calibration)),
            ("left.yaml", "ROS, left", left),
            ("right.yaml", "ROS, right", right),
            ("calibration.json", "JSON", calibration_json(result.calibration)),
        ):
            download_button(label, content, name, key=f"{KEY}.download.{name}", icon=":material/download:")
    prose.caption("Lengths are in metres. The calibration is kept only in this session: download it to keep it.")


# Sentences

MIN_OFF_GRID_SQUARES = 0.01
"""Distance of a corner from an even grid from which the page mentions it, as a share of a square's side."""

WHY_LEFT_OUT = {
    LeftOut.NOT_FOUND: "the board was not found in either picture",
    LeftOut.NOT_FOUND_LEFT: "the board was not found in the left picture",
    LeftOut.NOT_FOUND_RIGHT: "the board was not found in the right picture",
    LeftOut.OTHER_SIZE: "its pictures differ in size from most",
    LeftOut.FEW_IN_COMMON: "its pictures share too few corners",
    LeftOut.SAME_VIEW: "it shows the same view as an earlier pair",
    LeftOut.NOT_FLAT: "its corners are not those of a flat board",
    LeftOut.CONTRADICTS: "it contradicts the others: not taken at the same moment, or the board turned round in "
    "one picture",
    LeftOut.BY_HAND: "you left it out",
}


def board_in_words(board: Board) -> str:
    """Return the kind and the size of a board."""
    if board.markers is None:
        return f"A chessboard of {board.columns + 1} × {board.rows + 1} squares."
    kind = board.markers.dictionary.removeprefix("DICT_").rpartition("_")[0].replace("_", " ") or "ArUco"
    return (
        f"A ChArUco board of {board.columns + 1} × {board.rows + 1} squares, markers of the {kind} dictionary "
        f"{100 * board.markers.share:.0f} % as wide as a square"
        f"{', laid out as OpenCV did before 4.6' if board.markers.legacy else ''}."
    )


def pair_in_words(report: PairReport) -> str:
    """Return sentences about the errors of a pair and whether it is used."""
    errors = (
        ""
        if math.isnan(report.left_rms)
        else f"Reprojection error **{report.left_rms:.2f} px** left, **{report.right_rms:.2f} px** right; rows "
        f"**{report.row_error:.2f} px** apart. "
    )
    if report.left_out is not None:
        return f"{errors}Left out: {WHY_LEFT_OUT[report.left_out]}."
    turned = " The right picture’s corners, counted from the other end, were reordered." if report.turned else ""
    return f"{errors}Used.{turned}"


@typesets
def errors_in_words(names: Sequence[str], result: StereoCalibration) -> str:
    """Return a description of the error bars for screen readers."""
    errors = {
        name: max(pair.left_rms, pair.right_rms)
        for name, pair in zip(names, result.pairs, strict=True)
        if pair.left_out is None
    }
    if not errors:
        return "Reprojection error of each pair: none is used."
    worst = max(errors, key=errors.__getitem__)
    left_out = len(result.pairs) - len(errors)
    return (
        f"Reprojection error of each pair, left and right: {min(errors.values()):.2f} to {errors[worst]:.2f} px, the "
        f"largest for pair {worst}; {left_out} {'pair is' if left_out == 1 else 'pairs are'} left out."
    )


def weaknesses(names: Sequence[str], result: StereoCalibration) -> list[str]:
    """Return sentences about the weaknesses of a calibration and their remedies."""
    sentences = []
    for reason in LeftOut:
        out = [name for name, pair in zip(names, result.pairs, strict=True) if pair.left_out is reason]
        if out and reason is not LeftOut.BY_HAND:
            sentences.append(f"Left out: pair {', '.join(out)} – {WHY_LEFT_OUT[reason]}.")
    if result.off_grid_m > MIN_OFF_GRID_SQUARES * result.square_m:
        sentences.append(
            f"The corners of the board are up to {1000 * result.off_grid_m:.2g} mm off a flat, even grid. This was "
            "measured from the pictures and is taken into account."
        )
    return [*sentences, *result.doubts]
