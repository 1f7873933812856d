"""The files that make up a pair and what the page was set to: all that is needed to continue from there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from stereolag.export import calibration_json, image_png, image_tiff, pfm, session_json
from stereolag.inputs import Image
from stereolag.reading.sessions import SESSION
from stereolag.ui.depth.subjects import Subject

T = TypeVar("T")
Text = str | Callable[[Subject], str]


@dataclass(frozen=True)
class Export:
    """A file on offer.

    Attributes
    ----------
    label
        The button; "" of a file that goes into the ZIP alone.
    name
        Of the file, or what makes it.
    make
        Makes its bytes, or its text.
    meaning
        The button's help, and what is said of it in the ZIP.
    refusal
        Returns why there is none where it cannot be had, "" where it can.
    offered
        Returns whether it makes sense at all for this result.
    """

    label: Text
    name: Text
    make: Callable[[Subject], bytes | str]
    meaning: Text
    refusal: Callable[[Subject], str] = lambda subject: ""
    offered: Callable[[Subject], bool] = lambda subject: True


def _images(subject: Subject) -> tuple[tuple[str, Image], tuple[str, Image]]:
    return ("left", subject.pair.left), ("right", subject.pair.right)


def image_names(subject: Subject) -> tuple[str, str]:
    """Return the names of the files of the two images."""
    left, right = (_image_name(side, image) for side, image in _images(subject))
    return left, right


def _image_name(side: str, image: Image) -> str:
    """Return the name of a file that keeps every value of an image."""
    return f"{side}.tif" if image.dtype.kind == "f" else f"{side}.png"


def _image_export(number: int) -> Export:
    """Return the export of one image of the pair."""

    def label(subject: Subject) -> str:
        side, image = _images(subject)[number]
        return f"{side.capitalize()} {'TIFF' if image.dtype.kind == 'f' else 'PNG'}"

    def make(subject: Subject) -> bytes:
        image = _images(subject)[number][1]
        return image_tiff(image) if image.dtype.kind == "f" else image_png(image)

    meaning = f"The {('left', 'right')[number]} image as it is matched, in its own size."
    return Export(label, lambda it: image_names(it)[number], make, meaning)


TRUTH = Export(
    "",
    "ground_truth.pfm",
    lambda it: pfm(_known(it.pair.truth)),
    "The ground truth, px; infinite: none.",
    offered=lambda it: it.pair.truth is not None,
)
VISIBLE = Export(
    "",
    "visible.png",
    lambda it: image_png(_known(it.pair.visible)),
    "White where the right camera sees what the left one does.",
    offered=lambda it: it.pair.visible is not None,
)
CALIBRATION = Export(
    "",
    "calibration.json",
    lambda it: calibration_json(_known(it.calibration)),
    "Focal length in px, baseline in m; the pair is rectified.",
    offered=lambda it: it.calibration is not None and it.calibration.rig is None,
)

SESSION_EXPORT = Export(
    "",
    SESSION,
    lambda it: session_json(files=pair_files(it), **it.session),
    "What the page was set to: give it this ZIP as it is, in place of a left image, to continue from here.",
)

PAIR_EXPORTS = [_image_export(0), _image_export(1), TRUTH, VISIBLE, CALIBRATION, SESSION_EXPORT]


def pair_files(subject: Subject) -> dict[str, str]:
    """Return the names of the files that make up the pair, by what a session calls them."""
    left, right = image_names(subject)
    others = {"truth": TRUTH, "visible": VISIBLE, "calibration": CALIBRATION}
    offered = {what: str(export.name) for what, export in others.items() if export.offered(subject)}
    return {"left": left, "right": right} | offered


def _known(value: T | None) -> T:
    assert value is not None
    return value
