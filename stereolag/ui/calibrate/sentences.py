"""Sentences of the calibration page: the board, the errors of a pair, and the weaknesses of a result."""

from __future__ import annotations

import math
from collections.abc import Sequence

from stereolag.core.typography import typesets
from stereolag.geometry.boards import Board
from stereolag.geometry.calibrating import LeftOut, PairReport, StereoCalibration
from stereolag.ui.sentences import percent

ENOUGH_PAIRS = 8
ENOUGH_COVERAGE = 0.6
SURE_FOCAL = 0.01
GOOD_ROWS_PX = 0.5

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


@typesets
def errors_in_words(names: Sequence[str], result: StereoCalibration) -> str:
    """Return a description of the error bars for screen readers."""
    errors = {
        name: max(pair.left_rms, pair.right_rms)
        for name, pair in zip(names, result.pairs, strict=True)
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


def weaknesses(names: Sequence[str], result: StereoCalibration) -> list[str]:
    """Return sentences about the weaknesses of a calibration, and how to mend them."""
    sentences = []
    for reason in LeftOut:
        out = [name for name, pair in zip(names, result.pairs, strict=True) if pair.left_out is reason]
        if out and reason is not LeftOut.BY_HAND:
            sentences.append(f"Left out: pair {', '.join(out)} – {WHY_LEFT_OUT[reason]}.")
    if len(result.used) < ENOUGH_PAIRS:
        sentences.append(f"{len(result.used)} pairs count: use {ENOUGH_PAIRS} to 40 for a reliable result.")
    least = min(result.left_coverage, result.right_coverage)
    if least < ENOUGH_COVERAGE:
        sentences.append(
            f"The board has covered {percent(least)} of the picture: hold it in the corners too, where the lens "
            "distorts most."
        )
    if result.focal_error > SURE_FOCAL:
        sentences.append(
            f"The focal length is uncertain by {100 * result.focal_error:.1f} %: tilt the board more, to all sides."
        )
    if result.row_error > GOOD_ROWS_PX:
        sentences.append(
            f"Rows are {result.row_error:.2f} px apart on average, enough to disturb matching: is the board flat, are "
            "the pictures sharp, and both taken at the same moment?"
        )
    return sentences
