"""From scored places to an answer: which of them are the template, and why not more."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from stereolag.core.inputs import Image
from stereolag.core.showing import Shown
from stereolag.templates.identity import CHANGED_CONTRAST, Identity, Kind, identity
from stereolag.templates.patterns import Pattern, warped, warped_shape
from stereolag.templates.places import Places, peaks_near

Reason: TypeAlias = Literal[
    "clear",
    "lower_contrast",
    "higher_contrast",
    "partly_covered",
    "look_alikes",
    "low_score",
    "other_colours",
    "mirrored",
    "differs",
    "not_there",
]
"""Reason of a verdict. Found: as given; with another contrast; partly covered. Not found: more places than wanted fit
as well; no place scores high enough; the best place shows other colours, the mirror image, something that differs in
some blocks, or something else."""

CLEAR_RATIO = 0.6
"""Clear lead: the best place differs from the template by at most this share of the next place's difference.

Measured by 1 - score, half the mean squared difference of the two normalised: the ratio test of Lowe (2004), whose 0.8
of a distance is 0.64 of its square. Rocketman at low contrast and a quarter hidden gives 0.37; his mirror image, which
resembles the original, 0.78; other colours 0.69; and a size smaller by a tenth, where another place fits best, 0.92.
"""

ROUNDING = 0.005
"""Largest 1 - score of an exact copy in a recompressed image: smaller differences count as equal."""

MOST_RIVALS = 20
"""Rivals kept."""


def leads(score: float, rival: float) -> bool:
    """Return whether a place with this score has a clear lead over a rival with its score."""
    return 1 - score + ROUNDING <= CLEAR_RATIO * (1 - rival + ROUNDING)


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
        Pearson's correlation coefficient, -1..1: 1 for an exact copy, whatever its brightness and contrast. At a place
        found only because some of its blocks agree, of those alone: it is not that of the score map. Where no size fits
        like a copy, but a word may be drawn anew, at the best height and width.
    scale
        Size in the image over size of the template.
    rotation
        Rotation of the template in the image, degrees, positive counter-clockwise as seen.
    kind, contrast, gain, explained, blocks
        What the place shows beside the template: :class:`~stereolag.templates.identity.Identity`. None or empty at
        places too poor to be looked at.

    Examples
    --------
    >>> import numpy as np
    >>> import stereolag as sl
    >>> image = np.random.default_rng(0).integers(0, 256, (120, 160), dtype=np.uint8)
    >>> match = sl.match_template(image, image[40:60, 70:100]).matches[0]
    >>> match.row, match.col, match.height, match.width  # px
    (40, 70, 20, 30)
    >>> round(match.score, 3), match.kind, all(map(all, match.blocks))
    (1.0, 'same', True)
    """

    row: int
    col: int
    height: int
    width: int
    score: float
    scale: float = 1.0
    rotation: float = 0.0
    kind: Kind | None = None
    contrast: float | None = None
    gain: tuple[float, ...] = ()
    explained: float | None = None
    blocks: tuple[tuple[bool, ...], ...] = ()


@dataclass(frozen=True)
class TemplateSearch(Shown):
    """The result of :func:`match_template`.

    Parameters
    ----------
    matches
        Places that score high enough, first the `clear` ones that can be relied on, then the others, each best first;
        never overlapping by more than half of their area; empty if no score is high enough.
    score_map
        (rows - height + 1, cols - width + 1) float32: the score with the template's top-left pixel at each
        (row, col), NaN where the window is flat. None for "sampled", and if sizes or angles were searched.
    candidates
        Number of positions scored.
    elapsed_s
        Seconds the search took.
    best
        The first match; without one the place with the highest score; None if nothing could be scored.
    rivals
        The best places other than the clear matches (other than the best place if no match is clear), best first; they
        share no pixel with those or with one another.
    clear
        Number of matches that are the template, from the first on.
    reason
        Which verdict `found` is: :data:`~stereolag.templates.verdict.Reason`.
    left_out
        Share of the places that have no score because the image has a pixel without data there (NaN, or a mark such as
        -32768); if sizes were searched, of those of the template's own size.

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
    left_out: float = 0.0

    @property
    def found(self) -> bool:
        """Whether the template is in the image, at no more places than were wanted."""
        return self.clear > 0

    @property
    def look_alikes(self) -> list[TemplateMatch]:
        """The best place and the rivals without a clear gap to it, best first; empty for any other reason."""
        best = self.best
        if best is None or self.reason != "look_alikes":
            return []
        return [best, *(rival for rival in self.rivals if not leads(best.score, rival.score))]


TRIED = 8
"""Places looked at after the last that is the template before the search for more of them ends."""

TINY = 64
"""A template of so few values, pixels and channels, is not found where another place scores higher, unless it scores
like an exact copy: its few blocks agree by chance."""

LEAST_BEYOND = (0.8, 0.6)
"""Least share explained of what a template has beyond a slope or a bend, without a clear lead and with one: those are
in every shading, and smooth pieces are little else.

