"""A template search small enough to do by hand in the browser: both pictures reduced, and every place scored."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Mask, Rgb
from stereolag.core.inputs import Image, as_image
from stereolag.figures.packing import packed_pictures, scores_as_colours
from stereolag.figures.pictures import as_rgb
from stereolag.templates import match_template
from stereolag.templates.patterns import alike, opaque_pixels

PIXELS = 250_000
"""Pixels of the reduced picture: some hundred kilobytes to send, and one screen's width."""

LEAST_SIDE = 12
"""Px; a smaller template shows too little. To avoid that, only a part of the picture is sent."""

LEAST_OPAQUE = 16
"""With fewer fully opaque pixels, those that are at least half opaque count too."""

RIVALS = 3

ScoreMap = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class ReducedSearch:
    """A picture, a template and the score of every place, reduced for the browser.

    Attributes
    ----------
    picture
        (rows, cols, 3) uint8 RGB; each pixel is the mean of factor × factor pixels of the image.
    template
        (height, width, 3) uint8 RGB.
    opaque
        (height, width), the pixels compared.
    score_map
        (rows - height + 1, cols - width + 1) float32, NaN where the window is flat.
    factor
        Image pixels along each side averaged into one.
    row, col
        Image pixel at which the picture begins.
    part
        Whether the picture shows only a part of the image.
    """

    picture: Rgb
    template: Rgb
    opaque: Mask
    score_map: ScoreMap
    factor: int
    row: int
    col: int
    part: bool

    def leaders(self) -> list[tuple[int, int, float]]:
        """Return (row, col, score) of the best places, best first, each at least one template size from the others."""
        left = np.where(np.isnan(self.score_map), -np.inf, self.score_map)
        height, width = self.opaque.shape
        best: list[tuple[int, int, float]] = []
        while len(best) <= RIVALS and np.isfinite(left.max()):
            row, col = (int(place) for place in np.unravel_index(int(left.argmax()), left.shape))
            best.append((row, col, float(left[row, col])))
            left[max(0, row - height + 1) : row + height, max(0, col - width + 1) : col + width] = -np.inf
        return best


def reduced_search(
    image: Image, template: Image, mask: Image | None, *, near: tuple[int, int] | None = None, pixels: int = PIXELS
) -> ReducedSearch:
    """Reduce an image and a template by the same whole factor, and score the template at every place in the image.

    Parameters
    ----------
    image, template, mask
        As in :func:`stereolag.templates.match_template`.
    near
        (row, col) of a place to keep: it falls on a pixel of the reduced picture, and if only a part of the image is
        kept, that part surrounds it.
    pixels
        Approximate number of pixels of the reduced picture.

    Raises
    ------
    ValueError
        If the template is constant, or becomes so when reduced.
    """
    whole, small = as_image(image, "image"), as_image(template, "template")
    opaque = opaque_pixels(small, mask)
    colours, sought = (as_rgb(one[:, :, 0] if one.shape[2] == 1 else one) for one in alike(whole, small))
    wanted = math.ceil(math.sqrt(whole.shape[0] * whole.shape[1] / pixels))
    factor = max(1, min(wanted, min(opaque.shape) // LEAST_SIDE))
    place = near or (0, 0)
    starts, sides = zip(
        *(
            _part(length, least, at, factor, math.sqrt(pixels / (whole.shape[0] * whole.shape[1])))
            for length, least, at in zip(whole.shape[:2], opaque.shape, place, strict=True)
        ),
        strict=True,
    )
    ends = [start + side * factor for start, side in zip(starts, sides, strict=True)]
    picture = _block_means(colours[starts[0] : ends[0], starts[1] : ends[1]], factor)
    reduced, counts = _reduced_template(sought, opaque, factor)
    scores = match_template(picture, reduced, mask=counts.astype(np.uint8), min_score=-1.0).score_map
    assert scores is not None
    part = any(side * factor < length - 2 * factor for side, length in zip(sides, whole.shape[:2], strict=True))
    return ReducedSearch(picture, reduced, counts, scores, factor, starts[0], starts[1], part)


def _part(length: int, least: int, at: int, factor: int, share: float) -> tuple[int, int]:
    """Return the start of the picture along one side, and its number of reduced pixels.

    A picture still far too large at this factor is cut to a part around the place `at`.
    """
    offset = at % factor
    side = (length - offset) // factor
    if share * factor > 1 / math.sqrt(2):
        return offset, side
    kept = min(side, max(round(length * share), 3 * (least // factor)))
    first = min(max(0, (at - offset) // factor + least // factor // 2 - kept // 2), side - kept)
    return offset + first * factor, kept


def _block_means(colours: Rgb, factor: int) -> Rgb:
    rows, cols = colours.shape[0] // factor, colours.shape[1] // factor
    whole = np.ascontiguousarray(colours[: rows * factor, : cols * factor])
    return np.asarray(cv2.resize(whole, (cols, rows), interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _reduced_template(colours: Rgb, opaque: Mask, factor: int) -> tuple[Rgb, Mask]:
    """Return the mean of the opaque pixels of each block, and which blocks count."""
    rows, cols = opaque.shape[0] // factor, opaque.shape[1] // factor
    inner = np.s_[: rows * factor, : cols * factor]
    blocks = opaque[inner].reshape(rows, factor, cols, factor)
    filled = blocks.mean(axis=(1, 3))
    sums = np.where(opaque[..., np.newaxis], colours, 0)[inner].reshape(rows, factor, cols, factor, 3)
    means = sums.sum(axis=(1, 3)) / np.maximum(blocks.sum(axis=(1, 3)), 1)[..., np.newaxis]
    counts = filled == 1
    if np.count_nonzero(counts) < LEAST_OPAQUE:
        counts = filled >= 0.5
    return np.rint(means).astype(np.uint8), counts


def packed_search(search: ReducedSearch, *, name: str, words: dict[str, object]) -> bytes:
    """Return a search as :func:`~stereolag.figures.packing.packed_pictures`: picture, template, opaque pixels, scores.

    Parameters
    ----------
    search
        The search to send.
    name
        Its name in the browser.
    words
        Texts beside it.
    """
    opaque = np.stack([search.opaque * np.uint8(255)] * 3, axis=-1)
    header = {
        "name": name,
        "factor": search.factor,
        "row": search.row,
        "col": search.col,
        "leaders": [{"row": row, "col": col, "score": score} for row, col, score in search.leaders()],
        "words": words,
    }
    return packed_pictures(header, (search.picture, search.template, opaque, scores_as_colours(search.score_map)))
