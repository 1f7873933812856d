"""Calibrations of stereo cameras in the formats of OpenCV, ROS and this library; lengths are in metres."""

from __future__ import annotations

import json

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.geometry.calibration import Calibration
from stereolag.geometry.rectification import rectification
from stereolag.geometry.rig import StereoRig
from stereolag.version import VERSION

_COEFFICIENTS = {"plumb_bob": 5, "rational_polynomial": 8}
"""Number of coefficients of the distortion models of ROS."""


def opencv_calibration(calibration: Calibration) -> str:
    """Return both cameras and their rectification as the YAML of OpenCV's ``FileStorage``.

    The names are those of OpenCV's own sample: M1, D1, M2, D2, R, T (metres), R1, R2, P1, P2, Q, and the size.

    Raises
    ------
    ValueError
        A calibration without a rig, or a rig without a size.
    """
    rig, size = _rig(calibration)
    storage = cv2.FileStorage(".yml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    storage.writeComment("lengths in metres")
    storage.write("image_width", size[0])
    storage.write("image_height", size[1])
    for name, matrix in _matrices(rig, size).items():
        storage.write(name, np.asarray(matrix, dtype=np.float64))
    if calibration.rms is not None:
        storage.write("rms", calibration.rms)
    return str(storage.releaseAndGetString())


def ros_calibration(calibration: Calibration) -> tuple[str, str]:
    """Return ``camera_info`` YAML of the left and the right camera, in the format of ROS's camera_calibration_parsers.

    Raises
    ------
    ValueError
        A calibration without a rig, a rig without a size, or more distortion coefficients than ROS's models have.
    """
    rig, size = _rig(calibration)
    matrices = _matrices(rig, size)
    left, right = (_camera_info(name, size, number, matrices) for name, number in (("left", 1), ("right", 2)))
    return left, right


def calibration_json(calibration: Calibration) -> str:
    """Return a calibration as JSON, which :func:`stereolag.read_calibration` reads back.

    It has the matrices of both cameras, under OpenCV's names; or for a rectified pair ``focal_px``, ``baseline_m`` and
    so on.
    """
    document: dict[str, object]
    if calibration.rig is None:
        names = ("focal_px", "baseline_m", "doffs_px", "cx", "cy", "width", "height", "num_disparities")
        document = {name: getattr(calibration, name) for name in names if getattr(calibration, name) is not None}
    else:
        rig, size = _rig(calibration)
        document = {"image_width": size[0], "image_height": size[1], "length_unit": "m"}
        document |= {name: np.asarray(matrix).tolist() for name, matrix in _matrices(rig, size).items()}
        if calibration.num_disparities is not None:
            document["num_disparities"] = calibration.num_disparities
    if calibration.rms is not None:
        document["rms"] = calibration.rms
    return json.dumps(document | {"stereolag": VERSION}, indent=2) + "\n"


def _rig(calibration: Calibration) -> tuple[StereoRig, tuple[int, int]]:
    rig = calibration.rig
    if rig is None:
        raise ValueError("calibration has no rig: a pair that is already rectified has no cameras to write.")
    if rig.width is None or rig.height is None:
        raise ValueError("The rig of the calibration has no width and height; they are needed to rectify.")
    return rig, (rig.width, rig.height)


def _matrices(rig: StereoRig, size: tuple[int, int]) -> dict[str, npt.NDArray[np.float64]]:
    how = rectification(rig, size)
    return {
        "M1": rig.left_matrix,
        "D1": rig.left_distortion[None],
        "M2": rig.right_matrix,
        "D2": rig.right_distortion[None],
        "R": rig.rotation,
        "T": rig.translation[:, None],
        "R1": how.left_rotation,
        "R2": how.right_rotation,
        "P1": how.left_projection,
        "P2": how.right_projection,
        "Q": _reprojection(how.left_projection, how.right_projection),
    }


def _reprojection(left: npt.NDArray[np.float64], right: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return the (4, 4) matrix Q of OpenCV's ``stereoRectify`` for two projections."""
    focal, baseline = left[0, 0], -right[0, 3] / right[0, 0]
    q = np.eye(4)
    q[0, 3], q[1, 3], q[2, 3] = -left[0, 2], -left[1, 2], focal
    q[2, 2], q[3, 2], q[3, 3] = 0, 1 / baseline, (right[0, 2] - left[0, 2]) / baseline
    return q


def _camera_info(name: str, size: tuple[int, int], number: int, matrices: dict[str, npt.NDArray[np.float64]]) -> str:
    distortion = matrices[f"D{number}"].ravel()
    used = int(np.flatnonzero(distortion).max(initial=-1)) + 1
    model = next((model for model, count in _COEFFICIENTS.items() if used <= count), None)
    if model is None:
        raise ValueError(f"The {name} camera has {used} distortion coefficients; ROS's models have at most 8.")
    coefficients = np.zeros(_COEFFICIENTS[model])
    coefficients[: min(used, coefficients.size)] = distortion[: min(used, coefficients.size)]
    lines = [f"image_width: {size[0]}", f"image_height: {size[1]}", f"camera_name: {name}"]
    lines += _ros_matrix("camera_matrix", matrices[f"M{number}"])
    lines += [f"distortion_model: {model}"]
    lines += _ros_matrix("distortion_coefficients", coefficients[None])
    lines += _ros_matrix("rectification_matrix", matrices[f"R{number}"])
    lines += _ros_matrix("projection_matrix", matrices[f"P{number}"])
    return "\n".join(lines) + "\n"


def _ros_matrix(name: str, matrix: npt.NDArray[np.float64]) -> list[str]:
    rows, cols = matrix.shape
    numbers = ", ".join(repr(float(number)) for number in matrix.flat)
    return [f"{name}:", f"  rows: {rows}", f"  cols: {cols}", f"  data: [{numbers}]"]
