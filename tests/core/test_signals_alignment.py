"""Recording 2 on the clock of recording 1: measured again, no lag is left at any time."""

import numpy as np
import numpy.typing as npt
import pytest

import stereolag as sl
from benchmarks.verdict import drifting, tones
from stereolag import samples
from stereolag.core.arrays import Vector
from stereolag.signals import alignment
from stereolag.signals.alignment import mix

SIZE = 60_000


def left(first: Vector, aligned: npt.ArrayLike, begin: int = 0) -> list[float]:
    """Return the lag that is left at the beginning, in the middle and at the end of the samples from `begin` on."""
    second, part = np.asarray(aligned), min(8_000, (first.size - begin) // 3)
    starts = begin, (begin + first.size - part) // 2, first.size - part
    found = [sl.signal_lag(first[start:][:part], second[start:][:part], max_lag=200, method="phat") for start in starts]
    assert all(one.verdict == "sure" for one in found)
    return [one.lag_subsample for one in found]


def dropped(signal: Vector, place: int, count: int) -> Vector:
    return np.delete(signal, slice(place, place + count))


PAIRS = {
    "plain": lambda first, second: (first, second),
    "heard first": lambda first, second: (second, first),
    "dropped in recording 2": lambda first, second: (first, dropped(second, 30_000, 700)),
    "dropped in recording 1": lambda first, second: (dropped(first, 30_000, 700), second),
    "shorter 1": lambda first, second: (first[:40_000], second),
    "shorter 2": lambda first, second: (first, second[:40_000]),
    "recording 1 begins later": lambda first, second: (first[20_000:], second),
}


DRIFTS = [(kind, 100 * (number % 2)) for number, kind in enumerate(PAIRS)]
FAST = [("plain", 1000), ("heard first", -300), ("dropped in recording 1", 1000), ("dropped in recording 2", -1000)]


@pytest.mark.parametrize(("kind", "ppm"), DRIFTS + FAST)
def test_no_lag_is_left_at_any_time(kind: str, ppm: float) -> None:
    first, second = PAIRS[kind](*drifting(SIZE, 400, ppm, 0.3, 1))
    result = sl.signal_lag(first, second)
    aligned = sl.align(first, second, result)
    assert aligned.shape == first.shape
    begin = max(0, -round(result.lag_at(0)))
    last = min(first.size, second.size - round(result.lag_at(first.size / result.sampling_rate)))
    assert np.abs(left(first[:last], aligned[:last], begin)).max() < 0.1


def test_a_step_is_placed_to_the_sample_and_what_is_missing_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    first, second = drifting(SIZE, 400, 0, 0.1, 2)
    lost = dropped(second, 30_000, 700) + 3.0
    result = sl.signal_lag(first, lost, sampling_rate=1000)
    (step,) = result.steps
    assert step.place == pytest.approx(29_600, abs=3)
    assert (step.before, step.after, step.missing) == pytest.approx((400, -300, 700), abs=0.05)
    assert (result.lag_at(20.0), result.lag_at(40.0)) == pytest.approx((400, -300), abs=0.05)
    aligned = sl.align(first, lost, result)
    gap = slice(29_604, 30_296)
    np.testing.assert_allclose(aligned[gap], lost.mean())
    for part in (slice(200, 29_596), slice(30_304, SIZE - 1_100)):
        assert np.corrcoef(aligned[part], second[400:][part])[0, 1] > 0.999
    monkeypatch.setattr(alignment, "BLOCK", 777)
    np.testing.assert_allclose(sl.align(first, lost, result), aligned, atol=1e-5)


def test_a_lag_of_ones_own_is_undone_and_keeps_the_samples() -> None:
    values = np.arange(1000, dtype=np.int16)
    aligned = sl.align(np.arange(900), values, 300)
    assert aligned.dtype == np.float32
    np.testing.assert_allclose(aligned[:700], values[300:], atol=1e-3)
    np.testing.assert_allclose(aligned[700:], values.mean())
    tone = np.sin(np.arange(1000) / 20)
    np.testing.assert_allclose(
        sl.align(tone, tone, 0.25)[50:-50], np.sin((np.arange(1000) + 0.25) / 20)[50:-50], atol=1e-4
    )
    assert sl.align(tone, tone + 0.1, -400)[:400] == pytest.approx(np.full(400, (tone + 0.1).mean()))


def test_only_a_sure_lag_is_undone() -> None:
    with pytest.raises(ValueError, match=r"The lag is 'ambiguous' \(repeats\), and only one that is sure is undone"):
        sl.align(*tones(6_000, 0.01, 0.0, 0))
    with pytest.raises(ValueError, match=r"lag is 100 samples; .* overlap at lags from -99 to 99"):
        sl.align(np.arange(100.0), np.arange(100.0), 100)
    recording = sl.read_signal(samples.recordings()["coast"].signal_1)
    with pytest.raises(ValueError, match="sampling_rate is 8,000 Hz and signal_1 has 44,100 Hz"):
        sl.align(recording, recording, 0, sampling_rate=8000)


def test_together_the_recordings_are_one_sound_once_the_lag_is_undone() -> None:
    first, second = drifting(SIZE, 400, 0, 0, 3)
    assert mix(first, second).var() == pytest.approx(2, rel=0.1)  # two sounds
    assert mix(first, sl.align(first, 50 * second + 3)).var() == pytest.approx(4, rel=0.1)  # one, twice as loud
    assert mix(first[:0], second[:0]).size == 0
