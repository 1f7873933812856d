"""Template search from a rare pixel: only places with exactly the same values are scored.

Such a place may have rivals that share none of its pixels: the places where the template fits best are found in a
reduced grey image and scored in the full one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.inputs import Image, as_grey
from stereolag.core.jobs import Estimate, Progress, check_memory, silent
from stereolag.templates.patterns import Pattern, grey_pattern, reduced, warped
from stereolag.templates.score_maps import Indices, Scores, elsewhere, fft_score_map, peaks, scores_at

ATTEMPTS = 8
"""Anchors tried, each of another colour, before giving up: some may be covered in the image."""

SAMPLE = 20_000
"""Pixels of the image used to judge the rarity of a colour."""

GRID_REACH = 1
"""The grid of positions scored around a hit extends this far to every side, px."""

HIT_BYTES = 64
"""Bytes per position with the anchor's value, for its indices and pixels."""

BATCH = 10_000_000
"""Pixel values compared between two progress calls."""


@dataclass(frozen=True)
class ExactPlacements:
    """Positions that share exact pixels with the template.

    Parameters
    ----------
    rows, cols
        Top-left pixels, in reading order.
    scores
        -1..1, NaN where flat.
    candidates
        Number of positions scored on the way, including those of failed anchors.
    """

    rows: Indices
    cols: Indices
    scores: npt.NDArray[np.float64]
    candidates: int


@dataclass(frozen=True)
class AnchorStages:
    """The positions left at each stage once an anchor is chosen, as rows and columns.

    Parameters
    ----------
    run
        First and last column of the opaque run along the anchor's row.
    coloured
        Positions at which the image has the anchor's exact value.
    agreeing
        Those at which both ends of the run agree too.
    scored
        All within a small grid around these.
    """

    run: tuple[int, int]
    coloured: tuple[Indices, Indices]
    agreeing: tuple[Indices, Indices]
    scored: tuple[Indices, Indices]


def exact_positions(
    image: Image, pattern: Pattern, min_score: float, seed: int | None, progress: Progress
) -> ExactPlacements:
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
    """
    image = np.ascontiguousarray(image)
    anchors = rare_pixels(image, pattern, seed)
    candidates, best = 0, -math.inf
    nowhere = np.zeros(0, np.intp)
    found = nowhere, nowhere, np.zeros(0)
    for attempt, (row, col) in enumerate(anchors):
        rows, cols = anchor_stages(image, pattern, row, col).scored
        candidates += len(rows)
        batch = BATCH // pattern.deviations.size + 1
        scores = np.empty(len(rows))
        for start in range(0, len(rows), batch):
            part = slice(start, start + batch)
            scores[part] = scores_at(image, pattern.deviations, pattern.opaque, rows[part], cols[part])
            progress((attempt + start / len(rows)) / len(anchors))
        highest = float(np.fmax.reduce(scores, initial=-1.0))
        if highest > best:
            best, found = highest, (rows, cols, scores)
        if best >= min_score:
            break
        progress((attempt + 1) / len(anchors))
    progress(1.0)
    return ExactPlacements(*found, candidates)


def rare_pixels(image: Image, pattern: Pattern, seed: int | None, most: int = ATTEMPTS) -> list[tuple[int, int]]:
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
    sample_rows, sample_cols = (random.integers(0, length, SAMPLE) for length in image.shape[:2])
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
    """Return the positions left at each stage with the template's pixel (row, col) as the anchor.

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
        Estimate(HIT_BYTES * cv2.countNonZero(marks), 0.0),
        hint="No value of the template is rare in this image; the method 'fft' does not depend on that.",
    )
    coloured = rows, cols = _nonzero(marks)
    for end in (run_start, run_end):
        agrees = (image[rows + row, cols + end] == pattern.colours[row, end]).all(axis=1)
        rows, cols = rows[agrees], cols[agrees]
    return AnchorStages((run_start, run_end), coloured, (rows, cols), _grid(rows, cols, places))


def _grid(rows: Indices, cols: Indices, places: tuple[int, int]) -> tuple[Indices, Indices]:
    """Return each position within the grid's reach of any of these once; there are `places` down and across."""
    near = np.zeros(places, dtype=np.uint8)
    near[rows, cols] = 1
    side = 2 * GRID_REACH + 1
    return _nonzero(cv2.dilate(near, np.ones((side, side), dtype=np.uint8)))


def _nonzero(marks: npt.NDArray[Any]) -> tuple[Indices, Indices]:
    """Return the result of :func:`numpy.nonzero` for a uint8 plane, several times faster."""
    found = cv2.findNonZero(marks)
    cols, rows = np.empty((2, 0), dtype=np.intp) if found is None else found.reshape(-1, 2).T.astype(np.intp)
    return rows, cols


REDUCED_SIDE = 28
"""Side of a template in the reduced image, the root of its area, px: enough to tell it from most other places."""


