"""How often a lag is reported as sure, rightly and wrongly, on recordings with known truth, generated from seeds."""

from __future__ import annotations

import multiprocessing
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from itertools import starmap
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from scipy import fft, signal

from benchmarks.recordings import KINDS, Trial, trial
from stereolag import signal_lag
from stereolag.core.searches import SignalMethod

Vector: TypeAlias = npt.NDArray[np.float64]
Pair: TypeAlias = tuple[Vector, Vector]

METHODS: tuple[SignalMethod, ...] = ("fft", "phat", "sampled", "direct")
SIZES = (2_000, 6_000, 20_000)
DIRECT_SIZES = (2_000, 6_000)

TRIALS = 40
"""Number of pairs of each kind of recordings."""

SIMPLE_TRIALS = 100
"""Number of simple pairs of each kind for each method."""


def noise(size: int, random: np.random.Generator) -> Vector:
    """Return white noise."""
    return random.normal(size=size)


def rumble(size: int, random: np.random.Generator) -> Vector:
    """Return noise whose level rises towards low frequencies, by up to 40 dB."""
    return coloured(size, random.uniform(0.5, 0.98), random)


def walk(size: int, random: np.random.Generator) -> Vector:
    """Return a random walk."""
    return np.asarray(np.cumsum(random.normal(size=size)))


