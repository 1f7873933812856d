"""Recordings: channels on one even clock, resampled to another rate or to that of another recording.

Samples with times of their own, as a file gives them, are put on an even clock.
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
from stereolag.io.stamps import Epoch, Times, rounding_step

MAX_CHANNELS = 64
MAX_GAPS_NAMED = 3
"""Gaps that are named one by one; more are added up."""

MAX_RATIO_TERM = 100_000
"""Largest term in the ratio of two sampling rates: the resampling filter is twenty times as long."""

MAX_FLOAT64_SAMPLES = 30_000_000
"""Samples of all channels above which a recording is kept as float32 (24 bits): 11 minutes at 44.1 kHz."""

COMPARED_SAMPLES = 100_000
"""Approximate number of samples compared to tell whether two recordings are one signal."""
MAX_DUPLICATE_RESIDUAL = 1e-6
"""Share of its power by which a recording may differ from another and be the same signal: two sensors differ more."""
MIN_LEVELS = 100
"""Recordings with fewer distinct values, such as triggers and counters, may be equal though two sensors made them."""
DUPLICATE_WARNING = (
    "Both recordings are one signal, saved twice: there is one sensor behind them, and a lag of 0 says nothing."
)

Channels: TypeAlias = npt.NDArray[np.float32] | npt.NDArray[np.float64]


@dataclass(frozen=True)
class Gap:
    """A stretch missing from a file: its start, s after the first sample, and its length, s."""

    start_s: float
    length_s: float


@dataclass(frozen=True, eq=False)
class Recording:
    """A recording read from a file; it converts to an array of its samples, so ``signal_lag`` accepts it directly.

    Attributes
    ----------
    channels
        (channels, samples) float64, all finite; audio is scaled to -1..1. Float32 above 30 million samples in total.
    sampling_rate
        Samples per second, as stated by the file or derived from its column of times; None if it gives neither.
    mended_lines
        Number of damaged lines of text that were mended.
    resampled_from
        The sampling rate of the file if :meth:`resampled` changed it; otherwise None.
    start_s
        Time of the first sample by the file's own clock, s; 0 if it has none.
    epoch
        Zero of `start_s`: ``"1970"`` if the file gives dates (in UTC if it gives a zone, otherwise as written),
        ``"midnight"`` if it gives times of day, otherwise ``"start"``, the file's own zero.
    gaps
        Stretches missing from the file, filled by a straight line, or by silence in sound.
    names
        Name of each channel in the file, with its unit; empty if it has none.
    numbers
        Number of each channel in the file, from 1; in a table, columns of times and words count as well.
    tracks, track
        Names of the audio tracks of a video, of the arrays of an NPZ or MAT file, or of sensors that take turns in a
        text; and the number, from 1, of the one that was read.
    notes
        Repairs and omissions, a short phrase each.
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
        return np.array(self.channels[0] if len(self.channels) == 1 else self.channels, dtype=dtype, copy=copy)

    @property
    def highest_channel(self) -> int:
        """The highest channel number; 1 if there is only one channel, whatever its number."""
        return max(self.numbers) if len(self.numbers) > 1 else 1

    @property
    def start(self) -> datetime | None:
        """Date and time of the first sample, None if the file gives no date."""
        return datetime.fromtimestamp(0, UTC) + timedelta(seconds=self.start_s) if self.epoch == "1970" else None

    @property
    def remarks(self) -> list[str]:
        """Repairs, gaps, start and track of the recording: short phrases."""
        phrases = [f"{counted(self.mended_lines, 'damaged line')} mended"] if self.mended_lines else []
        phrases += [
            f"{four_digits(gap.length_s)} s missing after {gap.start_s:.6g} s, filled"
            for gap in self.gaps[:MAX_GAPS_NAMED]
        ]
        if len(self.gaps) > MAX_GAPS_NAMED:
            phrases.append(f"{len(self.gaps)} gaps of {four_digits(sum(gap.length_s for gap in self.gaps))} s in total")
        if self.epoch != "start":
            moment = datetime.fromtimestamp(0, UTC) + timedelta(seconds=round(self.start_s, 6))
            when = f"{moment:%Y-%m-%d %H:%M:%S.%f}" if self.start else f"{moment:%H:%M:%S.%f}"
            phrases.append(f"begins {when.removesuffix('.000000')}")
        elif self.start_s:
            phrases.append(f"begins at {self.start_s:.6g} s")
        if len(self.tracks) > 1:
            phrases.append(f"track {self.track} of {len(self.tracks)}")
        return [*phrases, *self.notes]

    def resampled(self, sampling_rate: float) -> Recording:
        """Return the recording at another rate, by :func:`scipy.signal.resample_poly`; itself if it has that rate.

        There is no delay: the first sample keeps its time. Frequencies above half the lower rate are lost.

        Raises
        ------
        ValueError
            A recording without a sampling rate, a rate that is not positive and finite, rates whose ratio needs terms
            above 100,000 to be exact to half a sample at the end, or more samples than the current limit.
        """
        if self.sampling_rate is None:
            raise ValueError(f"The {WHAT} states no sampling rate, so it cannot be resampled to {sampling_rate:g} Hz.")
        if not (np.isfinite(sampling_rate) and sampling_rate > 0):
            raise ValueError(f"sampling_rate is {sampling_rate!r} Hz; it must be a positive, finite number.")
        if sampling_rate == self.sampling_rate:
            return self
        ratio = Fraction(sampling_rate) / Fraction(self.sampling_rate)
        rounded = ratio.limit_denominator(min(MAX_RATIO_TERM, max(1, int(MAX_RATIO_TERM / ratio))))
        if not rounded or abs(rounded / ratio - 1) * self.channels.shape[1] > 0.5:  # samples at the end
            raise ValueError(
                f"The {WHAT} has {self.sampling_rate:,.10g} samples a second and {sampling_rate:,.10g} are asked for; "
                f"their ratio is {ratio.numerator} : {ratio.denominator}, and numbers up to {MAX_RATIO_TERM:,} are "
                "allowed."
            )
        up, down = rounded.numerator, rounded.denominator
        check_size(len(self.channels), -(-self.channels.shape[1] * up // down))
        # The recording is continued by a line beyond its ends, so that an offset does not step to zero there.
        channels = scipy.signal.resample_poly(self.channels, up, down, axis=1, padtype="line")
        return replace(
            self,
            channels=channels,
            sampling_rate=sampling_rate,
            resampled_from=self.resampled_from or self.sampling_rate,
        )

    def channel(self, number: int) -> Recording:
        """Return the channel with this number in the file as a recording.

        Raises
        ------
        ValueError
            No such channel, or a column of times or words.
        """
        if number not in self.numbers:
            raise ValueError(f"The channel number is {number}; the {WHAT} has {channel_list(self.numbers)}.")
        index = self.numbers.index(number)
        return replace(self, channels=self.channels[index : index + 1], names=(self.names[index],), numbers=(number,))


def channel_list(numbers: tuple[int, ...]) -> str:
    """Return the numbers of channels as a phrase: "channels 2, 3"."""
    return f"channel{'s' * (len(numbers) > 1)} {', '.join(map(str, numbers))}"


def at_one_rate(first: Recording, second: Recording) -> tuple[Recording, Recording]:
    """Return both at the lower of their rates, which keeps all frequencies that both can hold.

    If one has no rate, both are assumed to have the same and are returned unchanged.

    Raises
    ------
    ValueError
        As :meth:`Recording.resampled`.
    """
    if first.sampling_rate is None or second.sampling_rate is None:
        return first, second
    lower = min(first.sampling_rate, second.sampling_rate)
    return first.resampled(lower), second.resampled(lower)


def start_difference_s(first: Recording, second: Recording) -> float | None:
    """Return how much later the second recording begins by dates or times of day, s; None if the files give none."""
    return second.start_s - first.start_s if first.epoch == second.epoch != "start" else None


def duplicate_warning(first: Recording, second: Recording) -> str:
    """Return a warning if two recordings of one channel are the same signal, perhaps scaled; otherwise ""."""
    one, other = (
        recording.channels[0, :: recording.channels.shape[1] // COMPARED_SAMPLES + 1] for recording in (first, second)
    )
    if first.channels.shape != second.channels.shape or np.unique(one).size < MIN_LEVELS:
        return ""
    centred = (signal - signal.mean(dtype=np.float64) for signal in (one, other))
    one, other = (signal / (np.abs(signal).max() or 1) for signal in centred)  # its square may overflow
    shared_power, power = np.vdot(one, other) ** 2, np.vdot(one, one) * np.vdot(other, other)
    return DUPLICATE_WARNING if shared_power > (1 - MAX_DUPLICATE_RESIDUAL) * power > 0 else ""


def chosen_track(tracks: Sequence[str], track: int | str) -> int:
    """Return the number of a track, from 1, given its number or its name.

    Raises
    ------
    ValueError
        No such track; the error lists the existing ones.
    """
    name = str(track)
    number = tracks.index(name) + 1 if name in tracks else int(name) if name.isascii() and name.isdigit() else 0
    if not 1 <= number <= len(tracks):
        existing = ", ".join(map(quote, tracks[:MAX_CHANNELS]))
        raise ValueError(
            f"The {WHAT} has no track {quote(name)}; there {'are' if len(tracks) > 1 else 'is'} {existing}."
        )
    return number


def check_size(channels: int, samples: int) -> None:
    """Refuse a recording with too few samples or too many, before they are read.

    Raises
    ------
    ValueError
        No channels or more than 64, fewer than 2 samples, more in total than the current limit or than fit into memory.
    """
    if not 1 <= channels <= MAX_CHANNELS:
        raise ValueError(f"The {WHAT} has {channels} channels; allowed are 1 to {MAX_CHANNELS}.")
    if samples < 2:
        raise ValueError(f"The {WHAT} holds {counted(samples, 'sample')}; at least 2 are needed.")
    if channels * samples > limits().max_samples:
        raise ValueError(
            f"The {WHAT} holds {channels} × {samples} samples; at most {limits().max_samples:,} in total are accepted."
        )
    if channels * samples > MAX_FLOAT64_SAMPLES:
        check_memory(Estimate(channels * samples * np.dtype(np.float32).itemsize, 0.0))


def float_type(samples: int) -> Literal["float32", "float64"]:
    """Return the type in which a recording is kept, given its number of samples in all channels."""
    return "float64" if samples <= MAX_FLOAT64_SAMPLES else "float32"


# Samples with a time each, as a file gives them.

MIN_ROWS = 10
"""Rows of a table below which its values alone are not enough to recognise a clock, a footer or sensors in turn."""

MAX_UNEVENNESS = 1e-3
"""Largest deviation from a straight line, as a share of its length, of a column recognised as times by its values."""

MAX_REPEATED_SHARE = 0.2
"""Share of samples that repeat the time before, above which the clock is coarser than the sampling interval."""

MIN_GAP_RATIO = 1.5
"""Ratio to the usual step above which a step in time is a gap."""

MIN_EXACT_SHARE = 0.98
"""Share of equal steps above which the times are exact, and any other step is a gap."""

MAX_DEVIATION = 0.02
"""Deviation from an even clock that is not corrected, samples; rounding of the times is allowed in addition."""

MAX_RATE_ROUNDING = 2e-3
"""Relative rounding of the rate of an uneven clock, whose samples are interpolated at any rate."""

MAX_FILL_RATIO = 20
"""Samples on the even clock per sample in the file: above, nearly all would be gaps."""


def rises_evenly(times: Vector) -> bool:
    """Return whether times never fall and follow a straight line, apart from gaps and the rounding of their numbers."""
    if times.size < MIN_ROWS or (np.diff(times[:1000]) < 0).any() or not np.isfinite(times).all():
        return False
    steps = np.diff(times)
    if (steps < 0).any() or times[-1] <= times[0]:
        return False
    regular = steps[steps <= MIN_GAP_RATIO * np.median(steps) + rounding_step(times)]
    gapless = np.concatenate(([0.0], np.cumsum(regular)))
    even = np.linspace(0.0, gapless[-1], gapless.size)
    # A few gaps are allowed; the rest must be even.
    return regular.size >= 0.9 * steps.size and bool(np.abs(gapless - even).max() <= MAX_UNEVENNESS * gapless[-1])


def on_even_clock(clock: Times, values: Channels) -> Recording:
    """Return samples taken at given times as a recording on an even clock.

    If the times are even apart from gaps and rounding, each sample keeps its value and goes to the place of its time.
    Otherwise samples are interpolated linearly. Gaps and missing values are filled by a straight line.

    Parameters
    ----------
    clock
        N times that never fall, none missing. If several samples share a time because the clock is coarser than the
        sampling interval, they are spread evenly.
    values
        (channels, N), NaN where a value is missing.

    Raises
    ------
    ValueError
        Times that are all the same, or so far apart that nearly everything would be a gap; too many samples.
    """
    notes = []
    times, rounding = clock.seconds, clock.rounding
    repeats = np.diff(times) == 0
    is_coarse = repeats.mean() > MAX_REPEATED_SHARE
    if is_coarse:
        times, rounding = _spread_repeats(times)
        notes.append("several samples with one time, spread evenly")
    elif repeats.any() and (
        rounding < np.median(np.diff(times)) / 2
        or np.array_equal(values[:, 1:][:, repeats], values[:, :-1][:, repeats], equal_nan=True)  # lines written twice
    ):
        kept = np.concatenate(([True], ~repeats))
        times, values = times[kept], values[:, kept]
        notes.append(f"{int(repeats.sum())} of two samples with one time left out")
    steps = np.diff(times)
    if not steps.size or times[-1] <= times[0]:
        raise ValueError(f"The times of the {WHAT} are all the same; they must rise.")
    median_step = float(np.median(steps))
    # If the times were rounded to nearly the length of a step, the steps would differ.
    is_exact = rounding > median_step / 4 and (np.abs(steps / median_step - 1) < MAX_DEVIATION).mean() > MIN_EXACT_SHARE
    tolerance_s = 0.0 if is_exact else rounding
    longest_regular = MIN_GAP_RATIO * max(median_step, float(np.quantile(steps, 0.9))) + tolerance_s
    regular = steps[steps <= longest_regular]
    step = float(regular.mean())
    uncertainty = rounding if is_coarse else min(rounding, float(np.ptp(regular)))
    step = _round_step(step, uncertainty / regular.size + 1e-9 * step)
    before_gaps = np.flatnonzero(steps > longest_regular)
    positions = _even_positions(times, before_gaps, step, MAX_DEVIATION + tolerance_s / step)
    if positions is None:
        step = _round_step(step, MAX_RATE_ROUNDING * step)
        positions = (times - times[0]) / step
        notes.append("uneven times, interpolated onto an even clock")
    total = math.floor(positions[-1] + 0.5) + 1
    if total > MAX_FILL_RATIO * times.size:
        raise ValueError(
            f"The times of the {WHAT} jump by {steps.max():,.4g} s after {times[steps.argmax()] - times[0]:,.4g} s, "
            f"while its usual step is {step:.4g} s; cut the file there, or correct its times."
        )
    check_size(len(values), total)
    gaps = tuple(Gap(float(positions[last] * step), float(steps[last] - step)) for last in before_gaps)
    is_gapless = total == times.size and (positions == np.arange(total)).all()
    channels = interpolated(values, None if is_gapless else positions, total)
    rate = float(f"{1 / step:.12g}")  # 99 and not 98.99999999999999
    return Recording(
        channels, rate, start_s=clock.start_s + float(times[0]), epoch=clock.epoch, gaps=gaps, notes=tuple(notes)
    )


def _even_positions(times: Vector, before_gaps: npt.NDArray[np.intp], step: float, tolerance: float) -> Vector | None:
    """Return the sample number of each time on an even clock; None if a time deviates by more than the tolerance.

    Parameters
    ----------
    times
        (N,), s.
    before_gaps
        Indices of the last times before a gap. The stretch after a gap begins at the nearest sample number.
    step
        Interval of the even clock, s.
    tolerance
        Samples.
    """
    positions = np.empty(times.size)
    for first, last in zip(np.r_[0, before_gaps + 1], np.r_[before_gaps + 1, times.size], strict=True):
        numbers = np.arange(last - first)
        exact = (times[first:last] - times[0]) / step
        offset = float((exact - numbers).mean())
        start = np.round(offset) if first else 0.0
        deviation = float(np.abs(exact - numbers - offset).max())
        if not max(deviation, abs(offset - start) if first else 0.0) <= tolerance:
            return None
        positions[first:last] = start + numbers
    return None if (np.diff(positions) <= 0).any() else positions


def interpolated(values: Channels, positions: Vector | None, total: int) -> Channels:
    """Return (channels, total) values interpolated linearly between the given ones that are not NaN.

    Each value is given at its position, from 0; None: its index.
    """
    dtype = float_type(len(values) * total)
    if positions is None and not any(np.isnan(channel).any() for channel in values):
        return values.astype(dtype, copy=False)
    channels, places = np.empty((len(values), total), dtype), np.arange(total)
    at = places if positions is None else positions
    for channel, given in zip(channels, values, strict=True):
        valid = ~np.isnan(given)
        channel[:] = np.interp(places, at[valid], given[valid])
    return channels


def _spread_repeats(times: Vector) -> tuple[Vector, float]:
    """Return the times of a coarse clock spread evenly between its ticks, and their uncertainty, s."""
    ticks, first, counts = np.unique(times, return_index=True, return_counts=True)
    if ticks.size < 2:
        return times, 0.0
    tick = float(np.median(np.diff(ticks)))
    per_tick = float(np.median(counts[1:-1]) if ticks.size > 2 else counts.max())
    number_in_tick = np.arange(times.size) - np.repeat(first, counts)
    # A recording begins and ends within a tick; the samples of the first tick lie at its end.
    spacing = tick / np.concatenate(([max(per_tick, counts[0])], counts[1:-1], [max(per_tick, counts[-1])]))
    delay = np.zeros(ticks.size)
    delay[0] = tick - counts[0] * spacing[0]
    return np.repeat(ticks + delay, counts) + number_in_tick * np.repeat(spacing, counts), tick / per_tick


def _round_step(step: float, uncertainty: float) -> float:
    """Return the step rounded, as a step or as a rate, to the fewest digits that stay within its uncertainty."""
    for digits in range(15):
        for candidate in (1 / float(f"{1 / step:.{digits}e}"), float(f"{step:.{digits}e}")):
            if abs(candidate - step) <= uncertainty:
                return candidate
    return step
