"""A cloud seen from above."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereolag.geometry.scene import seen_from_above

GREY = np.uint8([[100, 100, 100]])


def test_points_fall_into_their_cells_whatever_their_height() -> None:
    points = np.array([[0, 5, 1], [0, -5, 1], [9.9, 0, 1], [0, 0, 10.9]])
    colours = np.uint8([[10, 20, 30], [30, 40, 50], [0, 0, 255], [255, 0, 0]])
    view = seen_from_above(points, colours, cells=10)
    assert view.picture.shape == (10, 10, 4)
    assert view.cell == pytest.approx(0.99)
    assert (view.left, view.near) == (0, 1)
    assert view.picture[0, 0, :3].tolist() == [20, 30, 40]
    assert view.picture[0, 9, :3].tolist() == [0, 0, 255]
    assert view.picture[9, 0, :3].tolist() == [255, 0, 0]
    assert np.count_nonzero(view.picture[:, :, 3]) == 3


def test_cells_with_more_points_are_more_opaque() -> None:
    points = np.array([[0.0, 0, 1]] * 40 + [[1, 0, 1]] * 3 + [[2, 0, 1]])
    opacity = seen_from_above(points, GREY.repeat(44, axis=0), cells=3).picture[0, :, 3]
    assert opacity[0] == 255
    assert opacity[0] > opacity[1] > opacity[2] > 0


@given(st.integers(1, 300), st.integers(1, 64), st.integers(0, 2**32 - 1))
def test_every_point_is_in_the_picture(count: int, cells: int, seed: int) -> None:
    points = np.random.default_rng(seed).normal(0, 5, (count, 3)).astype(np.float32)
    view = seen_from_above(points, GREY.repeat(count, axis=0), cells=cells)
    rows, cols = view.picture.shape[:2]
    assert max(rows, cols) <= cells
    reach = np.array([view.left, view.near]) + view.cell * np.array([cols, rows])
    assert np.all(points[:, [0, 2]] <= reach + 1e-4)
    assert 1 <= np.count_nonzero(view.picture[:, :, 3]) <= count


def test_what_is_no_cloud_is_refused() -> None:
    with pytest.raises(ValueError, match=r"must be \(n, 3\)"):
        seen_from_above(np.empty((0, 3)), np.empty((0, 3), dtype=np.uint8))
    with pytest.raises(ValueError, match="cells is 0"):
        seen_from_above(np.ones((1, 3)), GREY, cells=0)
