"""The search for a lag: the peak of a curve, votes of samples looked up by value, and bands of long recordings.

Votes are those of Appendix A of the source report (:func:`sampled_votes`).

Correlating two hours in one transform takes many gigabytes. Bands of frequency take little: a band of width w is fully
described by w complex samples a second (R. Crochiere and L. Rabiner, "Multirate Digital Signal Processing" (1983),
section 7.2: the block transform as a filter bank). Each is correlated at a fraction of the sampling rate, the strongest
first. The correlation of the recordings is the sum of the bands' correlations, each rotated by its frequency, so the
sum of their magnitudes is an upper bound at all lags. When no other place can be as high as the best, the best and its
possible rivals are correlated sample by sample (:func:`stereolag.signals.correlation.block_curve`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
import numpy.typing as npt
from scipy import fft

from stereolag.core.arrays import FloatMap, Indices, Vector
from stereolag.core.jobs import Progress, silent
from stereolag.loops.compilation import compiled
from stereolag.signals.correlation import (
    FLAT,
    Lags,
    block_curve,
    direct_curve,
    overlap_length,
    phat_curve,
    transform_length,
)
from stereolag.signals.peaks import EQUAL, REACH, best_cycle, find_peak, interpolate_peak, peak_ratio
from stereolag.signals.recordings import GRAIN, ConvertedRecording, dot, running_sums


@dataclass(frozen=True)
class FoundLag:
    """The result of a method, in samples."""

    lag: int
    peak_ratio: float = np.nan
    ties: int = 1
    fraction: float = 0.0
    lags: Lags | None = None
    correlation: Vector | None = None
    votes: dict[int, int] | None = None
    opposite_lag: int | None = None

    def rounded(self, lag: float) -> int:
        """Return a lag in whole samples: the lag found if that is within half a sample."""
        return self.lag if abs(lag - self.lag) <= 0.5 else round(lag)


def lags_within(sizes: tuple[int, int], reach: int) -> tuple[int, int]:
    """Return the first and last lag, up to `reach` both ways, at which recordings of these sizes overlap."""
    return -min(reach, sizes[0] - 1), min(reach, sizes[1] - 1)


def search_curve(
    signal_1: Vector | ConvertedRecording,
    signal_2: Vector | ConvertedRecording,
    reach: int,
    curve_of: Callable[..., Vector],
) -> FoundLag:
    """Return the peak of a curve of :mod:`~.correlation` over the lags up to `reach` both ways."""
    first, last = lags_within((signal_1.size, signal_2.size), reach)
    overlap: Callable[[Lags], Lags] = partial(overlap_length, signal_1.size, signal_2.size)
    if curve_of is phat_curve:
        overlap = np.ones_like
    curve, lags = curve_of(signal_1, signal_2, first, last), np.arange(first, last + 1)
    peak, ties = find_peak(curve, lags, overlap)
    if ties == 1 and curve[peak] > 0:
        cycle = best_cycle(curve, peak, REACH)
        peak = cycle if abs(cycle - peak) > 1 else peak
    near = slice(max(0, peak - REACH), peak + REACH + 1)
    fraction, _ = interpolate_peak(curve[near] / np.sqrt(overlap(lags[near])), peak - near.start)
    lags.flags.writeable = False
    curve.flags.writeable = False
    return FoundLag(int(lags[peak]), peak_ratio(curve, peak), ties, fraction, lags, curve)


def search_votes(signal_1: Vector, signal_2: Vector, reach: int, seed: int | None, progress: Progress) -> FoundLag:
    """Return the lag with the most votes; ValueError if there are none."""
    votes = sampled_votes(signal_1, signal_2, reach, np.random.default_rng(seed), progress)
    if not votes:
        raise ValueError(
            f"no sample of signal_1 is found within ±{reach} samples in signal_2; "
            "allow a larger max_lag, or use the method 'fft'."
        )
    lag, count = next(iter(votes.items()))
    rivals = [votes_there for other, votes_there in votes.items() if abs(other - lag) > 1]
    ratio = count / max(rivals) if rivals else float("inf")
    # Votes that coincide by chance are not a lag, and equal counts of them are not ties.
    enough = enough_votes(votes, lag)
    ties = sum(votes_there == count for votes_there in votes.values()) if enough else 1
    opposite = None if enough else _opposite_vote(signal_1, signal_2, reach, seed)
    around = min(REACH, signal_1.size - 1 + lag, signal_2.size - 1 - lag)
    near = np.arange(lag - around, lag + around + 1)
    curve = direct_curve(signal_1, signal_2, lag - around, lag + around, silent)
    fraction, _ = interpolate_peak(curve / np.sqrt(overlap_length(signal_1.size, signal_2.size, near)), around)
    return FoundLag(lag, ratio, ties, fraction, votes=votes, opposite_lag=opposite)


def _opposite_vote(signal_1: Vector, signal_2: Vector, reach: int, seed: int | None) -> int | None:
    """Return the lag with enough votes when signal 2 is inverted, None if there are too few."""
    votes = sampled_votes(signal_1, -signal_2, reach, np.random.default_rng(seed), silent)
    lag = next(iter(votes), None)
    return lag if lag is not None and enough_votes(votes, lag) else None


SLICE_LENGTH = 100
"""Samples correlated for each candidate, as in the source report."""

_ROUNDS = ((512, 256, 16), (1024, 256, 1024), (2048, 256, 8192))
"""Per round: samples drawn, how many of the most distinctive are looked up, and candidates for each."""

_MIN_VALID_SHARE = 0.8
"""Share of the best correlation of all that a sample's own must reach to count as a vote."""

