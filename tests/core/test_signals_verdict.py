"""The verdict on a lag: never sure for noise, sure for sounds in noise, ambiguous for tones; the lag over time."""

from typing import get_args

import numpy as np
import pytest
import scipy.signal
import scipy.stats
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.recordings import trial
from benchmarks.sounds import music
from benchmarks.verdict import UNRELATED, coloured, common, drifting, tones, unrelated
from stereolag import read_signal, samples
from stereolag.signals import SignalLag, SignalMethod, over_time, signal_lag
from stereolag.signals.correlation import overlap_length
from stereolag.signals.drift import median_line
from stereolag.signals.over_time import LagOverTime, Stretch, resample, resample_reference
from stereolag.signals.peaks import find_peak
from stereolag.signals.verdict import local_curve, regular_spacing

METHODS = get_args(SignalMethod)


def reason(result: SignalLag) -> str:
    return result.judgement.reason


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("kind", UNRELATED)
def test_recordings_with_nothing_in_common_are_never_sure(kind: str, method: SignalMethod) -> None:
    for seed in range(4 if method == "fft" else 2):  # all methods are judged alike
        result = signal_lag(*unrelated(kind, (900, 3000)[seed % 2], seed), method=method, seed=seed)
        assert result.verdict != "sure", (seed, result.judgement)


@pytest.mark.parametrize("method", ["fft", "phat"])
@pytest.mark.parametrize("colour", [0.0, 0.8])
def test_a_sound_in_noise_as_loud_is_sure_and_right(method: SignalMethod, colour: float) -> None:
    for seed in range(6):
        lag = int(np.random.default_rng(seed).integers(-3000, 3000))
        result = signal_lag(*common(6000, lag, seed, colour=colour), method=method)
        assert (result.verdict, reason(result), result.lag, result.rivals) == ("sure", "clear", lag, ())


@pytest.mark.parametrize("seed", [0, 1, 7, 8])
def test_many_impulses_that_meet_are_sure_though_a_few_hold_nearly_all_of_the_energy(seed: int) -> None:
    random = np.random.default_rng(seed)
    impulses, others = random.standard_cauchy(size=(2, 6500))
    first, second = random.normal(size=(2, 6000))
    result = signal_lag(impulses[500:] + first, impulses[:6000] + second)
    assert (result.verdict, result.lag) == ("sure", 500)
    assert signal_lag(impulses[500:] + first, others[:6000] + second).verdict == "nothing"


@pytest.mark.parametrize("seed", [5, 6, 15])
def test_sensors_that_follow_steps_slowly_agree_in_the_samples_that_whitening_leaves(seed: int) -> None:
    random = np.random.default_rng(seed)
    steps = np.repeat(random.choice([0, 1, 4, 20], 60, p=[0.5, 0.2, 0.2, 0.1]), 45)[:2600]
    followed = scipy.signal.lfilter([5.0], [1, -0.97], steps)
    first, second = scipy.signal.lfilter([2.0], [1, -0.8], random.normal(size=(2, 2400)))
    result = signal_lag(followed[200:] + first, followed[:2400] + second)
    assert (result.verdict, result.lag) == ("sure", 200)


@pytest.mark.parametrize("seed", [8, 10, 18, 67])
def test_a_hum_in_both_does_not_move_the_lag(seed: int) -> None:
    random = np.random.default_rng(seed)
    sound = scipy.signal.lfilter([1.0], [1, -0.8], random.normal(size=4300))
    level, phases = random.uniform(1.5, 4), random.uniform(0, 6, size=(2, 1))
    first, second = level * np.sin(0.1 * np.pi * np.arange(4000) + phases)
    result = signal_lag(sound[266:4266] + first, sound[:4000] + second)
    assert result.verdict == "sure"
    assert result.lag_subsample == pytest.approx(266, abs=0.5)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("frequency", "noise_level"), [(0.01, 1.0), (0.1234, 0.1), (0.4, 0.0)])
def test_a_tone_is_ambiguous_and_its_period_is_named(method, noise_level, frequency):
    result = signal_lag(*tones(6000, frequency, noise_level, 2), method=method, seed=0)
    assert (result.verdict, reason(result)) == ("ambiguous", "repeats")
    # Teeth are at whole samples: with a period of 2.5, only every other one is.
    period = {0.4: 5.0}.get(frequency, 1 / frequency)
    assert result.judgement.spacing == pytest.approx(period, rel=0.02)
    assert np.all(np.diff(np.abs(np.array(result.rivals) - result.lag)) >= 0)


