"""A template drawn anew at another size: letters begin on whole pixels there, and are as wide and high as fits them.

Its width and height are then other multiples of the template's, and its columns and rows shifted by a pixel or two,
letter by letter, or the text of a button against its border. A sibling has a stroke more, or one less, which no such
shift explains.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np

from stereolag.core.arrays import median
from stereolag.core.inputs import Image
from stereolag.templates.aligning import Plane
from stereolag.templates.differences import Windows, explained
from stereolag.templates.patterns import Pattern, blurred

SOFT = 0.55
"""Spread of the blur, px of the template, after which two drawings are compared: 0.4 and 0.8 tell siblings less."""

ROOM, LEAST_ROOM = 0.12, 4
"""What is looked at beyond a place, as a share of its side, and at least, px."""

COARSELY = [
    (down, across) for down in (-0.11, -0.055, 0.0, 0.055, 0.11) for across in (-0.11, -0.055, 0.0, 0.055, 0.11)
]
FINELY = [(down, across) for down in (-0.0275, 0.0, 0.0275) for across in (-0.0275, 0.0, 0.0275)]
SIZES = [(step, step) for step in (-0.22, -0.165, -0.11, -0.055, 0.0, 0.055, 0.11, 0.165, 0.22)]
"""Steps of the logarithms of height and width, and of both alike where even the size is not known."""

LEAST_LIKE = 0.85
"""Least correlation at the best height and width; where the template is, from 0.91."""

BEYOND, SHOWN = 2, 0.1
"""What counts of a template: so many px beyond the rows and columns with this share of the largest step of a value."""

CUT_OFF = 0.5
"""Rows at the rim with less than this share of the height of a line are of another line, which the rim cuts off."""

REACH, STEP = 3.0, 0.25
"""Largest shift of a column or row and step of it, px."""

STIFF, SMOOTH = 0.2, 1.0
"""What a step of shift from one to the next must save, in mean squared differences of a line; and spread of the blur of
the shifts, px."""

LETTER, FAINTEST = 3.3, 0.2
"""Spread of the blur over a letter, px of the template; least variance of a letter, as a share of the largest."""

UNEXPLAINED = 0.27
"""Least squared difference of a letter, as a share of its variance, of something else.

Measured on screens drawn anew at 110 to 150 %: up to here at 228 of 235 words, numbers and buttons; from here on at 232
of as many of which one letter is another.
"""

LEAST_WIDE, LEAST_TALL = 1.8, 6
"""Least width over height of what has letters, and least height of it, px. Icons are not rounded to pixels, and a mark
in them is less than a letter."""

TALLEST, LEAST_BRIGHT = 48, 0.1
"""Greatest height of what has letters, px, that move so much that another place scores higher than theirs; and least
share of the variance of a template that is of its brightness, if that is to tell it."""

OF_HEIGHT = 0.5
"""How much of the logarithm of the size the height tells, and the width the rest: both are rounded for each letter."""

OF_INK, OF_SPREAD = 0.62, 0.3
"""How much of the logarithm of the ink tells the size, and how much of that of its spread down is taken off: strokes
are as wide as the size wants, but as long as whole pixels make them, and have more ink then.

