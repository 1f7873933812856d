"""Calibrations in the formats of Middlebury, KITTI, OpenCV, ROS, Kalibr, stereodemo and this project."""

from __future__ import annotations

import math
from dataclasses import replace

from stereolag.geometry.calibration import Calibration
from stereolag.geometry.rectification import rectified_calibration
from stereolag.geometry.rig import StereoRig
from stereolag.io.camera_names import Parts
from stereolag.io.entries import (
    Entries,
    Matrix,
    matrix,
    names_found,
    optional_count,
    optional_number,
    required_number,
)
from stereolag.io.notations import parse_entries
from stereolag.io.rigs import PROJECTIONS, REPROJECTION, image_size, parts_together, projection, stereo_rig
from stereolag.io.sources import Source, quoted, read_bytes

ACCEPTED = "files of Middlebury, KITTI, OpenCV, ROS, Kalibr, NPZ, or JSON with focal_px and baseline_m"

_KITTI_PAIRS = (("P_rect_02", "P_rect_03"), ("P2", "P3"), ("P_rect_00", "P_rect_01"), ("row0", "row1"))
_FOCAL = ("focal_px", "fx", "focal_length_px")
_BASELINE = ("baseline_m", "baseline_meters", "baseline_metres")


def read_calibration(*sources: Source, length_unit_m: float = 1.0) -> Calibration:
    """Read the calibration of a stereo camera.

    Supported are: Middlebury ``calib.txt``; KITTI ``calib*.txt`` (the colour cameras 2 and 3, which took the images of
    its stereo benchmarks, take precedence over the grey 0 and 1) and bare projection rows of two cameras; YAML, XML or
    JSON of OpenCV and NPZ of NumPy with both cameras (M1, D1, M2, D2, R, T and the other usual names) or the rectified
    pair (Q, or P1 and P2); ROS ``camera_info`` YAML of the right camera, or of both; the camera chain of Kalibr; the
    JSON of stereodemo; JSON with ``focal_px`` and ``baseline_m`` and, if known, ``doffs_px``, ``cx``, ``cy``,
    ``width``, ``height``, ``num_disparities``.

    Parameters
    ----------
    *sources
        Paths, bytes or binary file objects: one file, or several that belong together (``intrinsics.yml`` and
        ``extrinsics.yml`` of OpenCV, the two cameras of ROS).
    length_unit_m
        The unit of length, in metres, of files with both cameras that do not state it: 0.001 if the squares of the
        chessboard were measured in millimetres. (Not used for Middlebury, in mm, nor for ROS, Kalibr and ours, in m.)

    Returns
    -------
    calibration
        With its ``rig`` if the file has both cameras before rectification, and their rectification within that if the
        file states it (R1, R2 with P1, P2 or Q).

    Raises
    ------
    ValueError
        A file that is empty, damaged or of another kind, or a calibration that is incomplete or makes no sense.

    Examples
    --------
    >>> import stereolag as sl
    >>> from stereolag import samples
    >>> calibration = sl.read_calibration(samples.stereo_pairs()["cube"].calibration)
    >>> calibration.focal_px, calibration.baseline_m  # px, metres
    (900.0, 0.017)
    """
    if not sources:
        raise ValueError("No calibration was given; at least one file is needed.")
    if not (length_unit_m > 0 and math.isfinite(length_unit_m)):
        raise ValueError(f"length_unit_m is {length_unit_m}; allowed are numbers above 0.")
    files = [parse_entries(read_bytes(source, "calibration")) for source in sources]
    merged = {name: value for entries in files for name, value in entries.items()}
    return _of_rectified_pair(merged) or _of_two_cameras(files, merged, length_unit_m)


def _of_rectified_pair(entries: Entries) -> Calibration | None:
    """Return the calibration from a format for rectified pairs only, None if the file is in none of these."""
    if any(name in entries for name in _FOCAL):
        return _from_plain_numbers(entries)
    if "cam0" in entries:
        return _from_middlebury(entries)
    for left, right in _KITTI_PAIRS:
        if left in entries and right in entries:
            pair = {PROJECTIONS[0]: (left, entries[left]), PROJECTIONS[1]: (right, entries[right])}
            return _from_projections(pair, *_size(entries))
    return None


