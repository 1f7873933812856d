"""Panels about a search: scores read under the pointer, the template dragged by hand, and the steps of "sampled".

The interactive counterparts of Figs. 1.6, 1.9 and B.2 to B.4 of the report. Everything runs in the browser; nothing is
sent back.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any, Final

from stereolag.figures import templates as figures
from stereolag.figures.pictures import FRAME, VIRIDIS, fitted, jpeg
from stereolag.templates import TemplateMatch
from stereolag.templates.by_hand import ReducedSearch, ScoreMap, anchors, reduced_search
from stereolag.ui import prose
from stereolag.ui.components import component
from stereolag.ui.packing import packed_score_map, packed_search
from stereolag.ui.pictures import PictureAndTemplate
from stereolag.ui.results import computed, remembered

NAME = "template"
"""Name of the search in the browser: a place clicked on the score map is sent to it."""

_score_map, _template, _funnel = map(component, ("score_map", "template_by_hand", "funnel"))

# The score map

SCORE_MAP_WORDS: Final = {
    "hint": "Hover to read a score; click to compare that place below.",
    "reading": "Row {row}, column {col}: score {score}",
    "flat": "Row {row}, column {col}: flat, no score",
    "stage": "Score map. Arrow keys move the cursor, with Shift by ten; Enter compares that place.",
}


def packed(score_map: ScoreMap, matches: Sequence[TemplateMatch]) -> bytes:
    """Pack the score of every place, NaN if undefined, for :func:`show_score_map`; matches are ringed."""
    return packed_score_map(figures.score_map_png(score_map, matches), score_map, name=NAME, words=SCORE_MAP_WORDS)


def show_score_map(data: bytes) -> None:
    """Show the score map packed by :func:`packed`."""
    _score_map(key="template.score_map", data=data)


# Search by hand


def template_words(search: ReducedSearch) -> dict[str, Any]:
    """Return all texts and colours of the panel; `texts` maps CSS selectors to their text."""
    return {
        "frame": f"rgb{FRAME}",
        "palette": VIRIDIS[::3].tolist(),
        "stage": "The image with the template over it. Arrow keys move the template, with Shift by ten.",
        "texts": {
            ".try": "Drag the template over the image. Warm pixels agree with the window under it, cool ones "
            "disagree; the score is their mean. Where does it peak?",
            ".template figcaption": "Template",
            ".window figcaption": "Window",
            ".products figcaption": "Products",
            ".sum .label": "Score",
            ".map .empty": "The score map fills in as you drag.",
            ".reveal": "Reveal",
            ".clear": "Clear",
            ".hint": "Drag, use the arrow keys (with Shift by ten), or click on the score map. The mean of each colour "
            f"channel is subtracted before multiplying; transparent pixels do not count. {scale_of(search)}",
        },
        "where": "Row {row}, column {col}: {score}",
        "peak": "The peak is at row {row}, column {col}: {score}.",
        "lead": " The best rival reaches {rival}."
        if search.factor == 1
        else " At this scale the best rival reaches {rival}.",
        "nothing": "The image is flat: there is nothing to correlate.",
        "top": "Peak",
        "rival": "Rival",
        "go": "Compare this place",
    }


def scale_of(search: ReducedSearch) -> str:
    """Return how the picture was reduced, in a sentence."""
    part = "Only a part of the image. " if search.part else ""
    if search.factor == 1:
        return f"{part}Every pixel counts."
    return f"{part}Reduced for the browser: each pixel is the mean of {search.factor} × {search.factor}."


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

FUNNEL_WORDS: Final[dict[str, Any]] = {
    "texts": {
        ".try": "“Sampled” does not score every place. It takes one pixel of the template, the anchor, and looks for "
        "its exact colour. Go through the steps, then pick another pixel: the rarer its colour, the fewer places are "
        "left.",
        ".anchor figcaption": "Anchor and the ends of its run",
        ".colours .name": "How often the image holds colours of the template (logarithmic)",
    },
    "steps": ["All pixels", "This colour", "Both ends agree", "Scored"],
    "steps_label": "Steps",
    "said": [
        "Every pixel of the image could be the anchor.",
        "Pixels of exactly this colour, where the template has room around them.",
        "There, both ends of the anchor’s opaque run have the right colours too.",
        "Every place within one pixel of these is scored.",
    ],
    "best": " Best: row {row}, column {col}, score {score}.",
    "none": " None is left: no place has exactly these colours.",
    "many": " Too many: only their count is shown; a rarer colour leaves fewer.",
    "some": " {shown} of them are drawn.",
    "picture": "The image with the pixels that are left at this step.",
    "colours": "Pixel of the template, the rarest colour first. Arrow keys pick another.",
    "colour": "Row {row}, column {col} of the template: {count} pixels of its colour",
    "hint": "Click on a bar or on the template to pick another pixel; arrow keys work too.",
    "nothing": "Every colour of this template is too common in the image.",
}

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
