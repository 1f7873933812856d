"""Other lags that fit as well as the one found, because the recordings repeat."""

from __future__ import annotations

import numpy as np
from scipy import fft

from stereolag.core.arrays import Vector
from stereolag.signals.median_lines import median_line
from stereolag.signals.overlaps import overlap_length
from stereolag.signals.peaks import Lags, main_lobe
from stereolag.signals.whitening import Agreement, Pair, local_curve

_RIVAL = 0.85
"""Another lag is as good from this share of the height on; noise alone lowers a tooth of a comb by a few per cent."""

_STRETCH, _REACH = 2**16, 2**14
"""Length of the stretch searched for repetition, and largest distance between repeats, samples."""

_LINES, _LINE_SHARE = 8, 0.7
"""Most lines in the spectrum of a tonal curve, and the least share of its power that they contain."""

_FEWEST_PERIODS = 8
_FAINT = 0.05
"""Lines below this share of the strongest line's power are noise."""

_TEETH_SHARE = 0.5
"""Least share of the curve over which the teeth of a tone extend."""

_REGULAR = 0.75
"""Least share of the rivals that are evenly spaced."""

_MOST_RIVALS = 16


def rivals_of(
    pair: Pair,
    agreement: Agreement,
    first: int,
    last: int,
    needed: float,
    lags: Lags | None,
    curve: Vector | None,
) -> tuple[int, ...]:
    """Return the lags from `first` to `last` at which the whitened recordings agree equally well, nearest first."""
    nearby = _repetitions(pair, agreement.lag, first, last, needed)
    if agreement.height >= needed and lags is not None and curve is not None:
        for other in _high_points(pair, agreement.lag, lags, curve):
            there = pair.best_agreement(other)
            if there.score >= _RIVAL * agreement.score and there.height >= needed:
                nearby.add(there.lag)
    rivals = _nearest(nearby, agreement.lag)
    # A horn blown twice fits itself again, but the sounds around it do not: a rival fits with and without whitening.
    least = _RIVAL * pair.pearson(agreement.lag) if rivals else 0.0
    return tuple(other for other in rivals if pair.pearson(other) >= least)


def _nearest(found: set[int], lag: int) -> tuple[int, ...]:
    return tuple(sorted(found - {lag}, key=lambda other: (abs(other - lag), other))[:_MOST_RIVALS])


def tone_rivals(pair: Pair, lag: int, first: int, last: int) -> tuple[int, ...]:
    """Return the lags around `lag` at which tones common to both recordings line up.

    Whitening removes tones, and noise hides their teeth in the curve. The curve's spectrum reveals them: a few lines
    contain most of its power. The curve rebuilt from these lines alone has the teeth without the noise.
    """
    one, other = pair.loudest(lag, _STRETCH, white=False)
    reach = min(_REACH, one.size // 2)
    count = min(_LINES, reach // 64)
    if count == 0:
        return ()
    curve = local_curve(one, other, reach)
    spectrum = fft.rfft(curve * np.hanning(curve.size))
    power = spectrum.real**2 + spectrum.imag**2
    left = power.copy()
    left[: 2 * _FEWEST_PERIODS] = 0.0
    held = np.zeros(power.size, dtype=np.bool_)
    for _ in range(count):
        line = int(np.argmax(left))
        if left[line] < _FAINT * power[held].max(initial=0.0):
            break
        held[max(0, line - 2) : line + 3] = True
        left[max(0, line - 2) : line + 3] = 0.0
    if power[held].sum() < _LINE_SHARE * power.sum():
        return ()
    # Only the middle half, where the window is not small.
    middle = slice(reach // 2, curve.size - reach // 2)
    clean = (fft.irfft(np.where(held, spectrum, 0.0), curve.size) / np.maximum(np.hanning(curve.size), 0.1))[middle]
    best = int(np.argmax(clean))
    tops = _tops(clean, best, _RIVAL * clean[best])
    # Two sounds that happen to share a note for a while give a few teeth; a tone gives them everywhere.
    if tops.size < 2 or tops.size * float(np.median(np.diff(tops))) < _TEETH_SHARE * clean.size:
        return ()
    found = {lag - reach + middle.start + int(top) for top in (best, *tops)}
    return _nearest({each for each in found if first <= each <= last}, lag)


def _repetitions(pair: Pair, lag: int, first: int, last: int, needed: float) -> set[int]:
    """Return the lags around `lag` at which the loudest common stretch fits as well as at its best lag."""
    one, other = pair.loudest(lag, _STRETCH)
    reach = min(_REACH, one.size // 2)
    if reach < 2:
        return set()
    curve = local_curve(one, other, reach)
    curve = curve[max(0, first - lag + reach) : max(0, last - lag + reach) + 1]
    start = lag - reach + max(0, first - lag + reach)
    best = int(np.argmax(curve))
    if pair.agreement(start + best).height < needed:
        return set()
    tops = _tops(curve, best, _RIVAL * curve[best])
    return {start + int(top) for top in tops} | ({start + best} if tops.size else set())


def _high_points(pair: Pair, lag: int, lags: Lags, curve: Vector) -> list[int]:
    """Return the lags of the curve's highest points outside the main lobe of `lag`, best first."""
    peak = int(np.searchsorted(lags, lag))
    if peak >= lags.size:
        return []
    overlap = overlap_length(*pair.sizes, lags)
    high = _tops(curve, peak, 0.6 * curve[peak])
    high = high[overlap[high] >= 0.25 * overlap[peak]]
    best = high[np.argsort(-curve[high], kind="stable")[:_MOST_RIVALS]]
    return [int(each) for each in lags[best]]


def _tops(curve: Vector, peak: int, least: float) -> Lags:
    """Return where the curve has a maximum of at least `least`, outside the main lobe of `peak`."""
    begin, end = main_lobe(curve, peak)
    high = np.flatnonzero(curve >= least)
    high = high[((high < begin) | (high >= end)) & (high > 0) & (high < curve.size - 1)]
    return np.asarray(high[(curve[high] > curve[high - 1]) & (curve[high] >= curve[high + 1])])


def regular_spacing(rivals: tuple[int, ...], lag: int) -> float | None:
    """Return the spacing of evenly spaced rivals, within one sample or 2 %; None if they are irregular."""
    if len(rivals) < 2:
        return None
    places = np.array(sorted({*rivals, lag}), dtype=np.float64)
    apart = float(np.median(np.diff(places)))
    numbers = np.round((places - rivals[0]) / apart)
    if np.unique(numbers).size < 3:
        return None
    # By medians, because a lag that a method put between two teeth is not on the grid.
    spacing, _ = median_line(numbers, places)
    away = places - spacing * numbers
    regular = np.abs(away - np.median(away)) <= max(1.0, 0.02 * apart)
    if regular.mean() < _REGULAR or np.unique(numbers[regular]).size < 3:
        return None
    return float(np.polyfit(numbers[regular], places[regular], 1)[0])
