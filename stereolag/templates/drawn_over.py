"""Whether a place shows the template under an overlay that screens draw over their content.

Overlays are a text cursor, the arrow of the mouse, a focus ring, the tint of a selection, a badge, a scroll bar and a
drop shadow: no sibling of a template differs by one of these alone, and all other pixels are the template's.
"""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Mask, median, percentiles
from stereolag.core.inputs import Image
from stereolag.templates.aligning import Plane, squared_gradient
from stereolag.templates.patterns import Pattern

MAX_RING_PX = 4
"""Largest thickness of a focus ring."""

ARROW = np.array([(0, 0), (0, 16), (4, 12.5), (7, 19), (9.5, 18), (6.5, 11.5), (11.5, 11.5)])
"""Corners (x, y) of the arrow of the mouse on a screen at 100 %, px."""

MIN_SIZE_RATIO = 8
"""Least area of a template over that of an arrow, or of a badge within it: anything larger is a part of it."""

MIN_EDGE_OVER_TEXTURE = 9.0
"""Least squared gradient of an edge of the template over the median beside the overlay."""

MIN_EDGE_OVER_VARIANCE = 0.003
"""Least squared gradient of an edge of the template over its variance, px⁻²."""

MIN_OUTLINED = 0.95
"""Least share of a region's outline that is at edges of the template where the template has that outline.

Measured: 1.0 at switches and boxes in another state; under overlays up to 0.92, around letters under a text cursor.
"""

MAX_EDGES_AROUND = 0.5
"""Largest share of edges 3 to 12 px around that outline: texture has edges everywhere.

Measured: up to 0.36 at switches and boxes in another state, 0.69 around an arrow over texture.
"""

MIN_PART = 0.25
"""Least share of a region that a part of it has, for its outline to be compared by itself."""

MIN_PLAIN_RATIO = 7.0
"""Least squared gradient of the template at the rim of something plain over that within it.

Measured where a hat is gone: from 8 in six of seven.
"""

MIN_RIM_RATIO = 1.4
"""Least squared gradient at the rim of an overlay over the template's own there.

Measured: 0.3 to 1.4 where a hat is gone, 1.6 where something is in front of such a thing.
"""

MAX_GROUND_CHANGE = 0.03
"""Largest change of the ground at another mark in the same ink, as a share of the distance between the two.

Measured: up to 0.007 at other bars of a code and other mouths, from 0.07 where a tip or a picture is in front of words.
"""

MAX_INK_CHANGE = 0.1
"""The same of the ink, which JPEG mixes with the ground in thin strokes: by up to 0.07."""

MAX_SAME_DIFFERENCE = 6.0
"""Largest difference of equal pixels without much noise, grey levels of 255."""

NOISE_RATIO = 5.0
"""Largest difference of equal pixels over :data:`NOISE_PERCENTILE` of all differences."""

NOISE_PERCENTILE = 20

MAX_DIFFERING = 0.75
"""Largest share of the pixels that may differ."""

MIN_IN_REGION = 0.9
"""Least share of the differing pixels that are one region, or of pixels that have its colour."""

MIN_IN_OUTLINE = 0.97
"""Least share of the differing pixels that are within the outline of the overlay."""


def drawn_over(image: Image, pattern: Pattern, row: int, col: int) -> Mask | None:
    """Return the mask of the pixels under an overlay, (rows, cols); None unless the place differs by that alone.

    Parameters
    ----------
    image
        (rows, cols, channels) uint8, as many channels as the pattern.
    pattern
        The template at its own size, with equal weights.
    row, col
        The place, exactly.
    """
    rows, cols = pattern.shape
    if rows * cols < 4900 and cols < 1.2 * rows:  # an icon: with one stroke more, it is a sibling
        return None
    part = image[max(row, 0) : row + rows, max(col, 0) : col + cols]
    if part.shape != pattern.colours.shape:
        return None
    observed, template = part.astype(np.float32), pattern.colours.astype(np.float32)
    difference = observed - template
    level = np.array([median(channel) for channel in np.moveaxis(difference, 2, 0)], dtype=np.float32)
    # The median difference is a tint, or another light, and not noise.
    spreads = [
        float(percentiles(np.abs(plane).max(axis=2), NOISE_PERCENTILE)[0]) for plane in (difference, difference - level)
    ]
    noise = max(MAX_SAME_DIFFERENCE, NOISE_RATIO * min(spreads))
    differ = np.abs(difference).max(axis=2) > noise
    deviation = min(float(plane.std(axis=(0, 1)).max()) for plane in (template, observed))
    if not 0 < differ.mean() <= MAX_DIFFERING or noise > max(MAX_SAME_DIFFERENCE, deviation):
        return None
    _, labels, stats, _ = cv2.connectedComponentsWithStats(
        cv2.morphologyEx(np.asarray(differ, dtype=np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    )
    region = differ & (labels == 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA])))
    may_be_in_front = (
        region.sum() >= MIN_IN_REGION * differ.sum()
        and not has_outline(template, region)
        and not is_gone(template, observed, region)
    )
    is_in_front = may_be_in_front and (
        _is_cursor(region, observed, noise)
        or _is_arrow(region)
        or _is_bar(differ, observed, noise)
        or (
            _is_over_edges(region, template, noise)
            and _is_badge(region, image, row, col, noise)
            and not has_same_ink(
                template[_box(region)].reshape(-1, part.shape[2]), observed[_box(region)].reshape(-1, part.shape[2])
            )
        )
    )
    is_overlay = (
        is_in_front
        or _is_ring(differ, observed, noise)
        or _is_tint(differ, template, observed)
        or _is_shadow(differ, template, observed)
    )
    return differ if is_overlay else None


