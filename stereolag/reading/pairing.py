"""Which of many files belong together: left and right images, ground truths and calibrations, told by their names."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import PurePosixPath
from typing import NamedTuple

PICTURE_ENDINGS = frozenset(["png", "jpg", "jpeg", "webp", "bmp", "tif", "tiff", "ppm", "pgm", "gif"])
TRUTH_ENDINGS = frozenset(["pfm", "png", "pgm", "npy"])
CALIBRATION_ENDINGS = frozenset(["txt", "yaml", "yml", "json", "xml", "npz"])

LEFT, RIGHT = "left", "right"
MOST_PLACES = 8
"""In one name, at which the side may stand."""


@dataclass(frozen=True)
class PairFiles:
    """The names of the files of one pair, and what it is called: what their names have in common."""

    name: str
    left: str
    right: str
    truth: str | None = None
    calibrations: tuple[str, ...] = ()


def _word(word: str) -> str:
    """Return a pattern of a word that stands alone, begins with a capital within others, or ends before one."""
    capital = word[0].upper() + word[1:]
    return rf"(?:(?<![A-Za-z])(?i:{word})|(?<=[a-z0-9]){capital})(?![a-z])"


def _number(before: str, number: str) -> str:
    """Return a pattern of a number of its own behind some letters."""
    return rf"(?<![A-Za-z])(?i:{before})[-_]?{number}(?![0-9])"


CONVENTIONS: tuple[tuple[str, str], ...] = (
    (_word("left"), _word("right")),
    (r"(?<![A-Za-z])[lL](?![A-Za-z])", r"(?<![A-Za-z])[rR](?![A-Za-z])"),
    (_number("image", "0*2"), _number("image", "0*3")),  # KITTI's colour cameras, before its grey ones
    (_number("im(?:age|g)?", "0+"), _number("im(?:age|g)?", "0*1")),
    (_number("cam(?:era)?", "0+"), _number("cam(?:era)?", "0*1")),
    (_number("cam(?:era)?", "0*1"), _number("cam(?:era)?", "0*2")),
    (_number("view", "0+"), _number("view", "0*1")),
    (_number("view", "1"), _number("view", "5")),  # Middlebury 2005 and 2006
    (_number("im", "2"), _number("im", "6")),  # Middlebury 2001 and 2003
    (_number("im(?:age|g)?", "0*1"), _number("im(?:age|g)?", "0*2")),
    (r"(?:^|(?<=[-_ .]))0(?=[-_ .]|$)", r"(?:^|(?<=[-_ .]))1(?=[-_ .]|$)"),
    (r"(?:^|(?<=[-_ .]))1(?=[-_ .]|$)", r"(?:^|(?<=[-_ .]))2(?=[-_ .]|$)"),
)
"""How the names of left and right images differ, the surest first: each a pattern of either side, sought in every
folder's name and in the file's without its ending."""

_TRUTH = re.compile(r"(?<![a-z])(gt|truth|ground[-_ ]?truth|disp(?:arity|arities|map)?)(?![a-z])", re.IGNORECASE)
_NO_IMAGE = re.compile(r"(?<![a-z])(mask|valid|occ|nocc|nonocc|conf(?:idence)?|depth)(?![a-z])", re.IGNORECASE)
_CALIBRATION = re.compile(r"calib|camera|intrinsic|extrinsic|stereo|chain", re.IGNORECASE)
_IN_PARTS = (re.compile("intrinsic|extrinsic", re.IGNORECASE), re.compile("left|right", re.IGNORECASE))
"""How the files of a calibration that comes in two are called: OpenCV's sample's, and ROS's."""
_RIGHT_SIDE = re.compile(r"(?<![a-z])(?:right|r)(?![a-z])", re.IGNORECASE)
_SIDE_NUMBER = re.compile(r"disp[a-z]*[-_]?(\d+)$", re.IGNORECASE)
_DIGITS = re.compile(r"\d+")


