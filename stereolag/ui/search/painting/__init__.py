"""A mask painted on a template in the browser: with a mouse, a finger, or the keyboard."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import streamlit as st

from stereolag.core.inputs import Image
from stereolag.figures.pictures import as_rgb, png
from stereolag.io.hand_marks import packed_mask, read_packed_mask
from stereolag.templates.patterns import opaque_pixels
from stereolag.ui import prose
from stereolag.ui.linked_pictures import source
from stereolag.ui.search.cutting import HERE as CUTTING
from stereolag.ui.search.cutting import send_drawn_on
from stereolag.ui.states import show_refused

HERE = Path(__file__).parent

LARGEST_PIXELS: Final = 1_000_000
"""Largest template that can be painted on; a larger one needs a mask from a file."""

_brush = st.components.v2.component(
    "stereolag.brush",
    html=source("brush.html", folder=HERE),
    css=source("brush.css", folder=HERE),
    js=source("shown.js", "numbers.js")
    + source("drawn.js", folder=CUTTING)
    + "\n"
    + source("mask.js", "brush.js", folder=HERE),
)


class PaintedMask(NamedTuple):
    """A mask, above 0 where the template counts, and its digest."""

    pixels: Image
    digest: str


def painted_mask(template: Image, mask: Image | None, *, digest: str, key: str) -> PaintedMask | None:
    """Offer to paint a mask on a template, and return it; None while the template's own is used.

    Parameters
    ----------
    template
        The template to paint on.
    mask
        Its own mask; None to use its alpha channel.
    digest
        Digest of both; a mask painted on another template is discarded.
    key
        Key of the component.
    """
    shape = template.shape[0], template.shape[1]
    before, kept = st.session_state.get(f"{key}.mask", ("", None))
    painted: PaintedMask | None = kept if before == digest else None
    with st.expander("Paint a mask"):
        if shape[0] * shape[1] > LARGEST_PIXELS:
            prose.caption("This template is too large to paint on. You can add a mask among your own files.")
            return painted
        if refusal := st.session_state.pop(f"{key}.refusal", None):
            show_refused(refusal)
        try:
            own = opaque_pixels(template, mask)
        except ValueError:  # the search reports the error
            return painted
        _draw(template, own, own if painted is None else painted.pixels, digest, key)
    return painted


def _draw(template: Image, own: Image, used: Image, digest: str, key: str) -> None:
    def taken() -> None:
        value = st.session_state[key].mask
        if value is None:
            return
        try:
            pixels = read_packed_mask(value, (own.shape[0], own.shape[1]))
        except ValueError as error:
            st.session_state[f"{key}.refusal"] = str(error)
            return
        if np.array_equal(pixels > 0, own):
            st.session_state.pop(f"{key}.mask", None)
        else:
            painted = PaintedMask(pixels, hashlib.sha256(pixels.tobytes()).hexdigest())
            st.session_state[f"{key}.mask"] = digest, painted

    prose.caption("Paint over parts that should not count: background, shadow, anything that varies between places.")
    with st.container(gap=None):
        send_drawn_on(f"{digest} template", png(as_rgb(template)), key=f"{key}.picture")
        _brush(
            key=key,
            data={
                "name": f"{digest} template",
                "rows": own.shape[0],
                "cols": own.shape[1],
                "own": packed_mask(own),
                "used": packed_mask(used),
            },
            on_mask_change=taken,
        )
