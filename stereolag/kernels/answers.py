"""From what the windows found to a displacement, or a reason, for every pixel, in one pass over memory."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from stereolag.kernels.bands import over_bands
from stereolag.kernels.compilation import compiled
from stereolag.kernels.lag_range import LagRange
from stereolag.kernels.matches import FloatMap, LagMap, WindowMatches

Codes = npt.NDArray[np.uint8]

NOTHING = np.float32(np.nan)
NO_LAGS = np.empty((0, 0), np.int16)


class Causes(NamedTuple):
    """The numbers that stand for what an answer is, or why there is none."""

    measured: int
    out_of_frame: int
    low_texture: int
    at_search_edge: int


class Cells(NamedTuple):
    """Where the windows lie: px from the frame to the first window's cell, side of a cell, and the last window's place.

    The cell of a window is what is nearest to its centre, step × step px.
    """

    offset: int
    step: int
    last_row: int
    last_col: int


class Answers(NamedTuple):
    """(H, W) pictures: displacement and score, NaN where there is none, and the number of the cause."""

    dy: FloatMap
    dx: FloatMap
    score: FloatMap
    cause: Codes


@compiled
def write_answers(
    first: int,
    end: int,
    cells: Cells,
    lags: tuple[int, int, int, int],
    circular: bool,
    flat: float,
    causes: Causes,
    before: Codes,
    texture: FloatMap,
    best: FloatMap,
    lag_dy: LagMap,
    lag_dx: LagMap,
    beside_dy: FloatMap,
    beside_dx: FloatMap,
    answers: Answers,
) -> None:
    """Write the cells of rows `first` to `end` of the grid, and with its first and last row the frame beyond."""
    offset, step, last_row, last_col = cells
    dy_first, dy_last, dx_first, dx_last = lags
    dy_picture, dx_picture, score_picture, cause_picture = answers
    rows, cols = best.shape
    height, width = cause_picture.shape
    vertical = lag_dy.size > 0
    measured, out_of_frame = np.uint8(causes.measured), np.uint8(causes.out_of_frame)
    low_texture, at_search_edge = np.uint8(causes.low_texture), np.uint8(causes.at_search_edge)
    cause = np.full(cols, measured, np.uint8)
    dy, dx = np.empty(cols, np.float32), np.empty(cols, np.float32)
    for row in range(first, end):
        if before.size:
            cause[:] = before[row]
        else:
            cause[:] = measured
        if not circular:
            for col in range(cols):
                lag = lag_dx[row, col]
                place = col * step + lag
                inside = (lag >= dx_first) & (lag <= dx_last)
                cut = (place == 0) | (place == last_col)
                cause[col] = out_of_frame if cut else (cause[col] if inside else at_search_edge)
            if vertical:
                for col in range(cols):
                    lag = lag_dy[row, col]
                    place = row * step + lag
                    inside = (lag >= dy_first) & (lag <= dy_last)
                    cut = (place == 0) | (place == last_row) | (cause[col] == out_of_frame)
                    cause[col] = out_of_frame if cut else (cause[col] if inside else at_search_edge)
        for col in range(cols):
            score = best[row, col]
            known = cause[col] if score == score else out_of_frame
            known = low_texture if texture[row, col] <= flat else known
            cause[col] = known
            dx[col] = beside_dx[row, col] + np.float32(lag_dx[row, col]) if known == measured else NOTHING
            dy[col] = beside_dy[row, col] if known == measured else NOTHING
        if vertical:
            for col in range(cols):
                dy[col] += np.float32(lag_dy[row, col])
        top = offset + row * step
        for y in range(top, top + step):
            _blank(answers, y, 0, offset, out_of_frame)
            _blank(answers, y, offset + cols * step, width, out_of_frame)
            if step == 1:
                dy_picture[y, offset : offset + cols] = dy
                dx_picture[y, offset : offset + cols] = dx
                score_picture[y, offset : offset + cols] = best[row]
                cause_picture[y, offset : offset + cols] = cause
                continue
            for x in range(cols * step):
                col = x // step
                dy_picture[y, offset + x] = dy[col]
                dx_picture[y, offset + x] = dx[col]
                score_picture[y, offset + x] = best[row, col]
                cause_picture[y, offset + x] = cause[col]
    if first == 0:
        for y in range(offset):
            _blank(answers, y, 0, width, out_of_frame)
    if end == rows:
        for y in range(offset + rows * step, height):
            _blank(answers, y, 0, width, out_of_frame)


@compiled
def _blank(answers: Answers, y: int, left: int, right: int, cause: np.uint8) -> None:
    for x in range(left, right):
        answers.dy[y, x] = NOTHING
        answers.dx[y, x] = NOTHING
        answers.score[y, x] = NOTHING
        answers.cause[y, x] = cause


def answer(
    matches: WindowMatches,
    beside: tuple[FloatMap, FloatMap],
    *,
    shape: tuple[int, int],
    cells: Cells,
    lags: LagRange,
    circular: bool,
    flat: float,
    causes: Causes,
    before: Codes | None,
) -> Answers:
    """Return what every pixel is told.

    Parameters
    ----------
    matches
        What the windows found.
    beside
        Sub-pixel (dy, dx) of the peak of every window, px.
    shape
        (H, W) of the pictures.
    cells
        Where the windows lie.
    lags
        The displacements asked for: a peak on one beyond them is at the edge of the search.
    circular
        Whether the correlation wraps around, so that neither frame nor edge cuts the search short.
    flat
        Texture up to which a window is too flat, grey levels.
    causes
        The numbers of the causes.
    before
        Causes found already, which every other outweighs.
    """
    dy, dx, score = (np.empty(shape, np.float32) for _ in range(3))
    answers = Answers(dy, dx, score, np.empty(shape, np.uint8))
    found = (
        np.empty((0, 0), np.uint8) if before is None else np.ascontiguousarray(before),
        np.ascontiguousarray(matches.texture),
        np.ascontiguousarray(matches.score),
        np.ascontiguousarray(matches.dy) if lags.rows > 1 else NO_LAGS,
        np.ascontiguousarray(matches.dx),
        *beside,
    )
    asked = (lags.dy_first, lags.dy_last, lags.dx_first, lags.dx_last)

    def write(first: int, end: int) -> None:
        write_answers(first, end, cells, asked, circular, flat, causes, *found, answers)

    over_bands(write, matches.score.shape[0])
    return answers
