"""A template search small enough to do by hand: reduced pictures, the best scores of blocks, and the search by anchors.

For the browser, which lets people drag the template, read the score map and follow the "sampled" search step by step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stereolag.core.arrays import Indices, Mask, Rgb
from stereolag.core.inputs import Image, as_image
from stereolag.figures.pictures import as_rgb
from stereolag.templates.exact_pixels import anchor_stages, rare_pixels
from stereolag.templates.patterns import opaque_pixels, pattern_of, reduced, same_channels
from stereolag.templates.places import peaks
from stereolag.templates.score_maps import ScoreMap, best_position
from stereolag.templates.search import match_template

PICTURE_PIXELS = 250_000
"""Pixels of the reduced picture: a few hundred kilobytes to send, and the width of a screen."""

MIN_SIDE_PX = 12
"""Least side of the reduced template; to keep it, only a part of a large picture is sent."""

MIN_OPAQUE_PIXELS = 16
"""With fewer fully opaque pixels, those that are at least half opaque are compared too."""


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
        (rows - height + 1, cols - width + 1) float32, NaN where the window is flat: the scores of the reduced picture,
        or the best score of the whole image in each block of factor × factor places.
    factor
        Image pixels along each side averaged into one.
    row, col
        Image pixel at which the picture begins.
    part
        Whether the picture shows only a part of the image.
    at_full_size
        Whether the scores are those of the whole image.
    """

    picture: Rgb
    template: Rgb
    opaque: Mask
    score_map: ScoreMap
    factor: int
    row: int
    col: int
    part: bool
    at_full_size: bool = False

    @cached_property
    def leaders(self) -> list[tuple[int, int, float]]:
        """Return (row, col, score) of the best place and three rivals, best first, none overlapping another."""
        places = peaks(self.score_map, (self.opaque.shape[0], self.opaque.shape[1]))
        return [(*places.corner(at), float(places.scores[at])) for at in places.best(4)]


