"""Calibrations of stereo cameras in the formats of Middlebury, KITTI, OpenCV, ROS, Kalibr, stereodemo and this project.

They are written in those of OpenCV, ROS and this project. A file is read in three steps: its notation (JSON, YAML, XML,
NPZ, ``name=value`` or rows of numbers) into one table of entries by name; the names into parts, which are named as in
OpenCV; the parts into a calibration.
"""

from __future__ import annotations

import io
import json
import math
import re
import zipfile
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any, NamedTuple, TypeAlias
from xml.etree.ElementTree import Element, ParseError

import cv2
import numpy as np
import numpy.typing as npt
import yaml
from defusedxml import DefusedXmlException, ElementTree

from stereolag.geometry.calibration import Calibration, Rectification, StereoRig
from stereolag.geometry.rectification import rectification, rectified_calibration
from stereolag.io.sources import ZIP_MAGIC, Source, parse_npy, quote, read_bytes
from stereolag.version import VERSION

CALIBRATION_SUFFIXES = ("txt", "yaml", "yml", "json", "xml", "npz")

MAX_TEXT_BYTES = 2**20
MAX_ARCHIVE_BYTES = 2**24
MAX_ARRAY_BYTES = 2**16
"""Of one array of an archive, unpacked: more than any matrix of a camera, and less than a map of pixels."""
MAX_NAMES = 2000
MAX_DEPTH = 16
MAX_VALUES = 100_000
"""Scalars, lists and dictionaries, each counted as often as an alias of YAML repeats it."""
MAX_SIDE = 100_000
MAX_NUMBER = 1e12
"""No focal length, length or coefficient of a camera comes near it; results computed from such numbers stay finite."""

Matrix: TypeAlias = npt.NDArray[np.float64]
NO_NUMBERS = np.array([np.nan])
"""Placeholder for a list that is not an array of numbers, refused only if it is used."""


class Entry(NamedTuple):
    """A named value of a calibration file: an array of numbers (a single one has shape (1,)), or text."""

    name: str
    value: Matrix | str

    def numbers(self, count: int | None = None) -> Matrix:
        """Return the numbers as a vector, of length `count` if given; ValueError if they are not such numbers."""
        name, values = quote(self.name), self.value
        if isinstance(values, str):
            raise ValueError(f"{name} in the calibration must hold numbers, not {quote(values)}.")
        if not np.isfinite(values).all():
            raise ValueError(f"{name} in the calibration must hold finite numbers only.")
        largest = max(values.flat, key=abs, default=0.0)
        if abs(largest) > MAX_NUMBER:
            raise ValueError(
                f"{name} in the calibration holds {largest:g}; allowed are numbers from -{MAX_NUMBER:g} to "
                f"{MAX_NUMBER:g}."
            )
        if count is not None and values.size != count:
            raise ValueError(f"{name} in the calibration must hold {count} numbers; it holds {values.size}.")
        return values.ravel()

    def matrix(self, rows: int, cols: int) -> Matrix:
        """Return the numbers as a matrix of this size."""
        return self.numbers(rows * cols).reshape(rows, cols)

    def counts(self, count: int) -> list[int]:
        """Return whole numbers from 1 to `MAX_SIDE`, rounded."""
        numbers = self.numbers(count).tolist()
        for number in numbers:
            if not 1 <= number <= MAX_SIDE:
                raise ValueError(f"The calibration has {number:g} for {quote(self.name)}; allowed are 1 to {MAX_SIDE}.")
        return [round(number) for number in numbers]

    def projection(self) -> Matrix:
        """Return the numbers as a (3, 4) projection, whose focal length must be above 0."""
        found = self.matrix(3, 4)
        if found[0, 0] <= 0:
            raise ValueError(
                f"{quote(self.name)} in the calibration has the focal length {found[0, 0]:g} px; it must be above 0."
            )
        return found


