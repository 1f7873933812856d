"""Evidence that two recordings share a sound at a lag, beyond chance, for sounds of any kind.

No single curve shows every sound best: a rumble needs whitening, a bird call is drowned by it. So the recordings are
correlated under four weights of the cross-spectrum, from nearly plain to phase alone (C. Knapp and G. Carter, "The
generalized correlation method for estimation of time delay", IEEE Trans. ASSP 24 (1976)), and all peaks are scored by
one measure:

* The peak is interpolated between the samples, over its whole lobe: with few samples a cycle, the highest sample can
  belong to the next cycle.
* The part of the curve that the recordings' autocorrelation explains is subtracted.
* The height is compared with the rest of the curve: with its largest local deviation on several scales, since the same
  loud events overlap there and chance has the same spread; and with its highest other point.
* Evidence is limited by the number of samples that contribute: a click that meets a click is one agreement, not many.
  The number of rare events that meet is compared with a Poisson process; samples are clipped, so that the loudest
  events do not hide the others.

The score is the evidence over that needed to be beyond chance: ``sqrt(2 ln N)``, the height of the highest of N lags by
chance, plus ``MARGIN`` deviations.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy import fft, ndimage

from stereolag.core.arrays import Vector
from stereolag.signals.correlation import Lags, faded, overlap_length, overlap_slices, transform_length
from stereolag.signals.peaks import best_cycle, interpolate_peak

MARGIN = 1.8
"""Standard deviations by which a convincing agreement exceeds the highest that chance reaches."""

Samples = npt.NDArray[np.float32]
Spectrum = npt.NDArray[np.complex64]

_FLOORS = (1e-1, 1e-2, 1e-4)
"""Floors of the whitening weights, as shares of the loud power common to both recordings."""

_EXTREME_WEIGHTS, _MIDDLE_WEIGHTS = (0, 3), (1, 2)
"""Numbers of the weights: the one that whitens least and the phase, and those between them."""

_DECISIVE_SCORE = 2.0
"""Where both extreme weights reach this score at one lag, the middle ones are not computed."""

_PHASE_FLOOR = 1e-3
"""Floor of the phase weight, as a share of the mean magnitude of the cross-spectrum."""

_LOUD_QUANTILE = 0.98
"""Quantile of the power common to both recordings that counts as loud."""

_LOCAL_REACHES = (24, 96, 384, 1536, 6144, 24576)
"""Lags on either side over which the local deviation is taken."""

_CELL_LAGS = 32
"""Lags per cell of the search for peaks."""

_MAX_BANDS = 2048
"""A spectrum is averaged to this number of bands and one more."""

_COLOUR_REACH = 256
"""Lags of the bands' autocorrelation, from 0 on, that show the colour of a recording."""

_MAX_LOBE = 400
"""Lags from a peak to the end of its lobe, at most."""

_MAX_ENVELOPE = 512
"""Lags from a peak to the end of its envelope, at most."""

_STRETCHES = 32
"""Stretches of the overlap over which many events must be spread."""

_MIN_SHARING_STRETCHES = 6.0
"""Least effective number of these stretches that contribute to an agreement of many events."""

_MAX_EVENT_BLOCKS = 512
"""Blocks of the overlap in which events are counted, at most."""

_OVERDISPERSION = 1.25
"""Factor on the deviation of a Poisson process, since events with a beat of their own meet more often."""

_CLIP_LEVEL = 10.0
"""Magnitude at which samples are clipped, as a multiple of the mean magnitude."""

_MIN_INNER_ENERGY = 0.8
"""Share of the energy that faded ends must leave for clipped samples to count: any cut is loud."""

_MIN_COLOUR = 0.05
"""Share of the autocorrelation's middle from which on the lags beside it are more than white noise."""

_MIN_OVERLAP = 64
"""Samples; shorter overlaps are not searched, unless a recording has fewer than twice as many."""

_MIN_OVERLAP_SHARE = 0.02
"""Overlap below which lags are not searched, as a share of the longest."""

MEDIAN_POINTS = 2**15
"""Points of a curve from which its median and robust deviation are taken, about."""

_MIN_LEAD = 1.8
"""A peak this many times as high as any other point is convincing alone."""