def has_outline(template: Plane, region: Mask) -> bool:
    """Return whether the template has edges all along the outline of a region: it is a part in another state, or gone.

    Such a part is a switch, the check mark of a box, or a letter. Where a knob has moved, the outline at its place in
    the template is enough; noise makes gaps in a region, so that its convex hull is tried as well.
    """
    found, _ = cv2.findContours(region.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if not found:
        return False
    hull = cv2.convexHull(np.concatenate(found))
    large = [outline for outline in found if cv2.contourArea(outline) >= MIN_PART * region.sum()]
    steepness = squared_gradient(template)
    return any(_is_outlined(template, steepness, outline) for outline in [hull, *large])


def is_gone(template: Plane, observed: Plane, differ: Mask) -> bool:
    """Return whether the template has something plain or thin where it differs, and the image no clearer outline.

    Something in front of the template has an outline; the background continues where something is gone.
    """
    region, square = without_gaps(differ), np.ones((5, 5), np.uint8)
    inner = cv2.erode(region, square) > 0
    rim = (cv2.dilate(region, square) > 0) & ~inner
    own, shown = squared_gradient(template), squared_gradient(observed)
    at_rim = float(own[rim].sum())
    is_plain = at_rim * inner.sum() >= MIN_PLAIN_RATIO * float(own[inner].sum()) * rim.sum()
    return bool(is_plain and shown[rim].sum() < MIN_RIM_RATIO * at_rim)


def has_same_ink(predicted: Plane, observed: Plane) -> bool:
    """Return whether predicted and observed pixels are of one ground and one ink, the same in both."""
    colours = [np.median(predicted, axis=0)]
    for _ in range(2):  # the ink is farthest from the ground, and the ground from the ink
        distance = np.linalg.norm(predicted - colours[-1], axis=1)
        colours.append(predicted[distance >= percentiles(distance, 97)[0]].mean(axis=0))
    step = float(np.linalg.norm(colours[2] - colours[1]))
    near = [
        [np.linalg.norm(pixels - colour, axis=1) <= step / 4 for colour in colours[1:]]
        for pixels in (predicted, observed)
    ]
    if any(np.any(ends, axis=0).mean() < 0.8 or not all(map(np.any, ends)) for ends in near):
        return False
    # There is less of the ink.
    (_, ink_change), (_, ground_change) = sorted(
        (
            own.sum() + shown.sum(),
            np.linalg.norm(np.median(predicted[own], axis=0) - np.median(observed[shown], axis=0)),
        )
        for own, shown in zip(*near, strict=True)
    )
    return bool(ground_change <= MAX_GROUND_CHANGE * step and ink_change <= MAX_INK_CHANGE * step)


def without_gaps(differ: Mask) -> npt.NDArray[np.uint8]:
    """Return a mask as 0 and 1, with gaps of less than 5 px filled and without parts thinner than 3 px."""
    closed = cv2.morphologyEx(differ.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    return np.asarray(cv2.morphologyEx(closed, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)), dtype=np.uint8)


def _is_outlined(template: Plane, steepness: Plane, outline: npt.NDArray[Any]) -> bool:
    """Return whether the template has edges all along a closed line that does not touch its rim."""
    filled = cv2.drawContours(np.zeros(steepness.shape, np.uint8), [outline], -1, 1, -1)
    inner, outer, near, far = (
        change(filled, np.ones((side, side), np.uint8)) > 0
        for change, side in ((cv2.erode, 3), (cv2.dilate, 3), (cv2.dilate, 7), (cv2.dilate, 25))
    )
    rim, beside = outer & ~inner, far & ~near
    if touches_rim(outer) or not rim.any():
        return False
    variance = float(template.var(axis=(0, 1)).sum())
    least = max(MIN_EDGE_OVER_TEXTURE * median(steepness[~outer]), MIN_EDGE_OVER_VARIANCE * variance)
    edges = cv2.dilate(np.asarray(steepness > least, dtype=np.uint8), np.ones((3, 3), np.uint8)) > 0
    return bool(edges[rim].mean() >= MIN_OUTLINED and edges[beside].sum() <= MAX_EDGES_AROUND * beside.sum())


def touches_rim(region: Mask) -> bool:
    """Return whether a region reaches the first or last row or column."""
    return bool(region[[0, -1]].any() or region[:, [0, -1]].any())


def _box(differ: Mask) -> tuple[slice, slice]:
    """Return the rows and columns that contain all differing pixels."""
    rows, cols = (np.flatnonzero(differ.any(axis=axis)) for axis in (1, 0))
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(cols[0]), int(cols[-1]) + 1)


