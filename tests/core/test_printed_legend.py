"""A picture with its legend: the map unchanged, and the colours of the strip at their values."""

from __future__ import annotations

import numpy as np
import pytest

from stereolag.figures.legends import with_legend
from stereolag.figures.pictures import NO_ANSWER, VIRIDIS


def colours(picture: np.ndarray) -> set[tuple[int, ...]]:
    return {tuple(colour) for colour in np.unique(picture.reshape(-1, 3), axis=0).tolist()}


@pytest.mark.parametrize("shape", [(40, 30), (300, 360), (200, 901), (100, 2700)])
def test_the_map_is_kept_pixel_for_pixel_above_the_legend(shape):
    picture = np.random.default_rng(0).integers(0, 256, (*shape, 3), dtype=np.uint8)
    page = with_legend(picture, 0, 64, VIRIDIS, "disparity, px")
    assert page.shape[1] == max(360, shape[1])
    left = (page.shape[1] - shape[1]) // 2
    np.testing.assert_array_equal(page[: shape[0], left : left + shape[1]], picture)
    strip = colours(page[shape[0] :])
    assert {(255, 255, 255), NO_ANSWER, tuple(VIRIDIS[0].tolist()), tuple(VIRIDIS[-1].tolist())} <= strip


@pytest.mark.parametrize(("low", "high"), [(0, 64), (-12, 36), (1.5, 1.6), (0, 4), (3, 1003), (-0.002, 0.001)])
def test_ticks_stand_under_the_colours_of_their_values(low, high):
    page = with_legend(np.zeros((10, 900, 3), np.uint8), low, high, VIRIDIS, "")[10:]
    ends = [np.flatnonzero((row == VIRIDIS[0]).all(axis=1)) for row in page]
    bar = max(row for row, columns in enumerate(ends) if columns.size)
    ticks = np.flatnonzero((page[bar + 3] == 30).all(axis=1))
    assert 3 <= len(ticks) <= 9
    np.testing.assert_allclose(np.diff(ticks), np.diff(ticks).mean(), atol=1)
    assert ticks.min() >= 24
    assert ticks.max() <= 876
