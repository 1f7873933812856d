"""Whether a place shows the template itself, or a variant of it: its shape in other colours, or its mirror image."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

import numpy as np

from stereolag.core.inputs import Image
from stereolag.core.jobs import silent
from stereolag.templates.correlation import score_at
from stereolag.templates.patterns import Pattern
from stereolag.templates.result import TemplateMatch, TemplateSearch
from stereolag.templates.score_maps import fft_score_map
from stereolag.templates.verdict import Reason, leads
from stereolag.templates.warping import warped

MOVED = 4
"""A mirror image is searched within the template's side over this number around the place that resembles it."""


def as_given(search: TemplateSearch, image: Image, pattern: Pattern) -> TemplateSearch:
    """Return a search whose clear matches end before the first that fits clearly better with a variant of the template.

    Lighting and cameras change the brightness and contrast of each channel, but never swap channels. Upside down is
    a mirror image turned by 180 degrees.
    """
    if not search.found:
        return search
    clear = 0
    reason: Reason | None = None
    for match in search.matches[: search.clear]:
        reason = _better_variant(image, pattern, match)
        if reason is not None:
            break
        clear += 1
    return replace(search, clear=clear, reason="clear" if clear else reason or search.reason)


def _better_variant(image: Image, pattern: Pattern, match: TemplateMatch) -> Reason | None:
    """Return why a match does not count; None if no variant fits clearly better."""
    upright = (match.scale, match.rotation) == (1.0, 0.0)
    posed = pattern if upright else warped(pattern, match.scale, match.rotation)
    if posed is None:
        return None
    own = score_at(image, posed.deviations, posed.opaque, match.row, match.col)
    if not leads(1.0, own):
        return None
    if pattern.colours.shape[2] == 3 and leads(_in_other_colours(image, posed, match), own):
        return "other_colours"
    return "mirrored" if leads(_mirrored(image, posed, match), own) else None


def _in_other_colours(image: Image, pattern: Pattern, match: TemplateMatch) -> float:
    """Return the best score of a place with the channels in another order."""
    orders = [list(order) for order in permutations(range(3))][1:]
    return max(score_at(image, pattern.deviations[order], pattern.opaque, match.row, match.col) for order in orders)


def _mirrored(image: Image, pattern: Pattern, match: TemplateMatch) -> float:
    """Return the best score of the mirror image around a place."""
    (height, width), (row, col) = pattern.shape, (match.row, match.col)
    down, across = height // MOVED, width // MOVED
    around = image[max(0, row - down) : row + height + down, max(0, col - across) : col + width + across]
    colours, opaque, deviations = pattern.colours[:, ::-1], pattern.opaque[:, ::-1], pattern.deviations[:, :, ::-1]
    mirrored = Pattern(*map(np.ascontiguousarray, (colours, opaque, deviations)))
    return float(np.nanmax(fft_score_map(np.ascontiguousarray(around), mirrored, silent), initial=-1.0))
