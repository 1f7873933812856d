"""Files that belong together: left and right images, ground truths and calibrations, matched by their names."""

from __future__ import annotations

import glob
import re
from collections import Counter, defaultdict
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any, TypeVar

from stereolag.core.inputs import Image
from stereolag.geometry.boards import MAX_PAIRS
from stereolag.io.calibrations import CALIBRATION_SUFFIXES
from stereolag.io.disparities import DISPARITY_SUFFIXES
from stereolag.io.images import IMAGE_SUFFIXES, read_image
from stereolag.io.sources import is_archive, quote, read_archive, read_bytes

K = TypeVar("K", bound=Hashable)

LEFT, RIGHT = "left", "right"
MAX_SIDE_POSITIONS = 8
"""Maximum number of positions in one name that are tried for the word or number of the side."""


@dataclass(frozen=True)
class PairFiles:
    """The file names of one pair, and its `name`: the part common to its file names.

    `convention` is the index in :data:`CONVENTIONS` of the convention that distinguished left from right.
    """

    name: str
    left: str
    right: str
    truth: str | None = None
    calibrations: tuple[str, ...] = ()
    convention: int = 0


def _word(word: str) -> str:
    """Return a pattern for a word that stands alone, or is separated from its neighbours by camel case."""
    return rf"(?:(?<![A-Za-z])(?i:{word})|(?<=[a-z0-9]){word.capitalize()})(?![a-z])"


def _number(before: str, number: str) -> str:
    """Return a pattern for a complete number after the given letters."""
    return rf"(?<![A-Za-z])(?i:{before})[-_]?{number}(?![0-9])"


CONVENTIONS: tuple[tuple[str, str], ...] = (
    (_word("left"), _word("right")),
    (r"(?:(?<![A-Za-z])[lL]|(?<=[a-z])L)(?![A-Za-z])", r"(?:(?<![A-Za-z])[rR]|(?<=[a-z])R)(?![A-Za-z])"),
    (_number("image", "0*2"), _number("image", "0*3")),  # KITTI's colour cameras, before its grey ones
    (_number("(?:im(?:age|g)?|colou?red)", "0+"), _number("(?:im(?:age|g)?|colou?red)", "0*1")),
    (_number("cam(?:era)?", "0+"), _number("cam(?:era)?", "0*1")),
    (_number("cam(?:era)?", "0*1"), _number("cam(?:era)?", "0*2")),
    (_number("view", "0+"), _number("view", "0*1")),
    (_number("view", "1"), _number("view", "5")),  # Middlebury 2005 and 2006
    (_number("im", "2"), _number("im", "6")),  # Middlebury 2001 and 2003
    (_number("im(?:age|g)?", "0*1"), _number("im(?:age|g)?", "0*2")),
    (r"(?:^|(?<=[-_ .]))0(?=[-_ .]|$)", r"(?:^|(?<=[-_ .]))1(?=[-_ .]|$)"),
    (r"(?:^|(?<=[-_ .]))1(?=[-_ .]|$)", r"(?:^|(?<=[-_ .]))2(?=[-_ .]|$)"),
)
"""Differences between the names of left and right images, the most reliable first: one pattern for each side, searched
in all folder names and in the file name without its suffix."""

_TRUTH = re.compile(
    r"(?<![A-Za-z])(?i:gt|truth|ground[-_ ]?truth|disp(?:arity|arities|map)?)(?=[LR]?(?![A-Za-z]))(?P<number>[-_]?\d+)?"
)
_NOT_A_PICTURE = re.compile(r"(?<![a-z])(mask|valid|occ|nocc|nonocc|conf(?:idence)?|depth)(?![a-z])", re.IGNORECASE)
_CALIBRATION = re.compile(
    r"calib|camera|intrinsic|extrinsic|stereo|chain|(?:^|/)(?:K\.txt|SN\d*\.conf)$", re.IGNORECASE
)
_SPLIT_CALIBRATIONS = (re.compile("intrinsic|extrinsic", re.IGNORECASE), re.compile("left|right", re.IGNORECASE))
"""Words that tell the two files of a calibration apart: in OpenCV's sample, and in ROS."""

