"""Whether a place has the template's colours, or its shape in others."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations, takewhile

import numpy as np

from stereolag.inputs import Image
from stereolag.templates.correlation import score_at
from stereolag.templates.patterns import Pattern
from stereolag.templates.result import TemplateMatch, TemplateSearch
from stereolag.templates.verdict import leads
from stereolag.templates.warping import warped


def in_its_colours(search: TemplateSearch, image: Image, pattern: Pattern) -> TemplateSearch:
    """Return a search of whose clear matches none fits clearly better with the template's channels in another order.

    Lights and cameras change the brightness and the contrast of each channel; none exchanges two of them.
    """
    if pattern.colours.shape[2] == 1 or not search.found:
        return search
    own = list(takewhile(lambda match: _has_its_colours(image, pattern, match), search.matches[: search.clear]))
    return replace(search, clear=len(own), reason="clear" if own else "other_colours")


def _has_its_colours(image: Image, pattern: Pattern, match: TemplateMatch) -> bool:
    upright = (match.scale, match.rotation) == (1.0, 0.0)
    posed = pattern if upright else warped(pattern, match.scale, match.rotation)
    if posed is None:
        return True
    own, *others = (
        score_at(image, np.ascontiguousarray(posed.deviations[list(order)]), posed.opaque, match.row, match.col)
        for order in permutations(range(3))
    )
    return not leads(max(others), own)
