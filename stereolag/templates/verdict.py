"""From scored places to an answer: matches, rivals, and whether a match is the template and has a clear lead."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import permutations
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from stereolag.core.inputs import Image
from stereolag.core.jobs import silent
from stereolag.templates.patterns import Pattern, warped
from stereolag.templates.score_maps import Places, fft_score_map, score_at

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


def leads(score: float, rival: float) -> bool:
    """Return whether a place with this score has a clear lead over a rival with its score."""
    return 1 - score + ROUNDING <= CLEAR_RATIO * (1 - rival + ROUNDING)


def verdict(scores: Sequence[float], next_scores: Sequence[float]) -> tuple[int, Reason]:
    """Return how many matches, best first, clearly lead every other place, as many as possible, and why not more.

    Parameters
    ----------
    scores
        Scores of the matches, all high enough, best first.
    next_scores
        For each match, the best score of any place other than this match and those before it; -1 if there is no
        other place.
    """
    if not scores:
        return 0, "low_score"
    clear = [leads(score, after) for score, after in zip(scores, next_scores, strict=True)]
    count = len(clear) - clear[::-1].index(True) if any(clear) else 0
    return count, "clear" if count else "look_alikes"


@dataclass(frozen=True)
class TemplateMatch:
    """One position of the template in the image.

    Parameters
    ----------
    row, col
        Top-left pixel, px; for a rotated template, of the upright box around it.
    height, width
        Size of the template there, px; for a rotated template, of that box.
    score
        Pearson's correlation coefficient, -1..1: 1 for an exact copy, whatever its brightness and contrast.
    scale
        Size in the image over size of the template.
    rotation
        Rotation of the template in the image, degrees, positive counter-clockwise as seen.

    Examples
    --------
    >>> import numpy as np
    >>> import stereolag as sl
    >>> image = np.random.default_rng(0).integers(0, 256, (120, 160), dtype=np.uint8)
    >>> match = sl.match_template(image, image[40:60, 70:100]).matches[0]
    >>> match.row, match.col, match.height, match.width  # px
    (40, 70, 20, 30)
    >>> round(match.score, 3)
    1.0
    """

    row: int
    col: int
    height: int
    width: int
    score: float
    scale: float = 1.0
    rotation: float = 0.0


@dataclass(frozen=True)
class TemplateSearch:
    """The result of :func:`match_template`.

    Parameters
    ----------
    matches
        Places that score high enough, best first, never overlapping by more than half of their area; empty if no score
        is high enough. Only the first `clear` of them are reliable.
    score_map
        (rows - height + 1, cols - width + 1) float32: the score with the template's top-left pixel at each
        (row, col), NaN where the window is flat. None for "sampled", and if sizes or angles were searched.
    candidates
        Number of positions scored.
    elapsed_s
        Seconds the search took.
    best
        The place with the highest score, high enough or not; None if nothing could be scored.
    rivals
        The best places other than the clear matches (other than the best place if no match is clear), best first; they
        share no pixel with those or with one another.
    clear
        Number of matches, best first, that fit clearly better than every other place.
    reason
        Reason for `found`: "clear"; "look_alikes" if others fit about as well; "low_score" if no place scores high
        enough; "other_colours" or "mirrored" if the best place fits clearly better with the template's colour channels
        in another order, or with its mirror image.

    Examples
    --------
    A template that occurs twice is found only if two are wanted:

    >>> import numpy as np
    >>> import stereolag as sl
    >>> image = np.random.default_rng(0).integers(0, 256, (120, 160), dtype=np.uint8)
    >>> image[80:100, 10:40] = image[40:60, 70:100]
    >>> one = sl.match_template(image, image[40:60, 70:100])
    >>> one.found, one.reason
    (False, 'look_alikes')
    >>> two = sl.match_template(image, image[40:60, 70:100], max_matches=2)
    >>> two.found, sorted((match.row, match.col) for match in two.matches)  # px
    (True, [(40, 70), (80, 10)])
    """

    matches: list[TemplateMatch]
    score_map: npt.NDArray[np.float32] | None
    candidates: int
    elapsed_s: float
    best: TemplateMatch | None
    rivals: list[TemplateMatch]
    clear: int
    reason: Reason

    @property
    def found(self) -> bool:
        """Whether the template is in the image: at least one place scores high enough and has a clear lead."""
        return self.clear > 0

    @property
    def look_alikes(self) -> list[TemplateMatch]:
        """The best place and the rivals without a clear gap to it, best first; empty for any other reason."""
        best = self.best
        if best is None or self.reason != "look_alikes":
            return []
        return [best, *(rival for rival in self.rivals if not leads(best.score, rival.score))]


def judged(
    places: Places,
    max_matches: int,
    min_score: float,
    *,
    score_map: npt.NDArray[np.float32] | None,
    candidates: int,
    matchable: int | None = None,
) -> TemplateSearch:
    """Return the result of a search.

    Parameters
    ----------
    places
        Every position that may be a match or a rival.
    max_matches, min_score
        As for :func:`~stereolag.templates.match_template`.
    score_map, candidates
        Passed on to the result, whose `elapsed_s` is left at 0.
    matchable
        Number of places, from the first on, that may be matches; all of them by default.
    """
    enough = np.flatnonzero(places.scores[:matchable] >= min_score)
    kept = places.best(max_matches, share=0.5, left=enough)
    clear, reason = verdict([float(places.scores[one]) for one in kept], places.next_scores(kept))
    best = [int(np.argmax(places.scores))] if places.scores.size else []
    return TemplateSearch(
        matches=[_match(places, one) for one in kept],
        score_map=score_map,
        candidates=candidates,
        elapsed_s=0.0,
        best=_match(places, best[0]) if best else None,
        rivals=[_match(places, one) for one in places.best(MOST_RIVALS, taken=kept[:clear] or best)],
        clear=clear,
        reason=reason,
    )


def _match(places: Places, index: int) -> TemplateMatch:
    """Return one of the positions as a match."""
    height, width = places.box(index)
    scale, rotation = (1.0, 0.0) if places.poses is None else places.poses[index]
    row, col, score = int(places.rows[index]), int(places.cols[index]), float(places.scores[index])
    return TemplateMatch(row, col, height, width, score, scale, rotation)


MOVED = 4
"""A mirror image is searched within the template's side over this number around the place that resembles it."""


