"""The files of a pair and of the state of the page: everything needed to continue from there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from stereolag.core.inputs import Image
from stereolag.io.calibrations import calibration_json
from stereolag.io.disparities import pfm
from stereolag.io.images import image_png, image_tiff
from stereolag.io.sessions import SESSION, session_json
from stereolag.ui.depth.subjects import Subject

T = TypeVar("T")
Text = str | Callable[[Subject], str]


@dataclass(frozen=True)
class Export:
    """A file offered for download.

    Attributes
    ----------
    label
        Label of the button; "" for a file that is only in the ZIP.
    name
        File name, or a function that returns it.
    make
        Makes its bytes or text.
    meaning
        Help of the button, and description of the file in the ZIP.
    refusal
        Returns why the file is not available; "" if it is.
    offered
        Returns whether the file makes sense for this result at all.
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
    """Return the file names of the two images."""
    left, right = (_image_name(side, image) for side, image in _images(subject))
    return left, right


def _image_name(side: str, image: Image) -> str:
    """Return the file name of an image, in a format that keeps every value."""
    return f"{side}.tif" if image.dtype.kind == "f" else f"{side}.png"


def _image_export(number: int) -> Export:
    """Return the export of one image of the pair."""

    def label(subject: Subject) -> str:
        side, image = _images(subject)[number]
        return f"{side.capitalize()} {'TIFF' if image.dtype.kind == 'f' else 'PNG'}"

    def make(subject: Subject) -> bytes:
        image = _images(subject)[number][1]
        return image_tiff(image) if image.dtype.kind == "f" else image_png(image)

    meaning = f"The {('left', 'right')[number]} image as it is matched, at full size."
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
    "White where both cameras see the point.",
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
    "The page’s settings: upload this ZIP, unchanged, as the left image to continue from here.",
)

PAIR_EXPORTS = [_image_export(0), _image_export(1), TRUTH, VISIBLE, CALIBRATION, SESSION_EXPORT]


def pair_files(subject: Subject) -> dict[str, str]:
    """Return the file names of the pair, by their names in a session."""
    left, right = image_names(subject)
    others = {"truth": TRUTH, "visible": VISIBLE, "calibration": CALIBRATION}
    offered = {what: str(export.name) for what, export in others.items() if export.offered(subject)}
    return {"left": left, "right": right} | offered


def _known(value: T | None) -> T:
    assert value is not None
    return value
