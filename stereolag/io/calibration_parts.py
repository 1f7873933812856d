"""The parts of a calibration, named as in OpenCV: built from what files hold, and told by what names mean."""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np

from stereolag.io.calibration_files import Entries, Entry, Matrix, names_found
from stereolag.io.sources import quote

Parts: TypeAlias = dict[str, Entry]
"""Entries by OpenCV's names, ``M1`` for the left camera matrix, ``M2`` for the right one, with ``M0`` for that of the
only camera in a file: M, D, R, P, and in the same way size, width and height. R, T and Q are of both. Of a rectified
pair: focal (or M1) and baseline (or product, that of both), and if known doffs, cx, cx2, cy. Besides: lens,
unit, and most, the number of disparities."""

SIZE = {"width0": "width|image_width|camera.width", "height0": "height|image_height|camera.height"}
MOST = "num_disparities|max_disparity|ndisp"
COEFFICIENTS = {False: ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"), True: ("k1", "k2", "k3", "k4")}
"""Names of the coefficients of a lens given as single numbers, by whether it is a fisheye."""


def numbers(name: str, values: Any) -> Entry:
    """Return an entry with numbers made from others."""
    return Entry(name, np.asarray(values, dtype=np.float64))


def camera(
    entries: Entries,
    side: str,
    matrix: str,
    lens: str,
    centre: Sequence[str] = ("fx", "fy", "cx", "cy"),
    coefficients: Sequence[str] = COEFFICIENTS[False],
) -> Parts:
    """Return the matrix of a camera and its lens from single numbers below two headings."""
    fx, fy, cx, cy = (float(entries.required(f"{matrix}.{name}").numbers(1)[0]) for name in centre)
    parts = {f"M{side}": numbers(matrix, [[fx, 0, cx], [0, fy, cy], [0, 0, 1]])}
    names = [f"{lens}.{name}" for name in coefficients]
    if any(entries.find(name) for name in names):
        for name in names[:2]:
            entries.required(name)
        found = [entries.number(name) or 0.0 for name in names]
        parts[f"D{side}"] = numbers(lens, found)
    return parts


def pose(name: str, turn: Matrix, place: Matrix) -> Parts:
    """Return R and T: a point at x in the left camera's frame is at ``turn @ x + place`` in the right one's."""
    return {"R": numbers(name, turn), "T": numbers(name, place)}


def between(name: str, left: Matrix, right: Matrix) -> Parts:
    """Return R and T from the (4, 4) or (3, 4) transforms of one frame into those of both cameras."""
    turn = right[:3, :3] @ left[:3, :3].T
    return pose(name, turn, right[:3, 3] - turn @ left[:3, 3])


def rigid(turn: Sequence[float] | Matrix, place: Sequence[float] | Matrix) -> Matrix:
    """Return the (3, 4) transform that turns by a quaternion (w, x, y, z) and then moves."""
    w, x, y, z = np.asarray(turn) / (np.linalg.norm(turn) or 1.0)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.column_stack((np.eye(3) + 2 * (w * cross + cross @ cross), place))


def inverted(transform: Matrix) -> Matrix:
    """Return the (3, 4) inverse of a rigid transform."""
    turn = transform[:3, :3].T
    return np.column_stack((turn, -turn @ transform[:3, 3]))


# The parts by name. The names in a file are split into words, since ``leftCameraMatrix``, ``camera_matrix_left`` and
# ``mtxL`` mean one part: a word may give the side (left, L, 0, 1, …), words such as "camera" are ignored, and the rest
# names the part.

_OF_ONE_CAMERA = {
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
_OF_BOTH = {
    "R": "r rot rotation rotmat rotmatrix rotationmatrix rmat rmatrix rvec om",
    "T": "t trans trns translation translationvector translationmatrix tvec tvector transvector",
    "Q": "q qmatrix disparitytodepth disparitytodepthmatrix reprojectionmatrix",
}
_ONE, _BOTH = (
    {name: part for part, names in parts.items() for name in names.split()} for parts in (_OF_ONE_CAMERA, _OF_BOTH)
)
_SAYING_NOTHING = {"", "s", "cam", "cams", "stereo", "calibration", "calib", "parameters", "params", "extrinsics"}
_WORDS = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")
_SIDES = {"left": "left", "l": "left", "right": "right", "r": "right"}

FISHEYE = "fisheye"
_LENSES = {
    "": "none pinhole perspective rectified opencv",
    "pinhole": "plumbbob rationalpolynomial radtan radialtangential brown brownconrady pinholeradtan "
    "radialtangential8 pinholeradtan8",
    FISHEYE: "fisheye equidistant equi kannalabrandt kannalabrandt4 kannalabrandt8 kb4 opencvfisheye pinholeequi",
}
"""Models of lenses by their names in files, without marks; "" leaves the distortion open."""
_LENS = {name: lens for lens, names in _LENSES.items() for name in names.split()}
_OTHER_LENSES = "omni mei unified ucm eucm ds doublesphere fov scaramuzza ocam thinprism thinprismfisheye"
_LENS_STATED = {
    "distortionmodel", "distortiontype", "cameramodel", "modeltype", "lensmodel", "projectionmodel", "cameratype"
}  # fmt: skip
_LENS_PERHAPS = {"model", "type", "lens", "camera", "lenstype"}
"""The last words of names of entries with a model of lenses, and of those that may mean something else."""

_WITHOUT_EFFECT = (
    "e f rms stereolag cameraname comment calibtime calibrationtime date fileversion lengthunit unit units worldunits "
    "version camoverlaps rostopic sensortype ratehz depthrange avgreprojectionerror reprojectionerror timeshiftcamimu "
    "frameid sec nsec ret retval"
)
"""Names that are known not to describe the cameras, or are read elsewhere."""


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower())


def _last_words(name: str) -> str:
    """Return the last part of a dotted name in plain letters; with what is before it where that is too short to say."""
    *before, last = name.split(".")
    return _plain(before[-1] + last if before and last.lower() == "type" else last)


def lens_of(entries: Entries) -> str:
    """Return the model of both lenses that the files declare: "pinhole", :data:`FISHEYE`, or "" for none.

    Raises
    ------
    ValueError
        Another model, which is named, or two of them.
    """
    found: dict[str, str] = {}
    for one in entries.files:
        for name, entry in one.items():
            key, value = _last_words(name), _plain(entry.text())
            stated = key in _LENS_STATED
            if key in (FISHEYE, "isfisheye"):
                value = FISHEYE if value in ("1", "true", "yes") else "none"
            elif "mappingcoefficients" in key:
                value, stated = "scaramuzza", True
            elif key in ("dleftfe", "drightfe"):  # as Stereolabs' calibration names the lenses of fisheyes
                value, stated = FISHEYE, True
            elif key == "distortiontype":  # which MC-Calib numbers
                value = {"0": "brown", "1": FISHEYE}.get(value, value)
            elif not stated and not (key in _LENS_PERHAPS and value in {*_LENS, *_OTHER_LENSES.split()}):
                continue
            if value.isdecimal() and key == "cameratype":  # DepthAI's number, which its layout reads
                continue
            one.used.add(name)
            if value not in _LENS:
                said = entry.text() if isinstance(entry.value, str) else value
                raise ValueError(
                    f"The calibration has {quote(said)} for {quote(name)}, a model of lenses that is not read here; "
                    "allowed are pinhole (plumb_bob, radtan, rational_polynomial) and fisheye (equidistant, "
                    "kannala_brandt4)."
                )
            if _LENS[value]:
                found[_LENS[value]] = name
    if len(found) > 1:
        raise ValueError(
            f"The calibration declares a pinhole and a fisheye ({names_found(found.values())}); both must be the same."
        )
    return next(iter(found), "")


_POSES = (
    ("body_T_cam0", "body_T_cam1", True),
    ("cam0.T_cam_imu", "cam1.T_cam_imu", False),
    ("cam0.T_imu_cam", "cam1.T_imu_cam", True),
    ("cam0.T_BS", "cam1.T_BS", True),
)
"""Transforms of both cameras, and whether they lead out of the cameras' frames: VINS, Kalibr, OpenVINS and EuRoC."""


def pose_in_common(entries: Entries) -> Parts | None:
    """Return R and T if both cameras' poses are given in one frame."""
    neighbour = entries.find("cam1.T_cn_cnm1")
    given = [(entries.find(left), entries.find(right), outwards) for left, right, outwards in _POSES]
    if neighbour is not None:
        return between(neighbour.name, np.eye(4), neighbour.matrix(4, 4))
    for (_, right, _), (one, other, outwards) in zip(_POSES, given, strict=True):
        if one is not None and other is not None:
            both = one.matrix(4, 4), other.matrix(4, 4)
            return between(right, *(map(inverted, both) if outwards else both))
    return None


def _parts_of(entries: Entries) -> Parts:
    """Return the parts meant by the names in a file; of two names for one part, the first counts."""
    named = [(entry, *meaning) for name, entry in entries.items() if (meaning := _meaning(name)) is not None]
    numbers = "01" if any(side == "0" for _, _, side in named) else "12"
    sides = {"both": "", "lone": "0", "left": "1", "right": "2", numbers[0]: "1", numbers[1]: "2"}
    parts: Parts = {}
    for entry, part, side in named:
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
    words = [word.lower().replace("camera", "") for one in split for word in one]
    telling = [word for word in words if word not in _SAYING_NOTHING]
    rest = "".join(telling)
    if rest in _BOTH:
        return _BOTH[rest], "both"
    for place, word in enumerate(telling):
        others = "".join(telling[:place] + telling[place + 1 :])
        if (word in _SIDES or word.isdecimal()) and others in _ONE:
            return _ONE[others], _SIDES.get(word, word.lstrip("0") or "0")
    return (_ONE[rest], "lone") if rest in _ONE else None


def by_meaning(entries: Entries) -> list[Parts]:
    """Return the combined parts of files that belong together, by what their names mean.

    Two files with one camera each are the left and the right one: by their projections (ROS), by their poses (EuRoC),
    by the cameras' names, or in the given order. ROS and whoever gives poses as transforms write metres.
    """
    files = entries.files
    found = [_parts_of(one) | _single_numbers(one) for one in files]
    lone = [n for n, parts in enumerate(found) if {"M0", "P0"} & set(parts) and not {"M1", "M2"} & set(parts)]
    if len(lone) > 2:
        raise ValueError(f"{len(lone)} files hold the calibration of one camera each; a stereo camera has two.")
    metric = bool(lone) and all("P0" in found[n] for n in lone)
    shifts = [found[n]["P0"].projection()[0, 3] for n in lone] if metric else []
    title = files[lone[0]].find("camera_name") if len(lone) == 2 else None
    right_first = title is not None and "right" in title.text().lower()
    if len(shifts) == 1 or len(set(shifts)) == 2:
        right_first = shifts[0] < (0, *shifts[1:])[-1]
    poses = Entries(*files)
    bodies = [body.matrix(4, 4) for n in lone if (body := files[n].find("T_BS"))]
    if len(bodies) == 2:
        across, down, _ = between("", *map(inverted, bodies))["T"].numbers()
        right_first = across > abs(down)
    for n, side in zip(lone, "21" if right_first else "12", strict=False):
        found[n] = {part.replace("0", side): entry for part, entry in found[n].items()}
        if body := files[n].find("T_BS"):
            poses[f"cam{int(side) - 1}.T_BS"] = body
    parts: Parts = {}
    for one in found:
        parts = one | parts
    if "R" not in parts and (known := pose_in_common(poses)) is not None:
        parts |= known
        metric = True
    if len(lone) == 1:
        _complete_projections(parts, files[lone[0]])
    if "T" in parts and parts["T"].numbers().size in (12, 16):  # the whole transform
        whole = parts["T"].numbers().reshape(-1, 4)
        parts |= pose(parts["T"].name, whole[:3, :3], whole[:3, 3])
    elif "R" in parts and np.shape(parts["R"].value) == (9,) and entries.match(r"(.*\.)?ppx"):
        # RealSense, whose flat rotations go down the columns.
        parts["R"] = numbers(parts["R"].name, parts["R"].matrix(3, 3).T)
    if metric:
        parts["unit"] = Entry("unit", "m")
    elif unit := entries.find("length_unit|world_units|unit|units"):
        parts["unit"] = unit
    if most := entries.find(MOST):
        parts["most"] = most
    return [parts]


def _single_numbers(entries: Entries) -> Parts:
    """Return the cameras that a file gives as single numbers below its side's name: ``left.fx``."""
    parts: Parts = {}
    for side, names in (("1", "left|cam0|camera0|left_camera"), ("2", "right|cam1|camera1|right_camera")):
        for name in names.split("|"):
            for place in (name, f"{name}.intrinsics", f"{name}.intrinsic"):
                for centre in (("fx", "fy", "cx", "cy"), ("fx", "fy", "ppx", "ppy")):
                    if all(entries.find(f"{place}.{one}") for one in centre):
                        parts |= camera(entries, side, place, place, centre)
    return parts


def _complete_projections(parts: Parts, entries: Entries) -> None:
    """Derive the projection of the left camera if only that of the right one is given (ROS)."""
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


MOST_COMPARED = 100
"""Most names without effect that are compared with the known ones: a file of nothing but such takes seconds."""


def unused(entries: Entries, ignored: str) -> list[str]:
    """Return the names that have no effect although nothing says so, the likely misspelt ones first.

    Of names that fit the pattern `ignored` that is known.
    """
    known = [*_ONE, *_BOTH]
    left = [
        name
        for name in entries
        if name not in entries.used
        and _last_words(name) not in _WITHOUT_EFFECT.split()
        and not re.fullmatch(ignored, name, re.IGNORECASE)
    ]
    if len(left) > MOST_COMPARED:
        return left
    return sorted(left, key=lambda name: not difflib.get_close_matches(_last_words(name), known, cutoff=0.85))
