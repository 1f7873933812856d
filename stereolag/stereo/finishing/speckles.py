"""Detection of small connected surfaces in a map: OpenCV's ``filterSpeckles``, on all cores."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Array, FloatMap, Mask
from stereolag.loops.bands import over_bands, row_bands
from stereolag.loops.compilation import compiled

SIXTEENTHS = 16
NOTHING = -32768


def speckles(disparity: FloatMap, size: int, difference: float) -> Mask:
    """Return which pixels belong to a connected surface of fewer than `size` pixels.

    Neighbours, left and right or above and below, are connected if their disparities, rounded to sixteenths, differ by
    no more than `difference`. Runs of connected pixels in a row are joined where they touch a run of the row above
    (Rosenfeld & Pfaltz 1966, by union-find), band by band; then the seams between the bands are joined.

    Parameters
    ----------
    disparity
        (H, W) float32 px, within ±2047; NaN = none, which is never a speckle.
    size
        Smallest surface that is no speckle, pixels.
    difference
        Largest difference of connected neighbours, px.
    """
    sixteenths, run = np.empty(disparity.shape, np.int32), np.empty(disparity.shape, np.int32)
    parent, pixels = np.empty(disparity.size, np.int32), np.empty(disparity.size, np.int32)
    most, height = round(difference * SIXTEENTHS), disparity.shape[0]

    def connect(first: int, end: int) -> None:
        _find_runs(disparity, most, first, end, sixteenths, run, parent, pixels)
        _join_rows(sixteenths, most, first + 1, end, run, parent)

    over_bands(connect, height)
    for first, _ in row_bands(height, height)[1:]:
        _join_rows(sixteenths, most, first, first + 1, run, parent)
    _count_pixels(run, parent, pixels)
    small = np.empty(disparity.shape, np.bool_)
    over_bands(lambda first, end: _mark_small(run, parent, pixels, size, first, end, small), height)
    return small


@compiled
def _find_runs(
    disparity: FloatMap, most: int, first: int, end: int, sixteenths: Array, run: Array, parent: Array, pixels: Array
) -> None:
    """Label each pixel of rows `first` to `end` with its run, the index of the run's first pixel; -1 for NaN.

    Each run starts as its own parent; `pixels` counts its pixels.
    """
    width = disparity.shape[1]
    for y in range(first, end):
        for x in range(width):
            known = disparity[y, x] == disparity[y, x]
            sixteenths[y, x] = np.int32(np.rint(disparity[y, x] * np.float32(SIXTEENTHS))) if known else NOTHING
        start, before = -1, NOTHING
        for x in range(width):
            here = sixteenths[y, x]
            if here == NOTHING:
                start = -1
            elif start >= 0 and abs(here - before) <= most:
                pixels[start] += 1
            else:
                start = y * width + x
                parent[start], pixels[start] = start, 1
            run[y, x] = start
            before = here


@compiled
def _root(parent: Array, run: int) -> int:
    """Return the run that represents the surface of another, and shorten the path to it."""
    while parent[run] != run:
        parent[run] = parent[parent[run]]
        run = parent[run]
    return run


@compiled
def _join_rows(sixteenths: Array, most: int, first: int, end: int, run: Array, parent: Array) -> None:
    """Join the runs of each row from `first` to `end` with the connected runs of the row above."""
    for y in range(first, end):
        last, last_above = -1, -1
        for x in range(run.shape[1]):
            here, above = run[y, x], run[y - 1, x]
            if here < 0 or above < 0 or (here == last and above == last_above):
                continue
            if abs(sixteenths[y, x] - sixteenths[y - 1, x]) <= most:
                last, last_above = here, above
                one, other = _root(parent, here), _root(parent, above)
                parent[max(one, other)] = min(one, other)


@compiled
def _count_pixels(run: Array, parent: Array, pixels: Array) -> None:
    """Point every run directly at the first run of its surface, and count the pixels of the surface there."""
    width = run.shape[1]
    for y in range(run.shape[0]):
        x = 0
        while x < width:
            start = run[y, x]
            if start < 0:
                x += 1
                continue
            length = pixels[start]
            root = parent[parent[start]]
            parent[start] = root
            if root != start:
                pixels[root] += length
            x += length


@compiled
def _mark_small(run: Array, parent: Array, pixels: Array, size: int, first: int, end: int, small: Mask) -> None:
    """Mark the pixels of rows `first` to `end` whose surface has fewer than `size` pixels."""
    for y in range(first, end):
        last, answer = -1, False
        for x in range(run.shape[1]):
            if run[y, x] != last:
                last = run[y, x]
                answer = last >= 0 and pixels[parent[last]] < size
            small[y, x] = answer


def speckles_reference(disparity: FloatMap, size: int, difference: float) -> Mask:
    """Return the expected result of :func:`speckles`, computed with OpenCV, whose limit is the largest size removed."""
    known = np.isfinite(disparity)
    sixteenths: npt.NDArray[np.int16] = np.full(disparity.shape, NOTHING, np.int16)
    np.rint(disparity * np.float32(SIXTEENTHS), out=sixteenths, where=known, casting="unsafe")
    cv2.filterSpeckles(sixteenths, NOTHING, size - 1, round(difference * SIXTEENTHS))
    return np.asarray(known & (sixteenths == NOTHING))
