"""The "sampled" template search stage by stage, for several anchors: how few positions are scored."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stereolag.core.inputs import Image, as_image
from stereolag.figures.pictures import as_rgb
from stereolag.templates.correlation import scores_at
from stereolag.templates.exact_pixels import AnchorStages, Indices, anchor_stages, rare_pixels
from stereolag.templates.patterns import Pattern, alike, opaque_pixels, pattern_of

MOST_ANCHORS = 24
"""Most template pixels to choose from, each of a different colour."""

FEWEST_ANCHORS = 8

MOST_COMPARED = 100_000_000
"""Limit on image pixels times anchors: in larger images fewer anchors are tried."""

MOST_COLOURS = 4096
"""Most colours of a template, the rarest, from which the anchors are taken."""

MOST_DOTS = 600
"""Most dots per stage; if there are more, only every second, third … is shown."""

MOST_PRODUCTS = 30_000_000
"""If scoring the remaining positions takes more pixel products, they are only counted."""


@dataclass(frozen=True)
class Anchor:
    """A pixel of the template, and the image positions left at each stage of the search for it.

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
        (row, col, score) of the best position; None if no positions are left, or too many to score.
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
    large, small = as_image(image, "image"), as_image(template, "template")
    searched, colours = alike(large, small)
    if searched.dtype != colours.dtype:
        raise ValueError(f"image holds {searched.dtype} and template {colours.dtype} pixels; both must be of one type.")
    searched = np.ascontiguousarray(searched)
    pattern = pattern_of(colours, opaque_pixels(small, mask))
    shown = as_rgb(colours[:, :, 0] if colours.shape[2] == 1 else colours)
    pixels = searched.shape[0] * searched.shape[1]
    most = min(MOST_ANCHORS, max(FEWEST_ANCHORS, MOST_COMPARED // pixels))
    chosen = rare_pixels(searched, pattern, seed, most=MOST_COLOURS)
    if len(chosen) > most:
        later = np.linspace(FEWEST_ANCHORS, len(chosen) - 1, most - FEWEST_ANCHORS).astype(int)
        chosen = chosen[:FEWEST_ANCHORS] + [chosen[at] for at in later]
    found = []
    for row, col in chosen:
        try:
            stages = anchor_stages(searched, pattern, row, col)
        except ValueError:  # too common to search
            continue
        kept = (stages.coloured, stages.agreeing, stages.scored)
        coloured, agreeing, scored = (len(rows) for rows, _ in kept)
        red, green, blue = (int(channel) for channel in shown[row, col])
        found.append(
            Anchor(
                row,
                col,
                stages.run,
                (red, green, blue),
                (pixels, coloured, agreeing, scored),
                tuple(_dots(rows + row, cols + col) for rows, cols in kept),
                _best(searched, pattern, stages),
            )
        )
    return found


def _dots(rows: Indices, cols: Indices) -> list[tuple[int, int]]:
    every = max(1, -(-len(rows) // MOST_DOTS))
    return list(zip(rows[::every].tolist(), cols[::every].tolist(), strict=True))


def _best(image: Image, pattern: Pattern, stages: AnchorStages) -> tuple[int, int, float] | None:
    rows, cols = stages.scored
    if len(rows) == 0 or len(rows) * pattern.deviations.size > MOST_PRODUCTS:
        return None
    scores = scores_at(image, pattern.deviations, pattern.opaque, rows, cols)
    if np.isnan(scores).all():
        return None
    best = int(np.nanargmax(scores))
    return int(rows[best]), int(cols[best]), float(scores[best])
