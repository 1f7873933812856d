"""The bytes of files, read from a source or a ZIP archive; quotes of untrusted text; files and archives written whole.

Of an archive, only requested files are unpacked, within limits, and never to disk. The limits are: the size of the
directory, checked before it is parsed; the number and total size of the files as stated in the directory, checked
before anything is decompressed; and during decompression, the stated size of the file. Names are only keys for
requesting files and never become paths.
"""

from __future__ import annotations

import io
import os
import re
import unicodedata
import zipfile
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path, PurePosixPath
from typing import BinaryIO, TypeAlias
from uuid import uuid4

from stereolag.core.jobs import limits

Source: TypeAlias = str | PathLike[str] | bytes | bytearray | memoryview | BinaryIO
"""A path, the bytes themselves, or a binary file object such as a Streamlit upload."""

MAX_BYTES = 256 * 2**20
MAX_SIDE = 1_000_000
"""Rows or columns of an image: decoders keep a pointer for every row."""
HEADER_BYTES = 4096
"""Bytes at the beginning of a file by which its format is recognised, and that may hold a text header."""


def read_bytes(source: Source, what: str) -> bytes:
    """Return all bytes of `source`; a file object is read from its beginning and left at its end.

    `what` is its name in errors, for example ``"image"``.

    Raises
    ------
    ValueError
        No bytes at all, more than 256 MB, or not a source.
    OSError
        A path that cannot be opened.
    """
    if not (isinstance(source, str | PathLike | bytes | bytearray | memoryview) or hasattr(source, "read")):
        raise ValueError(f"The {what} is read from a path, bytes or a binary file, not from {type(source).__name__}.")
    data = beginning(source, MAX_BYTES + 1)
    if not isinstance(data, bytes):
        raise ValueError(f"The {what} was opened as text; open it in binary mode.")
    if not data:
        raise ValueError(f"The {what} is an empty file (0 bytes).")
    if len(data) > MAX_BYTES:
        raise ValueError(f"The {what} is larger than {MAX_BYTES // 2**20} MB, the most that is accepted.")
    return data


def beginning(source: Source, count: int = HEADER_BYTES) -> bytes:
    """Return the first bytes of `source`, by which its format is recognised; a file object is left after them."""
    if isinstance(source, bytes | bytearray | memoryview):
        return bytes(source)[:count]
    if isinstance(source, str | PathLike):
        with Path(source).open("rb") as file:
            return file.read(count)
    if hasattr(source, "seek"):
        source.seek(0)
    return source.read(count)


def check_pixels(width: int, height: int, what: str) -> None:
    """Refuse an image with no or too many pixels; called on the header, before a pixel is decoded.

    Raises
    ------
    ValueError
        No pixels, more than the current limit, or more than a million in a row or column.
    """
    if width < 1 or height < 1:
        raise ValueError(f"The {what} is {width} × {height} pixels: it holds none.")
    too_long = max(width, height) > MAX_SIDE
    if too_long or width * height > limits().max_pixels:
        raise ValueError(
            f"The {what} is {width} × {height} pixels ({width * height / 1e6:.0f} megapixels); at most "
            f"{limits().max_megapixels} megapixels are accepted"
            f"{f', and {MAX_SIDE:,} pixels in a row or column' if too_long else ''}."
        )


def quote(text: str) -> str:
    """Return the start of `text` in quotes, harmless in an error shown as Markdown or HTML.

    Square brackets, which loggers put around units, become round, since they are active in Markdown.
    """
    start = re.sub(r"[^\w .,:;+=()°%/-]|//+", "?", text[:24].replace("[", "(").replace("]", ")"))
    return f"“{start}…”" if len(text) > 24 else f"“{start}”"


def escape(text: str) -> str:
    """Return a sentence that quotes untrusted text, without characters active in Markdown or HTML."""
    return re.sub(r"[^\w .,:;'+=>?()-]", "?", text[:300])