def bangs(size: int, random: np.random.Generator) -> Vector:
    """Return one to three decaying bangs, 40 dB above the noise between them."""
    level = np.full(size, 0.01)
    for start in random.integers(0, size, random.integers(1, 4)):
        length = min(size - start, int(random.integers(50, size // 4)))
        level[start : start + length] = np.exp(-np.arange(length) / (length / 3)) + 0.01
    return level * rumble(size, random)


def babble(size: int, random: np.random.Generator) -> Vector:
    """Return buzzes of changing pitch and hisses in succession, like syllables."""
    sound, start = np.zeros(size), 0
    while start < size:
        length = int(random.integers(400, 3000))
        time = np.arange(min(length, size - start))
        if random.random() < 0.6:
            pitch = random.uniform(0.003, 0.02)
            syllable = sum(np.sin(2 * np.pi * pitch * k * time + random.uniform(0, 6)) / k for k in range(1, 20))
        else:
            syllable = signal.lfilter([1.0], [1.0, 0.5], random.normal(size=time.size))
        sound[start : start + time.size] = syllable * np.hanning(time.size) * random.uniform(0.1, 1)
        start += length
    return sound + 1e-3 * random.normal(size=size)


def clicks(size: int, random: np.random.Generator) -> Vector:
    """Return five clicks of different pitches."""
    sound, time = 0.003 * random.normal(size=size), np.arange(60)
    for start in random.integers(0, size - 60, 5):
        sound[start : start + 60] += np.exp(-time / 12) * np.sin(time * random.uniform(0.2, 1.5))
    return sound


UNRELATED: dict[str, tuple[Callable[[int, np.random.Generator], Vector], ...]] = {
    "noise and noise": (noise, rumble),
    "random walks": (walk,),
    "different sounds": (bangs, babble, clicks, rumble),
}


def coloured(size: int, colour: float, random: np.random.Generator) -> Vector:
    """Return first-order autoregressive noise with coefficient `colour`."""
    return np.asarray(signal.lfilter([1.0], [1.0, -colour], random.normal(size=size + 500))[500:])


def unrelated(kind: str, size: int, seed: int) -> Pair:
    """Return two recordings with nothing in common."""
    random = np.random.default_rng(seed)
    makers = UNRELATED[kind]
    return makers[seed % len(makers)](size, random), makers[(seed // len(makers)) % len(makers)](size, random)


def common(size: int, lag: int, seed: int, *, colour: float = 0.8) -> Pair:
    """Return two recordings of one sound, `lag` samples apart, each with its own noise as loud as the sound."""
    random = np.random.default_rng(seed)
    whole = coloured(size + abs(lag), colour, random)
    early, late = whole[abs(lag) :], whole[:size]
    first, second = (early, late) if lag >= 0 else (late, early)
    level = whole.std()
    return first + level * random.normal(size=size), second + level * random.normal(size=size)


def tones(size: int, frequency: float, noise_level: float, seed: int) -> Pair:
    """Return a tone (cycles per sample) at two phases, with noise of `noise_level` times its amplitude."""
    random = np.random.default_rng(seed)
    angle = 2 * np.pi * frequency * np.arange(size)
    phase = random.uniform(0, 2 * np.pi)
    return tuple(np.sin(angle + by) + noise_level * random.normal(size=size) for by in (0.0, phase))


def drifting(size: int, lag: int, ppm: float, noise_level: float, seed: int) -> Pair:
    """Return a sound, and the same sound by a clock that is `ppm` faster, `lag` samples later at its start.

    The sound is oversampled 8 times and interpolated, which is exact to a few thousandths.
    """
    random = np.random.default_rng(seed)
    margin = lag + int(abs(ppm) * 1e-6 * size) + 64
    whole = int(fft.next_fast_len(size + 2 * margin))
    spectrum = np.fft.rfft(random.normal(size=whole))
    spectrum[int(0.8 * spectrum.size) :] = 0
    points = 8 * whole
    fine = 8 * np.fft.irfft(np.pad(spectrum, (0, points // 2 + 1 - spectrum.size)), points)
    places = margin - lag + np.arange(size) * (1 - ppm * 1e-6)
    first = fine[8 * margin : 8 * (margin + size) : 8]
    second = np.interp(8 * places, np.arange(points), fine)
    level = noise_level * fine.std()
    return first + level * random.normal(size=size), second + level * random.normal(size=size)


@dataclass(frozen=True)
class Judged:
    """The outcome of one pair.

    Attributes
    ----------
    kind, seed
        Arguments of :func:`benchmarks.recordings.trial`.
    expected, verdict
        See :class:`benchmarks.recordings.Trial`.
    lag, truth
        The lag found, and the ranges of correct lags over the recordings, samples.
    inside
        Whether the lag occurs at some time of the recordings.
    named
        Whether the answer has all lags that a sure answer must name.
    simple
        Whether the highest point of the plain or of the whitened correlation is at a correct lag.
    drift_right
        Whether the drift is right; None where there is none to measure.
    over_time
        Whether the lag is right at all times; None if the result has no lag over time.
    seconds
        Duration of search and judgement.
    """

    kind: str
    seed: int
    expected: str
    verdict: str
    lag: float
    truth: tuple[tuple[float, float], ...]
    inside: bool
    named: bool
    simple: bool
    drift_right: bool | None
    over_time: bool | None
    seconds: float

    @property
    def right(self) -> bool:
        """Return whether the lag is reported as sure, and right."""
        return self.verdict == "sure" and self.expected in ("sure", "any") and self.inside and self.named

    @property
    def wrong(self) -> bool:
        """Return whether the lag is reported as sure, but wrong."""
        return self.verdict == "sure" and not self.right


def judged(kind: str, seed: int, method: SignalMethod = "fft") -> Judged:
    """Return the outcome of one pair with a method."""
    given = trial(kind, seed)
    start = time.perf_counter()
    found = signal_lag(*given.recordings, sampling_rate=given.rate, method=method, seed=0)
    verdict = found.verdict
    seconds = time.perf_counter() - start
    arrivals = (lag for lag, *_ in getattr(found, "arrivals", ()))
    lag_at = getattr(found, "lag_at", None)
    return Judged(
        kind=kind,
        seed=seed,
        expected=given.expected,
        verdict=verdict,
        lag=found.lag_subsample,
        truth=given.ranges(),
        inside=given.is_right(found.lag_subsample),
        named=given.names_all((found.lag_subsample, *found.rivals, *arrivals)),
        simple=any(map(given.is_right, simple_lags(given))),
        drift_right=given.is_right_drift(found.drift_ppm) if given.ppm and given.expected == "sure" else None,
        over_time=given.is_right_over_time(lag_at) if lag_at and given.lags and verdict == "sure" else None,
        seconds=seconds,
    )


def simple_lags(given: Trial) -> Iterator[int]:
    """Yield the lags of the highest points of the plain correlation and of the whitened one (GCC-PHAT)."""
    one, other = (recording - recording.mean() for recording in given.recordings)
    points = int(fft.next_fast_len(one.size + other.size, real=True))
    spectrum = np.conj(fft.rfft(one, points)) * fft.rfft(other, points)
    for weighted in (spectrum, spectrum / (np.abs(spectrum) + np.finfo(float).tiny)):
        highest = int(np.argmax(fft.irfft(weighted, points)))
        yield highest if highest < other.size else highest - points


def judged_trials(kinds: Sequence[str], seeds: Sequence[int], method: SignalMethod, jobs: int) -> Iterator[Judged]:
    """Yield the outcomes of the pairs of these kinds with these seeds, computed by `jobs` processes."""
    pairs = [(kind, seed, method) for kind in kinds for seed in seeds]
    if jobs == 1:
        yield from starmap(judged, pairs)
        return
    with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn")) as processes:
        yield from processes.map(judged, *zip(*pairs, strict=True), chunksize=4)


def recordings_table(
    kinds: Sequence[str] = tuple(KINDS),
    *,
    trials: int = TRIALS,
    seed: int = 0,
    method: SignalMethod = "fft",
    jobs: int = 1,
) -> tuple[str, list[dict[str, Any]]]:
    """Return the outcomes of pairs of each kind as Markdown, with each mistake, and as figures."""
    every = list(judged_trials(kinds, range(seed, seed + trials), method, jobs))
    lines = [
        "| recordings | pairs | sure, right | **sure, wrong** | ambiguous | nothing | found by argmax | of these sure,"
        " right | lag inside | drift right | right over time | s |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for kind in kinds:
        lines.append(f"| {kind} | " + " | ".join(_cells([one for one in every if one.kind == kind])) + " |")
    lines.append("| **all** | " + " | ".join(_cells(every)) + " |")
    mistakes = [
        f"- {one.kind}, seed {one.seed}: sure of {one.lag:.2f}; {_true_lags(one)}" for one in every if one.wrong
    ]
    return "\n".join([*lines, "", "Sure and wrong:", "", *(mistakes or ["- none"])]), [asdict(one) for one in every]


def _cells(judged: Sequence[Judged]) -> list[str]:
    verdicts = Counter(one.verdict for one in judged)
    simple = [one for one in judged if one.simple]
    known = [one for one in judged if one.truth]
    drifting = [one for one in judged if one.drift_right is not None]
    told = [one for one in judged if one.over_time is not None]

    def share(good: Iterable[bool], of: Sequence[Judged]) -> str:
        return f"{sum(good)} of {len(of)}" if of else ""

    return [
        str(len(judged)),
        str(sum(one.right for one in judged)),
        f"**{sum(one.wrong for one in judged)}**",
        str(verdicts["ambiguous"]),
        str(verdicts["nothing"]),
        share((one.simple for one in known), known),
        share((one.right for one in simple), simple),
        share((one.inside for one in known), known),
        share((one.right and bool(one.drift_right) for one in drifting), drifting),
        share((bool(one.over_time) for one in told), told),
        f"{np.mean([one.seconds for one in judged]):.2f}",
    ]


def _true_lags(one: Judged) -> str:
    if one.expected in ("ambiguous", "nothing"):
        return f"{one.expected} is right"
    lags = " or ".join(f"{low:.2f}" if low == high else f"{low:.2f} to {high:.2f}" for low, high in one.truth)
    return f"right is {lags}" + ("" if one.named else ", and not all that are true are named")


def methods_table() -> tuple[str, dict[str, Any]]:
    """Return the verdicts of every method on simple pairs as Markdown, and as figures."""
    figures: dict[str, Any] = {}
    lines = ["| recordings | method | pairs | sure | ambiguous | nothing |", "|---|---|---|---|---|---|"]
    for method in METHODS:
        sizes = DIRECT_SIZES if method == "direct" else SIZES
        makers: dict[str, Callable[[int], Pair]] = {
            kind: lambda seed, kind=kind, sizes=sizes: unrelated(kind, sizes[seed % len(sizes)], seed)  # type: ignore[misc]
            for kind in UNRELATED
        }
        makers["tones"] = any_tones
        for kind, maker in makers.items():
            counts = Counter(signal_lag(*maker(seed), method=method, seed=0).verdict for seed in range(SIMPLE_TRIALS))
            entry = {verdict: counts[verdict] for verdict in ("sure", "ambiguous", "nothing")}
            figures[f"{kind}, {method}"] = entry
            lines.append(f"| {kind} | {method} | {SIMPLE_TRIALS} | " + " | ".join(map(str, entry.values())) + " |")
    return "\n".join(lines), figures


def any_tones(seed: int) -> Pair:
    """Return a tone of any frequency at two phases, without noise, with a little, or with as much."""
    frequency = np.random.default_rng(seed).uniform(0.01, 0.4)
    return tones(6_000, frequency, (0.0, 0.1, 1.0)[seed % 3], seed)