Measured of pieces of 9 to 60 px: 0.7 to 1 where they are, in noise and JPEG too, but for 2 of 85; where others are,
0.67 or less but for 3 of 40.
"""

FAR_BELOW = 0.3
"""A copy of the template scores less than this below the best copy."""

FOUND: tuple[Kind, ...] = ("same", "lower_contrast", "higher_contrast", "partly_covered")


def judged(
    places: Places,
    image: Image,
    pattern: Pattern,
    max_matches: int,
    min_score: float,
    *,
    score_map: npt.NDArray[np.float32] | None,
    candidates: int,
    otherwise: TemplateSearch | None = None,
) -> TemplateSearch:
    """Return the result of a search.

    Parameters
    ----------
    places
        Every position that may be a match or a rival.
    image, pattern
        The image (rows, cols, channels) and the template, by which the places are judged.
    max_matches, min_score
        As for :func:`~stereolag.templates.match_template`.
    score_map, candidates
        Passed on to the result, whose `elapsed_s` is left at 0.
    otherwise
        The result instead if none of the places is the template.
    """
    looked = _LookedAt(places, image, pattern)
    enough = np.flatnonzero(places.scores >= min_score)
    kept: list[int] = []
    copies: list[int] = []
    tried = 0
    for one in places.in_order(share=0.5, left=enough):
        far = bool(copies) and places.scores[one] < places.scores[copies[0]] - FAR_BELOW
        looking = tried < TRIED and not far and len(copies) <= max_matches + MOST_RIVALS
        if not looking and len(kept) >= min(max_matches, len(copies) + MOST_RIVALS):
            break
        kept.append(one)
        if looking and looked.identity(one).kind in FOUND:
            copies.append(one)
            tried = 0
        else:
            tried += 1
    found = reliable([(one, looked.identity(one)) for one in copies], max_matches)
    if found:
        others = places.best(1, taken=found)
        score, other = places.scores[found[0]], places.scores[others[0]] if others else -1.0
        by_chance = pattern.count * len(pattern.deviations) <= TINY and other > score < 1 - ROUNDING
        if by_chance or looked.identity(found[0]).beyond < LEAST_BEYOND[bool(leads(score, other))]:
            found = []
    if otherwise is not None and not found:
        return otherwise
    best = found[:1] or kept[:1] or ([int(np.argmax(places.scores))] if places.scores.size else [])
    rivals = places.best(MOST_RIVALS, taken=found or best)
    if kept and rivals and places.scores[rivals[0]] >= places.scores[best[0]] - FAR_BELOW:
        looked.identity(rivals[0])
    others = [one for one in kept if one not in found]
    return TemplateSearch(
        matches=[looked.match(one) for one in (found + others)[:max_matches]],
        score_map=score_map,
        candidates=candidates,
        elapsed_s=0.0,
        best=looked.match(best[0]) if best else None,
        rivals=[looked.match(one) for one in rivals],
        clear=len(found),
        reason=_reason(looked, found, copies, kept, rivals),
    )


def reliable(copies: list[tuple[int, Identity]], most: int) -> list[int]:
    """Return the copies that can be relied on, best first: those most like the template, if no more than wanted are.

    A copy of the template's own contrast comes before a paler one, and that before one that is partly covered.
    """
    whole = [(one, shown) for one, shown in copies if shown.is_template]
    if whole:
        # Of another contrast is a shape of fewer strokes too: no contrast but its own counts more than the fit.
        own = [shown.contrast for _, shown in whole if shown.kind == "same"]
        best = max((shown for _, shown in whole), key=lambda shown: shown.explained)
        nearest = min(own or [best.contrast], key=lambda contrast: abs(math.log(contrast)))
        limits = nearest / CHANGED_CONTRAST, nearest * CHANGED_CONTRAST
        alike = [one for one, shown in whole if limits[0] <= shown.contrast <= limits[1]]
    else:
        alike = [one for one, _ in copies]
    if len(alike) <= most:
        return alike
    fits = {one: shown.explained for one, shown in copies}
    order = sorted(alike, key=lambda one: -fits[one])
    before = _before_gap(order, [fits[one] for one in order], most)
    return [one for one in alike if one in before]


def _before_gap(order: list[int], fits: list[float], most: int) -> list[int]:
    """Return of more places than wanted, best first, those before the largest gap of their fit, if it is a lead."""
    left = [1 - fit + ROUNDING for fit in fits]
    count = max(range(1, min(most + 1, len(left))), key=lambda count: left[count] / left[count - 1], default=0)
    return order[:count] if count and left[count - 1] <= CLEAR_RATIO * left[count] else []


def _reason(looked: _LookedAt, found: list[int], copies: list[int], kept: list[int], rivals: list[int]) -> Reason:
    """Return the reason of a verdict, from the place that is told."""
    if not kept:
        return "low_score"
    if copies and not found:
        return "look_alikes"
    kind = looked.identity((found or kept)[0]).kind
    if kind == "same":
        return "clear" if found else "look_alikes"
    if kind in ("differs", "not_there") and looked.mirrored(kept[0]):
        return "mirrored"
    if (
        kind == "not_there"
        and rivals
        and not leads(*(float(looked.places.scores[one]) for one in (kept[0], rivals[0])))
    ):
        return "look_alikes"
    return kind


MOVED = 4
"""A mirror image is searched within the template's side over this number around the place that resembles it."""


