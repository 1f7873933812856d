"""The stages shared by the project's own matchers: checks of the matches, speckle filter, filling and median."""

from __future__ import annotations

from typing import Annotated, Any, Protocol, runtime_checkable

import cv2
import numpy as np
from pydantic import Field

from stereolag.core.arrays import Array, EightBit, FloatMap, Mask, ReasonMap
from stereolag.core.inputs import FLAT_TEXTURE, Image, as_eight_bit, grey_level
from stereolag.core.settings import Applies, Settings
from stereolag.loops.bands import over_bands, over_image
from stereolag.loops.compilation import compiled
from stereolag.loops.vector_lanes import (
    LANES,
    are_equal,
    cast,
    item,
    larger,
    larger_unsigned,
    load,
    put,
    saturating_difference,
    smaller,
    splat,
    store,
    where_at_most,
)
from stereolag.stereo.finishing.filling import filled_from_behind
from stereolag.stereo.finishing.surfaces import SurfaceFilling, filled_along_surfaces
from stereolag.stereo.matcher import PixelMatches, Reason, without_outside


class LeftRightCheck(Settings):
    """Left-right check: matching back from the right image must lead to the same pixel."""

    tolerance: int = Field(
        default=1,
        title="Left-right tolerance",
        description="How far from its start a pixel may end when matched to the right image and back, px. Pixels "
        "that fail are mostly hidden from one of the cameras.",
        ge=0,
        le=16,
    )


class AmbiguityTest(Settings):
    """Ambiguity test: a match must clearly beat any other.

    The scores of plain correlation are unbounded: any lead allowed here is small relative to them, and little is
    rejected.
    """

    lead: float = Field(
        default=0.015,
        title="Lead over the next best",
        description="How far the best match must lead every other one farther than 1 px from it: in score or, in "
        "semi-global matching, as a share of the highest cost.",
        ge=0,
        le=2,
        json_schema_extra={"step": 0.005},
    )


class TextureTest(Settings):
    """Texture test: a window must contain something to match."""

    least: float = Field(
        default=1.0,
        title="Least texture",
        description="Standard deviation of the window, in grey levels of 255, below which nothing is measured.",
        ge=0,
        json_schema_extra={"step": 0.5},
    )


def least_texture(test: TextureTest | None, left: Image, right: Image) -> float:
    """Return the standard deviation, in the units of the images, up to which a window is not matched."""
    return (test.least if test else FLAT_TEXTURE) * grey_level(left, right)


NO_MATCH = np.iinfo(np.int16).min
"""Displacement or lag of a pixel of the right image without a match in the left one; it leads out of the frame."""


def left_right_disagree(dx: Array, right_dx: Array, tolerance: int) -> Mask:
    """Return the mask of left pixels whose match in the right image does not lead back to them.

    Parameters
    ----------
    dx
        (H, W) integer displacement of the match of each left pixel, right minus left, px.
    right_dx
        (H, W) integer displacement, with the same sign, of the match of each right pixel; a value that leads far out of
        the frame means none.
    tolerance
        Largest difference at which both agree, px.

    Returns
    -------
    ndarray
        (H, W) bool; also true where the match is out of the frame.
    """
    disagree = np.empty(dx.shape, np.bool_)
    over_bands(lambda first, end: _disagreeing_rows(dx, right_dx, tolerance, first, end, disagree), dx.shape[0])
    return disagree


@compiled(counted=False)
def _disagreeing_rows(dx: Array, right_dx: Array, tolerance: int, first: int, end: int, disagree: Mask) -> None:
    """Process rows `first` to `end` for :func:`left_right_disagree`."""
    width = np.int64(dx.shape[1])
    for y in range(first, end):
        for x in range(width):
            moved = np.int64(dx[y, x])
            place = x + moved
            inside = (place >= 0) & (place < width)
            difference = moved - np.int64(right_dx[y, place if inside else 0])
            disagree[y, x] = (not inside) | (abs(difference) > tolerance)


def left_right_disagree_reference(dx: Array, right_dx: Array, tolerance: int) -> Mask:
    """Return the expected result of :func:`left_right_disagree`, computed with plain NumPy."""
    width = dx.shape[1]
    place = np.arange(width) + dx
    inside = (place >= 0) & (place < width)
    returned = np.take_along_axis(right_dx, np.where(inside, place, 0), axis=1)
    return np.asarray(~inside | (np.abs(returned.astype(np.int64) - dx) > tolerance))


