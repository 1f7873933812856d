"""Calibrations of stereo cameras: read in the layouts of many makers, written in those of OpenCV, ROS and this project.

A file is read in three steps: its text or arrays are parsed into entries by name
(:mod:`stereolag.io.calibration_files`); its layout turns the entries into parts
(:mod:`stereolag.io.calibration_layouts`); the parts make a calibration.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from stereolag.core.inputs import check_positive
from stereolag.geometry.calibration import MAX_ROW_DIFFERENCE_PX, UNITS, Calibration, Rectification, StereoRig
from stereolag.geometry.rectification import rectification_for, rectified_calibration
from stereolag.io.calibration_files import Entries, Entry, Matrix, names_found, parse_entries
from stereolag.io.calibration_layouts import Layout, layout_of
from stereolag.io.calibration_parts import FISHEYE, Parts, lens_of, unused_names
from stereolag.io.sources import Source, quote, read_bytes
from stereolag.version import VERSION

CALIBRATION_SUFFIXES = ("txt", "yaml", "yml", "json", "xml", "npy", "npz", "mat", "conf", "ini")

DEFAULT_MODE_SIZE = (1280, 720)
"""Size of pictures whose calibration is returned for a camera with several sizes; `modes` has the others."""

_UNIT_NAMES = {"m": "metres", "cm": "centimetres", "mm": "millimetres"}
_REQUIRED_PARTS = {"M1": "left camera matrix", "M2": "right camera matrix", "R": "rotation", "T": "translation"}


def read_calibration(*sources: Source, length_unit_m: float | None = None) -> Calibration:
    """Read the calibration of a stereo camera.

    The layouts of :data:`stereolag.io.calibration_layouts.LAYOUTS` are recognised by their content: ZED's ``SN*.conf``,
    DepthAI (OAK), RealSense, ROS (YAML, ``ost.txt``), MATLAB (structs as JSON or MAT), Middlebury, KITTI (the colour
    cameras 2 and 3, which took the images of its stereo benchmarks, before the grey 0 and 1), DrivingStereo,
    Cityscapes, DSEC, ORB-SLAM, VINS, OKVIS, Basalt, MRPT, MC-Calib, cvkit, ``K.txt``, stereodemo; JSON with
    ``focal_px`` and ``baseline_m``; and YAML, XML, JSON, NPY, NPZ or MAT with both cameras (M1, D1, M2, D2, R, T and
    other common names, such as Kalibr's) or the rectified pair (Q, or P1 and P2). Lenses are pinholes with OpenCV's
    distortion, or fisheyes that the file declares as such (``cv2.fisheye``, Kalibr's equidistant).

    Parameters
    ----------
    *sources
        Paths, bytes or binary file objects: one file, or several that belong together (``intrinsics.yml`` and
        ``extrinsics.yml`` of OpenCV, the two cameras of ROS).
    length_unit_m
        The unit of length, in metres, of files whose unit is neither stated nor fixed by their layout: 0.001 if the
        squares of the chessboard were measured in millimetres. None: metres, and millimetres for MATLAB.

    Returns
    -------
    calibration
        With its ``rig`` if the file has both cameras before rectification, and their rectification in the rig if the
        file states it (R1, R2 with P1, P2 or Q). ``notes`` names assumptions, and names without effect; ``modes`` holds
        the calibrations for other sizes of pictures.

    Raises
    ------
    ValueError
        A file that is empty, damaged or of another kind, or a calibration that is incomplete or makes no sense.
    OSError
        A path that cannot be opened.

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
    if length_unit_m is not None:
        check_positive(length_unit_m, "length_unit_m")
    entries = Entries(*(parse_entries(read_bytes(source, "calibration")) for source in sources))
    layout = layout_of(entries)
    lens = lens_of(entries)
    all_parts = layout.read(entries)
    unused = unused_names(entries, layout.ignored)
    modes, problem = [], None
    for parts in all_parts:
        try:
            modes.append(_calibration(layout, entries, parts, lens, unused, length_unit_m))
        except ValueError as error:
            problem = problem or error
    if not modes:
        raise problem or ValueError(f"The calibration ({layout.name}) has no size of pictures that is known here.")
    if len(modes) == 1:
        return modes[0]
    default = (
        modes[0]  # the rectified pair comes first
        if layout.name == "KITTI"
        else max(modes, key=lambda mode: ((mode.width, mode.height) == DEFAULT_MODE_SIZE, mode.width or 0))
    )
    return replace(default, modes=tuple(modes))


def _calibration(
    layout: Layout,
    entries: Entries,
    parts: Parts,
    lens: str,
    unused: Sequence[str],
    length_unit_m: float | None,
) -> Calibration:
    """Return the calibration from parts, with notes on what was assumed."""
    stated = _stated_unit(layout, parts)
    unit = stated or length_unit_m or UNITS[layout.unit]
    notes = []
    if stated is None and length_unit_m is None:
        notes.append(f"The file does not state its unit of length: {_UNIT_NAMES[layout.unit]} are assumed.")
    if stated and length_unit_m not in (None, stated):
        unit_name = next(name for symbol, name in _UNIT_NAMES.items() if UNITS[symbol] == stated)
        notes.append(f"The given unit is not used: by its format or its content, the file is in {unit_name}.")
    if unused:
        notes.append(f"Not used, since these names are unknown here: {names_found(unused)}.")
    if "baseline" in parts or "product" in parts:
        if "M1" in parts and "M2" not in parts | {"cx2": 0, "doffs": 0} and layout.name == "Middlebury":
            notes.append("The file has neither doffs nor cam1: the principal points are taken to be the same.")
        calibration = _from_focal_and_baseline(parts, unit)
    else:
        lens = lens or parts.get("lens", Entry("", "")).text()
        calibration = _from_cameras(entries, parts, lens, unit, unused, notes)
    width, height = _image_size(parts)
    count = parts["num_disparities"].counts(1)[0] if "num_disparities" in parts else None
    return replace(
        calibration,
        width=width,
        height=height,
        num_disparities=count,
        notes=tuple(notes),
        unit_stated=stated is not None,
    )


def _stated_unit(layout: Layout, parts: Parts) -> float | None:
    """Return the unit that a file states or its layout fixes, in metres; None if there is none."""
    if "unit" in parts:
        text = parts["unit"].text().lower()
        plain = text.replace("meter", "metre")
        unit = next((symbol for symbol, name in _UNIT_NAMES.items() if plain in (symbol, name, name[:-1])), None)
        if unit is None:
            raise ValueError(f"The calibration has {quote(text)} as its unit of length; allowed are m, cm and mm.")
        return UNITS[unit]
    return UNITS[layout.unit] if layout.unit_is_fixed else None


def _from_focal_and_baseline(parts: Parts, unit_m: float) -> Calibration:
    """Return the calibration of a rectified pair from its focal length, and its baseline or the product of both."""
    focal, baseline, product, doffs, cx, cx2, cy, turn = (
        float(parts[part].numbers(1)[0]) if part in parts else None
        for part in ("focal", "baseline", "product", "doffs", "cx", "cx2", "cy", "turn")
    )
    if "M1" in parts:
        (focal, _, cx), (_, _, cy), last = parts["M1"].matrix(3, 3).tolist()
        if not np.allclose(last, (0, 0, 1)):
            raise ValueError(
                f"{quote(parts['M1'].name)} in the calibration is not [[f, 0, cx], [0, f, cy], [0, 0, 1]]."
            )
    if "M2" in parts:
        cx2 = float(parts["M2"].matrix(3, 3)[0, 2])
    if focal is None or not focal > 0:
        raise ValueError(f"The calibration has the focal length {focal} px; it must be above 0.")
    if baseline is None and product is not None:
        baseline = product / focal
    if doffs is None:
        doffs = 0.0 if cx is None or cx2 is None else cx2 - cx
    return Calibration(focal, (baseline or 0.0) * unit_m, doffs, cx, cy, turn=round(turn or 0))


def _from_projections(parts: Parts, unit_m: float) -> Calibration:
    """Return the calibration of a rectified pair from its (3, 4) projections (Geiger et al., IJRR 2013).

    The right one has ``-focal * baseline`` at [0, 3], or at [1, 3] for cameras one above the other, whose pictures
    OpenCV leaves upright.
    """
    left, right = parts["P1"].projection(), parts["P2"].projection()
    focal, (across, down, _) = float(left[0, 0]), (left[:, 3] - right[:, 3]).tolist()
    turn = 0 if abs(across) >= abs(down) else int(np.sign(down))
    differences = np.abs((left - right)[:, :3])
    differences[1 if turn else 0, 2] = 0.0
    if differences.max() > MAX_ROW_DIFFERENCE_PX or not np.allclose(left[2, :3], (0, 0, 1)):
        raise ValueError(
            f"{quote(parts['P1'].name)} and {quote(parts['P2'].name)} are not of a rectified pair, whose projections "
            "differ in one centre and in the baseline alone; give both cameras (M1, D1, M2, D2, R, T) instead."
        )
    doffs = float(right[0, 2] - left[0, 2]) if not turn else float(right[1, 2] - left[1, 2]) * turn
    baseline = (abs(down) if turn else across) / focal * unit_m
    return Calibration(focal, baseline, doffs, float(left[0, 2]), float(left[1, 2]), turn=turn)


def _from_cameras(
    entries: Entries, parts: Parts, lens: str, unit_m: float, unused: Sequence[str], notes: list[str]
) -> Calibration:
    """Return the calibration from the cameras' matrices, before or after rectification."""
    rectification = _rectification(parts, unit_m)
    if {"M1", "M2"} & set(parts):
        missing = [
            part for part in _REQUIRED_PARTS if part not in parts and (rectification is None or part in ("M1", "M2"))
        ]
        if not missing:
            _check_lenses(parts, lens, unused, notes)
            return _calibration_of_rig(_stereo_rig(parts, lens, unit_m, rectification))
        if "Q" not in parts and not {"P1", "P2"} <= set(parts):
            raise ValueError(
                f"The calibration has {names_found(entry.name for entry in parts.values())}, but lacks "
                f"{', '.join(f'{_REQUIRED_PARTS[part]} ({part})' for part in missing)}; give the file that holds it, "
                "often extrinsics.yml, together with this one."
            )
    if {"P1", "P2"} <= set(parts):
        return _from_projections(parts, unit_m)
    if "Q" in parts:
        focal, inverse_baseline, doffs, cx, cy = _from_q(parts["Q"])
        return Calibration(focal, unit_m / inverse_baseline, doffs / inverse_baseline, cx, cy)
    names = dict.fromkeys([*(entry.name for entry in parts.values()), *entries])
    accepted = "both cameras (M1, D1, M2, D2, R, T), or of the rectified pair (Q, or P1 and P2)"
    if not parts:
        accepted = (
            "OpenCV, ROS, Kalibr, MATLAB, ZED, OAK, RealSense, Middlebury, KITTI and others, or JSON with focal_px and "
            "baseline_m"
        )
    raise ValueError(
        f"The calibration holds {names_found(names)}: it is in no known format, or lacks both cameras; accepted are "
        f"files of {accepted}."
    )


def _check_lenses(parts: Parts, lens: str, unused: Sequence[str], notes: list[str]) -> None:
    """Refuse lenses whose coefficients are missing although they are needed, and note assumptions about others."""
    missing = [part for part in ("D1", "D2") if part not in parts or parts[part].numbers().size == 0]
    unknown = f" Names that are unknown here: {names_found(unused)}." if unused else ""
    are_empty = lens != FISHEYE and {"D1", "D2"} <= set(parts)  # as ROS writes a lens without distortion
    if missing and lens and not are_empty:
        raise ValueError(
            f"The calibration declares a lens ({lens}), but its distortion coefficients ({', '.join(missing)}) are not "
            f"found.{unknown}"
        )
    if len(missing) == 1:
        raise ValueError(f"The calibration has the distortion of one lens and lacks the other ({missing[0]}).{unknown}")
    if missing:
        notes.append("The file has no distortion coefficients: both lenses are taken to be free of distortion.")
    elif not lens and any(parts[part].numbers().size == 4 for part in ("D1", "D2")):
        notes.append(
            "Four coefficients are read as k1, k2, p1, p2; for a fisheye, add camera_model: fisheye to the file."
        )


def _calibration_of_rig(rig: StereoRig) -> Calibration:
    """Return the expected calibration after rectification, with the rig; a missing size is guessed from the centre."""
    width = rig.width or max(1, round(2 * rig.left_matrix[0, 2] + 1))
    height = rig.height or max(1, round(2 * rig.left_matrix[1, 2] + 1))
    try:
        rectified = rectified_calibration(rig, (width, height))
    except ZeroDivisionError as error:
        raise ValueError("The calibration is of cameras that cannot be rectified: no focal length is left.") from error
    return replace(rectified, rig=rig)


def _image_size(parts: Parts) -> tuple[int | None, int | None]:
    """Return the width and the height of the images, px, from the first camera that states them; None if none does."""
    for side in "012":
        size, width, height = (parts.get(part + side) for part in ("size", "width", "height"))
        if size is not None:
            cols, rows = size.counts(2)
            return (rows, cols) if _is_transposed(parts, rows, cols) else (cols, rows)
        if width is not None and height is not None:
            return width.counts(1)[0], height.counts(1)[0]
    alone = [parts[part].counts(1)[0] if part in parts else None for part in ("width0", "height0")]
    return alone[0], alone[1]


def _is_transposed(parts: Parts, cols: int, rows: int) -> bool:
    """Return whether a size fits the left camera's principal point much better than the size as given, transposed."""
    if "M1" not in parts or parts["M1"].numbers().size != 9:
        return False
    cx, cy = parts["M1"].matrix(3, 3)[:2, 2]
    error, transposed_error = (
        abs(2 * cx / width - 1) + abs(2 * cy / height - 1) for width, height in ((cols, rows), (rows, cols))
    )
    return bool(3 * error < transposed_error)


def _from_q(entry: Entry) -> list[float]:
    """Return focal length, 1 / baseline, doffs / baseline, cx and cy from the Q of OpenCV's ``stereoRectify``."""
    q = entry.matrix(4, 4)
    if q[3, 2] == 0:
        raise ValueError(
            f"{quote(entry.name)} in the calibration has 0 at row 3, column 2, which would be an infinite baseline."
        )
    return [float(value) for value in (q[2, 3], q[3, 2], q[3, 3], -q[0, 3], -q[1, 3])]


def _stereo_rig(parts: Parts, lens: str, length_unit_m: float, rectification: Rectification | None) -> StereoRig:
    """Return both cameras; their pose, if it is not given, follows from their rectification."""
    if rectification is not None and not {"R", "T"} <= set(parts):
        to_right = rectification.right_rotation.T
        rotation = to_right @ rectification.left_rotation
        translation = to_right @ np.array([-rectification.baseline_m, 0.0, 0.0])
    else:
        rotation, translation = parts["R"].numbers(), parts["T"].numbers() * length_unit_m
        if rotation.size == 3:
            rotation = np.asarray(cv2.Rodrigues(rotation)[0], dtype=np.float64)
    empty = Entry("", np.zeros(0))
    cameras = [(_camera_matrix(parts[f"M{side}"]), parts.get(f"D{side}", empty).numbers()) for side in "12"]
    return StereoRig(
        *cameras[0],
        *cameras[1],
        rotation,
        translation,
        *_image_size(parts),
        rectification,
        fisheye=lens == FISHEYE,
    )


def _camera_matrix(entry: Entry) -> Matrix:
    """Return the (3, 3) matrix; four numbers are the focal lengths and the centre (Kalibr)."""
    if entry.numbers().size != 4:
        return entry.matrix(3, 3)
    fx, fy, cx, cy = entry.numbers()
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])


