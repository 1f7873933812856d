"""Two engines, one answer; and a cost model that takes the cheaper one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pairs import shifted_pair
from stereolag.stereo.windows.matching import cheaper_engine, find_matches

from stereolag.stereo.windows.search import LagRange

IMAGE = (400, 881)


def test_the_cost_model_knows_where_each_engine_pays() -> None:
    strip, square = LagRange(0, 0, -63, 0), LagRange(-60, 60, -60, 60)
    assert cheaper_engine(IMAGE, 20, 1, strip) == "window_sums"
    assert cheaper_engine(IMAGE, 20, 20, strip) == "window_sums"
    assert cheaper_engine(IMAGE, 20, 1, square) == "window_sums"
    assert cheaper_engine(IMAGE, 40, 40, square) == "fft"


@settings(max_examples=30)
@given(
    seed=st.integers(0, 1000),
    dtype=st.sampled_from([np.uint8, np.uint16, np.float32, np.float64]),
    window_size=st.integers(3, 14),
    step=st.integers(1, 9),
    lags=st.tuples(st.integers(-6, 0), st.integers(0, 6), st.integers(-12, 3), st.integers(3, 8)),
    score=st.sampled_from(["zncc", "ncc", "cross"]),
    flat=st.booleans(),
)
def test_both_engines_agree(
    seed: int,
    dtype: type,
    window_size: int,
    step: int,
    lags: tuple[int, int, int, int],
    score: str,
    flat: bool,
) -> None:
    left, right = (image.copy() for image in shifted_pair(36, 52, 1, -3, dtype=dtype, seed=seed))
    if flat:
        left[5:25, 10:30] = right[8:28, 12:40] = 100
    found = [
        find_matches(
            left,
            right,
            engine=engine,
            score=score,
            window_size=window_size,
            step=step,
            lags=LagRange(*lags),
            circular=False,
            runner_up=True,
        )
        for engine in ("window_sums", "fft")
    ]
    sums, fft = found
    scale = np.nanmax(np.abs(fft.score)) if np.isfinite(fft.score).any() else 1
    np.testing.assert_allclose(sums.score, fft.score, atol=2e-5 * max(1, scale))
    np.testing.assert_allclose(sums.texture, fft.texture, atol=1e-3 * max(1, np.max(fft.texture)))
    # Where two places are as good as equal, rounding may choose either.
    clear = (fft.score - np.nan_to_num(fft.runner_up, nan=-np.inf)) > 1e-4 * max(1, scale)
    around_peak = np.nan_to_num(fft.around, nan=-np.inf)
    middle = around_peak.shape[0] // 2
    rivals = np.delete(around_peak.reshape(-1, *fft.score.shape), middle * 3 + 1, axis=0).max(axis=0)
    clear &= fft.score - rivals > 1e-4 * max(1, scale)
    np.testing.assert_array_equal(sums.dy[clear], fft.dy[clear])
    np.testing.assert_array_equal(sums.dx[clear], fft.dx[clear])
    np.testing.assert_allclose(sums.around[:, :, clear], fft.around[:, :, clear], atol=2e-5 * max(1, scale))
    np.testing.assert_allclose(sums.runner_up[clear], fft.runner_up[clear], atol=2e-5 * max(1, scale))


@pytest.mark.parametrize("engine", ["window_sums", "fft"])
def test_of_equal_places_the_nearest_wins(engine: str) -> None:
    stripes = np.tile(np.array([10, 60, 200, 90], np.uint8), (24, 12))
    found = find_matches(
        stripes,
        stripes,
        engine=engine,
        score="zncc",
        window_size=8,
        step=4,
        lags=LagRange(-4, 4, -9, 9),
        circular=False,
    )
    np.testing.assert_allclose(found.score, 1, atol=1e-6)
    assert not found.dx.any()
    assert not found.dy.any()


@pytest.mark.parametrize("engine", ["window_sums", "fft"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_huge_offset_does_not_hide_the_peak(engine: str, dtype: type) -> None:
    left, right = shifted_pair(40, 60, 0, -5, dtype=np.float64)
    offset = 40 * 1e4
    found = find_matches(
        (left + offset).astype(dtype),
        (right + offset).astype(dtype),
        engine=engine,
        score="zncc",
        window_size=9,
        step=3,
        lags=LagRange(0, 0, -9, 0),
        circular=False,
    )
    assert np.mean(found.dx[:, 5:-2] == -5) == 1
