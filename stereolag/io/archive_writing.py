"""Many files in one ZIP: equal files give an equal archive, byte for byte."""

from __future__ import annotations

import io
import re
import unicodedata
import zipfile
from collections.abc import Mapping
from pathlib import PurePosixPath

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
