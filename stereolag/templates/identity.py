"""Whether a place shows the template: light, colour and a shift below a pixel are fitted, and what remains is judged.

Block by block, so that a difference in one place is not lost in the agreement of all others: a sibling of an icon
correlates at 0.95, and so does a landscape with another one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Mask, median, percentiles
from stereolag.core.inputs import Image
from stereolag.templates.aligning import Plane, gradient
from stereolag.templates.drawn_over import drawn_over, has_outline, is_gone, without_gaps
from stereolag.templates.fits import (
    COUNTED,
    COUNTS,
    DIFFERENT,
    SETTLED,
    Fit,
    averaged,
    best_fit,
    blocks_of,
)
from stereolag.templates.patterns import CLOSE, FULL_WEIGHT, Pattern, blurred, edges, nearness
from stereolag.templates.redrawn import Redrawing, redrawing
from stereolag.templates.softening import BLUR_OF_COLOURS

Kind: TypeAlias = Literal[
    "same", "lower_contrast", "higher_contrast", "partly_covered", "other_colours", "differs", "not_there"
]
"""What a place shows: the template; it with another contrast, or partly covered; its shape in other colours; something
that differs from it in some blocks; something else."""

EDGE, ALIKE = 0.2, 0.6
"""Least energy of the edges of a shape of one colour in a block that can disagree, as a share of the most in a block;
and the least correlation there with the edges seen, whatever is beside them.

Measured: from 0.75 on photographs where the shape is, up to 0.41 in the worst block of another one in the same ring.
"""

OWN, AS_NEAR, MORE = 12.0, 0.05, 0.2
"""Farthest a shape may be from its colour, grey levels of 255, that is not mixed with what is behind; by how much less
of it, as a logarithm, makes no difference; and the share of a block outside a shape that may be of its colour."""

ASIDE, OF_STEP = 40.0, 0.25
"""Least distance of another colour from every mixture of a shape's own with what is beside it, grey levels of 255 over
all channels, and the same as a share of the step from there to the shape.

Measured: up to 37 where the shape is, half transparent too; from 90, and 0.5 of the step, in another hue.
"""

SLACK, SLACK_OF_SPREAD, CANNOT, AS_BRIGHT = 6.0, 0.25, 0.02, 1.12
"""A pixel can be the template over something behind it if it is beyond the values of that by at most so many grey
levels of 255, and this share of the template's standard deviation; of the pixels of a block so many may not; and the
gains of the channels are 1 up to the last.

Measured: all pixels and gains from 0.96 to 1.10 at glows drawn over photographs; elsewhere from 4 % and 0.3 to 4.
"""

RECOLOURED = 0.037
"""Least squared difference of other colours, as a share of the template's variance, from any gains of the channels.

Measured: up to 0.033 under other lights and in JPEG, from 0.040 for lamps and buttons of another colour.
"""

LEAST_EXPLAINED, LEAST_THROUGH, LEAST_OF_SMALL, SMALL = 0.9, 0.57, 0.958, 900
"""Least share of the variance of a place that an opaque template explains, that one through which the background shows
does, and that an opaque one of fewer pixels than the last.