def test_one_ping_in_both_is_too_little_and_not_at_the_level_of_chance() -> None:
    first, second = 0.03 * np.random.default_rng(0).normal(size=(2, 3000))
    ping = np.hanning(40) * np.sin(1.2 * np.arange(40))
    first[1000:1040] += ping
    second[1300:1340] += 0.5 * ping
    result = signal_lag(first, second)
    assert (result.verdict, reason(result), result.lag) == ("nothing", "too_little", 300)


@pytest.mark.parametrize("seed", [424318, 424334, 424341])
def test_a_tone_without_noise_is_not_settled_by_its_cut_ends(seed: int) -> None:
    assert signal_lag(*trial("tones", seed).recordings).verdict == "ambiguous"


REPEATED = np.tile(coloured(80, 0.8, np.random.default_rng(3)), 60)


@pytest.mark.parametrize("method", METHODS)
def test_what_repeats_in_noise_is_ambiguous_with_its_teeth(method: SignalMethod) -> None:
    random = np.random.default_rng(4)
    noisy = [part + 0.3 * random.normal(size=4000) for part in (REPEATED[25:4025], REPEATED[:4000])]
    result = signal_lag(*noisy, method=method, seed=0)
    assert result.verdict == "ambiguous"
    assert result.judgement.spacing == pytest.approx(80, abs=0.1)
    assert {(rival - 25) % 80 for rival in result.rivals} == {0}


@pytest.mark.parametrize(("around", "lowest"), [(360.0, 0.0), (2 * np.pi, -np.pi), (4096.0, 0.0)])
def test_what_begins_again_at_a_number_is_compared_by_its_steps(around: float, lowest: float) -> None:
    for seed in range(5):
        random = np.random.default_rng(seed)
        turning = around / 100 * np.cumsum(random.uniform(0, 2, 1500) + random.normal(size=1500))
        noisy = (
            one + around / 200 * random.normal(size=1300) for one in (turning[50:1350], 0.3 * around + turning[:1300])
        )
        heading_1, heading_2 = ((one - lowest) % around + lowest for one in noisy)
        result = signal_lag(heading_1, heading_2)
        assert (result.verdict, result.lag) == ("sure", 50)
        assert result.begins_again_at == pytest.approx(around)


def test_a_regular_sawtooth_still_repeats() -> None:
    counted = 5 * np.arange(1024) % 256
    assert signal_lag(counted[:1000], counted[10:1010]).verdict == "ambiguous"


def test_rivals_lie_within_what_was_searched() -> None:
    result = signal_lag(REPEATED[25:4025], REPEATED[:4000], max_lag=110)
    assert sorted((*result.rivals, result.lag)) == [-55, 25, 105]
    assert signal_lag(REPEATED[25:4025], REPEATED[:4000], max_lag=40).verdict == "sure"


def test_a_sound_that_comes_twice_has_one_rival_without_spacing() -> None:
    random = np.random.default_rng(5)
    clip = random.normal(size=3000)
    long = np.concatenate((random.normal(size=4000), clip, random.normal(size=25_000), clip, random.normal(size=900)))
    result = signal_lag(clip, long)
    assert (result.lag, result.verdict, reason(result)) == (4000, "ambiguous", "rivals")
    assert result.rivals == (32_000,)
    assert result.judgement.spacing is None


def rung(seed: int) -> np.ndarray:
    """Return two noises with one bell in both, four times at times of their own."""
    random = np.random.default_rng(seed)
    bell = random.normal(size=600) * np.exp(-np.arange(600) / 150)
    pair = 0.05 * random.normal(size=(2, 9000))
    for sound in pair:
        for start in random.integers(0, 8400, 4):
            sound[start : start + 600] += bell
    return pair


@pytest.mark.parametrize("seed", [5, 7, 12])
def test_a_bell_heard_at_unrelated_times_fits_at_many_lags_though_their_overlaps_differ(seed: int) -> None:
    result = signal_lag(*rung(seed))
    assert result.verdict == "ambiguous"
    overlap = overlap_length(9000, 9000, np.array([result.lag, *result.rivals]))
    assert overlap.max() > 1.3 * overlap.min()


