"""The image and the template of the search page."""

from __future__ import annotations

from dataclasses import dataclass, replace

import streamlit as st

from stereolag import samples
from stereolag.core.inputs import Image, as_image
from stereolag.io.guard import guarded
from stereolag.io.images import read_image
from stereolag.ui.choices import OWN, choose, image_limits, own_or_example, show_limits
from stereolag.ui.controls import persistent
from stereolag.ui.search.hand_marks import box_in, painted_mask
from stereolag.ui.uploads import PICTURE_TYPES, Upload, forget_together, put_together, upload

KEY = "pictures"


@dataclass(frozen=True, eq=False)
class PictureAndTemplate:
    """An image, the template to find in it, and a mask: above 0 where the template counts, None to use its alpha.

    `place` is the (row, col) of the template's top-left pixel, known for an example and for a template cut from the
    image. `by_hand` names the parts of an example that the visitor made by hand; such inputs are not shared.
    """

    picture: Image
    template: Image
    description: str
    digest: str
    shared: bool
    mask: Image | None = None
    place: tuple[int, int] | None = None
    by_hand: tuple[str, ...] = ()

    @property
    def own(self) -> bool:
        """Return whether the image is the visitor's own."""
        return not self.shared and not self.by_hand


def choose_pictures() -> PictureAndTemplate:
    """Ask for the image, the template and its mask."""
    examples = samples.mazes()
    chosen = choose(examples, key=KEY)
    given = "A file" if chosen == OWN else "The example’s"
    template_from = st.segmented_control(
        "Template",
        ("given", "cut"),
        default="given",
        format_func=lambda one: given if one == "given" else "Cut from the image",
        required=True,
        **persistent(f"{KEY}.from"),
    )
    if template_from == "cut":
        inputs = own_or_example(chosen, _own_cut, _example_cut, examples, key=KEY, awaited="your image is")
    else:
        inputs = own_or_example(chosen, _own_pictures, example_pictures, examples, key=KEY, awaited="both images are")
    painted = painted_mask(inputs.template, inputs.mask, digest=inputs.digest, key=f"{KEY}.painted")
    if painted is None:
        return inputs
    by_hand = () if inputs.own else (*inputs.by_hand, "mask you painted")
    digest = f"{inputs.digest} painted {painted.digest}"
    return replace(inputs, mask=painted.pixels, digest=digest, shared=False, by_hand=by_hand)


@st.cache_resource(show_spinner="Loading the example …")
def example_pictures(name: str) -> PictureAndTemplate:
    """Return one of the bundled images with its template."""
    example = samples.mazes()[name]
    return PictureAndTemplate(
        read_image(example.picture),
        read_image(example.template),
        example.description,
        f"maze {name}",
        True,
        place=(example.row, example.col),
    )


def _own_pictures() -> PictureAndTemplate | None:
    """Ask for two files and an optional mask; return the last ones that fit together."""
    columns = st.columns(3, gap="medium")
    with columns[0]:
        picture = upload("Image", guarded(read_image), key=f"{KEY}.picture", types=PICTURE_TYPES)
    with columns[1]:
        template = upload(
            "Template",
            guarded(read_image),
            key=f"{KEY}.template",
            types=PICTURE_TYPES,
            note="The thing to find, cut from the image or at the same scale. Transparent parts do not count.",
        )
    with columns[2]:
        mask = upload(
            "Mask of the template (optional)",
            guarded(read_image),
            key=f"{KEY}.mask",
            types=PICTURE_TYPES,
            note="An image of the template’s size, black where the template does not count, as around a cursor or a "
            "logo. It replaces the template’s own transparency.",
        )
    show_limits(image_limits())
    if picture is None or template is None:
        forget_together(f"{KEY}.own")
        return None
    return put_together(lambda: _together(picture, template, mask), f"{KEY}.own")


def _own_cut() -> PictureAndTemplate | None:
    """Ask for an image file, and for a box in it."""
    picture = upload("Image", guarded(read_image), key=f"{KEY}.picture", types=PICTURE_TYPES)
    show_limits(image_limits())
    if picture is None:
        return None
    return _cut(as_image(picture.content, "image"), "Your own image.", picture.digest, shared=False)


def _example_cut(name: str) -> PictureAndTemplate:
    example = example_pictures(name)
    return _cut(example.picture, example.description, example.digest, shared=True)


def _cut(image: Image, description: str, digest: str, *, shared: bool) -> PictureAndTemplate:
    """Ask for a box in an image, whose pixels become the template; the result is private to the visitor."""
    box = box_in(image, digest=digest, shared=shared, key=f"{KEY}.cut")
    template = image[box.slices]
    digest = f"{digest} cut {box.row} {box.col} {box.height} {box.width}"
    said = f"{description} The cut-out finds itself: ask for more matches, or damage the image below."
    by_hand = ("template you cut out",) if shared else ()
    return PictureAndTemplate(image, template, said, digest, False, place=(box.row, box.col), by_hand=by_hand)


def _together(picture: Upload[Image], template: Upload[Image], mask: Upload[Image] | None) -> PictureAndTemplate:
    """Return image, template and mask together; ValueError if the template does not fit the image, or the mask."""
    image, small = as_image(picture.content, "image"), as_image(template.content, "template")
    if small.shape[0] > image.shape[0] or small.shape[1] > image.shape[1]:
        raise ValueError(
            f"The template is {small.shape[1]} × {small.shape[0]} pixels and the image {image.shape[1]} × "
            f"{image.shape[0]}; the template must fit into the image."
        )
    digest = f"{picture.digest} {template.digest}"
    if mask is None:
        return PictureAndTemplate(image, small, "Your own images.", digest, False)
    marked = _fitting_mask(mask.content, small)
    return PictureAndTemplate(image, small, "Your own images.", f"{digest} {mask.digest}", False, marked)


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