_RIGHT_SIDE = re.compile(r"(?<![A-Za-z])(?i:right|r)(?![A-Za-z])|(?<=[a-z])R(?![A-Za-z])")
_SIDE_NUMBER = re.compile(r"disp[a-z]*[-_]?(\d+)", re.IGNORECASE)
_DIGITS = re.compile(r"\d+")
_SIDES = tuple(re.compile(part) for both in CONVENTIONS[:2] for part in both)


def matched_pairs(names: Sequence[str]) -> list[PairFiles]:
    """Return the pairs among files, matched by their names alone, in the order of these names.

    Parameters
    ----------
    names
        Names of the files, including any folders: "left/000.png", "teddy/im2.png".

    Returns
    -------
    pairs
        Left and right images whose names differ only in a word or number that gives the side (:data:`CONVENTIONS`),
        in one folder, in the file name or throughout. A ground truth belongs to the only pair in its folder, or to the
        pair whose name or number it shares. A calibration belongs to the pair whose name or number it shares, or to
        all pairs in its folder and below; if there is only one, it belongs to all pairs.
    """
    pictures, truths = _pictures(names)
    found = sorted(_pair_pictures(pictures), key=lambda pair: [natural_order(pair.left), pair.left])
    calibrations = _Calibrations(
        [
            name
            for name in names
            if suffix_of(name) in CALIBRATION_SUFFIXES
            and name not in truths
            and (_CALIBRATION.search(name) or suffix_of(name) in ("yaml", "yml"))
        ],
        found,
    )
    left_truths = _Truths([name for name in truths if not _RIGHT_SIDE.search(PurePosixPath(name).stem)], found)
    return [
        replace(pair, name=name, truth=left_truths.of(pair), calibrations=calibrations.of(pair))
        for pair, name in zip(found, _pair_names([pair.name for pair in found]), strict=True)
    ]


def unpaired_left(names: Sequence[str], pairs: Sequence[PairFiles], convention: int) -> list[str]:
    """Return the left pictures among files, by a convention, that are in none of the pairs."""
    paired = {name for pair in pairs for name in (pair.left, pair.right)}
    left, _ = CONVENTIONS[convention]
    return [name for name in _pictures(names)[0] if name not in paired and re.search(left, _stem_path(name))]


