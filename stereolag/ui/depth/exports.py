"""Take it away: everything about one result as files, one by one or in one ZIP, each made when it is asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import streamlit as st

from stereolag.export import (
    bundle,
    check_kitti,
    image_png,
    image_tiff,
    kitti_png,
    metrics_csv,
    npy,
    opencv_yaml,
    pfm,
    ply,
    script,
    settings_json,
    valid_mask_png,
)
from stereolag.figures.disparity import with_legend
from stereolag.figures.pictures import as_rgb, coloured
from stereolag.geometry.clouds import clean_point_cloud
from stereolag.inputs import Image
from stereolag.reading import read_matcher
from stereolag.stereo.matcher import DisparityMap
from stereolag.stereo.opencv import BlockMatcher
from stereolag.ui.depth.address import adopt
from stereolag.ui.depth.calibrating import calibration_of
from stereolag.ui.depth.scoreboard import evaluations
from stereolag.ui.depth.view import DepthView
from stereolag.ui.private_files import download_button
from stereolag.ui.uploads import upload

LEGEND = "disparity, px: from far to near"


class Subject(NamedTuple):
    """The result of which files are made: one map of a view."""

    view: DepthView
    result: DisparityMap


Text = str | Callable[[Subject], str]


@dataclass(frozen=True)
class Export:
    """A file on offer.

    Attributes
    ----------
    label, meaning
        The button, and its help.
    name
        Of the file, or what makes it.
    make
        Makes its bytes, or its text.
    refusal
        Returns why there is none where it cannot be had, "" where it can.
    offered
        Returns whether it makes sense at all for this result.
    """

    label: Text
    name: Text
    make: Callable[[Subject], bytes | str]
    meaning: str
    refusal: Callable[[Subject], str] = lambda subject: ""
    offered: Callable[[Subject], bool] = lambda subject: True


class File(NamedTuple):
    """An export of one result: its bytes are made when they are asked for."""

    label: str
    name: str
    make: Callable[[], bytes | str]
    meaning: str
    refusal: str


def _coloured(subject: Subject) -> bytes:
    view = subject.view
    image = coloured(subject.result.disparity, view.low, view.high, view.palette)
    return image_png(with_legend(image, view.low, view.high, view.palette, LEGEND))


def _cloud(subject: Subject) -> bytes:
    calibration, left = calibration_of(subject.view.pair), subject.view.pair.left
    assert calibration is not None
    return ply(*clean_point_cloud(calibration, subject.result.disparity, as_rgb(left), max_points=None))


def _metrics(subject: Subject) -> str:
    """Return the figures of every method on the page, so that they can be compared."""
    return metrics_csv(evaluations(subject.view))


def _kitti_refusal(subject: Subject) -> str:
    try:
        check_kitti(subject.result.disparity)
    except ValueError as error:
        return str(error)
    return ""


def _opencv_yaml(subject: Subject) -> str:
    matcher = subject.result.settings
    assert isinstance(matcher, BlockMatcher)
    return opencv_yaml(matcher)


def _script(subject: Subject) -> str:
    names = (_image_name(side, image) for side, image in _images(subject))
    return script(subject.result.settings, *names)


def _images(subject: Subject) -> tuple[tuple[str, Image], tuple[str, Image]]:
    return ("left", subject.view.pair.left), ("right", subject.view.pair.right)


def _image_name(side: str, image: Image) -> str:
    """Return the name of a file that keeps every value of an image."""
    return f"{side}.tif" if image.dtype.kind == "f" else f"{side}.png"


def _image_export(number: int) -> Export:
    """Return the export of one image of the pair as it was matched."""

    def name(subject: Subject) -> str:
        return _image_name(*_images(subject)[number])

    def label(subject: Subject) -> str:
        side, image = _images(subject)[number]
        return f"{side.capitalize()} {'TIFF' if image.dtype.kind == 'f' else 'PNG'}"

    def make(subject: Subject) -> bytes:
        image = _images(subject)[number][1]
        return image_tiff(image) if image.dtype.kind == "f" else image_png(image)

    return Export(label, name, make, f"The {('left', 'right')[number]} image as it was matched.")


EXPORTS: list[Export] = [
    Export("PFM", "disparity.pfm", lambda it: pfm(it.result.disparity), "Disparity in px as floats; infinite: none."),
    Export("NPY", "disparity.npy", lambda it: npy(it.result.disparity), "Disparity in px for NumPy; NaN: none."),
    Export(
        "KITTI PNG",
        "disparity_kitti.png",
        lambda it: kitti_png(it.result.disparity),
        "Disparity × 256 in 16 bits; 0: none.",
        _kitti_refusal,
    ),
    Export("Coloured PNG", "disparity_coloured.png", _coloured, "As shown, with a legend."),
    Export("Valid mask", "valid.png", lambda it: valid_mask_png(it.result), "White where there is a disparity."),
    Export(
        "Point cloud PLY",
        "cloud.ply",
        _cloud,
        "Points in metres and true colour, flying pixels left out.",
        lambda it: (
            "Metres need a calibration, or one point whose distance is known."
            if calibration_of(it.view.pair) is None
            else ""
        ),
    ),
    Export(
        "Metrics CSV",
        "metrics.csv",
        _metrics,
        "Every method against the ground truth; once more without occluded pixels where they are known.",
        lambda it: "Metrics need a ground truth." if it.view.pair.truth is None else "",
    ),
    Export(
        "Settings JSON",
        "settings.json",
        lambda it: settings_json(it.result.settings),
        "Can be loaded again below.",
    ),
    Export(
        "OpenCV YAML",
        "opencv.yml",
        _opencv_yaml,
        "For OpenCV’s Algorithm::load or read.",
        offered=lambda it: isinstance(it.result.settings, BlockMatcher),
    ),
    Export("Python script", "reproduce.py", _script, "Makes the same map."),
    _image_export(0),
    _image_export(1),
]
"""All files about a result, in the order in which they are offered: a new one is listed here and nowhere else."""


def files(view: DepthView, method: str) -> list[File]:
    """Return all files about the result of one method, in the order in which they are offered."""
    subject = Subject(view, view.results[method])

    def said(text: Text) -> str:
        return text if isinstance(text, str) else text(subject)

    return [
        File(said(one.label), said(one.name), partial(one.make, subject), one.meaning, one.refusal(subject))
        for one in EXPORTS
        if one.offered(subject)
    ]


KEY = "depth.take"


def show_downloads(view: DepthView) -> None:
    """Offer the files of one result, and take settings back in."""
    opened = st.expander("Take it away", icon=":material/download:", key=f"{KEY}.opened", on_change="rerun")
    if not opened.open or not view.results:
        return
    with opened:
        names = [*view.results]
        chosen = st.segmented_control("Result of", names, default=names[0], required=True, key=f"{KEY}.result")
        offered = files(view, chosen if chosen in view.results else names[0])
        with st.container(horizontal=True, gap="small"):
            download_button(
                "All in one ZIP",
                partial(archive, offered),
                "stereolag.zip",
                "application/zip",
                key=f"{KEY}.zip",
                meaning="All files on offer here, with the pair as it was matched.",
                icon=":material/folder_zip:",
                primary=True,
            )
            for file in offered:
                download_button(
                    file.label,
                    file.make,
                    file.name,
                    key=f"{KEY}.{file.name}",
                    meaning=file.refusal or file.meaning,
                    disabled=bool(file.refusal),
                )
        if view.pair.changes:
            done = " ".join(change.sentence for change in view.pair.changes)
            st.caption(f"The pair in the ZIP is the one that was matched. {done}")
        _load_settings()


def archive(offered: list[File]) -> bytes:
    """Return one ZIP of the files that can be had."""
    return bundle({file.name: file.make() for file in offered if not file.refusal})


def _load_settings() -> None:
    """Ask for a settings file, and set the controls to what it says, once a file."""
    loaded = upload(
        "Load settings",
        read_matcher,
        key=f"{KEY}.load",
        types=("json",),
        note="A settings JSON from here.",
        lasting=False,
    )
    digest = loaded.digest if loaded else None
    if loaded is not None and st.session_state.get(f"{KEY}.loaded") != digest:
        st.session_state[f"{KEY}.loaded"] = digest
        adopt(loaded.content)
    st.session_state[f"{KEY}.loaded"] = digest
