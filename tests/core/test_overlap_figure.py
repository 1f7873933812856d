"""The grid of windows around one window, as a figure."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereolag.assess.explaining import Box, window_start
from stereolag.figures.match import (
    CLOSEST,
    WindowGrid,
    overlap_figure,
    window_grid,
)
from stereolag.stereo.windows.matcher import CorrelationMatcher

SHAPE = 300, 400


def grid_at(row: int, col: int, size: int, overlap: float, shape: tuple[int, int] = SHAPE) -> WindowGrid:
    step = CorrelationMatcher(window_size=size, overlap=overlap).step
    top, left = (window_start(at, end, size, step) for at, end in zip((row, col), shape, strict=True))
    return window_grid(shape, Box(top, left, size, size), step)


@pytest.mark.parametrize(
    ("size", "overlap", "step", "values"),
    [(20, 0.9, 2, 17 * 17), (20, 0.95, 1, 32 * 32), (20, 0.0, 20, 3 * 3), (10, 0.5, 5, 5 * 5), (3, 0.95, 1, 9 * 9)],
)
def test_the_values_are_the_windows_whose_centres_lie_in_the_cut(
    size: int, overlap: float, step: int, values: int
) -> None:
    grid = grid_at(150, 200, size, overlap)
    assert (grid.step, grid.values, grid.every) == (step, values, 1)
    assert len(grid.neighbours()) == 9


sides = st.integers(3, 255)


@given(size=sides, overlap=st.floats(0, 0.99), row=st.integers(0, 299), col=st.integers(0, 399))
def test_every_window_is_one_of_the_map_and_the_figure_stays_legible(
    size: int, overlap: float, row: int, col: int
) -> None:
    grid = grid_at(row, col, size, overlap)
    every_row, every_col = (set(range(0, side - size + 1, grid.step)) for side in SHAPE)
    cut, half = grid.cut, (size - 1) / 2
    # The reference counts all windows of the map one by one.
    counted = [
        sum(first <= start + half < first + length for start in starts)
        for starts, first, length in ((every_row, cut.row, cut.height), (every_col, cut.col, cut.width))
    ]
    assert grid.values == counted[0] * counted[1]
    assert set(grid.rows.tolist()) <= every_row
    assert set(grid.cols.tolist()) <= every_col
    near = grid.neighbours()
    assert (grid.middle.row, grid.middle.col) in near
    assert 1 <= len(near) <= 9
    for top, left in near:
        assert cut.row <= top <= cut.row + cut.height - size
        assert cut.col <= left <= cut.col + cut.width - size
    # Neighbours stay some px apart on the screen, whatever the settings.
    assert grid.every * grid.step >= size / CLOSEST
    assert grid.drawn(grid.rows, grid.middle.row).size <= 4 * CLOSEST


def test_the_figure_has_the_windows_their_centres_and_the_part_of_the_image() -> None:
    image = np.random.default_rng(3).integers(0, 255, (*SHAPE, 3), dtype=np.uint8)
    grid = grid_at(150, 200, 20, 0.9)
    figure = overlap_figure(image, grid)
    assert len(figure.layout.shapes) == 9
    assert {shape.x1 - shape.x0 for shape in figure.layout.shapes} == {20}
    assert sorted({shape.x0 for shape in figure.layout.shapes}) == [grid.middle.col + at - 0.5 for at in (-2, 0, 2)]
    others, own = figure.data
    assert len(others.x) + 1 == grid.values
    assert (own.y[0], own.x[0]) == (grid.middle.row + 9.5, grid.middle.col + 9.5)
    # Rows grow downwards on the screen as in the image, and pixels are square.
    assert figure.layout.yaxis.range[0] > figure.layout.yaxis.range[1]
    assert figure.layout.yaxis.scaleanchor == "x"
    (picture,) = figure.layout.images
    assert (picture.sizex, picture.sizey) == (grid.cut.width, grid.cut.height)


def test_at_the_corner_of_the_image_the_cut_ends_with_it() -> None:
    grid = grid_at(0, 399, 20, 0.5)
    assert (grid.cut.row, grid.cut.col + grid.cut.width) == (0, 400)
    assert len(grid.neighbours()) == 4


def test_a_window_beside_the_grid_is_refused() -> None:
    with pytest.raises(ValueError, match=r"\(3, 4\) is not on a grid of step 2"):
        window_grid(SHAPE, Box(3, 4, 20, 20), 2)
