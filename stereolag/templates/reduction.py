"""The places where a template fits best, found in a reduced grey image and scored in the full one."""

from __future__ import annotations

import math

import numpy as np

from stereolag.core.inputs import Image, as_grey
from stereolag.core.jobs import silent
from stereolag.templates.correlation import scores_at
from stereolag.templates.patterns import Pattern
from stereolag.templates.peaks import Indices, Scores, elsewhere, peaks
from stereolag.templates.score_maps import fft_score_map
from stereolag.templates.warping import grey_pattern, reduced, warped

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