class Entries(dict[str, Entry]):
    """The entries of a calibration file by their names; of several names, the first that exists counts."""

    def find(self, *names: str) -> Entry | None:
        """Return an entry, None if there is none."""
        return next((self[name] for name in names if name in self), None)

    def number(self, *names: str) -> float | None:
        """Return a number, None if there is none."""
        found = self.find(*names)
        return None if found is None else float(found.numbers(1)[0])

    def required_number(self, *names: str) -> float:
        """Return a number that must exist."""
        number = self.number(*names)
        if number is None:
            raise ValueError(
                f"The calibration has no {names[0]}; it is needed to turn disparity into metres. It has "
                f"{names_found(self)}."
            )
        return number

    def count(self, *names: str) -> int | None:
        """Return a whole number from 1, None if there is none."""
        found = self.find(*names)
        return None if found is None else found.counts(1)[0]

    def text(self, name: str) -> str:
        """Return a text, empty if there is none."""
        return str(self[name].value) if name in self else ""


def names_found(names: Iterable[str]) -> str:
    """Return the first names in words, harmless in an error shown as Markdown or HTML."""
    every = list(names)
    shown = [re.sub(r"[^\w.+-]", "?", name[:24]) for name in every[:6]]
    more = f" and {len(every) - len(shown):,} more" if len(every) > len(shown) else ""
    return ", ".join(shown) + more if shown else "no names with values"


_KITTI_PAIRS = (("P_rect_02", "P_rect_03"), ("P2", "P3"), ("P_rect_00", "P_rect_01"), ("row0", "row1"))
_FOCAL = ("focal_px", "fx", "focal_length_px")
_BASELINE = ("baseline_m", "baseline_meters", "baseline_metres")
_WHOLE_NUMBERS = (
    ("width", "image_width"),
    ("height", "image_height"),
    ("num_disparities", "max_disparity", "ndisp"),
)


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
    sides = next((pair for pair in _KITTI_PAIRS if set(pair) <= set(entries)), None)
    if entries.find(*_FOCAL):
        numbers = _plain_numbers(entries)
    elif "cam0" in entries:
        numbers = _numbers_of_middlebury(entries)
    elif sides:
        numbers = _numbers_of_projections(entries[sides[0]], entries[sides[1]])
    else:
        return _from_cameras(files, entries, length_unit_m)
    width, height, most = (entries.count(*names) for names in _WHOLE_NUMBERS)
    return Calibration(*numbers, width=width, height=height, num_disparities=most)


RectifiedNumbers: TypeAlias = tuple[float, float, float, float | None, float | None]
"""Of a rectified pair: the focal length, the baseline (metres), doffs, and the centre of the left image."""


def _plain_numbers(entries: Entries) -> RectifiedNumbers:
    """Read single numbers by name; stereodemo calls them ``fx``, ``baseline_meters``, ``cx0`` and ``cx1``."""
    cx, right_cx = entries.number("cx", "cx0"), entries.number("cx1")
    doffs = entries.number("doffs_px", "doffs")
    if doffs is None:
        doffs = 0.0 if cx is None or right_cx is None else right_cx - cx
    return entries.required_number(*_FOCAL), entries.required_number(*_BASELINE), doffs, cx, entries.number("cy")


def _numbers_of_middlebury(entries: Entries) -> RectifiedNumbers:
    """Read lengths in mm and ``doffs = cx1 - cx0`` (https://vision.middlebury.edu/stereo/data/scenes2014/)."""
    (focal, _, cx), (_, _, cy), _ = entries["cam0"].matrix(3, 3).tolist()
    return focal, entries.required_number("baseline") / 1000, entries.number("doffs") or 0.0, cx, cy


def _numbers_of_projections(left_entry: Entry, right_entry: Entry, length_unit_m: float = 1.0) -> RectifiedNumbers:
    """Read the (3, 4) projections of a rectified pair, ``P[0, 3] = -focal * baseline`` (Geiger et al., IJRR 2013)."""
    left, right = left_entry.projection().tolist(), right_entry.projection().tolist()
    focal, _, cx, shift = left[0]
    return focal, (shift - right[0][3]) / focal * length_unit_m, right[0][2] - cx, cx, left[1][2]


