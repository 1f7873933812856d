"""The windows' loops against plain formulas: sums, both engines, peak fits, and the spread over pixels."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pairs import shifted_pair

from stereolag.stereo.finishing.stages import NO_MATCH
from stereolag.stereo.matcher import Reason
from stereolag.stereo.windows.engines import match_windows, score_surface
from stereolag.stereo.windows.matcher import CorrelationMatcher, cheaper_engine, find_matches
from stereolag.stereo.windows.norms import WindowNorms, Windows, describe_windows, describe_windows_reference
from stereolag.stereo.windows.pixels import (
    fit_peaks,
    fit_peaks_reference,
    spread_over_pixels,
    spread_over_pixels_reference,
)
from stereolag.stereo.windows.scores import right_view_reference, score_volume_reference
from stereolag.stereo.windows.search import LagRange, Score, SearchArea, WindowMatches, WindowQuery


@pytest.fixture
def rng():
    return np.random.default_rng(20)


SCORES = ["zncc", "ncc", "cross"]
DTYPES = [np.uint8, np.uint16, np.float32, np.float64]


def picture(rng, shape, dtype):
    noise = rng.normal(size=shape)
    noise = (noise + np.roll(noise, 1, 0) + np.roll(noise, 1, 1)) * 20
    if np.issubdtype(dtype, np.integer):
        return np.clip(noise + 128, 0, 255).astype(dtype) * np.asarray(257 if dtype == np.uint16 else 1, dtype)
    return noise.astype(dtype)


def at_lag(volume, search, dy, dx):
    """Return each window's score from the volume at its own lag; NaN outside the range."""
    row, col = dy.astype(int) - search.dy_first, dx.astype(int) - search.dx_first
    inside = (row >= 0) & (row < search.rows) & (col >= 0) & (col < search.cols)
    i, j = np.indices(dy.shape)
    return np.where(inside, volume[np.where(inside, row, 0), np.where(inside, col, 0), i, j], np.nan)