def _rectification(parts: Parts, length_unit_m: float) -> Rectification | None:
    """Return the rectification stated in the file; None if it is incomplete."""
    if not {"R1", "R2"} <= set(parts):
        return None
    if {"P1", "P2"} <= set(parts):
        if parts["P2"].projection()[1, 3]:  # one above the other: pictures are turned first, and rectified otherwise
            return None
        left, right = parts["P1"].projection().copy(), parts["P2"].projection().copy()
    elif "Q" in parts:
        focal, inverse_baseline, doffs, cx, cy = _from_q(parts["Q"])
        left = np.array([[focal, 0, cx, 0], [0, focal, cy, 0], [0, 0, 1, 0]])
        right = left.copy()
        right[0, 2:] += doffs / inverse_baseline, -focal * (1 / inverse_baseline)
    else:
        return None
    for projection in (left, right):
        projection[:, 3] *= length_unit_m
    return Rectification(parts["R1"].matrix(3, 3), parts["R2"].matrix(3, 3), left, right)


# Writing.


def opencv_calibration(calibration: Calibration) -> str:
    """Return both cameras and their rectification as the YAML of OpenCV's ``FileStorage``.

    The names are those of OpenCV's own sample: M1, D1, M2, D2, R, T (metres), R1, R2, P1, P2, Q, and the size.

    Raises
    ------
    ValueError
        A calibration without a rig, or a rig without a size.
    """
    size, matrices = _matrices(calibration)
    storage = cv2.FileStorage(".yml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    storage.writeComment("lengths in metres")
    storage.write("image_width", size[0])
    storage.write("image_height", size[1])
    if calibration.rig is not None and calibration.rig.fisheye:
        storage.write("camera_model", FISHEYE)
    for name, values in matrices.items():
        storage.write(name, np.asarray(values, dtype=np.float64))
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
    size, matrices = _matrices(calibration)
    if "R1" not in matrices:
        raise ValueError("ROS has no cameras one above the other: write the calibration as OpenCV's YAML or JSON.")
    fisheye = calibration.rig is not None and calibration.rig.fisheye
    return _camera_info("left", size, 1, matrices, fisheye), _camera_info("right", size, 2, matrices, fisheye)


def calibration_json(calibration: Calibration) -> str:
    """Return a calibration as JSON, which :func:`stereolag.read_calibration` reads back.

    It has the matrices of both cameras under OpenCV's names, or for a rectified pair ``focal_px``, ``baseline_m`` and
    so on.
    """
    if calibration.rig is None:
        names = ("focal_px", "baseline_m", "doffs_px", "cx", "cy", "width", "height", "num_disparities", "turn")
        document: dict[str, object] = {
            name: getattr(calibration, name)
            for name in names
            if getattr(calibration, name) is not None and (name != "turn" or calibration.turn)
        }
    else:
        size, matrices = _matrices(calibration)
        document = {"image_width": size[0], "image_height": size[1], "length_unit": "m"}
        if calibration.rig.fisheye:
            document["camera_model"] = FISHEYE
        document |= {name: np.asarray(matrix).tolist() for name, matrix in matrices.items()}
        if calibration.num_disparities is not None:
            document["num_disparities"] = calibration.num_disparities
    if calibration.rms is not None:
        document["rms"] = calibration.rms
    return json.dumps(document | {"stereolag": VERSION}, indent=2) + "\n"


def _matrices(calibration: Calibration) -> tuple[tuple[int, int], dict[str, Matrix]]:
    """Return the size of the images, and the matrices of the cameras and of their rectification by OpenCV's names."""
    rig = calibration.rig
    if rig is None:
        raise ValueError("calibration has no rig: a pair that is already rectified has no cameras to write.")
    if rig.width is None or rig.height is None:
        raise ValueError("The rig of the calibration has no width and height; they are needed to rectify.")
    size = rig.width, rig.height
    cameras = {
        "M1": rig.left_matrix,
        "D1": rig.left_distortion[None],
        "M2": rig.right_matrix,
        "D2": rig.right_distortion[None],
        "R": rig.rotation,
        "T": rig.translation[:, None],
    }
    if rig.turn:  # only turned pictures can be rectified
        return size, cameras
    rectification = rectification_for(rig, size)
    left, right = rectification.left_projection, rectification.right_projection
    return size, cameras | {
        "R1": rectification.left_rotation,
        "R2": rectification.right_rotation,
        "P1": left,
        "P2": right,
        "Q": _q_matrix(left, right),
    }


def _q_matrix(left: Matrix, right: Matrix) -> Matrix:
    """Return the (4, 4) matrix Q of OpenCV's ``stereoRectify`` for two projections."""
    (focal, _, cx, _), (_, _, cy, _), _ = left
    baseline = -right[0, 3] / right[0, 0]
    return np.array(
        [
            [1, 0, 0, -cx],
            [0, 1, 0, -cy],
            [0, 0, 0, focal],
            [0, 0, 1 / baseline, (right[0, 2] - cx) / baseline],
        ]
    )


def _camera_info(name: str, size: tuple[int, int], number: int, matrices: dict[str, Matrix], fisheye: bool) -> str:
    distortion = matrices[f"D{number}"].ravel()
    used = int(np.flatnonzero(distortion).max(initial=-1)) + 1
    if used > 8:
        raise ValueError(f"The {name} camera has {used} distortion coefficients; ROS's models have at most 8.")
    model, count = ("equidistant", 4) if fisheye else ("plumb_bob", 5) if used <= 5 else ("rational_polynomial", 8)
    lines = [
        f"image_width: {size[0]}",
        f"image_height: {size[1]}",
        f"camera_name: {name}",
        *_ros_matrix("camera_matrix", matrices[f"M{number}"]),
        f"distortion_model: {model}",
        *_ros_matrix("distortion_coefficients", np.pad(distortion[:used], (0, count - used))[None]),
        *_ros_matrix("rectification_matrix", matrices[f"R{number}"]),
        *_ros_matrix("projection_matrix", matrices[f"P{number}"]),
    ]
    return "\n".join(lines) + "\n"


def _ros_matrix(name: str, matrix: Matrix) -> list[str]:
    rows, cols = matrix.shape
    numbers = ", ".join(repr(float(number)) for number in matrix.flat)
    return [f"{name}:", f"  rows: {rows}", f"  cols: {cols}", f"  data: [{numbers}]"]
