"""Calibrations in the formats of Middlebury, KITTI, OpenCV, ROS, Kalibr, stereodemo and this project."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable
from dataclasses import replace
from enum import StrEnum
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.geometry.calibration import Calibration, Rectification, StereoRig
from stereolag.geometry.rectification import rectification, rectified_calibration
from stereolag.io.notations import (
    Entries,
    Matrix,
    counted,
    matrix,
    names_found,
    optional_count,
    optional_number,
    parse_entries,
    required_number,
    vector,
)
from stereolag.io.sources import Source, quoted, read_bytes
from stereolag.version import VERSION


class Role(StrEnum):
    """The parts of a calibration."""

    MATRIX = "camera matrix"
    DISTORTION = "distortion"
    RECTIFICATION = "rectification"
    PROJECTION = "projection"
    ROTATION = "rotation"
    TRANSLATION = "translation"
    REPROJECTION = "reprojection"
    SIZE = "size"
    WIDTH = "width"
    HEIGHT = "height"


class Side(StrEnum):
    """The camera to which a part belongs; LONE is the only camera in its file, BOTH the pair."""

    LEFT = "left"
    RIGHT = "right"
    LONE = "lone"
    BOTH = "both"


class Part(NamedTuple):
    """The meaning of a name."""

    role: Role
    side: Side


Parts = dict[Part, tuple[str, Matrix | str]]
"""The name under which each part was found, and its value."""

_OF_ONE_CAMERA = {
    Role.MATRIX: "k m a mtx mat cm matrix cammatrix intrinsic intrinsics intrinsicmatrix intrinsicsmatrix",
    Role.DISTORTION: "d dist distortion distortions distcoeff distcoeffs distcoef distcoefs distcoefficients distvec "
    "distortioncoeff distortioncoeffs distortioncoefficient distortioncoefficients distortionvector distortionmatrix",
    Role.RECTIFICATION: "r rect rectification rectificationmatrix rectmatrix rrect rectr rectificationrotation "
    "rectificationtransform recttrans rectifyrotation",
    Role.PROJECTION: "p proj projection projectionmatrix projmatrix projmat projmtx prect",
    Role.SIZE: "imagesize imgsize size resolution framesize imageresolution",
    Role.WIDTH: "width imagewidth imgwidth imagesizewidth resolutionwidth w",
    Role.HEIGHT: "height imageheight imgheight imagesizeheight resolutionheight h",
}
_OF_BOTH = {
    Role.ROTATION: "r rot rotation rotmat rotmatrix rotationmatrix rmat rmatrix rvec om",
    Role.TRANSLATION: "t trans translation translationvector translationmatrix tvec tvector transvector",
    Role.REPROJECTION: "q qmatrix disparitytodepth disparitytodepthmatrix reprojectionmatrix",
}
_ROLES = {
    of: {name: role for role, names in roles.items() for name in names.split()}
    for of, roles in (("one", _OF_ONE_CAMERA), ("both", _OF_BOTH))
}
_LEFT, _RIGHT = ("left", "l"), ("right", "r")
_SAYING_NOTHING = {"", "s", "cam", "cams", "stereo", "calibration", "calib", "parameters", "params"}
_WORDS = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")


def stereo_parts(entries: Entries) -> Parts:
    """Return the parts meant by the names in a file; of two names for one part, the first counts."""
    numbered = [(name, *meaning) for name in entries if (meaning := _meaning(name)) is not None]
    from_zero = any(side == "0" for _, role, side in numbered if role in _OF_ONE_CAMERA)
    sides = {"0": Side.LEFT, "1": Side.RIGHT} if from_zero else {"1": Side.LEFT, "2": Side.RIGHT}
    sides |= {"left": Side.LEFT, "right": Side.RIGHT, "": Side.LONE, "both": Side.BOTH}
    parts: Parts = {}
    for name, role, side in numbered:
        if side in sides:
            parts.setdefault(Part(role, sides[side]), (name, entries[name]))
    return _of_a_lone_camera(parts)


def _meaning(name: str) -> tuple[Role, str] | None:
    """Return the role that a name means and its side: "left", "right", a number, "" or "both"; None if unknown."""
    words = [word.lower().replace("camera", "") for word in _words(name)]
    telling = [word for word in words if word not in _SAYING_NOTHING]
    rest = "".join(telling)
    if rest in _ROLES["both"]:
        return _ROLES["both"][rest], "both"
    for place, word in enumerate(telling):
        side = "left" if word in _LEFT else "right" if word in _RIGHT else word.lstrip("0") or "0"
        others = "".join(telling[:place] + telling[place + 1 :])
        if (side in ("left", "right") or side.isdecimal()) and others in _ROLES["one"]:
            return _ROLES["one"][others], side
    return (_ROLES["one"][rest], "") if rest in _ROLES["one"] else None


def _words(name: str) -> Iterable[str]:
    """Yield the words of a name; two capitals such as KL and DR are a part and its side."""
    for word in _WORDS.findall(name[:80]):
        yield from word if re.fullmatch("[KMADPR][LR]", word) else (word,)


def _of_a_lone_camera(parts: Parts) -> Parts:
    """Return the parts with R as the camera's rectification if K and P of a single camera accompany it (ROS)."""
    rotation = Part(Role.ROTATION, Side.BOTH)
    alone = {Part(Role.MATRIX, Side.LONE), Part(Role.PROJECTION, Side.LONE)} <= set(parts)
    if alone and rotation in parts and Part(Role.TRANSLATION, Side.BOTH) not in parts:
        parts.setdefault(Part(Role.RECTIFICATION, Side.LONE), parts.pop(rotation))
    return parts


