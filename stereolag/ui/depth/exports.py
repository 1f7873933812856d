"""Take it away: the files about one result, each made on request."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from stereolag.core.arrays import FloatMap
from stereolag.figures.maps import cloud_ply, coloured_png
from stereolag.io.disparities import check_kitti, confidence_png, kitti_png, measured_mask_png, pfm, valid_mask_png
from stereolag.io.numpy_files import npy
from stereolag.io.programs import opencv_script, script
from stereolag.io.results import metrics_csv
from stereolag.io.settings import opencv_yaml, settings_json
from stereolag.stereo.evaluation import Evaluation, confidence, has_scores
from stereolag.stereo.matcher import DisparityMap
from stereolag.stereo.opencv import BlockMatcher
from stereolag.ui import downloads
from stereolag.ui.depth.comparing import evaluations
from stereolag.ui.depth.pair_exports import PAIR_EXPORTS, Export, Text, image_names
from stereolag.ui.depth.subjects import Subject
from stereolag.ui.downloads import File


def _of_map(ending: str) -> Callable[[Subject], str]:
    """Return a function that names a file of the map; the name of an enlarged map says so."""
    return lambda it: f"disparity{f'_enlarged_{it.factor:.3g}x' if it.enlarged else ''}{ending}"


def _coloured(subject: Subject) -> bytes:
    low, high = subject.colour_range
    return coloured_png(subject.result.disparity, low, high, subject.view.colours.palette)


def _confidence(subject: Subject) -> FloatMap:
    return confidence(subject.result, subject.pair.left, subject.pair.right)


def _confidence_in_words(form: str) -> Callable[[Subject], str]:
    """Return a function that describes a confidence file: the source of its values for this map, and its `form`."""

    def said(subject: Subject) -> str:
        sure = "Confidence of each measured disparity, 0 to 1: "
        if has_scores(subject.shown):
            return f"{sure}the method’s own score, or 0 if that is negative. {form}."
        return (
            f"{sure}how well the 7 × 7 pixels around it correlate (ZNCC) with those around its match, as the method "
            f"gives no score from 0 to 1. {form}."
        )

    return said


def _cloud(subject: Subject) -> bytes:
    assert subject.calibration is not None
    return cloud_ply(subject.calibration, subject.result.disparity, subject.pair.left)


def _metrics(subject: Subject) -> str:
    """Return the figures of every method on the page as CSV, for comparison."""
    judged: dict[str, Evaluation] = {}
    for name, result in subject.each_result():
        judged |= evaluations(subject.pair, {name: result})
    maps: dict[str, DisparityMap] = {**subject.view.results}
    if not subject.enlarged:
        maps[subject.method] = subject.result
    return metrics_csv(judged, maps, subject.estimated_bad)


def _kitti_refusal(subject: Subject) -> str:
    try:
        check_kitti(subject.shown.disparity * subject.factor)
    except ValueError as error:
        return str(error)
    return ""


def _block_matcher(subject: Subject) -> BlockMatcher:
    assert isinstance(subject.settings, BlockMatcher)
    return subject.settings


def _settings(subject: Subject) -> str:
    assert subject.settings is not None
    return settings_json(subject.settings)


def _script(subject: Subject) -> str:
    assert subject.settings is not None
    return script(subject.settings, *image_names(subject))


def _settings_refusal(subject: Subject) -> str:
    return subject.settings_refusal


def _of_opencv(subject: Subject) -> bool:
    return isinstance(subject.shown.settings, BlockMatcher)


EXPORTS: list[Export] = [
    Export("PFM", _of_map(".pfm"), lambda it: pfm(it.result.disparity), "Disparity in px as floats; infinite: none."),
    Export("NPY", _of_map(".npy"), lambda it: npy(it.result.disparity), "Disparity in px for NumPy; NaN: none."),
    Export(
        "KITTI PNG",
        _of_map("_kitti.png"),
        lambda it: kitti_png(it.result.disparity),
        "Disparity × 256 in 16 bits; 0: none.",
        _kitti_refusal,
    ),
    Export("Coloured PNG", _of_map("_coloured.png"), _coloured, "As shown, with a legend."),
    Export("Valid mask", "valid.png", lambda it: valid_mask_png(it.result), "White where there is a disparity."),
    Export(
        "Measured mask",
        "measured.png",
        lambda it: measured_mask_png(it.result),
        "White where the disparity was measured, black where it was filled in or there is none.",
    ),
    Export(
        "Confidence PNG",
        "confidence.png",
        lambda it: confidence_png(_confidence(it)),
        _confidence_in_words("× 65535 in 16 bits; 0: none"),
    ),
    Export("Confidence NPY", "confidence.npy", lambda it: npy(_confidence(it)), _confidence_in_words("NaN: none")),
    Export(
        "Point cloud PLY",
        "cloud.ply",
        _cloud,
        "Points in metres and true colour, flying pixels left out; at most 2 million.",
        lambda it: "Metres need a calibration, or one point whose distance is known." if it.calibration is None else "",
    ),
    Export(
        "Metrics CSV",
        "metrics.csv",
        _metrics,
        "Coverage and time of every method, and its figures against the ground truth if that is known, with and "
        "without occluded pixels; otherwise bad-2 as estimated in the scoreboard.",
    ),
    Export("Settings JSON", "settings.json", _settings, "Can be loaded again below.", _settings_refusal),
    Export(
        "OpenCV YAML",
        "opencv.yml",
        lambda it: opencv_yaml(_block_matcher(it)),
        "For OpenCV’s Algorithm::load or read.",
        _settings_refusal,
        _of_opencv,
    ),
    Export("Python script", "reproduce.py", _script, "Reproduces the map from these images.", _settings_refusal),
    Export(
        "OpenCV script",
        "reproduce_opencv.py",
        lambda it: opencv_script(_block_matcher(it), *image_names(it)),
        "Reproduces the map from these images with OpenCV alone.",
        _settings_refusal,
        _of_opencv,
    ),
    *PAIR_EXPORTS,
]
"""All files about a result, in the order offered; a new one is added here and nowhere else."""


def files(subject: Subject, exports: Sequence[Export] | None = None) -> list[File]:
    """Return the files about a result in the order offered; of all exports by default."""

    def said(text: Text) -> str:
        return text if isinstance(text, str) else text(subject)

    return [
        File(said(one.label), said(one.name), partial(one.make, subject), said(one.meaning), one.refusal(subject))
        for one in exports or EXPORTS
        if one.offered(subject)
    ]


def archive(subject: Subject, exports: Sequence[Export] | None = None) -> bytes:
    """Return a ZIP of the available files and a description of each; of all exports by default."""
    return downloads.archive(files(subject, exports), size_in_words(subject))


def size_in_words(subject: Subject) -> str:
    """Return sentences about the image size of the files, and how their map was brought to it."""
    rows, cols = subject.pair.left.shape[:2]
    said = f"All files are for the images at full size, {cols} × {rows} pixels."
    if not subject.reduced:
        return said
    shown = f"{subject.view.pair.left.shape[1]} × {subject.view.pair.left.shape[0]}"
    if not subject.enlarged:
        return f"{said} The map was computed at that size; the page shows {shown}."
    return (
        f"{said} The map was computed at {shown} and enlarged, its disparities multiplied by {subject.factor:.4g}: it "
        "is no more accurate than the smaller one. Settings and programs are scaled to the images’ full size."
    )