def pictures_by_side(names: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the left and the right pictures among files, in natural order, if the names of their folders tell them."""
    pictures = sorted(_pictures(names)[0], key=natural_order)
    for patterns in CONVENTIONS:
        left, right = ([name for name in pictures if re.search(side, _folder(name))] for side in patterns)
        if left and right and not {*left} & {*right}:
            return left, right
    return [], []


def _pictures(names: Sequence[str]) -> tuple[list[str], set[str]]:
    """Return the camera pictures and the ground truths among files."""
    truths = {name for name in names if suffix_of(name) in DISPARITY_SUFFIXES and _TRUTH.search(_stem_path(name))}
    pictures = [name for name in names if suffix_of(name) in IMAGE_SUFFIXES and name not in truths]
    return [name for name in pictures if not _NOT_A_PICTURE.search(PurePosixPath(name).stem)], truths


def _pair_pictures(pictures: Iterable[str]) -> list[PairFiles]:
    """Return the pairs among pictures; each convention is applied to those that the previous ones left unpaired."""
    unpaired = set(pictures)
    pairs: list[PairFiles] = []
    for convention, (left, right) in enumerate(CONVENTIONS):
        sides: dict[str, dict[str, list[str]]] = defaultdict(lambda: {LEFT: [], RIGHT: []})
        for name in unpaired:
            path = _stem_path(name)
            for side, pattern in ((LEFT, left), (RIGHT, right)):
                matches = [*re.finditer(pattern, path)][-MAX_SIDE_POSITIONS:]
                keys = [f"{path[: match.start()]}\0{path[match.end() :]}" for match in matches]
                for key in keys if len(keys) < 2 else [*keys, re.sub(pattern, "\0", path)]:
                    sides[key][side].append(name)
        # Names that differ in one position come before those that differ in all, as in left/left_0.
        for key in sorted(sides, key=lambda key: (key.count("\0") > 1, key)):
            lefts, rights = sides[key][LEFT], sides[key][RIGHT]
            if len(lefts) == len(rights) == 1 and unpaired.issuperset(lefts + rights):
                pairs.append(PairFiles(key, lefts[0], rights[0], convention=convention))
                unpaired.difference_update(lefts + rights)
    return pairs


class _Truths:
    """Ground truths indexed by folder and name, so that no pair need be compared with all of them."""

    def __init__(self, names: Sequence[str], pairs: Sequence[PairFiles]) -> None:
        self._names, self._pairs_in = names, Counter(_folder(pair.left) for pair in pairs)
        self._one_pair = len(pairs) == 1
        self._by_folder = _grouped(names, _folder)
        self._by_bare_name = _grouped(names, lambda name: (self._owner(name), _bare_name(name)))
        # The number of disp0_teddy is that of the left camera.
        self._by_plain_name = _grouped(names, lambda name: (self._owner(name), _bare_name(_TRUTH.sub("", name))))
        self._by_numbers = _grouped(names, lambda name: (self._owner(name), _numbers(name)))
        self._by_last_numbers = _grouped(names, lambda name: (self._owner(name), _numbers(_TRUTH.sub("", name))))

    def of(self, pair: PairFiles) -> str | None:
        """Return the ground truth that belongs to a pair and to no other; None if there is none."""
        folder = _folder(pair.left)
        beside = self._by_folder.get(folder, []) if self._pairs_in[folder] == 1 else []
        if beside := [name for name in beside if not _numbered_as_right(name, pair)]:
            return min(beside, key=lambda name: (_NOT_A_PICTURE.search(name) is not None, len(name), name))
        if self._one_pair and len(self._names) == 1:
            return self._names[0]
        common = pair.name.replace("\0", "") + "."  # without the side, and without a suffix
        searches: list[tuple[dict[tuple[str | None, Any], list[str]], Any]] = [
            (self._by_bare_name, _bare_name(pair.left)),
            (self._by_bare_name, _bare_name(common)),
            (self._by_plain_name, _bare_name(common)),
        ]
        if not self._one_pair:
            searches += [(self._by_numbers, _numbers(common)), (self._by_last_numbers, _numbers(common))]
        found: list[str] = []
        for names, wanted in searches:
            matching = [name for owner in (None, folder) for name in names.get((owner, wanted), [])] if wanted else []
            found = found or [name for name in matching if not _numbered_as_right(name, pair)]
        return min(found, key=lambda name: (_folder_distance(name, pair.left), "noc" in name, name), default=None)

    def _owner(self, name: str) -> str | None:
        """Return the folder of a ground truth if it contains pairs, to which it then belongs; None for any pair."""
        folder = _folder(name)
        return folder if folder in self._pairs_in else None


def _numbered_as_right(name: str, pair: PairFiles) -> bool:
    """Return whether a ground truth has a number, like Middlebury's disp1.png, that is the right image's."""
    number = _SIDE_NUMBER.search(PurePosixPath(name).stem)
    left, right = (_DIGITS.findall(PurePosixPath(side).stem)[-1:] for side in (pair.left, pair.right))
    return bool(number and left != right == [number[1]])


class _Calibrations:
    """Calibrations indexed by folder and name."""

    def __init__(self, names: Sequence[str], pairs: Sequence[PairFiles]) -> None:
        self._names, self._several_pairs = names, len(pairs) > 1
        self._by_bare_name = _grouped(names, _bare_name)
        self._by_stem = _grouped(names, lambda name: PurePosixPath(name).stem)
        self._in_folder = {folder: _unambiguous(sorted(group)) for folder, group in _grouped(names, _folder).items()}

    def of(self, pair: PairFiles) -> tuple[str, ...]:
        """Return the calibrations of a pair: with its name, in its folder, or in one above; empty if ambiguous."""
        bare, prefix = _bare_name(pair.left), PurePosixPath(pair.left).stem.split("_")[0]
        by_name = {
            *(self._by_bare_name.get(bare, []) if bare else []),
            *(self._by_stem.get(prefix, []) if prefix.isdigit() else []),
        }
        if len(by_name) == 1 and self._several_pairs:
            return (*by_name,)
        folder = _folder(pair.left)
        for parent in (folder, *map(str, PurePosixPath(folder).parents)):
            if found := self._in_folder.get(parent):
                return found
        return tuple(self._names) if len(self._names) == 1 else ()


def _unambiguous(names: Sequence[str]) -> tuple[str, ...]:
    """Return the files of the only calibration in a folder; empty if there seem to be several."""
    if len(names) == 1:
        return (names[0],)
    for pattern in _SPLIT_CALIBRATIONS:
        found = {match[0].casefold(): name for name in names if (match := pattern.search(PurePosixPath(name).stem))}
        if len(found) == 2:
            return tuple(sorted(found.values()))
    return tuple(name for name in names if "calib" in _stem_path(name).casefold())[:1]


def _bare_name(name: str) -> str:
    """Return a file's name without folders, suffix, separators and the words for its side or kind."""
    stem = PurePosixPath(name).stem
    stem = _TRUTH.sub(lambda kind: kind["number"] or "", stem)
    for pattern in _SIDES:
        stem = pattern.sub("", stem)
    return re.sub(r"[-_ .]+", "", stem).casefold()


def _numbers(name: str) -> tuple[str, ...]:
    return tuple(_DIGITS.findall(PurePosixPath(name).stem))


def _grouped(names: Iterable[str], key: Callable[[str], K]) -> dict[K, list[str]]:
    groups: dict[K, list[str]] = defaultdict(list)
    for name in names:
        groups[key(name)].append(name)
    return groups


def _folder_distance(name: str, other: str) -> int:
    """Return the number of folders in the paths of two files that they do not share."""
    first, second = PurePosixPath(name).parts[:-1], PurePosixPath(other).parts[:-1]
    shared = sum(1 for one, two in zip(first, second, strict=False) if one == two)
    return len(first) + len(second) - 2 * shared


def _pair_names(keys: Sequence[str]) -> list[str]:
    """Return the names of pairs: the common parts of their file names, without folders common to all pairs."""
    parts = [[re.sub(r"[-_ .]*\0[-_ .]*", " ", part).strip() for part in key.split("/")] for key in keys]
    parts = [[part for part in one if part] for one in parts]
    while len(parts) > 1 and all(len(one) > 1 for one in parts) and len({one[0] for one in parts}) == 1:
        parts = [one[1:] for one in parts]
    return [" ".join(one[-2:]) or "pair" for one in parts]


def natural_order(name: str) -> list[tuple[int, str]]:
    """Return a sort key by which file 2 comes before file 10."""
    return [(int(part[:18]), "") if part.isdecimal() else (-1, part) for part in re.split(r"(\d+)", name.casefold())]


def _stem_path(name: str) -> str:
    return re.sub(r"\.[^./]*$", "", name.replace("\\", "/"))


def suffix_of(name: str) -> str:
    """Return the suffix of a file's name in lower case, without the point."""
    return PurePosixPath(name).suffix.removeprefix(".").casefold()


def _folder(name: str) -> str:
    return str(PurePosixPath(name.replace("\\", "/")).parent)


@dataclass(frozen=True)
class PicturesOfFiles:
    """Pairs of pictures, decoded anew on every access: all of them in memory would take gigabytes."""

    files: Sequence[PairFiles]
    read: Callable[[str], bytes]
    decode: Callable[[bytes], Image] = read_image

    def __len__(self) -> int:
        return len(self.files)

    def __getitem__(self, number: int) -> tuple[Image, Image]:
        return self._picture(self.files[number].left), self._picture(self.files[number].right)

    def _picture(self, name: str) -> Image:
        try:
            return self.decode(self.read(name))
        except ValueError as error:
            raise ValueError(f"{quote(name)}: {error}") from error


# Pictures of a board, from the arguments of a command.


def board_pictures(given: Sequence[str]) -> tuple[list[str], PicturesOfFiles]:
    """Return the names of pairs of pictures, and the pairs, decoded on demand.

    `given` is two patterns, a folder, a ZIP, or files to be matched by name.

    Raises
    ------
    ValueError
        No pairs, too many, patterns that match nothing or different numbers of files, or a damaged ZIP.
    OSError
        A file or folder that cannot be read.
    """
    read: Callable[[str], bytes] = partial(read_bytes, what="picture")
    if len(given) == 2 and all(glob.has_magic(text) and not Path(text).exists() for text in given):
        pairs = _checked_count(_paired_by_number(*given))
    else:
        names = [name for text in given for name in _files_at(text)]
        if len(given) == 1 and Path(given[0]).is_file():
            data = read(given[0])
            if not is_archive(data):
                raise ValueError(
                    f"{given[0]} is one file but not a ZIP; give a folder, a ZIP, or the files of both cameras."
                )
            try:
                archive = read_archive(data)
            except ValueError as error:
                raise ValueError(f"{given[0]}: {error}") from error
            names, read = [*archive.names], archive.read
        pairs = board_pairs(names, "or give two patterns in quotes")
    return [pair.name for pair in pairs], PicturesOfFiles(pairs, read)


def board_pairs(names: Sequence[str], otherwise: str) -> list[PairFiles]:
    """Return the pairs of pictures of a board among files, matched by name; ValueError if there are none, or too many.

    `otherwise` is the end of the message if there are none: what to do other than renaming the files.
    """
    pairs = matched_pairs(names)
    if not pairs:
        raise ValueError(
            f"No left and right pictures match by name (files given: {len(names)}); name them left01 and right01, "
            f"{otherwise}."
        )
    return _checked_count(pairs)


def _checked_count(pairs: list[PairFiles]) -> list[PairFiles]:
    """Return the pairs unchanged; ValueError if there are too many."""
    if len(pairs) > MAX_PAIRS:
        raise ValueError(f"These are {len(pairs)} pairs; at most {MAX_PAIRS} are accepted, and 8 to 40 are enough.")
    return pairs


def _paired_by_number(left: str, right: str) -> list[PairFiles]:
    """Return the files that match two patterns in pairs, in the order of their numbers."""
    files = [_glob(pattern) for pattern in (left, right)]
    for pattern, found in zip((left, right), files, strict=True):
        if not found:
            raise ValueError(f"{pattern}: no file matches.")
    if len(files[0]) != len(files[1]):
        raise ValueError(
            f"{left} matches {len(files[0])} files and {right} {len(files[1])}; the numbers must be equal."
        )
    return [PairFiles(Path(one).stem, one, other) for one, other in zip(*files, strict=True)]


def _files_at(text: str) -> list[str]:
    """Return the file at a path, the pictures in and below a folder, or the files that match a pattern."""
    path = Path(text)
    if path.is_dir():
        return sorted(str(file) for file in path.rglob("*") if suffix_of(file.name) in IMAGE_SUFFIXES)
    if path.exists():
        return [text]
    found = _glob(text)
    if not found:
        raise ValueError(f"{text}: there is no such file or folder.")
    return found


def _glob(pattern: str) -> list[str]:
    """Return the files that match a pattern, in the order of their numbers."""
    return sorted(glob.glob(pattern, recursive=True), key=natural_order)  # noqa: PTH207 (Path's takes none from the root)
