"""Take it away: everything about one result as files, one by one or in one ZIP, each made when it is asked for."""

from __future__ import annotations

from collections.abc import Callable
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
from stereolag.geometry.calibration import Calibration
from stereolag.geometry.clouds import clean_point_cloud
from stereolag.inputs import Image
from stereolag.reading import read_matcher
from stereolag.stereo.evaluation import evaluate
from stereolag.stereo.matcher import DisparityMap, StereoMatcher
from stereolag.stereo.opencv import BlockMatcher
from stereolag.ui.depth.address import adopt
from stereolag.ui.depth.calibrating import calibration_of
from stereolag.ui.depth.view import DepthView
from stereolag.ui.private_files import download_button
from stereolag.ui.uploads import upload

KEY = "depth.take"
LEGEND = "disparity, px: from far to near"


class File(NamedTuple):
    """A file on offer: what makes its bytes, and why there is none where it cannot be had."""

    label: str
    name: str
    make: Callable[[], bytes | str]
    meaning: str
    refusal: str = ""


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
        if view.pair.notes:
            st.caption("The pair in the ZIP is the one that was matched. " + " ".join(view.pair.notes))
        _load_settings()


def files(view: DepthView, method: str) -> list[File]:
    """Return all files about the result of one method, in the order in which they are offered."""
    pair, result = view.pair, view.results[method]
    matcher, calibration = result.settings, calibration_of(pair)
    assert isinstance(matcher, StereoMatcher)
    left, right = _picture("left", pair.left), _picture("right", pair.right)
    offered = [
        File("PFM", "disparity.pfm", partial(pfm, result.disparity), "Disparity in px as floats; infinite: none."),
        File("NPY", "disparity.npy", partial(npy, result.disparity), "Disparity in px for NumPy; NaN: none."),
        File(
            "KITTI PNG",
            "disparity_kitti.png",
            partial(kitti_png, result.disparity),
            "Disparity × 256 in 16 bits; 0: none.",
            _refused(partial(check_kitti, result.disparity)),
        ),
        File("Coloured PNG", "disparity_coloured.png", partial(_coloured, view, result), "As shown, with a legend."),
        File("Valid mask", "valid.png", partial(valid_mask_png, result), "White where there is an answer."),
        File(
            "Point cloud PLY",
            "cloud.ply",
            partial(_cloud, calibration, result, pair.left),
            "Points in metres and true colour, flying pixels left out.",
            "" if calibration is not None else "Metres need a calibration, or one point whose distance is known.",
        ),
        File(
            "Metrics CSV",
            "metrics.csv",
            partial(_metrics, view),
            "Every method against the truth; once more without occluded pixels where they are known.",
            "" if pair.truth is not None else "Metrics need a true disparity.",
        ),
        File("Settings JSON", "settings.json", partial(settings_json, matcher), "Can be loaded again below."),
        File("Python script", "reproduce.py", partial(script, matcher, left.name, right.name), "Makes the same map."),
        left,
        right,
    ]
    if isinstance(matcher, BlockMatcher):
        yaml = File("OpenCV YAML", "opencv.yml", partial(opencv_yaml, matcher), "For OpenCV’s Algorithm::load or read.")
        offered.insert(-3, yaml)
    return offered


def archive(offered: list[File]) -> bytes:
    """Return one ZIP of the files that can be had."""
    return bundle({file.name: file.make() for file in offered if not file.refusal})


def _picture(side: str, image: Image) -> File:
    """Return one picture of the pair as it was matched, in a file that keeps every value."""
    meaning = f"The {side} picture as it was matched."
    if image.dtype.kind == "f":
        return File(f"{side.capitalize()} TIFF", f"{side}.tif", partial(image_tiff, image), meaning)
    return File(f"{side.capitalize()} PNG", f"{side}.png", partial(image_png, image), meaning)


def _coloured(view: DepthView, result: DisparityMap) -> bytes:
    picture = coloured(result.disparity, view.low, view.high, view.palette)
    return image_png(with_legend(picture, view.low, view.high, view.palette, LEGEND))


def _cloud(calibration: Calibration | None, result: DisparityMap, left: Image) -> bytes:
    assert calibration is not None
    return ply(*clean_point_cloud(calibration, result.disparity, as_rgb(left), max_points=None))


def _metrics(view: DepthView) -> str:
    """Return the figures of every method on the page, so that they can be compared."""
    pair = view.pair
    assert pair.truth is not None
    judged = {name: evaluate(result.disparity, pair.truth) for name, result in view.results.items()}
    if pair.visible is not None:
        for name, result in view.results.items():
            judged[f"{name}, non-occluded"] = evaluate(result.disparity, pair.truth, mask=pair.visible)
    return metrics_csv(judged)


def _refused(check: Callable[[], None]) -> str:
    try:
        check()
    except ValueError as error:
        return str(error)
    return ""


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
