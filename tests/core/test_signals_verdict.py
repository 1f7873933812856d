"""The verdict on a lag: never sure for noise, sure for sounds in noise, ambiguous for tones; long recordings alike."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from typing import Any, get_args

import numpy as np
import pytest
import scipy.stats
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.verdict import UNRELATED, coloured, common, drifting, noise, tones, unrelated
from stereolag import samples
from stereolag.io.recordings import read_signal
from stereolag.signals import SignalLag, SignalMethod, signal_lag
from stereolag.signals import whitening as long_pairs
from stereolag.signals.correlation import ConvertedRecording, HeldRecording, find_peak, overlap_length
from stereolag.signals.search import FoundLag
from stereolag.signals.verdict import LagJudgement, judge, median_line, regular_spacing
from stereolag.signals.whitening import (
    Pair,
    add_agreement,
    add_agreement_reference,
    local_curve,
    whiten,
    whiten_reference,
)

METHODS = get_args(SignalMethod)


def reason(result: SignalLag) -> str:
    assert isinstance(result.judgement, LagJudgement)
    return result.judgement.reason


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("kind", UNRELATED)
def test_recordings_with_nothing_in_common_are_never_sure(kind: str, method: SignalMethod) -> None:
    for seed in range(12 if method == "fft" else 4):  # all methods are judged alike
        result = signal_lag(*unrelated(kind, (900, 3000)[seed % 2], seed), method=method, seed=seed)
        assert result.verdict != "sure", (seed, result.judgement)


@pytest.mark.parametrize("method", ["fft", "phat"])
@pytest.mark.parametrize("colour", [0.0, 0.8])
def test_a_sound_in_noise_as_loud_is_sure_and_right(method: SignalMethod, colour: float) -> None:
    for seed in range(12):
        lag = int(np.random.default_rng(seed).integers(-3000, 3000))
        result = signal_lag(*common(6000, lag, seed, colour=colour), method=method)
        assert (result.verdict, reason(result), result.lag, result.rivals) == ("sure", "clear", lag, ())


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("noise_level", [0.0, 0.1, 1.0])
@pytest.mark.parametrize("frequency", [0.01, 0.1234, 0.4])
def test_a_tone_is_ambiguous_and_its_period_is_named(
    method: SignalMethod, noise_level: float, frequency: float
) -> None:
    result = signal_lag(*tones(6000, frequency, noise_level, 2), method=method, seed=0)
    assert (result.verdict, reason(result)) == ("ambiguous", "repeats")
    assert result.judgement is not None and result.judgement.spacing is not None
    # Teeth are at whole samples: with a period of 2.5, only every other one is.
    period = {0.4: 5.0}.get(frequency, 1 / frequency)
    assert result.judgement.spacing == pytest.approx(period, rel=0.02)
    assert np.all(np.diff(np.abs(np.array(result.rivals) - result.lag)) >= 0)


@pytest.mark.parametrize("method", METHODS)
def test_what_repeats_in_noise_is_ambiguous_with_its_teeth(method: SignalMethod) -> None:
    random = np.random.default_rng(3)
    repeated = np.tile(coloured(80, 0.8, random), 60)
    noisy = [part + 0.3 * random.normal(size=4000) for part in (repeated[25:4025], repeated[:4000])]
    result = signal_lag(*noisy, method=method, seed=0)
    assert result.verdict == "ambiguous"
    assert result.judgement is not None and result.judgement.spacing == pytest.approx(80, abs=0.1)
    assert {(rival - 25) % 80 for rival in result.rivals} == {0}


def test_rivals_lie_within_what_was_searched() -> None:
    random = np.random.default_rng(3)
    repeated = np.tile(coloured(80, 0.8, random), 60)
    result = signal_lag(repeated[25:4025], repeated[:4000], max_lag=110)
    assert sorted((*result.rivals, result.lag)) == [-55, 25, 105]
    assert signal_lag(repeated[25:4025], repeated[:4000], max_lag=40).verdict == "sure"


def test_a_sound_that_comes_twice_has_one_rival_without_spacing() -> None:
    random = np.random.default_rng(5)
    clip = random.normal(size=3000)
    long = np.concatenate((random.normal(size=4000), clip, random.normal(size=25_000), clip, random.normal(size=900)))
    result = signal_lag(clip, long)
    assert (result.lag, result.verdict, reason(result)) == (4000, "ambiguous", "rivals")
    assert result.rivals == (32_000,)
    assert result.judgement is not None and result.judgement.spacing is None


def test_few_samples_convince_of_nothing() -> None:
    first, second = np.zeros(1000), np.zeros(1000)
    first[100:108] = second[850:858] = [1, 4, 9, 5, -3, -2, 1, 0.5]
    assert reason(signal_lag(first, second)) == "too_little"


def test_few_votes_are_named_and_are_no_ties() -> None:
    named = set()
    for seed in range(4):
        result = signal_lag(*unrelated("noise and noise", 10_000, 4 * seed), method="sampled", seed=seed)
        assert result.verdict == "nothing" and result.ties == 1
        named.add(reason(result))
    assert "few_votes" in named


def test_noise_has_no_ties() -> None:
    for seed in range(30):
        assert signal_lag(*unrelated("noise and noise", 2000, seed)).ties == 1


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
    assert judgement is not None and curve is not None and judgement.ribbon is not None
    spread = 1.4826 * np.median(np.abs(curve - np.median(curve)))
    assert judgement.height == pytest.approx((curve.max() - np.median(curve)) / spread)
    assert judgement.chance == pytest.approx(np.sqrt(2 * np.log(curve.size + 1)))
    low, high = judgement.ribbon
    assert ((curve < low) | (curve > high)).sum() <= 2
    assert 3 < judgement.height < 5
    assert signal_lag(*common(20_000, 300, 0)).judgement.height > 20  # type: ignore[union-attr]


@pytest.mark.parametrize("ppm", [50.0, -50.0, 10.0])
@pytest.mark.parametrize("noise_level", [0.0, 1.0])
def test_a_drift_is_measured_and_named(ppm: float, noise_level: float) -> None:
    result = signal_lag(*drifting(150_000, 400, ppm, noise_level, 1), max_lag=2000)
    assert (result.verdict, reason(result)) == ("sure", "drift")
    assert result.drift_ppm == pytest.approx(ppm, abs=1.0)
    assert result.uncertainty < 0.2
    assert result.judgement is not None and result.judgement.drift is not None
    assert result.judgement.drift.start == pytest.approx(400, abs=0.2)
    assert result.judgement.drift.span == pytest.approx(0.15 * ppm, abs=0.15)


def test_clocks_that_agree_have_no_drift_and_swapping_turns_its_sign() -> None:
    steady = signal_lag(*common(20_000, 300, 0, colour=0.0))
    assert reason(steady) == "clear"
    assert abs(steady.drift_ppm) < 20 and 0 < steady.uncertainty < 0.2
    first, second = drifting(60_000, 100, 80.0, 0.5, 2)
    forth, back = signal_lag(first, second, max_lag=500), signal_lag(second, first, max_lag=500)
    assert back.drift_ppm == pytest.approx(-forth.drift_ppm, abs=1.0)
    assert np.isnan(signal_lag(*common(3000, 10, 0)).uncertainty)


def test_a_height_does_not_depend_on_gain_and_of_noise_is_that_of_chance() -> None:
    heights = []
    for seed in range(200):
        first, second = unrelated("random walks", 1000, seed)
        held = [HeldRecording(signal - signal.mean()) for signal in (first, second)]
        heights.append(Pair(*held).agreement(0).height)
        louder = Pair(HeldRecording(1e3 * (first - first.mean())), held[1])
        assert louder.agreement(0).height == pytest.approx(heights[-1])
    assert np.std(heights) == pytest.approx(1.0, abs=0.2)
    assert np.mean(heights) == pytest.approx(0.0, abs=0.3)


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


def test_any_lag_can_be_judged_without_a_curve() -> None:
    pair = Pair(*(HeldRecording(signal - signal.mean()) for signal in common(6000, 700, 1)))
    assert judge(pair, FoundLag(700), 5999).verdict == "sure"
    wrong = judge(pair, FoundLag(4000), 5999)
    assert (wrong.verdict, wrong.reason) == ("nothing", "chance")
    assert np.isnan(wrong.height) and wrong.ribbon is None


@pytest.mark.parametrize("method", ["fft", "phat", "sampled"])
@pytest.mark.parametrize("name", samples.recordings())
def test_the_bundled_recordings_are_sure(name: str, method: SignalMethod) -> None:
    example = samples.recordings()[name]
    first, second = (read_signal(path).channels[0] for path in (example.signal_1, example.signal_2))
    result = signal_lag(first, second, method=method, seed=0)
    assert (result.verdict, result.lag) == ("sure", example.lag)


@pytest.mark.parametrize("method", METHODS)
def test_the_opposite_sign_is_told_by_every_method(method: SignalMethod) -> None:
    whole = coloured(9000, 0.8, np.random.default_rng(4))
    result = signal_lag(whole[1000:7000], -whole[:6000], method=method, seed=0)
    assert (result.verdict, reason(result), result.inverted) == ("nothing", "opposite_sign", True)
    assert result.judgement is not None and result.judgement.opposite_lag == 1000
    assert not signal_lag(whole[1000:7000], whole[:6000], method=method, seed=0).inverted


def test_the_blocks_of_a_drift_lie_on_its_line() -> None:
    result = signal_lag(*drifting(150_000, 400, 50.0, 0.0, 1), max_lag=2000)
    assert result.judgement is not None and result.judgement.drift is not None
    drift = result.judgement.drift
    assert drift.blocks == len(drift.places) >= 10
    slope, _ = np.polyfit(drift.places, drift.lags, 1)
    assert 1e6 * slope == pytest.approx(50.0, abs=5)


def test_a_result_lets_go_of_the_recordings_once_it_is_judged() -> None:
    sound = np.random.default_rng(0).standard_normal(4_000)
    judged_later, judged_at_once = (
        signal_lag(sound[200:], sound),
        signal_lag(sound[200:], sound, progress=lambda _: None),
    )
    assert judged_later._judge is not None
    assert judged_at_once._judge is None
    assert judged_later.judgement == judged_at_once.judgement
    assert judged_later.judgement is judged_later.judgement
    assert judged_later._judge is None


POINTS = st.lists(
    st.tuples(st.integers(-1_000, 1_000), st.integers(-(10**6), 10**6)),
    min_size=3,
    max_size=30,
    unique_by=lambda one: one,
)


@given(POINTS.filter(lambda points: len({place for place, _ in points}) > 2))
def test_it_is_the_line_of_scipy(points: list[tuple[int, int]]) -> None:
    places, values = np.array(points, dtype=np.float64).T
    wanted = scipy.stats.theilslopes(values, places)
    assert median_line(places, values) == pytest.approx((wanted.slope, wanted.intercept), rel=1e-9, abs=1e-9)


def repeated() -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(0)
    once = np.tile(noise(5000, random), 8)
    return once, once + noise(once.size, random)


def opposite() -> tuple[np.ndarray, np.ndarray]:
    one, other = common(40_000, 100, 1)
    return one, -other


PAIRS: dict[str, Any] = {
    "later": lambda: common(40_000, 3000, 0),
    "earlier": lambda: common(150_000, -3000, 1),
    "unlike lengths": lambda: (common(40_000, -300, 2)[0][:25_000], common(40_000, -300, 2)[1]),
    "nothing in common": lambda: unrelated("different sounds", 40_000, 2),
    "bangs": lambda: unrelated("different sounds", 40_000, 4),
    "a tone": lambda: tones(40_000, 0.0123, 0.1, 1),
    "drift": lambda: drifting(60_000, 700, 50, 0.5, 3),
    "repetition": repeated,
    "opposite": opposite,
}


@pytest.mark.parametrize("name", PAIRS)
def test_the_judgement_is_that_of_the_whole(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(long_pairs, "_PIECE", 2**13)
    one, other = PAIRS[name]()
    found = signal_lag(one, other, max_lag=8000)
    pair = Pair(ConvertedRecording(one), ConvertedRecording(other))
    judged = judge(pair, FoundLag(found.lag, lags=found.lags, correlation=found.correlation), 8000)
    assert found.judgement is not None
    for (field, expected), value in zip(
        flat(dataclasses.asdict(found.judgement)), [value for _, value in flat(dataclasses.asdict(judged))], strict=True
    ):
        if isinstance(expected, float):
            assert math.isclose(value, expected, rel_tol=1e-6, abs_tol=1e-9) or (
                math.isnan(value) and math.isnan(expected)
            ), field
        else:
            assert value == expected, field


def flat(values: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    for name, value in values.items():
        if isinstance(value, dict):
            yield from flat(value)
        elif isinstance(value, tuple):
            yield from ((name, each) for each in value)
        else:
            yield name, value


@pytest.mark.parametrize("size", [1, 100, 5000])
@pytest.mark.parametrize("count", [1, 17])
def test_whitening_is_a_convolution(size: int, count: int) -> None:
    samples, taps = np.random.default_rng(0).normal(size=(2, size + count - 1))
    whitened = np.empty(size)
    whiten(samples, taps[:count], whitened)
    np.testing.assert_allclose(whitened, whiten_reference(samples, taps[:count]), atol=1e-12)


@pytest.mark.parametrize("together", [1, 7, 64, 1000])
@pytest.mark.parametrize("cuts", [(), (300,), (1, 64, 65, 448)])
def test_sums_are_the_plain_formula_however_they_are_cut(together: int, cuts: tuple[int, ...]) -> None:
    one, other = np.random.default_rng(1).normal(size=(2, 640))
    sums = np.zeros(9)
    for start, stop in zip((0, *cuts), (*cuts, 640), strict=True):
        add_agreement(one[start:stop], other[start:stop], together, sums)
    np.testing.assert_allclose(sums, add_agreement_reference(one, other, together), atol=1e-9)
