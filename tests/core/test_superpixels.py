"""An image cut into patches of similar colour."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stereolag.stereo.finishing.surfaces import (
    borders,
    choose_patches,
    choose_patches_reference,
    mean_centres,
    neighbours,
    superpixels,
)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 999), st.sampled_from([1, 3]), st.integers(1, 30), st.integers(1, 40), st.integers(3, 12))
def test_pixels_choose_as_by_the_formula(seed: int, channels: int, height: int, width: int, side: int) -> None:
    rng = np.random.default_rng(seed)
    planes = rng.integers(0, 255, (channels, height, width)).astype(np.float32)
    grid = max(1, round(height / side)), max(1, round(width / side))
    count = grid[0] * grid[1]
    centres = np.column_stack(
        [
            *rng.integers(0, 255, (channels, count)),
            rng.uniform(0, height, count),
            rng.uniform(0, width, count),
        ]
    ).astype(np.float32)
    weights = np.float32(0.001), np.float32(1 / side**2)
    labels = np.full((height, width), -1, np.int32)
    choose_patches(planes, centres, grid, weights, 0, grid[0], labels)
    np.testing.assert_array_equal(labels, choose_patches_reference(planes, centres, grid, weights))
    after = mean_centres(planes, labels, centres)
    for patch in range(count):
        inside = labels == patch
        rows, cols = np.nonzero(inside)
        mean = [*planes[:, inside].mean(axis=1), rows.mean(), cols.mean()] if inside.any() else centres[patch]
        np.testing.assert_allclose(after[patch], mean, rtol=1e-5)


def test_patches_keep_to_an_edge_of_colour() -> None:
    y, x = np.indices((60, 90))
    bright = x + y // 2 > 60
    planes = np.where(bright, 200, 40).astype(np.float32)[None]
    found = superpixels(planes, 15, 20)
    for patch in range(len(found.centres)):
        assert len(np.unique(bright[found.labels == patch])) <= 1


@pytest.mark.parametrize("shape", [(1, 1), (3, 50), (40, 2), (33, 47)])
def test_any_size_is_cut(shape: tuple[int, int]) -> None:
    found = superpixels(np.zeros((3, *shape), np.float32), 15, 20)
    assert found.labels.shape == shape
    assert set(np.unique(found.labels)) <= set(range(found.grid[0] * found.grid[1]))
    assert np.isfinite(found.centres).all()


def test_borders_are_those_counted() -> None:
    rng = np.random.default_rng(0)
    found = superpixels(rng.integers(0, 255, (3, 60, 80)).astype(np.float32), 10, 10)
    labels, near = found.labels, neighbours(found.grid)
    long = borders(labels, found.grid)
    pairs = np.concatenate(
        [
            np.stack([labels[:, 1:].ravel(), labels[:, :-1].ravel()]),
            np.stack([labels[1:].ravel(), labels[:-1].ravel()]),
        ],
        axis=1,
    )
    # Patches that touch are at most three apart on the grid: the loop has no room for more, and needs none.
    for patch in range(len(near)):
        for number, other in enumerate(near[patch]):
            if other != patch:
                met = ((pairs == [[patch], [other]]).all(axis=0) | (pairs == [[other], [patch]]).all(axis=0)).sum()
                assert long[patch, number, 0] == met
    assert long[:, :, 0].sum() == 2 * (pairs[0] != pairs[1]).sum()
