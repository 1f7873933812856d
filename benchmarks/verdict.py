"""How often a lag is called sure, wrongly and rightly: synthetic recordings with known truth."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from scipy import fft, signal

from stereolag import SignalLag, signal_lag
from stereolag.core.searches import SignalMethod

Vector: TypeAlias = npt.NDArray[np.float64]
Pair: TypeAlias = tuple[Vector, Vector]

METHODS: tuple[SignalMethod, ...] = ("fft", "phat", "sampled", "direct")
SIZES = (2_000, 6_000, 20_000)
DIRECT_SIZES = (2_000, 6_000)
TRIALS = 300
RATE = 44_100.0


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
    return tuple(np.sin(angle + by) + noise_level * random.normal(size=size) for by in (0.0, phase))  # type: ignore[return-value]


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


def _counted(results: Iterable[SignalLag]) -> Counter[str]:
    return Counter(result.verdict for result in results)


def verdict_table() -> tuple[str, dict[str, Any]]:
    """Return the verdicts over all trials as Markdown, and as figures."""
    figures: dict[str, Any] = {}
    lines = ["| recordings | method | trials | sure | ambiguous | nothing | right |", "|---|---|---|---|---|---|---|"]

    def tell(name: str, method: str, results: list[SignalLag], right: int | None) -> None:
        counts = _counted(results)
        entry = {verdict: counts[verdict] for verdict in ("sure", "ambiguous", "nothing")} | {"right": right}
        figures[f"{name}, {method}"] = entry | {"trials": len(results)}
        told = "" if right is None else str(right)
        cells = [name, method, len(results), entry["sure"], entry["ambiguous"], entry["nothing"], told]
        lines.append("| " + " | ".join(map(str, cells)) + " |")

    for kind in UNRELATED:
        for method in METHODS:
            sizes = DIRECT_SIZES if method == "direct" else SIZES
            pairs = (unrelated(kind, sizes[seed % len(sizes)], seed) for seed in range(TRIALS))
            tell(kind, method, [signal_lag(*pair, method=method, seed=0) for pair in pairs], None)
    for method in ("fft", "phat"):
        results, right = [], 0
        for seed in range(TRIALS):
            size = (6_000, 20_000)[seed % 2]
            lag = int(np.random.default_rng(seed).integers(-size // 2, size // 2))
            results.append(signal_lag(*common(size, lag, seed, colour=(0.0, 0.8)[seed // 2 % 2]), method=method))
            right += results[-1].verdict == "sure" and results[-1].lag == lag
        tell("one sound at 0 dB", method, results, right)
    for method in METHODS:
        pairs = (
            tones(6_000, np.random.default_rng(seed).uniform(0.01, 0.4), (0.0, 0.1, 1.0)[seed % 3], seed)
            for seed in range(60)
        )
        tell("tones", method, [signal_lag(*pair, method=method, seed=0) for pair in pairs], None)
    return "\n".join([*lines, "", *_drift_lines(figures)]), figures


def _drift_lines(figures: dict[str, Any]) -> list[str]:
    lines = ["| drift, ppm | length, s | noise, dB | measured, ppm | verdict | score |", "|---|---|---|---|---|---|"]
    for seconds in (3, 60):
        for ppm in (50.0, -50.0, 10.0, 0.0):
            for level, decibels in ((0.0, "none"), (1.0, "0")):
                pair = drifting(round(seconds * RATE), 700, ppm, level, 3)
                found = signal_lag(*pair, max_lag=5_000)
                reason = found.judgement.reason if found.judgement else ""
                figures[f"{ppm:g} ppm, {seconds} s, noise {decibels}"] = found.drift_ppm
                lines.append(
                    f"| {ppm:g} | {seconds} | {decibels} | {found.drift_ppm:.2f} | {found.verdict}, {reason} |"
                    f" {found.score:.3f} |"
                )
    return lines
