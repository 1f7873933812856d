"""Calibrations of stereo cameras as Middlebury, KITTI, OpenCV, ROS and this project write them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from stereolag.geometry.calibration import Calibration
from stereolag.geometry.rectification import rectified_calibration
from stereolag.geometry.rig import StereoRig
from stereolag.reading.entries import (
    Entries,
    Matrix,
    image_size,
    matrix,
    optional_count,
    optional_number,
    required_number,
    vector,
)
from stereolag.reading.notations import parse_entries
from stereolag.reading.sources import Source, read_bytes

ACCEPTED = (
    "Middlebury calib.txt, KITTI calib*.txt, YAML or JSON of OpenCV (both cameras, or Q), YAML of ROS (the right "
    "camera, or both), and JSON with focal_px and baseline_m"
)
MAX_BYTES = 2**20

_KITTI_PAIRS = (("P_rect_02", "P_rect_03"), ("P2", "P3"), ("P_rect_00", "P_rect_01"), ("P0", "P1"))
_RIG_NAMES = {
    "left_matrix": ("M1", "K1", "cameraMatrix1", "camera_matrix_1", "cameraMatrixL", "left_camera_matrix", "K_left"),
    "left_distortion": ("D1", "distCoeffs1", "dist_coeffs_1", "distCoeffsL", "left_distortion", "D_left"),
    "right_matrix": ("M2", "K2", "cameraMatrix2", "camera_matrix_2", "cameraMatrixR", "right_camera_matrix", "K_right"),
    "right_distortion": ("D2", "distCoeffs2", "dist_coeffs_2", "distCoeffsR", "right_distortion", "D_right"),
    "rotation": ("R", "rotation"),
    "translation": ("T", "translation"),
}


def read_calibration(*sources: Source, length_unit_m: float = 1.0) -> Calibration:
    """Read the calibration of a stereo camera.

    Known are: Middlebury ``calib.txt``; KITTI ``calib*.txt`` (the colour cameras 2 and 3, which took the images of
    its stereo benchmarks, before the grey 0 and 1) and bare projection rows of two cameras; OpenCV YAML or JSON with
    both cameras (M1, D1, M2, D2, R, T and the usual other names) or of the rectified pair (Q, or P1 and P2); ROS
    ``camera_info`` YAML of the right camera, or of both; JSON with ``focal_px`` and ``baseline_m`` and, if known,
    ``doffs_px``, ``cx``, ``cy``, ``width``, ``height``, ``num_disparities``.

    Parameters
    ----------
    *sources
        Paths, bytes or binary file objects: one file, or several that belong together (``intrinsics.yml`` and
        ``extrinsics.yml`` of OpenCV, the two cameras of ROS).
    length_unit_m
        The unit of length of OpenCV's files, which do not name it, in metres: 0.001 where the squares of the
        chessboard were measured in millimetres. (Middlebury is in mm, ROS in m: not asked there.)

    Returns
    -------
    calibration
        With its ``rig`` where the file holds both cameras before rectification.

    Raises
    ------
    ValueError
        A file that is empty, damaged or of another kind, or a calibration that lacks something or makes no sense.
    """
    if not sources:
        raise ValueError("No calibration was given; at least one file is needed.")
    if not (length_unit_m > 0 and math.isfinite(length_unit_m)):
        raise ValueError(f"length_unit_m is {length_unit_m}; allowed are numbers above 0.")
    cameras = [_entries(source) for source in sources]
    if all("projection_matrix" in camera for camera in cameras):
        return _from_ros(cameras)
    merged = {name: value for camera in cameras for name, value in camera.items()}
    return _from_entries(merged, length_unit_m)


def _entries(source: Source) -> Entries:
    data = read_bytes(source, "calibration")
    if len(data) > MAX_BYTES:
        raise ValueError(f"The calibration has {len(data):,} bytes; at most {MAX_BYTES:,} are accepted: {ACCEPTED}.")
    return parse_entries(data)


def _from_entries(entries: Entries, length_unit_m: float) -> Calibration:
    if "focal_px" in entries:
        return _from_plain_numbers(entries)
    if "cam0" in entries:
        return _from_middlebury(entries)
    for left, right in _KITTI_PAIRS:
        if left in entries and right in entries:
            return _from_projections(_projection(entries, left), _projection(entries, right), entries)
    if "row0" in entries and "row1" in entries and set(entries) <= {"row0", "row1", "row2", "row3"}:
        return _from_projections(_projection(entries, "row0"), _projection(entries, "row1"), entries)
    return _from_opencv(entries, length_unit_m)


def _from_plain_numbers(entries: Entries) -> Calibration:
    width, height = image_size(entries)
    return Calibration(
        required_number(entries, "focal_px"),
        required_number(entries, "baseline_m"),
        optional_number(entries, "doffs_px", "doffs") or 0.0,
        optional_number(entries, "cx"),
        optional_number(entries, "cy"),
        width=width,
        height=height,
        num_disparities=optional_count(entries, "num_disparities", "max_disparity"),
    )


def _from_middlebury(entries: Entries) -> Calibration:
    """Read lengths in mm and ``doffs = cx1 - cx0`` (https://vision.middlebury.edu/stereo/data/scenes2014/)."""
    left = matrix(entries, "cam0", (3, 3))
    width, height = image_size(entries)
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


def _from_projections(left: Matrix, right: Matrix, entries: Entries, length_unit_m: float = 1.0) -> Calibration:
    """Read the (3, 4) projections of a rectified pair, ``P[0, 3] = -focal * baseline`` (Geiger et al., IJRR 2013)."""
    width, height = image_size(entries)
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


def _from_opencv(entries: Entries, length_unit_m: float) -> Calibration:
    rig = _rig(entries, length_unit_m)
    if rig is not None:
        return _forecast(rig)
    if "Q" in entries:
        return _from_reprojection(matrix(entries, "Q", (4, 4)), entries, length_unit_m)
    if "P1" in entries and "P2" in entries:
        return _from_projections(_projection(entries, "P1"), _projection(entries, "P2"), entries, length_unit_m)
    raise ValueError(f"The calibration is in no known format; accepted are {ACCEPTED}.")


def _from_reprojection(q: Matrix, entries: Entries, length_unit_m: float) -> Calibration:
    """Read the matrix Q of OpenCV's ``stereoRectify``: Q[3, 2] is 1 / baseline and Q[3, 3] is doffs / baseline."""
    if q[3, 2] == 0:
        raise ValueError("Q in the calibration has 0 at row 3, column 2, which would be an infinite baseline.")
    width, height = image_size(entries)
    return Calibration(
        float(q[2, 3]),
        length_unit_m / float(q[3, 2]),
        float(q[3, 3]) / float(q[3, 2]),
        -float(q[0, 3]),
        -float(q[1, 3]),
        width=width,
        height=height,
    )


def _rig(entries: Entries, length_unit_m: float) -> StereoRig | None:
    """Return both cameras if all is there, None if there are no camera matrices at all."""
    found = {part: name for part, names in _RIG_NAMES.items() for name in names if name in entries}
    if not {"left_matrix", "right_matrix"} & set(found):
        return None
    missing = [part for part in _RIG_NAMES if part not in found and not part.endswith("distortion")]
    if missing:
        if "Q" in entries or {"P1", "P2"} <= set(entries):
            return None
        names = ", ".join(f"{part} ({_RIG_NAMES[part][0]})" for part in missing)
        raise ValueError(
            f"The calibration has camera matrices but lacks {names}; give the file that holds it, often "
            "extrinsics.yml, together with this one."
        )
    width, height = image_size(entries)
    parts = {part: vector(entries, found.get(part)) for part in _RIG_NAMES}
    parts["translation"] = parts["translation"] * length_unit_m
    return StereoRig(**parts, width=width, height=height)


def _forecast(rig: StereoRig) -> Calibration:
    """Return the calibration to expect after rectification, with the rig; without a size, the centre is guessed."""
    width = rig.width or max(1, round(2 * rig.left_matrix[0, 2] + 1))
    height = rig.height or max(1, round(2 * rig.left_matrix[1, 2] + 1))
    try:
        rectified = rectified_calibration(rig, (width, height))
    except ZeroDivisionError as error:
        raise ValueError("The calibration is of cameras that cannot be rectified: no focal length is left.") from error
    return replace(rectified, width=rig.width, height=rig.height, rig=rig)


def _from_ros(cameras: list[Entries]) -> Calibration:
    """Read ``camera_info``: P of the right camera has ``Tx = -focal * baseline`` at [0, 3], metres (sensor_msgs)."""
    cameras = sorted(cameras, key=lambda camera: -_projection(camera, "projection_matrix")[0, 3])
    right = _projection(cameras[-1], "projection_matrix")
    if right[0, 3] >= 0:
        raise ValueError(
            "The calibration (ROS) is of the left camera alone: its projection_matrix has no baseline; give the "
            "file of the right camera, or both."
        )
    left = right * [[1, 1, 1, 0]] if len(cameras) == 1 else _projection(cameras[0], "projection_matrix")
    calibration = _from_projections(left, right, cameras[-1])
    if len(cameras) == 1:
        return calibration
    return replace(calibration, rig=_ros_rig(cameras[0], cameras[-1], calibration.baseline_m))


def _ros_rig(left: Entries, right: Entries, baseline_m: float) -> StereoRig | None:
    """Return both cameras; their pose follows from how ROS turns each into the rectified frame."""
    needed = ("camera_matrix", "distortion_coefficients", "rectification_matrix")
    if not all(name in camera for name in needed for camera in (left, right)):
        return None
    for camera in (left, right):
        model = camera.get("distortion_model", "plumb_bob")
        if model not in ("plumb_bob", "rational_polynomial"):
            raise ValueError(
                "The calibration (ROS) has a distortion_model that is not known here; allowed are plumb_bob and "
                "rational_polynomial."
            )
    to_rectified, right_to_rectified = (matrix(camera, "rectification_matrix", (3, 3)) for camera in (left, right))
    width, height = image_size(left)
    return StereoRig(
        matrix(left, "camera_matrix", (3, 3)),
        vector(left, "distortion_coefficients"),
        matrix(right, "camera_matrix", (3, 3)),
        vector(right, "distortion_coefficients"),
        right_to_rectified.T @ to_rectified,
        right_to_rectified.T @ np.array([-baseline_m, 0.0, 0.0]),
        width,
        height,
    )


def _projection(entries: Entries, name: str) -> Matrix:
    """Return a (3, 4) projection, whose focal length must be above 0."""
    projection = matrix(entries, name, (3, 4))
    if projection[0, 0] <= 0:
        raise ValueError(f"{name} in the calibration has the focal length {projection[0, 0]:g} px; it must be above 0.")
    return projection