_KALIBR_POSE = "cam1.T_cn_cnm1"
_MODELS = {
    "distortion_model": ("plumb_bob", "rational_polynomial", "radtan", "radial-tangential", "none"),
    "camera_model": ("pinhole",),
}
_USUAL_NAMES = {
    Part(Role.MATRIX, Side.LEFT): "M1",
    Part(Role.MATRIX, Side.RIGHT): "M2",
    Part(Role.ROTATION, Side.BOTH): "R",
    Part(Role.TRANSLATION, Side.BOTH): "T",
}
ROTATION, TRANSLATION = Part(Role.ROTATION, Side.BOTH), Part(Role.TRANSLATION, Side.BOTH)
REPROJECTION = Part(Role.REPROJECTION, Side.BOTH)
_MATRICES = Part(Role.MATRIX, Side.LEFT), Part(Role.MATRIX, Side.RIGHT)
PROJECTIONS = Part(Role.PROJECTION, Side.LEFT), Part(Role.PROJECTION, Side.RIGHT)
_RECTIFICATIONS = Part(Role.RECTIFICATION, Side.LEFT), Part(Role.RECTIFICATION, Side.RIGHT)
_LONE_PROJECTION, _LONE_MATRIX = Part(Role.PROJECTION, Side.LONE), Part(Role.MATRIX, Side.LONE)


def parts_together(files: list[Entries]) -> tuple[Parts, bool]:
    """Return the combined parts of files that belong together, and whether their lengths are always in metres.

    Two files with one camera each are the left and the right one: by their projections (ROS), by the cameras' names, or
    in the given order. ROS and Kalibr write metres.

    Raises
    ------
    ValueError
        More than two files with one camera each, or a single one that does not describe the pair.
    """
    found = [stereo_parts(entries) for entries in files]
    lone = [index for index, parts in enumerate(found) if _LONE_PROJECTION in parts or _LONE_MATRIX in parts]
    lone = [index for index in lone if not set(_MATRICES) & set(found[index])]
    if len(lone) > 2:
        raise ValueError(f"{len(lone)} files hold the calibration of one camera each; a stereo camera has two.")
    metric = bool(lone) and all(_LONE_PROJECTION in found[index] for index in lone)
    sides: tuple[Side, ...] = (Side.LEFT, Side.RIGHT)
    if len(lone) == 1 and metric:
        sides = (Side.LEFT,) if _shift(found[lone[0]]) >= 0 else (Side.RIGHT,)
    elif len(lone) == 2 and _is_right(files[lone[0]], found[lone[0]], found[lone[1]]):
        lone.reverse()
    for index, side in zip(lone, sides, strict=False):
        found[index] = {Part(role, side if of is Side.LONE else of): it for (role, of), it in found[index].items()}
    together: Parts = {}
    for entries, parts in zip(files, found, strict=True):
        together = parts | together
        if _KALIBR_POSE in entries:
            pose = matrix(entries, _KALIBR_POSE, (4, 4))
            together |= {ROTATION: (_KALIBR_POSE, pose[:3, :3]), TRANSLATION: (_KALIBR_POSE, pose[:3, 3])}
            metric = True
    if len(lone) == 1:
        _complete_projections(together, files[lone[0]])
    return together, metric


