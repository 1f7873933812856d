"""The settings of the depth page and its pair, saved in its section "Take it away" and read back."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from stereolag.core.arrays import FloatMap, Mask
from stereolag.core.inputs import Image, as_stereo_pair
from stereolag.geometry.calibration import Calibration
from stereolag.io.archives import Archive
from stereolag.io.calibrations import read_calibration
from stereolag.io.disparities import read_disparity
from stereolag.io.guard import Door, unguarded
from stereolag.io.images import read_image
from stereolag.io.settings import matcher_from, parsed_json, settings_document
from stereolag.stereo.matcher import FARTHEST_FIRST, LARGEST_COUNT, StereoMatcher
from stereolag.stereo.methods import METHODS
from stereolag.version import VERSION

SESSION = "session.json"
"""Name of the session file in an archive."""
WHAT = "session file"
MAX_BYTES = 2**18
MOST_SENTENCES = 20
LONGEST_TEXT = 500
LARGEST_COLOUR = 1e6

_ACTIVE = re.compile(r"[^\w\s.,:;'’“”%°×÷–/+=?()-]|_")
_ADDRESS = re.compile(r":/+|www\.|(?<=\w)[:@](?=\w)")


@dataclass(frozen=True)
class Colours:
    """The colours of the maps: the range, px, None if the page chooses it; the palette's name, "" if none is named.

    `outlined`: whether the outlines of the left image are drawn over the maps.
    """

    low: float | None = None
    high: float | None = None
    palette: str = ""
    inverted: bool = False
    outlined: bool = False


@dataclass(frozen=True, eq=False)
class Session:
    """A pair at its own size and the settings of the page, all checked.

    Attributes
    ----------
    left, right
        The images.
    truth, visible
        (H, W) px and bool; None if missing in the archive.
    calibration
        Calibration of the pair; None if missing in the archive.
    description, history
        Description of the pair and of its processing, without any active Markdown.
    num_disparities, min_disparity
        The range that the pair needs, px.
    matchers
        The settings of all methods, for images of that size.
    shown
        The short names of the methods shown.
    size
        Name of the size at which it was shown on the page; untrusted.
    colours
        Colours of the maps.
    """

    left: Image
    right: Image
    truth: FloatMap | None
    visible: Mask | None
    calibration: Calibration | None
    description: str
    history: tuple[str, ...]
    num_disparities: int | None
    min_disparity: int
    matchers: tuple[StereoMatcher, ...]
    shown: tuple[str, ...]
    size: str
    colours: Colours


def holds_session(archive: Archive) -> bool:
    """Return whether an archive was saved on the depth page."""
    return SESSION in archive.names


def read_session(archive: Archive, door: Door = unguarded) -> Session:
    """Read an archive saved on the depth page; values missing in the session get the page's defaults.

    Its files are read through `door`: the guard, or none.

    Raises
    ------
    ValueError
        No session in the archive, a damaged one, images that are missing or do not fit together, or settings that are
        refused.
    """
    data = archive.read(SESSION)
    if len(data) > MAX_BYTES:
        raise ValueError(f"The {WHAT} has {len(data):,} bytes; at most {MAX_BYTES:,} are accepted.")
    document = _object(parsed_json(data, WHAT))
    pair = _object(document.get("pair"))
    files = {what: name for what, name in _object(pair.get("files")).items() if isinstance(name, str)}
    if not {"left", "right"} <= set(files):
        raise ValueError(f"The {WHAT} does not name the left and the right image.")
    left, right = as_stereo_pair(*(door(read_image)(archive.read(files[side])) for side in ("left", "right")))
    truth = door(read_disparity)(archive.read(files["truth"])) if "truth" in files else None
    visible = _mask(door(read_image)(archive.read(files["visible"]))) if "visible" in files else None
    for what, found in (("ground truth", truth), ("mask", visible)):
        if found is not None and found.shape != left.shape[:2]:
            raise ValueError(f"The {what} in the archive has another size than the left image.")
    calibration = door(read_calibration)(archive.read(files["calibration"])) if "calibration" in files else None
    methods = document.get("methods")
    return Session(
        left,
        right,
        truth,
        visible,
        calibration,
        _text(pair.get("description")),
        tuple(filter(None, map(_text, _list(pair.get("history"))[:MOST_SENTENCES]))),
        _whole(pair.get("num_disparities"), 1, LARGEST_COUNT),
        _whole(pair.get("min_disparity"), -FARTHEST_FIRST, FARTHEST_FIRST) or 0,
        tuple(matcher_from(one, WHAT) for one in _list(methods)[: len(METHODS)]),
        tuple(kind.short_name for kind in METHODS if kind.short_name in _list(document.get("shown"))),
        _text(document.get("size")),
        _colours(_object(document.get("colours"))),
    )


def _colours(document: dict[str, Any]) -> Colours:
    low, high = (_number(document.get(end)) for end in ("low", "high"))
    if low is None or high is None or not low < high:
        low = high = None
    inverted, outlined = (document.get(name) is True for name in ("inverted", "outlined"))
    return Colours(low, high, _text(document.get("palette")), inverted, outlined)


def _mask(image: Image) -> Mask:
    return (image if image.ndim == 2 else image[:, :, 0]) > 0


def _object(value: object) -> dict[str, Any]:
    return value if isinstance(value, dict) else {}


def _list(value: object) -> list[Any]:
    return value if isinstance(value, list) else []


def _text(value: object) -> str:
    """Return a text as one harmless line, without addresses and without characters active in Markdown or HTML."""
    if not isinstance(value, str):
        return ""
    plain = _ACTIVE.sub("", value[:LONGEST_TEXT])
    return " ".join(_ADDRESS.sub(" ", plain).split())


def _number(value: object) -> float | None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if math.isfinite(value) and abs(value) <= LARGEST_COLOUR else None


def _whole(value: object, low: int, high: int) -> int | None:
    return value if isinstance(value, int) and not isinstance(value, bool) and low <= value <= high else None


def session_json(
    *,
    files: Mapping[str, str],
    matchers: Sequence[StereoMatcher],
    shown: Sequence[str],
    size: str,
    colours: Mapping[str, Any],
    description: str = "",
    history: Sequence[str] = (),
    num_disparities: int | None = None,
    min_disparity: int = 0,
) -> str:
    """Return a session as JSON.

    Parameters
    ----------
    files
        The names of the pair's files beside it, by role: "left", "right", and if known "truth", "visible" and
        "calibration".
    matchers
        The settings of all methods, for the images as they are in these files.
    shown
        The short names of the methods shown.
    size
        Size at which the pair is shown: a name in :data:`stereolag.ui.pairs.SIZES`.
    colours
        "low" and "high", px of disparity in these images, or neither if the page chooses them; "palette", its name;
        "inverted"; "outlined".
    description, history
        Description of the pair and of its processing.
    num_disparities, min_disparity
        The range that the pair needs, px, if known.
    """
    document = {
        "stereolag": VERSION,
        "pair": {
            "files": dict(files),
            "description": description,
            "history": list(history),
            "num_disparities": num_disparities,
            "min_disparity": min_disparity,
        },
        "methods": [settings_document(matcher) for matcher in matchers],
        "shown": list(shown),
        "size": size,
        "colours": dict(colours),
    }
    return json.dumps(document, indent=2) + "\n"
