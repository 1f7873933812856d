"""Whether a place shows the template, but for a thing that a screen draws over whatever is there.

A text cursor, the arrow of the mouse, the ring around what has the focus, the tint of a selection, the shadow of
something in front of its ground: no sibling differs by such a thing alone, and all other pixels are the template's.
"""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Mask, median, percentiles
from stereolag.core.inputs import Image
from stereolag.templates.aligning import Plane, gradient
from stereolag.templates.patterns import Pattern

LEAST_AREA, LEAST_LONG = 4900, 1.2
"""Least number of pixels of a template, or least width over height: an icon with a stroke more is its sibling."""

CURSOR = (13, 3)
"""Least length and greatest width of a text cursor, px: strokes of letters are shorter."""

THICKEST, OF_SIDE, OF_TEMPLATE = 4, 0.4, 0.4
"""Greatest thickness of a ring, px, least share of each of its sides that is seen, and of the template within it."""

ARROW = np.array([(0, 0), (0, 16), (4, 12.5), (7, 19), (9.5, 18), (6.5, 11.5), (11.5, 11.5)])
"""The corners of the arrow of the mouse, x and y, at 100 % of a screen, px."""

ARROW_SIZES, LIKE_ARROW, BESIDE = (1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0), 0.7, 8
"""Its sizes, the least share that it and what differs have in common, and how many times its size, or that of a badge
within it, a template has: what fills more of it is a part of it."""

BAR, OF_BAR = 24, 0.75
"""Greatest width of a bar along a side, px, and least share of it that differs."""

BADGE, ROUND, NEW = (8, 40), (0.68, 0.95), 0.5
"""Least and greatest height of a badge, px, and of its box that it fills; and least share of it that differs: if less,
the template has that badge, with another number in it.
"""

STEEP, OF_VARIANCE, OUTLINED, TEXTURE, PART = 9.0, 0.003, 0.95, 0.5, 0.25
"""Squared gradient of an edge of the template, over the median one beside a thing and over the template's variance; the
least share of the rim of a thing that is at such edges where the template itself has that outline; the largest 3 to 12
px around it, where texture has edges too; and the least share of a thing of a part with a rim of its own.

Measured: 1.0 and up to 0.36 at switches and boxes in another state; at things in front up to 0.92 around letters under
a text cursor, and 0.69 around an arrow over texture.
"""

PLAIN, STEEPER = 7.0, 1.4
"""Least squared gradient at the rim of a plain thing over that within it; and how many times the energy of that rim in
the template the rim of something in front has.

Measured where a hat is gone: from 8 in six of seven, and 0.3 to 1.4; where something is in front of such a thing, 1.6.
"""

LEAST_GAIN, LEAST_TINTED = 0.4, 0.95
"""Least contrast under a tint, and least share of the variance there that the tinted template explains."""

DARKEST, SMOOTH, NEUTRAL, FADES, DARK = 0.3, 0.08, 0.08, 0.05, 40.0
"""Darkest shadow, largest step of it from one pixel to the next, largest difference of it between channels, least by
which it fades, and the least value at which its share can be told."""

LIKE, NOISY, AS_THEY_ARE, MOST = 6.0, 5.0, 20, 0.75
"""Greatest difference of pixels that are the same, grey levels of 255, unless it is so many times this percentile; and
the largest share of the pixels that may differ by more."""

ONE, ALL = 0.9, 0.97
"""Least share of what differs that is one thing, and that is within the outline of what it is taken for."""


