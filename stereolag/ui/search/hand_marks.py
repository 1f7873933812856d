"""A template cut from an image and a mask painted on it in the browser, with a mouse, a finger or the keyboard.

A box may also be typed as numbers.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict
from functools import partial
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import streamlit as st

from stereolag.core.arrays import Box
from stereolag.core.inputs import Image
from stereolag.figures.pictures import as_rgb, fitted, jpeg, png
from stereolag.templates.patterns import opaque_pixels
from stereolag.ui import prose
from stereolag.ui.components import component, deliver, packed_item
from stereolag.ui.elements import show_refused
from stereolag.ui.results import remembered
from stereolag.ui.uploads import Upload

LEAST_SIDE: Final = 4
"""Px; a smaller template fits nearly everywhere."""


def read_box(value: object, image_shape: tuple[int, ...]) -> Box:
    """Return the box described by {"row", "col", "height", "width"}.

    Raises
    ------
    ValueError
        Anything but four whole numbers, sides below :data:`LEAST_SIDE`, or a box that leaves the image.
    """
    rows, cols = image_shape[:2]
    heights, widths = range(LEAST_SIDE, rows + 1), range(LEAST_SIDE, cols + 1)
    allowed = {"row": range(rows), "col": range(cols), "height": heights, "width": widths}
    given = value if isinstance(value, Mapping) else {}
    if given.keys() == allowed.keys() and all(given[name] in numbers for name, numbers in allowed.items()):
        box = Box(**{name: int(given[name]) for name in allowed})
        if box.row + box.height <= rows and box.col + box.width <= cols:
            return box
    raise ValueError(
        "The box needs a row, a column, a height and a width in whole pixels, within the image of "
        f"{cols} × {rows} and at least {LEAST_SIDE} × {LEAST_SIDE}."
    )


def packed_mask(mask: npt.NDArray[Any]) -> str:
    """Return a mask as base64 text: one bit per pixel, row by row, 1 for pixels that count."""
    return base64.b64encode(np.packbits(mask > 0).tobytes()).decode("ascii")


def read_packed_mask(value: object, shape: tuple[int, int]) -> npt.NDArray[np.uint8]:
    """Return the mask encoded by :func:`packed_mask`, 255 where the template counts and 0 elsewhere.

    Parameters
    ----------
    value
        The text. Its length is checked before it is decoded.
    shape
        (height, width) of the template.

    Raises
    ------
    ValueError
        Not such a text for that size, or a mask with fewer than two pixels that count.
    """
    height, width = shape
    size = -(-height * width // 8)
    data = b""
    if isinstance(value, str) and len(value) == 4 * -(-size // 3):
        with suppress(ValueError):
            data = base64.b64decode(value, validate=True)
    if len(data) != size:
        raise ValueError(f"The painted mask does not have {width} × {height} pixels.")
    bits = np.unpackbits(np.frombuffer(data, dtype=np.uint8), count=height * width)
    if int(bits.sum()) < 2:
        raise ValueError("Everything is painted over; at least 2 pixels must count.")
    return bits.reshape(height, width) * np.uint8(255)


SENT_WIDTH: Final = 1200
"""Px; wider images are sent smaller, but the box stays in pixels of the full image."""

LARGEST_PIXELS: Final = 1_000_000
"""Largest template that can be painted on; a larger one needs a mask from a file."""

_box, _brush = map(component, ("box", "brush"))


def _send_picture(name: str, data: bytes, *, key: str) -> None:
    """Send a PNG or JPEG as the background of the component given the same name."""
    deliver(packed_item({"kind": "drawn-on", "name": name, "digest": name}, [data]).data, key=key)


def _keep_what_came(key: str, name: str, digest: str, read: Callable[[object], object]) -> None:
    """Keep what a component has sent under a name, as read for inputs with this digest, or why it is refused."""
    value = getattr(st.session_state[key], name)
    if value is None:
        return
    try:
        st.session_state[f"{key}.kept"] = digest, read(value)
    except ValueError as error:
        st.session_state[f"{key}.refusal"] = str(error)


def _kept(key: str, digest: str) -> Any:
    """Return what is kept for these inputs, or None; show why what came last is refused."""
    if refusal := st.session_state.pop(f"{key}.refusal", None):
        show_refused(refusal)
    before, kept = st.session_state.get(f"{key}.kept", ("", None))
    return kept if before == digest else None


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
    box: Box = _kept(key, digest) or box_in_the_middle(image.shape)
    make = partial(jpeg, fitted(image, SENT_WIDTH))
    data = remembered("hand picture", make, inputs=digest, settings="", shared=shared)
    with st.container(gap=None):
        _send_picture(digest, data, key=f"{key}.picture")
        _box(
            key=key,
            data={
                "name": digest,
                "rows": image.shape[0],
                "cols": image.shape[1],
                "least": LEAST_SIDE,
                "box": asdict(box),
            },
            on_box_change=partial(_keep_what_came, key, "box", digest, partial(read_box, image_shape=image.shape)),
        )
    return box


def box_in_the_middle(shape: tuple[int, ...]) -> Box:
    """Return a box in the middle of an image, an eighth as wide and a sixth as high, or the minimum size if larger."""
    rows, cols = shape[:2]
    height, width = max(min(LEAST_SIDE, rows), rows // 6), max(min(LEAST_SIDE, cols), cols // 8)
    return Box((rows - height) // 2, (cols - width) // 2, height, width)


def painted_mask(template: Image, mask: Image | None, *, digest: str, key: str) -> Upload[Image] | None:
    """Offer to paint a mask on a template, and return it; None while the template's own is used.

    It is above 0 where the template counts.

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
    with st.expander("Paint a mask"):
        painted: Upload[Image] | None = _kept(key, digest)
        if shape[0] * shape[1] > LARGEST_PIXELS:
            prose.caption("This template is too large to paint on. You can add a mask among your own files.")
            return painted
        try:
            own = opaque_pixels(template, mask)
        except ValueError:  # the search reports the error
            return painted
        _show_brush(template, own, own if painted is None else painted.content, digest, key)
    return painted


def _show_brush(template: Image, own: Image, used: Image, digest: str, key: str) -> None:
    def read(value: object) -> Upload[Image] | None:
        pixels = read_packed_mask(value, (own.shape[0], own.shape[1]))
        as_before = np.array_equal(pixels > 0, own)
        return None if as_before else Upload(hashlib.sha256(pixels.tobytes()).hexdigest(), pixels)

    prose.caption("Paint over parts that should not count: background, shadow, anything that varies between places.")
    with st.container(gap=None):
        _send_picture(f"{digest} template", png(as_rgb(template)), key=f"{key}.picture")
        _brush(
            key=key,
            data={
                "name": f"{digest} template",
                "rows": own.shape[0],
                "cols": own.shape[1],
                "own": packed_mask(own),
                "used": packed_mask(used),
            },
            on_mask_change=partial(_keep_what_came, key, "mask", digest, read),
        )
