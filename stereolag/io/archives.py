"""ZIP archives, read from untrusted bytes and written: equal files give an equal archive, byte for byte.

Only requested files are unpacked, within limits, and never to disk.

The limits are: the size of the directory, checked before it is parsed; the number and total size of the files as stated
in the directory, checked before anything is decompressed; and during decompression, the stated size of the file. Names
are only keys for requesting files and never become paths.
"""

from __future__ import annotations

import io
import re
import unicodedata
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import PurePosixPath

from stereolag.io.sources import MAX_BYTES, Source, quote, read_bytes

WHAT = "archive"
MAGIC = b"PK"
MAX_FILES = 2000
MAX_DIRECTORY_BYTES = 2**20
MAX_NAME = 300
MAX_DEPTH = 8

_END = b"PK\x05\x06"
_END_BYTES, _COMMENT_BYTES = 22, 65_535
_END_OF_ZIP64 = b"PK\x06\x07"
_ZIP64_LOCATOR_BYTES = 20
_ENCRYPTED = 1
_METHODS = {zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED}


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
            raise ValueError(f"The {WHAT} holds no {quote(name)}.")
        try:
            with self._opened.open(name) as file:
                data = file.read()  # no more than the directory states, which was checked
            stated = self._opened.getinfo(name).file_size
        except Exception as error:  # zipfile and zlib raise all kinds of errors on broken files
            raise _damaged_file(name) from error
        if len(data) != stated:
            raise _damaged_file(name)
        return data


def is_archive(data: bytes) -> bool:
    """Return whether the bytes begin like a ZIP archive."""
    return data.startswith((b"PK\x03\x04", _END))


def read_archive(source: Source, *, max_files: int = MAX_FILES) -> Archive:
    """Read the directory of a ZIP archive.

    Parameters
    ----------
    source
        A path, the bytes of the file, or a binary file object.
    max_files
        Largest number of files.

    Returns
    -------
    archive
        The files, without folders, hidden files and those added by macOS.

    Raises
    ------
    ValueError
        An archive that is damaged, encrypted or packed by a method other than "deflate", or that has too many files or
        none, two of the same name, more than 256 MB unpacked, or names that are too long or lead out of it.
    """
    packed = read_bytes(source, WHAT)
    _check_directory(packed)
    try:
        with zipfile.ZipFile(io.BytesIO(packed)) as whole:
            members = whole.infolist()
    except Exception as error:  # zipfile raises all kinds of errors on broken files
        raise _damaged() from error
    kept = [member for member in members if not (member.is_dir() or _is_hidden(member.filename))]
    if not kept:
        raise ValueError(f"The {WHAT} holds no files.")
    if len(kept) > max_files:
        raise ValueError(f"The {WHAT} holds {len(kept):,} files; at most {max_files:,} are accepted.")
    for member in kept:
        _check_name(member.filename)
        if member.flag_bits & _ENCRYPTED:
            raise ValueError(f"{quote(member.filename)} in the {WHAT} is encrypted; pack it without a password.")
        if member.compress_type not in _METHODS:
            raise ValueError(f"{quote(member.filename)} in the {WHAT} is packed by a method other than “deflate”.")
    unpacked = sum(member.file_size for member in kept)
    if unpacked > MAX_BYTES:
        raise ValueError(
            f"The {WHAT} holds {unpacked / 2**20:,.0f} MB unpacked; at most {MAX_BYTES // 2**20} MB are accepted."
        )
    names = tuple(member.filename for member in kept)
    twin = next(_twins(names), None)
    if twin is not None:
        raise ValueError(f"The {WHAT} holds two files named {quote(twin)}.")
    return Archive(names, packed)


