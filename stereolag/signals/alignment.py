"""Recording 2 on the clock of recording 1: shifted by the lag, resampled for drift, and with steps for its jumps."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Vector
from stereolag.core.inputs import checked_signal
from stereolag.core.jobs import Estimate, Progress, check_memory
from stereolag.signals.lag import SignalLag, common_rate, signal_lag
from stereolag.signals.over_time import TAPS, LagOverTime, Stretch, on_first_clock

Signal = npt.NDArray[np.floating]

BLOCK = 2**20
"""Samples aligned at a time."""

_MAX_IGNORED_FRACTION = 0.02
"""Samples; a lag that differs by no more from a whole number, and does not drift by more, moves whole samples."""


def align(
    signal_1: npt.ArrayLike,
    signal_2: npt.ArrayLike,
    lag: SignalLag | float | None = None,
    *,
    sampling_rate: float | None = None,
    max_lag: int | None = None,
    progress: Progress | None = None,
) -> Signal:
    """Return recording 2 on the clock of recording 1: the sample that belongs to each sample of recording 1.

    The lag is undone at every time: clock drift by resampling (a windowed sinc of 32 samples), dropped buffers by
    steps. Where recording 2 has no samples (before its start, after its end, and where a buffer is missing), its mean
    is filled in, which does not correlate. Samples missing in recording 1 are left out.

    Parameters
    ----------
    signal_1, signal_2
        (N1,) and (N2,) numbers of any type, or recordings from :func:`stereolag.read_signal`.
    lag
        The result of :func:`stereolag.signal_lag` on them, or a lag of your own, samples, positive if signal 2 records
        the event later. None: measured here.
    sampling_rate, max_lag, progress
        As for :func:`stereolag.signal_lag`, if the lag is measured here.

    Returns
    -------
    aligned
        (N1,) floats, float32 unless recording 2 needs float64.

    Raises
    ------
    ValueError
        A lag that is not sure, or at which the recordings do not overlap; and as :func:`stereolag.signal_lag` does.

    Examples
    --------
    >>> import numpy as np
    >>> import stereolag as sl
    >>> sound = np.random.default_rng(0).standard_normal(5000)
    >>> aligned = sl.align(sound[300:], sound)
    >>> aligned.shape, sl.signal_lag(sound[300:], aligned).lag
    ((4700,), 0)
    """
    given_1, given_2 = checked_signal(signal_1, "signal_1"), checked_signal(signal_2, "signal_2")
    common_rate(signal_1, signal_2, sampling_rate)
    if lag is None:
        lag = signal_lag(given_1, given_2, max_lag=max_lag, progress=progress)
    dtype = np.result_type(given_2.dtype, np.float32)
    check_memory(Estimate(given_1.size * dtype.itemsize, 0.0))
    aligned = np.empty(given_1.size, dtype=dtype)
    first = 0
    for block in aligned_blocks(given_1, given_2, lag):
        aligned[first : first + block.size] = block
        first += block.size
    return aligned


def aligned_blocks(signal_1: Signal, signal_2: Signal, lag: SignalLag | float) -> Iterator[Vector]:
    """Yield the result of :func:`align` in blocks of ``BLOCK`` samples, float64."""
    clock = shared_clock(signal_1, signal_2, lag)
    mean = float(signal_2.mean(dtype=np.float64))
    for first in range(0, signal_1.size, BLOCK):
        yield aligned_part(signal_2, clock, first, min(first + BLOCK, signal_1.size), mean)


def shared_clock(signal_1: Signal, signal_2: Signal, lag: SignalLag | float) -> tuple[Stretch, ...]:
    """Return the stretches of recording 1 in which recording 2 has samples, in order of time, and the lag in each.

    Parameters
    ----------
    signal_1, signal_2
        (N1,) and (N2,) finite numbers.
    lag
        The result for them, or a constant lag, samples.

    Raises
    ------
    ValueError
        A result whose verdict is not "sure", or a lag at which the recordings do not overlap.
    """
    if isinstance(lag, SignalLag):
        if lag.verdict != "sure":
            raise ValueError(
                f"The lag is {lag.verdict!r} ({lag.judgement.reason}), and only one that is sure is undone: give the "
                "lag to undo in samples, or recordings with more in common."
            )
        over_time = lag.over_time
        if over_time is not None and (over_time.changes or over_time.drifts_by(_MAX_IGNORED_FRACTION)):
            return _without_gaps(over_time, signal_1.size)
        lag = lag.lag_subsample
        if abs(lag - round(lag)) <= _MAX_IGNORED_FRACTION:
            lag = round(lag)
    if not -signal_1.size < lag < signal_2.size:
        raise ValueError(
            f"lag is {lag:,.10g} samples; recordings of {signal_1.size:,} and {signal_2.size:,} samples overlap at "
            f"lags from {1 - signal_1.size:,} to {signal_2.size - 1:,}."
        )
    return (Stretch(0, signal_1.size, float(lag), 0.0),)


def _without_gaps(over_time: LagOverTime, size: int) -> tuple[Stretch, ...]:
    """Return the stretches, extended to all of `size` samples, without the samples missing in recording 2."""
    gaps = [0, *(max(0, round(step.missing)) for step in over_time.steps)]
    lines = [replace(line, begin=line.begin + gap) for line, gap in zip(over_time.stretches, gaps, strict=True)]
    lines[0] = replace(lines[0], begin=0)
    lines[-1] = replace(lines[-1], end=size)
    return tuple(line for line in lines if line.begin < line.end)


def aligned_part(signal_2: Signal, clock: Sequence[Stretch], first: int, last: int, mean: float) -> Vector:
    """Return recording 2 resampled to the samples `first` to `last` - 1 of recording 1.

    Parameters
    ----------
    signal_2
        (N2,) finite numbers.
    clock
        From :func:`shared_clock`.
    first, last
        Range of samples of recording 1; about ``BLOCK`` of them, since as many of recording 2 are converted.
    mean
        Value where recording 2 has no sample.
    """
    aligned = np.full(last - first, mean)
    for line in clock:
        low, high = max(first, line.begin), min(last, line.end)
        if low >= high:
            continue
        ends = low + line.lag_at(low), high - 1 + line.lag_at(high - 1)
        begin = max(0, math.floor(ends[0]) - TAPS)
        part = signal_2[begin : max(begin, math.ceil(ends[1]) + TAPS + 1)].astype(np.float64)
        if part.size:
            part = (part - mean).astype(np.float32)
            aligned[low - first : high - first] += on_first_clock(part, line.for_part(begin), low, high - low)
    return aligned


def mix(signal_1: Signal, signal_2: Signal) -> Vector:
    """Return the sum of both recordings, equally loud, over the length of the longer one, float64."""
    mixed = np.zeros(max(signal_1.size, signal_2.size))
    for signal in (signal_1, signal_2):
        if signal.size:  # at a very low sampling rate, a stretch may have none
            centred = signal - signal.mean(dtype=np.float64)
            mixed[: signal.size] += centred / (centred.std() or 1.0)
    return mixed
