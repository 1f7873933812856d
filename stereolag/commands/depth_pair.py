"""The pair of the depth command: images, calibration and ground truth, combined as on the page."""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace

from stereolag.assess.disparities import likely_divisor
from stereolag.commands.fitting import fitted
from stereolag.commands.parsing import read
from stereolag.core.arrays import FloatMap
from stereolag.core.inputs import Image, as_stereo_pair
from stereolag.geometry.calibration import Calibration
from stereolag.geometry.rectification import as_deep, cropped_alike
from stereolag.io.calibrations import read_calibration
from stereolag.io.disparities import read_stored_disparity
from stereolag.io.images import read_image


@dataclass(frozen=True, eq=False)
class DepthPair:
    """Two images ready for matching, with their ground truth and calibration.

    Attributes
    ----------
    left, right
        The images, of one size and type.
    truth
        (rows, cols) px; None if unknown.
    calibration
        Calibration of the rectified pair at its size; None if unknown.
    rectified_here
        Whether the images were rectified with the calibration.
    said
        Sentences about the processing of the images.
    """

    left: Image
    right: Image
    truth: FloatMap | None = None
    calibration: Calibration | None = None
    rectified_here: bool = False
    said: tuple[str, ...] = ()


def read_pair(options: argparse.Namespace) -> DepthPair:
    """Return the pair named by the arguments.

    Raises
    ------
    ValueError
        Files that are refused, or that do not belong together.
    OSError
        Files that cannot be opened.
    """
    left_file, right_file = read(read_image, options.left), read(read_image, options.right)
    left, right = as_stereo_pair(*as_deep(*cropped_alike(left_file, right_file)))
    pair = DepthPair(left, right)
    if options.truth is not None:
        truth = _read_truth(options.truth, left_file, right_file)
        pair = replace(pair, truth=truth[: left.shape[0], : left.shape[1]])
    if options.calibration is not None:
        calibration = read(read_calibration, *options.calibration)
        pair = _calibrated(pair, calibration, options.rectify)
    return pair


def _read_truth(path: str, left: Image, right: Image) -> FloatMap:
    stored = read(read_stored_disparity, path)
    if stored.stored.shape != left.shape[:2]:
        (height, width), (rows, cols) = stored.stored.shape, left.shape[:2]
        raise ValueError(
            f"{path} is {width} × {height} and the left image {cols} × {rows} pixels; they must have the same size."
        )
    return stored.divided(stored.divisor or float(likely_divisor(stored.divided(1.0), left, right)))


def _calibrated(pair: DepthPair, calibration: Calibration, wanted: str) -> DepthPair:
    """Return the pair with its calibration, rectified if it is raw, as decided by its rows or by `wanted`."""
    found = fitted(calibration, pair.left, pair.right, wanted)
    if found.straight is None:
        said = (f"The pair is rectified already ({found.rows}).",) if found.rows else ()
        return replace(pair, calibration=found.calibration, said=said)
    if pair.truth is not None:
        raise ValueError(
            f"The images are raw ({found.rows}) and the ground truth belongs to them before rectification: leave out "
            "--truth or --calibration, or give --rectify no."
        )
    said = (f"The pair was rectified with its calibration ({found.rows}).",)
    return DepthPair(found.straight.left, found.straight.right, None, found.calibration, True, said)
