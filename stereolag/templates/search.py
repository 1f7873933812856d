"""Template search: the positions of a small image in a larger one."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial
from typing import Any, get_args

import numpy as np
import numpy.typing as npt

from stereolag.estimates import check_memory
from stereolag.inputs import Image, as_image
from stereolag.progress import Progress, silent
from stereolag.searches import TemplateMethod
from stereolag.templates.estimates import estimate_search, fitting_image, has_alpha
from stereolag.templates.exact_pixels import exact_positions
from stereolag.templates.patterns import Pattern, alike, opaque_pixels, pattern_of
from stereolag.templates.score_maps import direct_score_map, fft_score_map

Indices = npt.NDArray[np.intp]


@dataclass(frozen=True)
class TemplateMatch:
    """One position of the template in the image.

    Parameters
    ----------
    row, col
        Of the top-left pixel, px.
    height, width
        Of the template, px.
    score
        Pearson's correlation coefficient, -1..1: 1 for an exact copy, whatever its brightness and contrast.
    """

    row: int
    col: int
    height: int
    width: int
    score: float


@dataclass(frozen=True)
class TemplateSearch:
    """The result of :func:`match_template`.

    Parameters
    ----------
    matches
        Best first, never overlapping by more than half of their area; empty where no score is high enough.
    score_map
        (rows - height + 1, cols - width + 1) float32: the score with the template's top-left pixel at each
        (row, col), NaN where the window is flat. None for "sampled".
    candidates
        Number of positions scored.
    elapsed_s
        Seconds the search took.
    """

    matches: list[TemplateMatch]
    score_map: npt.NDArray[np.float32] | None
    candidates: int
    elapsed_s: float

    @property
    def found(self) -> bool:
        """Whether the template is in the image at all."""
        return bool(self.matches)


def match_template(
    image: npt.ArrayLike,
    template: npt.ArrayLike,
    *,
    method: TemplateMethod = "fft",
    mask: npt.ArrayLike | None = None,
    max_matches: int = 1,
    min_score: float = 0.5,
    seed: int | None = None,
    progress: Progress | None = None,
) -> TemplateSearch:
    """Find a template in an image by the zero-mean normalised cross-correlation (ZNCC).

    Each channel loses its own mean over the compared pixels; products and squares are then summed over all channels
    (Pearson's coefficient, as OpenCV's TM_CCOEFF_NORMED). Its sign counts: a negative of the template is no match.
    Every position fully inside the image is searched.

    Parameters
    ----------
    image
        (rows, cols) grey or (rows, cols, 3 | 4) RGB(A); uint8, uint16 or float. Its alpha is ignored.
    template
        Likewise, no larger than the image. Only its most opaque pixels are compared. Where one of the two is grey,
        the luminance of the other is compared.
    method
        "fft" scores every position, in a time that hardly depends on the size of the template.
        "direct" gives the same by sliding the template along every row: minutes for a photograph.
        "sampled" (Appendix B of the source report) scores only where the image holds the exact values of a rare
        pixel of the template and of the two ends of its opaque run: the fastest, but blind where an image was
        recompressed, rescaled or dimmed, where "fft" still finds the template, and slow in an image of so few
        values that none is rare.
    mask
        (height, width) of the template: its pixels above 0 are compared, whatever the template's alpha.
    max_matches
        The largest number of matches, each a local maximum of the score.
    min_score
        Least score of a match, -1..1.
    seed
        Of the choices of "sampled"; the other methods make none.
    progress
        Called with the fraction done, 0..1.

    Returns
    -------
    TemplateSearch
        `found` is False, and `matches` empty, where no position reaches `min_score`.

    Raises
    ------
    ValueError
        Arrays that are no images, a template larger than the image, a mask of another size, no opaque pixel,
        opaque pixels all of one value, an unknown method, numbers out of their bounds; for "sampled" also image
        and template of different type; more memory needed than one job may take
        (:func:`~stereolag.templates.estimate_search`).
    """
    _check_options(method, max_matches, min_score)
    searched, pattern = _checked(image, template, mask, method)
    report = silent if progress is None else progress
    started = time.perf_counter()
    score_map: npt.NDArray[np.float32] | None = None
    scores: npt.NDArray[np.floating[Any]]
    if method == "sampled":
        _check_same_type(searched, pattern)
        positions = exact_positions(searched, pattern, min_score, seed, report)
        candidates = positions.candidates
        enough = positions.scores >= min_score
        rows, cols, scores = positions.rows[enough], positions.cols[enough], positions.scores[enough]
    else:
        score_map = (fft_score_map if method == "fft" else direct_score_map)(searched, pattern, report)
        candidates = score_map.size
        rows, cols = peaks(score_map, min_score)
        scores = score_map[rows, cols]
    kept = suppress(rows, cols, scores, pattern.shape, max_matches)
    matches = [TemplateMatch(int(rows[i]), int(cols[i]), *pattern.shape, float(scores[i])) for i in kept]
    return TemplateSearch(matches, score_map, candidates, time.perf_counter() - started)


def _check_options(method: str, max_matches: int, min_score: float) -> None:
    if method not in get_args(TemplateMethod):
        raise ValueError(f"method is {method!r}; allowed are {', '.join(map(repr, get_args(TemplateMethod)))}.")
    if max_matches < 1:
        raise ValueError(f"max_matches is {max_matches}; it must be 1 or more.")
    if not -1 <= min_score <= 1:
        raise ValueError(f"min_score is {min_score}; a correlation coefficient lies between -1 and 1.")


def _checked(
    image: npt.ArrayLike, template: npt.ArrayLike, mask: npt.ArrayLike | None, method: TemplateMethod
) -> tuple[Image, Pattern]:
    """Return the image (rows, cols, channels) and the pattern to look for in it, if the search has room for it."""
    large, small = as_image(image, "image"), as_image(template, "template")
    if small.shape[0] > large.shape[0] or small.shape[1] > large.shape[1]:
        raise ValueError(
            f"template is {small.shape[1]} × {small.shape[0]} pixels and image {large.shape[1]} × "
            f"{large.shape[0]}; the template must fit into the image."
        )
    _check_room(large, small, method, masked=mask is not None or has_alpha(small.shape))
    opaque = opaque_pixels(small, None if mask is None else as_image(mask, "mask"))
    large, colours = alike(large, small)
    return large, pattern_of(colours, opaque)


def _check_room(large: Image, small: Image, method: TemplateMethod, *, masked: bool) -> None:
    check_memory(
        estimate_search(large.shape, small.shape, dtype=large.dtype, method=method, masked=masked),
        partial(
            fitting_image,
            image_shape=large.shape,
            template_shape=small.shape,
            dtype=large.dtype,
            method=method,
            masked=masked,
        ),
    )


def _check_same_type(large: Image, pattern: Pattern) -> None:
    if large.dtype != pattern.colours.dtype:
        raise ValueError(
            f"image holds {large.dtype} and template {pattern.colours.dtype} pixels; "
            "the method 'sampled' compares exact values and needs one type (or use 'fft')."
        )


Scores = npt.NDArray[np.floating[Any]]


ROWS_AT_ONCE = 256
"""Rows of a score map searched for peaks at a time: indices of every pixel take ten times the memory of a map."""


def peaks(score_map: Scores, min_score: float) -> tuple[Indices, Indices]:
    """Return rows and columns of the local maxima of at least `min_score`: no neighbour scores higher.

    The slopes of a peak are left out, so that they do not return as matches just outside its suppressed half.
    NaN is never a peak.
    """
    found = [
        _peaks_of_rows(score_map, first, first + ROWS_AT_ONCE, min_score)
        for first in range(0, len(score_map), ROWS_AT_ONCE)
    ]
    return np.concatenate([rows for rows, _ in found]), np.concatenate([cols for _, cols in found])


def _peaks_of_rows(score_map: Scores, first: int, end: int, min_score: float) -> tuple[Indices, Indices]:
    """Return the peaks of the rows from `first` to `end`; those next to them are looked at too."""
    rows, cols = np.divmod(np.flatnonzero(score_map[first:end] >= min_score), score_map.shape[1])
    rows += first
    own = score_map[rows, cols]
    last_row, last_col = score_map.shape[0] - 1, score_map.shape[1] - 1
    highest = np.ones(len(rows), dtype=np.bool_)
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            neighbour = score_map[np.clip(rows + down, 0, last_row), np.clip(cols + right, 0, last_col)]
            highest &= ~(neighbour > own)
    return rows[highest], cols[highest]


def suppress(rows: Indices, cols: Indices, scores: Scores, shape: tuple[int, int], max_matches: int) -> list[int]:
    """Return the indices of the positions kept, best first: each removes all that it overlaps by more than half.

    Positions are rectangles of `shape` (height, width) with their top-left pixel at (row, col); of equal scores
    the first listed wins.
    """
    height, width = shape
    left = np.argsort(-scores, kind="stable")
    kept: list[int] = []
    while left.size and len(kept) < max_matches:
        best = left[0]
        kept.append(int(best))
        shared_rows = np.maximum(height - np.abs(rows[left] - rows[best]), 0)
        shared_cols = np.maximum(width - np.abs(cols[left] - cols[best]), 0)
        left = left[2 * shared_rows * shared_cols <= height * width]
    return kept