def reject_variants(search: TemplateSearch, image: Image, pattern: Pattern) -> TemplateSearch:
    """Return a search whose clear matches end before the first that fits clearly better with a variant of the template.

    Lighting and cameras change the brightness and contrast of each channel, but never swap channels. Upside down is
    a mirror image turned by 180 degrees.
    """
    if not search.found:
        return search
    clear = 0
    reason: Reason | None = None
    for match in search.matches[: search.clear]:
        reason = _better_variant(image, pattern, match)
        if reason is not None:
            break
        clear += 1
    return replace(search, clear=clear, reason="clear" if clear else reason or search.reason)


def _better_variant(image: Image, pattern: Pattern, match: TemplateMatch) -> Reason | None:
    """Return why a match does not count; None if no variant fits clearly better."""
    upright = (match.scale, match.rotation) == (1.0, 0.0)
    posed = pattern if upright else warped(pattern, match.scale, match.rotation)
    if posed is None:
        return None
    own = score_at(image, posed.deviations, posed.weights, match.row, match.col)
    if not leads(1.0, own):
        return None
    if pattern.colours.shape[2] == 3:
        orders = [list(order) for order in permutations(range(3))][1:]
        swapped = (score_at(image, posed.deviations[order], posed.weights, match.row, match.col) for order in orders)
        if leads(max(swapped), own):
            return "other_colours"
    return "mirrored" if leads(_mirrored(image, posed, match), own) else None


def _mirrored(image: Image, pattern: Pattern, match: TemplateMatch) -> float:
    """Return the best score of the mirror image around a place."""
    (height, width), (row, col) = pattern.shape, (match.row, match.col)
    down, across = height // MOVED, width // MOVED
    around = image[max(0, row - down) : row + height + down, max(0, col - across) : col + width + across]
    return float(np.nanmax(fft_score_map(np.ascontiguousarray(around), pattern.mirrored(), silent), initial=-1.0))
