"""Two engines with one answer, and a cost model that picks the cheaper one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pairs import shifted_pair, texture
from skimage import data

from stereolag.core.inputs import Image
from stereolag.stereo.windows.matcher import CorrelationMatcher, Engine, cheaper_engine, find_matches
from stereolag.stereo.windows.search import LagRange, Score, SearchArea, WindowMatches, WindowQuery
from stereolag.stereo.windows.window_fft import score_surface

IMAGE = (400, 881)


def test_the_cost_model_knows_where_each_engine_pays() -> None:
    strip, square = LagRange(0, 0, -63, 0), LagRange(-60, 60, -60, 60)
    assert cheaper_engine(IMAGE, 20, 1, strip) == "window_sums"
    assert cheaper_engine(IMAGE, 20, 20, strip) == "window_sums"
    assert cheaper_engine(IMAGE, 20, 1, square) == "window_sums"
    assert cheaper_engine(IMAGE, 40, 40, square) == "fft"


def by_both(query: WindowQuery) -> tuple[WindowMatches, WindowMatches]:
    return find_matches(query, "window_sums"), find_matches(query, "fft")


@settings(max_examples=60)
@given(
    seed=st.integers(0, 1000),
    dtype=st.sampled_from([np.uint8, np.uint16]),
    window_size=st.integers(3, 14),
    step=st.integers(1, 9),
    lags=st.tuples(st.integers(-6, 0), st.integers(0, 6), st.integers(-12, 3), st.integers(3, 8)),
    score=st.sampled_from(["zncc", "ncc", "cross"]),
    flat=st.booleans(),
)
def test_both_engines_give_the_same_to_the_bit(
    seed: int, dtype: type, window_size: int, step: int, lags: tuple[int, int, int, int], score: Score, flat: bool
) -> None:
    left, right = (image.copy() for image in shifted_pair(36, 52, 1, -3, dtype=dtype, seed=seed))
    if flat:
        left[5:25, 10:30] = right[8:28, 12:40] = 100
    query = WindowQuery(left, right, window_size, step, LagRange(*lags), score, runner_up=True)
    sums, fft = by_both(query)
    for name in ("dy", "dx", "score", "around", "texture", "runner_up"):
        np.testing.assert_array_equal(getattr(sums, name), getattr(fft, name), err_msg=name)


SEARCHES = {
    "square": (20, 0.95, SearchArea.centred(40)),
    "strip": (11, 0.9, SearchArea.rectified(32)),
    "reach": (15, 0.8, SearchArea.rectified(16, -4, 3)),
    "apart": (16, 0.0, SearchArea.centred(33)),
}


def landscape(part: str, dtype: type) -> tuple[Image, Image]:
    """Return a bright, plain sky above a texture, and the same scene moved by 5 px, with noise."""
    rng = np.random.default_rng(0)
    left = np.linspace(190, 215, 90)[:, None] + rng.normal(0, 0.7, (90, 120))
    left[54:] = texture(36, 120)
    left = np.clip(np.rint(left), 0, 255)[{"whole": np.s_[:], "sky": np.s_[:50]}[part]]
    right = np.clip(np.rint(np.roll(left, -5, axis=1) + rng.normal(0, 1, left.shape)), 0, 255)
    unit = {np.uint8: 1, np.uint16: 257, np.float32: 1 / 255}[dtype]
    return (left * unit).astype(dtype), (right * unit).astype(dtype)


def test_both_engines_agree_on_the_sky_of_a_photograph() -> None:
    left = data.camera()[:120]
    right = np.clip(np.rint(np.roll(left, -5, axis=1) + np.random.default_rng(0).normal(0, 1, left.shape)), 0, 255)
    matcher = CorrelationMatcher(search=SearchArea.centred(40), score="ncc", overlap=0.9)
    sums, fft = (
        matcher.model_copy(update={"engine": engine}).compute(left, right.astype(np.uint8))
        for engine in ("window_sums", "fft")
    )
    np.testing.assert_array_equal(sums.disparity, fft.disparity)
    np.testing.assert_array_equal(sums.reason, fft.reason)


SCORES, TYPES = ("zncc", "ncc", "cross"), (np.uint8, np.uint16, np.float32)


@pytest.mark.parametrize("part", ["whole", "sky"])
@pytest.mark.parametrize(
    ("search", "score", "dtype"),
    [(name, score, TYPES[(row + col) % 3]) for row, name in enumerate(SEARCHES) for col, score in enumerate(SCORES)],
)
def test_both_engines_give_the_same_map(part: str, dtype: type, score: str, search: str) -> None:
    """With ncc, 12 % of a photograph with much sky used to differ: each engine had its own ties and flatness rules."""
    window_size, overlap, area = SEARCHES[search]
    pair = landscape(part, dtype)
    sums, fft = (
        CorrelationMatcher(window_size=window_size, overlap=overlap, search=area, score=score, engine=engine).compute(
            *pair
        )
        for engine in ("window_sums", "fft")
    )
    np.testing.assert_array_equal(sums.reason, fft.reason)
    np.testing.assert_allclose(sums.disparity, fft.disparity, atol=0.01)
    np.testing.assert_allclose(sums.dy, fft.dy, atol=0.01)


@pytest.mark.parametrize("score", ["zncc", "ncc", "cross", "phase"])
def test_the_surface_of_one_window_holds_what_its_match_saw(score: Score) -> None:
    left, right = shifted_pair(40, 60, 1, -3)
    query = WindowQuery(left, right, 9, 3, LagRange(-2, 60, -9, 2), score)
    found = find_matches(query, "fft")
    for row, col in ((0, 0), (4, 7), (10, 17)):
        surface = score_surface(query, 3 * row, 3 * col)
        assert surface.shape == (63, 12)
        assert np.nanmax(surface) == pytest.approx(found.score[row, col], rel=1e-6)
        assert surface[found.dy[row, col] + 2, found.dx[row, col] + 9] == found.score[row, col]
    left[:9, :9] = 50
    assert np.isnan(score_surface(query, 0, 0)).all()


def test_a_search_of_more_lags_than_window_sums_allow_is_the_ffts(monkeypatch: pytest.MonkeyPatch) -> None:
    left, right = shifted_pair(60, 90, 2, -3)
    query = WindowQuery(left, right, 16, 8, LagRange(-9, 9, -20, 20), runner_up=True)
    few = find_matches(query, "fft")
    monkeypatch.setattr("stereolag.stereo.windows.window_fft.MOST_LAGS", 100)
    many = find_matches(query, "fft")
    for name in ("dy", "dx", "score", "around"):
        np.testing.assert_array_equal(getattr(many, name), getattr(few, name), err_msg=name)
    np.testing.assert_allclose(many.runner_up, few.runner_up, atol=1.1 * 2**10 / 2**29)
    assert cheaper_engine((800, 900), 16, 8, LagRange(-200, 200, -200, 200)) == "fft"
    large = shifted_pair(100, 320, 0, -20)
    result = CorrelationMatcher(window_size=20, overlap=0, search=SearchArea.centred(290)).compute(*large)
    assert abs(np.nanmedian(result.disparity) - 20) < 0.1


def test_matches_of_the_right_windows_are_not_to_be_had_by_fft() -> None:
    image = np.zeros((20, 30), np.uint8)
    with pytest.raises(ValueError, match="Only window sums"):
        find_matches(WindowQuery(image, image, 5, 1, LagRange(0, 0, -5, 0), right_matches=True), "fft")


@pytest.mark.parametrize("engine", ["window_sums", "fft"])
def test_of_equal_places_the_nearest_wins(engine: Engine) -> None:
    stripes = np.tile(np.array([10, 60, 200, 90], np.uint8), (24, 12))
    found = find_matches(WindowQuery(stripes, stripes, 8, 4, LagRange(-4, 4, -9, 9)), engine)
    np.testing.assert_allclose(found.score, 1, atol=1e-6)
    assert not found.dx.any()
    assert not found.dy.any()


@pytest.mark.parametrize("engine", ["window_sums", "fft"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_huge_offset_does_not_hide_the_peak(engine: Engine, dtype: type) -> None:
    left, right = shifted_pair(40, 60, 0, -5, dtype=np.float64)
    offset = 40 * 1e4
    images = (image.astype(dtype) for image in (left + offset, right + offset))
    found = find_matches(WindowQuery(*images, 9, 3, LagRange(0, 0, -9, 0)), engine)
    assert np.mean(found.dx[:, 5:-2] == -5) == 1
