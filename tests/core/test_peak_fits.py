"""Sub-pixel fits: the compiled fit equals the plain formula, and both find the top of a known hill."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pairs import shifted_pair

from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.stereo.windows.pixels import fit_peaks, fit_peaks_reference
from stereolag.stereo.windows.search import SearchArea
from stereolag.stereo.windows.window_fft import score_surface


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.sampled_from([1, 3]), st.floats(-0.5, 0.9))
def test_compiled_equals_plain(seed: int, rows: int, lowest: float) -> None:
    rng = np.random.default_rng(seed)
    around = rng.uniform(lowest, 0.95, (rows, 3, 7, 11)).astype(np.float32)
    # The series is not accurate for positive scores below a fiftieth of the peak.
    around[(around > 0) & (around < 0.02)] = 0.02
    around[rng.random(around.shape) < 0.05] = np.nan
    around[rows // 2, 1] = rng.uniform(0.95, 1, (7, 11))
    for fast, slow in zip(fit_peaks(around), fit_peaks_reference(around), strict=True):
        np.testing.assert_allclose(fast, slow, atol=3e-3)


@pytest.mark.parametrize("dy", [-0.4, 0.0, 0.25])
@pytest.mark.parametrize("dx", [-0.5, 0.1, 0.3])
@pytest.mark.parametrize("tilt", [0.0, 0.15])
def test_the_top_of_an_oblique_gaussian_is_found(dy: float, dx: float, tilt: float) -> None:
    y, x = np.mgrid[-1:2, -1:2]
    hill = np.exp(-0.2 * (y - dy) ** 2 - 0.3 * (x - dx) ** 2 - tilt * (y - dy) * (x - dx))
    around = hill.astype(np.float32)[:, :, None, None]
    for found in (fit_peaks_reference(around), fit_peaks(around)):
        assert found[0].item() == pytest.approx(dy, abs=1e-3)
        assert found[1].item() == pytest.approx(dx, abs=1e-3)


@pytest.mark.parametrize("scores", [(np.nan, 1.0, 0.5), (1.0, 1.0, 1.0), (0.5, 1.0, np.nan)])
def test_nothing_to_fit_is_no_offset(scores: tuple[float, float, float]) -> None:
    around = np.array(scores, dtype=np.float32).reshape(1, 3, 1, 1)
    assert fit_peaks(around)[1].item() == 0
    assert fit_peaks_reference(around)[1].item() == 0


def test_negative_scores_are_fitted_by_a_parabola() -> None:
    around = np.array([-0.1, 0.4, 0.3], dtype=np.float32).reshape(1, 3, 1, 1)
    parabola = (-0.1 - 0.3) / (2 * (-0.1 - 0.8 + 0.3))
    assert fit_peaks(around)[1].item() == pytest.approx(parabola, abs=1e-6)


@pytest.mark.parametrize("vertical", [0, 2])
@pytest.mark.parametrize("dtype", [np.uint8, np.float32])
def test_the_surface_of_one_window_is_fitted_as_the_map_is(vertical: int, dtype: type) -> None:
    """The explanation of a match and the map share one fit, so they cannot disagree."""
    left, right = shifted_pair(40, 70, 0.3 * bool(vertical), -5.4, dtype=dtype)
    search = SearchArea.rectified(12, 0, vertical)
    matcher = CorrelationMatcher(window_size=9, search=search)
    result, query = matcher.compute(left, right), matcher.query(left, right)
    for row, col in ((8, 30), (20, 41), (29, 55)):
        surface = score_surface(query, row, col)
        dy, dx = np.unravel_index(np.nanargmax(surface), surface.shape)
        rows = slice(dy - 1, dy + 2) if vertical else slice(0, 1)
        around = surface[rows, dx - 1 : dx + 2, None, None].astype(np.float32)
        offset_dy, offset_dx = fit_peaks(around)
        pixel = row + 4, col + 4
        assert dx + query.lags.dx_first + offset_dx.item() == pytest.approx(result.dx[pixel], abs=1e-5)
        assert dy + query.lags.dy_first + offset_dy.item() == pytest.approx(result.dy[pixel], abs=1e-5)