def test_a_step_longer_than_what_lies_around_it_is_placed() -> None:
    assert all(0 < step.place < 9000 for step in signal_lag(*rung(19)).steps)


def test_few_votes_are_named_and_are_no_ties() -> None:
    results = [signal_lag(*unrelated("noise and noise", 10_000, 4 * n), method="sampled", seed=n) for n in range(2)]
    assert [(result.verdict, result.ties) for result in results] == [("nothing", 1)] * 2
    assert "few_votes" in map(reason, results)


def test_a_shorter_overlap_that_agrees_even_better_is_no_tie() -> None:
    lags = np.arange(-99, 100)
    weight = np.sqrt(overlap_length(100, 100, lags) / 100)
    curve = 0.1 * np.cos(lags) * weight
    curve[lags == 10], curve[lags == 40] = 0.8 * weight[lags == 10], 0.81 * weight[lags == 40]
    peak, ties = find_peak(curve, lags, lambda some: overlap_length(100, 100, some))
    assert (lags[peak], ties) == (10, 1)


def test_the_height_is_that_of_the_plain_formula_and_chance_leaves_its_ribbon_once_at_most() -> None:
    result = signal_lag(*unrelated("noise and noise", 3000, 0))
    judgement, curve = result.judgement, result.correlation
    spread = 1.4826 * np.median(np.abs(curve - np.median(curve)))
    assert judgement.height == pytest.approx((curve.max() - np.median(curve)) / spread)
    assert judgement.chance == pytest.approx(np.sqrt(2 * np.log(curve.size + 1)))
    low, high = judgement.ribbon
    assert ((curve < low) | (curve > high)).sum() <= 2
    assert 3 < judgement.height < 5
    assert result.ties == 1
    assert signal_lag(*common(20_000, 300, 0)).judgement.height > 20


@pytest.mark.parametrize(("ppm", "noise_level"), [(50.0, 0.0), (-50.0, 1.0), (10.0, 1.0)])
def test_a_drift_is_measured_and_named(ppm: float, noise_level: float) -> None:
    result = signal_lag(*drifting(150_000, 400, ppm, noise_level, 1), max_lag=2000)
    assert (result.verdict, reason(result)) == ("sure", "drift")
    assert result.drift_ppm == pytest.approx(ppm, abs=1.0)
    assert result.uncertainty < 0.2
    assert result.over_time.start == pytest.approx(400, abs=0.2)
    assert result.over_time.span == pytest.approx(0.15 * ppm, abs=0.15)
    assert result.over_time.blocks == len(result.over_time.places) >= 10
    slope, _ = np.polyfit(result.over_time.places, result.over_time.lags, 1)
    assert 1e6 * slope == pytest.approx(ppm, abs=5)  # the blocks lie on its line


def test_clocks_that_agree_have_no_drift_and_swapping_turns_its_sign() -> None:
    steady = signal_lag(*common(20_000, 300, 0, colour=0.0))
    assert reason(steady) == "clear"
    assert abs(steady.drift_ppm) < 20 and 0 < steady.uncertainty < 0.2
    first, second = drifting(60_000, 100, 80.0, 0.5, 2)
    forth, back = signal_lag(first, second, max_lag=500), signal_lag(second, first, max_lag=500)
    assert back.drift_ppm == pytest.approx(-forth.drift_ppm, abs=1.0)
    assert np.isnan(signal_lag(*common(3000, 10, 0)).uncertainty)


def test_the_local_curve_is_the_plain_mean_of_products() -> None:
    random = np.random.default_rng(0)
    first, second = random.normal(size=(2, 50))
    curve = local_curve(first, second, 20)
    energy = np.sqrt((first @ first) * (second @ second)) / 50
    for lag in range(-20, 21):
        parts = first[max(0, -lag) : 50 - max(0, lag)], second[max(0, lag) : 50 - max(0, -lag)]
        assert curve[lag + 20] == pytest.approx(np.mean(parts[0] * parts[1]) / energy)


@pytest.mark.parametrize(
    ("rivals", "lag", "expected"),
    [((10, -10, 20), 0, 10.0), ((100, 201, -99), 0, 100.0), ((10,), 0, None), ((3, 50, 180), 0, None), ((), 4, None)],
)
def test_a_spacing_is_regular_or_none(rivals: tuple[int, ...], lag: int, expected: float | None) -> None:
    found = regular_spacing(rivals, lag)
    assert found == (None if expected is None else pytest.approx(expected))


