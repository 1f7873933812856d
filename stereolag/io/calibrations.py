"""Calibrations of stereo cameras in the formats of Middlebury, KITTI, OpenCV, ROS, Kalibr, stereodemo and this project.

They are written in those of OpenCV, ROS and this project. The names in a file are split into words, since
``leftCameraMatrix``, ``camera_matrix_left``, ``K1`` and ``mtxL`` mean one part: a word may give the side (left, L, 0,
1, …), words such as "camera" are ignored, and the rest names the part.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable
from dataclasses import replace
from enum import StrEnum
from typing import TypeAlias

import cv2
import numpy as np

from stereolag.geometry.calibration import Calibration, Rectification, StereoRig
from stereolag.geometry.rectification import rectification, rectified_calibration
from stereolag.io.notations import Entries, Entry, Matrix, names_found, parse_entries
from stereolag.io.sources import Source, quote, read_bytes
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


CALIBRATION_SUFFIXES = ("txt", "yaml", "yml", "json", "xml", "npz")

Part: TypeAlias = tuple[Role, Side]
Parts: TypeAlias = dict[Part, Entry]

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
_SAYING_NOTHING = {"", "s", "cam", "cams", "stereo", "calibration", "calib", "parameters", "params"}
_WORDS = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")
_SIDE_WORDS = {"left": Side.LEFT, "l": Side.LEFT, "right": Side.RIGHT, "r": Side.RIGHT}

_ROTATION, _TRANSLATION = (Role.ROTATION, Side.BOTH), (Role.TRANSLATION, Side.BOTH)
_REPROJECTION = (Role.REPROJECTION, Side.BOTH)
_MATRICES, _PROJECTIONS, _RECTIFICATIONS = (
    ((role, Side.LEFT), (role, Side.RIGHT)) for role in (Role.MATRIX, Role.PROJECTION, Role.RECTIFICATION)
)
_LONE_MATRIX, _LONE_PROJECTION = (Role.MATRIX, Side.LONE), (Role.PROJECTION, Side.LONE)
_USUAL_NAMES = dict(zip((*_MATRICES, _ROTATION, _TRANSLATION), ("M1", "M2", "R", "T"), strict=True))

_KALIBR_POSE = "cam1.T_cn_cnm1"
_MODELS = {
    "distortion_model": ("plumb_bob", "rational_polynomial", "radtan", "radial-tangential", "none"),
    "camera_model": ("pinhole",),
}
"""The models of lenses that OpenCV's ``stereoRectify`` supports: no fisheyes."""

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
    entries = Entries({name: entry for one in files for name, entry in one.items()})
    if any(name in entries for name in _FOCAL):
        return _from_plain_numbers(entries)
    if "cam0" in entries:
        return _from_middlebury(entries)
    for left, right in _KITTI_PAIRS:
        if left in entries and right in entries:
            return _from_projections(entries[left], entries[right], *_size(entries))
    return _from_cameras(files, entries, length_unit_m)


def _size(entries: Entries) -> tuple[int | None, int | None]:
    return entries.count("width", "image_width"), entries.count("height", "image_height")


def _from_plain_numbers(entries: Entries) -> Calibration:
    """Read single numbers by name; stereodemo calls them ``fx``, ``baseline_meters``, ``cx0`` and ``cx1``."""
    width, height = _size(entries)
    cx, right_cx = entries.number("cx", "cx0"), entries.number("cx1")
    doffs = entries.number("doffs_px", "doffs")
    if doffs is None:
        doffs = 0.0 if cx is None or right_cx is None else right_cx - cx
    return Calibration(
        entries.required_number(*_FOCAL),
        entries.required_number(*_BASELINE),
        doffs,
        cx,
        entries.number("cy"),
        width=width,
        height=height,
        num_disparities=entries.count("num_disparities", "max_disparity"),
    )


def _from_middlebury(entries: Entries) -> Calibration:
    """Read lengths in mm and ``doffs = cx1 - cx0`` (https://vision.middlebury.edu/stereo/data/scenes2014/)."""
    left = entries["cam0"].matrix(3, 3)
    width, height = _size(entries)
    return Calibration(
        float(left[0, 0]),
        entries.required_number("baseline") / 1000,
        entries.number("doffs") or 0.0,
        float(left[0, 2]),
        float(left[1, 2]),
        width=width,
        height=height,
        num_disparities=entries.count("ndisp"),
    )


