"""The inputs of the page Rocketman search: examples or own files, and templates and masks made in the browser.

With a mouse, a finger or the keyboard, a template is cut from an image, and a mask is painted on it; the box can also
be typed as numbers.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any, Final

import numpy as np
import streamlit as st

from stereolag import read_image, samples
from stereolag.core.arrays import Array, Box
from stereolag.core.inputs import Image, as_image
from stereolag.core.searches import TemplateQuery
from stereolag.figures.pictures import as_rgb, fitted, jpeg, png
from stereolag.templates.patterns import opaque_pixels
from stereolag.templates.search import check_fits
from stereolag.ui import prose
from stereolag.ui.addresses import Address, example_choice
from stereolag.ui.components import component, deliver, packed_item
from stereolag.ui.controls import adopt_values, persistent
from stereolag.ui.elements import in_columns, show_refused
from stereolag.ui.navigation import head, show_try_first
from stereolag.ui.results import Inputs, remembered
from stereolag.ui.uploads import (
    LIVE,
    OWN,
    Upload,
    choose,
    image_limits,
    in_fold,
    own_or_example,
    put_together,
    show_limits,
    upload_picture,
)

PICTURES = "pictures"


@dataclass(frozen=True, eq=False)
class PictureAndTemplate(Inputs):
    """An image, the template to find in it, and a mask: above 0 where the template counts, None to use its alpha.

    `place` is the (row, col) of the template's top-left pixel, known for an example and for a template cut from the
    image. `by_hand` names the parts of an example that the visitor replaced; such inputs are not shared.
    """

    picture: Image
    template: Image
    mask: Image | None = None
    place: tuple[int, int] | None = None
    by_hand: tuple[str, ...] = ()

    @property
    def own(self) -> bool:
        """Return whether the image is the visitor's own."""
        return not self.shared and not self.by_hand


def choose_pictures() -> PictureAndTemplate | None:
    """Ask for the image, the template and the file of its mask; return None if a camera is chosen instead."""
    examples = samples.mazes()
    with head("Rocketman search"):
        chosen = choose(examples, key=PICTURES, live="Camera")
        show_try_first(
            {
                LIVE: "start the camera, draw a box around something, and move it about.",
                OWN: "drag the template over the image, then *Damage it* until it is no longer found.",
            }.get(chosen, "drag him over the image; then find him in moon dust.")
        )
        if chosen == LIVE:
            return None
        names = {
            "given": "Template: a file" if chosen == OWN else "The example’s template",
            "cut": "Cut from the image",
        }
        template_from = st.segmented_control(
            "Template",
            names,
            default="given",
            format_func=names.__getitem__,
            required=True,
            **persistent(f"{PICTURES}.from"),
            label_visibility="collapsed",
        )
    cut = template_from == "cut"
    return own_or_example(
        chosen,
        _own_cut if cut else _own_pictures,
        _example_cut if cut else example_pictures,
        examples,
        key=PICTURES,
        awaited="your image is" if cut else "both images are",
    )


def with_painted_mask(inputs: PictureAndTemplate) -> PictureAndTemplate:
    """Offer to paint a mask on the template, and return the inputs with the painted mask, if any."""
    painted = painted_mask(inputs.template, inputs.mask, digest=inputs.digest, key=f"{PICTURES}.painted")
    if painted is None:
        return inputs
    return replace(
        inputs,
        mask=painted.content,
        digest=f"{inputs.digest} painted {painted.digest}",
        shared=False,
        by_hand=() if inputs.own else (*inputs.by_hand, "mask you painted"),
    )


@st.cache_resource(show_spinner="Loading the example …")
def example_pictures(name: str) -> PictureAndTemplate:
    """Return one of the bundled images with its template."""
    example = samples.mazes()[name]
    return PictureAndTemplate(
        example.description,
        f"maze {name}",
        True,
        read_image(example.picture),
        read_image(example.template),
        place=(example.row, example.col),
    )


