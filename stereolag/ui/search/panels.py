"""Panels about a search: scores read under the pointer, the template dragged by hand, and the steps of "sampled".

The interactive counterparts of Figs. 1.6, 1.9 and B.2 to B.4 of the report. Everything runs in the browser; nothing is
sent back.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any, Final

from stereolag.core.searches import TemplateQuery
from stereolag.figures import templates as figures
from stereolag.figures.pictures import FRAME, fitted, jpeg
from stereolag.figures.verdicts import doubtful
from stereolag.templates import TemplateMatch, TemplateSearch
from stereolag.templates.by_hand import Anchor, ScoreMap, anchors, reduced_search
from stereolag.ui import prose
from stereolag.ui.components import component, packed_score_map, packed_search
from stereolag.ui.elements import data_address
from stereolag.ui.inputs import PictureAndTemplate
from stereolag.ui.results import computed, remembered
from stereolag.ui.search.sentences import FUNNEL_WORDS, SCORE_MAP_WORDS, template_words

NAME = "template"
"""Name of the search in the browser: a place clicked on the score map is sent to it."""

_score_map, _template, _funnel = map(component, ("score_map", "template_by_hand", "funnel"))

# The score map


def packed(score_map: ScoreMap, matches: Sequence[TemplateMatch]) -> bytes:
    """Pack the score of every place, NaN if undefined, for :func:`show_score_map`; matches are ringed."""
    return packed_score_map(figures.score_map_png(score_map, matches), score_map, name=NAME, words=SCORE_MAP_WORDS)


def show_score_map(data: bytes) -> None:
    """Show the score map packed by :func:`packed`."""
    _score_map(key="template.score_map", data=data)


# Search by hand


def search_by_hand(inputs: PictureAndTemplate, result: TemplateSearch, query: TemplateQuery) -> None:
    """Show the picture, reduced for the browser, with the template to drag over it and the places found framed.

    The reduction is aligned so that the best place falls on a pixel.
    """
    best = result.best
    framed = [("found", match) for match in result.matches[: result.clear]]
    framed = framed or [("doubtful", match) for match in doubtful(result)]

    def pack() -> bytes:
        near = (max(best.row, 0), max(best.col, 0)) if best else None
        search = reduced_search(inputs.picture, inputs.template, inputs.mask, near=near, score_map=result.score_map)
        places = []
        for kind, match in framed:
            here = replace(match, row=match.row - search.row, col=match.col - search.col)
            corners = figures.corners_of(here, 1 / search.factor, 1, inputs.template.shape)
            places.append({"kind": kind, "corners": corners})
        return packed_search(search, name=NAME, words=template_words(search), places=places)

    try:
        settings = query.model_dump_json()
        data = remembered("search by hand", pack, inputs=inputs.digest, settings=settings, shared=inputs.shared)
    except ValueError:
        prose.caption("Too little is left of this template when it is reduced for the browser.")
        return
    _template(key="template.by_hand", data=data)


# Step by step

FUNNEL_WIDTH: Final = 900
"""Width of the picture behind the dots, px."""


def show_funnel(inputs: PictureAndTemplate, result: TemplateSearch, query: TemplateQuery) -> None:
    """Show the image pixels that remain after each step of the "sampled" search, for any anchor."""
    try:
        shown = computed(
            "funnel",
            lambda _: _funnel_data(inputs),
            inputs=inputs.digest,
            settings="",
            shared=inputs.shared,
            label="Looking for rare pixels …",
        )
    except ValueError as error:
        prose.caption(f"“Sampled” cannot search here: {error}")
        return
    _funnel(key="template.funnel", data=json.loads(shown))


def _funnel_data(inputs: PictureAndTemplate) -> bytes:
    """Return the data for the browser, as JSON."""
    told = {
        "picture": data_address(jpeg(fitted(inputs.picture, FUNNEL_WIDTH))),
        "template": data_address(figures.what_counts(inputs.template, inputs.mask)),
        "rows": inputs.picture.shape[0],
        "cols": inputs.picture.shape[1],
        "height": inputs.template.shape[0],
        "width": inputs.template.shape[1],
        "anchors": [_told(anchor) for anchor in anchors(inputs.picture, inputs.template, inputs.mask)],
        "frame": f"rgb{FRAME}",
        "words": FUNNEL_WORDS,
    }
    return json.dumps(told).encode()


def _told(anchor: Anchor) -> dict[str, Any]:
    """Return an anchor as data for the browser: at the last step one place is left, the best of all that are scored."""
    *narrowed, scored = anchor.counts
    return asdict(anchor) | {"counts": [*narrowed, 1 if anchor.best else narrowed[-1]], "scored": scored}
