"""From windows to pixels: every pixel takes the answer of its window's cell, or a reason for being blank."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stereolag.stereo.matcher import Reason
from stereolag.stereo.windows.pixels import spread_over_pixels, spread_over_pixels_reference
from stereolag.stereo.windows.search import LagRange, WindowMatches, WindowQuery


@settings(max_examples=60)
@given(
    seed=st.integers(0, 999),
    shape=st.tuples(st.integers(9, 24), st.integers(9, 30)),
    window_size=st.integers(3, 9),
    step=st.integers(1, 5),
    vertical=st.integers(0, 2),
    circular=st.booleans(),
    refusals=st.booleans(),
)
def test_pixels_learn_from_their_window_as_by_the_formula(
    seed: int, shape: tuple[int, int], window_size: int, step: int, vertical: int, circular: bool, refusals: bool
) -> None:
    rng = np.random.default_rng(seed)
    image = np.zeros(shape, np.uint8)
    asked = LagRange(-vertical, vertical, -6, 2)
    query = WindowQuery(image, image, window_size, step, asked, circular=circular)
    grid = query.grid
    around = rng.uniform(-0.2, 0.9, (3 if vertical else 1, 3, *grid)).astype(np.float32)
    around[len(around) // 2, 1] = rng.uniform(0.9, 1, grid)
    around[:, :, rng.random(grid) < 0.1] = np.nan
    matches = WindowMatches(
        dy=rng.integers(-vertical - 1, vertical + 2, grid).astype(np.int16) * bool(vertical),
        dx=rng.integers(-7, 4, grid).astype(np.int16),
        score=around[len(around) // 2, 1],
        around=around,
        texture=rng.integers(0, 5, grid).astype(np.float32),
    )
    refused = rng.choice([Reason.MEASURED, Reason.LEFT_RIGHT], grid).astype(np.uint8) if refusals else None
    found = spread_over_pixels(matches, query, asked=asked, flat=1.0, refused=refused)
    plain = spread_over_pixels_reference(matches, query, asked=asked, flat=1.0, refused=refused)
    for ours, expected in zip(found, plain, strict=True):
        np.testing.assert_array_equal(ours, expected)


@pytest.mark.parametrize("dx", [-3, 0, 2])
def test_the_sign_turns_once(dx: int) -> None:
    image = np.zeros((12, 30), np.uint8)
    query = WindowQuery(image, image, 5, 1, LagRange(0, 0, -8, 8))
    around = np.full((1, 3, *query.grid), 0.5, np.float32)
    around[0, 1] = 1
    lags = np.full(query.grid, dx, np.int16)
    matches = WindowMatches(np.zeros_like(lags), lags, around[0, 1], around, np.full(query.grid, 9, np.float32))
    found = spread_over_pixels(matches, query, asked=query.lags, flat=1.0, refused=None)
    assert (found.disparity[2:-2, 10:-10] == -dx).all()
    assert not np.signbit(found.disparity[found.disparity == 0]).any()
