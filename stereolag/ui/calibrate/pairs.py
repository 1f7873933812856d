"""The pairs one by one: whether each counts, its error, and its pictures with the detected corners."""

from __future__ import annotations

import math

import streamlit as st

from stereolag.core.inputs import as_image
from stereolag.core.typography import typesets
from stereolag.figures.boards import error_bars, with_corners, with_row_lines
from stereolag.figures.pictures import jpeg
from stereolag.geometry.boards import BoardViews
from stereolag.geometry.calibrating import LeftOut, PairReport, StereoCalibration
from stereolag.geometry.rectification import rectify
from stereolag.ui import prose
from stereolag.ui.calibrate.pictures import KEY, BoardPictures
from stereolag.ui.elements import show_jpeg
from stereolag.ui.persistence import persistent
from stereolag.ui.results import computed
from stereolag.ui.states import show_refused

WHY_LEFT_OUT = {
    LeftOut.NOT_FOUND: "the board was not found in either picture",
    LeftOut.NOT_FOUND_LEFT: "the board was not found in the left picture",
    LeftOut.NOT_FOUND_RIGHT: "the board was not found in the right picture",
    LeftOut.OTHER_SIZE: "its pictures differ in size from most",
    LeftOut.FEW_IN_COMMON: "both pictures share too few corners",
    LeftOut.SAME_VIEW: "it shows the same view as an earlier pair",
    LeftOut.NOT_FLAT: "its corners are not those of a flat board",
    LeftOut.CONTRADICTS: "it contradicts the others: not taken at the same moment, or the board turned round in "
    "one picture",
    LeftOut.BY_HAND: "you left it out",
}


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


def choose_shown(pictures: BoardPictures, result: StereoCalibration | None) -> int:
    """Show the error of each pair, and return the number of the one to show, picked by its bar or by name."""
    key = f"{KEY}.shown.{pictures.digest}"
    at_first = next((number for number in (result.used if result else ())), 0)
    shown = int(st.session_state.setdefault(key, at_first))
    if result is not None:
        figure = error_bars(
            pictures.names,
            [pair.left_rms for pair in result.pairs],
            [pair.right_rms for pair in result.pairs],
            [pair.left_out is None for pair in result.pairs],
            shown,
        )
        clicks = st.session_state.setdefault(f"{key}.clicks", 0)
        event = st.plotly_chart(
            figure,
            key=f"{key}.bars.{clicks}",
            on_select="rerun",
            selection_mode="points",
            config={"displayModeBar": False},
            alt=_errors_in_words(pictures, result),
        )
        if event.selection.points:
            # A chart keeps its selection; under a new key it starts without one.
            st.session_state[f"{key}.clicks"] = clicks + 1
            st.session_state[key] = int(event.selection.points[0]["x"])
            st.rerun(scope="fragment")
    return int(
        st.selectbox(
            "Pair shown",
            range(len(pictures.names)),
            format_func=lambda number: pictures.names[number],
            key=key,
            width=260,
        )
    )


def show_pair(pictures: BoardPictures, views: BoardViews, number: int, result: StereoCalibration | None) -> None:
    """Show both pictures of a pair with their corners, its errors, and whether it counts."""
    report = result.pairs[number] if result else None
    left, right = (report.left, report.right) if report else (views.left[number], views.right[number])

    def drawn(_: object) -> bytes:
        return b"".join(_with_length(_corners_jpeg(pictures, views, number)))

    data = computed(
        "corners drawn",
        drawn,
        inputs=pictures.digest,
        settings=f"{views.board!r} {number}",
        shared=pictures.shared,
        label="Drawing the corners …",
    )
    cut = 4 + int.from_bytes(data[:4], "big")
    for column, side, picture, corners in zip(
        st.columns(2, gap="small"), ("Left", "Right"), (data[4:cut], data[cut:]), (left, right), strict=True
    ):
        with column:
            found = "not found" if corners is None else f"{len(corners)} of {views.board.corners} corners"
            show_jpeg(picture, f"{side} picture of pair {pictures.names[number]}, its corners marked: {found}")
            prose.caption(f"{side}: {found}")
    if report is not None:
        prose.markdown(_in_words(report))


def show_rectified(pictures: BoardPictures, number: int, result: StereoCalibration) -> None:
    """Show a pair rectified by the calibration, with lines along its rows."""

    def drawn(_: object) -> bytes:
        left, right = pictures.pairs[number]
        rectified = rectify(left, right, result.calibration)
        return jpeg(with_row_lines(rectified.left, rectified.right))

    try:
        data = computed(
            "rectified",
            drawn,
            inputs=pictures.digest,
            settings=f"{number} {result.board!r} {result.used} {result.square_m}",
            shared=pictures.shared,
            label="Rectifying the pair …",
        )
    except ValueError as error:
        show_refused(error)
        return
    show_jpeg(data, f"Pair {pictures.names[number]}, rectified, with lines along its rows")
    prose.caption(
        f"Pair {pictures.names[number]}, rectified: a point on a line in the left picture lies on it in the right one."
    )


def _corners_jpeg(pictures: BoardPictures, views: BoardViews, number: int) -> tuple[bytes, bytes]:
    left, right = (as_image(one, "The picture") for one in pictures.pairs[number])
    return (
        jpeg(with_corners(left, views.left[number], views.board)),
        jpeg(with_corners(right, views.right[number], views.board)),
    )


def _with_length(both: tuple[bytes, bytes]) -> tuple[bytes, bytes, bytes]:
    return len(both[0]).to_bytes(4, "big"), *both


@typesets
def _errors_in_words(pictures: BoardPictures, result: StereoCalibration) -> str:
    """Return a description of the error bars for screen readers."""
    errors = {
        name: max(pair.left_rms, pair.right_rms)
        for name, pair in zip(pictures.names, result.pairs, strict=True)
        if pair.left_out is None
    }
    if not errors:
        return "Reprojection error of each pair: none counts."
    worst = max(errors, key=errors.__getitem__)
    left_out = len(result.pairs) - len(errors)
    return (
        f"Reprojection error of each pair, left and right: {min(errors.values()):.2f} to {errors[worst]:.2f} px, the "
        f"largest for pair {worst}; {left_out} {'pair does' if left_out == 1 else 'pairs do'} not count."
    )


def _in_words(report: PairReport) -> str:
    """Return sentences about the errors of a pair and whether it counts."""
    errors = (
        ""
        if math.isnan(report.left_rms)
        else f"Reprojection error **{report.left_rms:.2f} px** left, **{report.right_rms:.2f} px** right; rows "
        f"**{report.row_error:.2f} px** apart. "
    )
    if report.left_out is not None:
        return f"{errors}Left out: {WHY_LEFT_OUT[report.left_out]}."
    turned = " The right picture’s corners, counted from the other end, were reordered." if report.turned else ""
    return f"{errors}It counts.{turned}"