def _from_projections(
    left_entry: Entry, right_entry: Entry, width: int | None, height: int | None, length_unit_m: float = 1.0
) -> Calibration:
    """Read the (3, 4) projections of a rectified pair, ``P[0, 3] = -focal * baseline`` (Geiger et al., IJRR 2013)."""
    left, right = _projection(left_entry), _projection(right_entry)
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


def _from_cameras(files: list[Entries], entries: Entries, length_unit_m: float) -> Calibration:
    """Return the calibration from the cameras' matrices, before or after rectification."""
    parts, metric = _parts_together(files)
    unit = 1.0 if metric or _text(entries, "length_unit") == "m" else length_unit_m
    rig = _stereo_rig(files, parts, unit)
    width, height = _image_size(parts)
    if rig is not None:
        return _predicted(rig, entries.count("num_disparities"))
    if _REPROJECTION in parts:
        focal, back, doffs, cx, cy = _reprojected(parts[_REPROJECTION])
        return Calibration(focal, unit / back, doffs / back, cx, cy, width=width, height=height)
    if set(_PROJECTIONS) <= set(parts):
        left, right = (parts[part] for part in _PROJECTIONS)
        return _from_projections(left, right, width, height, unit)
    raise ValueError(
        f"The calibration holds {names_found(entries)}: it is in no known format, or lacks both cameras; accepted are "
        "files of Middlebury, KITTI, OpenCV, ROS, Kalibr, NPZ, or JSON with focal_px and baseline_m."
    )


def _predicted(rig: StereoRig, num_disparities: int | None) -> Calibration:
    """Return the calibration to expect after rectification, with the rig; a missing size is guessed from the centre."""
    width = rig.width or max(1, round(2 * rig.left_matrix[0, 2] + 1))
    height = rig.height or max(1, round(2 * rig.left_matrix[1, 2] + 1))
    try:
        rectified = rectified_calibration(rig, (width, height))
    except ZeroDivisionError as error:
        raise ValueError("The calibration is of cameras that cannot be rectified: no focal length is left.") from error
    return replace(rectified, width=rig.width, height=rig.height, rig=rig, num_disparities=num_disparities)


def _stereo_parts(entries: Entries) -> Parts:
    """Return the parts meant by the names in a file; of two names for one part, the first counts."""
    numbered = [(entry, *meaning) for name, entry in entries.items() if (meaning := _meaning(name)) is not None]
    from_zero = any(side == "0" for _, _, side in numbered)
    sides: dict[str, Side] = dict(zip("01" if from_zero else "12", (Side.LEFT, Side.RIGHT), strict=True))
    parts: Parts = {}
    for entry, role, side in numbered:
        if isinstance(side, Side) or side in sides:
            parts.setdefault((role, side if isinstance(side, Side) else sides[side]), entry)
    if {_LONE_MATRIX, _LONE_PROJECTION, _ROTATION} <= set(parts) and _TRANSLATION not in parts:
        # Beside K and P of a single camera, R is its rectification (ROS).
        parts.setdefault((Role.RECTIFICATION, Side.LONE), parts.pop(_ROTATION))
    return parts


def _meaning(name: str) -> tuple[Role, Side | str] | None:
    """Return the role that a name means and its side, or the number of its camera; None if unknown."""
    words = [word.lower().replace("camera", "") for word in _words(name)]
    telling = [word for word in words if word not in _SAYING_NOTHING]
    rest = "".join(telling)
    if rest in _ROLES["both"]:
        return _ROLES["both"][rest], Side.BOTH
    for place, word in enumerate(telling):
        others = "".join(telling[:place] + telling[place + 1 :])
        if (word in _SIDE_WORDS or word.isdecimal()) and others in _ROLES["one"]:
            return _ROLES["one"][others], _SIDE_WORDS.get(word, word.lstrip("0") or "0")
    return (_ROLES["one"][rest], Side.LONE) if rest in _ROLES["one"] else None


def _words(name: str) -> Iterable[str]:
    """Yield the words of a name; two capitals such as KL and DR are a part and its side."""
    for word in _WORDS.findall(name[:80]):
        yield from word if re.fullmatch("[KMADPR][LR]", word) else (word,)


def _text(entries: Entries, name: str) -> str:
    return str(entries[name].value) if name in entries else ""


