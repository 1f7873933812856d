"""Template search from a rare pixel: only places with exactly the template's values are scored."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Indices
from stereolag.core.inputs import Image
from stereolag.core.jobs import Estimate, Progress, check_memory
from stereolag.templates.patterns import Pattern
from stereolag.templates.places import Places
from stereolag.templates.score_maps import scores_at

MAX_ANCHORS = 8
"""Anchors tried, each of another colour, before giving up: some may be covered in the image."""

SAMPLED_PIXELS = 20_000
"""Pixels of the image used to judge the rarity of a colour."""

BYTES_PER_POSITION = 64
"""Memory per position with the anchor's value, for its indices and pixels."""

BATCH_VALUES = 10_000_000
"""Pixel values compared between two progress calls."""


@dataclass(frozen=True)
class AnchorStages:
    """The positions that remain at each stage of the search for an anchor, as rows and columns.

    Parameters
    ----------
    run
        First and last column of the opaque run along the anchor's row.
    coloured
        Positions at which the image has the anchor's exact value.
    agreeing
        Those at which both ends of the run agree too.
    scored
        All positions within a pixel of these.
    """

    run: tuple[int, int]
    coloured: tuple[Indices, Indices]
    agreeing: tuple[Indices, Indices]
    scored: tuple[Indices, Indices]


def exact_positions(
    image: Image, pattern: Pattern, min_score: float, seed: int | None, progress: Progress
) -> tuple[Places, int]:
    """Score the positions at which the image has three exact pixels of the template (Appendix B of the source report).

    The anchor is an opaque pixel of a colour that is rare in the image. Where the image has its value, and
    the two end pixels of the anchor's opaque run along the row agree too, a small grid of positions is scored.
    If none reaches `min_score`, the next rarest colour becomes the anchor; if none ever does, the positions are
    those of the anchor that came closest.

    Parameters
    ----------
    image
        (rows, cols, channels), of the dtype and channels of the pattern.
    pattern
        The template.
    min_score
        The score that ends the search for an anchor.
    seed
        Seed of the image sample used to judge rarity, and of the order of equally rare colours.
    progress
        Called with the fraction done, as if all anchors were needed; 1 at the end.

    Returns
    -------
    The positions, in reading order, and the number of positions scored on the way, including those of failed anchors.
    """
    image = np.ascontiguousarray(image)
    anchors = rare_pixels(image, pattern, seed)
    candidates, best = 0, -math.inf
    found = np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0)
    for attempt, (row, col) in enumerate(anchors):
        rows, cols = anchor_stages(image, pattern, row, col).scored
        candidates += len(rows)
        batch = BATCH_VALUES // pattern.deviations.size + 1
        scores = np.empty(len(rows))
        for start in range(0, len(rows), batch):
            part = slice(start, start + batch)
            scores[part] = scores_at(image, pattern.deviations, pattern.weights, rows[part], cols[part])
            progress((attempt + start / len(rows)) / len(anchors))
        highest = float(np.fmax.reduce(scores, initial=-1.0))
        if highest > best:
            best, found = highest, (rows, cols, scores)
        if best >= min_score:
            break
        progress((attempt + 1) / len(anchors))
    progress(1.0)
    scored = np.isfinite(found[2])
    return Places(found[0][scored], found[1][scored], found[2][scored], pattern.shape), candidates


def rare_pixels(image: Image, pattern: Pattern, seed: int | None, most: int = MAX_ANCHORS) -> list[tuple[int, int]]:
    """Return (row, col) of opaque template pixels of different colours, the rarest in a sample of the image first.

    Parameters
    ----------
    image, pattern, seed
        As for :func:`exact_positions`.
    most
        Largest number of pixels.
    """
    random = np.random.default_rng(seed)
    rows, cols = np.nonzero(pattern.opaque)
    sample_rows, sample_cols = (random.integers(0, length, SAMPLED_PIXELS) for length in image.shape[:2])
    colours, appearances = np.unique(_codes(image[sample_rows, sample_cols]), return_counts=True)
    shuffled = random.permutation(len(rows))
    codes = _codes(pattern.colours[rows[shuffled], cols[shuffled]])
    nearest = np.minimum(np.searchsorted(colours, codes), len(colours) - 1)
    count = np.where(colours[nearest] == codes, appearances[nearest], 0)
    _, first_of_colour = np.unique(codes, return_index=True)
    rarest = first_of_colour[np.lexsort((first_of_colour, count[first_of_colour]))][:most]
    return [(int(rows[index]), int(cols[index])) for index in shuffled[rarest]]


def _codes(pixels: Image) -> npt.NDArray[np.float64]:
    """Return one number for each pixel (pixels, channels); equal colours have equal numbers."""
    weights = 65537.0 ** np.arange(pixels.shape[1])
    return np.asarray((pixels * weights).sum(axis=1))


def anchor_stages(image: Image, pattern: Pattern, row: int, col: int) -> AnchorStages:
    """Return the positions that remain at each stage with the template's pixel (row, col) as the anchor.

    Parameters
    ----------
    image
        (rows, cols, channels), of the dtype and channels of the pattern.
    pattern
        The template; its pixel (row, col) is opaque.

    Raises
    ------
    ValueError
        A value so common that its positions would need more memory than one job may take.
    """
    gaps = np.flatnonzero(~pattern.opaque[row])
    run_start = int(gaps[gaps < col].max(initial=-1)) + 1
    run_end = int(gaps[gaps > col].min(initial=pattern.opaque.shape[1])) - 1
    value = tuple(pattern.colours[row, col].tolist())
    places = image.shape[0] - pattern.shape[0] + 1, image.shape[1] - pattern.shape[1] + 1
    # A position inside the image has its pixel (row, col) inside this part of it.
    marks = cv2.inRange(image[row : row + places[0], col : col + places[1]], value, value)
    check_memory(
        Estimate(BYTES_PER_POSITION * cv2.countNonZero(marks), 0.0),
        hint="No value of the template is rare in this image; the method 'fft' does not depend on that.",
    )
    coloured = rows, cols = _nonzero(marks)
    for end in (run_start, run_end):
        agrees = (image[rows + row, cols + end] == pattern.colours[row, end]).all(axis=1)
        rows, cols = rows[agrees], cols[agrees]
    marks[:] = 0
    marks[rows, cols] = 1
    scored = _nonzero(cv2.dilate(marks, np.ones((3, 3), dtype=np.uint8)))
    return AnchorStages((run_start, run_end), coloured, (rows, cols), scored)


def _nonzero(marks: npt.NDArray[Any]) -> tuple[Indices, Indices]:
    """Return the result of :func:`numpy.nonzero` for a uint8 plane, several times faster."""
    found = cv2.findNonZero(marks)
    cols, rows = np.empty((2, 0), dtype=np.intp) if found is None else found.reshape(-1, 2).T.astype(np.intp)
    return rows, cols
