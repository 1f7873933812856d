"""The verdict of a search: which of the scored places are the template, and why no others are."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from stereolag.core.inputs import Image
from stereolag.core.showing import Shown
from stereolag.templates.identity import CONTRAST_TOLERANCE, Identity, Kind, identity
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
equally well; no place scores high enough; the best place shows other colours, the mirror image, something that differs
in some blocks, or something else."""

CLEAR_RATIO = 0.6
"""Largest difference from the template at a place with a clear lead, over that at the next place.

The difference is 1 - score, half the mean squared difference of the two normalised; this is the ratio test of Lowe
(2004), whose 0.8 of a distance is 0.64 of its square. Rocketman at low contrast and a quarter hidden gives 0.37; his
mirror image, which resembles the original, 0.78; other colours 0.69; and a tenth smaller, where another place fits
best, 0.92.
"""

COPY_DIFFERENCE = 0.005
"""Largest 1 - score of an exact copy in a recompressed image: smaller differences count as equal."""

MAX_RIVALS = 20
"""Largest number of rivals kept."""


def leads(score: float, rival: float) -> bool:
    """Return whether a place with this score has a clear lead over a rival with its score."""
    return 1 - score + COPY_DIFFERENCE <= CLEAR_RATIO * (1 - rival + COPY_DIFFERENCE)


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
        that is partly covered or outside the image, over the visible blocks alone, unlike in the score map. For text
        drawn anew at another size, at the best height and width.
    scale
        Size in the image over size of the template.
    rotation
        Rotation of the template in the image, degrees, positive counter-clockwise as seen.
    kind, contrast, gain, explained, blocks
        The place compared with the template: :class:`~stereolag.templates.identity.Identity`. None or empty at places
        that score too low to be compared.

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
        Places that score high enough: first the `clear` ones, which are the template, then the others, each best first;
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
        The best places other than the clear matches (other than the best place if no match is clear), best first,
        without any overlap.
    clear
        Number of matches that are the template; they come first.
    reason
        Reason of the verdict: :data:`~stereolag.templates.verdict.Reason`.
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


MAX_MISSES = 8
"""Number of places in a row that are not the template, after which no more are compared with it."""

TINY_TEMPLATE_VALUES = 64
"""A template of up to so many values, pixels times channels, is not found where another place scores higher, unless it
scores like an exact copy: its few blocks agree by chance."""

MIN_DETAIL_WITHOUT_LEAD = 0.8
"""Least explained share of a template's variance beyond a quadratic surface: such surfaces are in every shading, and
smooth pieces are little else.

Measured on pieces of 9 to 60 px: 0.7 to 1 where they are, in noise and JPEG too, but for 2 of 85; where others are,
0.67 or less but for 3 of 40.
"""

MIN_DETAIL_WITH_LEAD = 0.6
"""The same at a place with a clear lead."""