A few blocks of a few pixels agree by chance. Measured: from 0.964 where the template is, off the grid, in JPEG and in
JPEG of screens reduced to half too, 0.959 under noise of half its contrast; up to 0.94 at most places where one of 9 px
is not, and 0.90 to 0.96 where an icon of 17 to 26 px in such a JPEG is its sibling.
"""

CHANGED_CONTRAST = 1.25
"""Contrast, or its inverse, from which it is told."""

DIGITS = 6
"""Of the figures of an identity."""


@dataclass(frozen=True)
class Identity:
    """What a place shows, compared with the template.

    Parameters
    ----------
    kind
        See :data:`Kind`.
    contrast
        Standard deviation of the place over that of the template.
    gain
        For each channel, its contrast: the slope of its values against those of the template.
    explained
        Share of the variance of the place that the template explains.
    blocks
        Rows of blocks over the template: whether they agree.
    anew
        Where and how the template is drawn anew at another size, if it is.
    moved
        Where exactly the place is, beside what was given: px down and right, logarithm of the size, and angle,
        radians clockwise.
    beyond
        Share explained of what no slope or bend explains.
    """

    kind: Kind
    contrast: float
    gain: tuple[float, ...]
    explained: float
    blocks: tuple[tuple[bool, ...], ...]
    anew: Redrawing | None = None
    moved: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    beyond: float = 1.0

    @property
    def is_template(self) -> bool:
        """Whether the place shows all of the template, in whatever light."""
        return self.kind in ("same", "lower_contrast", "higher_contrast")


def identity(
    image: Image,
    pattern: Pattern,
    row: int,
    col: int,
    *,
    posed: bool = False,
    resized: tuple[Pattern, float] | None = None,
    settled: float = SETTLED,
) -> Identity:
    """Return what the image shows at a place of the template.

    Parameters
    ----------
    image
        (rows, cols, channels), as many channels as the pattern.
    pattern
        The template, resized and rotated as at the place.
    row, col
        The place, accurate to a pixel.
    posed
        Whether size and angle are refined too.
    resized
        The template and the size of the pattern over its own, if it is not rotated: it may be drawn anew.
    settled
        Px by which no corner is moved any more once the place is aligned.
    """
    if pattern.silhouette:
        return _identity_of_shape(image, pattern, row, col)
    over = None
    if pattern.most_opaque and image.dtype.kind == "u":  # accurate to a pixel: a slope behind it moves the best score
        near = ((down, right) for down in (0, -1, 1) for right in (0, -1, 1))
        tried = (_gain_over_something(image, pattern, row + down, col + right) for down, right in near)
        over = next((one for one in tried if one is not None), None)
    if over is not None:
        return _told("same", 1.0, *over, np.ones(blocks_of(pattern.shape), dtype=np.bool_))
    fit = best_fit(image, pattern, row, col, posed, settled)
    if not fit.variance > 0 or fit.contrast <= 0:
        return Identity("not_there", 0.0, (0.0,) * pattern.colours.shape[2], 0.0, ())
    counts = fit.averaged(None) > COUNTED
    disagrees = fit.disagrees(counts)
    structure = fit.structure()
    agrees = ~disagrees & (counts | (structure == 0))
    seen = float(structure[agrees].sum() / max(structure.sum(), 1e-12))
    kind = _kind(fit, disagrees, structure, seen, outside=not agrees[~disagrees].all(), posed=posed)
    if (
        kind in ("differs", "not_there")
        and not posed
        and image.dtype == pattern.colours.dtype == np.uint8
        and (pattern.weights == 1).all()
    ):
        covering = drawn_over(image, pattern, row, col)
        if covering is not None:
            beside = averaged(covering, agrees.shape) == 0
            return _told("partly_covered", 1.0, (1.0,) * len(fit.gain), fit.explained_in(beside), beside)
    if kind in ("differs", "not_there") and resized is not None and fit.recoloured < RECOLOURED:
        anew = redrawing(image, resized[0], row, col, resized[1])
        if anew is not None:
            told = _told(_with_contrast(anew.contrast), anew.contrast, anew.gain, anew.explained, np.ones_like(agrees))
            return replace(told, anew=anew)
    told = _told(kind, fit.contrast, fit.gain, fit.explained, agrees)
    beyond = fit.explained_beyond if told.is_template and fit.is_opaque else 1.0
    return replace(told, moved=tuple(map(float, fit.motion)), beyond=beyond)


def _identity_of_shape(image: Image, pattern: Pattern, row: int, col: int) -> Identity:
    """Return what the image shows at a place of a silhouette: the edges in every block, and none of its colour beside.

    The first two channels of the image are its edges, the others how far it is from the silhouette's colour.
    """
    height, width = pattern.shape
    part = np.nan_to_num(image[row : row + height, col : col + width])
    alpha, seen, away = pattern.colours[:, :, 0], part[:, :, :2], part[:, :, 2:]
    near = nearness(away)
    own, grid = edges(pattern.colours), blocks_of(pattern.shape)
    on = np.square(own).sum(axis=2)
    there, common, here = (
        averaged(one, grid)
        for one in (on, (own * seen).sum(axis=2), np.square(seen).sum(axis=2) * (on > EDGE**2 * on.max()))
    )
    edged = there > EDGE * there.max()
    agrees = ~edged | (common > ALIKE * np.sqrt(there * here))
    inside = near[alpha >= alpha.max() * FULL_WEIGHT]
    own_colour = median(inside) > -math.log(CLOSE + OWN)
    if own_colour:
        beside = cv2.dilate(np.asarray(alpha, dtype=np.float32), np.ones((3, 3), np.uint8)) < 1 - FULL_WEIGHT
        agrees &= averaged(beside & (near > percentiles(inside, 10)[0] - AS_NEAR), grid) <= MORE
    explained = float(common.sum() ** 2 / max(there.sum() * here.sum(), 1e-12)) if common.sum() > 0 else 0.0
    shown = float(there[agrees].sum() / there.sum())
    if agrees.all():
        other = not own_colour and _has_other_colour(alpha, away)
        return _told("other_colours" if other else "same", 1.0, (1.0,), explained, agrees)
    return _told("differs" if shown >= DIFFERS else "not_there", 1.0, (1.0,), explained, agrees)


def _has_other_colour(alpha: Plane, away: Plane) -> bool:
    """Return whether a shape is of no mixture of its own colour, from which all is `away`, with what is beside it."""
    soft, shown = (blurred(one, BLUR_OF_COLOURS, cv2.BORDER_REPLICATE) for one in (alpha, away))
    # At its edges, across which what is behind goes on.
    down, right = gradient(soft)
    steep = np.square(down) + np.square(right)
    slopes = [one[:, :, np.newaxis] * other for one, other in zip((down, right), gradient(shown), strict=True)]
    steps = np.sum(slopes, axis=(0, 1, 2)) / steep.sum()
    beside = np.average((shown - soft[:, :, np.newaxis] * steps).reshape(-1, steps.size), axis=0, weights=steep.ravel())
    inside = beside + steps
    aside = inside - beside * (inside @ beside) / max(float(beside @ beside), 1e-12)
    return bool(np.linalg.norm(aside) > max(ASIDE, OF_STEP * float(np.linalg.norm(steps))))


def _gain_over_something(image: Image, pattern: Pattern, row: int, col: int) -> tuple[tuple[float, ...], float] | None:
    """Return gains and explained share if the place can be the template over something behind it; else None.

    What is behind is any of the values that a pixel can have; to tell the gains, it is taken for a slope.
    """
    height, width = pattern.shape
    part = image[max(row, 0) : max(row + height, 0), max(col, 0) : max(col + width, 0)].astype(np.float64)
    if part.shape[:2] != pattern.shape:
        return None
    top = float(np.iinfo(image.dtype).max)
    alpha = pattern.most_opaque * np.cbrt(pattern.weights)[:, :, np.newaxis]
    over, through = alpha * pattern.colours, 1 - alpha
    spread = float(np.sqrt((pattern.weights * np.square(pattern.deviations).sum(axis=0)).sum() / pattern.count))
    slack = min(SLACK * top / 255, SLACK_OF_SPREAD * spread)
    cannot = ((part < over - slack) | (part > over + through * top + slack)).any(axis=2) & (pattern.weights > 0)
    if averaged(cannot, blocks_of(pattern.shape)).max() > CANNOT:
        return None
    on = pattern.weights > 0
    weights = np.sqrt(pattern.weights[on])
    rows, cols = (at[:, np.newaxis] / max(on.shape) for at in np.nonzero(on))
    gains, left, varies = [], 0.0, 0.0
    for channel in range(part.shape[2]):
        seen, shown, behind = part[:, :, channel][on], over[:, :, channel][on], through[on]
        terms = np.column_stack([shown, behind, behind * rows, behind * cols])
        weighted = terms * weights[:, np.newaxis]
        strength = 1e-9 + 1e-9 * float(np.square(shown).sum())
        ridge = 1e-3 * weights.sum() * np.diag([0, 1, 1, 1]) + np.diag([strength, 0, 0, 0])
        fitted = np.linalg.solve(terms.T @ weighted + ridge, weighted.T @ seen)
        gains.append(float(fitted[0]))
        left += float((weights * np.square(seen - terms @ fitted)).sum())
        varies += float((weights * np.square(seen - np.average(seen, weights=weights))).sum())
    if not all(1 / AS_BRIGHT <= gain <= AS_BRIGHT for gain in gains):
        return None
    return tuple(gains), max(0.0, 1 - left / varies) if varies > 0 else 0.0


def _told(
    kind: Kind, contrast: float, gain: tuple[float, ...], explained: float, agrees: npt.NDArray[np.bool_]
) -> Identity:
    """Return an identity, its figures to as many digits as single precision holds: those of an exact copy are 1."""
    contrast, explained, *gains = (float(f"{figure:.{DIGITS}g}") for figure in (contrast, explained, *gain))
    return Identity(kind, contrast, tuple(gains), explained, tuple(tuple(map(bool, line)) for line in agrees))


COVERED, LEAST_COVERED = (0.08, 0.45), 2304
"""Smallest and largest share of the pixels that a thing in front may hide, and of how many at least: with the mark of
an icon covered, nobody can tell it from its sibling."""

CERTAIN, CLEARLY, SLIGHTLY = 90, 4.0, 0.004
"""A pixel differs by more than so many times this percentile of those in the blocks that agree, and by more than this
share of the template's variance."""