class _LookedAt:
    """Places and what they show, each looked at once, if it is asked for."""

    def __init__(self, places: Places, image: Image, pattern: Pattern) -> None:
        self.places = places
        self._image = image
        self._pattern = pattern
        self._shown: dict[int, Identity] = {}

    def identity(self, index: int) -> Identity:
        """Return what a place shows."""
        if index not in self._shown:
            row, col = int(self.places.rows[index]), int(self.places.cols[index])
            scale, rotation = self._pose(index)
            may_be_anew = rotation == 0 and scale != 1 and bool((self._pattern.weights == 1).all())
            self._shown[index] = identity(
                self._image,
                self._posed(index),
                row,
                col,
                posed=self.places.poses is not None,
                resized=(self._pattern, scale) if may_be_anew else None,
            )
        return self._shown[index]

    def mirrored(self, index: int) -> bool:
        """Return whether a place shows the mirror image of the template, perhaps moved a little."""
        pattern = self._posed(index).mirrored()
        row, col = int(self.places.rows[index]), int(self.places.cols[index])
        near = peaks_near(self._image, pattern, row, col, (pattern.shape[0] // MOVED, pattern.shape[1] // MOVED))
        places = [(int(near.rows[one]), int(near.cols[one])) for one in near.best(1)]
        posed = self.places.poses is not None
        return any(identity(self._image, pattern, *place, posed=posed).is_template for place in places)

    def match(self, index: int) -> TemplateMatch:
        """Return a place as a match, with what it shows if it was looked at."""
        (height, width), (scale, rotation) = self.places.box(index), self._pose(index)
        row, col = int(self.places.rows[index]), int(self.places.cols[index])
        match = TemplateMatch(row, col, height, width, float(self.places.scores[index]), scale, rotation)
        shown = self._shown.get(index)
        if shown is None:
            return match
        told = {name: value for name, value in vars(shown).items() if name not in ("anew", "moved", "beyond")}
        if shown.anew is not None:
            told |= self._box_around(shown.anew.row, shown.anew.col, shown.anew.size, rotation)
        elif shown.is_template and (scale, rotation) != (1.0, 0.0) and self.places.poses is not None:
            down, right, larger, clockwise = shown.moved
            poses = np.array(self.places.poses)
            # What was not searched stays as it is.
            size = scale * math.exp(larger) if np.ptp(poses[:, 0]) else scale
            turned = rotation - math.degrees(clockwise) if np.ptp(poses[:, 1]) else rotation
            told |= self._box_around(row + height / 2 + down, col + width / 2 + right, size, turned)
        return replace(match, **told)

    def _box_around(self, row: float, col: float, scale: float, rotation: float) -> dict[str, float]:
        """Return size, angle and box of the template with this middle."""
        tall, wide = warped_shape(self._pattern.shape, scale, rotation)
        corner = {"row": max(0, round(row - tall / 2)), "col": max(0, round(col - wide / 2))}
        return {**corner, "height": tall, "width": wide, "scale": scale, "rotation": rotation}

    def _pose(self, index: int) -> tuple[float, float]:
        """Return the size and angle of the template at a place."""
        return (1.0, 0.0) if self.places.poses is None else self.places.poses[index]

    def _posed(self, index: int) -> Pattern:
        """Return the template as it is at a place."""
        pose = self._pose(index)
        posed = self._pattern if pose == (1.0, 0.0) else warped(self._pattern, *pose)
        return self._pattern if posed is None else posed