Measured on 409 words drawn anew at 110 to 150 %: off by more than 5 % in 3; by height and width in 22 of the first 197.
In screens reduced to 50 to 80 % and compressed: in 8 of 9, and by height and width in 3.
"""

ON_GROUND, RULED = 0.05, 0.85
"""Largest ink of the ground and of a gap in a line, as a share of the most; and least share of a row or column of a
frame that has more. Frames are rounded less than letters, and tell the size."""


_blurred = partial(blurred, border=cv2.BORDER_REPLICATE)


@dataclass(frozen=True)
class Redrawing:
    """How a place is the template drawn anew.

    Parameters
    ----------
    size
        Size there over that of the template.
    row, col
        Middle, px from the top-left corner of the image.
    gain
        For each channel the slope of its values against those of the template.
    contrast
        Standard deviation over that of the template.
    explained
        Share of the variance of the place that is explained.
    """

    size: float
    row: float
    col: float
    gain: tuple[float, ...]
    contrast: float
    explained: float


def redrawing(image: Image, template: Pattern, row: int, col: int, scale: float) -> Redrawing | None:
    """Return how a place is the template drawn anew at about this scale; None if it is something else.

    Parameters
    ----------
    image
        (rows, cols, channels), as many channels as the template.
    template
        As given, all of which counts.
    row, col
        Top-left pixel of the place.
    scale
        Size there over that of the template, to a tenth.
    """
    shown = _shown(template)
    around = _around(image, template, row, col, scale) if _has_letters(shown) else None
    if around is None:
        return None
    part, weights, margins = around
    given = _blurred(np.moveaxis(template.deviations, 0, 2).astype(np.float32), SOFT)
    seen = _blurred(part - part.mean(axis=(0, 1)), SOFT * max(1.0, scale))
    like, tall, wide, top, left = _stretched(given, seen, scale, (COARSELY, FINELY))
    if like < LEAST_LIKE:
        return None
    stretch = np.array([tall, wide]) / template.shape
    middle = np.array([top + tall / 2, left + wide / 2])
    counts = tuple(
        slice(max(0, math.floor(at + one * (first - side / 2))), math.ceil(at + one * (last - side / 2)))
        for at, one, (first, last), side in zip(middle, stretch, shown, template.shape, strict=True)
    )
    seen, weights = seen[counts], weights[counts]
    rows, cols = (
        (np.arange(side) + (part.start or 0) + 0.5 - start) / one - 0.5
        for side, part, start, one in zip(seen.shape, counts, (top, left), stretch, strict=False)
    )

    def drawn_at(down: Plane, across: Plane) -> Plane:
        return _sampled(given, rows + down / stretch[0], cols + across / stretch[1])

    down, across = np.zeros(len(rows), np.float32), np.zeros(len(cols), np.float32)
    for _ in range(2):
        across = _shifts(drawn_at, down, across, seen, weights, 1)
        down = _shifts(drawn_at, down, across, seen, weights, 0)
    drawn = drawn_at(down, across)
    slopes = np.array([_slope(down, drawn, 0), _slope(across, drawn, 1)])
    own = np.moveaxis(template.deviations, 0, 2)[tuple(slice(*ends) for ends in shown)]
    by_ink = _size_by_ink(own.astype(np.float32), part[counts] - part.mean(axis=(0, 1)))
    gain, in_light = _light(drawn, seen, weights)
    lit = in_light(drawn)
    differs, _ = Windows(weights, LETTER * scale).compared(lit, seen, FAINTEST)
    if (gain <= 0).all() or differs.max() > UNEXPLAINED:
        return None
    size = float(np.exp((np.log(stretch) - slopes) @ [OF_HEIGHT, 1 - OF_HEIGHT]))
    if by_ink is not None and size >= 1:  # reduced, strokes are paler
        size = by_ink
    if by_ink is not None:  # a word is set from its first letter on, and as long as rounding makes it
        first = shown[1][0] + BEYOND
        there = np.interp(first, cols + across / stretch[1], np.arange(len(cols))) + counts[1].start
        middle[1] = there + 0.5 + (template.shape[1] / 2 - first - 0.5) * size
    return Redrawing(
        size=size,
        row=row - margins[0] + float(middle[0]),
        col=col - margins[1] + float(middle[1]),
        gain=tuple(map(float, gain)),
        contrast=math.sqrt(float(lit.var(axis=(0, 1)).sum() / drawn.var(axis=(0, 1)).sum())),
        explained=explained(seen.reshape(weights.size, -1), lit.reshape(weights.size, -1), weights.ravel()),
    )


def stretched_like(
    image: Image, template: Pattern, row: int, col: int, scale: float
) -> tuple[float, float, float, float] | None:
    """Return how a place is like a word that is drawn anew, by brightness alone; None if it is not.

    The middle (row, col), px, the size over the template's own, and the correlation at the best height and width. As
    :func:`redrawing`, but the scale may be wrong by a quarter: letters that move take the best score elsewhere.
    """
    (first, last), _ = shown = _shown(template)
    grey = np.moveaxis(template.deviations, 0, 2).mean(axis=2, keepdims=True).astype(np.float32)
    told = float(np.square(grey).mean()) > LEAST_BRIGHT * float(np.square(template.deviations).mean())
    around = _around(image, template, row, col, scale, 2 * ROOM)
    if around is None or not told or not _has_letters(shown) or last - first > TALLEST:
        return None
    part, _, margins = around
    seen = (part - part.mean(axis=(0, 1))).mean(axis=2, keepdims=True)
    planes = _blurred(grey, SOFT), _blurred(seen, SOFT * max(1.0, scale))
    score, tall, wide, top, left = _stretched(*planes, scale, (SIZES, COARSELY))
    if score < LEAST_LIKE:
        return None
    size = math.sqrt(tall * wide / math.prod(template.shape))
    return row - margins[0] + top + tall / 2, col - margins[1] + left + wide / 2, size, score


def _has_letters(shown: list[tuple[int, int]]) -> bool:
    """Return whether what counts of a template is of the form of words."""
    tall, wide = (last - first - 2 * BEYOND for first, last in shown)
    return tall >= LEAST_TALL and wide >= LEAST_WIDE * tall


def _around(
    image: Image, template: Pattern, row: int, col: int, scale: float, room: float = ROOM
) -> tuple[Plane, Plane, tuple[int, int]] | None:
    """Return a place with margins, which of its pixels are in the image, and the margins; None if some have no data."""
    sides = [round(side * scale) for side in template.shape]
    down, across = (max(LEAST_ROOM, round(room * side)) for side in sides)
    around = [
        np.arange(start - margin, start + side + margin)
        for start, side, margin in zip((row, col), sides, (down, across), strict=True)
    ]
    inside = [(at >= 0) & (at < length) for at, length in zip(around, image.shape, strict=False)]
    rows, cols = (np.clip(at, 0, length - 1) for at, length in zip(around, image.shape, strict=False))
    part = image[np.ix_(rows, cols)].astype(np.float32)
    return (part, np.outer(*inside).astype(np.float32), (down, across)) if np.isfinite(part).all() else None


def _stretched(
    drawn: Plane, seen: Plane, scale: float, searches: Sequence[Sequence[tuple[float, float]]]
) -> tuple[float, int, int, int, int]:
    """Return correlation, height, width, top and left of the template where it is most like a part of what is seen."""
    best = -2.0, 0, 0, 0, 0
    middle = np.log([scale, scale])
    for steps in searches:
        tried = {
            tuple(max(3, round(side * size)) for side, size in zip(drawn.shape, np.exp(middle + step), strict=False))
            for step in steps
        }
        for tall, wide in sorted(tried):
            if tall > seen.shape[0] or wide > seen.shape[1]:
                continue
            scores = cv2.matchTemplate(seen, cv2.resize(drawn, (wide, tall)), cv2.TM_CCOEFF_NORMED)
            _, score, _, (left, top) = cv2.minMaxLoc(scores)
            best = max(best, (score, tall, wide, top, left))
        middle = np.log(np.array(best[1:3]) / drawn.shape[:2]) if best[1] else middle
    return best


def _shown(template: Pattern) -> list[tuple[int, int]]:
    """Return the first row and column that count, and the ends of the last: in which something varies, or beside."""
    ends = []
    for axis in range(2):
        other = 1 - axis
        along = np.abs(np.diff(template.deviations, axis=1 + axis)).sum(axis=0).max(axis=other)
        across = np.abs(np.diff(template.deviations, axis=1 + other)).sum(axis=0).max(axis=other)
        step = np.maximum(np.maximum(np.append(along, 0), np.append(0, along)), across)
        varies = np.flatnonzero(step > SHOWN * step.max())
        if axis == 0:  # without what the rim cuts off of the lines above and below
            runs = np.split(varies, np.flatnonzero(np.diff(varies) > 1) + 1)
            least, last = CUT_OFF * max(map(len, runs)), len(step) - 1
            varies = np.concatenate([run for run in runs if len(run) >= least or 0 < run[0] <= run[-1] < last])
        ends.append((max(0, int(varies[0]) - BEYOND), min(len(step), int(varies[-1]) + 1 + BEYOND)))
    return ends


def _shifts(
    drawn_at: Callable[[Plane, Plane], Plane], down: Plane, across: Plane, seen: Plane, weights: Plane, axis: int
) -> Plane:
    """Return the shifts of the rows or columns, each near that of the next, with the least difference of all."""
    still = [0 * down, across] if axis == 0 else [down, 0 * across]
    _, lit = _light(drawn_at(*still), seen, weights)
    shifts = np.arange(-REACH, REACH + STEP / 2, STEP, dtype=np.float32)
    costs = []
    for shift in shifts:
        at = [one + shift * (number == axis) for number, one in enumerate(still)]
        costs.append((np.square(seen - lit(drawn_at(at[0], at[1]))).sum(axis=2) * weights).sum(axis=1 - axis))
    of_line = np.stack(costs, axis=1)
    of_line /= max(float(of_line.mean()), 1e-12)
    least, before = of_line[0], []
    for cost in of_line[1:]:
        around = np.pad(least, 1, constant_values=math.inf)
        ways = np.stack([around[:-2] + STIFF, least, around[2:] + STIFF])
        before.append(ways.argmin(axis=0) - 1)
        least = ways.min(axis=0) + cost
    path = [int(least.argmin())]
    for ways in reversed(before):
        path.append(path[-1] + int(ways[path[-1]]))
    return _blurred(shifts[path[::-1]].reshape(1, -1), SMOOTH).ravel()


def _slope(shifts: Plane, drawn: Plane, axis: int) -> float:
    """Return by how much the shifts of rows or columns grow from one to the next, where something varies."""
    steps = np.square(np.diff(drawn, axis=axis)).sum(axis=(1 - axis, 2))
    counts = np.append(steps, 0) + np.append(0, steps)
    at = np.arange(len(shifts)) - np.average(np.arange(len(shifts)), weights=counts)
    return float((counts * at * shifts).sum() / (counts * np.square(at)).sum())


def _size_by_ink(own: Plane, seen: Plane) -> float | None:
    """Return the size of what is seen by the ink in it and in the template; None unless they are words on a ground."""
    colours = own.reshape(-1, own.shape[2])
    axis = np.linalg.eigh(colours.T @ colours)[1][:, -1]
    logarithms = []
    for plane in (own @ axis, seen @ axis):
        ink = plane - median(plane)
        most = float(np.abs(ink).max())
        if not most > 0:
            return None
        ink *= math.copysign(1 / most, float(ink.sum()))
        marked = np.abs(ink) > ON_GROUND
        if max(marked.mean(axis=0).max(), marked.mean(axis=1).max()) > RULED:
            return None
        of_rows = ink.clip(0).sum(axis=1)
        away = np.arange(len(of_rows)) - np.average(np.arange(len(of_rows)), weights=of_rows)
        variance = max(float(np.average(np.square(away), weights=of_rows)), 1 / 12)  # of a single row
        logarithms.append((math.log(of_rows.sum()), math.log(variance) / 2))
    (ink_before, spread_before), (ink_after, spread_after) = logarithms
    return math.exp(OF_INK * (ink_after - ink_before) - OF_SPREAD * (spread_after - spread_before))


def _sampled(plane: Plane, rows: Plane, cols: Plane) -> Plane:
    """Return the values of a plane in these rows and columns, parts of a pixel too."""
    across, down = np.meshgrid(cols, rows)
    at = np.asarray(across, dtype=np.float32), np.asarray(down, dtype=np.float32)
    sampled = cv2.remap(plane, at[0], at[1], cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(sampled, dtype=np.float32).reshape(*across.shape, -1)


def _light(plane: Plane, seen: Plane, weights: Plane) -> tuple[Plane, Callable[[Plane], Plane]]:
    """Return the gain of each channel that, with an offset, brings a plane nearest to what is seen; and that light."""
    shares = (weights / weights.sum())[:, :, np.newaxis]
    level, wanted = ((one * shares).sum(axis=(0, 1)) for one in (plane, seen))
    about = (plane - level) * shares
    energy = np.maximum((about * plane).sum(axis=(0, 1)), 1e-12)
    gain = np.asarray((about * seen).sum(axis=(0, 1)) / energy, dtype=np.float32)
    return gain, lambda one: np.asarray((one - level) * gain + wanted, dtype=np.float32)
