"""Random sounds and slow signals, from which :mod:`benchmarks.recordings` makes recordings."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
import numpy.typing as npt
from scipy import signal

Vector: TypeAlias = npt.NDArray[np.float64]
Random: TypeAlias = np.random.Generator
Source: TypeAlias = Callable[[int, float, Random], Vector]
"""A function of a number of samples, the sampling rate, Hz, and a generator that returns (samples,) of a sound."""

NOISE_FLOOR = 1e-4
"""Level of the noise under sounds with pauses, so that nothing is constant."""


def one_of(sources: tuple[Source, ...], random: Random) -> Source:
    """Return one of the sources, all equally likely."""
    return sources[int(random.integers(len(sources)))]


def white(size: int, rate: float, random: Random) -> Vector:
    """Return white noise."""
    return random.normal(size=size)


def red(size: int, colour: float, random: Random) -> Vector:
    """Return first-order autoregressive noise with coefficient `colour` and standard deviation 1."""
    noise = signal.lfilter([1], [1, -colour], random.normal(size=size + 500))[500:]
    return np.asarray(noise * np.sqrt(1 - colour**2))


def swelling(size: int, turns: int, depth: float, random: Random) -> Vector:
    """Return a level around 1, interpolated between `turns` random values."""
    return np.abs(1 + depth * np.interp(np.arange(size), np.linspace(0, size, turns), random.normal(size=turns)))


def harmonics(phase: Vector, levels: Vector, random: Random) -> Vector:
    """Return harmonics of a phase (radians) with these levels, the fundamental first, each with a random phase."""
    turn, tone, total = np.exp(1j * phase), np.ones(phase.size, dtype=np.complex128), np.zeros(phase.size)
    for level in levels.tolist():
        tone *= turn
        total += (tone * (level * np.exp(1j * random.uniform(0, 2 * np.pi)))).real
    return total


def ringing(size: int, rate: float, pitch: float, width: float) -> Vector:
    """Return a tone that starts at once and decays: the response of a resonance of `width` Hz."""
    time = np.arange(size) / rate
    return np.exp(-np.pi * width * time) * np.sin(2 * np.pi * pitch * time)


def add(sound: Vector, start: int, event: Vector) -> None:
    """Add an event to a sound in place, cut off at its ends."""
    begin, stop = max(0, start), min(sound.size, start + event.size)
    if begin < stop:
        sound[begin:stop] += event[begin - start : stop - start]


def speech(size: int, rate: float, random: Random) -> Vector:
    """Return buzzes and hisses through three formants each, with pauses."""
    sound, start = NOISE_FLOOR * random.normal(size=size), 0
    while start < size:
        if random.random() < 0.2:
            start += int(rate * random.uniform(0.03, 0.3))
            continue
        time = np.arange(int(rate * random.uniform(0.05, 0.25)))
        syllable = random.normal(size=time.size)
        if random.random() < 0.7:
            pitch = random.uniform(90, 250)
            vibrato = 1 + 0.05 * np.sin(2 * np.pi * random.uniform(2, 6) * time / rate + random.uniform(0, 6))
            half = np.pi * pitch * np.cumsum(vibrato + 0.005 * random.normal(size=time.size)) / rate + 1e-6
            count = 2 * int(min(0.45 * rate, 4500) // pitch) + 1
            # All harmonics with the same level in closed form: a train of pulses.
            syllable = np.sin(count * half) / np.sin(half) - 1
        for _ in range(3):
            formant, width = random.uniform(300, min(3500, 0.45 * rate)), random.uniform(60, 250)
            pole = np.exp(-np.pi * width / rate)
            resonance = [1, -2 * pole * np.cos(2 * np.pi * formant / rate), pole**2]
            syllable = signal.lfilter([1 - pole], resonance, syllable)
        add(sound, start, random.uniform(0.2, 1) / syllable.std() * syllable * np.sqrt(np.hanning(time.size)))
        start += time.size
    return sound


def crowd(size: int, rate: float, random: Random) -> Vector:
    """Return four voices at once."""
    return np.asarray(sum(random.uniform(0.3, 1) * speech(size, rate, random) for _ in range(4)))


def music(size: int, rate: float, random: Random) -> Vector:
    """Return notes with harmonics and drum beats on a rhythm."""
    sound, beat, at = NOISE_FLOOR * random.normal(size=size), random.uniform(0.15, 0.5), 0.0
    while at * rate < size:
        for _ in range(random.integers(1, 4)):
            pitch = 110 * 2 ** (random.integers(0, 36) / 12)
            time = np.arange(int(rate * beat * random.uniform(1, 3))) / rate
            levels = 1 / np.arange(1, 1 + min(7, int(0.45 * rate // pitch))) ** 1.2
            note = harmonics(2 * np.pi * pitch * time, levels, random) * np.exp(-time / random.uniform(0.1, 0.6))
            add(sound, int(at * rate), random.uniform(0.3, 1) * note)
        if random.random() < 0.5:
            time = np.arange(int(0.05 * rate)) / rate
            drum = random.uniform(0.3, 2) * random.normal(size=time.size) * np.exp(-time / 0.01)
            add(sound, int(at * rate), drum)
        at += beat * random.choice([0.5, 1, 1, 2])
    return sound


def traffic(size: int, rate: float, random: Random) -> Vector:
    """Return a rumble that swells and fades as cars pass."""
    return swelling(size, 12, 0.8, random) * red(size, random.uniform(0.8, 0.98), random)


def wind(size: int, rate: float, random: Random) -> Vector:
    """Return gusts: noise whose level changes several times a second."""
    gusts = swelling(size, 4 + int(size / rate * random.uniform(2, 6)), 0.6, random)
    return gusts**2 * red(size, random.uniform(0.5, 0.9), random)


def rain(size: int, rate: float, random: Random) -> Vector:
    """Return some hundred drops a second on surfaces that ring, over a hiss."""
    drops = np.zeros(size)
    places = random.integers(0, size, 1 + int(size / rate * random.uniform(100, 400)))
    np.add.at(drops, places, random.exponential(size=places.size) * random.choice([-1, 1], places.size))
    pitches = random.uniform(0.05, 0.4, 3) * rate
    surfaces = [ringing(int(0.02 * rate), rate, pitch, random.uniform(100, 400)) for pitch in pitches]
    sound = signal.oaconvolve(drops, np.sum(surfaces, axis=0))[:size]
    return np.asarray(sound / sound.std() + random.uniform(0.1, 0.5) * random.normal(size=size))


def engine(size: int, rate: float, random: Random) -> Vector:
    """Return thirty harmonics of a wandering speed, and noise."""
    speed = random.uniform(15, 40) + np.cumsum(random.normal(size=size)) * random.uniform(0.3, 2) / np.sqrt(rate)
    phase = 2 * np.pi * np.cumsum(np.clip(speed, 8, 80)) / rate
    levels = random.uniform(0.2, 1, 30) / np.sqrt(np.arange(1, 31))
    return harmonics(phase, levels, random) + 0.3 * random.normal(size=size)


def claps(size: int, rate: float, random: Random) -> Vector:
    """Return short bursts of noise at random times, about one a second."""
    sound, time = 10 * NOISE_FLOOR * random.normal(size=size), np.arange(int(0.05 * rate)) / rate
    for start in random.integers(0, size, max(3, int(size / rate * random.uniform(0.8, 2)))).tolist():
        burst = random.normal(size=time.size) * np.exp(-time / random.uniform(0.003, 0.01))
        add(sound, start, random.uniform(0.3, 1) * burst)
    return sound


def footsteps(size: int, rate: float, random: Random) -> Vector:
    """Return the steps of one walker, heel and toe, at a pace that varies by some per cent."""
    sound, pace, at = 10 * NOISE_FLOOR * random.normal(size=size), random.uniform(0.4, 0.7), random.uniform(0, 0.5)
    floor = ringing(int(0.03 * rate), rate, random.uniform(80, 400), random.uniform(40, 100))
    while at * rate < size:
        for later, level in ((0.0, 1.0), (random.uniform(0.06, 0.1), 0.5)):
            scrape = random.normal(size=floor.size) * np.exp(-np.arange(floor.size) / (0.004 * rate))
            add(sound, int((at + later) * rate), level * random.uniform(0.5, 1) * (floor + 0.5 * scrape))
        at += pace * random.normal(1, 0.04)
    return sound


def workshop(size: int, rate: float, random: Random) -> Vector:
    """Return a grinder that slows down under load, and hammer blows on ringing metal."""
    load = swelling(size, 3 + int(size / rate * 2), 0.5, random)
    phase = 2 * np.pi * np.cumsum(random.uniform(80, 200) / (1 + 0.2 * load)) / rate
    count = min(20, int(0.4 * rate // 200))
    sound = harmonics(phase, random.uniform(0.1, 0.5, count), random) + load * red(size, -0.5, random)
    pitches, length = random.uniform(0.03, 0.4, 4) * rate, int(0.3 * rate)
    for start in random.integers(0, size, 1 + int(size / rate * random.uniform(0.5, 3))).tolist():
        blow = sum(random.uniform(0.3, 2) * ringing(length, rate, pitch, random.uniform(3, 20)) for pitch in pitches)
        add(sound, start, np.asarray(blow))
    return sound


def chirps(size: int, rate: float, low: float, high: float, seconds: float, random: Random) -> Vector:
    """Return four to eleven calls of about the given length, each gliding between two pitches with a warble."""
    sound = np.zeros(size)
    for _ in range(random.integers(4, 12)):
        length = int(seconds * rate * random.uniform(0.6, 1.4))
        start, place = int(random.integers(0, max(1, size - length))), np.linspace(0, 1, length)
        first, last = random.uniform(low, high, 2)
        warble = np.sin(2 * np.pi * random.uniform(0.5, 4) * place + random.uniform(0, 6))
        pitch = first + (last - first) * place + 0.1 * (high - low) * warble
        add(sound, start, random.uniform(0.3, 1) * np.sin(2 * np.pi * np.cumsum(pitch) / rate) * np.hanning(length))
    return sound


def birds(size: int, rate: float, random: Random) -> Vector:
    """Return some bird calls over a little noise."""
    call = chirps(size, rate, 0.1 * rate, 0.4 * rate, random.uniform(0.05, 0.2), random)
    return call + 0.01 * random.normal(size=size)


def bang(size: int, rate: float, random: Random) -> Vector:
    """Return one to three decaying bangs, 40 dB above the noise between them."""
    level = np.full(size, 0.01)
    for start in random.integers(0, size, random.integers(1, 4)).tolist():
        length = int(random.integers(50, max(51, size // 4)))
        add(level, start, np.exp(-3 * np.arange(length) / length))
    return level * red(size, random.uniform(0.5, 0.98), random)


def walk(size: int, rate: float, random: Random) -> Vector:
    """Return a random walk."""
    return np.asarray(np.cumsum(random.normal(size=size)))


def heartbeats(size: int, rate: float, random: Random) -> Vector:
    """Return an electrocardiogram: waves P, QRS and T at a heart rate that breathes and varies from beat to beat."""
    sound, at, pulse = 0.01 * random.normal(size=size), -random.uniform(0, 1), random.uniform(0.6, 1.1)
    time = np.arange(-0.3, 0.45, 1 / rate)
    waves = ((-0.17, 0.025, 0.12), (-0.025, 0.01, -0.15), (0.0, 0.012, 1.0), (0.03, 0.012, -0.25), (0.22, 0.05, 0.3))
    shape = [(place, width, level * random.uniform(0.6, 1.4)) for place, width, level in waves]
    breath, variation = random.uniform(0.15, 0.35), random.uniform(0.01, 0.05)
    while at * rate < size + rate:
        beat = sum(level * np.exp(-0.5 * ((time - place) / width) ** 2) for place, width, level in shape)
        add(sound, int((at - 0.3) * rate), np.asarray(beat * random.normal(1, 0.03)))
        at += pulse * (1 + 0.04 * np.sin(2 * np.pi * breath * at) + variation * random.normal())
    return sound


def gait(size: int, rate: float, random: Random) -> Vector:
    """Return the acceleration of a walking body: knocks and swings at a pace that drifts, with stops."""
    pace = random.uniform(1.6, 2.2) * (1 + 0.05 * np.cumsum(random.normal(size=size)) / np.sqrt(rate * 10))
    phase = 2 * np.pi * np.cumsum(np.clip(pace, 1.2, 3)) / rate
    swing = harmonics(phase / 2, random.uniform(0.1, 1, min(8, int(0.4 * rate))), random)
    moves = swelling(size, 3 + int(size / rate / 5), 0.5, random)
    return moves * swing + 0.1 * red(size, 0.7, random)


def swell(size: int, rate: float, random: Random) -> Vector:
    """Return the height of waves at sea: noise around a tenth of the rate, over a slow tide."""
    band = signal.butter(2, (0.04 * rate, 0.2 * rate), "band", fs=rate, output="sos")
    waves = signal.sosfilt(band, random.normal(size=size + 200))[200:]
    return np.asarray(waves / waves.std() + 0.5 * np.sin(np.linspace(0, random.uniform(1, 6), size)))


def tremor(size: int, rate: float, random: Random) -> Vector:
    """Return the motion of the ground: a restless background and one or more events with a sharp onset."""
    sound = red(size, 0.9, random)
    for start in random.integers(0, size, random.integers(1, 4)).tolist():
        length = int(rate * random.uniform(5, 20))
        shape = np.exp(-np.arange(length) / (length / random.uniform(3, 8)))
        add(sound, start, random.uniform(3, 30) * shape * red(length, random.uniform(0.3, 0.8), random))
    return sound


SOUNDS: tuple[Source, ...] = (speech, crowd, music, traffic, wind, rain, engine, claps, footsteps, workshop)
SLOW_SIGNALS: tuple[Source, ...] = (heartbeats, gait, swell, tremor)
