"""The parts of a calibration, named as in OpenCV, and the many names that files use for them."""

from __future__ import annotations

import difflib
import re
from collections import ChainMap
from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np

from stereolag.io.calibration_files import Entries, Entry, Matrix, names_found
from stereolag.io.sources import quote

Parts: TypeAlias = dict[str, Entry]
"""Entries by OpenCV's names: M, D, R, P of each camera, and in the same way size, width and height, with 1 for the left
camera (``M1``), 2 for the right one and 0 for the only camera in a file; R, T and Q of both. Of a rectified pair: focal
(or M1) and baseline (or product, focal length × baseline), and if known doffs, cx, cx2, cy. Also: lens, unit and
num_disparities."""

SIZE_NAMES = {"width0": "width|image_width|camera.width", "height0": "height|image_height|camera.height"}
NUM_DISPARITIES_NAMES = "num_disparities|max_disparity|ndisp"
COEFFICIENT_KEYS = {False: ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"), True: ("k1", "k2", "k3", "k4")}
"""Keys of the coefficients of a lens given as single numbers, by whether it is a fisheye."""


def numeric_entry(name: str, values: Any) -> Entry:
    """Return an entry with computed numbers."""
    return Entry(name, np.asarray(values, dtype=np.float64))


def camera_parts(
    entries: Entries,
    side: str,
    matrix: str,
    lens: str,
    matrix_keys: Sequence[str] = ("fx", "fy", "cx", "cy"),
    lens_keys: Sequence[str] = COEFFICIENT_KEYS[False],
) -> Parts:
    """Return a camera's matrix and distortion from single numbers, ``matrix.fx`` and so on, and ``lens.k1`` and so on.

    If the file has any coefficient, it must have the first two; others that it lacks are 0.
    """
    fx, fy, cx, cy = (float(entries.required(f"{matrix}.{name}").numbers(1)[0]) for name in matrix_keys)
    parts = {f"M{side}": numeric_entry(matrix, [[fx, 0, cx], [0, fy, cy], [0, 0, 1]])}
    names = [f"{lens}.{name}" for name in lens_keys]
    if any(entries.find(name) for name in names):
        for name in names[:2]:
            entries.required(name)
        parts[f"D{side}"] = numeric_entry(lens, [entries.number(name) or 0.0 for name in names])
    return parts


def pose_parts(name: str, rotation: Matrix, translation: Matrix) -> Parts:
    """Return R and T: a point at x in the left camera's frame is at ``R @ x + T`` in the right one's."""
    return {"R": numeric_entry(name, rotation), "T": numeric_entry(name, translation)}


def relative_pose(name: str, left: Matrix, right: Matrix) -> Parts:
    """Return R and T from the (4, 4) or (3, 4) transforms of a common frame into those of the two cameras."""
    rotation = right[:3, :3] @ left[:3, :3].T
    return pose_parts(name, rotation, right[:3, 3] - rotation @ left[:3, 3])


def rigid_transform(quaternion: Sequence[float] | Matrix, translation: Sequence[float] | Matrix) -> Matrix:
    """Return the (3, 4) transform that rotates by a quaternion (w, x, y, z) and then translates."""
    w, x, y, z = np.asarray(quaternion) / (np.linalg.norm(quaternion) or 1.0)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.column_stack((np.eye(3) + 2 * (w * cross + cross @ cross), translation))


def inverse(transform: Matrix) -> Matrix:
    """Return the (3, 4) inverse of a rigid transform."""
    rotation = transform[:3, :3].T
    return np.column_stack((rotation, -rotation @ transform[:3, 3]))


# The parts by name. The names in a file are split into words, since ``leftCameraMatrix``, ``camera_matrix_left`` and
# ``mtxL`` all mean the same part: a word may give the side (left, L, 0, 1, …), words such as "camera" are ignored, and
# the rest names the part.

_CAMERA_PART_NAMES = {
    "M": "k m a mtx mat cm matrix cammatrix intrinsic intrinsics intrinsicmatrix intrinsicsmatrix",
    "D": "d dfe dist distortion distortions distcoeff distcoeffs distcoef distcoefs distcoefficients distvec "
    "distortioncoeff distortioncoeffs distortioncoefficient distortioncoefficients coeffs "
    "coefficients distortionvector distortionmatrix",
    "R": "r rect rectification rectificationmatrix rectmatrix rrect rectr rectificationrotation "
    "rectificationtransform recttrans rectifyrotation",
    "P": "p proj projection projectionmatrix projmatrix projmat projmtx prect",
    "size": "imagesize imgsize size resolution framesize imageresolution",
    "width": "width imagewidth imgwidth imagesizewidth resolutionwidth w",
    "height": "height imageheight imgheight imagesizeheight resolutionheight h",
}
_PAIR_PART_NAMES = {
    "R": "r rot rotation rotmat rotmatrix rotationmatrix rmat rmatrix rvec om",
    "T": "t trans trns translation translationvector translationmatrix tvec tvector transvector",
    "Q": "q qmatrix disparitytodepth disparitytodepthmatrix reprojectionmatrix",
}
_CAMERA_PARTS, _PAIR_PARTS = (
    {name: part for part, names in parts.items() for name in names.split()}
    for parts in (_CAMERA_PART_NAMES, _PAIR_PART_NAMES)
)
_FILLER_WORDS = {"", "s", "cam", "cams", "stereo", "calibration", "calib", "parameters", "params", "extrinsics"}
_WORDS = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")
_SIDES = {"left": "left", "l": "left", "right": "right", "r": "right"}

FISHEYE = "fisheye"
_LENS_MODEL_NAMES = {
    "": "none pinhole perspective rectified opencv",
    "pinhole": "plumbbob rationalpolynomial radtan radialtangential brown brownconrady pinholeradtan "
    "radialtangential8 pinholeradtan8",
    FISHEYE: "fisheye equidistant equi kannalabrandt kannalabrandt4 kannalabrandt8 kb4 opencvfisheye pinholeequi",
}
"""Names of lens models in files, normalised; "" is for names that say nothing about the distortion."""

_LENS_MODELS = {name: lens for lens, names in _LENS_MODEL_NAMES.items() for name in names.split()}
_UNSUPPORTED_LENS_MODELS = "omni mei unified ucm eucm ds doublesphere fov scaramuzza ocam thinprism thinprismfisheye"
_LENS_KEYS = {
    "distortionmodel", "distortiontype", "cameramodel", "modeltype", "lensmodel", "projectionmodel", "cameratype"
}  # fmt: skip
"""Keys of entries that name a lens model."""

_AMBIGUOUS_LENS_KEYS = {"model", "type", "lens", "camera", "lenstype"}
"""Keys of entries that may name a lens model, or mean something else."""

_IRRELEVANT_NAMES = (
    "e f rms stereolag cameraname comment calibtime calibrationtime date fileversion lengthunit unit units worldunits "
    "version camoverlaps rostopic sensortype ratehz depthrange avgreprojectionerror reprojectionerror timeshiftcamimu "
    "frameid sec nsec ret retval"
)
"""Keys of entries that do not describe the cameras, or are read elsewhere."""


def _normalised(name: str) -> str:
    """Return the lower-case letters and digits of a name."""
    return re.sub(r"[^a-z0-9]", "", name.lower())


def _key_of(name: str) -> str:
    """Return the last part of a dotted name, normalised; the last two if it is "type", which alone is ambiguous."""
    *before, last = name.split(".")
    return _normalised(before[-1] + last if before and last.lower() == "type" else last)


def lens_of(entries: Entries) -> str:
    """Return the model of both lenses that the files declare: "pinhole", :data:`FISHEYE`, or "" if they declare none.

    Raises
    ------
    ValueError
        An unsupported model, or two different models.
    """
    found: dict[str, str] = {}
    for file in entries.files:
        for name, entry in file.items():
            key, value = _key_of(name), _normalised(entry.text())
            is_lens = key in _LENS_KEYS
            if key in (FISHEYE, "isfisheye"):
                value = FISHEYE if value in ("1", "true", "yes") else "none"
            elif "mappingcoefficients" in key:
                value, is_lens = "scaramuzza", True
            elif key in ("dleftfe", "drightfe"):  # Stereolabs' names for the coefficients of fisheyes
                value, is_lens = FISHEYE, True
            elif key == "distortiontype":  # which MC-Calib numbers
                value = {"0": "brown", "1": FISHEYE}.get(value, value)
            elif not is_lens and not (
                key in _AMBIGUOUS_LENS_KEYS and value in {*_LENS_MODELS, *_UNSUPPORTED_LENS_MODELS.split()}
            ):
                continue
            if value.isdecimal() and key == "cameratype":  # DepthAI's number, which its layout reads
                continue
            file.used.add(name)
            if value not in _LENS_MODELS:
                given = entry.text() if isinstance(entry.value, str) else value
                raise ValueError(
                    f"The calibration has {quote(given)} for {quote(name)}, a model of lenses that is not read here; "
                    "allowed are pinhole (plumb_bob, radtan, rational_polynomial) and fisheye (equidistant, "
                    "kannala_brandt4)."
                )
            if _LENS_MODELS[value]:
                found[_LENS_MODELS[value]] = name
    if len(found) > 1:
        raise ValueError(
            f"The calibration declares a pinhole and a fisheye ({names_found(found.values())}); both must be the same."
        )
    return next(iter(found), "")


_COMMON_FRAME_POSES = (
    ("body_T_cam0", "body_T_cam1", True),
    ("cam0.T_cam_imu", "cam1.T_cam_imu", False),
    ("cam0.T_imu_cam", "cam1.T_imu_cam", True),
    ("cam0.T_BS", "cam1.T_BS", True),
)
"""Names of the poses of the left and the right camera in a common frame (VINS, Kalibr, OpenVINS and EuRoC), and whether
they are transforms from the cameras' frames rather than into them."""


def pose_from_common_frame(entries: Entries) -> Parts | None:
    """Return R and T from the cameras' poses in a common frame; None if the file has no such poses."""
    from_left = entries.find("cam1.T_cn_cnm1")
    poses = [(entries.find(left), entries.find(right), right, out) for left, right, out in _COMMON_FRAME_POSES]
    if from_left is not None:
        return relative_pose(from_left.name, np.eye(4), from_left.matrix(4, 4))
    for left, right, right_name, from_camera in poses:
        if left is not None and right is not None:
            both = left.matrix(4, 4), right.matrix(4, 4)
            return relative_pose(right_name, *(map(inverse, both) if from_camera else both))
    return None


def _parts_of(entries: Entries) -> Parts:
    """Return the parts of a file by the meaning of its names; of two names for one part, the first counts."""
    meant = [(entry, *meaning) for name, entry in entries.items() if (meaning := _meaning(name)) is not None]
    left, right = "01" if any(side == "0" for _, _, side in meant) else "12"
    sides = {"both": "", "lone": "0", "left": "1", "right": "2", left: "1", right: "2"}
    parts: Parts = {}
    for entry, part, side in meant:
        is_other = part == "M" and np.size(entry.value) not in (4, 9)
        if side in sides and not is_other and not (part == "P" and isinstance(entry.value, str)):
            entries.used.add(entry.name)
            parts.setdefault(part + sides[side], entry)
    if {"M0", "P0", "R"} <= set(parts) and "T" not in parts:
        # Beside K and P of a single camera, R is its rectification (ROS).
        parts.setdefault("R0", parts.pop("R"))
    return parts


def _meaning(name: str) -> tuple[str, str] | None:
    """Return the part that a name means and its side, or the number of its camera; None if unknown."""
    # Two letters such as KL, DR and Kl are a part and its side.
    split = [[*word] if re.fullmatch("[KMADPR][LRlr]", word) else [word] for word in _WORDS.findall(name[:80])]
    plain = [word.lower().replace("camera", "") for words in split for word in words]
    words = [word for word in plain if word not in _FILLER_WORDS]
    joined = "".join(words)
    if joined in _PAIR_PARTS:
        return _PAIR_PARTS[joined], "both"
    for index, word in enumerate(words):
        others = "".join(words[:index] + words[index + 1 :])
        if (word in _SIDES or word.isdecimal()) and others in _CAMERA_PARTS:
            return _CAMERA_PARTS[others], _SIDES.get(word, word.lstrip("0") or "0")
    return (_CAMERA_PARTS[joined], "lone") if joined in _CAMERA_PARTS else None


def parts_by_meaning(entries: Entries) -> list[Parts]:
    """Return the combined parts of files that belong together, by the meaning of their names, as the only item.

    ROS and all who give poses as transforms write metres.
    """
    files = entries.files
    found = [_parts_of(file) | _single_numbers(file) for file in files]
    lone = [n for n, parts in enumerate(found) if {"M0", "P0"} & set(parts) and not {"M1", "M2"} & set(parts)]
    if len(lone) > 2:
        raise ValueError(f"{len(lone)} files hold the calibration of one camera each; a stereo camera has two.")
    in_metres = bool(lone) and all("P0" in found[n] for n in lone)
    right_first = _is_right_first([files[n] for n in lone], [found[n] for n in lone])
    poses = Entries(*files)
    for n, side in zip(lone, "21" if right_first else "12", strict=False):
        found[n] = {part.replace("0", side): entry for part, entry in found[n].items()}
        if body := files[n].find("T_BS"):
            poses[f"cam{int(side) - 1}.T_BS"] = body
    parts = dict(ChainMap(*found))  # of two files with the same part, the first counts
    if "R" not in parts and (known := pose_from_common_frame(poses)) is not None:
        parts |= known
        in_metres = True
    baseline = (
        entries.match("baseline(LR)?") if "M1" in parts and not {"M2", "R", "T", "P1", "P2"} & set(parts) else None
    )
    if baseline is not None and not (parts["D1"].numbers().any() if "D1" in parts else False):
        parts["baseline"] = baseline
    elif len(lone) == 1:
        _complete_projections(parts, files[lone[0]])
    if "T" in parts and parts["T"].numbers().size in (12, 16):  # rotation and translation
        transform = parts["T"].numbers().reshape(-1, 4)
        parts |= pose_parts(parts["T"].name, transform[:3, :3], transform[:3, 3])
    elif "R" in parts and np.shape(parts["R"].value) == (9,) and entries.match(r"(.*\.)?ppx"):
        # RealSense, which lists the elements of rotations by columns.
        parts["R"] = numeric_entry(parts["R"].name, parts["R"].matrix(3, 3).T)
    if in_metres:
        parts["unit"] = Entry("unit", "m")
    else:
        parts |= entries.select({"unit": "length_unit|world_units|unit|units"})
    return [parts | entries.select({"num_disparities": NUM_DISPARITIES_NAMES})]


def _is_right_first(files: Sequence[Entries], parts: Sequence[Parts]) -> bool:
    """Return whether the first of up to two files with one camera each has the right camera.

    That is known from their poses (EuRoC), from their projections (ROS), or from the first camera's name.
    """
    bodies = [body.matrix(4, 4) for file in files if (body := file.find("T_BS"))]
    if len(bodies) == 2:
        across, down, _ = relative_pose("", *map(inverse, bodies))["T"].numbers()
        return bool(across > abs(down))
    shifts = [one["P0"].projection()[0, 3] for one in parts] if all("P0" in one for one in parts) else []
    if len(shifts) == 1 or len(set(shifts)) == 2:
        return bool(shifts[0] < (0, *shifts[1:])[-1])
    camera_name = files[0].find("camera_name") if len(files) == 2 else None
    return camera_name is not None and "right" in camera_name.text().lower()


def _single_numbers(entries: Entries) -> Parts:
    """Return the cameras that a file gives as single numbers below the name of a side: ``left.fx``."""
    parts: Parts = {}
    for side, names in (("1", "left|cam0|camera0|left_camera"), ("2", "right|cam1|camera1|right_camera")):
        for name in names.split("|"):
            for path in (name, f"{name}.intrinsics", f"{name}.intrinsic"):
                for keys in (("fx", "fy", "cx", "cy"), ("fx", "fy", "ppx", "ppy")):
                    if all(entries.find(f"{path}.{key}") for key in keys):
                        parts |= camera_parts(entries, side, path, path, keys)
    return parts


def _complete_projections(parts: Parts, entries: Entries) -> None:
    """Derive the projection of the left camera if a file of one camera has only that of the right one (ROS)."""
    if "P2" in parts and "P1" not in parts:
        parts["P1"] = Entry(parts["P2"].name, parts["P2"].projection() * [[1, 1, 1, 0]])
    elif "P1" in parts:
        raise ValueError(
            f"The calibration (ROS) is of the left camera alone: {quote(parts['P1'].name)} has no baseline; give the "
            "file of the right camera, or both."
        )
    else:
        raise ValueError(
            f"The calibration is of one camera alone ({names_found(entries)}); give the file of the other camera, and "
            "of the rotation (R) and translation (T) between them, together with it."
        )


MAX_COMPARED_NAMES = 100
"""Maximum number of unused names that are compared with the known ones: comparing thousands takes seconds."""


def unused_names(entries: Entries, ignored: str) -> list[str]:
    """Return the names that have no effect unexpectedly, those that are probably misspelt first.

    Names that match the pattern `ignored` are expected to have none.
    """
    known = [*_CAMERA_PARTS, *_PAIR_PARTS]
    unused = [
        name
        for name in entries
        if name not in entries.used
        and _key_of(name) not in _IRRELEVANT_NAMES.split()
        and not re.fullmatch(ignored, name, re.IGNORECASE)
    ]
    if len(unused) > MAX_COMPARED_NAMES:
        return unused
    return sorted(unused, key=lambda name: not difflib.get_close_matches(_key_of(name), known, cutoff=0.85))
