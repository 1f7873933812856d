"""Evidence that two recordings share a sound at a lag, beyond what chance reaches, whatever they sound like.

No single curve shows every sound best: a rumble needs whitening, a bird call is drowned by it. So the cross-spectrum is
correlated under four weights, from nearly plain to phase alone (C. Knapp and G. Carter, "The generalized correlation
method for estimation of time delay", IEEE Trans. ASSP 24 (1976)), and all their peaks are scored by one measure:

* The peak is searched for between the samples, over its whole lobe: with few samples a cycle, the highest sample can
  belong to the next cycle.
* The part of the curve that the recordings' own repetition explains is subtracted.
* The height is compared with the rest: with its largest local deviation on several scales, since the same loud events
  overlap there and chance has the same spread; and with its highest other point.
* No evidence is larger than the samples that carry it allow: a click that meets a click is one agreement, not many.
  Many rare events that meet are compared with those of a Poisson process, the loudest limited so as not to hide others.

A score above 1 is beyond chance: that many times the height that the highest of N lags reaches, ``sqrt(2 ln N)``, and
``MARGIN`` deviations more.
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
"""Standard deviations above the highest that chance reaches, from which on an agreement is convincing."""

Samples = npt.NDArray[np.float32]
Spectrum = npt.NDArray[np.complex64]

_FLOORS = (1e-1, 1e-2, 1e-4)
"""Floors of the whitening weights, as shares of the power that is common to both recordings."""

_UNLIKE, _OTHERS = (0, 3), (1, 2)
"""Numbers of the weights: the least whitening one and the phase, and those between them."""

_BY_FAR = 2.0
_PHASE_FLOOR = 1e-3
_LOUD = 0.98
"""Quantile of the common power that stands for its height."""

_SCALES = (24, 96, 384, 1536, 6144, 24576)
"""Lags on either side over which the local deviation is taken."""

_CELL = 32
"""Lags per cell in which peaks are looked for."""

_BANDS = 2048
_COLOUR_REACH = 256
_WIDEST_LOBE, _WIDEST_ENVELOPE = 400, 512
_STRETCHES, _FEWEST_STRETCHES, _EVENT_BLOCKS = 32, 6.0, 512
"""Stretches of the recordings, and how many of them must share an agreement for it to be one of many events; and most
blocks in which events are counted."""

_DEPENDENT = 1.25
"""Events on a beat of their own meet more often than those of a Poisson process."""

_LIMIT, _INNER = 10.0, 0.8
"""Times the mean magnitude to which samples are limited, and the least share of the energy away from both ends."""

_COLOURED = 0.05
"""From this share on, the own curve beside its middle is not that of white noise."""

_FEW_SAMPLES = 64
"""Overlaps below this number of samples are not searched."""

_SHORTEST_SHARE = 0.02
_MEDIAN_OF = 2**15

_LEAD, _LEAD_OF_LOCAL = 1.8, 1.15
"""A peak this many times as high as all the rest is convincing alone; with its local height, their product is."""

_WORTH_COUNTING = 0.8
"""Share of what is needed below which a peak is not looked into."""

_AGREED = 1.5, 2.5, 1.2
"""Where most weights lead to one lag, these times what is needed convinces: carried, above and clear of a peak."""

_BETWEEN = math.pi / 2
"""Between two samples, a curve is at most this many times as high as on them."""

_ALONE = 2.5
_CORE = 3
"""A peak this many times as high as everything more than so many lags beside it repeats nowhere, not even in cycles."""

_CLEAR_GAP = 4.0
"""Deviations between two heights from which on they are not equal."""

_ALIKE = 0.85
"""Far from the peak, another lag fits equally well from this share of the height on."""

_REPEATS = 0.5
"""From this share on, the recordings' own repetition explains another peak."""

_LEAST_RIVAL, _SHORTER = 0.4, 4.0
"""Least share of the height of a rival, and how many times shorter its overlap may be."""

_MOST_TOPS = 64


def _in_blocks(values: Samples, size: int) -> Vector:
    """Return the sums over blocks of a size; what is left over at the end is left out."""
    count = values.size // size
    return np.asarray(values[: count * size].reshape(count, size).sum(axis=1, dtype=np.float64))