FILLED, ONE = 0.76, 0.9
"""Least share of the pixels that differ where something is in front, and least share of those that differ there.

A sibling shares its ground with the template. Measured: from 0.79 where something is in front, up to 0.73 elsewhere.
"""

FROM_RIM, AT_RIM, FILLED_NOISY, LEFT_NOISY = (0.1, 0.45), 0.4, 0.6, 0.55
"""The same where noise hides the pixels of its rim: smallest and largest share of the blocks, least share of the pixels
that differ at the rim of the template and of all in them, and of the structure that must be seen, of a thing that comes
in over that rim.

Measured at the rim: from 0.58 where something is in front; up to 0.27 at another digit, or a bar full to another part,
inside their frames.
"""

MOSTLY = 0.1
"""Least squared difference of the thing itself, beside that percentile of those of it and its halo."""

EXCHANGED = 0.1
"""Largest mean difference of the values there in order, beside that of the pixels, where something only moved.

Measured: up to 0.02 there, from 0.2 where something is in front.
"""

INK, NEAR_IT, DRAWN, SAME_INK = 97, 0.25, 0.8, 0.03
"""Percentile of the distance from the ground of a mark, from which pixels are its ink; how far pixels are from either,
as a share of the distance between the two; least share of the pixels that are so where only ground and ink are; and how
far ground and ink may be from those of another mark in the same.

Measured: up to 0.007 at other bars of a code and other mouths, from 0.07 where a tip or a picture is in front of words.
"""

