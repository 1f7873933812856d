"""Downloads: the files about one result, each made on request at the pair's full size, and loading of settings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property, partial
from typing import TypeVar, cast

import streamlit as st

from stereolag.core.arrays import FloatMap
from stereolag.core.jobs import format_bytes, limits
from stereolag.core.typography import duration
from stereolag.figures.legends import cloud_ply, coloured_png
from stereolag.geometry.rectification import turned
from stereolag.io.arrays import npy
from stereolag.io.calibrations import calibration_json
from stereolag.io.depths import MAX_PNG_DEPTH_M, depth_png, depth_tiff, too_far
from stereolag.io.disparities import check_kitti, confidence_png, kitti_png, pfm
from stereolag.io.images import image_file, image_png
from stereolag.io.programs import Cameras, opencv_script, script
from stereolag.io.results import metrics_csv
from stereolag.io.sessions import SESSION, session_json
from stereolag.io.settings import opencv_yaml, read_matcher, settings_json
from stereolag.pair import Pair, upright
from stereolag.stereo.evaluation import Evaluation, confidence, has_scores
from stereolag.stereo.matcher import DisparityMap
from stereolag.stereo.opencv import BlockMatcher
from stereolag.ui import prose
from stereolag.ui.background_jobs import is_heavy
from stereolag.ui.depth.comparing import estimates_in_memory, evaluations
from stereolag.ui.depth.inputs import original
from stereolag.ui.depth.maps import choose_map
from stereolag.ui.depth.state import adopt, at_size, for_size, saved_state
from stereolag.ui.depth.view import DepthView, settings_key
from stereolag.ui.downloads import (
    File,
    download_button,
    file_of_image,
    refusal_of,
    run_queued,
    show_file_buttons,
    show_zip_button,
)
from stereolag.ui.downloads import archive as zip_of
from stereolag.ui.elements import refusals_shown
from stereolag.ui.results import computed_in_turn, kept_for
from stereolag.ui.uploads import upload

KEY = "depth.take"
BYTES_PER_PIXEL = 100
"""Memory per pixel while files are made: the map at full size, its points and colours, and the file."""
WANTED = f"{KEY}.wanted"
"""Session-state key of the maps that the visitor wants computed at full size."""

NO_METRES = "Depth in metres needs a calibration, or one point whose distance is known."

T = TypeVar("T")


def show_downloads(view: DepthView) -> None:
    """Offer the files of one result, and ask for settings to load."""
    opened = st.expander("Take it away", icon=":material/download:", key=f"{KEY}.opened", on_change="rerun")
    if not opened.open or not view.results:
        return
    with opened:
        download = Download(view, choose_map(view, "Result of", f"{KEY}.result"))
        if download.reduced:
            _compute_at_full_size(download)
        rows, cols = download.pair.left.shape[:2]
        memory = BYTES_PER_PIXEL * rows * cols
        offered = files(download)
        first = [file for file in offered if file.first and not file.refusal]
        with st.container(horizontal=True, gap="small"):
            show_zip_button(
                partial(archive, download),
                memory,
                key=KEY,
                more="Upload it as the left image to return to the page as it is now.",
            )
            show_file_buttons(first, memory, key=KEY)
            with (
                st.popover("More files", icon=":material/more_horiz:", key=f"{KEY}.more"),
                st.container(horizontal=True, gap="small"),  # which wraps them
            ):
                download_button(
                    "Session ZIP",
                    partial(run_queued, partial(archive, download, pair_files), memory),
                    "stereolag-session.zip",
                    "application/zip",
                    key=f"{KEY}.session",
                    meaning="The pair and the page’s settings, without the results: enough to continue from here.",
                    icon=":material/bookmark:",
                )
                show_file_buttons([file for file in offered if file not in first], memory, key=KEY)
        if download.calibration is None:
            prose.caption(NO_METRES)
        prose.caption(" ".join([size_in_words(download), *(change.sentence for change in download.pair.changes)]))
        _load_settings(1 / download.factor)


def _compute_at_full_size(download: Download) -> None:
    """Offer to compute the map at full size if that takes long; store the result in the download."""
    matcher, pair = download.settings, download.pair
    if matcher is None:
        prose.warning(download.settings_refusal)
        return
    if download.light:
        return
    wanted, previous = f"{pair.digest} {settings_key(download.shown)}", st.session_state.get(WANTED, ())
    estimate = matcher.estimate(pair.left.shape, pair.left.dtype)
    size = f"{pair.left.shape[1]} × {pair.left.shape[0]}"
    if estimate.memory > limits().job_memory:
        prose.caption(
            f"Computed at {size}, this map would need about {format_bytes(estimate.memory)} of memory, and "
            f"one job may take {format_bytes(limits().job_memory)}: the map in the files is the one shown, enlarged."
        )
        return
    if wanted not in previous:
        st.button(
            f"Compute the map at {size}",
            key=f"{KEY}.compute",
            icon=":material/open_in_full:",
            help=f"About {duration(estimate.seconds)}. Until then, the map in the files is the one shown, enlarged.",
            on_click=partial(st.session_state.update, {WANTED: {*previous, wanted}}),
        )
        return
    download.computed = computed_in_turn(
        f"original map {matcher.short_name}",
        lambda progress: matcher.compute(pair.left, pair.right, progress=progress),
        estimate,
        **kept_for(pair, matcher.model_dump_json()),
        label=f"{matcher.title} at {size} …",
    )


def _load_settings(factor: float) -> None:
    """Ask for a settings file and, once per file, set the controls to it, scaled by `factor` to the size shown."""
    loaded = upload(
        "Load settings",
        read_matcher,
        key=f"{KEY}.load",
        types=("json",),
        note="A settings JSON saved here, for the pair at its full size.",
        lasting=False,
    )
    digest, previous = loaded.digest if loaded else None, st.session_state.get(f"{KEY}.loaded")
    st.session_state[f"{KEY}.loaded"] = digest
    if loaded is not None and digest != previous:
        with refusals_shown("The settings could not be scaled with the images. {}"):
            adopt(at_size(loaded.content, factor))


# The data


class Download:
    """One map of a view and the data for its files, at the pair's full size.

    Attributes
    ----------
    view, method
        The view on the page, and the title of the map's method.
    shown
        The map as the page shows download.
    pair
        The pair at full size, with all changes made to the smaller one.
    factor
        Pixels of the full-size pair per pixel shown.
    calibration
        Calibration of the full-size pair, derived from a known distance if one was entered.
    settings
        Settings of the map for full size; None if they are not allowed.
    settings_refusal
        Why the settings are not allowed; "" if they are.
    computed
        The map computed at full size; None if not computed yet.
    light
        Whether the map at full size is cheap enough to be computed when its file is requested.
    session
        State of the page, as arguments of :func:`stereolag.io.sessions.session_json`.
    estimated_bad
        Estimated bad-2 of the maps shown, %, by title of the method; empty unless it was estimated.
    """

    def __init__(self, view: DepthView, method: str) -> None:
        self.view, self.method, self.shown = view, method, view.results[method]
        self.pair = pair = original(view.pair)
        self.factor = pair.left.shape[1] / view.pair.left.shape[1]
        known = view.known_distance
        self.calibration = pair.calibration if known is None else known.calibration.scaled(self.factor)
        self.settings, refusal = for_size(self.shown.settings, self.factor)
        self.settings_refusal = refusal and f"At full size, {refusal}"
        self.computed = None if self.reduced else self.shown
        estimate = self.settings and self.settings.estimate(pair.left.shape, pair.left.dtype)
        self.light = bool(estimate and not is_heavy(estimate) and estimate.memory <= limits().job_memory)
        self.session = saved_state(view, self.factor) | {
            "description": pair.description,
            "history": [change.sentence for change in pair.changes],
        }
        self.estimated_bad = estimates_in_memory(view) if view.pair.truth is None else {}

    @property
    def reduced(self) -> bool:
        """Return whether the page shows the pair at reduced size."""
        return self.pair is not self.view.pair

    @property
    def enlarged(self) -> bool:
        """Return whether the map of the files is the one shown, enlarged, and not computed at full size."""
        return self.computed is None and not self.light

    @cached_property
    def result(self) -> DisparityMap:
        """Return the map at full size; computed or enlarged on first use."""
        if self.computed is not None:
            return self.computed
        if self.light and self.settings is not None:
            return self.settings.compute(self.pair.left, self.pair.right)
        return self.enlarged_map(self.method)

    @property
    def raw(self) -> Pair | None:
        """Return the pair before rectification, with the calibration of both cameras; None if it was not rectified."""
        return self.pair.raw if self.calibration is not None else None

    @property
    def depth(self) -> FloatMap:
        """Return the depth of every pixel of the left image as it is matched, metres; NaN: none."""
        return _not_none(self.calibration).depth(self.result.disparity)

    @property
    def as_taken(self) -> DisparityMap:
        """Return the map in the orientation of the images as taken, if they were turned for matching."""
        return self.result.turned(-self.pair.turn)

    @property
    def confidence(self) -> FloatMap:
        """Return the confidence of the map, in the orientation of the images as taken."""
        return turned(confidence(self.result, self.pair.left, self.pair.right), -self.pair.turn)

    def enlarged_map(self, method: str) -> DisparityMap:
        """Return the map of a method that the page shows, enlarged to full size."""
        shown = self.view.results[method]
        if not self.reduced:
            return shown
        rows, cols = self.pair.left.shape[:2]
        return shown.enlarged(rows, cols, for_size(shown.settings, self.factor)[0] or shown.settings)


def _not_none(value: T | None) -> T:
    assert value is not None
    return value


# The files


def files(download: Download) -> list[File]:
    """Return the files about a result in the order offered; a new one is added here and nowhere else."""
    pair, colours = download.pair, download.view.colours
    no_metres, no_settings = NO_METRES if download.calibration is None else "", download.settings_refusal
    suffix = f"_enlarged_{download.factor:.3g}x" if download.enlarged else ""
    measure = (
        "the method’s own score, or 0 if that is negative"
        if has_scores(download.shown)
        else "how well the 7 × 7 pixels around it correlate (ZNCC) with those around its match, as the method gives no "
        "score from 0 to 1"
    )
    confidence_meaning = f"Confidence of each measured disparity, 0 to 1: {measure}."
    images = "pair" if download.raw is None else "raw pair"
    output = "the map" if download.calibration is None else "the map and the depth in metres"
    listed = [
        File(
            "Python script",
            "reproduce.py",
            partial(_script, download),
            f"Computes {output} from the {images} in the ZIP.",
            no_settings,
            first=True,
        ),
        File(
            "Point cloud PLY",
            "cloud.ply",
            partial(_cloud, download),
            "Points in metres with their colours, without flying pixels; at most 2 million.",
            no_metres,
            first=True,
        ),
        File(
            "Depth TIFF, m",
            f"depth{suffix}.tif",
            lambda: depth_tiff(download.depth),
            "Depth of every pixel of the left image, metres as floats; NaN: none.",
            no_metres,
            first=True,
        ),
        File(
            "Depth PNG, mm",
            f"depth{suffix}_mm.png",
            lambda: depth_png(download.depth),
            _millimetres_in_words(download),
            no_metres,
            first=True,
        ),
        File(
            "PFM",
            f"disparity{suffix}.pfm",
            lambda: pfm(download.as_taken.disparity),
            "Disparity in px as floats; infinite: none.",
        ),
        File(
            "NPY",
            f"disparity{suffix}.npy",
            lambda: npy(download.as_taken.disparity),
            "Disparity in px for NumPy; NaN: none.",
        ),
        File(
            "KITTI PNG",
            f"disparity{suffix}_kitti.png",
            lambda: kitti_png(download.as_taken.disparity),
            "Disparity × 256 in 16 bits; 0: none.",
            refusal_of(partial(check_kitti, download.shown.disparity * download.factor)),
        ),
        File(
            "Coloured PNG",
            f"disparity{suffix}_coloured.png",
            lambda: coloured_png(
                download.as_taken.disparity,
                colours.low * download.factor,
                colours.high * download.factor,
                colours.palette,
            ),
            "As shown, with a legend.",
        ),
        File(
            "Valid mask", "valid.png", lambda: image_png(download.as_taken.valid), "White where there is a disparity."
        ),
        File(
            "Measured mask",
            "measured.png",
            lambda: image_png(download.as_taken.measured),
            "White where the disparity was measured, black where it was filled in or there is none.",
        ),
        File(
            "Confidence PNG",
            "confidence.png",
            lambda: confidence_png(download.confidence),
            f"{confidence_meaning} × 65535 in 16 bits; 0: none.",
        ),
        File("Confidence NPY", "confidence.npy", lambda: npy(download.confidence), f"{confidence_meaning} NaN: none."),
        File(
            "Metrics CSV",
            "metrics.csv",
            partial(_metrics, download),
            "Coverage and time of every method, and its figures against the ground truth if that is known, with and "
            "without occluded pixels; otherwise bad-2 as estimated in the scoreboard.",
        ),
        File(
            "Settings JSON",
            "settings.json",
            lambda: settings_json(_not_none(download.settings)),
            "Can be loaded again below.",
            no_settings,
        ),
    ]
    if isinstance(download.shown.settings, BlockMatcher):
        matcher = cast(BlockMatcher, download.settings)
        listed += [
            File(
                "OpenCV YAML",
                "opencv.yml",
                partial(opencv_yaml, matcher),
                "For Algorithm::load or read in OpenCV.",
                no_settings,
            ),
            File(
                "OpenCV script",
                "reproduce_opencv.py",
                partial(opencv_script, matcher, *image_names(pair), (pair.left, pair.right)),
                "Reproduces the map from these images with OpenCV alone.",
                no_settings,
            ),
        ]
    return [*listed, *pair_files(download), *raw_files(download)]


RAW = "raw_"
"""Prefix of the names of the files of the pair before rectification."""
CALIBRATION, RAW_CALIBRATION = "calibration.json", f"{RAW}calibration.json"


def pair_files(download: Download) -> list[File]:
    """Return the files of the pair and of the state of the page: everything needed to continue from there."""
    pair = download.pair
    listed = {
        "left": file_of_image("left", pair.left, "The left image as it is matched, at full size."),
        "right": file_of_image("right", pair.right, "The right image as it is matched, at full size."),
    }
    if pair.truth is not None:
        listed["truth"] = File(
            "", "ground_truth.pfm", partial(pfm, pair.truth), "The ground truth, px; infinite: none."
        )
    if pair.visible is not None:
        listed["visible"] = File(
            "", "visible.png", partial(image_png, pair.visible), "White where both cameras see the point."
        )
    if download.calibration is not None:
        listed["calibration"] = File(
            "Calibration JSON",
            CALIBRATION,
            partial(calibration_json, download.calibration),
            "Of the left image as it is matched: focal length and principal point in px, baseline in m.",
        )
    return [
        *listed.values(),
        File(
            "",
            SESSION,
            partial(session_json, files={role: file.name for role, file in listed.items()}, **download.session),
            "The page’s settings: upload this ZIP, unchanged, as the left image to continue from here.",
        ),
    ]


def raw_files(download: Download) -> list[File]:
    """Return the files of the pair before rectification and of its cameras, from which the script starts."""
    raw = download.raw
    if raw is None:
        return []
    known, (rows, cols) = _not_none(raw.calibration), raw.left.shape[:2]
    rig = _not_none(known.rig)
    sized = replace(known, rig=replace(rig, width=rig.width or cols, height=rig.height or rows))
    return [
        file_of_image(f"{RAW}left", raw.left, "The left image as it was taken."),
        file_of_image(f"{RAW}right", raw.right, "The right image as it was taken."),
        File(
            "Raw calibration JSON",
            RAW_CALIBRATION,
            partial(calibration_json, sized),
            "Both cameras before rectification, under OpenCV’s names; lengths in m.",
        ),
    ]


def image_names(pair: Pair, prefix: str = "") -> tuple[str, str]:
    """Return the file names of the two images of a pair, both with a prefix."""
    return image_file(f"{prefix}left", pair.left)[0], image_file(f"{prefix}right", pair.right)[0]


def _script(download: Download) -> str:
    """Return the program that computes the map from the images, from the raw ones if the pair was rectified here."""
    pair, raw, calibration, cameras = download.pair, download.raw, None, None
    if raw is not None:
        cameras = Cameras(RAW_CALIBRATION, _not_none(pair.rectification).alpha, pair.id.remedies)
    if download.calibration is not None and (raw is None or download.view.known_distance is not None):
        calibration = CALIBRATION
    names = image_names(pair) if raw is None else image_names(raw, RAW)
    return script(_not_none(download.settings), *names, calibration, cameras=cameras)


def _cloud(download: Download) -> bytes:
    pair = upright(replace(download.pair, calibration=download.calibration))
    return cloud_ply(_not_none(pair.calibration), download.as_taken.disparity, pair.left)


def _metrics(download: Download) -> str:
    """Return the figures of every method on the page as CSV."""
    judged: dict[str, Evaluation] = {}
    for name in download.view.results:  # one by one, since each map is as large as the pair
        judged |= evaluations(
            download.pair, {name: download.result if name == download.method else download.enlarged_map(name)}
        )
    maps: dict[str, DisparityMap] = {**download.view.results}
    if not download.enlarged:
        maps[download.method] = download.result
    return metrics_csv(judged, maps, download.estimated_bad)


def _millimetres_in_words(download: Download) -> str:
    """Return a description of the depth PNG, with the number of pixels that are too far away for download."""
    said = f"Depth of every pixel of the left image, mm in 16 bits, as in ROS; 0: none, or beyond {MAX_PNG_DEPTH_M} m"
    if download.calibration is None:
        return f"{said}."
    shown = download.calibration.depth(download.shown.disparity * download.factor)
    return f"{said}: {too_far(shown):,} of the {shown.size:,} pixels shown are."


def archive(download: Download, of: Callable[[Download], list[File]] = files) -> bytes:
    """Return a ZIP of the files that are available, with a description of each."""
    return zip_of(of(download), size_in_words(download))


def size_in_words(download: Download) -> str:
    """Return sentences about the image size of the files, and whether their map was computed at it or enlarged."""
    rows, cols = download.pair.left.shape[:2]
    said = f"All files are for the images at full size, {cols} × {rows} pixels."
    if download.pair.turn:
        said += (
            " The images, the depth in metres and its calibration are turned, as they were matched; all other maps and "
            "the points are turned back, as the images were taken."
        )
    if not download.reduced:
        return said
    shown = f"{download.view.pair.left.shape[1]} × {download.view.pair.left.shape[0]}"
    if not download.enlarged:
        return f"{said} The map was computed at that size; the page shows {shown}."
    return (
        f"{said} The map was computed at {shown} and enlarged, its disparities multiplied by {download.factor:.4g}: it "
        "is no more accurate than the smaller one. Settings and programs are scaled to the images’ full size."
    )
