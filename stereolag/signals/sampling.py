"""The lag by voting: samples of one recording looked up by value in the other (Appendix A of the source report)."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import numpy.typing as npt

from stereolag.arrays import Vector
from stereolag.loops.compilation import compiled
from stereolag.progress import Progress
from stereolag.signals.overlaps import FLAT, running_sums

SLICE_LENGTH = 100
"""Samples that are correlated around a match, as in the report."""

_ROUNDS = ((512, 256, 16), (1024, 256, 1024), (2048, 256, 8192))
"""Samples drawn, the most distinctive of them that are looked up, and candidates for each."""

_VALID_SHARE = 0.8
_DECISIVE_SHARE = 0.1
_DECISIVE_LEAD = 2


class _Slices:
    """The slices of a recording, one beginning at every sample, and the sample's value relative to its slice."""

    def __init__(self, signal: Vector, shortest: int) -> None:
        self.signal = signal
        # At most a quarter of a short recording, so that the rest leaves room for a lag.
        self.length = min(SLICE_LENGTH, max(2, shortest // 4))
        sums, squares = running_sums(signal)
        self.means = (sums[self.length :] - sums[: -self.length]) / self.length
        energy = squares[self.length :] - squares[: -self.length] - self.length * self.means**2
        self.varying = np.flatnonzero(energy > FLAT * squares[-1])
        self.scales = np.zeros(energy.size)
        self.scales[self.varying] = 1 / np.sqrt(energy[self.varying])

    @cached_property
    def by_value(self) -> Indices:
        """The starts of the slices that vary, sorted by their :meth:`values`."""
        return np.asarray(self.varying[np.argsort(self.values(self.varying))])

    def values(self, starts: Indices) -> Vector:
        """Return the samples at `starts` relative to the slices that they begin, in root energies."""
        return np.asarray((self.signal[starts] - self.means[starts]) * self.scales[starts])

    def at(self, starts: Indices) -> Vector:
        """Return (starts, length) slices, mean-free and of unit energy."""
        slices = np.lib.stride_tricks.sliding_window_view(self.signal, self.length)[starts]
        return np.asarray((slices - self.means[starts, np.newaxis]) * self.scales[starts, np.newaxis])


def sampled_votes(
    signal_1: Vector, signal_2: Vector, max_lag: int, random: np.random.Generator, progress: Progress
) -> dict[int, int]:
    """Return how many samples voted for which lag, most votes first; empty where nothing is found within `max_lag`.

    Samples of signal 1 are drawn at random without replacement (of the shorter recording, which lies wholly in the
    longer one more often). Each is looked up among the sorted values of the other recording; the slice that begins
    there is correlated with the slice that begins at the sample, and the best place votes for its lag.

    The report looked for *equal* values, which sensor noise leaves none of. Therefore:

    * values are compared relative to their own slice (mean and standard deviation), which gain and offset leave alone;
    * not the equal value but the nearest ones in the sorted order are candidates: 16 at first, and where no lag wins
      clearly, 1,024 and then 8,192, so that recordings without noise stay fast;
    * of the samples drawn the most distinctive are looked up, those whose values are rare: noise leaves the right
      place among the nearest values of a rare value, not among those of a common one;
    * the best candidate slides to the top of its correlation, so that a neighbour of the right place will do, and
      votes only if that is at least 0.8 of the best correlation of all.

    Parameters
    ----------
    signal_1, signal_2
        (N1,) and (N2,) float64, each free of its mean.
    max_lag
        The largest ``|lag|`` that may be voted for, samples.
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
    """Return the lags that the `looked_up` most distinctive of the samples at `starts` vote for."""
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
    """Return the lags and their numbers, the most frequent first, of equals the smallest ``|lag|`` first."""
    voted, counts = np.unique(lags, return_counts=True)
    ranking = np.lexsort((-voted, np.abs(voted), -counts))
    return {int(voted[rank]): int(counts[rank]) for rank in ranking}


def _decisive(votes: dict[int, int]) -> bool:
    counts = [*votes.values(), 0, 0]
    return counts[0] >= max(_DECISIVE_SHARE * sum(counts), _DECISIVE_LEAD * counts[1], 2)


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


@compiled(fastmath={"reassoc", "contract"})
def _product(piece: Vector, signal: Vector, start: int) -> float:
    # The piece is mean-free, so the mean of the other slice drops out.
    total = 0.0
    for i in range(piece.size):
        total += piece[i] * signal[start + i]
    return total