def stereo_rig(files: list[Entries], parts: Parts, length_unit_m: float) -> StereoRig | None:
    """Return both cameras; None if there are none, or some are missing but the rectified projection is known.

    Raises
    ------
    ValueError
        Parts that are missing or do not fit together, or an unsupported lens model.
    """
    if not set(_MATRICES) & set(parts):
        return None
    rectification = _rectification(parts, length_unit_m)
    missing = [part for part in _MATRICES if part not in parts]
    if rectification is None:
        missing += [part for part in (ROTATION, TRANSLATION) if part not in parts]
    if missing:
        if REPROJECTION in parts or set(PROJECTIONS) <= set(parts):
            return None
        lacking = ", ".join(_in_words(part) for part in missing)
        raise ValueError(
            f"The calibration has {names_found(dict(parts.values()))}, but lacks {lacking}; give the file that holds "
            "it, often extrinsics.yml, together with this one."
        )
    _check_models(files)
    rotation, translation = _pose(parts, rectification, length_unit_m)
    width, height = image_size(parts)
    return StereoRig(
        _camera_matrix(parts, Side.LEFT),
        _distortion(parts, Side.LEFT),
        _camera_matrix(parts, Side.RIGHT),
        _distortion(parts, Side.RIGHT),
        rotation,
        translation,
        width,
        height,
        rectification,
    )


def image_size(parts: Parts) -> tuple[int | None, int | None]:
    """Return the width and the height of the images, px, from whichever camera states them."""
    for side in (Side.LONE, Side.LEFT, Side.RIGHT):
        size, width, height = (parts.get(Part(role, side)) for role in (Role.SIZE, Role.WIDTH, Role.HEIGHT))
        if size is not None:
            cols, rows = vector(dict([size]), size[0], 2)
            return counted(cols, size[0]), counted(rows, size[0])
        if width is not None and height is not None:
            (cols,), (rows,) = vector(dict([width]), width[0], 1), vector(dict([height]), height[0], 1)
            return counted(cols, width[0]), counted(rows, height[0])
    return None, None


def projection(parts: Parts, part: Part) -> Matrix:
    """Return a (3, 4) projection, whose focal length must be above 0."""
    name, value = parts[part]
    found = matrix({name: value}, name, (3, 4))
    if found[0, 0] <= 0:
        raise ValueError(
            f"{quoted(name)} in the calibration has the focal length {found[0, 0]:g} px; it must be above 0."
        )
    return found


def _in_words(part: Part) -> str:
    side = "" if part.side is Side.BOTH else f"{part.side} "
    return f"{side}{part.role} ({_USUAL_NAMES[part]})"


def _shift(parts: Parts) -> float:
    return float(projection(parts, _LONE_PROJECTION)[0, 3])


def _is_right(entries: Entries, parts: Parts, others: Parts) -> bool:
    """Return whether the first of two cameras is the right one."""
    if _LONE_PROJECTION in parts and _LONE_PROJECTION in others and _shift(parts) != _shift(others):
        return _shift(parts) < _shift(others)
    return "right" in str(entries.get("camera_name", "")).lower()