@in_fold(PICTURES)
def _own_pictures() -> PictureAndTemplate | None:
    """Ask for two files and an optional mask; return the last ones that fit together."""
    asked = (
        ("picture", "Image", ""),
        (
            "template",
            "Template",
            "The thing to find, cut from the image or at the same scale. Transparent parts do not count.",
        ),
        (
            "mask",
            "Mask of the template (optional)",
            "An image of the template’s size, black where the template does not count, as around a cursor or a logo. "
            "It replaces the template’s own transparency.",
        ),
    )
    picture, template, mask = (
        upload_picture(label, key=f"{PICTURES}.{name}", note=note) for name, label, note in in_columns(asked)
    )
    show_limits(image_limits())
    if picture is None or template is None:
        return put_together(None, f"{PICTURES}.own")
    return put_together(lambda: _together(picture, template, mask), f"{PICTURES}.own")


@in_fold(PICTURES)
def _own_cut() -> PictureAndTemplate | None:
    """Ask for an image file, and for a box in it."""
    picture = upload_picture("Image", key=f"{PICTURES}.picture")
    show_limits(image_limits())
    if picture is None:
        return None
    return _cut(as_image(picture.content, "image", gaps=True), "Your own image.", picture.digest, shared=False)


def _example_cut(name: str) -> PictureAndTemplate:
    example = example_pictures(name)
    return _cut(example.picture, example.description, example.digest, shared=True)


def _cut(image: Image, description: str, digest: str, *, shared: bool) -> PictureAndTemplate:
    """Ask for a box in an image, whose pixels become the template; the result is not shared."""
    box = box_in(image, digest=digest, shared=shared, key=f"{PICTURES}.cut")
    return PictureAndTemplate(
        f"{description} The cut-out finds itself: ask for more matches, or damage the image below.",
        f"{digest} cut {box.row} {box.col} {box.height} {box.width}",
        False,
        image,
        image[box.slices],
        place=(box.row, box.col),
        by_hand=("template you cut out",) if shared else (),
    )


def _together(picture: Upload[Image], template: Upload[Image], mask: Upload[Image] | None) -> PictureAndTemplate:
    """Return image, template and mask together; ValueError if the template does not fit the image or the mask."""
    image, small = (
        as_image(one.content, name, gaps=True) for one, name in ((picture, "image"), (template, "template"))
    )
    check_fits(image, small)
    return PictureAndTemplate(
        description="Your own images.",
        digest=" ".join(one.digest for one in (picture, template, mask) if one),
        shared=False,
        picture=image,
        template=small,
        mask=None if mask is None else _fitting_mask(mask.content, small),
    )


def _fitting_mask(mask: Image, template: Image) -> Image:
    if mask.shape[:2] != template.shape[:2]:
        (height, width), (rows, cols) = mask.shape[:2], template.shape[:2]
        raise ValueError(
            f"The mask is {width} × {height} and the template {cols} × {rows} pixels; they must have the same size."
        )
    colours = mask if mask.ndim == 2 else mask[:, :, :3]
    if not (colours > 0).any():
        raise ValueError("The mask is black all over; it must be brighter where the template counts.")
    return mask


TEMPLATE_ADDRESS: Address[PictureAndTemplate | None] = Address(
    "template.address",
    lambda: {"picture": example_choice(PICTURES, samples.mazes(), LIVE)},
    lambda inputs: {"": TemplateQuery()},
    lambda query, inputs: adopt_values(query, "template.{}".format),
)


# Drawn by hand

MIN_SIDE: Final = 4
"""Smallest side of a template cut by hand, px: a smaller one fits nearly everywhere."""


def read_box(value: object, image_shape: tuple[int, ...]) -> Box:
    """Return the box described by {"row", "col", "height", "width"}.

    Raises
    ------
    ValueError
        Anything but four whole numbers, a side below :data:`MIN_SIDE`, or a box that leaves the image.
    """
    rows, cols = image_shape[:2]
    heights, widths = range(MIN_SIDE, rows + 1), range(MIN_SIDE, cols + 1)
    allowed = {"row": range(rows), "col": range(cols), "height": heights, "width": widths}
    given = value if isinstance(value, Mapping) else {}
    if given.keys() == allowed.keys() and all(given[name] in numbers for name, numbers in allowed.items()):
        box = Box(**{name: int(given[name]) for name in allowed})
        if box.row + box.height <= rows and box.col + box.width <= cols:
            return box
    raise ValueError(
        "The box needs a row, a column, a height and a width in whole pixels, within the image of "
        f"{cols} × {rows} and at least {MIN_SIDE} × {MIN_SIDE}."
    )


