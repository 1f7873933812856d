"""Two cameras before rectification, and their rectification, from the parts in calibration files."""

from __future__ import annotations

import cv2
import numpy as np

from stereolag.geometry.rig import Rectification, StereoRig
from stereolag.io.camera_names import Part, Parts, Role, Side, stereo_parts
from stereolag.io.entries import Entries, Matrix, counted, matrix, names_found, vector
from stereolag.io.sources import quoted

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