def assert_equals_reference(query):
    found = match_windows(replace(query, runner_up=True))
    volume, search = score_volume_reference(query), query.lags
    # Plain correlation has no scale of its own: compare it with the largest value the brightest windows could have.
    brightest = [max(1.0, query.window_size * float(np.ptp(one.astype(float)))) for one in (query.left, query.right)]
    tolerance = 4e-6 * (np.prod(brightest) if query.score == "cross" else 1)
    none = np.isnan(volume).all((0, 1))
    best = np.where(none, np.nan, np.nanmax(np.where(np.isnan(volume), -np.inf, volume), (0, 1)))
    np.testing.assert_array_equal(np.isnan(found.score), none)
    np.testing.assert_allclose(found.score, best, atol=tolerance, rtol=0)
    dy, dx = found.dy, found.dx
    np.testing.assert_allclose(np.where(none, np.nan, at_lag(volume, search, dy, dx)), best, atol=tolerance, rtol=0)
    for up in (-1, 0, 1) if search.rows > 1 and len(found.around) > 1 else (0,):
        for aside in (-1, 0, 1):
            expected = np.where(none, np.nan, at_lag(volume, search, dy + up, dx + aside))
            actual = found.around[up + len(found.around) // 2, aside + 1]
            np.testing.assert_allclose(actual, expected, atol=tolerance, rtol=0, err_msg=f"{up}, {aside}")
    lag_dy, lag_dx = np.mgrid[search.dy_first : search.dy_last + 1, search.dx_first : search.dx_last + 1]
    far = np.maximum(abs(lag_dy[..., None, None] - dy), abs(lag_dx[..., None, None] - dx)) > 1
    elsewhere = np.where(far & ~np.isnan(volume), volume, -np.inf).max((0, 1))
    elsewhere = np.where(none | np.isinf(elsewhere), np.nan, elsewhere)
    np.testing.assert_allclose(found.runner_up, elsewhere, atol=tolerance, rtol=0)


@st.composite
def cases(draw):
    window_size = draw(st.integers(2, 9))
    height, width = draw(st.integers(window_size, 22)), draw(st.integers(window_size, 40))
    dy_first, dx_first = draw(st.integers(-8, 8)), draw(st.integers(-45, 45))
    search = LagRange(dy_first, dy_first + draw(st.integers(0, 6)), dx_first, dx_first + draw(st.integers(0, 50)))
    dtype = draw(st.sampled_from(DTYPES))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    left, right = picture(rng, (height, width), dtype), picture(rng, (height, width), dtype)
    for image in (left, right):
        for _ in range(draw(st.integers(0, 2))):
            y, x = draw(st.integers(0, height - 1)), draw(st.integers(0, width - 1))
            image[y:, x:] = draw(st.sampled_from([0, 1, 200]))
    step, score = draw(st.integers(1, window_size + 1)), draw(st.sampled_from(SCORES))
    return WindowQuery(left, right, window_size, step, search, score)


@given(cases())
@settings(max_examples=50)
def test_equals_the_plain_formula(query):
    assert_equals_reference(query)


def test_a_faint_picture_beside_a_bright_one_loses_nothing():
    left = np.array([[35980, 0], [37265, 0]], np.uint16)
    right = np.array([[0, 1], [0, 1]], np.uint16)
    assert_equals_reference(WindowQuery(left, right, 2, 1, LagRange(0, 0, 0, 0), "cross"))


@pytest.mark.parametrize("columns_in_cache", [1, 20_000])
def test_tiles_and_bands_leave_no_seam(rng, monkeypatch, columns_in_cache):
    monkeypatch.setattr("stereolag.stereo.windows.engines.CACHE_BYTES", columns_in_cache)
    monkeypatch.setattr("stereolag.stereo.windows.engines.BAND_CELLS", 1.0)
    left, right = picture(rng, (24, 90), np.uint8), picture(rng, (24, 90), np.uint8)
    assert_equals_reference(WindowQuery(left, right, 6, 1, LagRange(-1, 1, -20, 13), "zncc"))


@pytest.mark.parametrize("engine", ["window_sums", "fft"])
@pytest.mark.parametrize("dtype", [np.uint16, np.float32, np.float64])
def test_a_mean_ten_thousand_times_the_contrast_hides_nothing(rng, dtype, engine):
    scene = 20_000 + 2 * rng.normal(size=(50, 110))
    scene = scene.round().astype(dtype) if dtype != np.float64 else scene
    left, right = scene[:, 5:95].copy(), scene[:, 10:100].copy()
    left[:, 45:], right[:, 40:] = left[:, 45:] // 2, right[:, 40:] // 2  # no single mean suits both halves
    found = find_matches(WindowQuery(left, right, 9, 1, LagRange(0, 0, -12, 12), "zncc"), engine)
    half = np.s_[:, 12:36]
    assert (found.dx[half] == -5).all()
    np.testing.assert_allclose(found.score[half], 1, atol=1e-4)


def test_equal_scores_go_to_the_shortest_displacement(rng):
    row = np.tile(rng.integers(0, 255, 8, dtype=np.uint8), 10)
    image = np.tile(row, (30, 1))
    found = match_windows(WindowQuery(image, image, 8, 1, LagRange(-3, 3, -20, 20), "zncc"))
    assert not found.dx.any() and not found.dy.any()
    # The match is as far to the left as to the right: the left one comes first by the documented order.
    shifted = np.roll(image, 4, axis=1)
    found = match_windows(WindowQuery(image, shifted, 8, 1, LagRange(0, 0, -20, 20), "zncc"))
    assert (found.dx[:, 10:-10] == -4).all()
    assert found.runner_up is None


@pytest.mark.parametrize("score", SCORES)
@pytest.mark.parametrize("search", [LagRange(0, 0, -25, 0), LagRange(0, 0, -5, 40), LagRange(0, 0, -200, 200)])
def test_right_matches_are_the_best_of_the_other_view(rng, score, search):
    left, right = picture(rng, (20, 70), np.uint8), picture(rng, (20, 70), np.uint8)
    found = match_windows(WindowQuery(left, right, 7, 1, search, score, runner_up=True, right_matches=True))
    volume = score_volume_reference(WindowQuery(left, right, 7, 1, search, score))
    plain = right_view_reference(volume, search, NO_MATCH)
    np.testing.assert_array_equal(found.right_dx == NO_MATCH, plain == NO_MATCH)
    assert (found.right_dx == plain).mean() > 0.99  # scores within the precision of float32 are equal


def test_large_windows_of_bytes_do_not_overflow():
    image = np.full((300, 300), 255, np.uint8)
    image[::7, ::5] = 0
    for window_size in (181, 182, 260):
        found = match_windows(WindowQuery(image, image, window_size, 20, LagRange(0, 0, -3, 3), "ncc"))
        assert (found.dx == 0).all()
        np.testing.assert_allclose(found.score, 1, atol=1e-6)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"window_size": 31}, "window_size is 31 px"),
        ({"step": 0}, "step is 0"),
        ({"score": "sad"}, "'sad'"),
        ({"lags": LagRange(0, 1, 0, 0), "right_matches": True}, "no vertical search"),
        ({"right": np.zeros((30, 41), np.uint8)}, "one size"),
        ({"right": np.zeros((30, 40), np.float32)}, "type"),
        (
            {"left": np.zeros((400, 400)), "right": np.zeros((400, 400)), "lags": LagRange(-200, 200, -200, 200)},
            "65535",
        ),
    ],
)
def test_bad_settings_are_named(rng, change, message):
    image = picture(rng, (30, 40), np.uint8)
    good = WindowQuery(image, image, 7, 1, LagRange(0, 0, -5, 0))
    with pytest.raises(ValueError, match=message):
        match_windows(replace(good, **change))
    with pytest.raises(ValueError, match="Only window sums"):
        find_matches(replace(good, right_matches=True), "fft")
    with pytest.raises(ValueError, match="before its start"):
        LagRange(0, 0, 5, 4)