def packed_mask(mask: Array) -> str:
    """Return a mask as base64 text: one bit per pixel, row by row, 1 for pixels that count."""
    return base64.b64encode(np.packbits(mask > 0).tobytes()).decode("ascii")


def read_packed_mask(value: object, shape: tuple[int, int]) -> Image:
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
        Not a mask of that size, or a mask with fewer than two pixels that count.
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


MAX_SENT_WIDTH: Final = 1200
"""Width above which an image is reduced for the browser, px; the box stays in pixels of the full image."""

MAX_PAINTED_PIXELS: Final = 1_000_000
"""Number of pixels of a template above which it cannot be painted on; a larger one needs a mask from a file."""


def _send_picture(name: str, data: bytes, *, key: str) -> None:
    """Send a PNG or JPEG as the background of the component that has the same name."""
    deliver(packed_item({"kind": "drawn-on", "name": name, "digest": name}, [data]).data, key=key)


def _keep_sent(key: str, name: str, digest: str, read: Callable[[object], object]) -> None:
    """Keep the value that a component sent under a name, as read for inputs with this digest, or why it is refused."""
    value = getattr(st.session_state[key], name)
    if value is None:
        return
    try:
        st.session_state[f"{key}.kept"] = digest, read(value)
    except ValueError as error:
        st.session_state[f"{key}.refusal"] = str(error)


def _kept(key: str, digest: str) -> Any:
    """Return the value kept for these inputs, or None; show why the last one sent was refused, if it was."""
    if refusal := st.session_state.pop(f"{key}.refusal", None):
        show_refused(refusal)
    kept_digest, kept = st.session_state.get(f"{key}.kept", ("", None))
    return kept if kept_digest == digest else None


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
    data = remembered(
        "hand picture", lambda: jpeg(fitted(image, MAX_SENT_WIDTH)), inputs=digest, settings="", shared=shared
    )
    with st.container(gap=None):
        _send_picture(digest, data, key=f"{key}.picture")
        component("box")(
            key=key,
            data={
                "name": digest,
                "rows": image.shape[0],
                "cols": image.shape[1],
                "least": MIN_SIDE,
                "box": asdict(box),
            },
            on_box_change=partial(_keep_sent, key, "box", digest, partial(read_box, image_shape=image.shape)),
        )
    return box


def box_in_the_middle(shape: tuple[int, ...]) -> Box:
    """Return a box in the middle of an image, an eighth as wide and a sixth as high, or the minimum size if larger."""
    rows, cols = shape[:2]
    height, width = max(min(MIN_SIDE, rows), rows // 6), max(min(MIN_SIDE, cols), cols // 8)
    return Box((rows - height) // 2, (cols - width) // 2, height, width)


def painted_mask(template: Image, mask: Image | None, *, digest: str, key: str) -> Upload[Image] | None:
    """Offer to paint a mask on a template, and return it; None while the template's own mask is used.

    The mask is above 0 where the template counts.

    Parameters
    ----------
    template
        The template to paint on.
    mask
        The template's own mask; None to use its alpha channel.
    digest
        Digest of template and mask; a mask painted on another template is discarded.
    key
        Key of the component.
    """
    shape = template.shape[0], template.shape[1]
    with st.expander("Paint a mask"):
        painted: Upload[Image] | None = _kept(key, digest)
        if shape[0] * shape[1] > MAX_PAINTED_PIXELS:
            prose.caption("This template is too large to paint on. You can upload a mask with your own files.")
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
        unchanged = np.array_equal(pixels > 0, own)
        return None if unchanged else Upload(hashlib.sha256(pixels.tobytes()).hexdigest(), pixels)

    prose.caption("Paint over parts that should not count: background, shadow, anything that varies between places.")
    with st.container(gap=None):
        _send_picture(f"{digest} template", png(as_rgb(template)), key=f"{key}.picture")
        component("brush")(
            key=key,
            data={
                "name": f"{digest} template",
                "rows": own.shape[0],
                "cols": own.shape[1],
                "own": packed_mask(own),
                "used": packed_mask(used),
            },
            on_mask_change=partial(_keep_sent, key, "mask", digest, read),
        )