def drawn_over(image: Image, pattern: Pattern, row: int, col: int) -> Mask | None:
    """Return which pixels are drawn over, (rows, cols), None if that is not all by which a place differs.

    Parameters
    ----------
    image
        (rows, cols, channels) uint8, as many channels as the pattern.
    pattern
        The template in its own size, all of whose pixels count the same.
    row, col
        The place, exactly.
    """
    rows, cols = pattern.shape
    if rows * cols < LEAST_AREA and cols < LEAST_LONG * rows:
        return None
    part = image[max(row, 0) : row + rows, max(col, 0) : col + cols]
    if part.shape != pattern.colours.shape:
        return None
    seen, template = part.astype(np.float32), pattern.colours.astype(np.float32)
    away = seen - template
    level = np.array([median(channel) for channel in np.moveaxis(away, 2, 0)], dtype=np.float32)
    # What most pixels differ by is a tint, or another light, and no noise.
    spreads = [float(percentiles(np.abs(one).max(axis=2), AS_THEY_ARE)[0]) for one in (away, away - level)]
    noise = max(LIKE, NOISY * min(spreads))
    differ = np.abs(away).max(axis=2) > noise
    varies = min(float(one.std(axis=(0, 1)).max()) for one in (template, seen))
    if not 0 < differ.mean() <= MOST or noise > max(LIKE, varies):  # what differs by as much as all varies is no noise
        return None
    _, labels, stats, _ = cv2.connectedComponentsWithStats(
        cv2.morphologyEx(np.asarray(differ, dtype=np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    )
    thing = differ & (labels == 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA])))
    alone = (
        thing.sum() >= ONE * differ.sum() and not has_outline(template, thing) and not is_gone(template, seen, thing)
    )
    over = (
        (alone and (_is_cursor(thing, seen, noise) or _is_arrow(thing)))
        or (alone and _is_bar(differ, seen, noise))
        or (alone and _is_over_edges(thing, template, noise) and _is_badge(thing, image, row, col, noise))
        or _is_ring(differ, seen, noise)
        or _is_tint(differ, template, seen)
        or _is_shadow(differ, template, seen)
    )
    return differ if over else None


def has_outline(template: Plane, thing: Mask) -> bool:
    """Return whether the template has edges all along the rim of a thing: it is in another state, or gone.

    As a switch is, or the check mark of a box, or a letter. Of a knob that moves, the rim where the template has it
    tells; noise makes gaps in a thing, so that its hull tells as well.
    """
    found, _ = cv2.findContours(thing.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if not found:
        return False
    least, hull = PART * thing.sum(), cv2.convexHull(np.concatenate(found))
    large = [one for one in found if cv2.contourArea(one) >= least]
    steep = sum(np.square(one).sum(axis=2) for one in gradient(template))
    return any(_is_outlined(template, steep, outline) for outline in [hull, *large])


def is_gone(template: Plane, seen: Plane, differ: Mask) -> bool:
    """Return whether the template has something plain or thin where it differs, and no clearer outline is seen there.

    What is in front of the template has an outline of its own; what goes on behind something that is gone has none.
    """
    thing, square = without_gaps(differ), np.ones((5, 5), np.uint8)
    inner = cv2.erode(thing, square) > 0
    rim = (cv2.dilate(thing, square) > 0) & ~inner
    own, there = (sum(np.square(one).sum(axis=2) for one in gradient(plane)) for plane in (template, seen))
    at_rim = float(own[rim].sum())
    is_plain = at_rim * inner.sum() >= PLAIN * float(own[inner].sum()) * rim.sum()
    return bool(is_plain and there[rim].sum() < STEEPER * at_rim)


def without_gaps(differ: Mask) -> npt.NDArray[np.uint8]:
    """Return what differs, as 0 and 1, without gaps of less than 5 px and without what is thinner than 3 px."""
    closed = cv2.morphologyEx(differ.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    return np.asarray(cv2.morphologyEx(closed, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)), dtype=np.uint8)


def _is_outlined(template: Plane, steep: Plane, outline: npt.NDArray[Any]) -> bool:
    """Return whether the template has edges all along a closed line: one that it cuts off does not count."""
    filled = cv2.drawContours(np.zeros(steep.shape, np.uint8), [outline], -1, 1, -1)
    inner, outer, near, far = (
        change(filled, np.ones((side, side), np.uint8)) > 0
        for change, side in ((cv2.erode, 3), (cv2.dilate, 3), (cv2.dilate, 7), (cv2.dilate, 25))
    )
    rim, beside = outer & ~inner, far & ~near
    if outer[[0, -1]].any() or outer[:, [0, -1]].any() or not rim.any():
        return False
    least = max(STEEP * median(steep[~outer]), OF_VARIANCE * float(template.var(axis=(0, 1)).sum()))
    edges = cv2.dilate(np.asarray(steep > least, dtype=np.uint8), np.ones((3, 3), np.uint8)) > 0
    return bool(edges[rim].mean() >= OUTLINED and edges[beside].sum() <= TEXTURE * beside.sum())


def _box(differ: Mask) -> tuple[slice, slice]:
    """Return the rows and columns that hold all that differs."""
    rows, cols = (np.flatnonzero(differ.any(axis=axis)) for axis in (1, 0))
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(cols[0]), int(cols[-1]) + 1)


