"""Lag by voting: samples of one recording looked up by value in the other (Appendix A of the source report)."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Vector
from stereolag.core.jobs import Progress
from stereolag.loops.compilation import compiled
from stereolag.signals.correlation import FLAT, running_sums

SLICE_LENGTH = 100
"""Samples correlated for each candidate, as in the source report."""

_ROUNDS = ((512, 256, 16), (1024, 256, 1024), (2048, 256, 8192))
"""Per round: samples drawn, how many of the most distinctive are looked up, and candidates for each."""

_VALID_SHARE = 0.8
_DECISIVE_SHARE = 0.1
_DECISIVE_LEAD = 2


LEAST_VOTES = 5
"""Out of 256 samples looked up; among thousands of lags, chance brings two or three votes together."""


class _Slices:
    """The slices of a recording, one starting at every sample, and each sample's value relative to its slice."""

    def __init__(self, signal: Vector, shortest: int) -> None:
        self.signal = signal
        # At most a quarter of a short recording, which leaves room for a lag.
        self.length = min(SLICE_LENGTH, max(2, shortest // 4))
        sums, squares = running_sums(signal)
        self.means = (sums[self.length :] - sums[: -self.length]) / self.length
        energy = squares[self.length :] - squares[: -self.length] - self.length * self.means**2
        self.varying = np.flatnonzero(energy > FLAT * squares[-1])
        self.scales = np.zeros(energy.size)
        self.scales[self.varying] = 1 / np.sqrt(energy[self.varying])

    @cached_property
    def by_value(self) -> Indices:
        """The starts of the slices that are not flat, sorted by their :meth:`values`."""
        return np.asarray(self.varying[np.argsort(self.values(self.varying))])

    def values(self, starts: Indices) -> Vector:
        """Return the samples at `starts` minus the mean of their slice, over the root of the slice's energy."""
        return np.asarray((self.signal[starts] - self.means[starts]) * self.scales[starts])

    def at(self, starts: Indices) -> Vector:
        """Return (starts, length) slices with zero mean and unit energy."""
        slices = np.lib.stride_tricks.sliding_window_view(self.signal, self.length)[starts]
        return np.asarray((slices - self.means[starts, np.newaxis]) * self.scales[starts, np.newaxis])


def sampled_votes(
    signal_1: Vector, signal_2: Vector, max_lag: int, random: np.random.Generator, progress: Progress
) -> dict[int, int]:
    """Return the number of votes for each lag, most votes first; empty if nothing is found within `max_lag`.

    Samples of the shorter recording are drawn at random without replacement: it is more often contained whole in the
    longer one than the other way round. Each sample is looked up among the sorted values of the other recording; the
    slice that starts there is correlated with the slice that starts at the sample, and the best candidate votes for
    its lag.

    The source report looked for *equal* values, but sensor noise leaves none. Therefore:

    * values are compared relative to their own slice (mean and standard deviation), so gain and offset do not matter;
    * the candidates are the nearest values in sorted order, not equal ones: 16 at first, and if no lag wins clearly,
      1,024 and then 8,192, so recordings without noise stay fast;
    * of the samples drawn, the most distinctive are looked up, those with rare values: despite noise, the right place
      is among the nearest values of a rare value, but not of a common one;
    * the best candidate slides to the top of its correlation, so a neighbour of the right place is good enough, and
      votes only if it reaches at least 0.8 of the best correlation of all.

    Parameters
    ----------
    signal_1, signal_2
        (N1,) and (N2,) float64, each with zero mean.
    max_lag
        Largest ``|lag|`` that can get votes, samples.
    """
    if signal_2.size < signal_1.size:
        mirrored = sampled_votes(signal_2, signal_1, max_lag, random, progress)
        return {-lag: count for lag, count in mirrored.items()}
    pool_1, pool_2 = _Slices(signal_1, signal_1.size), _Slices(signal_2, signal_1.size)
    votes: dict[int, int] = {}
    if not (pool_1.varying.size and pool_2.varying.size):
        return votes
    for number, (drawn, looked_up, nearest) in enumerate(_ROUNDS):
        starts = random.permutation(pool_1.varying)[:drawn]
        lags = _look_up(pool_1, pool_2, starts, looked_up, nearest, max_lag)
        votes = _count(lags)
        progress((number + 1) / len(_ROUNDS))
        if _decisive(votes):
            break
    progress(1.0)
    return votes


def _look_up(pool_1: _Slices, pool_2: _Slices, starts: Indices, looked_up: int, nearest: int, max_lag: int) -> Indices:
    """Return the lags that the `looked_up` most distinctive samples at `starts` vote for."""
    order = pool_2.by_value
    values_2, values_1 = pool_2.values(order), pool_1.values(starts)
    nearest = min(nearest, order.size)
    lowest = np.clip(np.searchsorted(values_2, values_1) - nearest // 2, 0, order.size - nearest)
    rarity = values_2[lowest + nearest - 1] - values_2[lowest]
    distinctive = np.argsort(-rarity, kind="stable")[:looked_up]
    candidates = order[lowest[distinctive, np.newaxis] + np.arange(nearest)]
    starts = starts[distinctive]
    lags, scores = best_matches(pool_1.at(starts), starts, pool_2.signal, pool_2.scales, candidates, max_lag)
    return np.asarray(lags[scores >= max(_VALID_SHARE * scores.max(), 0.0)])


def _count(lags: Indices) -> dict[int, int]:
    """Return the number of votes for each lag, most votes first; equal counts with the smallest ``|lag|`` first."""
    voted, counts = np.unique(lags, return_counts=True)
    ranking = np.lexsort((-voted, np.abs(voted), -counts))
    return {int(voted[rank]): int(counts[rank]) for rank in ranking}


def _decisive(votes: dict[int, int]) -> bool:
    counts = [*votes.values(), 0, 0]
    return counts[0] >= max(_DECISIVE_SHARE * sum(counts), _DECISIVE_LEAD * counts[1], 2)


def enough_votes(votes: dict[int, int], lag: int) -> bool:
    """Return whether `lag` and its neighbours have more votes than chance would bring together."""
    return sum(votes.get(near, 0) for near in (lag - 1, lag, lag + 1)) >= LEAST_VOTES


Indices = npt.NDArray[np.int64]

_EQUAL = 1e-9


@compiled
def best_matches(
    slices_1: npt.NDArray[np.float64],
    starts_1: Indices,
    signal_2: Vector,
    scales_2: Vector,
    candidates: Indices,
    max_lag: int,
) -> tuple[Indices, Vector]:
    """Return the lag at which each slice of signal 1 correlates best with signal 2, starting from its candidates.

    From the best candidate the match climbs one sample at a time, since noise can make a neighbour of the right value
    the nearest one. Of equally good candidates the one with the smallest ``|lag|`` wins.

    Parameters
    ----------
    slices_1
        (samples, length) slices of signal 1, with zero mean and unit energy.
    starts_1
        (samples,) where the slices start.
    signal_2
        (N,).
    scales_2
        (N - length + 1,) one over the root of each slice's energy about its mean; 0 where flat.
    candidates
        (samples, candidates) starts in signal 2 to compare.
    max_lag
        Candidates with a larger ``|lag|`` are skipped.

    Returns
    -------
    (samples,) lags, and the correlation at each: -2 for a sample without a candidate within `max_lag`.
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


@compiled(fastmath={"reassoc", "contract"})
def _product(piece: Vector, signal: Vector, start: int) -> float:
    # The piece has zero mean, so the mean of the other slice drops out.
    total = 0.0
    for i in range(piece.size):
        total += piece[i] * signal[start + i]
    return total