def _check_directory(packed: bytes) -> None:
    """Refuse a directory that is too long to parse: every entry takes ten times its bytes in memory."""
    end = packed.rfind(_END, max(0, len(packed) - _END_BYTES - _COMMENT_BYTES))
    if end < 0 or len(packed) - end < _END_BYTES:
        raise _damaged()
    if packed[max(0, end - _ZIP64_LOCATOR_BYTES) : end].startswith(_END_OF_ZIP64):
        raise ValueError(f"The {WHAT} is in the format for more than 4 GB (ZIP64); pack fewer files.")
    size = int.from_bytes(packed[end + 12 : end + 16], "little")
    if size > MAX_DIRECTORY_BYTES:
        raise ValueError(
            f"The {WHAT} has a directory of {size / 2**20:,.0f} MB; at most {MAX_DIRECTORY_BYTES // 2**20} MB is "
            "accepted: pack fewer files."
        )


def _check_name(name: str) -> None:
    parts = PurePosixPath(name.replace("\\", "/")).parts
    if len(name) > MAX_NAME or len(parts) > MAX_DEPTH:
        raise ValueError(f"{quote(name)} in the {WHAT} has too long a name.")
    if ".." in parts or name.startswith(("/", "\\")) or "\0" in name or ":" in parts[0]:
        raise ValueError(f"{quote(name)} in the {WHAT} points outside it; only names within are accepted.")


def _is_hidden(name: str) -> bool:
    parts = name.replace("\\", "/").split("/")
    return "__MACOSX" in parts or parts[-1].startswith(".") or parts[-1].casefold() in ("thumbs.db", "desktop.ini")


def _twins(names: tuple[str, ...]) -> Iterator[str]:
    seen: set[str] = set()
    for name in names:
        if name in seen:
            yield name
        seen.add(name)


def _damaged_file(name: str) -> ValueError:
    return ValueError(f"{quote(name)} in the {WHAT} is damaged or cut short.")


def _damaged() -> ValueError:
    return ValueError(f"The {WHAT} is not a ZIP file, or it is damaged or cut short.")


LONGEST_STEM, LONGEST_SUFFIX = 50, 10
EARLIEST = (1980, 1, 1, 0, 0, 0)
"""The earliest date that a ZIP can store: the time of the export would make every archive differ."""

READABLE = 0o644 << 16
UNIX = 3
_DEVICES = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\.|$)", re.IGNORECASE)


def bundle(files: Mapping[str, bytes | str]) -> bytes:
    """Return a ZIP of all the files, in their order.

    Parameters
    ----------
    files
        {name: bytes or text}; :func:`file_name` makes each name harmless.

    Raises
    ------
    ValueError
        No files at all, or two whose names become the same.
    """
    if not files:
        raise ValueError("files is empty; an archive needs at least one.")
    names = [file_name(name) for name in files]
    # Windows and macOS do not distinguish A from a.
    twins = sorted({name for name in names if [other.casefold() for other in names].count(name.casefold()) > 1})
    if twins:
        raise ValueError(f"files holds several that become {', '.join(twins)}; give each its own name.")
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, data in zip(names, files.values(), strict=True):
            entry = zipfile.ZipInfo(name, EARLIEST)
            # A PNG is compressed already.
            entry.compress_type = zipfile.ZIP_STORED if name.endswith(".png") else zipfile.ZIP_DEFLATED
            entry.external_attr, entry.create_system = READABLE, UNIX
            archive.writestr(entry, data)
    return stream.getvalue()


def file_name(name: str) -> str:
    """Return a name that is safe as a file name on any system and as text on a page: no folders, no Markdown.

    Letters and digits of any script, and dots, underscores and hyphens between them, are kept; all else becomes a
    hyphen.
    """
    last = unicodedata.normalize("NFC", re.split(r"[/\\]", name)[-1])
    harmless = PurePosixPath(re.sub(r"[^\w.]+", "-", last).strip("-_."))
    short = harmless.stem[:LONGEST_STEM] + harmless.suffix[:LONGEST_SUFFIX]
    return f"file-{short}".rstrip("-") if not short or _DEVICES.match(short) else short