def _is_uniform(values: Plane, noise: float) -> bool:
    """Return whether values (pixels, channels) are of one colour."""
    middle = [median(channel) for channel in values.T]
    return bool((np.abs(values - middle).max(axis=1) <= noise).mean() >= ONE)


def _is_cursor(differ: Mask, seen: Plane, noise: float) -> bool:
    rows, cols = _box(differ)
    part = seen[rows, cols]
    return part.shape[0] >= CURSOR[0] and part.shape[1] <= CURSOR[1] and _is_uniform(part[differ[rows, cols]], noise)


def _is_ring(differ: Mask, seen: Plane, noise: float) -> bool:
    rows, cols = _box(differ)
    part = differ[rows, cols]
    if min(part.shape) < 4 * THICKEST or part.size < OF_TEMPLATE * differ.size:
        return False
    inner = part[THICKEST:-THICKEST, THICKEST:-THICKEST]
    if inner.sum() > (1 - ALL) * part.sum():
        return False
    sides = [side.any(axis=0) for turned in (part, part.T) for side in (turned[:THICKEST], turned[-THICKEST:])]
    return all(side.mean() >= OF_SIDE for side in sides) and _is_uniform(seen[rows, cols][part], noise)


def _is_bar(differ: Mask, seen: Plane, noise: float) -> bool:
    """Return whether what differs is a bar of one or two colours along a whole side of the template."""
    rows, cols = _box(differ)
    part, sides = seen[rows, cols], differ.shape
    along = [one.stop - one.start == side for one, side in zip((rows, cols), sides, strict=True)]
    at_rim = [one.start == 0 or one.stop == side for one, side in zip((rows, cols), sides, strict=True)]
    wide = min(part.shape[:2])
    if along[0] == along[1] or not all(at_rim) or wide > min(BAR, OF_TEMPLATE * min(sides)) or wide < 3:
        return False
    if differ[rows, cols].mean() < OF_BAR:
        return False
    values = part.reshape(-1, part.shape[2])
    first = np.abs(values - [median(channel) for channel in values.T]).max(axis=1) <= noise
    return bool(first.mean() >= ONE) or (bool(first.mean() >= 1 / 3) and _is_uniform(values[~first], noise))


def _is_over_edges(thing: Mask, template: Plane, noise: float) -> bool:
    """Return whether a thing that is small beside the template is over edges of it: a mark on its ground is its own."""
    rim = np.concatenate([thing[[0, -1]].ravel(), thing[:, [0, -1]].ravel()])
    small = thing.sum() * BESIDE <= thing.size
    return bool(small and (rim.any() or not _is_uniform(template[thing], noise)))


