"""The "sampled" template search stage by stage, from each of several pixels of the template: how few are scored."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stereolag.figures.pictures import as_rgb
from stereolag.inputs import Image, as_image
from stereolag.templates.correlation import scores_at
from stereolag.templates.exact_pixels import AnchorStages, Indices, anchor_stages, rare_pixels
from stereolag.templates.patterns import Pattern, alike, opaque_pixels, pattern_of

MOST_ANCHORS = 24
"""Pixels of the template that can be picked, each of another colour."""

FEWEST_ANCHORS = 8

MOST_COMPARED = 100_000_000
"""Pixels of the image times anchors: of larger images fewer anchors are tried."""

MOST_COLOURS = 4096
"""Of a template, the rarest, from which the anchors are taken."""

MOST_DOTS = 600
"""Of one stage; from more, every second, third … is shown."""

MOST_PRODUCTS = 30_000_000
"""Where the positions left take more products of pixels, they are counted but not scored."""


@dataclass(frozen=True)
class Anchor:
    """A pixel of the template, and what is left of the image once it is looked for.

    Attributes
    ----------
    row, col
        Of the pixel in the template.
    run
        First and last column of the opaque run along its row.
    colour
        Its red, green and blue, 0..255.
    counts
        Pixels of the image, those of this value, positions where both ends of the run agree too, positions scored.
    dots
        For the last three, (row, col) of pixels of the image that held the anchor; some of them where they are many.
    best
        (row, col, score) of the best position scored; None where none is left, or too many are.
    """

    row: int
    col: int
    run: tuple[int, int]
    colour: tuple[int, int, int]
    counts: tuple[int, int, int, int]
    dots: tuple[list[tuple[int, int]], ...]
    best: tuple[int, int, float] | None


def anchors(image: Image, template: Image, mask: Image | None, *, seed: int | None = 0) -> list[Anchor]:
    """Return the stages from pixels of different colour, in the order in which "sampled" would try them.

    Parameters
    ----------
    image, template, mask, seed
        As :func:`stereolag.templates.match_template` takes them. Of a template of many colours the rarest are taken,
        and others evenly over the rest.

    Raises
    ------
    ValueError
        A template that is constant, or image and template of different type.
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
        except ValueError:  # too common to be looked at
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