def _from_cameras(files: list[Entries], entries: Entries, length_unit_m: float) -> Calibration:
    """Return the calibration from the cameras' matrices, before or after rectification."""
    parts, metric = _parts_together(files)
    unit = 1.0 if metric or entries.text("length_unit") == "m" else length_unit_m
    width, height = size = _image_size(parts)
    how = _rectification(parts, unit)
    is_rectified = "Q" in parts or {"P1", "P2"} <= set(parts)
    if {"M1", "M2"} & set(parts):
        missing = [part for part in _NEEDED if part not in parts and (how is None or part in ("M1", "M2"))]
        if not missing:
            return _predicted(_stereo_rig(files, parts, unit, size, how), entries.count("num_disparities"))
        if not is_rectified:
            raise ValueError(
                f"The calibration has {names_found(entry.name for entry in parts.values())}, but lacks "
                f"{', '.join(f'{_NEEDED[part]} ({part})' for part in missing)}; give the file that holds it, often "
                "extrinsics.yml, together with this one."
            )
    if "Q" in parts:
        focal, back, doffs, cx, cy = _reprojected(parts["Q"])
        return Calibration(focal, unit / back, doffs / back, cx, cy, width=width, height=height)
    if is_rectified:
        return Calibration(*_numbers_of_projections(parts["P1"], parts["P2"], unit), width=width, height=height)
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


# The parts by name. The names in a file are split into words, since ``leftCameraMatrix``, ``camera_matrix_left`` and
# ``mtxL`` mean one part: a word may give the side (left, L, 0, 1, …), words such as "camera" are ignored, and the rest
# names the part.

Parts: TypeAlias = dict[str, Entry]
"""Entries by OpenCV's names, ``M1`` for the left camera matrix, ``M2`` for the right one, with ``M0`` for that of the
only camera in a file: M, D, R, P, and in the same way size, width and height. R, T and Q are of the pair."""

_OF_ONE_CAMERA = {
    "M": "k m a mtx mat cm matrix cammatrix intrinsic intrinsics intrinsicmatrix intrinsicsmatrix",
    "D": "d dist distortion distortions distcoeff distcoeffs distcoef distcoefs distcoefficients distvec "
    "distortioncoeff distortioncoeffs distortioncoefficient distortioncoefficients distortionvector distortionmatrix",
    "R": "r rect rectification rectificationmatrix rectmatrix rrect rectr rectificationrotation "
    "rectificationtransform recttrans rectifyrotation",
    "P": "p proj projection projectionmatrix projmatrix projmat projmtx prect",
    "size": "imagesize imgsize size resolution framesize imageresolution",
    "width": "width imagewidth imgwidth imagesizewidth resolutionwidth w",
    "height": "height imageheight imgheight imagesizeheight resolutionheight h",
}
_OF_BOTH = {
    "R": "r rot rotation rotmat rotmatrix rotationmatrix rmat rmatrix rvec om",
    "T": "t trans translation translationvector translationmatrix tvec tvector transvector",
    "Q": "q qmatrix disparitytodepth disparitytodepthmatrix reprojectionmatrix",
}
_ONE, _BOTH = (
    {name: part for part, names in parts.items() for name in names.split()} for parts in (_OF_ONE_CAMERA, _OF_BOTH)
)
_SAYING_NOTHING = {"", "s", "cam", "cams", "stereo", "calibration", "calib", "parameters", "params"}
_WORDS = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")
_SIDES = {"left": "left", "l": "left", "right": "right", "r": "right"}

_NEEDED = {"M1": "left camera matrix", "M2": "right camera matrix", "R": "rotation", "T": "translation"}
_KALIBR_POSE = "cam1.T_cn_cnm1"
_MODELS = {
    "distortion_model": ("plumb_bob", "rational_polynomial", "radtan", "radial-tangential", "none"),
    "camera_model": ("pinhole",),
}
"""The models of lenses that OpenCV's ``stereoRectify`` supports: no fisheyes."""


def _parts_of(entries: Entries) -> Parts:
    """Return the parts meant by the names in a file; of two names for one part, the first counts."""
    named = [(entry, *meaning) for name, entry in entries.items() if (meaning := _meaning(name)) is not None]
    numbers = "01" if any(side == "0" for _, _, side in named) else "12"
    sides = {"both": "", "lone": "0", "left": "1", "right": "2", numbers[0]: "1", numbers[1]: "2"}
    parts: Parts = {}
    for entry, part, side in named:
        if side in sides:
            parts.setdefault(part + sides[side], entry)
    if {"M0", "P0", "R"} <= set(parts) and "T" not in parts:
        # Beside K and P of a single camera, R is its rectification (ROS).
        parts.setdefault("R0", parts.pop("R"))
    return parts


