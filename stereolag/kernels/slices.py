"""Short slices of one recording, compared with candidate slices of another."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from stereolag.kernels.compilation import KEPT
from stereolag.kernels.overlaps import Vector

Indices = npt.NDArray[np.int64]

_EQUAL = 1e-9


def slice_correlation(signal_1: Vector, signal_2: Vector, start_1: int, start_2: int, length: int) -> float:
    """Return Pearson's correlation of the slices of `length` samples that begin at `start_1` and `start_2`."""
    return float(np.corrcoef(signal_1[start_1 : start_1 + length], signal_2[start_2 : start_2 + length])[0, 1])


@njit(nogil=True, cache=KEPT)
def best_matches(
    slices_1: npt.NDArray[np.float64],
    starts_1: Indices,
    signal_2: Vector,
    scales_2: Vector,
    candidates: Indices,
    max_lag: int,
) -> tuple[Indices, Vector]:
    """Return the lag at which each slice of signal 1 correlates best with signal 2, beginning from its candidates.

    From the best candidate the match slides uphill, a sample at a time: noise makes the right value's neighbour the
    nearest value. Of equally good candidates the one with the smallest ``|lag|`` wins.

    Parameters
    ----------
    slices_1
        (samples, length) slices of signal 1, mean-free and of unit energy.
    starts_1
        (samples,) where they begin.
    signal_2
        (N,).
    scales_2
        (N - length + 1,) one over the root of the energy about the mean of the slice that begins there; 0 where flat.
    candidates
        (samples, candidates) where in signal 2 to compare.
    max_lag
        Candidates with a larger ``|lag|`` are passed over.

    Returns
    -------
    (samples,) lags, and the correlation there: -2 for a sample none of whose candidates is within `max_lag`.
    """
    lags = np.full(starts_1.size, signal_2.size)
    scores = np.full(starts_1.size, -2.0)
    for sample in range(starts_1.size):
        start_1, piece = starts_1[sample], slices_1[sample]
        best = -2.0
        for start_2 in candidates[sample]:
            lag = start_2 - start_1
            if abs(lag) > max_lag:
                continue
            score = scales_2[start_2] * _product(piece, signal_2, start_2)
            if score > best + _EQUAL or (score > best - _EQUAL and abs(lag) < abs(lags[sample])):
                best = max(best, score)
                lags[sample] = lag
        if best == -2.0:
            continue
        for step in (-1, 1):
            while True:
                lag = lags[sample] + step
                start_2 = start_1 + lag
                if abs(lag) > max_lag or start_2 < 0 or start_2 >= scales_2.size:
                    break
                score = scales_2[start_2] * _product(piece, signal_2, start_2)
                if score <= best + _EQUAL:
                    break
                best = score
                lags[sample] = lag
        scores[sample] = best
    return lags, scores


@njit(nogil=True, cache=KEPT, fastmath={"reassoc", "contract"})
def _product(piece: Vector, signal: Vector, start: int) -> float:
    # The piece is mean-free, so the mean of the other slice drops out.
    total = 0.0
    for i in range(piece.size):
        total += piece[i] * signal[start + i]
    return total