def _is_median(values: Plane, noise: float) -> Mask:
    """Return which of the values (pixels, channels) are of the median colour."""
    return np.asarray(np.abs(values - [median(channel) for channel in values.T]).max(axis=1) <= noise)


def _is_uniform(values: Plane, noise: float) -> bool:
    """Return whether values (pixels, channels) are of one colour."""
    return bool(_is_median(values, noise).mean() >= MIN_IN_REGION)


def _is_cursor(differ: Mask, observed: Plane, noise: float) -> bool:
    rows, cols = _box(differ)
    part = observed[rows, cols]
    # Strokes of letters are shorter than 13 px.
    return part.shape[0] >= 13 and part.shape[1] <= 3 and _is_uniform(part[differ[rows, cols]], noise)


def _is_ring(differ: Mask, observed: Plane, noise: float) -> bool:
    rows, cols = _box(differ)
    part = differ[rows, cols]
    is_large = min(part.shape) >= 4 * MAX_RING_PX and part.size >= 0.4 * differ.size
    inner = part[MAX_RING_PX:-MAX_RING_PX, MAX_RING_PX:-MAX_RING_PX]
    if not is_large or inner.sum() > (1 - MIN_IN_OUTLINE) * part.sum():
        return False
    sides = [side.any(axis=0) for turned in (part, part.T) for side in (turned[:MAX_RING_PX], turned[-MAX_RING_PX:])]
    return all(side.mean() >= 0.4 for side in sides) and _is_uniform(observed[rows, cols][part], noise)


def _is_bar(differ: Mask, observed: Plane, noise: float) -> bool:
    """Return whether the differing pixels are a bar of one or two colours along a whole side of the template."""
    rows, cols = _box(differ)
    part, sides = observed[rows, cols], differ.shape
    is_whole_side = [span.stop - span.start == side for span, side in zip((rows, cols), sides, strict=True)]
    at_rim = [span.start == 0 or span.stop == side for span, side in zip((rows, cols), sides, strict=True)]
    width = min(part.shape[:2])
    is_strip = is_whole_side[0] != is_whole_side[1] and all(at_rim) and 3 <= width <= min(24, 0.4 * min(sides))
    if not is_strip or differ[rows, cols].mean() < 0.75:
        return False
    values = part.reshape(-1, part.shape[2])
    first = _is_median(values, noise)
    return bool(first.mean() >= MIN_IN_REGION) or (bool(first.mean() >= 1 / 3) and _is_uniform(values[~first], noise))


def _is_over_edges(region: Mask, template: Plane, noise: float) -> bool:
    """Return whether a small region is over edges of the template, or at its rim: a mark on plain ground is its own."""
    return bool(region.sum() * MIN_SIZE_RATIO <= region.size) and (
        touches_rim(region) or not _is_uniform(template[region], noise)
    )


