"""Whether a template is found: its place must score enough, and fit clearly better than any other place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

Reason: TypeAlias = Literal["clear", "look_alikes", "low_score", "other_colours", "mirrored"]
"""Of a verdict: one or more places stand clear of all others; others fit as well; no place scores enough; the best
place fits clearly better with the template's colour channels in another order, or with its mirror image."""

CLEAR_RATIO = 0.6
"""A clear lead: the best place differs from the template at most this many times as much as the next place does.

Measured by 1 - score, half the mean squared difference of the two normalised: the ratio test of Lowe (2004), whose 0.8
of a distance is 0.64 of its square. Rocketman dulled and a quarter hidden comes to 0.37; his mirror image, which the
true one resembles, to 0.78, other colours to 0.69, and a tenth smaller, where a stranger fits best, to 0.92.
"""

ROUNDING = 0.005
"""What 1 - score of an exact copy may be in a recompressed image: what differs less is equal."""

MOST_RIVALS = 20
"""Rivals that are kept: as many as a page offers matches."""


@dataclass(frozen=True)
class Verdict:
    """How many of the matches can be relied on, and why not more.

    Parameters
    ----------
    clear
        How many of the matches, best first, stand clear of every other place.
    reason
        Why.
    """

    clear: int
    reason: Reason


def leads(score: float, rival: float) -> bool:
    """Return whether a place of that score has a clear lead over a rival of the other."""
    return 1 - score + ROUNDING <= CLEAR_RATIO * (1 - rival + ROUNDING)


def verdict(scores: Sequence[float], next_scores: Sequence[float]) -> Verdict:
    """Return how many matches stand clear: as many as there can be.

    Parameters
    ----------
    scores
        Of the matches, all of them enough, best first.
    next_scores
        For each match, the best score of any place elsewhere than this match and those before it; -1 where there is
        no other place.
    """
    if not scores:
        return Verdict(0, "low_score")
    clear = [leads(score, after) for score, after in zip(scores, next_scores, strict=True)]
    count = len(clear) - clear[::-1].index(True) if any(clear) else 0
    return Verdict(count, "clear" if count else "look_alikes")