_MIN_LEAD_OF_LOCAL = 1.15
"""The same for the product of this lead and the local height over that needed."""

_MIN_EXAMINED_SHARE = 0.8
"""Share of the evidence needed below which a peak is not examined."""

_MAX_INTERSAMPLE_RATIO = math.pi / 2
"""Largest ratio of the height of a curve between two samples to that on them."""

_CORE_LAGS = 3
"""Lags on either side of a peak that belong to it."""

_MIN_LONE_RATIO = 2.5
"""A peak this many times as high as any point outside its core does not repeat, not even in cycles."""

_MIN_CLEAR_GAP = 4.0
"""Standard deviations of their difference from which on two heights are not equal."""

_MIN_DISTANT_RIVAL = 0.85
"""Share of the peak's height from which on a lag far from it fits equally well."""

_MIN_EXPLAINED_SHARE = 0.5
"""Share of another peak from which on the recordings' autocorrelation explains it."""

_MIN_RIVAL_HEIGHT = 0.4
"""Least height of a rival, as a share of the peak's."""

_MAX_OVERLAP_RATIO = 4.0
"""Largest ratio of the peak's overlap to that of a rival."""

_MAX_RIVAL_CANDIDATES = 64
"""Highest points of a curve that are examined as rivals."""


def _block_sums(values: Samples, size: int) -> Vector:
    """Return the sums over blocks of `size` values, without an incomplete block at the end."""
    count = values.size // size
    return np.asarray(values[: count * size].reshape(count, size).sum(axis=1, dtype=np.float64))


def effective_count(values: Vector) -> float:
    """Return the number of equal values with the same sum and sum of squares; 0 for a sum that is not positive."""
    return max(float(values.sum()), 0.0) ** 2 / (float(values @ values) + 1e-300)


def standardised(signal: npt.NDArray[np.floating]) -> Samples:
    """Return the signal with zero mean and unit standard deviation, float32."""
    centred = signal - signal.mean(dtype=np.float64)
    deviation = math.sqrt(float(np.einsum("n,n->", centred, centred)) / signal.size)
    return np.asarray(centred / (deviation or 1.0), dtype=np.float32)


@dataclass(frozen=True)
class Peak:
    """A peak of one of the weighted curves.

    Attributes
    ----------
    weight
        Index of the weight.
    lag, height
        Position between the samples, samples, and height of the curve there.
    score
        Evidence over that needed: above 1 the peak is not due to chance.
    agreement, max_agreement
        Agreement of the samples at the lag, standard deviations of chance, and the largest that they allow.
    global_height, cycle_height
        Height in robust standard deviations of the whole curve; and in the geometric mean of these and the largest
        local deviation, which is right for comparisons of neighbouring cycles.
    repetition
        Factor from the recordings' autocorrelation to the curve around this peak.
    """

    weight: int
    lag: float
    height: float
    score: float = 0.0
    agreement: float = 0.0
    max_agreement: float = math.inf
    global_height: float = 0.0
    cycle_height: float = 0.0
    repetition: float = 0.0

    def is_clearly_above(self, other: Peak) -> bool:
        """Return whether this peak is clearly higher than another one that belongs to the same cycles."""
        share = min(other.global_height / max(self.global_height, 1e-30), 1.0)
        return (1 - share) * self.cycle_height >= _MIN_CLEAR_GAP * math.sqrt(2 * (1 - min(share, 0.9999)))


def needed_for(searched: int, steps: int = 0, size: int = 1) -> float:
    """Return the evidence that the best of `searched` lags needs, standard deviations of chance.

    A lag with steps is the best of more alternatives: each step may be at any of `size` samples.
    """
    return math.sqrt(2 * (math.log(searched + 1) + steps * math.log(size))) + MARGIN


