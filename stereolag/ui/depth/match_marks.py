"""The frames of one match over the pictures, and the legend of their colours."""

from __future__ import annotations

import math

from stereolag.assess.explaining import Box, MatchExplanation
from stereolag.figures.legends import Legend, word_legend
from stereolag.figures.match import RUNNER_UP_COLOUR, SEARCH_COLOUR, TRUTH_COLOUR, WINDOW_COLOUR
from stereolag.ui.depth.view import DepthView
from stereolag.ui.linked_pictures import Mark

Pixel = tuple[int, int]


def legend_of(view: DepthView) -> Legend:
    """Return the legend of the frames."""
    colours = [WINDOW_COLOUR, RUNNER_UP_COLOUR, SEARCH_COLOUR]
    words = ["the window, and where it was found", "the runner-up", "the search area"]
    if view.pair.truth is not None:
        colours.insert(1, TRUTH_COLOUR)
        words.insert(1, "the true place")
    return word_legend("", colours, words)


def marks_of(view: DepthView, seen: MatchExplanation, pixel: Pixel) -> list[Mark]:
    """Return the frames: the window at left; the search area and the runner-up, true and found places at right."""
    marks = [_frame(seen.search, SEARCH_COLOUR, 1, area=True), _frame(seen.window, WINDOW_COLOUR, 0)]
    if seen.runner_up:
        marks.append(_frame(moved(seen, seen.runner_up), RUNNER_UP_COLOUR, 1))
    if true := true_lag(view, pixel):
        marks.append(_frame(moved(seen, true), TRUTH_COLOUR, 1, dashed=True))
    if seen.found:
        marks.append(_frame(seen.found, WINDOW_COLOUR, 1))
    return [*marks, Mark(*pixel, WINDOW_COLOUR, pictures=(0,))]


def truth_at(view: DepthView, pixel: Pixel) -> float:
    """Return the ground truth at a pixel, px; NaN if unknown."""
    return math.nan if view.pair.truth is None else float(view.pair.truth[pixel])


def true_lag(view: DepthView, pixel: Pixel) -> tuple[int, int] | None:
    """Return the integer lag (dy, dx) nearest to the ground truth; None if unknown."""
    truth = truth_at(view, pixel)
    return None if math.isnan(truth) else (0, -round(truth))


def _frame(box: Box, colour: str, picture: int, *, area: bool = False, dashed: bool = False) -> Mark:
    return Mark(
        box.row,
        box.col,
        colour,
        height=box.height,
        width=box.width,
        dashed=area or dashed,
        filled=area,
        pictures=(picture,),
    )


def moved(seen: MatchExplanation, lag: tuple[int, int]) -> Box:
    """Return the window moved by (dy, dx)."""
    window = seen.window
    return Box(window.row + lag[0], window.col + lag[1], window.height, window.width)
