"""Arrays of numbers in files of NumPy, MATLAB and Octave (NPY, NPZ, MAT), read from untrusted bytes; no pickles."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy  # loads scipy.io on first use only

from stereolag.io.sources import Archive, quote

NPY_MAGIC = b"\x93NUMPY"
MAX_DIMENSIONS = 32

_HEADER_READERS = {1: np.lib.format.read_array_header_1_0, 2: np.lib.format.read_array_header_2_0}

MAT_MAGIC = re.compile(
    rb"MATLAB 5\.0 MAT-file"
    # Version 4 has no magic bytes: type, rows, columns, whether complex, length of the name, name.
    rb"|[\0-\x34]\0\0\0.{8}[\0\1]\0\0\0[\x02-\x40]\0\0\0[A-Za-z]\w*\0"
    rb"|\0\0(?:\x03[\xe8-\xff]|\x04[\0-\x1c]).{8}\0\0\0[\0\1]\0\0\0[\x02-\x40][A-Za-z]\w*\0",
    re.DOTALL,
)
_MAT_KINDS = frozenset(
    ["double", "single", "logical", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))]
)


def parse_npy(data: bytes, what: str, kinds: str = "biuf") -> npt.NDArray[Any]:
    """Return the array of numbers in the bytes of an ``.npy`` file, a read-only view of them.

    `kinds` are the allowed kinds of NumPy types; ``"M"`` among them allows dates.

    Raises
    ------
    ValueError
        A broken header, objects or text in place of real numbers, or fewer bytes than the header claims.
    """
    stream = io.BytesIO(data)
    try:
        version = np.lib.format.read_magic(stream)
        shape, is_fortran, dtype = _HEADER_READERS[min(version[0], 2)](stream)
        if len(shape) > MAX_DIMENSIONS or any(side < 0 or isinstance(side, bool) for side in shape):
            raise ValueError(f"shape {shape}")
    except Exception as error:  # the header is a Python literal, and can be broken in all kinds of ways
        raise ValueError(f"The {what} begins like an .npy file, but its header cannot be read.") from error
    if dtype.kind not in kinds or dtype.itemsize > 8:
        raise ValueError(
            f"The {what} (.npy) holds {'records of several fields' if dtype.names else dtype.name}; allowed are "
            "integers and floats."
        )
    offset, count = stream.tell(), math.prod(shape)
    if count * dtype.itemsize > len(data) - offset:
        raise ValueError(
            f"The {what} (.npy) is cut short: its header announces {min(count, 10**30):.15g} numbers of {dtype.name}."
        )
    array = np.frombuffer(data, dtype, count, offset) if count else np.zeros(0, dtype)
    return array.reshape(shape, order="F" if is_fortran else "C")


def npy(array: npt.ArrayLike) -> bytes:
    """Return an array of numbers as the bytes of an ``.npy`` file, bit for bit."""
    stream = io.BytesIO()
    np.save(stream, np.asarray(array), allow_pickle=False)
    return stream.getvalue()


def npz_arrays(archive: Archive, what: str, kinds: str = "biuf") -> dict[str, npt.NDArray[Any]]:
    """Return the arrays of numbers in an NPZ archive by name; {} if it holds no array at all.

    Raises
    ------
    ValueError
        Only texts, objects or damaged arrays.
    """
    arrays, fault = {}, None
    for name in archive.names:
        if name.endswith(".npy"):
            try:
                arrays[name.removesuffix(".npy")] = parse_npy(archive.read(name), what, kinds)
            except ValueError as error:  # numbers may be saved together with texts and objects
                fault = error
    if fault is not None and not arrays:
        raise fault
    return arrays


def mat_arrays(data: bytes, what: str, check: Callable[[tuple[int, ...]], None]) -> dict[str, npt.NDArray[Any]]:
    """Return the matrices of numbers in a MAT file of MATLAB or Octave by name.

    `check` raises for a shape that is too large, before any matrix is read.

    Raises
    ------
    ValueError
        A damaged file, or one without matrices of numbers.
    """
    stream: Any = io.BytesIO(data)
    with reported_as_damage(what):
        contents = scipy.io.whosmat(stream)
    shapes = {name: shape for name, shape, kind in contents if kind in _MAT_KINDS and len(shape) == 2}
    for shape in shapes.values():
        check(shape)
    stream.seek(0)
    with reported_as_damage(what):
        loaded = scipy.io.loadmat(stream, variable_names=[*shapes]) if shapes else {}
        arrays = {name: np.asarray(loaded[name]) for name in shapes}
    if not arrays:
        others = ", ".join(f"{quote(name)} ({kind})" for name, _, kind in contents[:9])
        raise ValueError(f"The {what} is a MAT file without arrays of numbers; it holds {others or 'nothing'}.")
    return arrays


@contextmanager
def reported_as_damage(what: str) -> Iterator[None]:
    """Report any error as a damaged MAT file: scipy raises all kinds of errors on broken files."""
    try:
        yield
    except MemoryError:
        raise
    except Exception as error:
        raise ValueError(f"The {what} is a MAT file that is damaged or cut short; save it again.") from error
