"""Sub-pixel fits: the compiled one equals the plain formula, and both find the top of a known hill."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stereolag.stereo.windows.peak_fits import fit_peaks, peak_offset, peak_offsets


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.sampled_from([1, 3]), st.floats(-0.5, 0.9))
def test_compiled_equals_plain(seed: int, rows: int, lowest: float) -> None:
    rng = np.random.default_rng(seed)
    around = rng.uniform(lowest, 0.95, (rows, 3, 7, 11)).astype(np.float32)
    # The series is not made for scores of less than a fiftieth of the peak.
    around[(around > 0) & (around < 0.02)] = 0.02
    around[rng.random(around.shape) < 0.05] = np.nan
    around[rows // 2, 1] = rng.uniform(0.95, 1, (7, 11))
    plain = peak_offsets(around) if rows == 3 else (np.zeros((7, 11)), peak_offset(*around[0]))
    for fast, slow in zip(fit_peaks(around), plain, strict=True):
        np.testing.assert_allclose(fast, slow, atol=3e-3)


@pytest.mark.parametrize("dy", [-0.4, 0.0, 0.25])
@pytest.mark.parametrize("dx", [-0.5, 0.1, 0.3])
@pytest.mark.parametrize("tilt", [0.0, 0.15])
def test_the_top_of_an_oblique_gaussian_is_found(dy: float, dx: float, tilt: float) -> None:
    y, x = np.mgrid[-1:2, -1:2]
    hill = np.exp(-0.2 * (y - dy) ** 2 - 0.3 * (x - dx) ** 2 - tilt * (y - dy) * (x - dx))
    around = hill.astype(np.float32)[:, :, None, None]
    for found in (peak_offsets(around), fit_peaks(around)):
        assert found[0].item() == pytest.approx(dy, abs=1e-3)
        assert found[1].item() == pytest.approx(dx, abs=1e-3)


@pytest.mark.parametrize("scores", [(np.nan, 1.0, 0.5), (1.0, 1.0, 1.0), (0.5, 1.0, np.nan)])
def test_nothing_to_fit_is_no_offset(scores: tuple[float, float, float]) -> None:
    around = np.array(scores, dtype=np.float32).reshape(1, 3, 1, 1)
    assert fit_peaks(around)[1].item() == 0
    assert peak_offset(*around[0]).item() == 0


def test_negative_scores_are_fitted_by_a_parabola() -> None:
    around = np.array([-0.1, 0.4, 0.3], dtype=np.float32).reshape(1, 3, 1, 1)
    parabola = (-0.1 - 0.3) / (2 * (-0.1 - 0.8 + 0.3))
    assert fit_peaks(around)[1].item() == pytest.approx(parabola, abs=1e-6)
