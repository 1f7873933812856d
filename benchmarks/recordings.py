"""Pairs of recordings with known truth, of the kinds that users bring, each generated from its kind and a seed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from scipy import fft, signal

from benchmarks.sounds import (
    SLOW_SIGNALS,
    SOUNDS,
    Random,
    Source,
    Vector,
    add,
    bang,
    birds,
    chirps,
    claps,
    crowd,
    engine,
    footsteps,
    harmonics,
    heartbeats,
    music,
    one_of,
    rain,
    red,
    speech,
    traffic,
    walk,
    white,
    wind,
    workshop,
)

Pair: TypeAlias = tuple[Vector, Vector]
Kind: TypeAlias = Callable[[Random], "Trial"]

MARGIN = 3000
"""Samples of a sound before the first sample recorded."""

NOT_REPETITIVE: tuple[Source, ...] = tuple(sound for sound in SOUNDS if sound is not engine)
"""Sounds that do not almost repeat."""


@dataclass(frozen=True)
class Piece:
    """A stretch without a step that is in both recordings: its ends in recording 1 and the lags there, samples."""

    first: float
    last: float
    lag_first: float
    lag_last: float

    def lag(self, place: float) -> float:
        """Return the lag at a place in recording 1."""
        return float(np.interp(place, (self.first, self.last), (self.lag_first, self.lag_last)))


@dataclass(frozen=True)
class Trial:
    """Two recordings and the correct answer.

    The lag is a function of time: it grows by `ppm`, and jumps at `steps`.

    Attributes
    ----------
    recordings
        (N1,) and (N2,) samples.
    rate
        Samples per second.
    lags
        The correct lags at sample 0 of recording 1, samples; none if the recordings have nothing in common.
    expected
        The verdict: ``"sure"``; ``"ambiguous"`` (every period fits as well); ``"nothing"``; ``"any"``: none is a
        mistake. ``"sure"`` is a mistake where ``"ambiguous"`` or ``"nothing"`` is expected.
    ppm
        Growth of the lag, samples per million; positive if the clock of recording 2 runs faster.
    steps
        Places in recording 1, samples, each with the lag from there on.
    named
        The lags of `lags` that a sure answer must name, as its lag or in addition.
    tolerance
        Largest error of a correct lag, samples.
    """

    recordings: Sequence[Vector]
    rate: float
    lags: tuple[float, ...]
    expected: Literal["sure", "ambiguous", "nothing", "any"] = "sure"
    ppm: float = 0.0
    steps: tuple[tuple[float, float], ...] = ()
    named: tuple[float, ...] = ()
    tolerance: float = 2.0

    def lines(self) -> list[list[Piece]]:
        """Return the lag over time, for each of `lags`."""
        (size_1, size_2), growth = (one.size for one in self.recordings), self.ppm * 1e-6
        lines = []
        for start in self.lags:
            starts = [(0.0, start), *self.steps]
            ends = [place for place, _ in self.steps] + [size_1 - 1.0]
            line = []
            for (place, lag), end in zip(starts, ends, strict=True):
                # Sample i corresponds to sample i + lag + growth * (i - place) of recording 2.
                first = max(place, (growth * place - lag) / (1 + growth))
                last = min(end, (size_2 - 1 + growth * place - lag) / (1 + growth))
                if first < last:
                    line.append(Piece(first, last, lag + growth * (first - place), lag + growth * (last - place)))
            lines.append(line)
        return lines

    def ranges(self) -> tuple[tuple[float, float], ...]:
        """Return the lowest and the highest lag of each piece of each line."""
        ends = ((piece.lag_first, piece.lag_last) for line in self.lines() for piece in line)
        return tuple((min(pair), max(pair)) for pair in ends)

    def is_right(self, lag: float) -> bool:
        """Return whether a lag occurs at some time, within the tolerance."""
        return any(low - self.tolerance <= lag <= high + self.tolerance for low, high in self.ranges())

    def is_right_drift(self, ppm: float) -> bool:
        """Return whether a drift is right to 2 ppm, or over short recordings to a quarter of a sample in total."""
        shortest = min(one.size for one in self.recordings)
        return abs(ppm - self.ppm) <= max(2.0, 0.25e6 / shortest)

    def is_right_over_time(self, lag_at: Callable[[float], float]) -> bool:
        """Return whether a lag as a function of time, s, agrees with one of the true lines.

        They are compared at the quarters of each piece between steps.
        """

        def agrees(piece: Piece) -> bool:
            quarters = np.linspace(piece.first, piece.last, 5)[1:-1].tolist()
            return all(abs(lag_at(place / self.rate) - piece.lag(place)) <= self.tolerance for place in quarters)

        return any(all(map(agrees, line)) for line in self.lines())

    def names_all(self, lags: Iterable[float]) -> bool:
        """Return whether all lags that a sure answer must name are among these."""
        given = list(lags)
        return all(any(abs(one - other) <= self.tolerance for other in given) for one in self.named)


def at_places(sound: Vector, places: Vector) -> Vector:
    """Return a sound at ascending places, interpolated after oversampling by eight, up to 0.93 of half its rate."""
    first = max(0, int(places[0]) - MARGIN)
    near = sound[first : int(places[-1]) + MARGIN]
    size = int(fft.next_fast_len(near.size + 256))
    # Single precision: half the time, and errors 130 dB below the sound.
    spectrum = fft.rfft(near.astype(np.float32), size)
    spectrum[int(0.93 * spectrum.size) :] = 0
    fine = 8.0 * fft.irfft(spectrum, 8 * size)
    whole, rest = np.divmod(8 * (places - first), 1)
    index = whole.astype(np.int64)
    return np.asarray(fine[index] * (1 - rest) + fine[index + 1] * rest)


def recorded_twice(
    source: Source, sizes: tuple[int, int], rate: float, lag: float, random: Random, ppm: float = 0.0
) -> Pair:
    """Return a sound recorded twice, `lag` samples later by recorder 2, whose clock is `ppm` faster."""
    before = MARGIN + max(0, int(lag))
    places = np.asarray(before + (np.arange(sizes[1]) - lag) / (1 + ppm * 1e-6), dtype=np.float64)
    sound = source(max(before + sizes[0], int(places[-1])) + MARGIN, rate, random)
    return sound[before : before + sizes[0]], at_places(sound, places)


def in_a_room(sound: Vector, rate: float, random: Random) -> Vector:
    """Return a sound with echoes that are sparse at first and decay by 60 dB in 0.1 to 0.6 s."""
    size = int(random.uniform(0.1, 0.6) * rate)
    time = np.arange(size)
    echoes = random.normal(size=size) * 10 ** (-3 * time / size)
    echoes *= random.random(size) < np.clip(time / (0.05 * rate), 0.02, 1)
    echoes[: int(0.001 * rate) + 1] = 0
    echoes *= 10 ** (-random.uniform(-3, 8) / 20) / np.sqrt(np.sum(echoes**2))
    echoes[0] = 1
    return np.asarray(signal.oaconvolve(sound, echoes)[: sound.size])


def by_microphone(sound: Vector, rate: float, random: Random) -> Vector:
    """Return a sound as recorded by one of four microphones: unchanged, band-limited, overdriven, or coloured."""
    kind = random.integers(4)
    if kind == 0:
        return sound
    edges = (random.uniform(50, 200), min(random.uniform(3000, 7000), 0.45 * rate))
    heard = signal.sosfilt(signal.butter(2, edges, "band", fs=rate, output="sos"), sound)
    if kind == 1:
        heard = np.tanh(2 / 3 * heard / heard.std())
    if kind == 2:
        heard = signal.lfilter([1, random.uniform(-0.6, 0.6)], [1], heard)
    return np.asarray(heard)


NOISE_COLOURS = (0.0, 0.7, 0.95)
"""Coefficients of the noise of recorders and their surroundings, from white to a rumble."""


def with_noise(sound: Vector, decibels: float, random: Random, colours: tuple[float, ...] = NOISE_COLOURS) -> Vector:
    """Return a sound with independent noise, `decibels` below it."""
    level = sound.std() * 10 ** (-decibels / 20)
    return np.asarray(sound + level * red(sound.size, random.choice(colours), random))


def sign(random: Random) -> int:
    """Return -1 or 1."""
    return int(random.choice([-1, 1]))


def typical_pair(
    random: Random, decibels: tuple[float, float], sources: tuple[Source, ...] = NOT_REPETITIVE
) -> tuple[Pair, float, float]:
    """Return 2 to 6 s of a sound recorded twice, each with its own noise; the rate, and the lag."""
    rate = float(random.choice([8000, 16000]))
    size = int(random.uniform(2, 6) * rate)
    lag = random.uniform(-0.2, 0.2) * size
    one, other = recorded_twice(one_of(sources, random), (size, size), rate, lag, random)
    return (
        (with_noise(one, random.uniform(*decibels), random), with_noise(other, random.uniform(*decibels), random)),
        rate,
        lag,
    )


def rooms(random: Random) -> Trial:
    """Two microphones in a room, with different echoes, noise and frequency responses."""
    rate = float(random.choice([8000, 16000, 44100]))
    size = int(random.uniform(2, 8) * rate)
    lag = random.uniform(-0.3, 0.3) * size
    pair = recorded_twice(one_of(SOUNDS, random), (size, size), rate, lag, random)
    heard = [by_microphone(in_a_room(one, rate, random), rate, random) for one in pair]
    noisy = [with_noise(one, random.uniform(-5, 6), random) for one in heard]
    # The sparse echoes of the first milliseconds may be louder than the direct sound.
    return Trial(noisy, rate, (lag,), tolerance=max(3.0, 0.0015 * rate))


def excerpts(random: Random) -> Trial:
    """Half a second to three seconds of a longer recording, by another microphone."""
    rate = float(random.choice([8000, 16000]))
    sizes = int(random.uniform(8, 25) * rate), int(random.uniform(0.5, 3) * rate)
    lag = -float(random.integers(0, sizes[0] - sizes[1]))
    one, other = recorded_twice(one_of(SOUNDS, random), sizes, rate, lag, random)
    other = by_microphone(other, rate, random)
    noisy = [with_noise(sound, random.uniform(-2, 12), random) for sound in (one, other)]
    return Trial(noisy, rate, (lag,), tolerance=3)


def different_lengths(random: Random) -> Trial:
    """A short recording and one a hundred times as long."""
    rate = 8000.0
    short = int(random.uniform(0.3, 0.7) * rate)
    lag = -float(random.integers(0, 99 * short))
    pair = recorded_twice(one_of(NOT_REPETITIVE, random), (100 * short, short), rate, lag, random)
    long_one, short_one = (with_noise(sound, random.uniform(6, 20), random) for sound in pair)
    if random.random() < 0.5:
        return Trial((short_one, long_one), rate, (-lag,))
    return Trial((long_one, short_one), rate, (lag,))


def short(random: Random) -> Trial:
    """64 to 500 samples of noise or of one chirp."""
    size, rate = int(random.integers(64, 501)), float(random.choice([100, 1000, 44100]))
    lag, colour = random.uniform(-0.3, 0.3) * size, random.choice([0.0, 0.5, 0.9])

    def noise(size: int, rate: float, random: Random) -> Vector:
        return red(size, colour, random)

    def chirp(size_of_source: int, rate: float, random: Random) -> Vector:
        sound, length = np.zeros(size_of_source), size // 4
        call = np.sin(np.pi * np.cumsum(np.linspace(0.05, 0.7, length))) * np.hanning(length)
        add(sound, MARGIN + size // 2 + max(0, int(lag)) - length // 2, call)
        return sound + 1e-3 * random.normal(size=size_of_source)

    pair = recorded_twice(noise if random.random() < 0.7 else chirp, (size, size), rate, lag, random)
    noisy = [with_noise(sound, random.uniform(6, 30), random, (0.0,)) for sound in pair]
    return Trial(noisy, rate, (lag,), tolerance=1.5)


def narrow_bands(random: Random) -> Trial:
    """Noise in a band of 5 to 30 % of its frequency: the next cycle fits almost as well."""
    rate = float(random.choice([8000, 16000, 32000]))
    size = int(random.uniform(1, 5) * rate)
    middle = random.uniform(0.08, 0.42) * rate
    half = random.uniform(0.025, 0.15) * middle
    band = signal.butter(4, (max(middle - half, 50), min(middle + half, 0.46 * rate)), "band", fs=rate, output="sos")

    def source(size: int, rate: float, random: Random) -> Vector:
        return np.asarray(signal.sosfilt(band, random.normal(size=size)))

    lag, quiet = random.uniform(-0.2, 0.2) * size, random.uniform(3, 40)
    pair = recorded_twice(source, (size, size), rate, lag, random)
    noisy = [with_noise(one, quiet, random, (0.0,)) for one in pair]
    return Trial(noisy, rate, (lag,), tolerance=max(0.6, 0.25 * rate / middle))


def calls(random: Random) -> Trial:
    """A few calls of birds or bats, 10 to 30 dB above the noise at their loudest."""
    is_bat = random.random() < 0.4
    rate = 192_000.0 if is_bat else float(random.choice([22050, 32000, 44100]))
    size = int((random.uniform(0.3, 0.8) if is_bat else random.uniform(2, 4)) * rate)
    band = (40e3, 90e3) if is_bat else ((5e3, 7e3), (2e3, 5e3))[int(random.integers(2))]
    seconds = 0.004 if is_bat else random.uniform(0.05, 0.25)

    def source(size: int, rate: float, random: Random) -> Vector:
        return chirps(size, rate, *band, seconds, random)

    lag, level = random.uniform(-0.12, 0.12) * size, 10 ** (random.uniform(10, 30) / 20)
    pair = recorded_twice(source, (size, size), rate, lag, random)
    noisy = [level * one / np.abs(one).max() + random.normal(size=size) for one in pair]
    return Trial(noisy, rate, (lag,))


def pulse_train(places: Vector, size: int, width: float, boxes: bool = False) -> Vector:
    """Return a pulse at each place: a Gaussian of standard deviation `width`, or a box of that width, samples."""
    train, reach = np.zeros(size), int(5 * width) + 2
    for place in places.tolist():
        near = np.arange(max(0, int(place) - reach), max(0, min(size, int(place) + reach + 1)))
        offset = near - place
        train[near] += (offset >= 0) & (offset < width) if boxes else np.exp(-0.5 * (offset / width) ** 2)
    return train


def by_two_recorders(places: Vector, size: int, rate: float, lag: float, ppm: float, random: Random) -> list[Vector]:
    """Return pulses of 1 to 50 ms at places in recording 1, as recorded by two recorders with different clocks."""
    width = max(1.0, 10 ** random.uniform(-3, -1.3) * rate)
    boxes, noise = random.random() < 0.5, 10 ** (-random.uniform(12, 60) / 20)
    trains = [pulse_train(recorded, size, width, boxes) for recorded in (places, lag + places * (1 + ppm * 1e-6))]
    return [train + noise * random.normal(size=size) for train in trains]


def regular_pulses(random: Random) -> Trial:
    """A regular pulse, recorded by two clocks: every period fits equally well."""
    rate = float(random.choice([250, 1000, 8000]))
    size = int((random.uniform(20, 200) if rate < 8000 else 10) * rate)
    period = rate * (random.uniform(0.3, 1.5) if rate < 8000 else random.uniform(0.1, 0.3))
    lag, ppm = random.uniform(0, period), float(random.choice([0, 30, 100, 300]) * sign(random))
    places = period * np.arange(-4, size // period + 4)
    pair = by_two_recorders(np.asarray(places), size, rate, lag, ppm, random)
    return Trial(pair, rate, (lag,), "ambiguous", ppm, tolerance=period)


def random_triggers(random: Random) -> Trial:
    """Pulses at random intervals over one to six minutes, recorded by two clocks that differ by up to 500 ppm."""
    rate = float(random.choice([250, 1000]))
    size = int(random.uniform(60, 360) * rate)
    lag, ppm = random.uniform(-0.15, 0.15) * size, float(random.choice([0, 30, 100, 250, 500]) * sign(random))
    gaps = rate * random.uniform(0.5, random.uniform(1.5, 5), int(4 * size / rate))
    pair = by_two_recorders(np.cumsum(gaps) - 0.3 * size, size, rate, lag, ppm, random)
    return Trial(pair, rate, (lag,), ppm=ppm)


def by_two_clocks(ppm: float, random: Random) -> Trial:
    """Return 15 to 60 s of a sound, recorded by two clocks that differ by `ppm`."""
    rate = 8000.0
    size = int(random.uniform(15, 60) * rate)
    lag, quiet = random.uniform(-0.2, 0.2) * size, random.uniform(3, 25)
    pair = recorded_twice(one_of(NOT_REPETITIVE, random), (size, size), rate, lag, random, ppm)
    return Trial([with_noise(one, quiet, random) for one in pair], rate, (lag,), ppm=ppm)


def drifting_clocks(random: Random) -> Trial:
    """Two clocks that differ by 30 to 1,000 ppm, over 15 to 60 s."""
    return by_two_clocks(sign(random) * float(random.choice([30, 60, 100, 250, 500, 1000])), random)


def clocks_far_apart(random: Random) -> Trial:
    """Two clocks that differ by 1,000 to 10,000 ppm (1 %), over 15 to 60 s."""
    return by_two_clocks(sign(random) * random.uniform(1_000, 10_000), random)


def interrupted(ppm: float, random: Random) -> Trial:
    """Return 15 to 40 s of a sound by two clocks, with one to three gaps of 20 ms to 0.5 s in either."""
    rate, growth = 8000.0, ppm * 1e-6
    size, start = int(random.uniform(15, 40) * rate), int(random.integers(-2000, 2001))
    count = int(random.integers(1, 4))
    heard = [np.arange(size, dtype=np.float64), (np.arange(size) - start) / (1 + growth)]
    steps, missing = [], 0.0
    for number in range(count):
        place = (number + random.uniform(0.8, 1.2)) * size / (count + 1)
        gap = int(random.uniform(0.02, 0.5) * rate)
        lag = start + growth * place + missing * (1 + growth)
        if random.random() < 0.5:
            heard[0][int(place) :] += gap
            missing += gap
        else:
            heard[1][int(place + lag) :] += gap
            missing -= gap
        steps.append((place, start + growth * place + missing * (1 + growth)))
    before = 2 * MARGIN
    sound = one_of(NOT_REPETITIVE, random)(before + int(max(places[-1] for places in heard)) + MARGIN, rate, random)
    decibels = random.uniform(6, 25)
    noisy = [with_noise(at_places(sound, before + places), decibels, random) for places in heard]
    return Trial(noisy, rate, (float(start),), ppm=ppm, steps=tuple(steps))


def dropped_buffers(random: Random) -> Trial:
    """Parts of 20 ms to half a second are missing in either recording."""
    return interrupted(0.0, random)


def drift_and_dropped_buffers(random: Random) -> Trial:
    """Parts are missing in either recording, and the clocks differ by 20 to 300 ppm."""
    return interrupted(sign(random) * random.uniform(20, 300), random)


def silent_gaps(random: Random) -> Trial:
    """Each recorder writes zeros or its last value for a while, and has an offset; the lag does not change."""
    (one, other), rate, lag = typical_pair(random, (6, 25))
    gappy = []
    for sound in (one, other):
        with_gaps = sound + random.uniform(-2, 2) * sound.std()
        for start in random.integers(0, sound.size, random.integers(1, 5)).tolist():
            stop = start + int(random.uniform(0.02, 0.5) * rate)
            with_gaps[start:stop] = with_gaps[start] if random.random() < 0.5 else 0
        gappy.append(with_gaps)
    return Trial(gappy, rate, (lag,))


def common_noise(random: Random) -> Trial:
    """Two microphones on one recorder, which adds the same hum or noise to both, 0 to 15 dB below the sound."""
    rate = 16_000.0
    size, lag = int(random.uniform(2, 6) * rate), float(sign(random) * random.integers(4, 400))
    pair = recorded_twice(one_of(NOT_REPETITIVE, random), (size, size), rate, lag, random)
    level = pair[0].std()
    own = red(size, random.choice([0, 0.9]), random) if random.random() < 0.7 else hum(size, rate, random)
    own *= level / own.std() * 10 ** (-random.uniform(0, 15) / 20)
    noisy = [one + own + 0.03 * level * random.normal(size=size) for one in pair]
    return Trial(noisy, rate, (lag, 0.0), "any", named=(lag,))


def tone(pitch: float, size: int, rate: float, start: float, levels: Vector, random: Random) -> Vector:
    """Return harmonics of `pitch` Hz from `start` seconds on."""
    return harmonics(np.asarray(2 * np.pi * pitch * (np.arange(size) / rate + start)), levels, random)


def hum(size: int, rate: float, random: Random, start: float = 0.0) -> Vector:
    """Return mains hum from `start` seconds on: 50 Hz and its harmonics."""
    count = min(7, int(0.4 * rate // 50))
    return tone(50, size, rate, start, random.uniform(0.1, 1, count), random)


def louder_echo(random: Random) -> Trial:
    """The second microphone records a reflection louder than the direct sound."""
    rate = 16_000.0
    size, lag, later = int(random.uniform(2, 6) * rate), int(random.integers(-200, 200)), int(random.integers(60, 1500))
    sound = one_of(NOT_REPETITIVE, random)(size + 2 * MARGIN, rate, random)
    direct, reflected = (sound[MARGIN - one : MARGIN - one + size] for one in (lag, lag + later))
    heard = random.uniform(0.4, 0.7) * direct + reflected
    pair = with_noise(sound[MARGIN : MARGIN + size], 20, random), with_noise(heard, 20, random)
    return Trial(pair, rate, (float(lag), float(lag + later)), "any", named=(float(lag),))


def jingle_heard_twice(random: Random) -> Trial:
    """A jingle that occurs twice: in recording 2 only, so that two lags are true, or in the scene that both record."""
    rate = 8000.0
    jingle = music(int(random.uniform(1, 3) * rate), rate, random)
    size = int(random.uniform(8, 20) * rate)
    first = int(random.integers(0, size // 2 - jingle.size))
    second = int(random.integers(size // 2, size - jingle.size))
    if random.random() < 0.5:
        background = [
            0.3 * jingle.std() * one / one.std() for one in (speech(size, rate, random), wind(size, rate, random))
        ]
        once = int(random.integers(0, size - jingle.size))
        add(background[0], once, jingle)
        for start in (first, second):
            add(background[1], start, jingle)
        lags = (float(first - once), float(second - once))
        return Trial(background, rate, lags, "any", named=lags)

    def scene(size: int, rate: float, random: Random) -> Vector:
        sound = one_of((speech, footsteps, workshop, traffic), random)(size, rate, random)
        sound *= random.uniform(0.3, 1) * jingle.std() / sound.std()
        for start in (first, second):
            add(sound, MARGIN + start, jingle)
        return sound

    lag = random.uniform(-0.15, 0.15) * size
    pair = recorded_twice(scene, (size, size), rate, lag, random)
    return Trial([with_noise(one, random.uniform(6, 20), random) for one in pair], rate, (lag,))


def low_passed_sensor(random: Random) -> Trial:
    """A sensor without high frequencies, such as one behind a wall, and one with all."""
    pair, rate, lag = typical_pair(random, (6, 25), (speech, crowd, music, traffic, wind, rain, workshop, white))
    edge = random.uniform(0.02, 0.1) * rate
    # Forwards and backwards, so that the filter has no delay.
    dull = signal.sosfiltfilt(signal.butter(int(random.integers(1, 4)), edge, fs=rate, output="sos"), pair[0])
    dull = with_noise(np.asarray(dull), random.uniform(10, 30), random, (0.0,))
    tolerance = max(2.0, 0.1 * rate / edge)
    if random.random() < 0.5:
        return Trial((pair[1], dull), rate, (-lag,), tolerance=tolerance)
    return Trial((dull, pair[1]), rate, (lag,), tolerance=tolerance)


def inverted_polarity(random: Random) -> Trial:
    """One microphone is wired the wrong way round."""
    (one, other), rate, lag = typical_pair(random, (3, 20))
    return Trial((one, -other), rate, (lag,), "any")


def tones(random: Random) -> Trial:
    """One tone of any period with up to four harmonics, recorded twice: every period fits equally well."""
    rate = float(random.choice([8000, 44100]))
    size, pitch = int(random.uniform(1, 4) * rate), random.uniform(50, 0.4 * rate)
    levels = np.array([1.0, *random.uniform(0, 1, 3)])[: max(1, int(random.integers(0, 5)))]
    levels = levels[: max(1, int(0.45 * rate // pitch))]
    noise, seed = random.choice([0, 0.1, 1]), random.integers(2**32)
    # The same seed, so that the harmonics have the same relative phases in both recordings.
    pair = [
        tone(pitch, size, rate, start, levels, np.random.default_rng(seed))
        for start in (0.0, random.uniform(0, 1 / pitch))
    ]
    return Trial([one + noise * random.normal(size=size) for one in pair], rate, (), "ambiguous")


def offset_and_wander(random: Random) -> Trial:
    """An offset up to a hundred times the sound and a wandering baseline, different in each recording."""
    pair, rate, lag = typical_pair(random, (6, 25))
    moved = []
    for sound in pair:
        level, turns = sound.std(), int(random.integers(2, 12))
        wander = np.interp(
            np.arange(sound.size), np.linspace(0, sound.size, turns), np.cumsum(random.normal(size=turns))
        )
        moved.append(sound + level * (random.uniform(-100, 100) + random.uniform(0.3, 5) * wander))
    return Trial(moved, rate, (lag,))


def clipped(random: Random) -> Trial:
    """One recording, or both, clipped at 10 to 50 % of the peak."""
    pair, rate, lag = typical_pair(random, (3, 20))
    limits = [random.uniform(0.1, 0.5) * np.abs(sound).max() for sound in pair]
    if random.random() < 0.5:
        limits[0] = np.inf
    return Trial([np.clip(sound, -limit, limit) for sound, limit in zip(pair, limits, strict=True)], rate, (lag,))


def eight_bits(random: Random) -> Trial:
    """Integers from -128 to 127, in a recording that uses all or few of them."""
    pair, rate, lag = typical_pair(random, (3, 20))
    steps = [min(random.choice([1.0, 3.0, 127.0]), 127 * sound.std() / np.abs(sound).max()) for sound in pair]
    coarse = [np.clip(np.round(step * sound / sound.std()), -128, 127) for sound, step in zip(pair, steps, strict=True)]
    return Trial(coarse, rate, (lag,))


def loggers(random: Random) -> Trial:
    """Two sensors of one heart, walk, sea or earthquake: 25 to 500 samples a second over 0.5 to 5 minutes."""
    source = one_of(SLOW_SIGNALS, random)
    rate = float(random.choice([250, 500] if source is heartbeats else [25, 50, 100]))
    size = int(random.uniform(30, 300) * rate)
    lag = random.uniform(-0.15, 0.15) * size
    pair = recorded_twice(source, (size, size), rate, lag, random)
    noisy = [random.uniform(0.1, 50) * with_noise(one, random.uniform(6, 25), random, (0.0, 0.7)) for one in pair]
    return Trial(noisy, rate, (lag,))


UNRELATED_SOURCES: tuple[Source, ...] = (*SOUNDS, birds, bang, walk)


def unrelated(pair: Sequence[Vector], rate: float) -> Trial:
    """Return recordings that have nothing in common."""
    return Trial(pair, rate, (), "nothing")


def unrelated_sounds(random: Random) -> Trial:
    """Two recordings of any two sounds."""
    rate = float(random.choice([8000, 16000]))
    sizes = (int(random.uniform(1, 8) * rate) for _ in range(2))
    return unrelated([one_of(UNRELATED_SOURCES, random)(size, rate, random) for size in sizes], rate)


def unrelated_noise(random: Random) -> Trial:
    """Two noises of any colour, or two random walks."""
    size = int(10 ** random.uniform(2, 5))
    if random.random() < 0.3:
        return unrelated([walk(size, 1.0, random) for _ in range(2)], 1000.0)
    return unrelated([red(size, random.uniform(-0.5, 0.99), random) for _ in range(2)], 44_100.0)


def unrelated_likes(random: Random) -> Trial:
    """Two recordings of one kind of sound: two speakers, two pieces of music, two engines."""
    source, rate = one_of((speech, crowd, music, engine, claps, footsteps, workshop), random), 8000.0
    return unrelated([source(int(random.uniform(1, 8) * rate), rate, random) for _ in range(2)], rate)


def unrelated_calls(random: Random) -> Trial:
    """Two birds, or two bats, of one species."""
    is_bat = random.random() < 0.4
    rate, size = (192_000.0, 100_000) if is_bat else (32_000.0, int(random.uniform(2, 4) * 32_000))
    band, seconds = ((40e3, 90e3), 0.004) if is_bat else ((2e3, 6e3), random.uniform(0.05, 0.25))
    level = 10 ** (random.uniform(10, 30) / 20)
    return unrelated(
        [level * chirps(size, rate, *band, seconds, random) + random.normal(size=size) for _ in range(2)], rate
    )


def unrelated_pulses(random: Random) -> Trial:
    """Two regular pulse trains of different periods, a regular and a random one, or two hearts."""
    rate = 250.0
    size = int(random.uniform(20, 120) * rate)
    if random.random() < 0.4:
        return unrelated([heartbeats(size, rate, random) for _ in range(2)], rate)
    width, noise = max(1.0, random.uniform(0.004, 0.03) * rate), 10 ** (-random.uniform(10, 35) / 20)

    def train(regular: bool) -> Vector:
        period = random.uniform(0.3, 1.5) * rate
        gaps = period * (np.ones(4 * size) if regular else random.uniform(0.6, 2, 4 * size))
        return pulse_train(np.cumsum(gaps)[: int(size / period) + 2] - period, size, width) + noise * random.normal(
            size=size
        )

    return unrelated((train(True), train(random.random() < 0.5)), rate)


def unrelated_slow_signals(random: Random) -> Trial:
    """Two walkers, two seas, or two earthquakes."""
    source, rate = one_of(SLOW_SIGNALS[1:], random), float(random.choice([25, 50, 100]))
    return unrelated([source(int(random.uniform(30, 200) * rate), rate, random) for _ in range(2)], rate)


def one_hum(random: Random) -> Trial:
    """Two unrelated sounds with the same mains hum, 20 dB below to 6 dB above them."""
    rate = float(random.choice([8000, 16000]))
    size, seed = int(random.uniform(1, 8) * rate), random.integers(2**32)
    mixed = []
    for _ in range(2):
        sound = one_of(SOUNDS, random)(size, rate, random)
        level = sound.std() * 10 ** (random.uniform(-20, 6) / 20)
        mains = hum(size, rate, np.random.default_rng(seed), random.uniform(0, 0.02))
        mixed.append(sound + level * mains / mains.std())
    return unrelated(mixed, rate)


KINDS: dict[str, Kind] = {
    kind.__name__.replace("_", " "): kind
    for kind in (
        rooms,
        excerpts,
        different_lengths,
        short,
        narrow_bands,
        calls,
        regular_pulses,
        random_triggers,
        drifting_clocks,
        clocks_far_apart,
        dropped_buffers,
        drift_and_dropped_buffers,
        silent_gaps,
        common_noise,
        louder_echo,
        jingle_heard_twice,
        low_passed_sensor,
        inverted_polarity,
        tones,
        offset_and_wander,
        clipped,
        eight_bits,
        loggers,
        unrelated_sounds,
        unrelated_noise,
        unrelated_likes,
        unrelated_calls,
        unrelated_pulses,
        unrelated_slow_signals,
        one_hum,
    )
}


def trial(kind: str, seed: int) -> Trial:
    """Return one pair of a kind of :data:`KINDS`."""
    return KINDS[kind](np.random.default_rng([*kind.encode(), seed]))
