"""A template drawn anew at another size, as screens draw text: each letter is fitted to whole pixels.

Its width and height are then different multiples of the template's, and its columns and rows are shifted by a pixel or
two, letter by letter, or the text of a button against its border. A sibling has one stroke more or less, which no such
shift explains.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product

import cv2
import numpy as np

from stereolag.core.arrays import median
from stereolag.core.inputs import Image
from stereolag.templates.aligning import Matrix, Plane
from stereolag.templates.differences import Windows, explained_variance
from stereolag.templates.patterns import Pattern, blurred

COMPARED_SIGMA_PX = 0.55
"""Sigma of the blur, px of the template, under which two drawings are compared: 0.4 and 0.8 separate siblings less."""

MARGIN_SHARE = 0.12
"""Margin around a place that is searched, as a share of its side; at least 4 px."""

COARSE_STEPS = np.array(list(product((-0.11, -0.055, 0.0, 0.055, 0.11), repeat=2)))
"""Steps of the logarithms of height and width."""

FINE_STEPS = np.array(list(product((-0.0275, 0.0, 0.0275), repeat=2)))

SIZE_STEPS = np.array([(step, step) for step in (-0.22, -0.165, -0.11, -0.055, 0.0, 0.055, 0.11, 0.165, 0.22)])
"""Equal steps of both, where the size is uncertain."""

MIN_CORRELATION = 0.85
"""Least correlation at the best height and width; where the template is, from 0.91."""

DRAWING_MARGIN_PX = 2
"""Pixels around the drawing that are compared as well."""

SHIFT_PENALTY = 0.2
"""Cost of a step of the shift from one row or column to the next, in mean squared differences of a line."""

LETTER_SIGMA_PX = 3.3
"""Sigma of the window about a letter, px of the template."""

MIN_LETTER_VARIANCE = 0.2
"""Least variance of a letter, as a share of the largest."""

MAX_LETTER_DIFFERENCE = 0.27
"""Largest squared difference of a letter, as a share of its variance, from the same letter.

Measured on screens drawn anew at 110 to 150 %: up to here at 228 of 235 words, numbers and buttons; from here on at 232
of as many of which one letter is another.
"""

MAX_TEXT_HEIGHT_PX = 48
"""Largest height of text whose letters move so far that another place scores higher than its own."""

INK_EXPONENT = 0.62
"""Exponent of the amount of ink in the size."""

SPREAD_EXPONENT = 0.3
"""Exponent of the ink's vertical spread, by which the size is divided: strokes are as wide as the size asks for, but as
long as whole pixels make them, and then have more ink.