LEFT_OVER, LEFT_INSIDE, DIFFERS = 0.45, 0.4, 0.4
"""Least share of the template's structure that must be seen if a part is covered, if only a part is outside, and of
something that differs in some blocks."""

LEAST_BESIDE, GRAINY = 0.985, 2.0
"""Least share of the variance that the template explains beside a thing that comes in over the rim, or least grain of
the place there beside what remains: noise has 8 to 9.

Measured: from 0.985 in 25 of 26 places of which 10 to 40 % is covered; 0.87 to 0.983 and grain of 0.002 to 0.25 where
something like it was taken for covered: another coin, the next line of a list, other terrain, another part of the sky.
"""


def _kind(
    fit: Fit, disagrees: npt.NDArray[np.bool_], structure: Plane, seen: float, *, outside: bool, posed: bool
) -> Kind:
    """Return what a place shows, from the blocks that disagree and the share of the structure seen in all others."""
    if not fit.is_opaque and fit.explained < LEAST_THROUGH:
        return "not_there"
    if disagrees.any():
        if fit.recoloured < RECOLOURED and (
            _hides(fit, disagrees, structure) or (seen >= LEFT_NOISY and _comes_in(fit, disagrees))
        ):
            return "partly_covered"
        return "differs" if seen >= DIFFERS else "not_there"
    least = LEAST_OF_SMALL if math.prod(fit.shape) < SMALL else LEAST_EXPLAINED
    # Of another size, strokes are drawn anew or were averaged: small marks differ where it is the template, too.
    if fit.is_opaque and (fit.explained < least or (not posed and fit.has_another_mark())):
        return "differs"
    if fit.recoloured >= RECOLOURED:
        return "other_colours"
    if outside:
        return "partly_covered" if seen >= LEFT_INSIDE else "not_there"
    return _with_contrast(fit.contrast)


def _with_contrast(contrast: float) -> Kind:
    """Return what a place with this contrast shows where the template is."""
    if 1 / CHANGED_CONTRAST < contrast < CHANGED_CONTRAST:
        return "same"
    return "lower_contrast" if contrast < 1 else "higher_contrast"


def _hides(fit: Fit, disagrees: npt.NDArray[np.bool_], structure: Plane) -> bool:
    """Return whether all blocks that disagree hold or touch one thing in front, whose every pixel does."""
    counts = fit.weights >= COUNTS
    if counts.sum() < LEAST_COVERED:
        return False
    squares = fit.differences(sharp=True)
    there = ~fit.over(disagrees)
    noise = float(percentiles(squares[there & counts], CERTAIN)[0]) if (there & counts).any() else math.inf
    differ = squares > min(max(CLEARLY * noise, SLIGHTLY * fit.variance), DIFFERENT * fit.variance)
    front = _thing(differ)
    reach = 2 * math.ceil(3 * BLUR_OF_COLOURS) + 1
    touched = cv2.dilate(np.asarray(front, dtype=np.uint8), np.ones((reach, reach), np.uint8))
    if (disagrees & (averaged(touched, structure.shape) == 0)).any():  # so if there is no such thing
        return False
    share = (front & counts).sum() / counts.sum()
    left = float((structure * (1 - averaged(front, structure.shape))).sum() / max(structure.sum(), 1e-12))
    filled, one = differ[front & counts].mean(), (differ & front).sum() / differ.sum()
    solid = COVERED[0] <= share <= COVERED[1] and filled >= FILLED and one >= ONE
    return bool(solid and left >= LEFT_OVER) and not _is_in_another_state(fit, disagrees, front & differ)