def test_the_bundled_harbour_is_sure() -> None:
    example = samples.recordings()["harbour"]
    first, second = (read_signal(path).channels[0] for path in (example.signal_1, example.signal_2))
    result = signal_lag(first, second)
    assert (result.verdict, result.lag) == ("sure", example.lag)


@pytest.mark.parametrize("method", METHODS)
def test_the_opposite_sign_is_told_by_every_method(method: SignalMethod) -> None:
    whole = coloured(9000, 0.8, np.random.default_rng(4))
    result = signal_lag(whole[1000:7000], -whole[:6000], method=method, seed=0)
    assert (result.verdict, reason(result), result.inverted) == ("nothing", "opposite_sign", True)
    assert result.judgement.opposite_lag == 1000
    assert not signal_lag(whole[1000:7000], whole[:6000], method=method, seed=0).inverted


@pytest.mark.parametrize("colour", [0.7, 0.9, 0.95])
def test_a_phase_turned_by_a_filter_is_no_opposite_sign_and_moves_the_lag_by_no_cycle(colour: float) -> None:
    random = np.random.default_rng(0)
    sound = coloured(12_300, colour, random)
    telephone = scipy.signal.butter(3, (0.075, 0.85), "band", output="sos")
    heard = scipy.signal.sosfilt(telephone, sound[:12_000])
    result = signal_lag(sound[300:], heard + 0.1 * heard.std() * random.normal(size=12_000))
    assert (result.verdict, result.lag) == ("sure", 300)


def test_a_result_lets_go_of_the_recordings_once_it_is_judged() -> None:
    sound = np.random.default_rng(0).standard_normal(4_000)
    judged_later = signal_lag(sound[200:], sound)
    judged_at_once = signal_lag(sound[200:], sound, progress=lambda _: None)
    assert judged_later._recordings is not None
    assert judged_at_once._recordings is None
    assert judged_later.judgement == judged_at_once.judgement
    assert judged_later.judgement is judged_later.judgement
    assert judged_later._recordings is None


POINTS = st.lists(
    st.tuples(st.integers(-1_000, 1_000), st.integers(-(10**6), 10**6)), min_size=3, max_size=30, unique=True
)


@given(POINTS.filter(lambda points: len({place for place, _ in points}) > 2))
def test_it_is_the_line_of_scipy(points: list[tuple[int, int]]) -> None:
    places, values = np.array(points, dtype=np.float64).T
    wanted = scipy.stats.theilslopes(values, places)
    assert median_line(places, values) == pytest.approx((wanted.slope, wanted.intercept), rel=1e-9, abs=1e-9)


# The lag over time


def with_a_step(size: int, lag: int, missing: int, seed: int, level: float = 0.3) -> tuple[np.ndarray, np.ndarray]:
    """Return a sound and the same one `lag` samples later, with `missing` samples dropped at 40 % of it."""
    random = np.random.default_rng(seed)
    sound = coloured(size + abs(lag) + abs(missing), 0.8, random)
    first, second = sound[lag : lag + size], sound[: size + abs(missing)]
    at = int(0.4 * size) + lag
    if missing < 0:
        first = np.delete(sound[lag : lag + size - missing], slice(at - lag, at - lag - missing))
    else:
        second = np.delete(second, slice(at, at + missing))
    return tuple(one + level * sound.std() * random.normal(size=one.size) for one in (first, second))


@pytest.mark.parametrize(
    ("size", "missing"),
    [*((100_000, few) for few in (40, 400, 5000, -400)), (150_000, -20_000), (60_000, 20_000)],
)
def test_missing_samples_are_a_step_where_they_are_missing(size: int, missing: int) -> None:
    lag = 700
    result = signal_lag(*with_a_step(size, lag, missing, 1), sampling_rate=8000.0)
    assert (result.verdict, reason(result)) == ("sure", "steps")
    (step,) = result.steps
    assert (step.before, step.after, step.missing) == pytest.approx((lag, lag - missing, missing), abs=0.2)
    assert step.place == pytest.approx(0.4 * size, abs=1.5 * 2048)
    assert result.lag_at(2.0) == pytest.approx(lag, abs=0.2)
    assert result.lag_at(12.0) == pytest.approx(lag - missing, abs=0.2)
    assert result.lag in (lag, lag - missing)