@pytest.mark.parametrize("dtype", [np.uint8, np.float64])
@pytest.mark.parametrize("norm", [0.0, 7.0])
@pytest.mark.parametrize("keep_mean", [False, True])
@pytest.mark.parametrize(("window", "step"), [(3, 1), (8, 1), (5, 3)])
def test_windows_are_described_as_by_the_formula(rng, dtype, norm, keep_mean, window, step):
    image = picture(rng, (30, 40), dtype)
    image[5:20, 5:25] = 77
    share = 0.0 if keep_mean else 1 / window**2
    shape = [(side - window) // step + 1 for side in image.shape]
    total = np.zeros(shape, np.int32 if dtype == np.uint8 else np.float64)
    inverse, texture = np.zeros((2, *shape), np.float32)
    there = 0, shape[0], 0
    norms = WindowNorms(window, step, share, norm, floor=0.25)
    describe_windows(image, norms, 0, Windows(total, inverse), there, texture)
    plain = describe_windows_reference(image, norms)
    for found, expected in zip((total, inverse, texture), plain, strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-6)
    assert np.isnan(inverse[shape[0] // 3, shape[1] // 3])


def test_the_cost_model_knows_where_each_engine_pays() -> None:
    strip, square = LagRange(0, 0, -63, 0), LagRange(-60, 60, -60, 60)
    for window_size, step, lags in ((20, 1, strip), (20, 20, strip), (20, 1, square)):
        assert cheaper_engine((400, 881), window_size, step, lags) == "window_sums"
    assert cheaper_engine((400, 881), 40, 40, square) == "fft"


@settings(max_examples=30)
@given(
    seed=st.integers(0, 1000),
    dtype=st.sampled_from(DTYPES),
    window_size=st.integers(3, 14),
    step=st.integers(1, 9),
    lags=st.tuples(st.integers(-6, 0), st.integers(0, 6), st.integers(-12, 3), st.integers(3, 8)),
    score=st.sampled_from(SCORES),
    flat=st.booleans(),
    sky=st.booleans(),
)
def test_both_engines_give_the_same_to_the_bit(seed, dtype, window_size, step, lags, score, flat, sky):
    """With ncc, 12 % of a photograph with much sky used to differ: each engine had its own ties and flatness rules."""
    left, right = (image.copy() for image in shifted_pair(36, 52, 1, -3, dtype=dtype, seed=seed))
    if flat:
        left[5:25, 10:30] = right[8:28, 12:40] = 100
    if sky:
        faint = np.random.default_rng(seed).normal(200, 0.7, (20, 52)) * (np.asarray(left).max() / 255)
        left[:20], right[:20] = faint, np.roll(faint, -3, axis=1)
    query = WindowQuery(left, right, window_size, step, LagRange(*lags), score, runner_up=True)
    sums, fft = find_matches(query, "window_sums"), find_matches(query, "fft")
    for name in ("dy", "dx", "score", "around", "texture", "runner_up"):
        np.testing.assert_array_equal(getattr(sums, name), getattr(fft, name), err_msg=name)


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
    monkeypatch.setattr("stereolag.stereo.windows.engines.MAX_LAGS", 100)
    many = find_matches(query, "fft")
    for name in ("dy", "dx", "score", "around"):
        np.testing.assert_array_equal(getattr(many, name), getattr(few, name), err_msg=name)
    np.testing.assert_allclose(many.runner_up, few.runner_up, atol=1.1 * 2**10 / 2**29)
    assert cheaper_engine((800, 900), 16, 8, LagRange(-200, 200, -200, 200)) == "fft"
    large = shifted_pair(100, 320, 0, -20)
    result = CorrelationMatcher(window_size=20, overlap=0, search=SearchArea.centred(290)).compute(*large)
    assert abs(np.nanmedian(result.disparity) - 20) < 0.1


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
    assert [offset.item() for offset in fit_peaks(around)] == pytest.approx([dy, dx], abs=1e-3)


@settings(max_examples=30)
@given(
    seed=st.integers(0, 999),
    shape=st.tuples(st.integers(9, 24), st.integers(9, 30)),
    window_size=st.integers(3, 9),
    step=st.integers(1, 5),
    vertical=st.integers(0, 2),
    circular=st.booleans(),
    refusals=st.booleans(),
)
def test_pixels_learn_from_their_window_as_by_the_formula(seed, shape, window_size, step, vertical, circular, refusals):
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


@pytest.mark.parametrize("dx", [-3, 0])
def test_the_sign_turns_once_and_zero_has_none(dx: int) -> None:
    image = np.zeros((12, 30), np.uint8)
    query = WindowQuery(image, image, 5, 1, LagRange(0, 0, -8, 8))
    around = np.full((1, 3, *query.grid), 0.5, np.float32)
    around[0, 1] = 1
    lags = np.full(query.grid, dx, np.int16)
    matches = WindowMatches(np.zeros_like(lags), lags, around[0, 1], around, np.full(query.grid, 9, np.float32))
    found = spread_over_pixels(matches, query, asked=query.lags, flat=1.0, refused=None)
    assert (found.disparity[2:-2, 10:-10] == -dx).all()
    assert not np.signbit(found.disparity[found.disparity == 0]).any()