def _parts_together(files: list[Entries]) -> tuple[Parts, bool]:
    """Return the combined parts of files that belong together, and whether their lengths are always in metres.

    Two files with one camera each are the left and the right one: by their projections (ROS), by the cameras' names, or
    in the given order. ROS and Kalibr write metres.
    """
    found = [_stereo_parts(entries) for entries in files]
    lone = [
        index
        for index, parts in enumerate(found)
        if {_LONE_PROJECTION, _LONE_MATRIX} & set(parts) and not set(_MATRICES) & set(parts)
    ]
    if len(lone) > 2:
        raise ValueError(f"{len(lone)} files hold the calibration of one camera each; a stereo camera has two.")
    metric = bool(lone) and all(_LONE_PROJECTION in found[index] for index in lone)
    sides = [Side.LEFT, Side.RIGHT]
    if len(lone) == 1 and metric:
        sides = [Side.LEFT if _shift(found[lone[0]]) >= 0 else Side.RIGHT]
    elif len(lone) == 2 and _is_right(files[lone[0]], found[lone[0]], found[lone[1]]):
        lone.reverse()
    for index, side in zip(lone, sides, strict=False):
        found[index] = {(role, side if of is Side.LONE else of): it for (role, of), it in found[index].items()}
    together: Parts = {}
    for entries, parts in zip(files, found, strict=True):
        together = parts | together
        if _KALIBR_POSE in entries:
            pose = entries[_KALIBR_POSE].matrix(4, 4)
            together |= {_ROTATION: Entry(_KALIBR_POSE, pose[:3, :3]), _TRANSLATION: Entry(_KALIBR_POSE, pose[:3, 3])}
            metric = True
    if len(lone) == 1:
        _complete_projections(together, files[lone[0]])
    return together, metric


def _shift(parts: Parts) -> float:
    return float(_projection(parts[_LONE_PROJECTION])[0, 3])


def _is_right(entries: Entries, parts: Parts, others: Parts) -> bool:
    """Return whether the first of two cameras is the right one."""
    if _LONE_PROJECTION in parts and _LONE_PROJECTION in others and _shift(parts) != _shift(others):
        return _shift(parts) < _shift(others)
    return "right" in _text(entries, "camera_name").lower()


def _complete_projections(parts: Parts, entries: Entries) -> None:
    """Derive the projection of the left camera if only that of the right one is given (ROS)."""
    left, right = _PROJECTIONS
    if right in parts and left not in parts:
        parts[left] = Entry(parts[right].name, _projection(parts[right]) * [[1, 1, 1, 0]])
    elif left in parts:
        raise ValueError(
            f"The calibration (ROS) is of the left camera alone: {quote(parts[left].name)} has no baseline; give the "
            "file of the right camera, or both."
        )
    else:
        raise ValueError(
            f"The calibration is of one camera alone ({names_found(entries)}); give the file of the other camera, and "
            "of the rotation (R) and translation (T) between them, together with it."
        )


def _image_size(parts: Parts) -> tuple[int | None, int | None]:
    """Return the width and the height of the images, px, from whichever camera states them."""
    for side in (Side.LONE, Side.LEFT, Side.RIGHT):
        size, width, height = (parts.get((role, side)) for role in (Role.SIZE, Role.WIDTH, Role.HEIGHT))
        if size is not None:
            cols, rows = size.counts(2)
            return cols, rows
        if width is not None and height is not None:
            return width.counts(1)[0], height.counts(1)[0]
    return None, None


def _projection(entry: Entry) -> Matrix:
    """Return a (3, 4) projection, whose focal length must be above 0."""
    found = entry.matrix(3, 4)
    if found[0, 0] <= 0:
        raise ValueError(
            f"{quote(entry.name)} in the calibration has the focal length {found[0, 0]:g} px; it must be above 0."
        )
    return found


def _reprojected(entry: Entry) -> tuple[float, float, float, float, float]:
    """Return the focal length, 1 / baseline, doffs / baseline and the centre from Q of OpenCV's ``stereoRectify``."""
    q = entry.matrix(4, 4)
    if q[3, 2] == 0:
        raise ValueError(
            f"{quote(entry.name)} in the calibration has 0 at row 3, column 2, which would be an infinite baseline."
        )
    return float(q[2, 3]), float(q[3, 2]), float(q[3, 3]), -float(q[0, 3]), -float(q[1, 3])


