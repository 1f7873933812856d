"""Pictures of a flow: the published colours, arrows where there is motion, and a matching legend."""

from __future__ import annotations

import colorsys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereolag.figures.pictures import (
    colour_wheel,
    flow_colours,
    largest_motion,
    with_arrows,
)


def one(dy, dx, largest=1.0):
    return flow_colours(np.full((1, 1), dy, np.float32), np.full((1, 1), dx, np.float32), largest)[0, 0]


def test_directions_have_the_colours_of_the_benchmark():
    # Right is red, down yellow, left cyan, up violet, as on the wheel of the published code.
    assert tuple(one(0, 1)) == (255, 0, 0, 255)
    assert tuple(one(0, 0)) == (255, 255, 255, 255)
    hues = [colorsys.rgb_to_hsv(*(one(dy, dx)[:3] / 255))[0] * 360 for dy, dx in ((1, 0), (0, -1), (-1, 0))]
    assert 45 < hues[0] < 70 and 170 < hues[1] < 215 and 255 < hues[2] < 300


def test_no_motion_known_is_transparent_and_too_much_is_darker():
    assert one(np.nan, 1)[3] == 0 and one(1, np.nan)[3] == 0
    assert one(0, 5)[0] < one(0, 1)[0]
    with pytest.raises(ValueError, match="largest is 0"):
        one(0, 0, 0)


@given(st.floats(-np.pi, np.pi), st.floats(0.05, 0.95), st.floats(0.1, 100))
def test_longer_motion_is_never_whiter_and_the_unit_does_not_matter(angle, length, unit):
    down, right = np.sin(angle), np.cos(angle)
    short, long = one(0.9 * length * down, 0.9 * length * right), one(length * down, length * right)
    assert (short.astype(int) >= long.astype(int) - 1).all()
    scaled = one(length * down * unit, length * right * unit, unit)
    assert np.abs(scaled.astype(int) - long).max() <= 2


def test_the_rim_holds_nearly_all_motions():
    rng = np.random.default_rng(0)
    flow = rng.normal(0, 7, (2, 50, 60)).astype(np.float32)
    flow[:, :5] = np.nan
    rim = largest_motion((flow[0], flow[1]))
    assert 0.985 < (np.hypot(*flow)[5:] <= rim).mean() < 1
    assert largest_motion((np.full((3, 3), np.nan, np.float32),) * 2) == 1


def test_arrows_stand_where_there_is_motion_and_nowhere_else():
    image = np.full((96, 120), 128, np.uint8)
    dy, dx = np.zeros((96, 120), np.float32), np.full((96, 120), 8, np.float32)
    dx[:, 60:] = np.nan
    drawn = with_arrows(image, dy, dx, spacing=24)
    changed = (drawn != 128).any(axis=2)
    assert changed[:, :60].any() and not changed[:, 66:].any()
    rows = np.nonzero(changed)[0]
    assert set((rows - 12) % 24) <= {*range(6), *range(18, 24)}
    assert changed[12, 12:20].all()
    assert (image == 128).all()


def test_the_legend_shows_the_same_colours():
    wheel = colour_wheel(12.0, 101)
    assert wheel.shape == (101, 101, 4)
    np.testing.assert_allclose(wheel[50, 99, :3].astype(int), one(0, 0.98)[:3].astype(int), atol=3)
    np.testing.assert_allclose(wheel[75, 50, :3].astype(int), one(0.5, 0)[:3].astype(int), atol=3)
    assert wheel[0, 0, 3] == 0
