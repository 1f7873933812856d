"""Whether a lag can be relied on: sure, ambiguous, or nothing but chance; codes and numbers, no sentences."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from stereolag.arrays import Vector
from stereolag.signals.drift import Drift, measure_drift
from stereolag.signals.peaks import Lags
from stereolag.signals.rivals import regular_spacing, rivals_of, tone_rivals
from stereolag.signals.whitening import Agreement, Pair

Verdict: TypeAlias = Literal["sure", "ambiguous", "nothing"]
Reason: TypeAlias = Literal["clear", "drift", "repeats", "rivals", "chance", "too_little", "few_votes", "opposite_sign"]

MARGIN = 1.8
"""Standard deviations above what chance gives at most from which on an agreement is none of chance's."""

LEAST_VOTES = 5
"""Of 256 samples that are looked up; among thousands of lags chance brings two or three together."""

_SAMPLED = 2**16
"""Points of a curve that its spread is taken from."""


@dataclass(frozen=True)
class Judgement:
    """What speaks for a lag and what against it.

    Attributes
    ----------
    verdict, reason
        ``"sure"``: ``"clear"``, or ``"drift"`` where the lag changes so much that it smears the peak.
        ``"ambiguous"``: ``"repeats"`` (rivals in regular distances) or ``"rivals"``.
        ``"nothing"``: ``"chance"``; ``"too_little"`` (so few samples carry it that none could convince);
        ``"few_votes"``; ``"opposite_sign"`` (nothing in common, but with the opposite of one recording).
    rivals
        Lags as good as the one found, within those searched, nearest to it first; at most 16.
    spacing
        Samples from one to the next where they lie regularly, otherwise None.
    evidence, needed
        Standard deviations by which the whitened recordings agree at the lag, and how many convince.
    height
        The peak over the median of the curve, in its robust standard deviations (1.4826 · MAD); NaN without a curve.
    chance
        The height that the highest of as many lags has by chance: ``sqrt(2 ln N)``.
    ribbon
        The values of the curve between which chance leaves it, or None without a curve.
    opposite_lag
        Where the opposite of recording 2 fits, None where it does not fit better.
    drift
        How the lag changes over time, None where it cannot be told.
    """

    verdict: Verdict
    reason: Reason
    rivals: tuple[int, ...] = ()
    spacing: float | None = None
    evidence: float = math.nan
    needed: float = math.nan
    height: float = math.nan
    chance: float = math.nan
    ribbon: tuple[float, float] | None = None
    opposite_lag: int | None = None
    drift: Drift | None = None


def judge(
    pair: Pair,
    lag: int,
    reach: int,
    *,
    lags: Lags | None = None,
    curve: Vector | None = None,
    votes: dict[int, int] | None = None,
    opposite_lag: int | None = None,
) -> Judgement:
    """Return whether `lag` can be relied on, however it was found.

    The height of a peak in its curve says too little: two unrelated recordings with one loud event each have a curve
    that is flat but for where the events meet, at any height. So the recordings are whitened
    (:mod:`stereolag.signals.whitening`) and their agreement at `lag` is counted in standard deviations of chance;
    the highest of N lags has ``sqrt(2 ln N)`` of them by chance, and ``MARGIN`` more convince.

    Parameters
    ----------
    pair
        The recordings, whitened.
    lag
        The lag found, samples.
    reach
        The largest ``|lag|`` that was searched.
    lags, curve
        (N,) ascending lags and the curve over them, where the method has one; lags may be left out.
    votes
        Lag to number of votes, where the method has them.
    opposite_lag
        Where the opposite of recording 2 may fit, for curves that cannot tell it.
    """
    first, last = -min(reach, pair.sizes[0] - 1), min(reach, pair.sizes[1] - 1)
    chance = math.sqrt(2 * math.log(last - first + 2))
    needed = chance + MARGIN
    agreement = pair.best_agreement(lag)
    rivals = rivals_of(pair, agreement, first, last, needed, lags, curve)
    if agreement.height < needed and not rivals:
        rivals = tone_rivals(pair, lag, first, last)
    height, ribbon = (math.nan, None) if curve is None else _height(curve, chance)
    drift = measure_drift(pair, lag)
    if opposite_lag is None and curve is not None and lags is not None:
        opposite_lag = _lowest_point(lags, curve)
    opposite = None if opposite_lag is None else _opposite(pair, agreement, opposite_lag, needed)
    verdict, reason = _decided(agreement, rivals, needed, drift, opposite, votes)
    if verdict != "ambiguous":
        rivals = ()
    return Judgement(
        verdict,
        reason,
        rivals,
        regular_spacing(rivals, lag),
        agreement.height,
        needed,
        height,
        chance,
        ribbon,
        opposite,
        drift if verdict == "sure" else None,
    )


def _decided(
    agreement: Agreement,
    rivals: tuple[int, ...],
    needed: float,
    drift: Drift | None,
    opposite: int | None,
    votes: dict[int, int] | None,
) -> tuple[Verdict, Reason]:
    if rivals:
        return "ambiguous", "repeats" if regular_spacing(rivals, agreement.lag) is not None else "rivals"
    if votes is not None and _pooled(votes, agreement.lag) < LEAST_VOTES:
        return "nothing", "few_votes" if opposite is None else "opposite_sign"
    if drift is not None and drift.shows:
        return "sure", "drift"
    if agreement.height >= needed:
        return "sure", "clear"
    if opposite is not None:
        return "nothing", "opposite_sign"
    return "nothing", "too_little" if agreement.reachable < needed else "chance"


def enough_votes(votes: dict[int, int], lag: int) -> bool:
    """Return whether so many samples voted for `lag`, or a sample beside it, that chance would not bring them."""
    return _pooled(votes, lag) >= LEAST_VOTES


def _pooled(votes: dict[int, int], lag: int) -> int:
    return sum(votes.get(near, 0) for near in (lag - 1, lag, lag + 1))


def _height(curve: Vector, chance: float) -> tuple[float, tuple[float, float]]:
    """Return the robust height of the highest point, and the values between which chance leaves the curve."""
    some = curve[:: max(1, curve.size // _SAMPLED)]
    middle = float(np.median(some))
    deviation = 1.4826 * float(np.median(np.abs(some - middle)))
    height = (float(curve.max()) - middle) / deviation if deviation > 0 else math.inf
    return height, (middle - chance * deviation, middle + chance * deviation)


def _lowest_point(lags: Lags, curve: Vector) -> int | None:
    """Return the lag of the lowest point of the curve, if it is farther from zero than the highest."""
    lowest = int(np.argmin(curve))
    return int(lags[lowest]) if -curve[lowest] > 1.1 * curve.max() else None


def _opposite(pair: Pair, agreement: Agreement, lag: int, needed: float) -> int | None:
    """Return `lag` if the opposite of recording 2 agrees better there; None otherwise."""
    disagreement = -pair.agreement(lag).height
    return lag if disagreement >= max(needed, agreement.height) else None
