"""The compiled correlation against the plain formula, for sizes, types, windows, steps, lag ranges and scores."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stereolag.stereo.windows.prepared_pair import NO_RIGHT_MATCH
from stereolag.stereo.windows.scores import describe_windows, describe_windows_reference, score_volume_reference
from stereolag.stereo.windows.search import LagRange, WindowQuery
from stereolag.stereo.windows.window_sums import match_windows, right_view_reference


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
    left, right, search = query.left, query.right, query.lags
    window_size, score = query.window_size, query.score
    volume = score_volume_reference(query)
    # Plain correlation has no scale of its own: compare it with the largest value the brightest windows could have.
    unit = 1.0
    if score == "cross":
        unit = max(1.0, window_size * float(np.ptp(left.astype(float)))) * max(
            1.0, window_size * float(np.ptp(right.astype(float)))
        )
    tolerance = 4e-6 * unit
    none = np.isnan(volume).all((0, 1))
    best = np.where(none, np.nan, np.nanmax(np.where(np.isnan(volume), -np.inf, volume), (0, 1)))
    np.testing.assert_array_equal(np.isnan(found.score), none)
    np.testing.assert_allclose(found.score, best, atol=tolerance, rtol=0)
    dy, dx = found.dy, found.dx
    there = np.where(none, np.nan, at_lag(volume, search, dy, dx))
    np.testing.assert_allclose(there, best, atol=tolerance, rtol=0)
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
    return found


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
@settings(max_examples=150)
def test_equals_the_plain_formula(query):
    assert_equals_reference(query)


def test_a_faint_picture_beside_a_bright_one_loses_nothing():
    left = np.array([[35980, 0], [37265, 0]], np.uint16)
    right = np.array([[0, 1], [0, 1]], np.uint16)
    assert_equals_reference(WindowQuery(left, right, 2, 1, LagRange(0, 0, 0, 0), "cross"))


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("score", SCORES)
@pytest.mark.parametrize(("dy", "dx"), [(0, 0), (0, -7), (0, 7), (3, -2), (-4, 5)])
def test_recovers_a_known_shift(rng, dtype, score, dy, dx):
    scene = picture(rng, (60, 90), dtype)
    left = scene[10:50, 10:80]
    right = scene[10 - dy : 50 - dy, 10 - dx : 80 - dx]
    found = match_windows(WindowQuery(left, right, 15, 2, LagRange(-5, 5, -8, 8), score))
    inside = np.s_[5:8, 5:20]
    share = ((found.dy == dy) & (found.dx == dx))[inside].mean()
    assert share == 1 if score == "zncc" else share > 0.8


@pytest.mark.parametrize("columns_in_cache", [1, 20_000])
def test_tiles_and_bands_leave_no_seam(rng, monkeypatch, columns_in_cache):
    monkeypatch.setattr("stereolag.stereo.windows.window_sums.CACHE_BYTES", columns_in_cache)
    monkeypatch.setattr("stereolag.stereo.windows.window_sums.BAND_WORK", 1.0)
    left, right = picture(rng, (40, 130), np.uint8), picture(rng, (40, 130), np.uint8)
    assert_equals_reference(WindowQuery(left, right, 6, 1, LagRange(-1, 1, -20, 13), "zncc"))


@pytest.mark.parametrize("dtype", [np.uint16, np.float32, np.float64])
def test_a_mean_ten_thousand_times_the_contrast_hides_nothing(rng, dtype):
    scene = 20_000 + 2 * rng.normal(size=(50, 110))
    scene = scene.round().astype(dtype) if dtype != np.float64 else scene
    left, right = scene[:, 5:95].copy(), scene[:, 10:100].copy()
    left[:, 45:], right[:, 40:] = left[:, 45:] // 2, right[:, 40:] // 2  # no single mean suits both halves
    found = match_windows(WindowQuery(left, right, 9, 1, LagRange(0, 0, -12, 12), "zncc"))
    half = np.s_[:, 12:36]
    assert (found.dx[half] == -5).all()
    np.testing.assert_allclose(found.score[half], 1, atol=1e-4)


@pytest.mark.parametrize("scale", [1e-9, 1e9])
def test_the_unit_of_float_images_does_not_matter(rng, scale):
    scene = rng.normal(size=(30, 80)) + 0.3
    left, right = scene[:, :60], scene[:, 4:64] + 0.1 * rng.normal(size=(30, 60))
    query = WindowQuery(left, right, 9, 2, LagRange(0, 0, -12, 12))
    found = match_windows(query)
    scaled = match_windows(replace(query, left=left * scale, right=right * scale))
    np.testing.assert_array_equal(scaled.dx, found.dx)
    np.testing.assert_allclose(scaled.score, found.score, atol=2e-6)
    volume = score_volume_reference(query)
    np.testing.assert_allclose(found.score, np.nanmax(volume, (0, 1)), atol=2e-6)


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


def test_a_flat_window_has_no_match(rng):
    left, right = picture(rng, (30, 60), np.uint8), picture(rng, (30, 60), np.uint8)
    left[:, 20:40] = 77
    found = match_windows(WindowQuery(left, right, 8, 1, LagRange(0, 0, -10, 10), "zncc"))
    assert np.isnan(found.score[:, 20:33]).all()
    assert (found.texture[:, 20:33] == 0).all()
    assert np.isfinite(found.score[:, :20]).all()


@pytest.mark.parametrize("score", SCORES)
@pytest.mark.parametrize("search", [LagRange(0, 0, -25, 0), LagRange(0, 0, -5, 40), LagRange(0, 0, -200, 200)])
def test_right_matches_are_the_best_of_the_other_view(rng, score, search):
    left, right = picture(rng, (20, 70), np.uint8), picture(rng, (20, 70), np.uint8)
    found = match_windows(WindowQuery(left, right, 7, 1, search, score, runner_up=True, right_matches=True))
    volume = score_volume_reference(WindowQuery(left, right, 7, 1, search, score))
    plain = right_view_reference(volume, search, NO_RIGHT_MATCH)
    assert found.right_dx is not None
    np.testing.assert_array_equal(found.right_dx == NO_RIGHT_MATCH, plain == NO_RIGHT_MATCH)
    assert (found.right_dx == plain).mean() > 0.99  # scores within the precision of float32 are equal


def test_swapping_the_images_flips_the_sign(rng):
    scene = picture(rng, (30, 80), np.uint8)
    left, right = scene[:, 6:70], scene[:, 3:67]
    one = match_windows(WindowQuery(left, right, 9, 1, LagRange(0, 0, -8, 8), "zncc"))
    other = match_windows(WindowQuery(right, left, 9, 1, LagRange(0, 0, -8, 8), "zncc"))
    inside = np.s_[:, 10:-10]
    assert (one.dx[inside] == 3).all() and (other.dx[inside] == -3).all()


def test_a_range_out_of_the_frame_finds_nothing(rng):
    image = picture(rng, (20, 30), np.uint8)
    for search in (LagRange(0, 0, 500, 600), LagRange(-90, -50, 0, 0)):
        found = match_windows(WindowQuery(image, image, 7, 1, search, "zncc", runner_up=True))
        assert np.isnan(found.score).all() and np.isnan(found.around).all() and np.isnan(found.runner_up).all()


def test_large_windows_of_bytes_do_not_overflow():
    image = np.full((300, 300), 255, np.uint8)
    image[::7, ::5] = 0
    for window_size in (181, 182, 260):
        found = match_windows(WindowQuery(image, image, window_size, 20, LagRange(0, 0, -3, 3), "ncc"))
        assert (found.dx == 0).all()
        np.testing.assert_allclose(found.score, 1, atol=1e-6)


def test_threads_may_call_at_once(rng):
    left, right = picture(rng, (60, 90), np.uint8), picture(rng, (60, 90), np.uint8)

    def match(window_size):
        return match_windows(WindowQuery(left, right, window_size, 1, LagRange(-2, 2, -9, 9), "zncc"))

    alone = {size: match(size).score for size in (5, 8, 11)}
    with ThreadPoolExecutor(6) as pool:
        for size, found in zip((5, 8, 11) * 4, pool.map(match, (5, 8, 11) * 4), strict=True):
            np.testing.assert_array_equal(found.score, alone[size])


def test_progress_rises_to_one(rng, monkeypatch):
    monkeypatch.setattr("stereolag.stereo.windows.window_sums.BAND_WORK", 2e4)
    image = picture(rng, (60, 90), np.uint8)
    told: list[float] = []
    match_windows(WindowQuery(image, image, 7, 1, LagRange(0, 0, -30, 0), "zncc"), told.append)
    assert len(told) > 4
    assert told == sorted(told) and told[-1] == 1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"window_size": 31}, "window of 31 px"),
        ({"step": 0}, "step is 0"),
        ({"score": "sad"}, "'sad'"),
        ({"lags": LagRange(0, 1, 0, 0), "right_matches": True}, "no vertical search"),
        ({"right": np.zeros((30, 41), np.uint8)}, "one size"),
        ({"right": np.zeros((30, 40), np.float32)}, "type"),
    ],
)
def test_bad_settings_are_named(rng, change, message):
    image = picture(rng, (30, 40), np.uint8)
    good = WindowQuery(image, image, 7, 1, LagRange(0, 0, -5, 0))
    with pytest.raises(ValueError, match=message):
        match_windows(replace(good, **change))


def test_too_many_lags_are_refused(rng):
    image = picture(rng, (400, 400), np.uint8)
    with pytest.raises(ValueError, match="65535"):
        match_windows(WindowQuery(image, image, 5, 1, LagRange(-200, 200, -200, 200), "zncc"))


def test_a_search_ends_after_it_begins():
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
    describe_windows(image, window, step, 0, share, norm, 0.25, total, inverse, texture)
    plain = describe_windows_reference(image, window, step, share, norm, 0.25)
    for found, expected in zip((total, inverse, texture), plain, strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-6)
    assert np.isnan(inverse[shape[0] // 3, shape[1] // 3])