def _is_badge(region: Mask, image: Image, row: int, col: int, noise: float) -> bool:
    """Return whether a region is a part of a disc or a pill in the image, of one colour with something in it."""
    rows, cols = (at + corner for at, corner in zip(np.nonzero(region), (row, col), strict=True))
    least, most = 8, 40  # heights of badges, px
    top, left = max(0, int(rows.min()) - most), max(0, int(cols.min()) - most)
    around = image[top : int(rows.max()) + most, left : int(cols.max()) + most]
    own = rows - top, cols - left
    colour = np.array([median(channel) for channel in around[own].T], dtype=np.float32)
    has_colour = np.asarray(np.abs(around - colour).max(axis=2) <= noise, dtype=np.uint8)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(has_colour)
    inside = labels[own][has_colour[own] > 0]
    if not inside.size:
        return False
    disc = 1 + int(np.argmax(np.bincount(inside, minlength=len(stats))[1:]))
    height, width = int(stats[disc, cv2.CC_STAT_HEIGHT]), int(stats[disc, cv2.CC_STAT_WIDTH])
    if not least <= height <= most or not 0.85 * height <= width <= 3 * height:
        return False
    found, _ = cv2.findContours(np.asarray(labels == disc, dtype=np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    filled = cv2.fillConvexPoly(np.zeros(has_colour.shape, np.uint8), cv2.convexHull(np.concatenate(found)), 1)
    fill = float(filled.sum()) / (height * width)
    reached = cv2.dilate(filled, np.ones((5, 5), np.uint8)) > 0
    down, right = (at + corner for at, corner in zip(np.nonzero(filled), (top - row, left - col), strict=True))
    within = (down >= 0) & (down < region.shape[0]) & (right >= 0) & (right < region.shape[1])
    # If fewer pixels differ, the template has that badge too, with another number in it.
    is_new = region[down[within], right[within]].mean() >= 0.5
    return 0.68 <= fill <= 0.95 and bool(is_new and reached[own].mean() >= MIN_IN_OUTLINE)


def _is_arrow(differ: Mask) -> bool:
    rows, cols = _box(differ)
    height, width = rows.stop - rows.start, cols.stop - cols.start
    if height * width * MIN_SIZE_RATIO > differ.size:
        return False
    found, _ = cv2.findContours(differ[rows, cols].astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    filled = cv2.drawContours(np.zeros((height, width), np.uint8), found, -1, 1, -1)
    for scale in (1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0):
        tall, wide = (math.ceil(scale * side) + 2 for side in ARROW[:, ::-1].max(axis=0))
        if abs(tall - height) > 2 + 0.1 * tall or abs(wide - width) > 2 + 0.1 * wide:
            continue
        corners = np.rint(16 * (ARROW * scale + 1)).astype(np.int32)
        arrow = cv2.fillPoly(np.zeros((max(tall, height), max(wide, width)), np.uint8), [corners], 1, cv2.LINE_8, 4)
        shape = cv2.dilate(arrow, np.ones((3, 3), np.uint8))
        shared = int(cv2.matchTemplate(shape, filled, cv2.TM_CCORR).max().round())  # pixels, at the best shift
        if shared >= 0.7 * (int(filled.sum()) + int(shape.sum()) - shared):
            return True
    return False


def _is_tint(differ: Mask, template: Plane, observed: Plane) -> bool:
    """Return whether the differing pixels are whole rows or columns under something translucent of one colour."""
    rows, cols = _box(differ)
    whole_cols, whole_rows = (
        span.stop - span.start == side for span, side in zip((rows, cols), differ.shape, strict=True)
    )
    if whole_cols == whole_rows or differ[rows, cols].mean() < MIN_IN_REGION:
        return False
    below, shown = (plane[rows, cols].reshape(-1, plane.shape[2]) for plane in (template, observed))
    below, shown = (plane - plane.mean(axis=0, dtype=np.float64) for plane in (below, shown))
    gain = float((below * shown).sum()) / max(float(np.square(below).sum()), 1e-12)
    residual = float(np.square(shown - gain * below).sum())
    return 0.4 <= gain <= 1 and residual <= (1 - 0.95) * float(np.square(shown).sum())


def _is_shadow(differ: Mask, template: Plane, observed: Plane) -> bool:
    """Return whether the differing pixels are darker by a share that fades and is the same in all channels."""
    light = template.min(axis=2) > 40  # in darker pixels the share cannot be measured
    shares = np.where(light[:, :, np.newaxis], observed / np.maximum(template, 1), 1)
    share, where = shares.mean(axis=2), differ & light
    if (
        where.sum() < MIN_IN_OUTLINE * differ.sum()
        or not 0.3 <= share[where].min() <= share[where].max() <= 1
        or np.ptp(shares[where], axis=1).max() > 0.08  # it has a colour
        or np.ptp(share[where]) < 0.05  # it does not fade
    ):
        return False
    # A blur of 1.5 px or more makes steps of up to 0.27 of the depth.
    most = max(0.08, 0.3 * float(1 - share[where].min()))
    even = [
        np.abs(np.diff(share, axis=axis))[where[1:] & where[:-1] if axis == 0 else where[:, 1:] & where[:, :-1]] <= most
        for axis in (0, 1)
    ]
    return all(not steps.size or float(steps.mean()) >= MIN_IN_OUTLINE for steps in even)