@pytest.mark.parametrize("seed", [0, 2])
def test_a_stretch_between_two_steps_is_found_though_it_has_hardly_two_blocks(seed: int) -> None:
    random = np.random.default_rng(seed)
    sound = coloured(103_000, 0.8, random)
    heard = np.delete(sound[700:], [*range(40_300, 40_400), *range(46_300, 46_400)])[:100_000]
    first, second = 0.5 * sound.std() * random.normal(size=(2, 100_000))
    steps = signal_lag(sound[1000:101_000] + first, heard + second).steps
    assert [round(lag) for step in steps for lag in (step.before, step.after)] == [300, 200, 200, 100]


@pytest.mark.parametrize("seed", [510, 526])
def test_all_stretches_are_of_one_clock_and_the_lag_is_from_where_it_was_measured(seed: int) -> None:
    drawn = trial("drift and dropped buffers", seed)
    result = signal_lag(*drawn.recordings, sampling_rate=drawn.rate)
    assert result.verdict == "sure"
    drifts = np.array([1e6 * one.slope for one in result.over_time.stretches])
    assert drifts == pytest.approx(np.full(drifts.size, drawn.ppm), abs=5)
    ends = [place for place, _ in drawn.steps[1:]] + [drawn.recordings[0].size]
    stretches = [
        sorted((lag, lag + drawn.ppm * 1e-6 * (end - place)))
        for (place, lag), end in zip(drawn.steps, ends, strict=True)
    ]
    before = drawn.lags[0] + drawn.ppm * 1e-6 * drawn.steps[0][0]
    stretches.append(sorted((drawn.lags[0], before)))
    assert any(low - 0.5 <= result.judgement.lag <= high + 0.5 for low, high in stretches)


def test_a_stretch_that_ends_before_its_blocks_is_no_step() -> None:
    given = trial("silent gaps", 21)
    assert signal_lag(*given.recordings, sampling_rate=given.rate, max_lag=500).verdict == "nothing"


@pytest.mark.parametrize("seed", [2, 8, 11])
def test_a_step_is_believed_by_what_it_adds_though_its_evidence_is_less(seed: int) -> None:
    random = np.random.default_rng(seed)
    sound = music(44_000, 8000.0, random)
    first, second = 0.1 * sound.std() * random.normal(size=(2, 40_000))
    result = signal_lag(sound[:40_000] + first, np.delete(sound, slice(14_000, 16_000))[:40_000] + second)
    assert [(round(step.before), round(step.after)) for step in result.steps] == [(0, -2000)]


def test_the_drift_is_that_of_all_stretches_by_their_errors() -> None:
    places = (100.0, 400.0)
    stretches = Stretch(0, 500, 0.0, 80e-6, 2e-6, places), Stretch(500, 900, -7.0, 90e-6, 1e-6, places)
    of_both = LagOverTime((*stretches, Stretch(900, 5000, 3.0, 0.0)))  # no block of the longest was measured
    assert (of_both.ppm, of_both.error_ppm) == pytest.approx((88.0, 1 / np.sqrt(1 + 1 / 4)))
    assert LagOverTime((Stretch(0, 500, 0.0, 5e-6),)).ppm == pytest.approx(5.0)


@pytest.mark.parametrize("seed", [26, 3051])
def test_the_louder_of_two_arrivals_does_not_hide_the_other_in_its_surroundings(seed: int) -> None:
    given = trial("louder echo", seed)
    arrivals = signal_lag(*given.recordings, sampling_rate=given.rate).arrivals
    assert [one.lag for one in arrivals] == pytest.approx(given.lags[::-1], abs=0.5)


def test_an_echo_is_an_arrival_and_no_step() -> None:
    random = np.random.default_rng(3)
    sound = coloured(60_000, 0.5, random)
    heard = 0.5 * np.roll(sound, 30) + np.roll(sound, 700) + 0.1 * random.normal(size=sound.size)
    result = signal_lag(sound[1000:], heard[1000:])
    assert (result.verdict, result.lag, result.steps) == ("sure", 700, ())
    assert [round(one.lag) for one in result.arrivals] == [700, 30]
    assert result.arrivals[0].sigma > result.arrivals[1].sigma > result.judgement.needed