def reduced_search(
    image: Image,
    template: Image,
    mask: Image | None,
    *,
    near: tuple[int, int] | None = None,
    score_map: ScoreMap | None = None,
    pixels: int = PICTURE_PIXELS,
) -> ReducedSearch:
    """Reduce an image and a template by the same whole factor, and score the template at every place in the image.

    Parameters
    ----------
    image, template, mask
        As in :func:`stereolag.templates.match_template`.
    near
        (row, col) of a place to keep: it falls on a pixel of the reduced picture, and if only a part of the image is
        kept, that part surrounds it.
    score_map
        The score of every place of the whole image, if known: it is then reduced instead of computed again.
    pixels
        Approximate number of pixels of the reduced picture.

    Raises
    ------
    ValueError
        If the template is constant, or becomes so when reduced.
    """
    whole, given = as_image(image, "image", gaps=True), as_image(template, "template", gaps=True)
    opaque = opaque_pixels(given, mask)
    colours, sought = (
        as_rgb(picture[:, :, 0] if picture.shape[2] == 1 else picture) for picture in same_channels(whole, given)
    )
    wanted = math.ceil(math.sqrt(whole.shape[0] * whole.shape[1] / pixels))
    factor = max(1, min(wanted, min(opaque.shape) // MIN_SIDE_PX))
    starts, sides = zip(
        *(
            _part(length, least, at, factor, math.sqrt(pixels / (whole.shape[0] * whole.shape[1])))
            for length, least, at in zip(whole.shape[:2], opaque.shape, near or (0, 0), strict=True)
        ),
        strict=True,
    )
    ends = [start + side * factor for start, side in zip(starts, sides, strict=True)]
    picture = reduced(colours[starts[0] : ends[0], starts[1] : ends[1]], factor)
    small, counts = _reduced_template(sought, opaque, factor)
    if score_map is None:
        scores = match_template(picture, small, mask=counts.astype(np.uint8), min_score=-1.0).score_map
        assert scores is not None
    else:
        scores = np.full([whole - own + 1 for whole, own in zip(sides, counts.shape, strict=True)], np.float32(np.nan))
        best, _, _ = best_of_blocks(score_map[starts[0] : ends[0], starts[1] : ends[1]], factor)
        known = best[: scores.shape[0], : scores.shape[1]]
        scores[: known.shape[0], : known.shape[1]] = known
    part = any(side * factor < length - 2 * factor for side, length in zip(sides, whole.shape[:2], strict=True))
    return ReducedSearch(
        picture, small, counts, scores, factor, starts[0], starts[1], part, at_full_size=score_map is not None
    )


def _part(length: int, least: int, at: int, factor: int, share: float) -> tuple[int, int]:
    """Return the start of the picture along one side, and its number of reduced pixels.

    A picture that is still far too large at this factor is cut to a part around the place `at`.
    """
    offset = at % factor
    side = (length - offset) // factor
    if share * factor > 1 / math.sqrt(2):
        return offset, side
    kept = min(side, max(round(length * share), 3 * (least // factor)))
    first = min(max(0, (at - offset) // factor + least // factor // 2 - kept // 2), side - kept)
    return offset + first * factor, kept


def _reduced_template(colours: Rgb, opaque: Mask, factor: int) -> tuple[Rgb, Mask]:
    """Return the mean of the opaque pixels of each block, and which blocks are compared."""
    rows, cols = opaque.shape[0] // factor, opaque.shape[1] // factor
    inner = np.s_[: rows * factor, : cols * factor]
    counts = opaque[inner].reshape(rows, factor, cols, factor).sum(axis=(1, 3))
    sums = np.where(opaque[..., np.newaxis], colours, 0)[inner].reshape(rows, factor, cols, factor, 3).sum(axis=(1, 3))
    compared = counts == factor**2
    if np.count_nonzero(compared) < MIN_OPAQUE_PIXELS:
        compared = counts >= factor**2 / 2
    return np.rint(sums / np.maximum(counts, 1)[..., np.newaxis]).astype(np.uint8), compared


MAX_MAP_WIDTH_PX = 700
"""Largest width of the score map as shown."""

BAND_ROWS = 32
"""Rows of blocks processed at a time, so that the map of a large image is never copied as a whole."""


def block_side(score_map: ScoreMap) -> int:
    """Return the number of places along each side that share one pixel of the map shown."""
    return max(1, -(-int(score_map.shape[1]) // MAX_MAP_WIDTH_PX))


def best_of_blocks(score_map: ScoreMap, factor: int) -> tuple[ScoreMap, Indices, Indices]:
    """Return the highest score of each block of factor × factor places, and its row and column offsets.

    Offsets are from the block's top-left corner; a block without scores is NaN.
    """
    bands = [
        _best_of_band(score_map[first : first + factor * BAND_ROWS], factor)
        for first in range(0, score_map.shape[0], factor * BAND_ROWS)
    ]
    best, down, right = (np.concatenate(parts) for parts in zip(*bands, strict=True))
    return best, down, right


def _best_of_band(score_map: ScoreMap, factor: int) -> tuple[ScoreMap, Indices, Indices]:
    rows, cols = (-(-side // factor) for side in score_map.shape)
    padded = np.full((rows * factor, cols * factor), -np.inf, dtype=np.float32)
    padded[: score_map.shape[0], : score_map.shape[1]] = np.nan_to_num(score_map, nan=-np.inf)
    blocks = padded.reshape(rows, factor, cols, factor).swapaxes(1, 2).reshape(rows, cols, factor * factor)
    down, right = np.divmod(blocks.argmax(axis=2), factor)
    best = blocks.max(axis=2)
    return np.where(np.isneginf(best), np.float32(np.nan), best), down, right


MAX_ANCHORS = 24
"""Largest number of template pixels to choose from, each of a different colour."""

MIN_ANCHORS = 8
"""Number of anchors even in large images, and of the rarest colours that are always among them."""

MAX_COMPARISONS = 100_000_000
"""Limit on image pixels times anchors: in larger images fewer anchors are tried."""

MAX_COLOURS = 4096
"""Largest number of colours of a template, the rarest, from which the anchors are taken."""

MAX_DOTS = 600
"""Largest number of dots per stage; if there are more, only every second, third … is shown."""

MAX_PRODUCTS = 30_000_000
"""If scoring the remaining positions takes more pixel products, they are only counted."""


@dataclass(frozen=True)
class Anchor:
    """A pixel of the template, and the image positions that remain at each stage of the search for it.

    Attributes
    ----------
    row, col
        Position of the pixel in the template.
    run
        First and last column of the opaque run along its row.
    colour
        Its red, green and blue, 0..255.
    counts
        Pixels of the image, those of this value, positions where both ends of the run agree too, positions scored.
    dots
        For the last three stages, (row, col) of the anchor in the image; only some if there are many.
    best
        (row, col, score) of the best position; None if no positions remain, or too many to score.
    """

    row: int
    col: int
    run: tuple[int, int]
    colour: tuple[int, int, int]
    counts: tuple[int, int, int, int]
    dots: tuple[list[tuple[int, int]], ...]
    best: tuple[int, int, float] | None


def anchors(image: Image, template: Image, mask: Image | None, *, seed: int | None = 0) -> list[Anchor]:
    """Return the stages for anchors of different colours, in the order in which "sampled" would try them.

    Parameters
    ----------
    image, template, mask, seed
        As in :func:`stereolag.templates.match_template`. If the template has many colours, the rarest are taken, and
        then others evenly from the rest.

    Raises
    ------
    ValueError
        If the template is constant, or image and template differ in dtype.
    """
    large, small = as_image(image, "image", gaps=True), as_image(template, "template", gaps=True)
    searched, colours = same_channels(large, small)
    if searched.dtype != colours.dtype:
        raise ValueError(f"image holds {searched.dtype} and template {colours.dtype} pixels; both must be of one type.")
    searched = np.ascontiguousarray(searched)
    pattern = pattern_of(colours, opaque_pixels(small, mask))
    shown = as_rgb(colours[:, :, 0] if colours.shape[2] == 1 else colours)
    pixels = searched.shape[0] * searched.shape[1]
    most = min(MAX_ANCHORS, max(MIN_ANCHORS, MAX_COMPARISONS // pixels))
    chosen = rare_pixels(searched, pattern, seed, most=MAX_COLOURS)
    if len(chosen) > most:
        later = np.linspace(MIN_ANCHORS, len(chosen) - 1, most - MIN_ANCHORS).astype(int)
        chosen = chosen[:MIN_ANCHORS] + [chosen[at] for at in later]
    found = []
    for row, col in chosen:
        try:
            stages = anchor_stages(searched, pattern, row, col)
        except ValueError:  # too common to search
            continue
        positions = (stages.coloured, stages.agreeing, stages.scored)
        coloured, agreeing, scored = (len(rows) for rows, _ in positions)
        few = scored * pattern.deviations.size <= MAX_PRODUCTS
        red, green, blue = (int(channel) for channel in shown[row, col])
        found.append(
            Anchor(
                row,
                col,
                stages.run,
                (red, green, blue),
                (pixels, coloured, agreeing, scored),
                tuple(_dots(rows + row, cols + col) for rows, cols in positions),
                best_position(searched, pattern, *stages.scored) if few else None,
            )
        )
    return found


def _dots(rows: Indices, cols: Indices) -> list[tuple[int, int]]:
    every = max(1, -(-len(rows) // MAX_DOTS))
    return list(zip(rows[::every].tolist(), cols[::every].tolist(), strict=True))
