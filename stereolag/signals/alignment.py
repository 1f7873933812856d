"""Two recordings on a common clock, with the lag between them removed."""

from __future__ import annotations

import numpy as np

from stereolag.core.arrays import Vector


def aligned(
    signal_1: Vector,
    signal_2: Vector,
    lag: int,
    first: int = 0,
    last: int | None = None,
    *,
    means: tuple[float, float] | None = None,
) -> Vector:
    """Return both recordings side by side, (samples, 2) float64, shifted so that the lag between them is 0.

    Nothing is cut off: before its start and after its end, a recording is padded with its mean, which no correlation
    sees.

    Parameters
    ----------
    signal_1, signal_2
        (N1,) and (N2,) finite numbers.
    lag
        Samples, as in :class:`~stereolag.signals.SignalLag`: positive if signal 2 records the event later.
    first, last
        Range of samples to return, out of :func:`aligned_length`; all by default.
    means
        Means of both recordings, if known.
    """
    last = aligned_length(signal_1.size, signal_2.size, lag) if last is None else last
    both = np.empty((max(0, last - first), 2))
    means = means or (float(signal_1.mean()), float(signal_2.mean()))
    for column, (signal, offset) in enumerate(zip((signal_1, signal_2), _offsets(lag), strict=True)):
        start, stop = (min(max(offset + end, first), last) for end in (0, signal.size))
        both[:, column] = means[column]
        both[start - first : stop - first, column] = signal[start - offset : stop - offset]
    return both


def aligned_length(size_1: int, size_2: int, lag: int) -> int:
    """Return the number of samples from the earlier start to the later end of the aligned recordings."""
    offset_1, offset_2 = _offsets(lag)
    return max(offset_1 + size_1, offset_2 + size_2)


def together(signal_1: Vector, signal_2: Vector, lag: int, most: int) -> Vector:
    """Return both recordings mixed equally loud, (samples,) float64: an echo, or one sound with the lag removed.

    Parameters
    ----------
    signal_1, signal_2
        (N1,) and (N2,) finite numbers.
    lag
        Lag to remove, samples; 0 leaves the recordings as they were made.
    most
        Largest number of samples. A longer mix is cut to start where both recordings have started.
    """
    if aligned_length(signal_1.size, signal_2.size, lag) > most:
        later_2, later_1 = _offsets(lag)
        signal_1, signal_2, lag = signal_1[later_1:][:most], signal_2[later_2:][:most], 0
    both = np.zeros(aligned_length(signal_1.size, signal_2.size, lag))
    for signal, offset in zip((signal_1, signal_2), _offsets(lag), strict=True):
        centred = signal - signal.mean()
        both[offset : offset + signal.size] += centred / (centred.std() or 1.0)
    return both


def _offsets(lag: int) -> tuple[int, int]:
    """Return the start of each recording on the common clock, samples."""
    return max(0, lag), max(0, -lag)