def write_file(path: Path, data: bytes, *, synced: bool = True) -> None:
    """Write a temporary file beside `path` and move it there once it is complete.

    `synced` waits until the data is on the disk. Otherwise a power failure may leave half a file; an interrupted
    process never does.

    Raises
    ------
    OSError
        The folder does not exist, the disk is full, and so on; an existing file is left unchanged.
    """
    temporary = path.with_name(f".{uuid4().hex}.part")
    try:
        with temporary.open("xb") as file:
            file.write(data)
            file.flush()
            if synced:
                os.fsync(file.fileno())
        temporary.replace(path)
    except OSError as error:
        error.filename, error.filename2 = str(path), None  # the temporary file's name says nothing
        raise
    finally:
        temporary.unlink(missing_ok=True)


# ZIP archives.

ZIP_MAGIC = b"PK\x03\x04"
NOT_AN_ARCHIVE = "The archive is not a ZIP file, or it is damaged or cut short."
MAX_FILES = 2000
MAX_DIRECTORY_BYTES = 2**20
MAX_NAME_LENGTH = 300
MAX_DEPTH = 8

_END_RECORD_MAGIC = b"PK\x05\x06"
_END_RECORD_BYTES, _MAX_COMMENT_BYTES = 22, 65_535
"""Sizes of the record that ends a ZIP archive and of the comment after it."""
_ZIP64_LOCATOR_MAGIC = b"PK\x06\x07"
_ZIP64_LOCATOR_BYTES = 20
_ENCRYPTED_FLAG = 1


@dataclass(frozen=True, eq=False)
class Archive:
    """The files of an archive, still packed.

    Attributes
    ----------
    names
        Names of all files, in the archive's order, folders with slashes: "scene/left.png". Untrusted text.
    packed
        The bytes of the archive.
    """

    names: tuple[str, ...]
    packed: bytes

    def __reduce__(self) -> tuple[type[Archive], tuple[tuple[str, ...], bytes]]:
        return Archive, (self.names, self.packed)

    @cached_property
    def _opened(self) -> zipfile.ZipFile:
        """Return the opened archive, its directory parsed once: for thousands of files this is slower than a read."""
        return zipfile.ZipFile(io.BytesIO(self.packed))

    def read(self, name: str) -> bytes:
        """Return the bytes of one file; several threads may call this at once.

        Raises
        ------
        ValueError
            No such file, or one that is damaged.
        """
        if name not in self.names:
            raise ValueError(f"The archive holds no {quote(name)}.")
        try:
            with self._opened.open(name) as file:
                data = file.read()  # no more than the directory states, which was checked
            if len(data) != self._opened.getinfo(name).file_size:
                raise EOFError("shorter than stated")
        except Exception as error:  # zipfile and zlib raise all kinds of errors on broken files
            raise ValueError(f"{quote(name)} in the archive is damaged or cut short.") from error
        return data


def is_archive(data: bytes) -> bool:
    """Return whether the bytes begin like a ZIP archive."""
    return data.startswith((ZIP_MAGIC, _END_RECORD_MAGIC))


def read_archive(source: Source, *, max_files: int = MAX_FILES) -> Archive:
    """Read the directory of a ZIP archive, without folders, hidden files and those added by macOS.

    Raises
    ------
    ValueError
        An archive that is damaged, encrypted or packed by a method other than "deflate", or that has more than
        `max_files` files or none, two of the same name, more than 256 MB unpacked, or names that are too long or lead
        out of it.
    """
    packed = read_bytes(source, "archive")
    _check_directory(packed)
    try:
        with zipfile.ZipFile(io.BytesIO(packed)) as whole:
            members = whole.infolist()
    except Exception as error:  # zipfile raises all kinds of errors on broken files
        raise ValueError(NOT_AN_ARCHIVE) from error
    kept = [member for member in members if not (member.is_dir() or _is_hidden(member.filename))]
    if not kept:
        raise ValueError("The archive holds no files.")
    if len(kept) > max_files:
        raise ValueError(f"The archive holds {len(kept):,} files; at most {max_files:,} are accepted.")
    for member in kept:
        for fault, is_present in _member_faults(member).items():
            if is_present:
                raise ValueError(f"{quote(member.filename)} in the archive {fault}.")
    unpacked = sum(member.file_size for member in kept)
    if unpacked > MAX_BYTES:
        raise ValueError(
            f"The archive holds {unpacked / 2**20:,.0f} MB unpacked; at most {MAX_BYTES // 2**20} MB are accepted."
        )
    names = tuple(member.filename for member in kept)
    twins = [name for name, count in Counter(names).items() if count > 1]
    if twins:
        raise ValueError(f"The archive holds two files named {quote(twins[0])}.")
    return Archive(names, packed)