class SpeckleFilter(Settings):
    """Speckle filter: small islands of disparity unlike their surroundings are mismatches."""

    size: int = Field(
        default=100,
        title="Smallest surface",
        description="Connected surfaces of fewer pixels are removed.",
        ge=1,
        le=10_000,
        json_schema_extra={"step": 10},
    )
    difference: float = Field(
        default=2.0,
        title="Connected within",
        description="Largest difference in disparity between neighbours of one surface, px.",
        gt=0,
        le=64,
        json_schema_extra={"step": 0.5},
    )


SPECKLE_UNITS = 16
"""Units of the rounded disparities in one px, as in OpenCV."""

NO_DISPARITY = -32768
"""Rounded disparity of a blank pixel."""

SPECKLE = np.uint8(Reason.SPECKLE)


def without_speckles(disparity: FloatMap, reason: ReasonMap, settings: SpeckleFilter) -> tuple[FloatMap, ReasonMap]:
    """Return the map without its small islands (like OpenCV's ``filterSpeckles``), which become SPECKLE.

    Neighbours, left and right or above and below, are connected if their disparities, rounded to sixteenths, differ by
    no more than the settings allow. Runs of connected pixels in a row are joined where they touch a run of the row
    above (Rosenfeld & Pfaltz 1966, by union-find).

    Parameters
    ----------
    disparity
        (H, W) float32 px, within ±2047; NaN = none, which is never a speckle.
    reason
        (H, W) uint8.
    settings
        Size below which an island is removed, and disparity step that bounds it.
    """
    (height, width), max_step = disparity.shape, round(settings.difference * SPECKLE_UNITS)
    quantised, counts = np.empty(disparity.shape, np.int16), np.empty(height, np.int32)
    runs = np.empty((2, height, width + 1), np.int32)
    over_bands(lambda first, end: _find_runs(disparity, max_step, first, end, quantised, runs, counts), height)
    starts = np.concatenate([[0], np.cumsum(counts)])
    surfaces, pixels = np.arange(starts[-1]), np.zeros(starts[-1], np.int64)
    _join_runs(quantised, max_step, starts, runs, surfaces, pixels)
    kept, reasons = np.empty_like(disparity), np.empty_like(reason)

    def keep(first: int, end: int) -> None:
        kept[first:end], reasons[first:end] = disparity[first:end], reason[first:end]
        _drop_small(runs, pixels, settings.size, starts, first, end, kept, reasons)

    over_bands(keep, height)
    return kept, reasons


@compiled
def _find_runs(
    disparity: FloatMap, max_step: int, first: int, end: int, quantised: Array, runs: Array, counts: Array
) -> None:
    """Round the disparities of rows `first` to `end` to sixteenths, NaN to NO_DISPARITY, and find the runs of each row.

    Set their number in `counts`, and in `runs` the first column of each, from the left, and the column after its last.
    """
    width, blank = disparity.shape[1], np.int16(NO_DISPARITY)
    begins, ends = np.empty(width, np.int32), np.empty(width, np.int32)
    for y in range(first, end):
        row, source = quantised[y], disparity[y]
        for x in range(width):
            known = source[x] == source[x]
            row[x] = np.int16(np.int32(np.rint(source[x] * np.float32(SPECKLE_UNITS)))) if known else blank
        begins[0], ends[0] = row[0] != NO_DISPARITY, 0
        for x in range(1, width):
            before, here = np.int32(row[x - 1]), np.int32(row[x])
            separate = (here == NO_DISPARITY) | (before == NO_DISPARITY) | (abs(here - before) > max_step)
            begins[x], ends[x] = separate & (here != NO_DISPARITY), separate & (before != NO_DISPARITY)
        begun, ended = y * (width + 1), (disparity.shape[0] + y) * (width + 1)
        for x in range(width):
            # Written everywhere and kept where a run begins or ends, without a branch to predict.
            put(runs, begun, x)
            put(runs, ended, x)
            begun += item(begins, x)
            ended += item(ends, x)
        put(runs, ended, width)
        counts[y] = begun - y * (width + 1)


@compiled(counted=False)
def _join_runs(quantised: Array, max_step: int, starts: Array, runs: Array, parent: Array, pixels: Array) -> None:
    """Set the number of pixels of the surface of each run, initially zeros; each run is initially its own `parent`."""
    height = quantised.shape[0]
    for y in range(1, height):
        here = above = 0
        while here < starts[y + 1] - starts[y] and above < starts[y] - starts[y - 1]:
            last, last_above = runs[1, y, here], runs[1, y - 1, above]
            for x in range(max(runs[0, y, here], runs[0, y - 1, above]), min(last, last_above)):
                if abs(np.int32(quantised[y, x]) - np.int32(quantised[y - 1, x])) <= max_step:
                    one, other = _root(parent, starts[y] + here), _root(parent, starts[y - 1] + above)
                    parent[max(one, other)] = min(one, other)
                    break
            # The run that ends first meets no other; if both end together, neither meets another.
            here += last <= last_above
            above += last_above <= last
    for y in range(height):
        for run in range(starts[y + 1] - starts[y]):
            pixels[_root(parent, starts[y] + run)] += runs[1, y, run] - runs[0, y, run]
    for run in range(parent.size):
        pixels[run] = pixels[parent[run]]