def matched_pairs(names: Sequence[str]) -> list[PairFiles]:
    """Return the pairs among files, by their names alone, in the order of these names.

    Parameters
    ----------
    names
        Of the files, with folders where there are any: "left/000.png", "teddy/im2.png".

    Returns
    -------
    pairs
        Left and right images whose names differ in a word or number that tells the side (:data:`CONVENTIONS`), in
        folders or files, and in nothing else. A ground truth belongs to the pair in whose folder it is the only one,
        or with whose name, or number, it agrees; a calibration likewise, and one alone, or one above, to all.
    """
    truths = {name for name in names if _ending(name) in TRUTH_ENDINGS and _TRUTH.search(_stem_path(name))}
    pictures = [name for name in names if _ending(name) in PICTURE_ENDINGS - {"npy"} and name not in truths]
    pictures = [name for name in pictures if not _NO_IMAGE.search(PurePosixPath(name).stem)]
    found = sorted(_matched(pictures), key=lambda pair: [natural_order(pair.left), pair.left])
    calibrations = [
        name
        for name in names
        if _ending(name) in CALIBRATION_ENDINGS
        and name not in truths
        and (_CALIBRATION.search(name) or _ending(name) in ("yaml", "yml"))
    ]
    left_truths = [name for name in sorted(truths) if not _RIGHT_SIDE.search(PurePosixPath(name).stem)]
    names_of = _called([pair.name for pair in found])
    return [
        replace(
            pair,
            name=name,
            truth=_belonging(pair, left_truths, found),
            calibrations=_above(pair, calibrations, found),
        )
        for pair, name in zip(found, names_of, strict=True)
    ]


class FrameFiles(NamedTuple):
    """The names of the files of one frame of a sequence; None where one is missing."""

    left: str
    right: str | None
    truth: str | None = None


def matched_frames(names: Sequence[str]) -> list[FrameFiles]:
    """Return the frames of one sequence among files, by their names alone, in their order.

    Parameters
    ----------
    names
        Of the files, with folders where there are any: "left/000.png".

    Returns
    -------
    frames
        Every picture of the left side by the first of :data:`CONVENTIONS` that finds both sides. One convention for
        all, so that it takes as long as there are files: :func:`matched_pairs` holds every pair against every other.
    """
    truths = {name for name in names if _ending(name) in TRUTH_ENDINGS and _TRUTH.search(_stem_path(name))}
    pictures = [name for name in names if _ending(name) in PICTURE_ENDINGS and name not in truths]
    known = {_core(name): name for name in sorted(truths, reverse=True) if not _RIGHT_SIDE.search(_stem_path(name))}
    for patterns in CONVENTIONS:
        lefts, rights = ({_without(side, name): name for name in pictures} for side in patterns)
        lefts.pop(None, None)
        if lefts.keys() & (rights.keys() - {None}):
            frames = [FrameFiles(name, rights.get(key), known.get(_core(name))) for key, name in lefts.items()]
            return sorted(frames, key=lambda frame: [natural_order(frame.left), frame.left])
    return []


def _without(pattern: str, name: str) -> str | None:
    """Return a name without what tells its side; None where nothing does."""
    path, found = re.subn(pattern, "\0", _stem_path(name))
    return path if found else None


def _matched(pictures: Iterable[str]) -> list[PairFiles]:
    """Return the pairs among pictures; each convention takes from what those before it left."""
    left_over = set(pictures)
    pairs: list[PairFiles] = []
    for left, right in CONVENTIONS:
        sides: dict[str, dict[str, list[str]]] = defaultdict(lambda: {LEFT: [], RIGHT: []})
        for name in left_over:
            path = _stem_path(name)
            for side, pattern in ((LEFT, left), (RIGHT, right)):
                for place in [*re.finditer(pattern, path)][-MOST_PLACES:]:
                    key = f"{path[: place.start()]}\0{path[place.end() :]}"
                    sides[key][side].append(name)
        for key in sorted(sides):
            both = sides[key][LEFT], sides[key][RIGHT]
            if len(both[0]) == len(both[1]) == 1 and left_over.issuperset(both[0] + both[1]):
                pairs.append(PairFiles(key, both[0][0], both[1][0]))
                left_over.difference_update(both[0] + both[1])
    return pairs