def _meaning(name: str) -> tuple[str, str] | None:
    """Return the part that a name means and its side, or the number of its camera; None if unknown."""
    # Two capitals such as KL and DR are a part and its side.
    split = [[*word] if re.fullmatch("[KMADPR][LR]", word) else [word] for word in _WORDS.findall(name[:80])]
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


def _parts_together(files: list[Entries]) -> tuple[Parts, bool]:
    """Return the combined parts of files that belong together, and whether their lengths are always in metres.

    Two files with one camera each are the left and the right one: by their projections (ROS), by the cameras' names, or
    in the given order. ROS and Kalibr write metres.
    """
    found = [_parts_of(entries) for entries in files]
    lone = [n for n, parts in enumerate(found) if {"M0", "P0"} & set(parts) and not {"M1", "M2"} & set(parts)]
    if len(lone) > 2:
        raise ValueError(f"{len(lone)} files hold the calibration of one camera each; a stereo camera has two.")
    metric = bool(lone) and all("P0" in found[n] for n in lone)
    shifts = [found[n]["P0"].projection()[0, 3] for n in lone] if metric else []
    right_first = len(lone) == 2 and "right" in files[lone[0]].text("camera_name").lower()
    if len(shifts) == 1 or len(set(shifts)) == 2:
        right_first = shifts[0] < (0, *shifts[1:])[-1]
    for n, side in zip(lone, "21" if right_first else "12", strict=False):
        found[n] = {part.replace("0", side): entry for part, entry in found[n].items()}
    together: Parts = {}
    for entries, parts in zip(files, found, strict=True):
        together = parts | together
        if _KALIBR_POSE in entries:
            pose = entries[_KALIBR_POSE].matrix(4, 4)
            together |= {"R": Entry(_KALIBR_POSE, pose[:3, :3]), "T": Entry(_KALIBR_POSE, pose[:3, 3])}
            metric = True
    if len(lone) == 1:
        _complete_projections(together, files[lone[0]])
    return together, metric


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


def _image_size(parts: Parts) -> tuple[int | None, int | None]:
    """Return the width and the height of the images, px, from whichever camera states them."""
    for side in "012":
        size, width, height = (parts.get(part + side) for part in ("size", "width", "height"))
        if size is not None:
            cols, rows = size.counts(2)
            return cols, rows
        if width is not None and height is not None:
            return width.counts(1)[0], height.counts(1)[0]
    return None, None


def _reprojected(entry: Entry) -> list[float]:
    """Return the focal length, 1 / baseline, doffs / baseline and the centre from Q of OpenCV's ``stereoRectify``."""
    q = entry.matrix(4, 4)
    if q[3, 2] == 0:
        raise ValueError(
            f"{quote(entry.name)} in the calibration has 0 at row 3, column 2, which would be an infinite baseline."
        )
    return [float(value) for value in (q[2, 3], q[3, 2], q[3, 3], -q[0, 3], -q[1, 3])]


def _stereo_rig(
    files: list[Entries],
    parts: Parts,
    length_unit_m: float,
    size: tuple[int | None, int | None],
    how: Rectification | None,
) -> StereoRig:
    """Return both cameras; their pose, if it is not given, follows from their rectification."""
    for name, entry in (each for entries in files for each in entries.items()):
        allowed = _MODELS.get(name.rsplit(".", 1)[-1])
        if allowed and str(entry.value).lower() not in allowed:
            raise ValueError(
                f"The calibration has {quote(str(entry.value))} for {quote(name)}, which is not known here; "
                f"allowed are {', '.join(allowed)}."
            )
    if how is not None and not {"R", "T"} <= set(parts):
        back = how.right_rotation.T
        rotation, translation = back @ how.left_rotation, back @ np.array([-how.baseline_m, 0.0, 0.0])
    else:
        rotation, translation = parts["R"].numbers(), parts["T"].numbers() * length_unit_m
        if rotation.size == 3:
            rotation = np.asarray(cv2.Rodrigues(rotation)[0], dtype=np.float64)
    none = Entry("", np.zeros(0))
    lenses = [parts.get(part, none).numbers() for part in ("D1", "D2")]
    left, right = (_camera_matrix(parts[part]) for part in ("M1", "M2"))
    return StereoRig(left, lenses[0], right, lenses[1], rotation, translation, *size, how)


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
        left, right = parts["P1"].projection().copy(), parts["P2"].projection().copy()
    elif "Q" in parts:
        focal, back, doffs, cx, cy = _reprojected(parts["Q"])
        left = np.array([[focal, 0, cx, 0], [0, focal, cy, 0], [0, 0, 1, 0]])
        right = left.copy()
        right[0, 2:] += doffs / back, -focal * (1 / back)
    else:
        return None
    for one in (left, right):
        one[:, 3] *= length_unit_m
    return Rectification(parts["R1"].matrix(3, 3), parts["R2"].matrix(3, 3), left, right)


