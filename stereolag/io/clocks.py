"""Recordings in time: channels on one even clock, at another rate, two at one.

Samples taken at times that a file gives are brought onto an even clock.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from fractions import Fraction
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt
import scipy  # loads scipy.signal on first use only, since that takes a second

from stereolag.core.arrays import Vector
from stereolag.core.jobs import Estimate, check_memory, limits
from stereolag.core.typography import counted, four_digits
from stereolag.io.formats import WHAT
from stereolag.io.sources import quote
from stereolag.io.stamps import Epoch, Times, granule

MAX_CHANNELS = 64
MOST_TOLD = 3
"""Gaps that are named one by one."""

MOST_TERMS = 100_000
"""Largest term in the ratio of two sampling rates: the filter between them is twenty times as long."""
MOST_SLIP = 0.5
"""Samples by which a recording may be off at its end if the ratio of two rates is rounded to such terms."""

LONGEST_DOUBLE = 30_000_000
"""Samples, all channels, above which a recording is kept with the 24 bits of float32: 11 minutes at 44.1 kHz."""

COMPARED = 100_000
"""About as many samples of two recordings are compared."""
SAME = 1e-6
"""Share of its power by which a recording may differ from another and be the same signal: two sensors differ more."""
FEWEST_LEVELS = 100
"""Recordings of fewer values, such as triggers and counters, may be alike though two sensors made them."""
ONE_SIGNAL = (
    "Both recordings are one signal, saved twice: there is one sensor behind them, and a lag of 0 says nothing."
)

Channels: TypeAlias = npt.NDArray[np.float32] | npt.NDArray[np.float64]


@dataclass(frozen=True)
class Gap:
    """A stretch of a recording that its file lacks: where it begins and how long it is, s after the first sample."""

    start_s: float
    length_s: float


@dataclass(frozen=True, eq=False)
class Recording:
    """A recording read from a file; it converts to an array of its samples, so ``signal_lag`` accepts it directly.

    Attributes
    ----------
    channels
        (channels, samples) float64, all finite; audio is scaled to -1..1. Float32 above 30 million samples in all.
    sampling_rate
        Samples per second: of audio, or by a file's column of times; None if the file does not state it.
    mended_lines
        Number of damaged lines of a text that were mended.
    resampled_from
        The samples per second of the file if :meth:`resampled` changed them; otherwise None.
    start_s
        Time of the first sample by the file's own clock, s; 0 if it has none.
    epoch
        What `start_s` counts from: ``"1970"`` if the file gives dates (in UTC if it gives a zone, otherwise as
        written), ``"midnight"`` if times of day, otherwise ``"start"``: a zero of the file's own.
    gaps
        Stretches that the file lacks, filled by a straight line, or by silence in a video.
    names
        Name of each channel in the file, with its unit; empty if it has none.
    numbers
        Number of each channel in the file, from 1: of columns of numbers, the times and words count as well.
    tracks, track
        Names of the audio tracks of a video, of the arrays of an NPZ or MAT file, or of sensors that take turns in a
        text; and the number, from 1, of the one that was read.
    notes
        What was mended or left out, one short phrase each.
    """

    channels: Channels
    sampling_rate: float | None
    mended_lines: int = 0
    resampled_from: float | None = None
    start_s: float = 0.0
    epoch: Epoch = "start"
    gaps: tuple[Gap, ...] = ()
    names: tuple[str, ...] = ()
    numbers: tuple[int, ...] = ()
    tracks: tuple[str, ...] = ("1",)
    track: int = 1
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        count = len(self.channels)
        object.__setattr__(self, "names", self.names or ("",) * count)
        object.__setattr__(self, "numbers", self.numbers or tuple(range(1, count + 1)))

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> npt.NDArray[Any]:
        """Return (samples,) for a single channel, or (channels, samples) for several."""
        samples = self.channels[0] if len(self.channels) == 1 else self.channels
        return np.array(samples, dtype=dtype, copy=copy)

    @property
    def highest(self) -> int:
        """Highest number of a channel; 1 if there is only one channel, whatever its number."""
        return max(self.numbers) if len(self.numbers) > 1 else 1

    @property
    def start(self) -> datetime | None:
        """Date and time of the first sample, None if the file gives no date."""
        return datetime.fromtimestamp(0, UTC) + timedelta(seconds=self.start_s) if self.epoch == "1970" else None

    @property
    def remarks(self) -> list[str]:
        """What is to be said about the recording, besides its length and rate: short phrases."""
        said = [f"{self.mended_lines} damaged line{'s' * (self.mended_lines > 1)} mended"] if self.mended_lines else []
        for gap in self.gaps[:MOST_TOLD]:
            said.append(f"{four_digits(gap.length_s)} s missing after {gap.start_s:.6g} s, filled")
        if len(self.gaps) > MOST_TOLD:
            said.append(f"{len(self.gaps)} gaps of {four_digits(sum(gap.length_s for gap in self.gaps))} s in all")
        if self.epoch != "start":
            moment = datetime.fromtimestamp(0, UTC) + timedelta(seconds=round(self.start_s, 6))
            when = f"{moment:%Y-%m-%d %H:%M:%S.%f}" if self.start else f"{moment:%H:%M:%S.%f}"
            said.append(f"begins {when.removesuffix('.000000')}")
        elif self.start_s:
            said.append(f"begins at {self.start_s:.6g} s")
        if len(self.tracks) > 1:
            said.append(f"track {self.track} of {len(self.tracks)}")
        return [*said, *self.notes]

    def resampled(self, sampling_rate: float) -> Recording:
        """Return the recording at another rate, by :func:`scipy.signal.resample_poly`; itself if the rate is its own.

        Nothing is delayed: the first sample stays the first. Frequencies above half the lower rate are lost.

        Raises
        ------
        ValueError
            A recording whose file states no rate, a rate that is not positive and finite, rates whose ratio needs
            numbers above 100,000 to be right to half a sample at the end, or more samples than the limit in
            force.
        """
        if self.sampling_rate is None:
            raise ValueError(f"The {WHAT} states no sampling rate, so it cannot be resampled to {sampling_rate:g} Hz.")
        if not (np.isfinite(sampling_rate) and sampling_rate > 0):
            raise ValueError(f"sampling_rate is {sampling_rate!r} Hz; it must be a positive, finite number.")
        if sampling_rate == self.sampling_rate:
            return self
        ratio = Fraction(sampling_rate) / Fraction(self.sampling_rate)
        near = ratio.limit_denominator(min(MOST_TERMS, max(1, int(MOST_TERMS / ratio))))
        if not near or abs(near / ratio - 1) * self.channels.shape[1] > MOST_SLIP:
            raise ValueError(
                f"The {WHAT} has {self.sampling_rate:,.10g} samples a second and {sampling_rate:,.10g} are asked for; "
                f"their ratio is {ratio.numerator} : {ratio.denominator}, and numbers up to {MOST_TERMS:,} are allowed."
            )
        up, down = near.numerator, near.denominator
        check_size(len(self.channels), -(-self.channels.shape[1] * up // down))
        # A line continues the recording beyond its ends, so that an offset makes no step to zero.
        channels = scipy.signal.resample_poly(self.channels, up, down, axis=1, padtype="line")
        kept = self.resampled_from or self.sampling_rate
        return replace(self, channels=channels, sampling_rate=sampling_rate, resampled_from=kept)

    def channel(self, number: int) -> Recording:
        """Return the channel with this number in the file as a recording of its own.

        Raises
        ------
        ValueError
            No such channel, or a column of times or words.
        """
        if number not in self.numbers:
            raise ValueError(f"The channel number is {number}; the {WHAT} has {numbered(self.numbers)}.")
        index = self.numbers.index(number)
        chosen = slice(index, index + 1)
        return replace(self, channels=self.channels[chosen], names=self.names[chosen], numbers=(number,))


def numbered(numbers: tuple[int, ...]) -> str:
    """Return the numbers of channels in words: "channels 2, 3"."""
    return f"channel{'s' * (len(numbers) > 1)} {', '.join(map(str, numbers))}"


def at_one_rate(first: Recording, second: Recording) -> tuple[Recording, Recording]:
    """Return both at the lower of their rates, which keeps all the frequencies that they can have in common.

    If the file of one states no rate, both are assumed to have the same and returned unchanged.

    Raises
    ------
    ValueError
        As :meth:`Recording.resampled`.
    """
    if first.sampling_rate is None or second.sampling_rate is None:
        return first, second
    lower = min(first.sampling_rate, second.sampling_rate)
    return first.resampled(lower), second.resampled(lower)


def starts_apart(first: Recording, second: Recording) -> float | None:
    """Return how much later the second recording begins by dates or times of day, s; None if the files give none."""
    if first.epoch != second.epoch or first.epoch == "start":
        return None
    return second.start_s - first.start_s


def saved_twice(first: Recording, second: Recording) -> str:
    """Return a sentence if two recordings, of a channel each, are one signal, as loud or not; "" otherwise."""
    one, other = (
        recording.channels[0, :: recording.channels.shape[1] // COMPARED + 1] for recording in (first, second)
    )
    if first.channels.shape != second.channels.shape or np.unique(one).size < FEWEST_LEVELS:
        return ""
    one, other = one - one.mean(dtype=np.float64), other - other.mean(dtype=np.float64)
    together, apart = np.vdot(one, other) ** 2, np.vdot(one, one) * np.vdot(other, other)
    return ONE_SIGNAL if together > (1 - SAME) * apart > 0 else ""


def chosen_track(tracks: Sequence[str], track: int | str) -> int:
    """Return the number of a track, from 1, given its number or its name.

    Raises
    ------
    ValueError
        No such track; the error lists those there are.
    """
    name = str(track)
    number = tracks.index(name) + 1 if name in tracks else int(name) if name.isascii() and name.isdigit() else 0
    if not 1 <= number <= len(tracks):
        there = ", ".join(map(quote, tracks[:MAX_CHANNELS]))
        raise ValueError(f"The {WHAT} has no track {quote(name)}; there {'are' if len(tracks) > 1 else 'is'} {there}.")
    return number


def check_size(channels: int, samples: int) -> None:
    """Refuse a recording that has too few samples or too many; called before they are read.

    Raises
    ------
    ValueError
        No channels or more than 64, fewer than 2 samples, more in all than the limit in force or than fit into memory.
    """
    if not 1 <= channels <= MAX_CHANNELS:
        raise ValueError(f"The {WHAT} has {channels} channels; allowed are 1 to {MAX_CHANNELS}.")
    if samples < 2:
        raise ValueError(f"The {WHAT} holds {counted(samples, 'sample')}; at least 2 are needed.")
    if channels * samples > limits().max_samples:
        raise ValueError(
            f"The {WHAT} holds {channels} × {samples} samples; at most {limits().max_samples:,} in all are accepted."
        )
    if channels * samples > LONGEST_DOUBLE:
        check_memory(Estimate(channels * samples * np.dtype(np.float32).itemsize, 0.0))


def float_type(samples: int) -> Literal["float32", "float64"]:
    """Return the type in which a recording of so many samples, of all channels, is kept."""
    return "float64" if samples <= LONGEST_DOUBLE else "float32"


# Times as a file gives them, one for each sample.

FEWEST_TICKS = 10
UNEVENNESS = 1e-3
"""Largest deviation of a column of times from a straight line, as a share of its length, if nothing else names it."""

COARSE = 0.2
"""Share of samples with the time of the one before, above which a clock is coarser than the samples."""

LONG_STEP = 1.5
"""A step of this many usual ones is a gap."""

EXACT = 0.98
"""Share of steps that are the same, above which the times are exact and another step is a gap."""

SLACK = 0.02
"""Deviation from an even clock that is not corrected, in samples; more if the times are rounded to coarser steps."""

ROUNDED = 2e-3
"""Share by which the rate of an uneven clock may be rounded: its samples are interpolated at any rate."""

MOST_FILLED = 20
"""Samples of the even clock for each that the file holds: beyond, nearly all would be gaps."""


def rises_evenly(times: Vector) -> bool:
    """Return whether times never fall and follow a straight line, apart from gaps and the rounding of their numbers."""
    if times.size < FEWEST_TICKS or (np.diff(times[:1000]) < 0).any() or not np.isfinite(times).all():
        return False
    steps = np.diff(times)
    if (steps < 0).any() or times[-1] <= times[0]:
        return False
    usual = steps[steps <= LONG_STEP * np.median(steps) + granule(times)]
    even = np.concatenate(([0.0], np.cumsum(usual)))
    straight = np.linspace(0.0, even[-1], even.size)
    # A few gaps may be there: the rest is even.
    return usual.size >= 0.9 * steps.size and bool(np.abs(even - straight).max() <= UNEVENNESS * even[-1])


def on_even_clock(clock: Times, values: Channels) -> Recording:
    """Return samples taken at given times on one even clock, so that sample numbers are true to time.

    If the times are even apart from gaps and their rounding, samples stay as they are, each in the place that its time
    gives it. Otherwise they are interpolated linearly. Gaps, and missing values, are filled by a straight line.

    Parameters
    ----------
    clock
        N times, none falling or missing; if the clock is coarser than the samples, several have the same time, and are
        spread evenly.
    values
        (channels, N), NaN where a value is missing.

    Raises
    ------
    ValueError
        Times that are all the same, or so far apart that nearly everything would be a gap; too many samples.
    """
    notes = []
    times, rounding = clock.seconds, clock.rounding
    same = np.diff(times) == 0
    if is_coarse := same.mean() > COARSE:
        times, rounding = _spread(times)
        notes.append("several samples with one time, spread evenly")
    elif same.any() and (
        rounding < np.median(np.diff(times)) / 2
        or np.array_equal(values[:, 1:][:, same], values[:, :-1][:, same], equal_nan=True)  # lines written twice
    ):
        kept = np.concatenate(([True], ~same))
        times, values = times[kept], values[:, kept]
        notes.append(f"{int(same.sum())} of two samples with one time left out")
    steps = np.diff(times)
    if not steps.size or times[-1] <= times[0]:
        raise ValueError(f"The times of the {WHAT} are all the same; they must rise.")
    usual_step = float(np.median(steps))
    # If times were rounded about as coarsely as the step is long, the steps would differ.
    is_exact = rounding > usual_step / 4 and (np.abs(steps / usual_step - 1) < SLACK).mean() > EXACT
    slack = 0.0 if is_exact else rounding
    long = LONG_STEP * max(usual_step, float(np.quantile(steps, 0.9))) + slack
    usual = steps[steps <= long]
    step, is_even = float(usual.mean()), True
    doubt = rounding if is_coarse else min(rounding, float(np.ptp(usual)))
    step = _round_step(step, doubt / usual.size + 1e-9 * step)
    positions = np.empty(times.size)
    ends = np.flatnonzero(steps > long)
    for first, last in zip(np.r_[0, ends + 1], np.r_[ends + 1, times.size], strict=True):
        places = (times[first:last] - times[0]) / step
        offset = float((places - np.arange(places.size)).mean())
        deviation = float(np.abs(places - np.arange(places.size) - offset).max())
        is_even &= max(deviation, abs(offset - round(offset)) if first else 0.0) <= SLACK + slack / step
        positions[first:last] = np.round(offset) + np.arange(places.size) if first else np.arange(places.size)
    if not is_even or (np.diff(positions) <= 0).any():
        step = _round_step(step, ROUNDED * step)
        positions = (times - times[0]) / step
        notes.append("uneven times, interpolated onto an even clock")
    total = math.floor(positions[-1] + 0.5) + 1
    if total > MOST_FILLED * times.size:
        raise ValueError(
            f"The times of the {WHAT} jump by {steps.max():,.4g} s after {times[steps.argmax()] - times[0]:,.4g} s, "
            f"while its usual step is {step:.4g} s; cut the file there, or correct its times."
        )
    check_size(len(values), total)
    gaps = tuple(Gap(float(positions[end] * step), float(steps[end] - step)) for end in ends)
    is_whole = total == times.size and (positions == np.arange(total)).all()
    channels = filled(values, None if is_whole else positions, total)
    rate = float(f"{1 / step:.12g}")  # 99 and not 98.99999999999999
    return Recording(
        channels, rate, start_s=clock.start_s + float(times[0]), epoch=clock.epoch, gaps=gaps, notes=tuple(notes)
    )


def filled(values: Channels, positions: Vector | None, total: int) -> Channels:
    """Return (channels, total) values on a straight line between those given, which NaN are not.

    They are given at `positions`, or each in its own place if that is None.
    """
    dtype = float_type(len(values) * total)
    if positions is None and not any(np.isnan(channel).any() for channel in values):
        return values.astype(dtype, copy=False)
    channels, places = np.empty((len(values), total), dtype), np.arange(total)
    at = places if positions is None else positions
    for channel, given in zip(channels, values, strict=True):
        there = ~np.isnan(given)
        channel[:] = np.interp(places, at[there], given[there])
    return channels


def _spread(times: Vector) -> tuple[Vector, float]:
    """Return times of a coarse clock spread evenly between its ticks, and by how much they may then be wrong, s."""
    ticks, first, counts = np.unique(times, return_index=True, return_counts=True)
    if ticks.size < 2:
        return times, 0.0
    tick, usual = float(np.median(np.diff(ticks))), float(np.median(counts[1:-1]) if ticks.size > 2 else counts.max())
    within = np.arange(times.size) - np.repeat(first, counts)
    # A recording begins and ends within a tick; what there is of the first lies at its end.
    spacing = tick / np.concatenate(([max(usual, counts[0])], counts[1:-1], [max(usual, counts[-1])]))
    late = np.zeros(ticks.size)
    late[0] = tick - counts[0] * spacing[0]
    return np.repeat(ticks + late, counts) + within * np.repeat(spacing, counts), tick / usual


def _round_step(step: float, doubt: float) -> float:
    """Return the step, or the rate, of fewest digits that is within the doubt about it, as a step."""
    for digits in range(15):
        for candidate in (1 / float(f"{1 / step:.{digits}e}"), float(f"{step:.{digits}e}")):
            if abs(candidate - step) <= doubt:
                return candidate
    return step