def _stereo_rig(files: list[Entries], parts: Parts, length_unit_m: float) -> StereoRig | None:
    """Return both cameras; None if there are none, or some are missing but the rectified projection is known."""
    if not set(_MATRICES) & set(parts):
        return None
    how = _rectification(parts, length_unit_m)
    missing = [part for part in _USUAL_NAMES if part not in parts and (how is None or part in _MATRICES)]
    if missing:
        if _REPROJECTION in parts or set(_PROJECTIONS) <= set(parts):
            return None
        lacking = ", ".join(
            f"{'' if side is Side.BOTH else f'{side} '}{role} ({_USUAL_NAMES[role, side]})" for role, side in missing
        )
        raise ValueError(
            f"The calibration has {names_found(entry.name for entry in parts.values())}, but lacks {lacking}; give the "
            "file that holds it, often extrinsics.yml, together with this one."
        )
    _check_models(files)
    if how is not None and not {_ROTATION, _TRANSLATION} <= set(parts):
        back = how.right_rotation.T
        rotation, translation = back @ how.left_rotation, back @ np.array([-how.baseline_m, 0.0, 0.0])
    else:
        rotation, translation = parts[_ROTATION].numbers(), parts[_TRANSLATION].numbers() * length_unit_m
        if rotation.size == 3:
            rotation = np.asarray(cv2.Rodrigues(rotation)[0], dtype=np.float64)
    (left, left_lens), (right, right_lens) = (
        (_camera_matrix(parts[Role.MATRIX, side]), parts.get((Role.DISTORTION, side), Entry("", np.zeros(0))).numbers())
        for side in (Side.LEFT, Side.RIGHT)
    )
    return StereoRig(left, left_lens, right, right_lens, rotation, translation, *_image_size(parts), how)


def _rectification(parts: Parts, length_unit_m: float) -> Rectification | None:
    """Return the rectification stated in the file; None if it is incomplete."""
    if not set(_RECTIFICATIONS) <= set(parts):
        return None
    if set(_PROJECTIONS) <= set(parts):
        left, right = (_projection(parts[part]).copy() for part in _PROJECTIONS)
    elif _REPROJECTION in parts:
        focal, back, doffs, cx, cy = _reprojected(parts[_REPROJECTION])
        left = np.array([[focal, 0, cx, 0], [0, focal, cy, 0], [0, 0, 1, 0]])
        right = left.copy()
        right[0, 2:] += doffs / back, -focal * (1 / back)
    else:
        return None
    for one in (left, right):
        one[:, 3] *= length_unit_m
    left_turn, right_turn = (parts[part].matrix(3, 3) for part in _RECTIFICATIONS)
    return Rectification(left_turn, right_turn, left, right)


def _camera_matrix(entry: Entry) -> Matrix:
    """Return the (3, 3) matrix; four numbers are the focal lengths and the centre (Kalibr)."""
    numbers = entry.numbers()
    if numbers.size == 4:
        return np.array([[numbers[0], 0, numbers[2]], [0, numbers[1], numbers[3]], [0, 0, 1]])
    return entry.matrix(3, 3)


def _check_models(files: list[Entries]) -> None:
    for entries in files:
        for name, entry in entries.items():
            allowed = _MODELS.get(name.rsplit(".", 1)[-1])
            if allowed and str(entry.value).lower() not in allowed:
                raise ValueError(
                    f"The calibration has {quote(str(entry.value))} for {quote(name)}, which is not known here; "
                    f"allowed are {', '.join(allowed)}."
                )


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


def _matrices(rig: StereoRig, size: tuple[int, int]) -> dict[str, Matrix]:
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


def _reprojection(left: Matrix, right: Matrix) -> Matrix:
    """Return the (4, 4) matrix Q of OpenCV's ``stereoRectify`` for two projections."""
    focal, baseline = left[0, 0], -right[0, 3] / right[0, 0]
    q = np.eye(4)
    q[0, 3], q[1, 3], q[2, 3] = -left[0, 2], -left[1, 2], focal
    q[2, 2], q[3, 2], q[3, 3] = 0, 1 / baseline, (right[0, 2] - left[0, 2]) / baseline
    return q


def _camera_info(name: str, size: tuple[int, int], number: int, matrices: dict[str, Matrix]) -> str:
    distortion = matrices[f"D{number}"].ravel()
    used = int(np.flatnonzero(distortion).max(initial=-1)) + 1
    if used > 8:
        raise ValueError(f"The {name} camera has {used} distortion coefficients; ROS's models have at most 8.")
    model, count = ("plumb_bob", 5) if used <= 5 else ("rational_polynomial", 8)
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
