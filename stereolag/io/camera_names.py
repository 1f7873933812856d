"""The part of a stereo calibration that a name means: ``leftCameraMatrix``, ``camera_matrix_left``, ``K1``, ``mtxL``.

Names are split into words. One word may give the side (left, L, 0, 1, …), words such as "camera" are ignored, and the
rest names the part.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from enum import StrEnum
from typing import NamedTuple

from stereolag.io.entries import Entries, Matrix


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