@compiled(counted=False)
def _root(parent: Array, run: int) -> int:
    """Return the run that represents the surface of another, and shorten the path to it."""
    while parent[run] != run:
        parent[run] = parent[parent[run]]
        run = parent[run]
    return run


@compiled(counted=False)
def _drop_small(
    runs: Array, pixels: Array, size: int, starts: Array, first: int, end: int, disparity: FloatMap, reason: ReasonMap
) -> None:
    """Blank the runs of rows `first` to `end` whose surface has fewer than `size` pixels."""
    for y in range(first, end):
        for run in range(starts[y + 1] - starts[y]):
            if pixels[starts[y] + run] < size:
                for x in range(runs[0, y, run], runs[1, y, run]):
                    disparity[y, x], reason[y, x] = np.float32(np.nan), SPECKLE


def speckles_reference(disparity: FloatMap, size: int, difference: float) -> Mask:
    """Return the pixels that :func:`without_speckles` drops, from OpenCV, whose limit is the largest size removed."""
    known = np.isfinite(disparity)
    quantised: Array = np.full(disparity.shape, NO_DISPARITY, np.int16)
    np.rint(disparity * np.float32(SPECKLE_UNITS), out=quantised, where=known, casting="unsafe")
    cv2.filterSpeckles(quantised, NO_DISPARITY, size - 1, round(difference * SPECKLE_UNITS))
    return np.asarray(known & (quantised == NO_DISPARITY))


class MedianFilter(Settings):
    """Edge-respecting median: each pixel takes the median disparity of its neighbours of similar colour."""

    radius: int = Field(
        default=6,
        title="Median radius",
        description="Radius of the neighbourhood, px.",
        ge=2,
        le=30,
        multiple_of=2,
    )
    contrast: int = Field(
        default=25,
        title="Median contrast",
        description="Difference of colour, levels of 255, from which a neighbour hardly counts.",
        ge=1,
        le=255,
    )


MEDIAN_UNITS = 256
"""Units of the rounded disparities in one px."""


