"""Shared by all readers and writers: the bytes of a source, size limits, safe quotes in errors, and whole files."""

from __future__ import annotations

import os
import re
from os import PathLike
from pathlib import Path
from typing import BinaryIO, TypeAlias
from uuid import uuid4

from stereolag.core.jobs import limits

Source: TypeAlias = str | PathLike[str] | bytes | bytearray | memoryview | BinaryIO
"""A path, the bytes themselves, or a binary file object such as a Streamlit upload."""

MAX_BYTES = 256 * 2**20
MAX_SIDE = 1_000_000
"""Limited because decoders keep a pointer for every row."""
HEADER_BYTES = 4096
"""Number of bytes at the beginning of a file that are searched for a text header."""


def read_bytes(source: Source, what: str) -> bytes:
    """Return all bytes of `source`; a file object is read from its beginning and left at its end.

    Parameters
    ----------
    source
        A path, bytes, or a binary file object.
    what
        Its name in errors, for example ``"image"``.

    Raises
    ------
    ValueError
        No bytes at all, more than 256 MB, or not a source.
    OSError
        A path that cannot be opened.
    """
    if isinstance(source, bytes | bytearray | memoryview):
        data = bytes(source)
    elif isinstance(source, str | PathLike):
        with Path(source).open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    elif hasattr(source, "read"):
        if hasattr(source, "seek"):
            source.seek(0)
        data = source.read(MAX_BYTES + 1)
    else:
        raise ValueError(f"A {what} is read from a path, bytes or a binary file, not from {type(source).__name__}.")
    if not isinstance(data, bytes):
        raise ValueError(f"The {what} was opened as text; open it in binary mode.")
    if not data:
        raise ValueError(f"The {what} is an empty file (0 bytes).")
    if len(data) > MAX_BYTES:
        raise ValueError(f"The {what} is larger than {MAX_BYTES // 2**20} MB, the most that is accepted.")
    return data


def check_pixels(width: int, height: int, what: str) -> None:
    """Refuse an image with no or too many pixels; called on the header, before a pixel is decoded.

    Raises
    ------
    ValueError
        No pixels, more than the limit in force, or more than a million in a row or column.
    """
    if width < 1 or height < 1:
        raise ValueError(f"The {what} is {width} × {height} pixels: it holds none.")
    if max(width, height) > MAX_SIDE:
        raise ValueError(
            f"The {what} is {width} × {height} pixels ({width * height / 1e6:.0f} megapixels); "
            f"at most {limits().max_megapixels} megapixels are accepted, and {MAX_SIDE:,} pixels in a row or column."
        )
    if width * height > limits().max_pixels:
        raise ValueError(
            f"The {what} is {width} × {height} pixels ({width * height / 1e6:.0f} megapixels); "
            f"at most {limits().max_megapixels} megapixels are accepted."
        )


def quote(text: str) -> str:
    """Return the start of `text` in quotes, harmless in an error shown as Markdown or HTML."""
    start = re.sub(r"[^\w .,:;+=-]", "?", text[:24])
    return f"“{start}…”" if len(text) > 24 else f"“{start}”"


def escape(text: str) -> str:
    """Return a sentence that quotes untrusted text, without characters active in Markdown or HTML."""
    return re.sub(r"[^\w .,:;'+=>?()-]", "?", text[:300])


def write_file(path: Path, data: bytes, *, synced: bool = True) -> None:
    """Write a temporary file beside `path` and move it there once it is complete.

    Parameters
    ----------
    path
        Path of the file, in an existing folder.
    data
        Content of the file.
    synced
        Wait until the data is on the disk. If not, a power failure may leave half a file, but an interrupted process
        still cannot.

    Raises
    ------
    OSError
        The folder does not exist, the disk is full, and so on; an existing file is left unchanged.
    """
    part = path.with_name(f".{uuid4().hex}.part")
    try:
        with part.open("xb") as file:
            file.write(data)
            file.flush()
            if synced:
                os.fsync(file.fileno())
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