# The notations.

_ASSIGNMENT = re.compile(r"^[ \t]*(\w+)[ \t]*=[ \t]*(\S.*)$")
_NUMBER = r"(?:[-+]?[\d.][-+.\deE]*|nan|inf)"
_NAMED_ROW = re.compile(rf"^[ \t]*(\w+):?[ \t]+({_NUMBER}(?:[ \t]+{_NUMBER})+)[ \t]*$")
_OPENCV_DIRECTIVE = re.compile(r"\A\s*%YAML:[^\n]*")
"""OpenCV writes ``%YAML:1.0``, which is not a YAML directive."""

# Every scalar stays text and every tag is ignored: no tag makes an object, and no type of YAML 1.1 is resolved (its
# base-60 numbers alone can take minutes). The loader in C is ten times as fast; every wheel of PyYAML has it.
_LOADER: Any = yaml.CBaseLoader if yaml.__with_libyaml__ else yaml.BaseLoader

TOO_DEEP = f"The calibration is nested more than {MAX_DEPTH} levels deep."
TOO_MANY = f"The calibration holds more than {MAX_VALUES:,} values, its aliases followed."


def parse_entries(data: bytes) -> Entries:
    """Return the entries of the file, by name.

    A matrix of OpenCV or ROS (rows, cols, data) and nested lists keep their shape. Nested entries are named by their
    path, with dots: ``cam0.intrinsics``. Bare rows are named ``row0``, ``row1``, …

    Raises
    ------
    ValueError
        A file that is too large or cannot be parsed, or a matrix whose size differs from the announced one.
    """
    packed = data.startswith(ZIP_MAGIC)
    most = MAX_ARCHIVE_BYTES if packed else MAX_TEXT_BYTES
    if len(data) > most:
        raise ValueError(
            f"The calibration has {len(data):,} bytes; at most {most:,} are accepted: it describes cameras only, and "
            "contains no maps of pixels."
        )
    try:
        values = _arrays(data) if packed else _values_of_text(_text(data))
    except RecursionError as error:
        raise ValueError(TOO_DEEP) from error
    _check_names(len(values))
    return Entries({name: Entry(name, value) for name, value in values.items() if name})


def _check_names(count: int) -> None:
    if count > MAX_NAMES:
        raise ValueError(f"The calibration has {count:,} names or lines; at most {MAX_NAMES:,} are accepted.")


def _arrays(data: bytes) -> dict[str, Matrix | str]:
    """Return the arrays in an archive of NumPy, with placeholders for those that are large or not of numbers."""
    arrays: dict[str, Matrix | str] = {}
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            _check_names(len(archive.infolist()))
            for member in archive.infolist():
                content = archive.read(member) if member.file_size <= MAX_ARRAY_BYTES else b""
                try:
                    array = _value(parse_npy(content, "calibration"))
                except ValueError:
                    continue
                arrays[member.filename.removesuffix(".npy")] = array
    except (ValueError, MemoryError):
        raise
    except Exception as error:  # zipfile and its decoders raise all kinds of errors on broken files
        raise ValueError("The calibration (.npz) is damaged, cut short or locked; save it again.") from error
    return arrays