def weighted_median(values: FloatMap, guide: EightBit, radius: int, spacing: int, contrast: int) -> FloatMap:
    """Return the weighted median of the values on a square grid around each pixel.

    This is the smallest value such that it and all smaller ones have at least half of the total weight. A neighbour
    weighs ``max(1, contrast * channels - difference)``, where the difference is between the guide's pixels, summed over
    its channels.

    Parameters
    ----------
    values
        (H, W) float32; NaN = none: ignored, and stays NaN.
    guide
        (H, W) or (H, W, channels) uint8; channels after the third are ignored.
    radius, spacing
        The neighbours are at -radius, -radius + spacing, ..., radius in both directions, px; `radius` is a multiple of
        `spacing`.
    contrast
        Grey-level difference at which a neighbour loses almost all its weight.

    Returns
    -------
    ndarray
        (H, W) float32, rounded to 1/256.
    """
    guide = np.atleast_3d(guide)[:, :, :3]
    height, width, channels = guide.shape
    low, high = (extreme.reduce(values, axis=None) * MEDIAN_UNITS for extreme in (np.fmin, np.fmax))
    if np.isnan(low):
        return values.copy()
    votes = (2 * (radius // spacing) + 1) ** 2 * contrast * channels
    # Sixteen numbers of 16 bits take half the registers; the lowest number marks a missing value.
    narrow = high - low < np.iinfo(np.uint16).max - 4 and votes <= np.iinfo(np.int16).max
    dtype: type[np.int16 | np.int32] = np.int16 if narrow else np.int32
    middle = round((float(low) + float(high)) / 2)
    # The border has no values, and makes room to load the last sixteen pixels of a row.
    right_border = radius + -width % LANES
    framed = np.full((height + 2 * radius, width + radius + right_border), np.iinfo(dtype).min, dtype)
    planes = np.empty((channels, *framed.shape), np.uint8)
    cv2.split(cv2.copyMakeBorder(guide, radius, radius, radius, right_border, cv2.BORDER_REPLICATE), [*planes])
    out = np.empty(values.shape, np.float32)
    over_image(lambda first, end: _quantise_rows(values, middle, radius, first, end, framed), values.shape)
    over_image(
        lambda first, end: _median_rows(framed, planes, radius, spacing, contrast, middle, first, end, out), out.shape
    )
    return out


@compiled(counted=False)
def _quantise_rows(values: FloatMap, middle: int, radius: int, first: int, end: int, framed: Array) -> None:
    """Set rows `first` to `end`, inside a border of the radius, to 256ths minus `middle`; NaN to the border's value."""
    missing, stop = np.int32(framed[0, 0]), values.shape[1] + radius
    for y in range(first, end):
        row, source = framed[y + radius, radius:stop], values[y]
        for x in range(source.size):
            # Rounding comes before the choice: otherwise the loop does not vectorise.
            value = source[x]
            known = value == value
            number = np.int32(np.rint((value if known else np.float32(0)) * np.float32(MEDIAN_UNITS)))
            row[x] = number - np.int32(middle) if known else missing


@compiled
def _median_rows(
    values: Array,
    planes: Array,
    radius: int,
    spacing: int,
    contrast: int,
    middle: int,
    first: int,
    end: int,
    out: FloatMap,
) -> None:
    """Find the medians of rows `first` to `end`, sixteen pixels at once.

    Parameters
    ----------
    values
        (H, W) inside a border of the radius, 256ths minus `middle`; the lowest number of the dtype marks a missing
        value.
    planes
        (channels, H, W) guide with the same border.
    """
    width, stride = out.shape[1], values.shape[1]
    side = 2 * (radius // spacing) + 1
    numbers, weights = np.empty(side * side * LANES, values.dtype), np.empty(side * side * LANES, values.dtype)
    found = np.empty(width + LANES, values.dtype)
    missing = values[0, 0]
    for y in range(first, end):
        for x in range(0, width, LANES):
            centre, corner = (y + radius) * stride + x + radius, y * stride + x
            store(found, x, _median(values, planes, contrast, centre, corner, side, spacing, numbers, weights))
        for x in range(width):
            known = values[y + radius, x + radius] != missing
            number = np.float32(np.int32(found[x]) + np.int32(middle)) / np.float32(MEDIAN_UNITS)
            out[y, x] = number if known else np.float32(np.nan)


@compiled(counted=False)
def _median(
    values: Array,
    planes: Array,
    contrast: int,
    centre: int,
    corner: int,
    side: int,
    spacing: int,
    numbers: Array,
    weights: Array,
) -> Any:
    """Return the medians of sixteen pixels, by bisecting the range of each.

    Bisection needs no sorting: the weight above a value is a plain sum, the same operation for all pixels. Either half
    begins and ends with a neighbour's value: the unsigned difference of the middle from a number is smallest for the
    next number below the middle, and largest for the next one above. The first neighbour is at `corner`; a missing one
    repeats the central value and gets no weight. If the central value is missing, the range is empty.
    """
    own = load(values, centre)
    nothing, missing = splat(0, values.dtype), splat(values[0, 0], values.dtype)
    low, high, total, one = own, own, nothing, splat(1, values.dtype)
    channels, size = planes.shape[0], planes.shape[1] * planes.shape[2]
    full_weight, at, place = splat(contrast * channels, values.dtype), 0, corner
    for _ in range(side):
        for _ in range(side):
            number, weight = load(values, place), full_weight - _channel_difference(planes, centre, place, values)
            if channels > 1:  # a loop over three takes half as long again
                weight = weight - _channel_difference(planes, size + centre, size + place, values)
                weight = weight - _channel_difference(planes, 2 * size + centre, 2 * size + place, values)
            weight = larger(weight, one)
            weight = where_at_most(number, missing, nothing, weight)
            number = where_at_most(number, missing, own, number)
            store(numbers, at, number)
            store(weights, at, weight)
            low, high = where_at_most(low, number, low, number), larger(high, number)
            total = total + weight
            at += LANES
            place += spacing
        place += (values.shape[1] - side) * spacing
    low, high = where_at_most(own, missing, own, low), where_at_most(own, missing, own, high)
    half = where_at_most(own, missing, total, total >> one)
    while not are_equal(low, high):
        middle, above, nearest, farthest = low + ((high - low) >> one), nothing, nothing - one, nothing
        for at in range(0, side * side * LANES, LANES):
            down = saturating_difference(middle, load(numbers, at))
            above = above + where_at_most(down, nothing - one, load(weights, at), nothing)
            nearest, farthest = smaller(nearest, down), larger_unsigned(farthest, down)
        low, high = (
            where_at_most(above, half, low, middle - farthest),
            where_at_most(above, half, middle - nearest, high),
        )
    return low


@compiled(counted=False)
def _channel_difference(planes: Array, one: int, other: int, values: Array) -> Any:
    """Return the absolute differences of sixteen pixels of a plane from others, in the type of the values."""
    here, there = load(planes, one), load(planes, other)
    darker = smaller(here, there)
    return cast((here - darker) + (there - darker), values.dtype)


def weighted_median_reference(values: FloatMap, guide: EightBit, radius: int, spacing: int, contrast: int) -> FloatMap:
    """Return the expected result of :func:`weighted_median`, pixel by pixel, for values that are whole 256ths."""
    height, width, channels = guide.shape
    out = values.copy()
    for y, x in np.argwhere(np.isfinite(values)):
        votes = sorted(
            (
                float(values[row, col]),
                max(1, contrast * channels - int(np.abs(guide[row, col].astype(int) - guide[y, x]).sum())),
            )
            for row in range(y - radius, y + radius + 1, spacing)
            for col in range(x - radius, x + radius + 1, spacing)
            if 0 <= row < height and 0 <= col < width and np.isfinite(values[row, col])
        )
        weights = np.cumsum([weight for _, weight in votes])
        out[y, x] = votes[int(np.searchsorted(2 * weights, weights[-1]))][0]
    return out


Texture = Annotated[
    TextureTest | None,
    Field(title="Texture test", description="Give no disparity where a window has too little texture."),
]
Ambiguity = Annotated[
    AmbiguityTest | None,
    Field(title="Ambiguity test", description="Give no disparity where another match fits nearly as well."),
]
LeftRight = Annotated[
    LeftRightCheck | None,
    Field(title="Left-right check", description="Give no disparity where the right image's match disagrees."),
]
Speckle = Annotated[
    SpeckleFilter | None,
    Field(title="Speckle filter", description="Drop small islands of disparity that differ from their surroundings."),
]
Filling = Annotated[
    bool, Field(title="Fill gaps", description="Fill pixels that could not be measured from the surface behind.")
]
Surfaces = Annotated[
    SurfaceFilling | None,
    Applies(lambda settings: settings.filling, "needs filling"),
    Field(
        title="Slanted surfaces",
        description="Fill gaps with patches of similar colour, each a slanted plane, not only along the row.",
    ),
]
Median = Annotated[
    MedianFilter | None,
    Field(title="Edge-respecting median", description="Smooth the map where the image is smooth, and only there."),
]


@runtime_checkable
class Finishing(Protocol):
    """Settings of a matcher that finishes its map."""

    @property
    def speckle(self) -> SpeckleFilter | None:
        """Return the speckle filter; None keeps all speckles."""

    @property
    def filling(self) -> bool:
        """Return whether gaps are filled."""

    @property
    def surfaces(self) -> SurfaceFilling | None:
        """Return how gaps are filled with slanted surfaces; None fills them along their rows."""

    @property
    def median(self) -> MedianFilter | None:
        """Return how the map is smoothed; None leaves it unsmoothed."""


def is_finished(settings: Finishing) -> bool:
    """Return whether any of the stages is on."""
    return settings.speckle is not None or settings.filling or settings.median is not None


def finished(found: PixelMatches, left: Image, right: Image, settings: Finishing) -> PixelMatches:
    """Return the map, filtered and filled according to the settings.

    Parameters
    ----------
    found
        The measured matches.
    left, right
        The images; patches and median follow the edges of the left one.
    settings
        The stages to run, and their settings.
    """
    found = without_outside(found, left, right)
    if not is_finished(settings):
        return found
    disparity, reason = found.disparity, found.reason
    if settings.speckle is not None:
        disparity, reason = without_speckles(disparity, reason, settings.speckle)
    if settings.filling:
        measured = disparity
        disparity, reason = filled_from_behind(measured, reason)
        if settings.surfaces is not None:
            disparity = filled_along_surfaces(measured, disparity, _guide(left, right), settings.surfaces)
    if settings.median is not None:
        radius, contrast = settings.median.radius, settings.median.contrast
        disparity = weighted_median(disparity, _guide(left, right), radius, radius // 2, contrast)  # of 5 × 5 pixels
    # After a search in two dimensions only speckles are removed; nothing is filled.
    dy = None if found.dy is None else np.where(np.isnan(disparity), np.float32(np.nan), found.dy)
    return PixelMatches(disparity, reason, found.score, dy)


def _guide(left: Image, right: Image) -> EightBit:
    """Return the left image in 8 bits; alpha, which is not brightness, does not affect the stretching."""
    colours = (image if image.ndim == 2 else image[:, :, :3] for image in (left, right))
    return np.ascontiguousarray(as_eight_bit(*colours)[0])
