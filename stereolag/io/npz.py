"""Arrays saved together by NumPy (``.npz``), from untrusted bytes: no pickles, and no more memory than is allowed."""

from __future__ import annotations

import io
import zipfile
import zlib
from typing import Any

import numpy as np
import numpy.typing as npt

from stereolag.io.npy import MAGIC, parse_npy

ZIP_MAGIC = b"PK\x03\x04"
MAX_MEMBERS = 1000
MAX_MEMBER_BYTES = 2**16
"""Limit for one array, unpacked: more than any matrix of a camera, and less than a map of pixels."""
MAX_TOTAL_BYTES = 2**22

# The other methods do not bound the output of a single read, and NumPy writes none of them.
_PACKED_AS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)


def parse_npz(data: bytes, what: str) -> dict[str, npt.NDArray[Any] | None]:
    """Return the arrays of numbers by name, with None for members above 64 kB or without numbers.

    Raises
    ------
    ValueError
        A broken archive, more than 1000 arrays, or more than 4 MB of small ones, unpacked.
    """
    arrays: dict[str, npt.NDArray[Any] | None] = {}
    unpacked = 0
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = archive.infolist()
            if len(members) > MAX_MEMBERS:
                raise ValueError(f"The {what} (.npz) holds {len(members):,} arrays; at most {MAX_MEMBERS:,} are read.")
            for member in members:
                content = _unpacked(archive, member)
                unpacked += len(content)
                if unpacked > MAX_TOTAL_BYTES:
                    raise ValueError(f"The {what} (.npz) unpacks to more than {MAX_TOTAL_BYTES // 2**20} MB.")
                arrays[member.filename.removesuffix(".npy")] = _array(content, what)
    except (zipfile.BadZipFile, zlib.error, EOFError, OSError, RuntimeError, OverflowError) as error:
        raise ValueError(f"The {what} (.npz) is damaged, cut short or locked; save it again.") from error
    return arrays


def _unpacked(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> bytes:
    """Return the bytes of a member, empty if it is too large; the size stated in its header may be a lie."""
    if member.compress_type not in _PACKED_AS or member.file_size > MAX_MEMBER_BYTES:
        return b""
    with archive.open(member) as file:
        content = file.read(MAX_MEMBER_BYTES + 1)
    return b"" if len(content) > MAX_MEMBER_BYTES else content


def _array(content: bytes, what: str) -> npt.NDArray[Any] | None:
    if not content.startswith(MAGIC):
        return None
    try:
        return np.asarray(parse_npy(content, what))
    except ValueError:
        return None
