"""How the "sampled" search narrows millions of pixels down to a few scored places, step by step.

The interactive counterpart of Appendix B of the report, Figs. B.2 to B.4. Everything
runs in the browser (the script beside this file); nothing is sent back.
"""

from __future__ import annotations

import base64
import json
from dataclasses import asdict
from pathlib import Path

import streamlit as st

from stereolag.figures.pictures import FRAME, fitted, jpeg
from stereolag.figures.templates import what_counts
from stereolag.templates.by_hand import anchors
from stereolag.ui import prose
from stereolag.ui.linked_pictures import source
from stereolag.ui.pictures import PictureAndTemplate
from stereolag.ui.results import computed
from stereolag.ui.search.funnel.words import WORDS

HERE = Path(__file__).parent

WIDTH = 900
"""Width of the picture behind the dots, px."""

_panel = st.components.v2.component(
    "stereolag.funnel",
    html=source("funnel.html", folder=HERE),
    css=source("funnel.css", folder=HERE),
    js=source("shown.js", "numbers.js") + source("funnel.js", folder=HERE),
)


def show_funnel(inputs: PictureAndTemplate) -> None:
    """Show the image pixels that remain after each step of the "sampled" search, for any anchor."""
    prose.markdown("### From every pixel to a few")
    try:
        shown = computed(
            "funnel",
            lambda _: _shown(inputs),
            inputs=inputs.digest,
            settings="",
            shared=inputs.shared,
            label="Looking for rare pixels …",
        )
    except ValueError as error:
        prose.caption(f"“Sampled” cannot search here: {error}")
        return
    _panel(key="template.funnel", data=json.loads(shown))


def _shown(inputs: PictureAndTemplate) -> bytes:
    """Return the data for the browser, as JSON."""
    told = {
        "picture": _address(jpeg(fitted(inputs.picture, WIDTH)), "image/jpeg"),
        "template": _address(what_counts(inputs.template, inputs.mask), "image/png"),
        "rows": inputs.picture.shape[0],
        "cols": inputs.picture.shape[1],
        "height": inputs.template.shape[0],
        "width": inputs.template.shape[1],
        "anchors": [asdict(anchor) for anchor in anchors(inputs.picture, inputs.template, inputs.mask)],
        "frame": f"rgb{FRAME}",
        "words": WORDS,
    }
    return json.dumps(told).encode()


def _address(data: bytes, media_type: str) -> str:
    return f"data:{media_type};base64," + base64.b64encode(data).decode("ascii")