Measured on 409 words drawn anew at 110 to 150 %: off by more than 5 % in 3; by height and width in 22 of the first 197.
In screens reduced to 50 to 80 % and compressed: in 8 of 9, and by height and width in 3.
"""

MAX_INKED_SHARE = 0.85
"""Largest share of a row or column of text that has ink. Frames have more; rounded less than letters, they give the
size by themselves."""


_blurred = partial(blurred, border=cv2.BORDER_REPLICATE)


@dataclass(frozen=True)
class Redrawing:
    """A template drawn anew at another size.

    Parameters
    ----------
    size
        Size over that of the template.
    row, col
        Centre, px from the top-left corner of the image.
    gain
        For each channel the slope of its values against those of the template.
    contrast
        Standard deviation over that of the template.
    explained
        Share of the variance of the place that the template explains.
    """

    size: float
    row: float
    col: float
    gain: tuple[float, ...]
    contrast: float
    explained: float


def redrawing(image: Image, template: Pattern, row: int, col: int, scale: float) -> Redrawing | None:
    """Return place and size of the template drawn anew at about this scale; None if the place is something else.

    Parameters
    ----------
    image
        (rows, cols, channels), as many channels as the template.
    template
        As given, with equal weights.
    row, col
        Top-left pixel of the place.
    scale
        Size over that of the template, to a tenth.
    """
    extent = _drawing_extent(template)
    around = _surroundings(image, template, row, col, scale, MARGIN_SHARE) if _is_text(extent) else None
    if around is None:
        return None
    part, weights, margins = around
    given = _blurred(np.moveaxis(template.deviations, 0, 2).astype(np.float32), COMPARED_SIGMA_PX)
    observed = _blurred(part - part.mean(axis=(0, 1)), COMPARED_SIGMA_PX * max(1.0, scale))
    correlation, height, width, top, left = _best_stretch(given, observed, scale, (COARSE_STEPS, FINE_STEPS))
    if correlation < MIN_CORRELATION:
        return None
    stretch = np.array([height, width]) / template.shape
    centre = np.array([top + height / 2, left + width / 2])
    drawing = tuple(
        slice(max(0, math.floor(at + factor * (first - side / 2))), math.ceil(at + factor * (last - side / 2)))
        for at, factor, (first, last), side in zip(centre, stretch, extent, template.shape, strict=True)
    )
    observed, weights = observed[drawing], weights[drawing]
    # Rows and columns of the template at the pixels of the drawing, before they are shifted.
    rows, cols = (
        (np.arange(side) + (span.start or 0) + 0.5 - start) / factor - 0.5
        for side, span, start, factor in zip(observed.shape, drawing, (top, left), stretch, strict=False)
    )
    down, across, drawn = _shifted_to_fit(given, rows, cols, stretch, observed, weights)
    slopes = np.array([_slope(down, drawn, 0), _slope(across, drawn, 1)])
    own = np.moveaxis(template.deviations, 0, 2)[tuple(slice(*ends) for ends in extent)]
    size_by_ink = _size_by_ink(own.astype(np.float32), part[drawing] - part.mean(axis=(0, 1)))
    gain, in_light = _light(drawn, observed, weights)
    lit = in_light(drawn)
    letters = Windows(weights, LETTER_SIGMA_PX * scale)
    differences, _ = letters.relative_differences(lit, observed, MIN_LETTER_VARIANCE)
    if (gain <= 0).all() or differences.max() > MAX_LETTER_DIFFERENCE:
        return None
    size = float(np.exp((np.log(stretch) - slopes) @ [0.5, 0.5]))  # height and width are both rounded per letter
    if size_by_ink is not None and size >= 1:  # in a reduced drawing, strokes are paler
        size = size_by_ink
    if size_by_ink is not None:  # text begins at its first letter, and is as long as rounding makes it
        first = extent[1][0] + DRAWING_MARGIN_PX
        start = np.interp(first, cols + across / stretch[1], np.arange(len(cols))) + drawing[1].start
        centre[1] = start + 0.5 + (template.shape[1] / 2 - first - 0.5) * size
    return Redrawing(
        size=size,
        row=row - margins[0] + float(centre[0]),
        col=col - margins[1] + float(centre[1]),
        gain=tuple(map(float, gain)),
        contrast=math.sqrt(float(lit.var(axis=(0, 1)).sum() / drawn.var(axis=(0, 1)).sum())),
        explained=explained_variance(
            observed.reshape(weights.size, -1), lit.reshape(weights.size, -1), weights.ravel()
        ),
    )


def redrawn_place(
    image: Image, template: Pattern, row: int, col: int, scale: float
) -> tuple[float, float, float, float] | None:
    """Return the place and size of text drawn anew, found by brightness alone; None if there is none.

    The centre (row, col), px, the size over the template's own, and the correlation at the best height and width. The
    given scale may be wrong by a quarter: with its letters moved, text may score best at another.
    """
    (first, last), _ = extent = _drawing_extent(template)
    grey = np.moveaxis(template.deviations, 0, 2).mean(axis=2, keepdims=True).astype(np.float32)
    min_variance = 0.1 * float(np.square(template.deviations).mean())  # for brightness to be compared alone
    around = _surroundings(image, template, row, col, scale, 2 * MARGIN_SHARE)
    is_bright = float(np.square(grey).mean()) > min_variance
    if around is None or not is_bright or not _is_text(extent) or last - first > MAX_TEXT_HEIGHT_PX:
        return None
    part, _, margins = around
    observed = (part - part.mean(axis=(0, 1))).mean(axis=2, keepdims=True)
    planes = _blurred(grey, COMPARED_SIGMA_PX), _blurred(observed, COMPARED_SIGMA_PX * max(1.0, scale))
    score, height, width, top, left = _best_stretch(*planes, scale, (SIZE_STEPS, COARSE_STEPS))
    if score < MIN_CORRELATION:
        return None
    size = math.sqrt(height * width / math.prod(template.shape))
    return row - margins[0] + top + height / 2, col - margins[1] + left + width / 2, size, score


def _is_text(extent: list[tuple[int, int]]) -> bool:
    """Return whether a drawing of this extent is as wide as words, and at least 6 px high.

    Icons are not rounded to pixels, and a mark in them is smaller than a letter.
    """
    height, width = (last - first - 2 * DRAWING_MARGIN_PX for first, last in extent)
    return height >= 6 and width >= 1.8 * height


def _surroundings(
    image: Image, template: Pattern, row: int, col: int, scale: float, margin_share: float
) -> tuple[Plane, Plane, tuple[int, int]] | None:
    """Return a place with margins, the weights of its pixels (0 outside the image), and the margins.

    None if pixels without data are among them.
    """
    sides = [round(side * scale) for side in template.shape]
    down, across = (max(4, round(margin_share * side)) for side in sides)
    around = [
        np.arange(start - margin, start + side + margin)
        for start, side, margin in zip((row, col), sides, (down, across), strict=True)
    ]
    inside = [(at >= 0) & (at < length) for at, length in zip(around, image.shape, strict=False)]
    rows, cols = (np.clip(at, 0, length - 1) for at, length in zip(around, image.shape, strict=False))
    part = image[np.ix_(rows, cols)].astype(np.float32)
    return (part, np.outer(*inside).astype(np.float32), (down, across)) if np.isfinite(part).all() else None


def _best_stretch(
    drawn: Plane, observed: Plane, scale: float, searches: Sequence[Matrix]
) -> tuple[float, int, int, int, int]:
    """Return correlation, height, width, top and left of the template, stretched and placed to fit the image best."""
    best = -2.0, 0, 0, 0, 0
    log_sizes = np.log([scale, scale])
    for steps in searches:
        shapes = {
            tuple(max(3, round(side * size)) for side, size in zip(drawn.shape, np.exp(log_sizes + step), strict=False))
            for step in steps
        }
        for height, width in sorted(shapes):
            scores = cv2.matchTemplate(observed, cv2.resize(drawn, (width, height)), cv2.TM_CCOEFF_NORMED)
            _, score, _, (left, top) = cv2.minMaxLoc(scores)
            best = max(best, (score, height, width, top, left))
        log_sizes = np.log(np.array(best[1:3]) / drawn.shape[:2]) if best[1] else log_sizes
    return best


def _drawing_extent(template: Pattern) -> list[tuple[int, int]]:
    """Return first and end of the rows, and of the columns, that contain the drawing and a margin around it.

    The drawing is where values change by a tenth or more of the largest change.
    """
    ends = []
    for axis in range(2):
        other = 1 - axis
        along = np.abs(np.diff(template.deviations, axis=1 + axis)).sum(axis=0).max(axis=other)
        across = np.abs(np.diff(template.deviations, axis=1 + other)).sum(axis=0).max(axis=other)
        step = np.maximum(np.maximum(np.append(along, 0), np.append(0, along)), across)
        drawn = np.flatnonzero(step > 0.1 * step.max())
        if axis == 0:  # without lines above and below of which the rim shows less than half
            runs = np.split(drawn, np.flatnonzero(np.diff(drawn) > 1) + 1)
            least, last = max(map(len, runs)) / 2, len(step) - 1
            drawn = np.concatenate([run for run in runs if len(run) >= least or 0 < run[0] <= run[-1] < last])
        end = int(drawn[-1]) + 1 + DRAWING_MARGIN_PX
        ends.append((max(0, int(drawn[0]) - DRAWING_MARGIN_PX), min(len(step), end)))
    return ends


def _shifted_to_fit(
    template: Plane, rows: Plane, cols: Plane, stretch: Matrix, observed: Plane, weights: Plane
) -> tuple[Plane, Plane, Plane]:
    """Return the shifts of each row and column that fit the image best, px of the image, and the template drawn so.

    `rows` and `cols` are those of the template before they are shifted; `stretch` is its height and width in the image
    over its own.
    """

    def drawn_at(down: Plane, across: Plane) -> Plane:
        return _sampled(template, rows + down / stretch[0], cols + across / stretch[1])

    down, across = np.zeros(len(rows), np.float32), np.zeros(len(cols), np.float32)
    for _ in range(2):
        across = _shifts(drawn_at, down, across, observed, weights, 1)
        down = _shifts(drawn_at, down, across, observed, weights, 0)
    return down, across, drawn_at(down, across)


def _shifts(
    drawn_at: Callable[[Plane, Plane], Plane], down: Plane, across: Plane, observed: Plane, weights: Plane, axis: int
) -> Plane:
    """Return the shifts of the rows or columns, up to 3 px and smooth, of least total cost, by dynamic programming."""
    unshifted = [0 * down, across] if axis == 0 else [down, 0 * across]
    _, in_light = _light(drawn_at(*unshifted), observed, weights)
    shifts = np.linspace(-3, 3, 25, dtype=np.float32)
    costs = []
    for shift in shifts:
        at = [start + shift * (number == axis) for number, start in enumerate(unshifted)]
        error = np.square(observed - in_light(drawn_at(at[0], at[1]))).sum(axis=2)
        costs.append((error * weights).sum(axis=1 - axis))
    line_costs = np.stack(costs, axis=1)
    line_costs /= max(float(line_costs.mean()), 1e-12)
    total, steps_back = line_costs[0], []
    for cost in line_costs[1:]:
        padded = np.pad(total, 1, constant_values=math.inf)
        choices = np.stack([padded[:-2] + SHIFT_PENALTY, total, padded[2:] + SHIFT_PENALTY])
        steps_back.append(choices.argmin(axis=0) - 1)
        total = choices.min(axis=0) + cost
    path = [int(total.argmin())]
    for steps in reversed(steps_back):
        path.append(path[-1] + int(steps[path[-1]]))
    return _blurred(shifts[path[::-1]].reshape(1, -1), 1.0).ravel()


def _slope(shifts: Plane, drawn: Plane, axis: int) -> float:
    """Return the mean growth of the shifts from one row or column to the next, weighted by their steps of value."""
    steps = np.square(np.diff(drawn, axis=axis)).sum(axis=(1 - axis, 2))
    weights = np.append(steps, 0) + np.append(0, steps)
    at = np.arange(len(shifts)) - np.average(np.arange(len(shifts)), weights=weights)
    return float((weights * at * shifts).sum() / (weights * np.square(at)).sum())


def _size_by_ink(template: Plane, observed: Plane) -> float | None:
    """Return the size of text in the image by the ink in it and in the template; None unless both are text."""
    colours = template.reshape(-1, template.shape[2])
    axis = np.linalg.eigh(colours.T @ colours)[1][:, -1]
    logarithms = []
    for plane in (template @ axis, observed @ axis):
        ink = plane - median(plane)
        most = float(np.abs(ink).max())
        if not most > 0:
            return None
        ink *= math.copysign(1 / most, float(ink.sum()))
        inked = np.abs(ink) > 0.05
        if max(inked.mean(axis=0).max(), inked.mean(axis=1).max()) > MAX_INKED_SHARE:
            return None
        row_ink = ink.clip(0).sum(axis=1)
        offsets = np.arange(len(row_ink)) - np.average(np.arange(len(row_ink)), weights=row_ink)
        variance = max(float(np.average(np.square(offsets), weights=row_ink)), 1 / 12)  # of a single row
        logarithms.append((math.log(row_ink.sum()), math.log(variance) / 2))
    (ink_before, spread_before), (ink_after, spread_after) = logarithms
    return math.exp(INK_EXPONENT * (ink_after - ink_before) - SPREAD_EXPONENT * (spread_after - spread_before))


def _sampled(plane: Plane, rows: Plane, cols: Plane) -> Plane:
    """Return a plane interpolated at fractional rows and columns."""
    across, down = np.meshgrid(cols.astype(np.float32), rows.astype(np.float32))
    sampled = cv2.remap(plane, across, down, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(sampled, dtype=np.float32).reshape(*across.shape, -1)


def _light(plane: Plane, observed: Plane, weights: Plane) -> tuple[Plane, Callable[[Plane], Plane]]:
    """Return the gain of each channel that, with an offset, brings a plane nearest to the image; and that mapping."""
    shares = (weights / weights.sum())[:, :, np.newaxis]
    level, target = ((values * shares).sum(axis=(0, 1)) for values in (plane, observed))
    weighted = (plane - level) * shares
    energy = np.maximum((weighted * plane).sum(axis=(0, 1)), 1e-12)
    gain = np.asarray((weighted * observed).sum(axis=(0, 1)) / energy, dtype=np.float32)
    return gain, lambda other: np.asarray((other - level) * gain + target, dtype=np.float32)