def _belonging(pair: PairFiles, candidates: Sequence[str], pairs: Sequence[PairFiles]) -> str | None:
    """Return the candidate that belongs to a pair and to no other, None where there is none."""
    folder = _folder(pair.left)
    beside = [name for name in candidates if _folder(name) == folder and not _numbered_as_right(name, pair)]
    if beside and sum(_folder(other.left) == folder for other in pairs) == 1:
        return min(beside, key=lambda name: (_NO_IMAGE.search(name) is not None, len(name), name))
    taken = {_folder(other.left) for other in pairs} - {folder}
    candidates = [name for name in candidates if _folder(name) not in taken]
    alike = [name for name in candidates if _core(name) == _core(pair.left) != ""]
    if not alike and len(pairs) > 1:
        numbers = _DIGITS.findall(PurePosixPath(pair.left).stem)
        alike = [name for name in candidates if numbers and _DIGITS.findall(PurePosixPath(name).stem) == numbers]
    if len(candidates) == len(pairs) == 1:
        alike = list(candidates)
    return min(alike, key=lambda name: (_nearness(name, pair.left), "noc" in name, name), default=None)


def _numbered_as_right(name: str, pair: PairFiles) -> bool:
    """Return whether a ground truth has a number, as Middlebury's disp1.png, and it is not that of the left image."""
    number = _SIDE_NUMBER.search(PurePosixPath(name).stem)
    sides = [_DIGITS.findall(PurePosixPath(side).stem)[-1:] for side in (pair.left, pair.right)]
    return bool(number and sides[0] != sides[1] and sides[0] != [number[1]])


def _above(pair: PairFiles, candidates: Sequence[str], pairs: Sequence[PairFiles]) -> tuple[str, ...]:
    """Return the calibration of a pair: with its name, in its folder, or in one above; none where it is not clear."""
    alike = [name for name in candidates if _core(name) == _core(pair.left) != "" or _same_number(name, pair.left)]
    if len(alike) == 1 and len(pairs) > 1:
        return (alike[0],)
    folders = [_folder(pair.left), *map(str, PurePosixPath(_folder(pair.left)).parents)]
    for folder in folders:
        inside = sorted(name for name in candidates if _folder(name) == folder)
        if len(inside) <= 1:
            found = tuple(inside)
        else:
            found = _in_parts(inside) or tuple(name for name in inside if "calib" in _stem_path(name).casefold())[:1]
        if found:
            return found
    return tuple(candidates) if len(candidates) == 1 else ()


def _in_parts(names: Sequence[str]) -> tuple[str, ...]:
    """Return the two files of a calibration that comes in two; nothing where there are no such two."""
    for pattern in _IN_PARTS:
        found = {match[0].casefold(): name for name in names if (match := pattern.search(PurePosixPath(name).stem))}
        if len(found) == 2:
            return tuple(sorted(found.values()))
    return ()


def _core(name: str) -> str:
    """Return what of a file's name is left without the words that tell its side or what it is."""
    stem = PurePosixPath(name).stem
    for pattern in (_TRUTH, *(re.compile(part) for both in CONVENTIONS[:2] for part in both)):
        stem = pattern.sub("", stem)
    return re.sub(r"[-_ .]+", "", stem).casefold()


def _same_number(name: str, other: str) -> bool:
    """Return whether a file is named by a number alone, with which the other's name begins."""
    stem = PurePosixPath(name).stem
    return stem.isdigit() and PurePosixPath(other).stem.split("_")[0] == stem


def _nearness(name: str, other: str) -> int:
    """Return how many of their folders two files do not share."""
    first, second = PurePosixPath(name).parts[:-1], PurePosixPath(other).parts[:-1]
    shared = sum(1 for one, two in zip(first, second, strict=False) if one == two)
    return len(first) + len(second) - 2 * shared


def _called(keys: Sequence[str]) -> list[str]:
    """Return what pairs are called: what their names have in common, without the folders that all of them share."""
    parts = [[re.sub(r"[-_ .]*\0[-_ .]*", " ", part).strip() for part in key.split("/")] for key in keys]
    parts = [[part for part in one if part] for one in parts]
    while len(parts) > 1 and all(len(one) > 1 for one in parts) and len({one[0] for one in parts}) == 1:
        parts = [one[1:] for one in parts]
    return [" ".join(one[-2:]) or "pair" for one in parts]


def natural_order(name: str) -> list[tuple[int, str]]:
    """Return a key by which 2 comes before 10."""
    return [(int(part[:18]), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name.casefold())]


def _stem_path(name: str) -> str:
    return re.sub(r"\.[^./]*$", "", name.replace("\\", "/"))


def _ending(name: str) -> str:
    return PurePosixPath(name).suffix.removeprefix(".").casefold()


def _folder(name: str) -> str:
    return str(PurePosixPath(name.replace("\\", "/")).parent)
