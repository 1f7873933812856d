"""The search of each method for the lag between two recordings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Vector
from stereolag.core.jobs import Progress, silent
from stereolag.core.searches import SignalMethod
from stereolag.signals.blocks import CentredRecording, block_curve
from stereolag.signals.curves import direct_curve, fft_curve, phat_curve
from stereolag.signals.overlaps import overlap_length
from stereolag.signals.peaks import REACH, Lags, find_peak, peak_ratio, refine_peak
from stereolag.signals.sampling import sampled_votes
from stereolag.signals.verdict import enough_votes


@dataclass(frozen=True)
class Found:
    """The result of a method, in samples."""

    lag: int
    peak_ratio: float
    ties: int
    fraction: float
    lags: npt.NDArray[np.int64] | None = None
    correlation: Vector | None = None
    votes: dict[int, int] | None = None
    opposite_lag: int | None = None


def normalised(given: npt.NDArray[Any]) -> Vector:
    """Return the signal with zero mean and height 1, so that squares neither over- nor underflow in any unit."""
    signal = given.astype(np.float64, copy=False)
    centred = signal - signal.mean()
    return np.asarray(centred / max(centred.max(), -centred.min()))


def search_whole(signal_1: Vector, signal_2: Vector, reach: int, method: SignalMethod, progress: Progress) -> Found:
    """Return the peak of the curve of "fft", "phat" or "direct" over the lags up to `reach` both ways."""
    first, last = -min(reach, signal_1.size - 1), min(reach, signal_2.size - 1)
    overlap: Callable[[Lags], Lags] = partial(overlap_length, signal_1.size, signal_2.size)
    if method == "direct":
        curve = direct_curve(signal_1, signal_2, first, last, progress)
    elif method == "fft":
        curve = fft_curve(signal_1, signal_2, first, last)
    else:
        curve = phat_curve(signal_1, signal_2, first, last)
        overlap = np.ones_like
    return _peak_of(curve, first, overlap)


def search_blocks(signal_1: CentredRecording, signal_2: CentredRecording, reach: int, progress: Progress) -> Found:
    """Return the result of :func:`search_whole` with the method "fft", computed block by block."""
    first, last = -min(reach, signal_1.size - 1), min(reach, signal_2.size - 1)
    curve = block_curve(signal_1, signal_2, first, last, progress)
    return _peak_of(curve, first, partial(overlap_length, signal_1.size, signal_2.size))


def _peak_of(curve: Vector, first: int, overlap: Callable[[Lags], Lags]) -> Found:
    lags = np.arange(first, first + curve.size)
    peak, ties = find_peak(curve, lags, overlap)
    around = min(REACH, peak, curve.size - 1 - peak)
    near = slice(peak - around, peak + around + 1)
    fraction = refine_peak(curve[near] / np.sqrt(overlap(lags[near])))
    lags.flags.writeable = False
    curve.flags.writeable = False
    return Found(int(lags[peak]), peak_ratio(curve, peak), ties, fraction, lags, curve)


def search_votes(signal_1: Vector, signal_2: Vector, reach: int, seed: int | None, progress: Progress) -> Found:
    """Return the lag with the most votes; ValueError if there are none."""
    votes = sampled_votes(signal_1, signal_2, reach, np.random.default_rng(seed), progress)
    if not votes:
        raise ValueError(
            f"no sample of signal_1 is found within ±{reach} samples in signal_2; "
            "allow a larger max_lag, or use the method 'fft'."
        )
    lag, count = next(iter(votes.items()))
    rivals = [others for other, others in votes.items() if abs(other - lag) > 1]
    ratio = count / max(rivals) if rivals else float("inf")
    # Votes that coincide by chance are not a lag, and equal counts of them are not ties.
    enough = enough_votes(votes, lag)
    ties = sum(others == count for others in votes.values()) if enough else 1
    opposite = None if enough else _opposite_vote(signal_1, signal_2, reach, seed)
    around = min(REACH, signal_1.size - 1 + lag, signal_2.size - 1 - lag)
    near = np.arange(lag - around, lag + around + 1)
    curve = direct_curve(signal_1, signal_2, lag - around, lag + around, silent)
    fraction = refine_peak(curve / np.sqrt(overlap_length(signal_1.size, signal_2.size, near)))
    return Found(lag, ratio, ties, fraction, votes=votes, opposite_lag=opposite)


def _opposite_vote(signal_1: Vector, signal_2: Vector, reach: int, seed: int | None) -> int | None:
    """Return the lag with enough votes when signal 2 is inverted, None if there are too few."""
    votes = sampled_votes(signal_1, -signal_2, reach, np.random.default_rng(seed), silent)
    lag = next(iter(votes), None)
    return lag if lag is not None and enough_votes(votes, lag) else None
