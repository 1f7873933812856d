"""A box drawn on an image in the browser: with a mouse, a finger, the keyboard, or as numbers."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Final

import streamlit as st

from stereolag.core.inputs import Image
from stereolag.figures.pictures import fitted, jpeg
from stereolag.io.hand_marks import LEAST_SIDE, Box, read_box
from stereolag.ui.linked_pictures import source
from stereolag.ui.results import remembered
from stereolag.ui.states import show_refused

HERE = Path(__file__).parent

SENT_WIDTH: Final = 1200
"""Px; wider images are sent smaller, but the box stays in pixels of the full image."""

# A component of its own, so that moving the box does not send the picture again.
_picture = st.components.v2.component("stereolag.hand_picture", js=source("picture.js", folder=HERE))
_box = st.components.v2.component(
    "stereolag.box",
    html=source("box.html", folder=HERE),
    css=source("box.css", folder=HERE),
    js=source("shown.js") + source("drawn.js", "box.js", folder=HERE),
)


def send_drawn_on(name: str, data: bytes, *, key: str) -> None:
    """Send a PNG or JPEG as the background of the component given the same name."""
    head = name.encode()
    _picture(key=key, data=len(head).to_bytes(2, "little") + head + data)


def box_in(image: Image, *, digest: str, shared: bool, key: str) -> Box:
    """Show an image with a box to drag, and return the box.

    Parameters
    ----------
    image
        The image under the box.
    digest
        Digest of the image; a different image starts with a box in the middle.
    shared
        Whether every visitor may see the image.
    key
        Key of the component.
    """
    before, kept = st.session_state.get(f"{key}.box", ("", None))
    box: Box = kept if before == digest else box_in_the_middle(image.shape)
    if refusal := st.session_state.pop(f"{key}.refusal", None):
        show_refused(refusal)

    def moved() -> None:
        value = st.session_state[key].box
        if value is None:
            return
        try:
            st.session_state[f"{key}.box"] = digest, read_box(value, image.shape)
        except ValueError as error:
            st.session_state[f"{key}.refusal"] = str(error)

    data = remembered("hand picture", lambda: _shown(image), inputs=digest, settings="", shared=shared)
    with st.container(gap=None):
        send_drawn_on(digest, data, key=f"{key}.picture")
        _box(
            key=key,
            data={
                "name": digest,
                "rows": image.shape[0],
                "cols": image.shape[1],
                "least": LEAST_SIDE,
                "box": asdict(box),
            },
            on_box_change=moved,
        )
    return box


def box_in_the_middle(shape: tuple[int, ...]) -> Box:
    """Return a box in the middle of an image, an eighth as wide and a sixth as high, or the minimum size if larger."""
    rows, cols = shape[:2]
    height, width = max(min(LEAST_SIDE, rows), rows // 6), max(min(LEAST_SIDE, cols), cols // 8)
    return Box((rows - height) // 2, (cols - width) // 2, height, width)


def _shown(image: Image) -> bytes:
    return jpeg(fitted(image, SENT_WIDTH))