def participating(values: Vector) -> float:
    """Return how many equal values would have the same sum and sum of squares; 0 for a sum that is not positive."""
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
        Evidence in units of what is needed to be convinced: above 1 the peak is not due to chance.
    carried, carriers
        Agreement in standard deviations of its own products, and the largest that these samples could reach.
    above, clear
        Height in robust standard deviations of the whole curve; and in the geometric mean of these and of the largest
        local deviation, which holds for comparisons of neighbouring cycles.
    repetition
        Factor from the recordings' own curve to this peak.
    """

    weight: int
    lag: float
    height: float
    score: float = 0.0
    carried: float = 0.0
    carriers: float = math.inf
    above: float = 0.0
    clear: float = 0.0
    repetition: float = 0.0

    def is_above(self, other: Peak) -> bool:
        """Return whether this peak is clearly higher than another one that belongs to the same cycles."""
        share = min(other.above / max(self.above, 1e-30), 1.0)
        return (1 - share) * self.clear >= _CLEAR_GAP * math.sqrt(2 * (1 - min(share, 0.9999)))


def needed_for(searched: int, steps: int = 0, size: int = 1) -> float:
    """Return the evidence that the best of so many lags needs, standard deviations of chance.

    A path with steps is the best of many, too: each step may be at any of `size` lags.
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
        Number of lags searched in all, of which these may be a part.
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
        self.own = (self.powers[0] / signal_1.size + self.powers[1] / signal_2.size) * geometric
        lags = np.arange(first, last + 1, dtype=np.int32)
        self.overlap = overlap_length(*self.sizes, lags).astype(np.float32)
        shortest = max(min(_FEW_SAMPLES, min(self.sizes) // 2), _SHORTEST_SHARE * float(self.overlap.max()))
        self.long_enough = self.overlap >= shortest
        width = max(3, min(self.sizes) // 128)
        smooth = ndimage.uniform_filter1d(self.powers, width, axis=1, mode="reflect")
        self._common = np.sqrt(np.maximum(smooth[0] * smooth[1], 0))
        self._loud = float(np.quantile(self._common[:: max(1, self._common.size // 8192)], _LOUD))
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
        """Return the highest peaks under every weight, and those at the given lags, the most convincing first.

        Where two unlike weights are convinced of one lag by far, the others are left out.
        """
        for numbers in (_UNLIKE, _OTHERS):
            self._correlate(numbers)
            found = self._counted(places)
            leaders = [next(peak for peak in found if peak.weight == number) for number in _UNLIKE]
            apart = abs(leaders[0].lag - leaders[1].lag)
            if apart < 1 and min(leader.score for leader in leaders) > _BY_FAR:
                return found
        return [self._agreed(found[0]), *found[1:]]

    def _agreed(self, peak: Peak) -> Peak:
        """Return the best peak with the evidence that it has if most of the weights lead to it.

        A few loud calls fill their surroundings with cycles of their own, so their peak stands out little from these,
        but it towers over all the rest, under one weight as under another.
        """
        highest = [float(self.first + np.argmax(curve.curve)) for curve in self.curves.values()]
        if sum(abs(lag - peak.lag) < 1 for lag in highest) < len(highest) - 1:
            return peak
        if math.isinf(peak.carriers):
            carried, carriers = self.curves[peak.weight].carried(round(peak.lag))
            peak = replace(peak, carried=carried, carriers=carriers)
        agreed = min(peak.carried / _AGREED[0], peak.above / _AGREED[1], peak.clear / _AGREED[2]) / self.needed
        return replace(peak, score=max(peak.score, agreed))

    def _counted(self, places: tuple[float, ...]) -> list[Peak]:
        """Return the highest peaks of the curves there are, and those at the given lags, with their scores."""
        found = []
        wanted = [round(place) - self.first for place in places if self.first <= place <= self.last]
        for number, curve in self.curves.items():
            seen: list[int] = []
            for index in [*curve.tops(), *wanted] or [0]:
                if all(abs(index - other) > curve.lobe for other in seen):
                    seen.append(index)
                    found.append(replace(curve.measure(index), weight=number))
        found.sort(key=lambda peak: (-peak.score, -peak.above))
        # One weight is enough to count the samples that carry the agreement at a lag, if it finds enough of them: the
        # more colour a weight leaves, the fewer are independent.
        known: list[Peak] = []
        for peak in found:
            reach = max(3, self.curves[peak.weight].lobe)
            same = next((other for other in known if abs(other.lag - peak.lag) <= reach), None)
            if same is not None and (same.carried >= self.needed or peak.score <= 1):
                carried, carriers = same.carried, same.carriers
            elif peak.score > _WORTH_COUNTING or not known:
                carried, carriers = self.curves[peak.weight].carried(round(peak.lag))
            else:
                carried, carriers = peak.above, math.inf
            score = min(peak.score, carried / self.needed)
            known.append(replace(peak, score=score, carried=carried, carriers=carriers))
        return sorted(known, key=lambda peak: (-peak.score, -peak.clear))

    def beside(self, peak: Peak, known: Sequence[float]) -> Peak:
        """Return a peak with the evidence that it has beside better ones, which are no part of its surroundings."""
        if peak.score > 1 or peak.above < self.needed:
            return peak
        curve = self.curves[peak.weight]
        alone = curve.measure(round(peak.lag) - self.first, known)
        carried, carriers = curve.carried(round(alone.lag)) if alone.score > 1 else (0.0, 0.0)
        score = min(alone.score, carried / self.needed)
        return replace(alone, weight=peak.weight, score=score, carried=carried, carriers=carriers)

    def smeared(self) -> list[float]:
        """Return the lags around which the whitened curves have the most power: clocks apart smear a peak over many."""
        return [self.first + self.curves[number].center_of_power() for number in _UNLIKE]

    def prefers_opposite(self, peak: Peak) -> bool:
        """Return whether the curve of a peak reaches farther down than up."""
        return -float(self.curves[peak.weight].curve.min()) > peak.height

    def bands(self, power: Samples) -> Vector:
        """Return the mean power in at most ``_BANDS`` + 1 bands of equal width."""
        if power.size <= _BANDS + 1:
            return power.astype(np.float64)
        edges = np.linspace(0, power.size, _BANDS + 2).astype(int)
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
        some = np.s_[:: max(1, self.curve.size // _MEDIAN_OF)]
        self.deviation = 1.4826 * float(np.median(np.abs(self.curve[some][evidence.long_enough[some]]))) + 1e-30
        bands = evidence.bands(evidence.own * weight)
        shape = np.abs(fft.ifft(np.append(bands, np.zeros(bands.size))))[: bands.size]
        # Noise of each recording alone adds to the middle of its own curve, and to no other place.
        beside = float(shape[1:3].max())
        whole = beside if beside > _COLOURED * shape[0] else float(shape[0])
        self.lobe = max(2, int(np.flatnonzero(shape[:_WIDEST_LOBE] > 0.25 * whole)[-1])) + 1
        low = np.flatnonzero(shape[:_WIDEST_ENVELOPE] < 0.3 * beside)
        self.envelope = max(self.lobe, int(low[0]) if low.size else _WIDEST_ENVELOPE)

    @cached_property
    def _own(self) -> Samples:
        """The mean of both recordings' own curves, at lags 0, 1, … wrapping around."""
        return np.asarray(fft.irfft(self._evidence.own * self._weight, self._evidence.points))

    @cached_property
    def _heard(self) -> Samples:
        """(2, points) both recordings under the root of the weight, whose product is the curve's."""
        return np.asarray(fft.irfft(self._evidence.spectra * np.sqrt(self._weight), self._evidence.points, workers=2))

    @cached_property
    def _limited(self) -> Samples:
        """(2, points) what is heard, limited to ``_LIMIT`` times its mean; 0 if its ends are loud, as any cut is."""
        limited = np.zeros_like(self._heard)
        for row, whole, size in zip(limited, self._heard, self._evidence.sizes, strict=True):
            heard = whole[:size]
            most = _LIMIT * np.abs(heard).mean()
            if np.sum(faded(heard) ** 2) > _INNER * np.sum(heard**2):
                row[:size] = np.clip(heard, -most, most)
                row[:size] -= row[:size].mean()
        return limited

    @cached_property
    def _colour(self) -> float:
        return self._widening(self._evidence.powers * self._weight)

    @cached_property
    def _limited_colour(self) -> float:
        return self._widening(np.abs(fft.rfft(self._limited, workers=2)) ** 2)

    def _widening(self, powers: Samples) -> float:
        """Return the factor by which colour of both widens agreement by chance (M. S. Bartlett, 1935)."""
        own = [fft.irfft(self._evidence.bands(one))[:_COLOUR_REACH] for one in powers]
        shared = float(own[0][1:] @ own[1][1:]) / (float(own[0][0] * own[1][0]) + 1e-300)
        return math.sqrt(max(1.0, 1 + 2 * shared))

    def tops(self, count: int = 2) -> list[int]:
        """Return the indices of the highest points, by height over the local deviation and by height."""
        cells = -(-self.curve.size // _CELL)
        starts, skipped = np.arange(0, self.curve.size, _CELL), -(-self.lobe // _CELL)
        high = np.maximum.reduceat(self.curve, starts)
        sums = np.append(0.0, np.cumsum(np.add.reduceat(self.curve * self.curve, starts), dtype=np.float64))
        cell = np.arange(cells)

        def around(radius: int) -> tuple[Vector, Lags]:
            low, end = np.maximum(0, cell - radius), np.minimum(cells, cell + radius + 1)
            return sums[end] - sums[low], (end - low) * _CELL

        lobe, lobe_size = around(skipped)
        power = np.zeros(cells)
        for scale in _SCALES:
            radius = skipped - (-scale // _CELL)
            if radius > max(cells, skipped + 1):
                break
            total, size = around(radius)
            np.maximum(power, (total - lobe) / np.maximum(_CELL, size - lobe_size), out=power)
        found: list[int] = []
        for heights in (np.where(power > 0, high / np.sqrt(power + 1e-30), 0.0), high.astype(np.float64)):
            for _ in range(count):
                best = int(np.argmax(heights))
                if heights[best] <= 0:
                    break
                index = best * _CELL + int(np.argmax(self.curve[best * _CELL : (best + 1) * _CELL]))
                if all(abs(index - other) > 1 for other in found):
                    found.append(index)
                heights[max(0, best - skipped) : best + skipped + 1] = 0
        return found

    def center_of_power(self) -> int:
        """Return the middle of the stretch of lags whose power exceeds that elsewhere the most clearly."""
        sums = np.append(0.0, np.cumsum(self.curve.astype(np.float64) ** 2))
        best, place = 0.0, self.curve.size // 2
        for scale in _SCALES:
            if 2 * scale >= self.curve.size:
                break
            power = (sums[2 * scale :: _CELL // 2] - sums[: -2 * scale : _CELL // 2]) / (2 * scale)
            excess = (power / (np.median(power) + 1e-30) - 1) * math.sqrt(scale)
            top = int(np.argmax(excess))
            if excess[top] > best:
                best, place = float(excess[top]), top * (_CELL // 2) + scale
        return place

    def measure(self, index: int, known: Sequence[float] = ()) -> Peak:
        """Return the peak whose envelope contains an index, with the evidence of its height beside known peaks."""
        needed, scale = self._evidence.needed, self.deviation
        most = _BETWEEN * max(float(self.curve[index]) / scale, self._over_local(index) / _WORTH_COUNTING)
        if most < needed:
            return Peak(
                0, self._evidence.first + index, float(self.curve[index]), above=float(self.curve[index]) / scale
            )
        index = best_cycle(self.curve, index, self.envelope + 2)
        offset, height = interpolate_peak(self.curve, index)
        peak = Peak(0, self._evidence.first + index + offset, height, above=height / scale)
        if peak.above < needed and self._over_local(index) < _WORTH_COUNTING * needed:
            return peak
        low, end = max(0, index - _SCALES[-1]), min(self.curve.size, index + _SCALES[-1] + 1)
        middle, part = index - low, self.curve[low:end].astype(np.float64)
        beside = (self.curve[: max(0, index - _CORE)], self.curve[index + _CORE + 1 :])
        factor = 0.0
        # Where nothing else is nearly as high, there is no repetition to subtract.
        if height < _ALONE * max((float(side.max()) for side in beside if side.size), default=height):
            factor, repeated = self._repetition(offset, part, middle)
            part = part - repeated
        rest = np.where(self._evidence.long_enough[low:end], part, 0.0)
        for place in (middle, *(round(lag) - self._evidence.first - low for lag in known)):
            rest[max(0, place - self.lobe) : max(0, place + self.lobe + 1)] = 0
        around = [
            rest[max(0, middle - reach) : middle + reach + 1]
            for reach in _SCALES
            if self.lobe < reach < self.curve.size
        ]
        # Not "@": the linear algebra library starts threads for it, which then wait busily for more.
        powers = [float(np.einsum("n,n->", one, one)) / int(np.count_nonzero(one)) for one in around if one.any()]
        local = height / math.sqrt(max(powers)) if powers else 0.0
        others = [float(one.max()) for one in (self.curve[:low], rest, self.curve[end:]) if one.size]
        lead = height / max(*others, 1e-30) if len(others) > 1 else height / max(others[0], 1e-30)
        leads = min(max(lead / _LEAD, local / needed * lead / _LEAD_OF_LOCAL), peak.above / needed)
        clear = math.sqrt(peak.above * local) if powers else peak.above
        return replace(peak, score=max(local / needed, leads), clear=clear, repetition=factor)

    def _repetition(self, offset: float, part: Vector, middle: int) -> tuple[float, Vector]:
        """Return the factor from the own curve to the curve around a peak, and the part that it explains.

        By least squares around the peak without its middle, where noise of each recording adds to its own curve.
        """
        reach, points, spectrum = self._own_middle
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
    def _own_middle(self) -> tuple[int, int, Spectrum]:
        """The lags on either side of the own curve's middle that surround a peak; the spectrum of this part, padded."""
        reach = min(_SCALES[-1], self.curve.size)
        points = transform_length(2 * reach + 257, real=True)
        places = np.arange(-reach, points - reach)
        return reach, points, np.asarray(fft.rfft(self._own.take(places, mode="wrap")))

    def _over_local(self, index: int) -> float:
        """Return the height at an index over the root mean square of its surroundings, its lobe aside."""
        reach = _SCALES[2]
        around = self.curve[max(0, index - reach) : index + reach + 1].astype(np.float64)
        lobe = self.curve[max(0, index - self.lobe) : index + self.lobe + 1].astype(np.float64)
        power = (float(around @ around) - float(lobe @ lobe)) / max(1, around.size - lobe.size)
        return float(self.curve[index]) / math.sqrt(max(power, 0.0) + 1e-30)

    def carried(self, lag: int) -> tuple[float, float]:
        """Return the agreement that the products at a lag carry, and the largest they could, in standard deviations."""
        part_1, part_2 = overlap_slices(*self._evidence.sizes, lag)
        heard = self._heard[0, part_1], self._heard[1, part_2]
        products = heard[0] * heard[1]
        scale = math.sqrt(float(np.sum(products * products, dtype=np.float64)) + 1e-300) * self._colour
        total, most = products.sum(dtype=np.float64), np.abs(products).sum(dtype=np.float64)
        met = self._coincidences(heard, products)
        if max(float(total) / scale, met) < self._evidence.needed:
            limited = self._limited[0, part_1], self._limited[1, part_2]
            met = max(met, self._agreement_of_limited(limited, limited[0] * limited[1]))
        return max(float(total) / scale, met), max(float(most) / scale, met)

    def _agreement_of_limited(self, limited: tuple[Samples, Samples], products: Samples) -> float:
        """Return the agreement of limited recordings, counted by samples and by events, whichever is less.

        Of impulses, one or two hold nearly all of the energy and hide how many others meet.
        """
        scale = math.sqrt(float(np.sum(products * products, dtype=np.float64)) + 1e-300) * self._limited_colour
        return min(float(products.sum(dtype=np.float64)) / scale, self._coincidences(limited, products))

    def _coincidences(self, heard: tuple[Samples, Samples], products: Samples) -> float:
        """Return the agreement of rare events that meet, in deviations of a Poisson process; 0 unless they are rare.

        A few samples carry it, but silence is met by silence as well: that all of thirty events in a minute meet
        others is less likely than the signs of thirty products. They must be spread over the recordings, since one
        event of several samples is a single agreement.
        """
        lobe = 2 * self.lobe + 1
        if products.size < _STRETCHES * lobe:
            return 0.0
        if participating(_in_blocks(products, products.size // _STRETCHES)) < _FEWEST_STRETCHES:
            return 0.0
        size = max(lobe, products.size // _EVENT_BLOCKS)
        met = participating(_in_blocks(products, size))
        blocks = products.size / size
        first, second = (participating(_in_blocks(one * one, size)) for one in heard)
        chance = first * second / blocks * lobe / size
        return math.sqrt(2 * (met * math.log(met / chance) - met + chance)) / _DEPENDENT if met > chance else 0.0

    def repeats(self, peak: Peak, other: Peak) -> bool:
        """Return whether the recordings' own repetition explains half of another peak."""
        apart = round(other.lag) - round(peak.lag)
        around = self._own[np.arange(apart - 1, apart + 2) % self._evidence.points]
        factor = peak.repetition or peak.height / max(float(self._own[0]), 1e-30)
        return factor * float(around.max()) > 0.5 * other.height

    def rivals(self, peak: Peak) -> list[float]:
        """Return the lags that fit as well as a peak of this curve, the highest first.

        Heights are compared as if all overlaps were equally long. Within the envelope, and where the recordings' own
        repetition explains the other peak, two heights are equal that differ by less than ``_CLEAR_GAP`` deviations of
        their difference; elsewhere if the other is ``_ALIKE`` as high and beyond chance itself. There, a longer overlap
        is no reason to expect more: sounds that both made by themselves, as a bell, fit as often at many lags.
        """
        evidence, curve = self._evidence, self.curve
        index, overlap = round(peak.lag) - evidence.first, evidence.overlap
        # No lower point is a rival, however short its overlap is.
        high = np.flatnonzero(curve[1:-1] >= _LEAST_RIVAL / _SHORTER * peak.height) + 1
        high = high[(curve[high] >= curve[high - 1]) & (curve[high] > curve[high + 1]) & (np.abs(high - index) > 1)]
        factors = overlap[index] / np.maximum(overlap[high], 1)
        heights = curve[high] * np.maximum(factors, 1)
        best = np.argsort(-heights, kind="stable")
        compared = evidence.long_enough[high] & (factors <= _SHORTER) & (heights >= _LEAST_RIVAL * peak.height)
        best = best[compared[best]][:_MOST_TOPS]
        found = []
        for other, factor in zip(high[best].tolist(), factors[best].tolist(), strict=True):
            offset, height = interpolate_peak(curve, other)
            share = height * factor / peak.height
            apart = other - index
            between = curve[min(index, other) : max(index, other) + 1]
            if float(between.min()) > 0.5 * height:  # a bump of the same peak
                continue
            places = np.arange(apart - 1, apart + 2) % evidence.points
            alike = peak.repetition * float(self._own[places].max()) * factor / peak.height
            near = abs(apart) <= 4 * self.envelope + 32
            alike = min(max(alike, share if near else 0.0), 0.9999)
            deviations = peak.clear if near else min(peak.above, peak.carried)
            # The samples that only one of the two overlaps has can make as much of a difference.
            exchanged = 2 * abs(apart) / float(overlap[index])
            clear = _CLEAR_GAP * math.sqrt(2 * (1 - alike)) / deviations
            equal = alike >= _REPEATS and 1 - share < clear + exchanged
            alone = height * max(factor, 1) / peak.height
            if equal or (not near and alone >= _ALIKE and height >= 0.9 * evidence.needed * self.deviation):
                found.append(evidence.first + other + offset)
        return found