def _comes_in(fit: Fit, disagrees: npt.NDArray[np.bool_]) -> bool:
    """Return whether the blocks that disagree are one thing in front that comes in over the rim of the template."""
    if math.prod(fit.shape) < SMALL or not FROM_RIM[0] <= disagrees.mean() <= FROM_RIM[1]:
        return False
    _, labels, stats, _ = cv2.connectedComponentsWithStats(disagrees.astype(np.uint8), connectivity=4)
    region = labels == 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    rim = region[0].any() or region[-1].any() or region[:, 0].any() or region[:, -1].any()
    if not rim or region.sum() < 0.8 * disagrees.sum():
        return False
    if fit.explained_in(~disagrees) < LEAST_BESIDE and fit.grain_in(~disagrees) < GRAINY:
        return False
    counted, square = fit.counted, np.ones((3, 3), np.uint8)
    inner = cv2.erode(counted.astype(np.uint8), square, borderType=cv2.BORDER_CONSTANT, borderValue=0)
    inside, sharply = fit.over(disagrees), fit.differences(sharp=True) > DIFFERENT * fit.variance
    at_rim = sharply[inside & counted & (inner == 0)]
    if not at_rim.size or at_rim.mean() < AT_RIM:
        return False
    differ = fit.differences()[inside & counted] > 0.02 * fit.variance
    return bool(differ.mean() >= FILLED_NOISY) and not _is_in_another_state(fit, disagrees, inside & sharply)


def _is_in_another_state(fit: Fit, disagrees: npt.NDArray[np.bool_], differ: Mask) -> bool:
    """Return whether what differs is a part of the template in another state: nothing is in front of it.

    The template has its outline, or that of what differs most, as JPEG has haloes around it; or a plain thing of the
    template is gone; or only the place of what the template has there is another, as of the mark of a choice; or
    another mark is there in its ink.
    """
    if not differ.any():
        return False
    squares = fit.differences(sharp=True)
    most = differ & (squares > MOSTLY * float(percentiles(squares[differ], CERTAIN)[0]))
    if any(has_outline(fit.template, _thing(one)) for one in (differ, most)) or is_gone(*fit.sharp, differ):
        return True
    given, seen = (plane[differ] for plane in fit.sharp)
    in_order = np.abs(np.sort(given, axis=0) - np.sort(seen, axis=0)).mean()
    if in_order <= EXCHANGED * np.abs(given - seen).mean():
        return True
    where = fit.over(disagrees) & fit.counted
    return _is_in_its_ink(*(plane[where] for plane in fit.sharp))


def _is_in_its_ink(given: Plane, seen: Plane) -> bool:
    """Return whether the pixels of a part of the template, and those seen there, are of one ground and one ink."""
    ground = np.array([median(channel) for channel in given.T])
    away = np.linalg.norm(given - ground, axis=1)
    ink = given[away >= percentiles(away, INK)[0]].mean(axis=0)
    step = float(np.linalg.norm(ink - ground))
    colours = []
    for one in (given, seen):
        at_ground, at_ink = (np.linalg.norm(one - colour, axis=1) <= NEAR_IT * step for colour in (ground, ink))
        if (at_ground | at_ink).mean() < DRAWN or not (at_ground.any() and at_ink.any()):
            return False
        colours.append([np.median(one[some], axis=0) for some in (at_ground, at_ink)])
    return bool(np.linalg.norm(np.diff(colours, axis=0), axis=2).max() <= SAME_INK * step)


def _thing(differ: Mask) -> Mask:
    """Return the convex hull of the largest thing that differs, without what is thinner than 3 px."""
    found, _ = cv2.findContours(without_gaps(differ), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    thing = np.zeros(differ.shape, np.uint8)
    if found:
        cv2.fillConvexPoly(thing, cv2.convexHull(max(found, key=cv2.contourArea)), 1)
    return thing > 0
