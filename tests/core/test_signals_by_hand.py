"""Recordings to slide, to disturb and to turn by hand: the texts beside them hold, and correlation agrees."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.lib.stride_tricks import sliding_window_view

from stereolag import read_signal, samples, signal_lag
from stereolag.signals import by_hand, phasors
from stereolag.signals.by_hand import Disturbances, disturbed
from stereolag.signals.phasors import LAG, LENGTH, LONGEST_LAG, SIZE


def example(name: str) -> tuple[np.ndarray, np.ndarray, int]:
    one = samples.recordings()[name]
    first, second = (read_signal(path).channels[0] for path in (one.signal_1, one.signal_2))
    return first, second, one.lag


# Slid by hand


def sums(slide: by_hand.Slide) -> np.ndarray:
    return sliding_window_view(slide.recording, slide.cut.size) @ slide.cut


def scores(slide: by_hand.Slide) -> np.ndarray:
    windows = sliding_window_view(slide.recording, slide.cut.size)
    return np.array([np.corrcoef(window, slide.cut)[0, 1] for window in windows])


def lags(slide: by_hand.Slide, heights: np.ndarray) -> list[int]:
    return [slide.lag + slide.step * int(place) for place in np.flatnonzero(heights > heights.max() - 1e-6)]


def test_seven_numbers_meet_themselves_once_and_nothing_else_comes_near() -> None:
    slide = by_hand.seven_numbers()
    heights = np.sort(sums(slide))
    assert lags(slide, sums(slide)) == lags(slide, scores(slide)) == [8]
    assert heights[-1] == 72 and heights[-2] < 72 / 1.5


@pytest.mark.parametrize("name", ["coast", "harbour"])
def test_an_excerpt_stands_out_at_the_lag_of_the_whole_recordings(name: str) -> None:
    first, second, lag = example(name)
    slide = by_hand.excerpt(first, second, lag)
    assert lags(slide, scores(slide)) == [lag]
    np.testing.assert_allclose(slide.scores, scores(slide), atol=1e-9)
    assert slide.scores.max() - slide.rival > 0.3


@given(
    st.integers(by_hand.SLID_OVER, 2_000),
    st.integers(by_hand.SLID_OVER, 2_000),
    st.floats(-1, 1),
    st.integers(0, 2**32 - 1),
)
def test_an_excerpt_is_cut_from_both_recordings_wherever_they_overlap(size_1, size_2, share, seed):
    lag = round(share * (size_2 if share > 0 else size_1))
    sound = np.random.default_rng(seed).normal(size=size_1 + size_2 + abs(lag))
    first, second = sound[max(lag, 0) :][:size_1], sound[max(-lag, 0) :][:size_2]
    slide = by_hand.excerpt(first, second, lag)
    if slide is not None:
        assert (slide.cut.size, slide.recording.size) == (by_hand.CUT_SAMPLES, by_hand.SLID_OVER)
        assert lags(slide, slide.scores) == [lag] and slide.scores.max() > 0.999
    else:
        assert min(size_1 + min(lag, 0), size_1, size_2 - lag, size_2) < by_hand.SLID_OVER


@pytest.mark.parametrize("scale", [1e-300, 1e300])
def test_an_excerpt_of_numbers_without_a_square_stands_out_as_well(scale: float) -> None:
    first = np.random.default_rng(0).uniform(-1, 1, 4000)
    slide = by_hand.excerpt(scale * first, scale * np.roll(first, 50), 50)
    assert slide is not None
    np.testing.assert_allclose(slide.scores, by_hand.excerpt(first, np.roll(first, 50), 50).scores, atol=1e-9)


def test_flat_and_short_recordings_have_no_excerpt() -> None:
    assert by_hand.excerpt(np.zeros(900), np.zeros(900), 0) is None
    assert by_hand.excerpt(np.arange(200.0), np.arange(200.0), 0) is None


def test_a_tone_fits_at_every_period_and_noise_comes_nowhere_near_a_match() -> None:
    slide = by_hand.tone()
    assert lags(slide, sums(slide)) == list(range(-80, 101, 20))
    slide = by_hand.noise()
    assert sums(slide).max() < 0.5 * slide.cut @ slide.cut
    assert scores(slide).max() == pytest.approx(0.45, abs=0.005)  # the value in the text beside it


def test_the_loud_stretch_wins_until_it_is_normalised() -> None:
    slide = by_hand.loud_stretch()
    (loudest,) = lags(slide, sums(slide))
    assert loudest > 130
    assert sums(slide).max() > 1.3 * slide.cut @ slide.cut
    assert lags(slide, scores(slide)) == [90]


# Disturbed by hand

DISTURBED = {
    "clean": ({"noise": -30}, "clear"),
    "as loud": ({"noise": 0}, "clear"),
    "sunk": ({"noise": 12}, "chance"),
    "drowned": ({"noise": 30, "draw": 3}, "chance"),
    "low teeth": ({"repetition": 50}, "clear"),
    "high teeth": ({"repetition": 90}, "repeats"),
    "noisy teeth": ({"repetition": 80, "noise": 8}, "repeats"),
    "nothing but teeth": ({"repetition": 100, "noise": -30}, "repeats"),
    "tone": ({"repetition": 100, "period": 20}, "repeats"),
    "noisy tone": ({"repetition": 100, "period": 20, "noise": 8}, "repeats"),
    "drowned tone": ({"repetition": 100, "period": 20, "noise": 20}, "chance"),
    "not only a tone": ({"repetition": 90, "period": 20}, "clear"),
    "echo": ({"echo": 60}, "clear"),
    "as loud an echo": ({"echo": 100}, "rivals"),
    "little drift": ({"drift": 1}, "clear"),
    "drift": ({"drift": 6}, "drift"),
    "most drift": ({"drift": 20, "noise": 0}, "drift"),
    "drift in noise": ({"drift": 12, "noise": 12}, "chance"),
    "everything": ({"drift": 3, "noise": 0, "repetition": 90, "echo": 60}, "repeats"),
}


@pytest.mark.parametrize("name", DISTURBED)
def test_each_disturbance_spoils_the_lag_in_its_own_way(name: str) -> None:
    settings, reason = DISTURBED[name]
    found = signal_lag(*disturbed(Disturbances(**settings)), max_lag=by_hand.MAX_LAG)
    assert found.judgement.reason == reason
    assert reason != "clear" or found.lag == by_hand.LAG


def test_what_is_mixed_is_what_the_settings_say() -> None:
    def mixed(**changed: int) -> tuple[np.ndarray, np.ndarray]:
        return disturbed(Disturbances(**({"noise": -30} | changed)))

    (first, second), lag, delay = mixed(), by_hand.LAG, by_hand.ECHO_DELAY
    assert first.size == second.size == by_hand.SAMPLES
    np.testing.assert_array_equal(mixed(), (first, second))
    assert np.std(second[lag:] - first[:-lag]) == pytest.approx(np.sqrt(2) * 10**-1.5, rel=0.05)
    assert first.std() == pytest.approx(1.0, abs=0.02)
    noisy, other = mixed(noise=6)[0], mixed(noise=6, draw=1)[0]
    assert 20 * np.log10((noisy - first).std()) == pytest.approx(6.0, abs=0.3)
    assert abs(np.corrcoef(noisy - first, other - first)[0, 1]) < 0.05
    echo = mixed(echo=50)[1] - second
    assert np.corrcoef(echo[delay:], second[:-delay])[0, 1] > 0.99 and echo.std() == pytest.approx(0.5, abs=0.02)
    repeated = mixed(repetition=100, period=40)[0]
    assert np.corrcoef(repeated[40:], repeated[:-40])[0, 1] > 0.99
    half = mixed(repetition=50)[0]
    assert np.corrcoef(half[400:], half[:-400])[0, 1] == pytest.approx(0.5, abs=0.07)
    drifting = mixed(drift=10)[1]
    lags = [signal_lag(first[part], drifting[part], max_lag=660).lag for part in (slice(2192), slice(-2192, None))]
    assert lags[1] - lags[0] == pytest.approx(10 * 6000 / by_hand.SAMPLES, abs=1.1)


# Turned by hand

WHOLE = np.arange(-LONGEST_LAG, LONGEST_LAG + 1)


def at_whole_lags(found: phasors.Phasors, *, whiten: bool = False) -> np.ndarray:
    lags, heights = phasors.correlation(found, whiten=whiten)
    np.testing.assert_array_equal(lags[::4], WHOLE)
    return heights[::4]


def peaks(found: phasors.Phasors, *, whiten: bool = False) -> list[float]:
    lags, heights = phasors.correlation(found, whiten=whiten)
    return sorted(lags[phasors.peaks(heights)].tolist())


def stretches(seed: int, length_1: int = LENGTH, length_2: int = LENGTH) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    return random.normal(3, 2, length_1), random.normal(-1, 5, length_2)


def excerpt(name: str) -> phasors.Phasors:
    return phasors.common_stretch(name, *example(name))


@given(st.integers(0, 2**32 - 1), st.integers(2, LENGTH), st.integers(2, LENGTH))
def test_the_chain_reaches_as_far_as_numpy_correlates(seed: int, length_1: int, length_2: int) -> None:
    first, second = (part - part.mean() for part in stretches(seed, length_1, length_2))
    expected = np.zeros(2 * SIZE)
    full = np.correlate(second, first, mode="full") / np.sqrt(first @ first * (second @ second))
    expected[SIZE - length_1 + 1 : SIZE + length_2] = full
    heights = at_whole_lags(phasors.phasors("two", first, second))
    np.testing.assert_allclose(heights, expected[SIZE + WHOLE], atol=1e-9)


@given(st.integers(0, 2**32 - 1))
def test_whitened_it_is_the_phase_transform_and_between_samples_the_band_limited_curve(seed: int) -> None:
    first, second = (part - part.mean() for part in stretches(seed))
    cross = np.conj(np.fft.rfft(first, SIZE)) * np.fft.rfft(second, SIZE)
    cross[0] = 0  # the mean
    found = phasors.phasors("two", first, second)
    phat = np.fft.irfft(np.divide(cross, np.abs(cross), where=np.abs(cross) > 0, out=np.zeros_like(cross)), SIZE)
    np.testing.assert_allclose(at_whole_lags(found, whiten=True), phat[WHOLE] * SIZE / (SIZE - 1), atol=1e-9)
    fine = 4 * np.fft.irfft(cross, 4 * SIZE) / np.sqrt(first @ first * (second @ second))
    lags, heights = phasors.correlation(found)
    np.testing.assert_allclose(heights, fine[(4 * lags).astype(int)], atol=1e-9)


@given(st.integers(0, 2**32 - 1), st.integers(-LONGEST_LAG, LONGEST_LAG))
def test_at_the_true_lag_all_arrows_are_in_line_and_the_phase_has_its_slope(seed: int, lag: int) -> None:
    sound = stretches(seed)[0][: LENGTH - 2 * LONGEST_LAG]
    first, second = np.zeros((2, LENGTH))
    first[LONGEST_LAG:][: sound.size] = second[LONGEST_LAG + lag :][: sound.size] = sound - sound.mean()
    found = phasors.phasors("two", first, second)
    off = found.turns - np.arange(1, found.turns.size + 1) * lag / SIZE
    np.testing.assert_allclose(off, np.rint(off), atol=1e-6)
    assert peaks(found) == peaks(found, whiten=True) == [lag]
    assert phasors.correlation(found)[1].max() == pytest.approx(found.lengths().sum()) == pytest.approx(1)
    for method in ("fft", "phat"):
        assert signal_lag(first, second, method=method, max_lag=LONGEST_LAG).lag == lag


def width(found: phasors.Phasors, *, whiten: bool) -> int:
    """Return the number of places where the curve is above half its peak."""
    _, heights = phasors.correlation(found, whiten=whiten)
    return int((heights > heights.max() / 2).sum())


def test_whitening_makes_the_coast_a_needle_and_lets_the_wind_in() -> None:
    coast, harbour = excerpt("coast"), excerpt("harbour")
    assert width(coast, whiten=False) > 4 * width(coast, whiten=True)
    plain, white = (phasors.correlation(harbour, whiten=whiten)[1].max() for whiten in (False, True))
    assert white < plain - 0.05
    assert plain < 0.95 * harbour.lengths().sum()  # the arrows are nowhere quite in line


def test_a_knock_has_all_frequencies_a_tone_has_one_and_noise_lines_up_nowhere() -> None:
    assert peaks(phasors.knock()) == peaks(phasors.knock(), whiten=True) == [4]
    assert phasors.knock().lengths().max() < 0.05
    tone = phasors.tone()
    assert np.count_nonzero(tone.lengths()) == 1
    assert peaks(tone) == peaks(tone, whiten=True) == [-11, -6, -1, 4, 9]
    plain, white = (phasors.correlation(phasors.noise(), whiten=whiten)[1].max() for whiten in (False, True))
    assert (round(plain, 2), round(white, 2)) == (0.18, 0.17)  # the values in the text beside it


@pytest.mark.parametrize("lag", [-20_000, -300, 0, 7, 25_000])
@pytest.mark.parametrize("size", [40_000, 60_000])
def test_any_two_recordings_give_what_they_share(lag: int, size: int) -> None:
    scene = np.random.default_rng(size).normal(size=size + abs(lag)).cumsum()
    first, second = scene[max(0, lag) :][:size], 0.3 * scene[max(0, -lag) :][: size - 10] + 5
    found = phasors.common_stretch("own", first, second, lag)
    assert found.offset + LAG * found.step == lag
    assert peaks(found, whiten=True) == [LAG]


def test_the_loudest_stretch_is_taken_and_none_where_too_little_is_shared_or_heard() -> None:
    scene = np.random.default_rng(5).normal(size=60_000)
    scene[:41_000] = scene[41_200:] = 0  # all other stretches are silent
    found = phasors.common_stretch("own", scene[:-20], scene[20:], -20)
    assert peaks(found) == [LAG]
    noise = np.random.default_rng(0).normal(size=1000)
    assert phasors.common_stretch("own", noise, noise, 1000 - LENGTH - LAG) is not None
    assert phasors.common_stretch("own", noise, noise, 1000 - LENGTH - LAG + 1) is None
    assert phasors.common_stretch("own", noise, np.zeros(1000), 0) is None
    for stretch in (np.zeros(10), np.arange(SIZE + 1.0)):
        with pytest.raises(ValueError, match=f"has {stretch.size} samples"):
            phasors.phasors("two", stretch, np.arange(5.0))
