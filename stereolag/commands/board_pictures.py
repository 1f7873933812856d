"""The pairs of pictures given to a command: two patterns, a folder, a ZIP, or files matched by their names."""

from __future__ import annotations

import glob
from collections.abc import Callable, Sequence
from pathlib import Path

from stereolag.geometry.boards import MOST_PAIRS
from stereolag.io.archives import is_archive, read_archive
from stereolag.io.pairing import PICTURE_ENDINGS, PairFiles, PicturesOfFiles, matched_pairs, natural_order
from stereolag.io.sources import read_bytes

WHAT = "picture"


def board_pictures(given: Sequence[str]) -> tuple[list[str], PicturesOfFiles]:
    """Return the names of the pairs, and the pairs, decoded on demand.

    Raises
    ------
    ValueError
        No pairs, too many, patterns that match nothing or different numbers of files, or a damaged ZIP.
    OSError
        A file or folder that cannot be read.
    """
    pairs, read = _two_patterns(given) if len(given) == 2 and all(map(_is_pattern, given)) else _by_names(given)
    if len(pairs) > MOST_PAIRS:
        raise ValueError(f"These are {len(pairs)} pairs; at most {MOST_PAIRS} are accepted, and 8 to 40 are enough.")
    return [pair.name for pair in pairs], PicturesOfFiles(pairs, read)


def _is_pattern(text: str) -> bool:
    return glob.has_magic(text) and not Path(text).exists()


def _two_patterns(given: Sequence[str]) -> tuple[list[PairFiles], Callable[[str], bytes]]:
    """Return the files of two patterns in pairs, in the order of their numbers."""
    left, right = map(_matching, given)
    for pattern, files in zip(given, (left, right), strict=True):
        if not files:
            raise ValueError(f"{pattern}: no file matches.")
    if len(left) != len(right):
        raise ValueError(
            f"{given[0]} matches {len(left)} files and {given[1]} {len(right)}; the numbers must be equal."
        )
    return [PairFiles(Path(one).stem, one, other) for one, other in zip(left, right, strict=True)], _read_file


def _by_names(given: Sequence[str]) -> tuple[list[PairFiles], Callable[[str], bytes]]:
    """Return the pairs among files, in folders or in one ZIP, matched by their names."""
    first = Path(given[0])
    if len(given) == 1 and first.is_file():
        data = read_bytes(first, "archive")
        if not is_archive(data):
            raise ValueError(f"{first} is one file but not a ZIP; give a folder, a ZIP, or the files of both cameras.")
        archive = read_archive(data)
        names: list[str] = list(archive.names)
        read = archive.read
    else:
        names, read = [one for text in given for one in _files(text)], _read_file
    pairs = matched_pairs(names)
    if not pairs:
        raise ValueError(
            f"No left and right pictures match by name (files given: {len(names)}); name them left01 and right01, or "
            "give two patterns in quotes."
        )
    return pairs, read


def _files(text: str) -> list[str]:
    """Return a file, the pictures in a folder and below it, or the files that match a pattern."""
    path = Path(text)
    if path.is_dir():
        found = (one for one in path.rglob("*") if one.suffix.removeprefix(".").lower() in PICTURE_ENDINGS)
        return sorted(str(one) for one in found)
    if path.exists():
        return [text]
    if not (found_by_pattern := _matching(text)):
        raise ValueError(f"{text}: there is no such file or folder.")
    return found_by_pattern


def _matching(pattern: str) -> list[str]:
    """Return the files that match a pattern, in the order of their numbers."""
    return sorted(glob.glob(pattern, recursive=True), key=natural_order)  # noqa: PTH207 (Path's takes none from the root)


def _read_file(name: str) -> bytes:
    return read_bytes(name, WHAT)
