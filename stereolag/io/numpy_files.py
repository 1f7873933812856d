"""Arrays as NumPy saves them (``.npy``, ``.npz``), read from untrusted bytes and written: numbers, no pickles."""

from __future__ import annotations

import io
import math
import zipfile
from typing import Any

import numpy as np
import numpy.typing as npt

MAGIC = b"\x93NUMPY"
ZIP_MAGIC = b"PK\x03\x04"
MAX_DIMENSIONS = 32
MAX_MEMBERS = 1000
MAX_MEMBER_BYTES = 2**16
"""Limit for one array of several, unpacked: more than any matrix of a camera, and less than a map of pixels."""

_HEADERS = {1: np.lib.format.read_array_header_1_0, 2: np.lib.format.read_array_header_2_0}


def parse_npy(data: bytes, what: str) -> npt.NDArray[Any]:
    """Return the array of numbers in the bytes of an ``.npy`` file (a read-only view of them).

    Raises
    ------
    ValueError
        A broken header, objects or text in place of real numbers, or fewer bytes than the header claims.
    """
    stream = io.BytesIO(data)
    try:
        version = np.lib.format.read_magic(stream)
        shape, is_fortran, dtype = _HEADERS[min(version[0], 2)](stream)
        if len(shape) > MAX_DIMENSIONS or any(side < 0 or isinstance(side, bool) for side in shape):
            raise ValueError(f"shape {shape}")
    except Exception as error:  # the header is Python, and can be broken in all kinds of ways
        raise ValueError(f"The {what} has the mark of an .npy file, but its header cannot be read.") from error
    if dtype.kind not in "biuf" or dtype.itemsize > 8:
        held = "records of several fields" if dtype.names else dtype.name
        raise ValueError(f"The {what} (.npy) holds {held}; allowed are integers and floats.")
    offset, count = stream.tell(), math.prod(shape)
    if count * dtype.itemsize > len(data) - offset:
        announced = f"{min(count, 10**30):.15g} numbers of {dtype.name}"
        raise ValueError(f"The {what} (.npy) is cut short: its header announces {announced}.")
    array = np.frombuffer(data, dtype, count, offset) if count else np.zeros(0, dtype)
    return array.reshape(shape, order="F" if is_fortran else "C")


def parse_npz(data: bytes, what: str) -> dict[str, npt.NDArray[Any] | None]:
    """Return the arrays of numbers by name, with None for members above 64 kB or without numbers.

    Raises
    ------
    ValueError
        A broken archive, or more than 1000 arrays.
    """
    arrays: dict[str, npt.NDArray[Any] | None] = {}
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = archive.infolist()
            if len(members) > MAX_MEMBERS:
                raise ValueError(f"The {what} (.npz) holds {len(members):,} arrays; at most {MAX_MEMBERS:,} are read.")
            for member in members:
                content = archive.read(member) if member.file_size <= MAX_MEMBER_BYTES else b""
                arrays[member.filename.removesuffix(".npy")] = _numbers(content, what)
    except (ValueError, MemoryError):
        raise
    except Exception as error:  # zipfile and its decoders raise all kinds of errors on broken files
        raise ValueError(f"The {what} (.npz) is damaged, cut short or locked; save it again.") from error
    return arrays


def _numbers(content: bytes, what: str) -> npt.NDArray[Any] | None:
    try:
        return parse_npy(content, what) if content.startswith(MAGIC) else None
    except ValueError:
        return None


def npy(array: npt.ArrayLike) -> bytes:
    """Return an array of numbers as the bytes of an ``.npy`` file, bit for bit."""
    stream = io.BytesIO()
    np.save(stream, np.asarray(array), allow_pickle=False)
    return stream.getvalue()
