"""Whether a lag is reliable: sure, ambiguous, or nothing but chance; in codes and numbers, without sentences."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from stereolag.core.arrays import Vector
from stereolag.signals.drift import Drift, measure_drift
from stereolag.signals.peaks import Lags
from stereolag.signals.rivals import regular_spacing, rivals_of, tone_rivals
from stereolag.signals.whitening import Agreement, Pair

Verdict: TypeAlias = Literal["sure", "ambiguous", "nothing"]
Reason: TypeAlias = Literal["clear", "drift", "repeats", "rivals", "chance", "too_little", "few_votes", "opposite_sign"]

MARGIN = 1.8
"""An agreement this many standard deviations above the highest expected by chance is not due to chance."""

LEAST_VOTES = 5
"""Out of 256 samples looked up; among thousands of lags, chance brings two or three votes together."""

_SAMPLED = 2**16
"""Points of a curve used to estimate its spread."""


@dataclass(frozen=True)
class Judgement:
    """The evidence for and against a lag.

    Attributes
    ----------
    verdict, reason
        ``"sure"``: ``"clear"``, or ``"drift"`` if the lag changes enough to smear the peak.
        ``"ambiguous"``: ``"repeats"`` (evenly spaced rivals) or ``"rivals"``.
        ``"nothing"``: ``"chance"``; ``"too_little"`` (too few samples carry the agreement to be convincing);
        ``"few_votes"``; ``"opposite_sign"`` (the recordings match only if one of them is inverted).
    rivals
        Lags as good as the one found, among those searched, nearest first; at most 16.
    spacing
        Distance between neighbouring rivals if they are evenly spaced, samples; otherwise None.
    evidence, needed
        Standard deviations by which the whitened recordings agree at the lag, and the number needed to be sure.
    height
        Height of the peak above the curve's median, in robust standard deviations (1.4826 · MAD); NaN without a curve.
    chance
        Height that the highest of as many lags reaches by chance: ``sqrt(2 ln N)``.
    ribbon
        The values between which chance keeps the curve, or None without a curve.
    opposite_lag
        The lag at which the inverted recording 2 fits, None if it does not fit better.
    drift
        How the lag changes over time, None if it cannot be measured.
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
    """Return whether `lag` is reliable, whatever method found it.

    The height of a peak in its curve is not enough: the curve of two unrelated recordings with one loud event each is
    flat except where the events meet, and that peak can have any height. So the recordings are whitened
    (:mod:`stereolag.signals.whitening`) and their agreement at `lag` is measured in standard deviations of chance.
    The highest of N lags reaches ``sqrt(2 ln N)`` by chance; ``MARGIN`` more is convincing.

    Parameters
    ----------
    pair
        The recordings, original and whitened.
    lag
        The lag found, samples.
    reach
        The largest ``|lag|`` that was searched.
    lags, curve
        (N,) ascending lags and the curve over them, if the method has one; there may be gaps between the lags.
    votes
        Votes per lag, if the method has them.
    opposite_lag
        The lag at which the inverted recording 2 may fit, for curves that do not show it.
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
    """Return whether `lag` and its neighbours have more votes than chance would bring together."""
    return _pooled(votes, lag) >= LEAST_VOTES


def _pooled(votes: dict[int, int], lag: int) -> int:
    return sum(votes.get(near, 0) for near in (lag - 1, lag, lag + 1))


def _height(curve: Vector, chance: float) -> tuple[float, tuple[float, float]]:
    """Return the robust height of the highest point, and the values between which chance keeps the curve."""
    some = curve[:: max(1, curve.size // _SAMPLED)]
    middle = float(np.median(some))
    deviation = 1.4826 * float(np.median(np.abs(some - middle)))
    height = (float(curve.max()) - middle) / deviation if deviation > 0 else math.inf
    return height, (middle - chance * deviation, middle + chance * deviation)


def _lowest_point(lags: Lags, curve: Vector) -> int | None:
    """Return the lag of the curve's lowest point if it is clearly farther from zero than the highest, else None."""
    lowest = int(np.argmin(curve))
    return int(lags[lowest]) if -curve[lowest] > 1.1 * curve.max() else None


def _opposite(pair: Pair, agreement: Agreement, lag: int, needed: float) -> int | None:
    """Return `lag` if the inverted recording 2 agrees better there; None otherwise."""
    disagreement = -pair.agreement(lag).height
    return lag if disagreement >= max(needed, agreement.height) else None