def _of_two_cameras(files: list[Entries], entries: Entries, length_unit_m: float) -> Calibration:
    """Return the calibration from the cameras' matrices, before or after rectification."""
    parts, metric = parts_together(files)
    unit = 1.0 if metric or entries.get("length_unit") == "m" else length_unit_m
    rig = stereo_rig(files, parts, unit)
    if rig is not None:
        return replace(_forecast(rig), num_disparities=optional_count(entries, "num_disparities"))
    if REPROJECTION in parts:
        return _from_reprojection(parts, unit)
    if set(PROJECTIONS) <= set(parts):
        return _from_projections(parts, *image_size(parts), unit)
    raise ValueError(
        f"The calibration holds {names_found(entries)}: it is in no known format, or lacks both cameras; accepted are "
        f"{ACCEPTED}."
    )


def _from_plain_numbers(entries: Entries) -> Calibration:
    """Read single numbers by name; stereodemo calls them ``fx``, ``baseline_meters``, ``cx0`` and ``cx1``."""
    width, height = _size(entries)
    cx, right_cx = optional_number(entries, "cx", "cx0"), optional_number(entries, "cx1")
    doffs = optional_number(entries, "doffs_px", "doffs")
    if doffs is None:
        doffs = 0.0 if cx is None or right_cx is None else right_cx - cx
    return Calibration(
        required_number(entries, *_FOCAL),
        required_number(entries, *_BASELINE),
        doffs,
        cx,
        optional_number(entries, "cy"),
        width=width,
        height=height,
        num_disparities=optional_count(entries, "num_disparities", "max_disparity"),
    )


def _from_middlebury(entries: Entries) -> Calibration:
    """Read lengths in mm and ``doffs = cx1 - cx0`` (https://vision.middlebury.edu/stereo/data/scenes2014/)."""
    left = matrix(entries, "cam0", (3, 3))
    width, height = _size(entries)
    return Calibration(
        float(left[0, 0]),
        required_number(entries, "baseline") / 1000,
        optional_number(entries, "doffs") or 0.0,
        float(left[0, 2]),
        float(left[1, 2]),
        width=width,
        height=height,
        num_disparities=optional_count(entries, "ndisp"),
    )


def _from_projections(parts: Parts, width: int | None, height: int | None, length_unit_m: float = 1.0) -> Calibration:
    """Read the (3, 4) projections of a rectified pair, ``P[0, 3] = -focal * baseline`` (Geiger et al., IJRR 2013)."""
    left, right = (projection(parts, part) for part in PROJECTIONS)
    focal = float(left[0, 0])
    return Calibration(
        focal,
        float(left[0, 3] - right[0, 3]) / focal * length_unit_m,
        float(right[0, 2] - left[0, 2]),
        float(left[0, 2]),
        float(left[1, 2]),
        width=width,
        height=height,
    )


def _from_reprojection(parts: Parts, length_unit_m: float) -> Calibration:
    """Read the matrix Q of OpenCV's ``stereoRectify``: Q[3, 2] is 1 / baseline and Q[3, 3] is doffs / baseline."""
    name, value = parts[REPROJECTION]
    q: Matrix = matrix({name: value}, name, (4, 4))
    if q[3, 2] == 0:
        raise ValueError(
            f"{quoted(name)} in the calibration has 0 at row 3, column 2, which would be an infinite baseline."
        )
    width, height = image_size(parts)
    return Calibration(
        float(q[2, 3]),
        length_unit_m / float(q[3, 2]),
        float(q[3, 3]) / float(q[3, 2]),
        -float(q[0, 3]),
        -float(q[1, 3]),
        width=width,
        height=height,
    )


def _forecast(rig: StereoRig) -> Calibration:
    """Return the calibration to expect after rectification, with the rig; a missing size is guessed from the centre."""
    width = rig.width or max(1, round(2 * rig.left_matrix[0, 2] + 1))
    height = rig.height or max(1, round(2 * rig.left_matrix[1, 2] + 1))
    try:
        rectified = rectified_calibration(rig, (width, height))
    except ZeroDivisionError as error:
        raise ValueError("The calibration is of cameras that cannot be rectified: no focal length is left.") from error
    return replace(rectified, width=rig.width, height=rig.height, rig=rig)


def _size(entries: Entries) -> tuple[int | None, int | None]:
    return optional_count(entries, "width", "image_width"), optional_count(entries, "height", "image_height")