def test_a_direct_sound_fainter_than_two_of_its_echoes_is_an_arrival() -> None:
    random = np.random.default_rng(0)
    sound = coloured(20_000, 0.5, random)
    heard = 0.5 * np.roll(sound, 30) + np.roll(sound, 700) + 0.9 * np.roll(sound, 1500)
    result = signal_lag(sound[2000:], heard[2000:] + 0.1 * random.normal(size=18_000))
    assert [round(one.lag) for one in result.arrivals] == [700, 1500, 30]


def test_long_recordings_are_judged_by_sections() -> None:
    first, second = drifting(270_000, 300, 40.0, 0.5, 6)
    result = signal_lag(first, second, max_lag=1000)
    assert (result.verdict, reason(result)) == ("sure", "drift")
    assert result.drift_ppm == pytest.approx(40.0, abs=1)
    assert signal_lag(first, -second, max_lag=1000).inverted
    nothing = signal_lag(*unrelated("noise and noise", 270_000, 0), max_lag=1000)
    assert (nothing.verdict, nothing.over_time) == ("nothing", None)


@pytest.mark.parametrize(("length", "verdict"), [(20, "nothing"), (300, "sure"), (3000, "sure")])
def test_an_excerpt_of_a_long_recording_is_judged_by_as_many_sections_as_it_has(length: int, verdict: str) -> None:
    sound = np.random.default_rng(length).normal(size=270_000)
    result = signal_lag(sound[700 : 700 + length], sound, max_lag=1000)
    assert (result.verdict, result.lag) == (verdict, 700)
    assert signal_lag(sound, np.random.default_rng(0).normal(size=length), max_lag=1000).verdict == "nothing"


@pytest.mark.parametrize(("size", "jump_at"), [(270_000, None), (60_000, None), (60_000, 15_000), (270_000, 60_000)])
def test_no_lag_beyond_the_largest_is_reported(size: int, jump_at: int | None) -> None:
    """Evidence is gathered by following a lag, and by sections around it, which both reach farther."""
    sound = np.random.default_rng(size).normal(size=size + 2000)
    second = sound[2000 - 1008 : -1008]
    if jump_at is not None:
        second = np.concatenate([sound[2000 - 300 : 2000 - 300 + jump_at], second[jump_at:]])
    result = signal_lag(sound[2000:], second, max_lag=500)
    assert abs(result.lag) <= 500
    assert result.verdict == "nothing" if jump_at is None else result.lag == 300


@given(size=st.integers(2, 80), first=st.floats(-5, 60), step=st.floats(0.9, 1.1), values=st.integers(1, 90))
def test_a_resampled_recording_is_the_plain_formula(size: int, first: float, step: float, values: int) -> None:
    samples, filters = np.random.default_rng(size).normal(size=size), over_time.interpolation()
    out = np.empty(values, dtype=np.float32)
    resample(samples, first, step, filters, out)
    np.testing.assert_allclose(out, resample_reference(samples, first, step, filters, values), atol=1e-5)


@pytest.mark.parametrize(("size", "first", "values"), [(31, 2.15, 38), (21, 0.4, 10), (15, 0.3, 28), (34, 0.3, 19)])
def test_a_last_place_at_the_last_sample_is_within_the_recording(size: int, first: float, values: int) -> None:
    samples, filters = np.random.default_rng(size).normal(size=size), over_time.interpolation()
    step, out = (size - 1 - first) / (values - 1), np.empty(values, dtype=np.float32)
    resample(samples, first, step, filters, out)
    assert out[-1] == pytest.approx(samples[-1], abs=1e-5)
    np.testing.assert_allclose(out, resample_reference(samples, first, step, filters, values), atol=1e-5)


def test_a_resampled_sine_is_a_sine() -> None:
    place = 100.3 + 1.0005 * np.arange(5000)
    for frequency in (0.01, 0.2, 0.4):
        out = np.empty(place.size, dtype=np.float32)
        resample(np.sin(2 * np.pi * frequency * np.arange(6000)), 100.3, 1.0005, over_time.interpolation(), out)
        np.testing.assert_allclose(out, np.sin(2 * np.pi * frequency * place), atol=3e-3)