MAX_BELOW_BEST = 0.3
"""Largest difference of a copy's score from that of the best copy."""

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
        The image (rows, cols, channels) and the template.
    max_matches, min_score
        As for :func:`~stereolag.templates.match_template`.
    score_map, candidates
        Passed on to the result, whose `elapsed_s` is left at 0.
    otherwise
        The result to return if none of the places is the template.
    """
    compared = _ComparedPlaces(places, image, pattern)
    kept: list[int] = []
    copies: list[int] = []
    misses = 0
    for place in places.in_order(share=0.5, among=np.flatnonzero(places.scores >= min_score)):
        far_below = bool(copies) and places.scores[place] < places.scores[copies[0]] - MAX_BELOW_BEST
        may_be_copy = (
            # With hidden parts, siblings score as high: none of those few places is left out.
            (misses < MAX_MISSES or otherwise is not None) and not far_below and len(copies) <= max_matches + MAX_RIVALS
        )
        if not may_be_copy and len(kept) >= min(max_matches, len(copies) + MAX_RIVALS):
            break
        kept.append(place)
        if may_be_copy and compared.identity(place).kind in FOUND:
            copies.append(place)
            misses = 0
        else:
            misses += 1
    found = reliable([(place, compared.identity(place)) for place in copies], max_matches)
    if found:
        others = places.best(1, taken=found)
        score, other = places.scores[found[0]], places.scores[others[0]] if others else -1.0
        is_tiny = pattern.count * len(pattern.deviations) <= TINY_TEMPLATE_VALUES
        by_chance = is_tiny and other > score < 1 - COPY_DIFFERENCE
        least = MIN_DETAIL_WITH_LEAD if leads(score, other) else MIN_DETAIL_WITHOUT_LEAD
        if by_chance or compared.identity(found[0]).explained_detail < least:
            found = []
    if otherwise is not None and not found:
        return otherwise
    best = found[:1] or kept[:1] or ([int(np.argmax(places.scores))] if places.scores.size else [])
    rivals = places.best(MAX_RIVALS, taken=found or best)
    if kept and rivals and places.scores[rivals[0]] >= places.scores[best[0]] - MAX_BELOW_BEST:
        compared.identity(rivals[0])
    return TemplateSearch(
        matches=[compared.match(place) for place in list(dict.fromkeys(found + kept))[:max_matches]],
        score_map=score_map,
        candidates=candidates,
        elapsed_s=0.0,
        best=compared.match(best[0]) if best else None,
        rivals=[compared.match(place) for place in rivals],
        clear=len(found),
        reason=_reason(compared, found, copies, kept, rivals),
    )


def reliable(copies: list[tuple[int, Identity]], most: int) -> list[int]:
    """Return the copies most like the template, best first; only those with a clear lead if more than wanted are.

    A copy of the template's own contrast comes before a paler one, and that before one that is partly covered.
    """
    whole = [(place, shown) for place, shown in copies if shown.is_template]
    if whole:
        # A shape of fewer strokes has another contrast too: only the template's own contrast outweighs the fit.
        own = [shown.contrast for _, shown in whole if shown.kind == "same"]
        best = max((shown for _, shown in whole), key=lambda shown: shown.explained).contrast
        nearest = min(own, key=lambda contrast: abs(math.log(contrast)), default=best)
        limits = nearest / CONTRAST_TOLERANCE, nearest * CONTRAST_TOLERANCE
        similar = [place for place, shown in whole if limits[0] <= shown.contrast <= limits[1]]
    else:
        similar = [place for place, _ in copies]
    if len(similar) <= most:
        return similar
    fits = {place: shown.explained for place, shown in copies}
    order = sorted(similar, key=lambda place: -fits[place])
    leading = _before_gap(order, [fits[place] for place in order], most)
    return [place for place in similar if place in leading]


def _before_gap(order: list[int], fits: list[float], most: int) -> list[int]:
    """Return the places, sorted best first, before the largest gap in their fits; none unless it is a clear lead."""
    errors = [1 - fit + COPY_DIFFERENCE for fit in fits]
    count = max(range(1, min(most + 1, len(errors))), key=lambda count: errors[count] / errors[count - 1], default=0)
    return order[:count] if count and errors[count - 1] <= CLEAR_RATIO * errors[count] else []


def _reason(
    compared: _ComparedPlaces, found: list[int], copies: list[int], kept: list[int], rivals: list[int]
) -> Reason:
    """Return the reason of a verdict, from the place found, or else from the best one."""
    if not kept:
        return "low_score"
    if copies and not found:
        return "look_alikes"
    kind = compared.identity((found or kept)[0]).kind
    if kind == "same":
        return "clear" if found else "look_alikes"
    if kind in ("differs", "not_there") and compared.is_mirrored(kept[0]):
        return "mirrored"
    if kind == "not_there" and rivals and not leads(compared.score(kept[0]), compared.score(rivals[0])):
        return "look_alikes"
    return kind


class _ComparedPlaces:
    """Places and their identities, each determined once, when it is needed."""

    def __init__(self, places: Places, image: Image, pattern: Pattern) -> None:
        self.places = places
        self._image = image
        self._pattern = pattern
        self._identities: dict[int, Identity] = {}

    def score(self, index: int) -> float:
        """Return the score of a place."""
        return float(self.places.scores[index])

    def identity(self, index: int) -> Identity:
        """Return the identity of a place."""
        if index not in self._identities:
            scale, rotation = self.places.pose(index)
            may_be_redrawn = rotation == 0 and scale != 1 and bool((self._pattern.weights == 1).all())
            self._identities[index] = identity(
                self._image,
                self._posed(index),
                *self.places.corner(index),
                refine_pose=self.places.poses is not None,
                resized=(self._pattern, scale) if may_be_redrawn else None,
            )
        return self._identities[index]

    def is_mirrored(self, index: int) -> bool:
        """Return whether a place shows the mirror image of the template, moved by up to a quarter of its side."""
        pattern = self._posed(index).mirrored()
        reach = pattern.shape[0] // 4, pattern.shape[1] // 4
        near = peaks_near(self._image, pattern, *self.places.corner(index), reach)
        return any(
            identity(self._image, pattern, *near.corner(best), refine_pose=self.places.poses is not None).is_template
            for best in near.best(1)
        )

    def match(self, index: int) -> TemplateMatch:
        """Return a place as a match, with its identity if that was determined."""
        (height, width), (scale, rotation) = self.places.box(index), self.places.pose(index)
        row, col = self.places.corner(index)
        match = TemplateMatch(row, col, height, width, self.score(index), scale, rotation)
        shown = self._identities.get(index)
        if shown is None:
            return match
        changes = {name: getattr(shown, name) for name in ("kind", "contrast", "gain", "explained", "blocks")}
        if shown.redrawing is not None:
            redrawn = shown.redrawing
            changes |= self._box_around(redrawn.row, redrawn.col, redrawn.size, rotation)
        elif shown.is_template and (scale, rotation) != (1.0, 0.0) and self.places.poses is not None:
            down, right, log_size, clockwise = shown.motion
            poses = np.array(self.places.poses)
            # Size and angle stay as they are unless they were searched.
            size = scale * math.exp(log_size) if np.ptp(poses[:, 0]) else scale
            turned = rotation - math.degrees(clockwise) if np.ptp(poses[:, 1]) else rotation
            changes |= self._box_around(row + height / 2 + down, col + width / 2 + right, size, turned)
        return replace(match, **changes)

    def _box_around(self, row: float, col: float, scale: float, rotation: float) -> dict[str, float]:
        """Return size, angle and box of the template centred at (row, col)."""
        tall, wide = warped_shape(self._pattern.shape, scale, rotation)
        corner = {"row": max(0, round(row - tall / 2)), "col": max(0, round(col - wide / 2))}
        return {**corner, "height": tall, "width": wide, "scale": scale, "rotation": rotation}

    def _posed(self, index: int) -> Pattern:
        """Return the template, resized and rotated as at a place."""
        pose = self.places.pose(index)
        posed = self._pattern if pose == (1.0, 0.0) else warped(self._pattern, *pose)
        return self._pattern if posed is None else posed