_MIN_DECISIVE_SHARE = 0.1
"""Share of all votes that a lag needs for no further round."""

_MIN_DECISIVE_RATIO = 2
"""Ratio to the votes for the runner-up that it needs besides."""

MIN_VOTES = 5
"""Votes out of 256 that a lag needs; among thousands of lags, chance brings two or three together."""


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
    * of the samples drawn, those with the rarest values are looked up: despite noise, the right place is among the
      nearest values of a rare value, but not of a common one;
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
    if not (pool_1.varying.size and pool_2.varying.size):
        return {}
    for number, (drawn, looked_up, nearest) in enumerate(_ROUNDS):
        starts = random.permutation(pool_1.varying)[:drawn]
        votes = _count(_look_up(pool_1, pool_2, starts, looked_up, nearest, max_lag))
        progress((number + 1) / len(_ROUNDS))
        if _is_decisive(votes):
            break
    progress(1.0)
    return votes


def _look_up(pool_1: _Slices, pool_2: _Slices, starts: Indices, looked_up: int, nearest: int, max_lag: int) -> Indices:
    """Return the lags that samples vote for: the `looked_up` ones with the rarest values of those at `starts`."""
    order = pool_2.by_value
    values_2, values_1 = pool_2.values(order), pool_1.values(starts)
    nearest = min(nearest, order.size)
    lowest = np.clip(np.searchsorted(values_2, values_1) - nearest // 2, 0, order.size - nearest)
    rarity = values_2[lowest + nearest - 1] - values_2[lowest]
    distinctive = np.argsort(-rarity, kind="stable")[:looked_up]
    candidates = order[lowest[distinctive, np.newaxis] + np.arange(nearest)]
    starts = starts[distinctive]
    lags, scores = best_matches(pool_1.at(starts), starts, pool_2.signal, pool_2.scales, candidates, max_lag)
    return np.asarray(lags[scores >= max(_MIN_VALID_SHARE * scores.max(), 0.0)])


def _count(lags: Indices) -> dict[int, int]:
    """Return the number of votes for each lag, most votes first; equal counts with the smallest ``|lag|`` first."""
    voted, counts = np.unique(lags, return_counts=True)
    ranking = np.lexsort((-voted, np.abs(voted), -counts))
    return {int(voted[rank]): int(counts[rank]) for rank in ranking}


def _is_decisive(votes: dict[int, int]) -> bool:
    counts = [*votes.values(), 0, 0]
    return counts[0] >= max(_MIN_DECISIVE_SHARE * sum(counts), _MIN_DECISIVE_RATIO * counts[1], 2)


def enough_votes(votes: dict[int, int], lag: int) -> bool:
    """Return whether `lag` and its neighbours have more votes than chance would bring together."""
    return sum(votes.get(near, 0) for near in (lag - 1, lag, lag + 1)) >= MIN_VOTES


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
            # The slice of signal 1 has zero mean, so the mean of the other drops out.
            score = scales_2[start_2] * dot(piece, signal_2[start_2:])
            if score > best + EQUAL or (score > best - EQUAL and abs(lag) < abs(lags[sample])):
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
                score = scales_2[start_2] * dot(piece, signal_2[start_2:])
                if score <= best + EQUAL:
                    break
                best = score
                lags[sample] = lag
        scores[sample] = best
    return lags, scores


BLOCK = 2**15
"""Samples per transform of the filter bank."""

_BLOCKS_AT_ONCE = 16
"""Blocks that are transformed together."""

Bands = npt.NDArray[np.complex64]


def band_energies(recording: ConvertedRecording, step: int) -> Vector:
    """Return the energy of each of the ``step / 2`` bands, in squared sample units."""
    energies = np.zeros(step // 2)
    for _, spectra in _spectra(recording):
        power = spectra.real**2 + spectra.imag**2
        energies += power.reshape(len(power), energies.size, -1).sum(axis=(0, 2), dtype=np.float64)
    return energies * 2 / BLOCK


def band_signals(recording: ConvertedRecording, bands: Sequence[int], step: int) -> Bands:
    """Return (bands, ceil(samples / step)): the complex envelopes of the given bands, at every `step`-th sample.

    Scaled so that the real part of their product equals the product of the recordings' samples.
    """
    points = BLOCK // step
    signals = np.zeros((len(bands), -(-recording.size // step)), dtype=np.complex64)
    for start, spectra in _spectra(recording):
        for signal, band in zip(signals, bands, strict=True):
            part = fft.ifft(spectra[:, band * points : (band + 1) * points], axis=1)
            remaining = signal[start // step :]
            remaining[: part.size] = part.ravel()[: remaining.size]
    signals *= np.float32(np.sqrt(2 / step))
    return signals


def _spectra(recording: ConvertedRecording) -> Iterator[tuple[int, Bands]]:
    """Yield the start of each group of blocks, and their (blocks, BLOCK / 2) spectra without the highest frequency."""
    for start in range(0, recording.size, _BLOCKS_AT_ONCE * BLOCK):
        count = min(_BLOCKS_AT_ONCE, -(-(recording.size - start) // BLOCK))
        rows = recording.part(start, start + count * BLOCK, np.float32).reshape(count, BLOCK)
        spectra = np.asarray(fft.rfft(rows, axis=1), dtype=np.complex64)
        # Unlike the other frequencies, the mean of a block has no negative counterpart.
        spectra[:, 0] *= np.float32(np.sqrt(0.5))
        yield start, spectra[:, :-1]


def band_products(first: Bands, second: Bands) -> Bands:
    """Return (N1 + N2,) the correlation of one band at the band's lags from ``1 - N1`` to N2.

    Parameters
    ----------
    first, second
        (N1,) and (N2,) envelopes of the band, from :func:`band_signals`.
    """
    size = transform_length(first.size + second.size)
    rows = np.zeros((2, size), dtype=np.complex64)
    rows[0, : first.size] = first
    rows[1, : second.size] = second
    spectrum_1, spectrum_2 = fft.fft(rows, axis=1, overwrite_x=True)
    np.conj(spectrum_1, out=spectrum_1)
    spectrum_1 *= spectrum_2
    products = fft.ifft(spectrum_1, overwrite_x=True)
    return np.concatenate((products[size - first.size + 1 :], products[: second.size + 1]))


MAX_LAGS_PER_BAND = 3_000_000
"""Lags at which a band is correlated, at most: with a few bands, their transforms take 0.4 GB."""

MIN_STEP = 8
"""Lags per cell, at least."""

BANDS_AT_ONCE = 8
"""Bands that are filtered together."""

MAX_KEPT_LAGS = 2**18
"""Lags in the reduced curve, at most."""

REFINED_REACH = 4096
"""Samples on either side of a lag that are searched sample by sample."""

_MAX_PLACES = 6
"""Lags around which the recordings are correlated sample by sample, at most, besides ties near lag 0."""

_MIN_RIVAL_BOUND = 0.6
"""Share of the best bound from which on another lag may be higher: the bound is loose for bands of tones."""

_MIN_PEAK_OF_BOUND = 0.7
"""Share of its bound that a clear peak reaches at least."""

_MAX_LEFT_OUT = 0.01
"""Share of the energy that may be left out."""

_CELLS_AT_ONCE = 2**18


class _UpperBound:
    """Upper bound of the correlation in each cell of `step` lags, from the bands added to `total` so far."""

    def __init__(self, signal_1: ConvertedRecording, signal_2: ConvertedRecording, reach: int, step: int) -> None:
        self.step, self.sizes = step, (signal_1.size, signal_2.size)
        lowest, highest = lags_within(self.sizes, reach)
        cells_1 = -(-signal_1.size // step)
        self.first = max(lowest // step, 1 - cells_1)
        self._cells = slice(self.first + cells_1 - 1, highest // step + cells_1)
        self.total, self.weights, self.means, self.limits = np.zeros(
            (4, self._cells.stop - self._cells.start), dtype=np.float32
        )
        for start in range(0, self.total.size, _CELLS_AT_ONCE):
            self._weigh(np.arange(start, min(start + _CELLS_AT_ONCE, self.total.size)), (signal_1, signal_2))

    def _weigh(self, cells: Lags, signals: tuple[ConvertedRecording, ConvertedRecording]) -> None:
        """Compute, from running sums, the factors that turn the products at each lag into Pearson's correlation."""
        lags = self.centres(cells)
        overlap, begin = overlap_length(*self.sizes, lags), np.maximum(0, -lags)
        means: Vector = 1 / overlap
        energy, varying = np.ones(cells.size), overlap > 1
        for signal, edge in zip(signals, (begin, begin + lags), strict=True):
            ends = np.minimum(np.arange(signal.sums.shape[1]) * GRAIN, signal.size).astype(np.float64)
            total, squares = (
                np.interp(edge + overlap, ends, sums) - np.interp(edge, ends, sums) for sums in signal.sums
            )
            about_mean = squares - total**2 / overlap
            means, energy, varying = means * total, energy * about_mean, varying & (about_mean > FLAT * signal.energy)
        self.limits[cells] = np.sqrt(overlap / min(self.sizes))
        self.weights[cells] = np.sqrt(overlap / min(self.sizes) / np.where(varying, energy, np.inf))
        self.means[cells] = means

    def centres(self, cells: Lags) -> Lags:
        """Return the lags at the centres of cells."""
        lags = (self.first + cells) * self.step + self.step // 2
        return np.clip(lags, 1 - self.sizes[0], self.sizes[1] - 1)

    def magnitudes(self, band: int, first: Bands, second: Bands) -> FloatMap:
        """Return the magnitudes of the recordings' correlation in another band."""
        products = band_products(first, second)[self._cells.start : self._cells.stop + 1]
        if band == 0:
            # Pearson's correlation is without the product of the overlap's means.
            products.real[:-1] -= self.means
            products.real[-1] -= self.means[-1]
        power = products.real**2
        power += products.imag**2
        # Between two lags, a band may be as high as both of them combined.
        return np.asarray(np.sqrt(power[:-1] + power[1:]))

    def weighted(self) -> FloatMap:
        """Return the upper bound of Pearson's correlation times ``sqrt(overlap / longest overlap)``."""
        # Pearson's correlation is at most 1, so this is at most the weight of the overlap.
        return np.asarray(np.minimum(self.total * self.weights, self.limits))


def search_bands(
    signal_1: ConvertedRecording, signal_2: ConvertedRecording, reach: int, progress: Progress
) -> FoundLag:
    """Return the result of :func:`search_curve` with "fft", its curve reduced.

    The curve is reduced to one point per stretch of lags, with an upper bound in `correlation`; near the peak and its
    rivals, which are measured sample by sample, it is the highest value and its lag. `peak_ratio` does not exceed
    that of the whole curve, and `ties` counts only those near the peak and its rivals.
    """
    step = cell_size(signal_1.size, signal_2.size)
    bound = _UpperBound(signal_1, signal_2, reach, step)
    signals = (signal_1, signal_2)
    with ThreadPoolExecutor(2) as threads:
        energies = list(threads.map(band_energies, signals, (step, step)))
    common = np.sqrt(energies[0] * energies[1]) / np.sqrt(energies[0].sum() * energies[1].sum())
    progress(0.1)
    order = np.argsort(-common, kind="stable")
    for start in range(0, order.size, BANDS_AT_ONCE):
        chosen = [int(band) for band in order[start : start + BANDS_AT_ONCE]]
        with ThreadPoolExecutor(2) as threads:
            parts = list(threads.map(band_signals, signals, (chosen, chosen), (step, step)))
            for number, magnitudes in enumerate(threads.map(bound.magnitudes, chosen, *parts), start=1):
                bound.total += magnitudes
                progress(0.1 + 0.6 * (start + number) / order.size)
        del parts  # before the next are made
        left_out = float(common[order[start + BANDS_AT_ONCE :]].sum())
        if left_out < _MAX_LEFT_OUT or _leads(bound.weighted(), REFINED_REACH // step, left_out):
            break
    return _refine(signal_1, signal_2, bound, reach, progress)


def cell_size(size_1: int, size_2: int) -> int:
    """Return the number of lags per cell: a power of two."""
    lags = max(MIN_STEP, -(-(size_1 + size_2) // MAX_LAGS_PER_BAND))
    return 1 << (lags - 1).bit_length()


def _leads(bound: FloatMap, around: int, left_out: float) -> bool:
    """Return whether the energy left out cannot lift any cell above the best, except its neighbours."""
    best = int(np.argmax(bound))
    highest = float(bound[best])
    bound[max(0, best - around) : best + around + 1] = 0
    return _MIN_PEAK_OF_BOUND * highest > float(bound.max()) + left_out


def _candidate_lags(bound: _UpperBound) -> list[int]:
    """Return the lags around which the correlation may be highest, best first."""
    weighted, around = bound.weighted(), REFINED_REACH // bound.step
    best = int(np.argmax(weighted))
    places, highest = [best], float(weighted[best])
    nearest = _nearest_ties(bound, weighted, best)
    while len(places) < _MAX_PLACES:
        weighted[max(0, places[-1] - around) : places[-1] + around + 1] = 0
        other = int(np.argmax(weighted))
        if weighted[other] < max(_MIN_RIVAL_BOUND * highest, 1e-30):
            break
        places.append(other)
    return [int(lag) for lag in bound.centres(np.array([*places, *nearest]))]


def _nearest_ties(bound: _UpperBound, weighted: FloatMap, best: int) -> list[int]:
    """Return the cells nearest to lag 0, on either side, that may tie with the best (:func:`find_peak`)."""
    high = np.flatnonzero(weighted >= _MIN_PEAK_OF_BOUND * np.sqrt(0.5) * weighted[best])
    share = overlap_length(*bound.sizes, bound.centres(high)) / overlap_length(
        *bound.sizes, bound.centres(np.array([best]))
    )
    high = high[(share >= 0.5) & (weighted[high] >= _MIN_PEAK_OF_BOUND * np.sqrt(share) * weighted[best])]
    is_later = high + bound.first >= 0
    return [*high[is_later][:1].tolist(), *high[~is_later][-1:].tolist()]


def _refine(
    signal_1: ConvertedRecording, signal_2: ConvertedRecording, bound: _UpperBound, reach: int, progress: Progress
) -> FoundLag:
    """Return the peak, measured sample by sample around all lags that may be as high."""
    first, last = lags_within(bound.sizes, reach)
    windows: list[tuple[int, int]] = []  # first and last lags, ascending and disjoint
    for place in sorted(_candidate_lags(bound)):
        low, high = max(first, place - REFINED_REACH), min(last, place + REFINED_REACH)
        if windows and low <= windows[-1][1] + 1:
            low = windows.pop()[0]
        windows.append((low, high))
    curves = []
    for number, window in enumerate(windows):
        curves.append(block_curve(signal_1, signal_2, *window))
        progress(0.7 + 0.3 * (number + 1) / len(windows))
    lags, values = np.concatenate([np.arange(low, high + 1) for low, high in windows]), np.concatenate(curves)
    overlap = partial(overlap_length, *bound.sizes)
    peak, ties = find_peak(values, lags, overlap)
    lag, height = int(lags[peak]), float(values[peak])
    reduced_lags, reduced, highest_bound = _reduced_curve(bound, windows, lags, values, peak)

    near = next(number for number, (low, high) in enumerate(windows) if low <= lag <= high)
    low, high = windows[near]
    rival = max([highest_bound, *(float(curve.max()) for number, curve in enumerate(curves) if number != near)])
    ratio = np.fmin(peak_ratio(curves[near], lag - low), height / rival if rival > 0 else np.inf)
    lowest = int(np.argmin(values))
    return FoundLag(
        lag,
        float(ratio) if height > 0 else np.nan,
        ties,
        interpolate_peak(curves[near] / np.sqrt(overlap(np.arange(low, high + 1))), lag - low)[0],
        reduced_lags,
        reduced,
        opposite_lag=int(lags[lowest]) if -values[lowest] > 1.1 * height else None,
    )


def _reduced_curve(
    bound: _UpperBound, windows: list[tuple[int, int]], lags: Lags, values: Vector, peak: int
) -> tuple[Lags, Vector, float]:
    """Return a curve reduced to the highest point of every stretch of cells, and its highest bound outside the windows.

    The bound, capped at the height of the peak, is replaced by the measured values at the given lags.
    """
    cells = -(-bound.total.size // MAX_KEPT_LAGS)
    rows = np.zeros((-(-bound.total.size // cells), cells), dtype=np.float32)
    row = rows.ravel()
    row[: bound.total.size] = bound.weighted()
    for low, high in windows:
        row[max(0, low // bound.step - bound.first) : high // bound.step - bound.first + 1] = 0
    best = rows.argmax(axis=1) + cells * np.arange(len(rows))
    reduced_lags, reduced = bound.centres(best), row[best].astype(np.float64)
    if values[peak] > 0:
        np.minimum(reduced, values[peak], out=reduced)
    highest_bound = float(reduced.max())
    # The highest value of each stretch is entered last, and the peak after those that tie with it.
    order = np.append(np.argsort(-values, kind="stable")[::-1], peak)
    stretches = (lags[order] - bound.first * bound.step) // (cells * bound.step)
    reduced_lags[stretches], reduced[stretches] = lags[order], values[order]
    return reduced_lags, reduced, highest_bound
