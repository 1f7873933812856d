"""Panels about a search: scores read under the pointer, the template dragged by hand, and the steps of "sampled".

The interactive counterparts of Figs. 1.6, 1.9 and B.2 to B.4 of the report. Everything runs in the browser; nothing is
sent back.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import Final

from stereolag.figures import templates as figures
from stereolag.figures.pictures import FRAME, fitted, jpeg
from stereolag.templates import TemplateMatch
from stereolag.templates.by_hand import ScoreMap, anchors, reduced_search
from stereolag.ui import prose
from stereolag.ui.components import component, packed_score_map, packed_search
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


def search_by_hand(inputs: PictureAndTemplate, matches: Sequence[TemplateMatch]) -> None:
    """Show the picture, reduced for the browser, with the template to drag over it.

    Parameters
    ----------
    inputs
        The picture and the template.
    matches
        The matches, best first; the reduction is aligned so that the best one falls on a pixel.
    """
    near = (matches[0].row, matches[0].col) if matches else None

    def pack() -> bytes:
        search = reduced_search(inputs.picture, inputs.template, inputs.mask, near=near)
        return packed_search(search, name=NAME, words=template_words(search))

    try:
        data = remembered("search by hand", pack, inputs=inputs.digest, settings=str(near), shared=inputs.shared)
    except ValueError:
        prose.caption("Too little is left of this template when it is reduced for the browser.")
        return
    _template(key="template.by_hand", data=data)


# Step by step

FUNNEL_WIDTH: Final = 900
"""Width of the picture behind the dots, px."""


def show_funnel(inputs: PictureAndTemplate) -> None:
    """Show the image pixels that remain after each step of the "sampled" search, for any anchor."""
    prose.markdown("### From every pixel to a few")
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
        "picture": _address(jpeg(fitted(inputs.picture, FUNNEL_WIDTH)), "image/jpeg"),
        "template": _address(figures.what_counts(inputs.template, inputs.mask), "image/png"),
        "rows": inputs.picture.shape[0],
        "cols": inputs.picture.shape[1],
        "height": inputs.template.shape[0],
        "width": inputs.template.shape[1],
        "anchors": [asdict(anchor) for anchor in anchors(inputs.picture, inputs.template, inputs.mask)],
        "frame": f"rgb{FRAME}",
        "words": FUNNEL_WORDS,
    }
    return json.dumps(told).encode()


def _address(data: bytes, media_type: str) -> str:
    return f"data:{media_type};base64," + base64.b64encode(data).decode("ascii")