class Evidence:
    """Two recordings correlated under every weight, for the lags from `first` to `last`.

    Parameters
    ----------
    signal_1, signal_2
        (N1,) and (N2,) samples from :func:`standardised`, 16 or more.
    first, last
        ``-N1 < first <= last < N2``, samples.
    searched
        Number of lags searched overall, of which these may be a part.
    """

    def __init__(self, signal_1: Samples, signal_2: Samples, first: int, last: int, searched: int) -> None:
        self.sizes = signal_1.size, signal_2.size
        self.first, self.last = first, last
        self.needed = needed_for(searched)
        self.points = transform_length(sum(self.sizes), real=True)
        rows = np.zeros((2, self.points), dtype=np.float32)
        rows[0, : signal_1.size], rows[1, : signal_2.size] = signal_1, signal_2
        self.spectra: Spectrum = np.asarray(fft.rfft(rows, axis=1, workers=2))
        self.cross: Spectrum = self.spectra[0].conj() * self.spectra[1]
        self.powers = self.spectra.real**2 + self.spectra.imag**2
        geometric = np.float32(math.sqrt(signal_1.size * signal_2.size) / 2)
        self.mean_power = (self.powers[0] / signal_1.size + self.powers[1] / signal_2.size) * geometric
        lags = np.arange(first, last + 1, dtype=np.int32)
        self.overlap = overlap_length(*self.sizes, lags).astype(np.float32)
        shortest = max(min(_MIN_OVERLAP, min(self.sizes) // 2), _MIN_OVERLAP_SHARE * float(self.overlap.max()))
        self.long_enough = self.overlap >= shortest
        width = max(3, min(self.sizes) // 128)
        smooth = ndimage.uniform_filter1d(self.powers, width, axis=1, mode="reflect")
        self._common = np.sqrt(np.maximum(smooth[0] * smooth[1], 0))
        self._loud = float(np.quantile(self._common[:: max(1, self._common.size // 8192)], _LOUD_QUANTILE))
        self.curves: dict[int, WeightedCurve] = {}

    def _correlate(self, numbers: Sequence[int]) -> None:
        """Add the curves of some weights."""
        weights = [self._weight(number) for number in numbers]
        curves = fft.irfft(np.stack([self.cross * weight for weight in weights]), self.points, axis=1, workers=2)
        for number, weight, products in zip(numbers, weights, curves, strict=True):
            self.curves[number] = WeightedCurve(self, weight, products)

    def _weight(self, number: int) -> Samples:
        if number < len(_FLOORS):
            return np.asarray(1 / (self._common + np.float32(_FLOORS[number] * self._loud + 1e-30)))
        magnitude = np.sqrt(self.powers[0] * self.powers[1])
        return np.asarray(1 / (magnitude + np.float32(_PHASE_FLOOR * magnitude.mean() + 1e-30)))

    def peaks(self, places: tuple[float, ...] = ()) -> list[Peak]:
        """Return the highest peaks under every weight and those at the given lags, the most convincing first.

        Without the middle weights if both extreme ones are decisive for one lag.
        """
        for numbers in (_EXTREME_WEIGHTS, _MIDDLE_WEIGHTS):
            self._correlate(numbers)
            found = self._scored_peaks(places)
            leaders = [next(peak for peak in found if peak.weight == number) for number in _EXTREME_WEIGHTS]
            if abs(leaders[0].lag - leaders[1].lag) < 1 and min(peak.score for peak in leaders) > _DECISIVE_SCORE:
                return found
        return [self._with_agreement(found[0]), *found[1:]]

    def _with_agreement(self, peak: Peak) -> Peak:
        """Return the best peak, scored by its agreement too if all weights but one, or all, have their maximum there.

        A few loud calls fill their surroundings with cycles of their own, so their peak stands out little from these,
        but it towers over the rest of the curve, whatever the weight.
        """
        highest = [float(self.first + np.argmax(curve.curve)) for curve in self.curves.values()]
        if sum(abs(lag - peak.lag) < 1 for lag in highest) < len(highest) - 1:
            return peak
        if math.isinf(peak.max_agreement):
            agreement, max_agreement = self.curves[peak.weight].agreement(round(peak.lag))
            peak = replace(peak, agreement=agreement, max_agreement=max_agreement)
        # Convincing from 1.5, 2.5 and 1.2 times the evidence needed on.
        agreed = min(peak.agreement / 1.5, peak.global_height / 2.5, peak.cycle_height / 1.2) / self.needed
        return replace(peak, score=max(peak.score, agreed))

    def _scored_peaks(self, places: tuple[float, ...]) -> list[Peak]:
        """Return the highest peaks of the curves computed so far and those at the given lags, with their scores."""
        found = []
        wanted = [round(place) - self.first for place in places if self.first <= place <= self.last]
        for number, curve in self.curves.items():
            measured: list[int] = []
            for index in [*curve.tops(), *wanted] or [0]:
                if all(abs(index - other) > curve.lobe for other in measured):
                    measured.append(index)
                    found.append(replace(curve.measure(index), weight=number))
        found.sort(key=lambda peak: (-peak.score, -peak.global_height))
        # The products at a lag are summed under one weight only, if that is enough: the more colour a weight leaves,
        # the fewer of them are independent.
        known: list[Peak] = []
        for peak in found:
            reach = max(3, self.curves[peak.weight].lobe)
            same = next((other for other in known if abs(other.lag - peak.lag) <= reach), None)
            if same is not None and (same.agreement >= self.needed or peak.score <= 1):
                agreement, max_agreement = same.agreement, same.max_agreement
            elif peak.score > _MIN_EXAMINED_SHARE or not known:
                agreement, max_agreement = self.curves[peak.weight].agreement(round(peak.lag))
            else:
                agreement, max_agreement = peak.global_height, math.inf
            score = min(peak.score, agreement / self.needed)
            known.append(replace(peak, score=score, agreement=agreement, max_agreement=max_agreement))
        return sorted(known, key=lambda peak: (-peak.score, -peak.cycle_height))

    def beside(self, peak: Peak, known: Sequence[float]) -> Peak:
        """Return a peak scored again, with better peaks left out of its surroundings."""
        if peak.score > 1 or peak.global_height < self.needed:
            return peak
        curve = self.curves[peak.weight]
        alone = curve.measure(round(peak.lag) - self.first, known)
        agreement, max_agreement = curve.agreement(round(alone.lag)) if alone.score > 1 else (0.0, 0.0)
        score = min(alone.score, agreement / self.needed)
        return replace(alone, weight=peak.weight, score=score, agreement=agreement, max_agreement=max_agreement)

    def lower_peaks(self, peak: Peak) -> list[Peak]:
        """Return more of the highest points under the weight of a peak, without scores, down to 12 dB below it."""
        curve = self.curves[peak.weight]
        heights = ((index, float(curve.curve[index])) for index in curve.tops(3))
        return [
            Peak(peak.weight, self.first + index, height, global_height=height / curve.deviation)
            for index, height in heights
            if height > 0.25 * peak.height
        ]

    def smeared(self) -> list[float]:
        """Return the lags around which the curves have the most power: drift smears a peak over many lags."""
        return [self.first + self.curves[number].center_of_power() for number in _EXTREME_WEIGHTS]

    def prefers_opposite(self, peak: Peak) -> bool:
        """Return whether the lowest trough of the peak's curve is deeper than the peak is high."""
        return -float(self.curves[peak.weight].curve.min()) > peak.height

    def bands(self, power: Samples) -> Vector:
        """Return the mean power in bands of equal width, at most ``_MAX_BANDS`` + 1 of them."""
        if power.size <= _MAX_BANDS + 1:
            return power.astype(np.float64)
        edges = np.linspace(0, power.size, _MAX_BANDS + 2).astype(int)
        return np.add.reduceat(power, edges[:-1], dtype=np.float64) / np.diff(edges)


class WeightedCurve:
    """The correlation under one weight, over the lags of its :class:`Evidence`.

    Attributes
    ----------
    curve
        (lags,) sums of products; 0 where the overlap is too short.
    lobe, envelope
        Lags from a peak to the end of its lobe, and to the end of its envelope, which may hold several cycles.
    deviation
        Robust standard deviation of the curve.
    """

    def __init__(self, evidence: Evidence, weight: Samples, products: Samples) -> None:
        self._evidence, self._weight = evidence, weight
        self.curve: Samples = np.roll(products, -evidence.first)[: evidence.overlap.size]
        self.curve[~evidence.long_enough] = 0
        some = np.s_[:: max(1, self.curve.size // MEDIAN_POINTS)]
        self.deviation = 1.4826 * float(np.median(np.abs(self.curve[some][evidence.long_enough[some]]))) + 1e-30
        bands = evidence.bands(evidence.mean_power * weight)
        shape = np.abs(fft.ifft(np.append(bands, np.zeros(bands.size))))[: bands.size]
        # Noise in one recording adds to the autocorrelation at lag 0 only.
        beside = float(shape[1:3].max())
        whole = beside if beside > _MIN_COLOUR * shape[0] else float(shape[0])
        self.lobe = max(2, int(np.flatnonzero(shape[:_MAX_LOBE] > 0.25 * whole)[-1])) + 1
        low = np.flatnonzero(shape[:_MAX_ENVELOPE] < 0.3 * beside)
        self.envelope = max(self.lobe, int(low[0]) if low.size else _MAX_ENVELOPE)

    @cached_property
    def _autocorrelation(self) -> Samples:
        """The mean of both recordings' autocorrelations, at lags 0, 1, … wrapping around."""
        return np.asarray(fft.irfft(self._evidence.mean_power * self._weight, self._evidence.points))

    @cached_property
    def _weighted(self) -> Samples:
        """(2, points) both recordings under the root of the weight, so that their correlation is the curve."""
        return np.asarray(fft.irfft(self._evidence.spectra * np.sqrt(self._weight), self._evidence.points, workers=2))

    @cached_property
    def _clipped(self) -> Samples:
        """(2, points) the weighted recordings, clipped at ``_CLIP_LEVEL`` times their mean magnitude.

        0 if the ends are loud, as those of any cut are.
        """
        clipped = np.zeros_like(self._weighted)
        for row, padded, size in zip(clipped, self._weighted, self._evidence.sizes, strict=True):
            signal = padded[:size]
            limit = _CLIP_LEVEL * np.abs(signal).mean()
            if np.sum(faded(signal) ** 2) > _MIN_INNER_ENERGY * np.sum(signal**2):
                row[:size] = np.clip(signal, -limit, limit)
                row[:size] -= row[:size].mean()
        return clipped

    @cached_property
    def _colour(self) -> float:
        return self._widening(self._evidence.powers * self._weight)

    @cached_property
    def _clipped_colour(self) -> float:
        return self._widening(np.abs(fft.rfft(self._clipped, workers=2)) ** 2)

    def _widening(self, powers: Samples) -> float:
        """Return the factor by which the colour of both widens the spread of chance (M. S. Bartlett, 1935)."""
        own = [fft.irfft(self._evidence.bands(power))[:_COLOUR_REACH] for power in powers]
        shared = float(own[0][1:] @ own[1][1:]) / (float(own[0][0] * own[1][0]) + 1e-300)
        return math.sqrt(max(1.0, 1 + 2 * shared))

    def tops(self, count: int = 2) -> list[int]:
        """Return the indices of the highest points by height over the local deviation, and of those by height."""
        cells = -(-self.curve.size // _CELL_LAGS)
        starts, skipped = np.arange(0, self.curve.size, _CELL_LAGS), -(-self.lobe // _CELL_LAGS)
        high = np.maximum.reduceat(self.curve, starts)
        sums = np.append(0.0, np.cumsum(np.add.reduceat(self.curve * self.curve, starts), dtype=np.float64))
        cell = np.arange(cells)

        def energy_within(radius: int) -> tuple[Vector, Lags]:
            low, end = np.maximum(0, cell - radius), np.minimum(cells, cell + radius + 1)
            return sums[end] - sums[low], (end - low) * _CELL_LAGS

        lobe, lobe_size = energy_within(skipped)
        power = np.zeros(cells)
        for reach in _LOCAL_REACHES:
            radius = skipped - (-reach // _CELL_LAGS)
            if radius > max(cells, skipped + 1):
                break
            total, size = energy_within(radius)
            np.maximum(power, (total - lobe) / np.maximum(_CELL_LAGS, size - lobe_size), out=power)
        found: list[int] = []
        for heights in (np.where(power > 0, high / np.sqrt(power + 1e-30), 0.0), high.astype(np.float64)):
            for _ in range(count):
                best = int(np.argmax(heights))
                if heights[best] <= 0:
                    break
                index = best * _CELL_LAGS + int(np.argmax(self.curve[best * _CELL_LAGS : (best + 1) * _CELL_LAGS]))
                if all(abs(index - other) > 1 for other in found):
                    found.append(index)
                heights[max(0, best - skipped) : best + skipped + 1] = 0
        return found

    def height_at(self, lag: float) -> float:
        """Return the height of the peak within a sample of a lag, interpolated between the lags."""
        first = max(0, round(lag) - self._evidence.first - 1)
        return interpolate_peak(self.curve, first + int(np.argmax(self.curve[first : first + 3])))[1]

    def is_one_peak(self, lag: float, other: float) -> bool:
        """Return whether the curve stays above half the height at the second lag on the way there from the first."""
        first, last = sorted((round(lag) - self._evidence.first, round(other) - self._evidence.first))
        return float(self.curve[first : last + 1].min()) > 0.5 * self.height_at(other)

    def is_one_sided(self, lag: float) -> bool:
        """Return whether a peak has a deep trough on one side and hardly one on the other.

        That is a turn of the phase by a filter, as of a telephone or of a sensor of velocity: the peak and the trough
        are of one arrival. An inverted recording has troughs on both sides, equally deep, or nearly none.
        """
        index = round(lag) - self._evidence.first
        beside = self.curve[: index + 1][::-1], self.curve[index:]
        depths = []
        for side in (part[:_MAX_ENVELOPE] for part in beside):
            below = side[int(np.argmax(side < 0)) :]
            depths.append(-float(below[: int(np.argmax(below >= 0)) or None].min()))
        return max(depths) > 0.5 * float(self.curve[index]) and min(depths) < 0.5 * max(depths)

    def center_of_power(self) -> int:
        """Return the middle of the stretch of lags whose power exceeds the median most clearly."""
        sums = np.append(0.0, np.cumsum(self.curve.astype(np.float64) ** 2))
        best, place = 0.0, self.curve.size // 2
        for reach in _LOCAL_REACHES:
            if 2 * reach >= self.curve.size:
                break
            power = (sums[2 * reach :: _CELL_LAGS // 2] - sums[: -2 * reach : _CELL_LAGS // 2]) / (2 * reach)
            excess = (power / (np.median(power) + 1e-30) - 1) * math.sqrt(reach)
            top = int(np.argmax(excess))
            if excess[top] > best:
                best, place = float(excess[top]), top * (_CELL_LAGS // 2) + reach
        return place

    def measure(self, index: int, known: Sequence[float] = ()) -> Peak:
        """Return the peak whose envelope contains an index, scored by its height.

        The lags in `known` are those of better peaks, which do not belong to its surroundings.
        """
        first, needed, value = self._evidence.first, self._evidence.needed, float(self.curve[index])
        global_height = value / self.deviation
        if _MAX_INTERSAMPLE_RATIO * max(global_height, self._over_local(index) / _MIN_EXAMINED_SHARE) < needed:
            return Peak(0, first + index, value, global_height=global_height)
        index = best_cycle(self.curve, index, self.envelope + 2)
        offset, height = interpolate_peak(self.curve, index)
        peak = Peak(0, first + index + offset, height, global_height=height / self.deviation)
        if peak.global_height < needed and self._over_local(index) < _MIN_EXAMINED_SHARE * needed:
            return peak
        low, end = max(0, index - _LOCAL_REACHES[-1]), min(self.curve.size, index + _LOCAL_REACHES[-1] + 1)
        middle, part = index - low, self.curve[low:end].astype(np.float64)
        beside = (self.curve[: max(0, index - _CORE_LAGS)], self.curve[index + _CORE_LAGS + 1 :])
        factor = 0.0
        # Where nothing else is nearly as high, there is no repetition to subtract.
        if height < _MIN_LONE_RATIO * max((float(side.max()) for side in beside if side.size), default=height):
            factor, repeated = self._repetition(offset, part, middle)
            part = part - repeated
        rest = np.where(self._evidence.long_enough[low:end], part, 0.0)
        for place in (middle, *(round(lag) - first - low for lag in known)):
            rest[max(0, place - self.lobe) : max(0, place + self.lobe + 1)] = 0
        around = [
            rest[max(0, middle - reach) : middle + reach + 1]
            for reach in _LOCAL_REACHES
            if self.lobe < reach < self.curve.size
        ]
        # Not "@": the linear algebra library starts threads for it, which then wait busily for more.
        powers = [
            float(np.einsum("n,n->", values, values)) / int(np.count_nonzero(values))
            for values in around
            if values.any()
        ]
        local = height / math.sqrt(max(powers)) if powers else 0.0
        others = [float(values.max()) for values in (self.curve[:low], rest, self.curve[end:]) if values.size]
        lead = height / max(*others, 1e-30) if len(others) > 1 else height / max(others[0], 1e-30)
        leads = min(max(lead / _MIN_LEAD, local / needed * lead / _MIN_LEAD_OF_LOCAL), peak.global_height / needed)
        cycle_height = math.sqrt(peak.global_height * local) if powers else peak.global_height
        return replace(peak, score=max(local / needed, leads), cycle_height=cycle_height, repetition=factor)

    def _repetition(self, offset: float, part: Vector, middle: int) -> tuple[float, Vector]:
        """Return the factor from the autocorrelation to the curve around a peak, and the autocorrelation times it.

        By least squares around the peak but for its middle, where noise in one recording adds to the autocorrelation.
        """
        reach, points, spectrum = self._autocorrelation_spectrum
        angle = np.arange(spectrum.size, dtype=np.float32) * np.float32(2 * np.pi * offset / points)
        shifted = fft.irfft(spectrum * (np.cos(angle) - 1j * np.sin(angle)), points)
        own = shifted[reach - middle : reach - middle + part.size].astype(np.float64)
        near = slice(max(0, middle - 4 * self.lobe - 40), middle + 4 * self.lobe + 41)
        flanks = own[near].copy()
        flanks[np.abs(np.arange(near.start, near.start + flanks.size) - middle - offset) < 2] = 0
        factor = float(flanks @ part[near]) / (float(flanks @ flanks) + 1e-300)
        factor = min(max(factor, 0.0), 4.5 * float(part[middle]) / max(float(own[middle]), 1e-300))
        return factor, factor * own

    @cached_property
    def _autocorrelation_spectrum(self) -> tuple[int, int, Spectrum]:
        """The reach of the autocorrelation around a peak, lags; points and spectrum of this part, padded."""
        reach = min(_LOCAL_REACHES[-1], self.curve.size)
        points = transform_length(2 * reach + 257, real=True)
        places = np.arange(-reach, points - reach)
        return reach, points, np.asarray(fft.rfft(self._autocorrelation.take(places, mode="wrap")))

    def _over_local(self, index: int) -> float:
        """Return the height at an index over the root mean square of its surroundings without its lobe."""
        reach = _LOCAL_REACHES[2]
        around = self.curve[max(0, index - reach) : index + reach + 1].astype(np.float64)
        lobe = self.curve[max(0, index - self.lobe) : index + self.lobe + 1].astype(np.float64)
        power = (float(around @ around) - float(lobe @ lobe)) / max(1, around.size - lobe.size)
        return float(self.curve[index]) / math.sqrt(max(power, 0.0) + 1e-30)

    def agreement(self, lag: int) -> tuple[float, float]:
        """Return the agreement at a lag and the largest that the samples allow, in standard deviations of chance.

        By the sum of their products, or by the number of events that meet if that says more.
        """
        part_1, part_2 = overlap_slices(*self._evidence.sizes, lag)
        products, scale, events = self._compared(self._weighted[0, part_1], self._weighted[1, part_2], self._colour)
        total = float(products.sum(dtype=np.float64)) / scale
        if max(total, events) < self._evidence.needed:
            # One or two impulses hold nearly all of the energy and hide how many others meet.
            clipped = self._clipped[0, part_1], self._clipped[1, part_2]
            clipped_products, clipped_scale, met = self._compared(*clipped, self._clipped_colour)
            events = max(events, min(float(clipped_products.sum(dtype=np.float64)) / clipped_scale, met))
        return max(total, events), max(float(np.abs(products).sum(dtype=np.float64)) / scale, events)

    def _compared(self, signal_1: Samples, signal_2: Samples, colour: float) -> tuple[Samples, float, float]:
        """Return the products of the samples, the standard deviation of their sum by chance, and the coincidence."""
        products = signal_1 * signal_2
        scale = math.sqrt(float(np.sum(products * products, dtype=np.float64)) + 1e-300) * colour
        return products, scale, self._coincidence((signal_1, signal_2), products)

    def _coincidence(self, signals: tuple[Samples, Samples], products: Samples) -> float:
        """Return by how much more rare events meet than by chance, in standard deviations of a Poisson process.

        Few samples have large products then, but silence also meets silence: that all of thirty events in a minute meet
        others is less likely than that thirty products have one sign. The events must be spread over the recordings
        (0 otherwise), since one event of several samples is a single agreement.
        """
        lobe = 2 * self.lobe + 1
        stretch = products.size // _STRETCHES
        if stretch < lobe or effective_count(_block_sums(products, stretch)) < _MIN_SHARING_STRETCHES:
            return 0.0
        size = max(lobe, products.size // _MAX_EVENT_BLOCKS)
        met = effective_count(_block_sums(products, size))
        blocks = products.size / size
        first, second = (effective_count(_block_sums(signal * signal, size)) for signal in signals)
        chance = first * second / blocks * lobe / size
        return math.sqrt(2 * (met * math.log(met / chance) - met + chance)) / _OVERDISPERSION if met > chance else 0.0

    def repeats(self, peak: Peak, other: Peak) -> bool:
        """Return whether the recordings' autocorrelation explains half of another peak."""
        apart = round(other.lag) - round(peak.lag)
        around = self._autocorrelation[np.arange(apart - 1, apart + 2) % self._evidence.points]
        factor = peak.repetition or peak.height / max(float(self._autocorrelation[0]), 1e-30)
        return factor * float(around.max()) > 0.5 * other.height

    def rivals(self, peak: Peak) -> list[float]:
        """Return the lags that fit as well as a peak of this curve, the highest first.

        Heights are compared as if all overlaps were equally long. Near the peak, and where the recordings'
        autocorrelation explains the other one, two heights are equal if they differ by less than ``_MIN_CLEAR_GAP``
        deviations of their difference. Elsewhere the other one is equal if it is at least ``_MIN_DISTANT_RIVAL`` times
        as high and beyond chance itself. There, a longer overlap is no reason to expect more: a sound that each
        recording contains many times, as a bell, fits at many lags.
        """
        evidence, curve = self._evidence, self.curve
        index, overlap = round(peak.lag) - evidence.first, evidence.overlap
        # No lower point is a rival, however short its overlap is.
        high = np.flatnonzero(curve[1:-1] >= _MIN_RIVAL_HEIGHT / _MAX_OVERLAP_RATIO * peak.height) + 1
        high = high[(curve[high] >= curve[high - 1]) & (curve[high] > curve[high + 1]) & (np.abs(high - index) > 1)]
        factors = overlap[index] / np.maximum(overlap[high], 1)
        heights = curve[high] * np.maximum(factors, 1)
        best = np.argsort(-heights, kind="stable")
        compared = (
            evidence.long_enough[high] & (factors <= _MAX_OVERLAP_RATIO) & (heights >= _MIN_RIVAL_HEIGHT * peak.height)
        )
        best = best[compared[best]][:_MAX_RIVAL_CANDIDATES]
        found = []
        for other, factor in zip(high[best].tolist(), factors[best].tolist(), strict=True):
            offset, height = interpolate_peak(curve, other)
            share = height * factor / peak.height
            apart = other - index
            if self.is_one_peak(peak.lag, evidence.first + other):
                continue
            places = np.arange(apart - 1, apart + 2) % evidence.points
            explained = peak.repetition * float(self._autocorrelation[places].max()) * factor / peak.height
            near = abs(apart) <= 4 * self.envelope + 32
            explained = min(max(explained, share if near else 0.0), 0.9999)
            deviations = peak.cycle_height if near else min(peak.global_height, peak.agreement)
            # The samples that are in only one of the two overlaps can make this much of a difference.
            exchanged = 2 * abs(apart) / float(overlap[index])
            clear = _MIN_CLEAR_GAP * math.sqrt(2 * (1 - explained)) / deviations
            equal = explained >= _MIN_EXPLAINED_SHARE and 1 - share < clear + exchanged
            relative_height = height * max(factor, 1) / peak.height
            if equal or (
                not near and relative_height >= _MIN_DISTANT_RIVAL and height >= 0.9 * evidence.needed * self.deviation
            ):
                found.append(evidence.first + other + offset)
        return found