def _is_badge(thing: Mask, image: Image, row: int, col: int, noise: float) -> bool:
    """Return whether what differs is of a disc or a pill of one colour, with something in it, seen in the image."""
    rows, cols = (at + corner for at, corner in zip(np.nonzero(thing), (row, col), strict=True))
    top, left = max(0, int(rows.min()) - BADGE[1]), max(0, int(cols.min()) - BADGE[1])
    around = image[top : int(rows.max()) + BADGE[1], left : int(cols.max()) + BADGE[1]]
    own = rows - top, cols - left
    colour = [median(channel) for channel in around[own].T]
    like = np.asarray(np.abs(around - np.asarray(colour, dtype=np.float32)).max(axis=2) <= noise, dtype=np.uint8)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(like)
    inside = labels[own][like[own] > 0]
    if not inside.size:
        return False
    disc = 1 + int(np.argmax(np.bincount(inside, minlength=len(stats))[1:]))
    height, width = int(stats[disc, cv2.CC_STAT_HEIGHT]), int(stats[disc, cv2.CC_STAT_WIDTH])
    if not BADGE[0] <= height <= BADGE[1] or not 0.85 * height <= width <= 3 * height:
        return False
    found, _ = cv2.findContours(np.asarray(labels == disc, dtype=np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    filled = cv2.fillConvexPoly(np.zeros(like.shape, np.uint8), cv2.convexHull(np.concatenate(found)), 1)
    share = float(filled.sum()) / (height * width)
    reached = cv2.dilate(filled, np.ones((5, 5), np.uint8)) > 0
    down, right = (at + corner for at, corner in zip(np.nonzero(filled), (top - row, left - col), strict=True))
    within = (down >= 0) & (down < thing.shape[0]) & (right >= 0) & (right < thing.shape[1])
    is_new = thing[down[within], right[within]].mean() >= NEW
    return ROUND[0] <= share <= ROUND[1] and bool(is_new and reached[own].mean() >= ALL)


def _is_arrow(differ: Mask) -> bool:
    rows, cols = _box(differ)
    height, width = rows.stop - rows.start, cols.stop - cols.start
    if height * width * BESIDE > differ.size:
        return False
    found, _ = cv2.findContours(differ[rows, cols].astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    filled = cv2.drawContours(np.zeros((height, width), np.uint8), found, -1, 1, -1) > 0
    for size in ARROW_SIZES:
        tall, wide = (math.ceil(size * side) + 2 for side in ARROW[:, ::-1].max(axis=0))
        if abs(tall - height) > 2 + 0.1 * tall or abs(wide - width) > 2 + 0.1 * wide:
            continue
        corners = np.rint(16 * (ARROW * size + 1)).astype(np.int32)
        arrow = cv2.fillPoly(np.zeros((max(tall, height), max(wide, width)), np.uint8), [corners], 1, cv2.LINE_8, 4)
        shape = np.asarray(cv2.dilate(arrow, np.ones((3, 3), np.uint8)) > 0)
        other = np.zeros_like(shape)
        for down in range(shape.shape[0] - height + 1):
            for right in range(shape.shape[1] - width + 1):
                other[:] = False
                other[down : down + height, right : right + width] = filled
                if (other & shape).sum() >= LIKE_ARROW * (other | shape).sum():
                    return True
    return False


def _is_tint(differ: Mask, template: Plane, seen: Plane) -> bool:
    """Return whether all that differs is in rows or columns that something translucent of one colour covers."""
    rows, cols = _box(differ)
    tall, wide = (one.stop - one.start == side for one, side in zip((rows, cols), differ.shape, strict=True))
    if tall == wide or differ[rows, cols].mean() < ONE:
        return False
    below, shown = (plane[rows, cols].reshape(-1, plane.shape[2]) for plane in (template, seen))
    below, shown = (plane - plane.mean(axis=0, dtype=np.float64) for plane in (below, shown))
    gain = float((below * shown).sum()) / max(float(np.square(below).sum()), 1e-12)
    left = float(np.square(shown - gain * below).sum())
    return LEAST_GAIN <= gain <= 1 and left <= (1 - LEAST_TINTED) * float(np.square(shown).sum())


def _is_shadow(differ: Mask, template: Plane, seen: Plane) -> bool:
    """Return whether all that differs is darker by a share that fades and is the same in all channels."""
    light = template.min(axis=2) > DARK
    shares = np.where(light[:, :, np.newaxis], seen / np.maximum(template, 1), 1)
    share, where = shares.mean(axis=2), differ & light
    if where.sum() < ALL * differ.sum() or share[where].min() < DARKEST or share[where].max() > 1:
        return False
    if np.ptp(shares[where], axis=1).max() > NEUTRAL or np.ptp(share[where]) < FADES:
        return False
    steps = [
        np.abs(np.diff(share, axis=axis))[where[1:] & where[:-1] if axis == 0 else where[:, 1:] & where[:, :-1]]
        for axis in (0, 1)
    ]
    return all(not step.size or float(np.mean(step <= SMOOTH)) >= ALL for step in steps)