def _complete_projections(parts: Parts, entries: Entries) -> None:
    """Derive the projection of the left camera if only that of the right one is given (ROS)."""
    left, right = PROJECTIONS
    if right in parts and left not in parts:
        name = parts[right][0]
        parts[left] = name, projection(parts, right) * [[1, 1, 1, 0]]
        parts.pop(Part(Role.MATRIX, Side.RIGHT), None)
        return
    if set(_MATRICES) <= set(parts) or REPROJECTION in parts:
        return
    if left in parts:
        raise ValueError(
            f"The calibration (ROS) is of the left camera alone: {quoted(parts[left][0])} has no baseline; give the "
            "file of the right camera, or both."
        )
    raise ValueError(
        f"The calibration is of one camera alone ({names_found(entries)}); give the file of the other camera, and of "
        "the rotation (R) and translation (T) between them, together with it."
    )


def _rectification(parts: Parts, length_unit_m: float) -> Rectification | None:
    """Return the rectification stated in the file; None if it is incomplete."""
    if not set(_RECTIFICATIONS) <= set(parts):
        return None
    if set(PROJECTIONS) <= set(parts):
        left, right = (projection(parts, part).copy() for part in PROJECTIONS)
    elif REPROJECTION in parts:
        left, right = _projections_of(*parts[REPROJECTION])
    else:
        return None
    for one in (left, right):
        one[:, 3] *= length_unit_m
    rotations = [matrix(dict([parts[part]]), parts[part][0], (3, 3)) for part in _RECTIFICATIONS]
    return Rectification(rotations[0], rotations[1], left, right)


def _projections_of(name: str, value: Matrix | str) -> tuple[Matrix, Matrix]:
    """Return the projections of both cameras from the reprojection matrix Q."""
    q = matrix({name: value}, name, (4, 4))
    if q[3, 2] == 0:
        raise ValueError(
            f"{quoted(name)} in the calibration has 0 at row 3, column 2, which would be an infinite baseline."
        )
    focal, baseline, doffs = q[2, 3], 1 / q[3, 2], q[3, 3] / q[3, 2]
    left = np.array([[focal, 0, -q[0, 3], 0], [0, focal, -q[1, 3], 0], [0, 0, 1, 0]])
    right = left + np.array([[0, 0, doffs, -focal * baseline], [0, 0, 0, 0], [0, 0, 0, 0]])
    return left, right


def _pose(parts: Parts, rectification: Rectification | None, length_unit_m: float) -> tuple[Matrix, Matrix]:
    """Return rotation and translation, derived from the rectification of both cameras if they are missing."""
    if rectification is not None and not {ROTATION, TRANSLATION} <= set(parts):
        back = rectification.right_rotation.T
        along_rows = np.array([-rectification.baseline_m, 0.0, 0.0])
        return back @ rectification.left_rotation, back @ along_rows
    name, value = parts[ROTATION]
    rotation = vector({name: value}, name)
    if rotation.size == 3:
        rotation = np.asarray(cv2.Rodrigues(rotation)[0], dtype=np.float64)
    name, value = parts[TRANSLATION]
    return rotation, vector({name: value}, name) * length_unit_m


def _camera_matrix(parts: Parts, side: Side) -> Matrix:
    """Return the (3, 3) matrix; four numbers are the focal lengths and the centre (Kalibr)."""
    name, value = parts[Part(Role.MATRIX, side)]
    numbers = vector({name: value}, name)
    if numbers.size == 4:
        return np.array([[numbers[0], 0, numbers[2]], [0, numbers[1], numbers[3]], [0, 0, 1]])
    return matrix({name: value}, name, (3, 3))


def _distortion(parts: Parts, side: Side) -> Matrix:
    name, value = parts.get(Part(Role.DISTORTION, side), ("", np.zeros(0)))
    return vector({name: value}, name)


def _check_models(files: list[Entries]) -> None:
    """Refuse lens models that OpenCV's ``stereoRectify`` does not support: fisheyes above all."""
    for entries in files:
        for name, value in entries.items():
            allowed = _MODELS.get(name.rsplit(".", 1)[-1])
            if allowed and str(value).lower() not in allowed:
                raise ValueError(
                    f"The calibration has {quoted(str(value))} for {quoted(name)}, which is not known here; allowed "
                    f"are {', '.join(allowed)}."
                )


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
    for name, values in _matrices(rig, size).items():
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