def _text(data: bytes) -> str:
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(
            "The calibration is not a text file (UTF-8) or an .npz of NumPy; save pickles and MATLAB’s files as one of "
            "these."
        ) from error
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise ValueError(f"Line {line} of the calibration holds a NUL byte; allowed is plain text.")
    return text


def _values_of_text(text: str) -> dict[str, Matrix | str]:
    start = text.lstrip()
    if start.startswith("<"):
        return _leaves(_xml(start.encode()))
    if start.startswith("{"):
        return _leaves(_json(start))
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    if assignments := [match for line in lines if (match := _ASSIGNMENT.match(line))]:
        _check_names(len(lines))
        return {match[1]: _value(re.sub(r"[\[\];]", " ", match[2])) for match in assignments}
    if lines and len(lines) <= MAX_NAMES and not any(isinstance(_value(line), str) for line in lines):
        return {f"row{number}": _value(line) for number, line in enumerate(lines)}
    rows = [match for line in lines if (match := _NAMED_ROW.match(line))]
    if any(match[1].startswith("P") for match in rows):
        _check_names(len(lines))
        return {match[1]: _value(match[2]) for match in rows}
    return _leaves(_yaml(text))


def _json(text: str) -> Any:
    """Return the content of a text in braces: JSON, or YAML in flow style."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        try:
            return _yaml(text)
        except ValueError:
            raise ValueError("The calibration begins like JSON, but cannot be parsed as such.") from error


def _yaml(text: str) -> Any:
    """Return the first document of a YAML text."""
    text = _OPENCV_DIRECTIVE.sub("", text, count=1)
    depth = 0
    try:
        # The loader in C would overflow the stack of its process at a few 10,000 levels.
        for number, event in enumerate(yaml.parse(text, Loader=_LOADER)):
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            if depth > MAX_DEPTH:
                raise ValueError(TOO_DEEP)
            if number > 2 * MAX_VALUES:
                raise ValueError(TOO_MANY)
            if isinstance(event, yaml.DocumentEndEvent):
                break
        return next(yaml.load_all(text, Loader=_LOADER), None)
    except yaml.MarkedYAMLError as error:
        line = "" if error.problem_mark is None else f" at line {error.problem_mark.line + 1}"
        raise ValueError(f"The calibration cannot be parsed as YAML: it is broken or cut short{line}.") from error
    except yaml.YAMLError as error:
        raise ValueError(
            "The calibration cannot be parsed as YAML: it holds characters that are not allowed."
        ) from error


def _xml(data: bytes) -> Any:
    """Return the content of the root element of OpenCV's XML, without entities or type definitions."""
    try:
        return _xml_tree(ElementTree.fromstring(data, forbid_dtd=True))
    except DefusedXmlException as error:
        raise ValueError(
            "The calibration (XML) defines types or entities, which are not accepted; save it as OpenCV does, without "
            "them."
        ) from error
    except ParseError as error:
        raise ValueError(
            f"The calibration cannot be parsed as XML: it is broken or cut short at line {error.position[0]}."
        ) from error
    except (LookupError, UnicodeError) as error:
        raise ValueError("The calibration (XML) is in an encoding that is not known; save it in UTF-8.") from error


def _xml_tree(element: Element) -> Any:
    if not len(element):
        return (element.text or "").strip().strip('"')
    if all(child.tag == "_" for child in element):  # OpenCV's name for the elements of a sequence
        return [_xml_tree(child) for child in element]
    return {child.tag: _xml_tree(child) for child in element}


def _leaves(tree: Any) -> dict[str, Matrix | str]:
    """Return the leaves of a tree of dictionaries and lists by their paths: ``left.camera_matrix``."""
    _count(tree)
    return dict(_walk("", tree))


def _count(tree: Any, depth: int = 0) -> int:
    """Return the number of values in a tree, its aliases followed; ValueError if they are too many, or too deep."""
    if depth > MAX_DEPTH:
        raise ValueError(TOO_DEEP)
    count = 1
    for value in tree.values() if isinstance(tree, dict) else tree if isinstance(tree, list) else ():
        count += _count(value, depth + 1)
        if count > MAX_VALUES:
            raise ValueError(TOO_MANY)
    return count