THINNED = 200
"""Least number of template pixels used to judge a place before all are compared."""


def reduction(shape: tuple[int, int]) -> float:
    """Return the factor by which an image may be reduced in the search for a template of that height and width."""
    return max(1.0, min(math.sqrt(shape[0] * shape[1]) / REDUCED_SIDE, min(shape) / 6))


def likely_places(
    image: Image, pattern: Pattern, count: int, least: float | None = None
) -> tuple[Indices, Indices, Scores]:
    """Return rows, columns and scores of about the `count` best places that share no pixel.

    Parameters
    ----------
    image
        (rows, cols, channels), as many channels as the pattern.
    pattern
        The template.
    count
        Number of places.
    least
        Places that score less than this on some 200 of their pixels are left out; None: none are.
    """
    nowhere = np.empty(0, dtype=np.intp), np.empty(0, dtype=np.intp), np.empty(0)
    factor = reduction(pattern.shape)
    grey = grey_pattern(pattern)
    small = None if grey is None else warped(grey, 1 / factor, 0.0)
    if small is None:
        return nowhere
    flat = as_grey(image if image.shape[2] == 3 else image[:, :, 0])
    little = reduced(flat[:, :, np.newaxis], factor)
    if little.shape[0] < small.shape[0] or little.shape[1] < small.shape[1]:
        return nowhere
    score_map = fft_score_map(little, small, silent)
    rows, cols = peaks(score_map, -1.0)
    kept = elsewhere(rows, cols, score_map[rows, cols], small.shape, [], count)
    # The centre of a place is the centre of its reduced copy.
    scaled = flat.shape[0] / little.shape[0], flat.shape[1] / little.shape[1]
    reach = math.ceil(factor / 2) + 1 if factor > 1 else 0
    found = []
    for row, col in zip(rows[kept], cols[kept], strict=True):
        top = round((row + small.shape[0] / 2) * scaled[0] - pattern.shape[0] / 2)
        left = round((col + small.shape[1] / 2) * scaled[1] - pattern.shape[1] / 2)
        near_rows, near_cols = _grid_near(image, pattern, top, left, reach)
        if least is not None:
            kept_near = _thinned_scores(image, pattern, near_rows, near_cols) >= least
            near_rows, near_cols = near_rows[kept_near], near_cols[kept_near]
        if near_rows.size:
            found.append(_best_of(image, pattern, near_rows, near_cols))
    places = [one for one in found if math.isfinite(one[2])]
    if not places:
        return nowhere
    best_rows, best_cols, scores = zip(*places, strict=True)
    return np.array(best_rows, dtype=np.intp), np.array(best_cols, dtype=np.intp), np.array(scores)


def _grid_near(image: Image, pattern: Pattern, row: int, col: int, reach: int) -> tuple[Indices, Indices]:
    """Return the rows and columns of all positions within `reach` px of one, or of the nearest one in the image."""
    last_row, last_col = image.shape[0] - pattern.shape[0], image.shape[1] - pattern.shape[1]
    row, col = min(max(row, 0), last_row), min(max(col, 0), last_col)
    near_rows = np.arange(max(0, row - reach), min(last_row, row + reach) + 1)
    near_cols = np.arange(max(0, col - reach), min(last_col, col + reach) + 1)
    rows, cols = (grid.ravel() for grid in np.meshgrid(near_rows, near_cols, indexing="ij"))
    return rows, cols


def _thinned_scores(image: Image, pattern: Pattern, rows: Indices, cols: Indices) -> Scores:
    """Return the score of each position from some of its opaque pixels, spread over all of them; 0 where flat."""
    inner_rows, inner_cols = np.nonzero(pattern.opaque)
    some = slice(None, None, max(1, len(inner_rows) // THINNED))
    inner_rows, inner_cols = inner_rows[some], inner_cols[some]
    wanted = pattern.colours[inner_rows, inner_cols].astype(np.float64)
    wanted -= wanted.mean(axis=0)
    windows = image[rows[:, np.newaxis] + inner_rows, cols[:, np.newaxis] + inner_cols].astype(np.float64)
    windows -= windows.mean(axis=1, keepdims=True)
    norms = np.linalg.norm(wanted) * np.linalg.norm(windows, axis=(1, 2))
    return np.asarray((windows * wanted).sum(axis=(1, 2)) / np.where(norms > 0, norms, np.inf))


def _best_of(image: Image, pattern: Pattern, rows: Indices, cols: Indices) -> tuple[int, int, float]:
    """Return the best of these positions and its score, NaN if all are flat."""
    scores = scores_at(np.ascontiguousarray(image), pattern.deviations, pattern.opaque, rows, cols)
    if np.isnan(scores).all():
        return int(rows[0]), int(cols[0]), float("nan")
    best = int(np.nanargmax(scores))
    return int(rows[best]), int(cols[best]), float(scores[best])
