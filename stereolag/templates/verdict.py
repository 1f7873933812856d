"""Whether a template is found: its place must score high enough, and fit clearly better than any other place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

Reason: TypeAlias = Literal["clear", "look_alikes", "low_score", "other_colours", "mirrored"]
"""Reason of a verdict: one or more places lead all others clearly; others fit as well; no place scores high enough;
the best place fits clearly better with the template's colour channels in another order, or with its mirror image."""

CLEAR_RATIO = 0.6
"""Clear lead: the best place differs from the template by at most this share of the next place's difference.

Measured by 1 - score, half the mean squared difference of the two normalised: the ratio test of Lowe (2004), whose 0.8
of a distance is 0.64 of its square. Rocketman at low contrast and a quarter hidden gives 0.37; his mirror image, which
resembles the original, 0.78; other colours 0.69; and a size smaller by a tenth, where another place fits best, 0.92.
"""

ROUNDING = 0.005
"""Largest 1 - score of an exact copy in a recompressed image: smaller differences count as equal."""

MOST_RIVALS = 20
"""Rivals kept: as many as a page offers matches."""


@dataclass(frozen=True)
class Verdict:
    """Number of reliable matches, and why there are not more.

    Parameters
    ----------
    clear
        Number of matches, best first, that clearly lead every other place.
    reason
        Reason for that number.
    """

    clear: int
    reason: Reason


def leads(score: float, rival: float) -> bool:
    """Return whether a place with this score has a clear lead over a rival with its score."""
    return 1 - score + ROUNDING <= CLEAR_RATIO * (1 - rival + ROUNDING)


def verdict(scores: Sequence[float], next_scores: Sequence[float]) -> Verdict:
    """Return the verdict with as many clear matches as possible.

    Parameters
    ----------
    scores
        Scores of the matches, all high enough, best first.
    next_scores
        For each match, the best score of any place other than this match and those before it; -1 if there is no
        other place.
    """
    if not scores:
        return Verdict(0, "low_score")
    clear = [leads(score, after) for score, after in zip(scores, next_scores, strict=True)]
    count = len(clear) - clear[::-1].index(True) if any(clear) else 0
    return Verdict(count, "clear" if count else "look_alikes")