def _walk(name: str, tree: Any) -> Iterator[tuple[str, Matrix | str]]:
    if isinstance(tree, list) and any(isinstance(item, dict) for item in tree):
        tree = dict(enumerate(tree))
    if not isinstance(tree, dict):
        if tree is not None and not isinstance(tree, bool) and tree != "":
            yield name, _value(tree)
    elif "data" in tree and ({"rows", "cols"} <= set(tree) or "sizes" in tree):
        # OpenCV 5 writes the sizes of an array of one row.
        sizes = [tree["rows"], tree["cols"]] if {"rows", "cols"} <= set(tree) else tree["sizes"]
        yield name, _announced(name, tree["data"], sizes)
    else:
        for key, value in tree.items():
            yield from _walk(f"{name}.{key}" if name else str(key), value)


def _announced(name: str, data: Any, sizes: Any) -> Matrix:
    """Return an array in the shape announced by its file."""
    values, shape = _value(data), _value(sizes)
    if isinstance(values, str) or isinstance(shape, str) or not np.isfinite([*values.flat, *shape.flat]).all():
        return NO_NUMBERS
    if not ((shape >= 0) & (shape <= values.size)).all() or math.prod(map(int, shape.flat)) != values.size:
        announced = " × ".join(f"{side:g}" for side in list(shape.flat)[:3])
        raise ValueError(f"{quote(name)} in the calibration announces {announced} numbers and holds {values.size}.")
    return values.reshape([int(side) for side in shape.flat])


def _value(leaf: Any) -> Matrix | str:
    """Return the numbers in a leaf; if it is a text that contains anything else, the text."""
    if isinstance(leaf, str):
        try:
            return np.array([_float(token) for token in re.split(r"[\s,]+", leaf.strip())])
        except ValueError:
            return leaf.strip()
    if isinstance(leaf, list) and leaf and all(isinstance(item, str) for item in leaf):
        # From YAML and XML; if a comma is missing at the end of a line, two numbers are one item.
        numbers = _value(" ".join(leaf))
        return NO_NUMBERS if isinstance(numbers, str) else numbers
    try:
        return np.atleast_1d(np.array(leaf, dtype=np.float64))
    except (TypeError, ValueError, OverflowError):
        return NO_NUMBERS


def _float(token: str) -> float:
    """Return the number in a text, including those that YAML writes differently from Python."""
    return float(token.replace(".", "", 1) if token.lower().lstrip("+-") in (".nan", ".inf") else token)


# Writing.


def opencv_calibration(calibration: Calibration) -> str:
    """Return both cameras and their rectification as the YAML of OpenCV's ``FileStorage``.

    The names are those of OpenCV's own sample: M1, D1, M2, D2, R, T (metres), R1, R2, P1, P2, Q, and the size.

    Raises
    ------
    ValueError
        A calibration without a rig, or a rig without a size.
    """
    size, matrices = _cameras(calibration)
    storage = cv2.FileStorage(".yml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    storage.writeComment("lengths in metres")
    storage.write("image_width", size[0])
    storage.write("image_height", size[1])
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
    size, matrices = _cameras(calibration)
    return _camera_info("left", size, 1, matrices), _camera_info("right", size, 2, matrices)


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
        size, matrices = _cameras(calibration)
        document = {"image_width": size[0], "image_height": size[1], "length_unit": "m"}
        document |= {name: np.asarray(matrix).tolist() for name, matrix in matrices.items()}
        if calibration.num_disparities is not None:
            document["num_disparities"] = calibration.num_disparities
    if calibration.rms is not None:
        document["rms"] = calibration.rms
    return json.dumps(document | {"stereolag": VERSION}, indent=2) + "\n"


def _cameras(calibration: Calibration) -> tuple[tuple[int, int], dict[str, Matrix]]:
    """Return the size of the images, and the matrices of both cameras and of their rectification by OpenCV's names."""
    rig = calibration.rig
    if rig is None:
        raise ValueError("calibration has no rig: a pair that is already rectified has no cameras to write.")
    if rig.width is None or rig.height is None:
        raise ValueError("The rig of the calibration has no width and height; they are needed to rectify.")
    size = rig.width, rig.height
    how = rectification(rig, size)
    return size, {
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
