"""The compiled loops of the template search, compared with the plain formulas beside them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stereolag.templates.score_maps import (
    fill_pearson,
    pearson,
    running_box_energy,
    running_box_energy_reference,
    score_at,
    scores_at,
)


@settings(max_examples=60)
@given(
    st.integers(0, 2**32),
    st.integers(1, 4),
    st.integers(1, 9),
    st.integers(1, 9),
    st.integers(0, 12),
    st.integers(0, 12),
)
def test_running_box_energy_equals_the_formula(
    seed: int, channels: int, height: int, width: int, down: int, across: int
) -> None:
    shape = (channels, height + down, width + across)
    planes = np.random.default_rng(seed).integers(-255, 256, shape).astype(np.float64)
    planes[:, : height + 2, : width + 2] = 77
    energy = running_box_energy(planes, height, width)
    np.testing.assert_allclose(energy, running_box_energy_reference(planes, height, width), rtol=1e-9, atol=1e-6)


@settings(max_examples=40)
@given(st.integers(0, 2**32), st.integers(1, 12), st.integers(1, 12))
def test_compiled_scores_equal_the_formula(seed: int, rows: int, cols: int) -> None:
    random = np.random.default_rng(seed)
    energy = random.uniform(-5, 60, size=(rows + 2, cols + 3))
    energy[0, 0] = 0
    products = random.normal(size=(rows + 2, cols + 3)) * 40
    scores = np.empty((rows + 1, cols + 1), dtype=np.float32)[:rows, :cols]
    fill_pearson(scores, products, energy, 5.0, 0.25)
    expected = pearson(products[:rows, :cols], energy[:rows, :cols], norm=5.0, tolerance=0.25)
    np.testing.assert_allclose(scores, expected, rtol=1e-6)
    assert np.isnan(scores[0, 0])


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64])
@pytest.mark.parametrize("channels", [1, 3])
def test_scores_at_positions_equal_the_formula(dtype: type, channels: int) -> None:
    random = np.random.default_rng(0)
    image = random.integers(0, 256, (30, 40, channels)).astype(dtype)
    image[:12, :12] = 9
    opaque = random.random((6, 7)) < 0.7
    template = random.normal(size=(channels, 6, 7))
    deviations = np.where(opaque, template - template[:, opaque].mean(axis=1)[:, np.newaxis, np.newaxis], 0)
    rows, cols = np.divmod(np.arange(25 * 34), 34)
    scores = scores_at(image, deviations, opaque, rows, cols)
    expected = [score_at(image, deviations, opaque, row, col) for row, col in zip(rows, cols, strict=True)]
    np.testing.assert_allclose(scores, expected, atol=1e-12)
    assert np.isnan(scores[0])