def _member_faults(member: zipfile.ZipInfo) -> dict[str, bool]:
    """Return the possible faults of a file in an archive, as phrases, and whether it has them by the directory."""
    name = member.filename
    parts = PurePosixPath(name.replace("\\", "/")).parts
    return {
        "has too long a name": len(name) > MAX_NAME_LENGTH or len(parts) > MAX_DEPTH,
        "points outside it; only names within are accepted": (
            ".." in parts or name.startswith(("/", "\\")) or ":" in parts[0]
        ),
        "is encrypted; pack it without a password": bool(member.flag_bits & _ENCRYPTED_FLAG),
        "is packed by a method other than “deflate”": (
            member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
        ),
    }


def _check_directory(packed: bytes) -> None:
    """Refuse a directory that is too long to parse: every entry takes ten times its bytes in memory."""
    end = packed.rfind(_END_RECORD_MAGIC, max(0, len(packed) - _END_RECORD_BYTES - _MAX_COMMENT_BYTES))
    if end < 0 or len(packed) - end < _END_RECORD_BYTES:
        raise ValueError(NOT_AN_ARCHIVE)
    if packed[max(0, end - _ZIP64_LOCATOR_BYTES) : end].startswith(_ZIP64_LOCATOR_MAGIC):
        raise ValueError("The archive is in the format for more than 4 GB (ZIP64); pack fewer files.")
    size = int.from_bytes(packed[end + 12 : end + 16], "little")
    if size > MAX_DIRECTORY_BYTES:
        raise ValueError(
            f"The archive has a directory of {size / 2**20:,.0f} MB; at most {MAX_DIRECTORY_BYTES // 2**20} MB is "
            "accepted: pack fewer files."
        )


def _is_hidden(name: str) -> bool:
    parts = name.replace("\\", "/").split("/")
    return "__MACOSX" in parts or parts[-1].startswith(".") or parts[-1].casefold() in ("thumbs.db", "desktop.ini")


MAX_STEM_LENGTH, MAX_SUFFIX_LENGTH = 50, 10
"""Characters of a file name that are kept before and from its last dot."""

_DEVICES = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\.|$)", re.IGNORECASE)


def bundle(files: Mapping[str, bytes | str]) -> bytes:
    """Return a ZIP of all the files, bytes or text, in their order; :func:`file_name` makes each name harmless.

    Raises
    ------
    ValueError
        No files at all, or two whose names become the same.
    """
    if not files:
        raise ValueError("files is empty; an archive needs at least one.")
    names = [file_name(name) for name in files]
    # Windows and macOS do not distinguish A from a.
    counts = Counter(name.casefold() for name in names)
    twins = sorted({name for name in names if counts[name.casefold()] > 1})
    if twins:
        raise ValueError(f"files holds several that become {', '.join(twins)}; give each its own name.")
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, data in zip(names, files.values(), strict=True):
            entry = zipfile.ZipInfo(name)  # dated 1980-01-01: with the current time, every archive would differ
            # A PNG is already compressed.
            entry.compress_type = zipfile.ZIP_STORED if name.endswith(".png") else zipfile.ZIP_DEFLATED
            entry.external_attr, entry.create_system = 0o644 << 16, 3  # rw-r--r-- on Unix
            archive.writestr(entry, data)
    return stream.getvalue()


def file_name(name: str) -> str:
    """Return a name that is safe as a file name on any system and as text on a page: no folders, no Markdown.

    Letters and digits of any script, and dots, underscores and hyphens between them, are kept; the rest becomes
    hyphens.
    """
    last = unicodedata.normalize("NFC", re.split(r"[/\\]", name)[-1])
    harmless = PurePosixPath(re.sub(r"[^\w.]+", "-", last).strip("-_."))
    short = harmless.stem[:MAX_STEM_LENGTH] + harmless.suffix[:MAX_SUFFIX_LENGTH]
    return f"file-{short}".rstrip("-") if not short or _DEVICES.match(short) else short
