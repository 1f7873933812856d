"""Memory that is used again, since to get fresh pages can take longer than to fill them; copies and fills in loops."""

from __future__ import annotations

import ctypes
import math
import sys
import weakref
from collections import deque
from contextlib import suppress
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Array
from stereolag.core.jobs import HEAP_BLOCK
from stereolag.loops.compilation import compiled

LINE = 64
"""Bytes of a cache line; no sixteen lags of a volume that starts at one straddle two."""

MOST_KEPT = 64 * 2**20
"""Larger volumes are given back to the system."""

_free: deque[Array] = deque(maxlen=2)


class _Loan:
    """Memory in use: what an array is made of, so that it ends with the last view of it."""

    def __init__(self, memory: Array) -> None:
        self.memory = memory
        self.__array_interface__ = memory.__array_interface__
        if memory.size <= MOST_KEPT:
            weakref.finalize(self, _free.append, memory).atexit = False


def _taken(size: int) -> Array:
    """Return at least `size` bytes: of the memory kept, what is not more than twice as large, or fresh ones."""
    for _ in range(len(_free)):
        with suppress(IndexError):  # another thread took it
            memory = _free.popleft()
            if size <= memory.size <= 2 * size:
                return memory
            _free.append(memory)
    return np.empty(size, np.uint8)


def zeros(shape: tuple[int, ...], dtype: npt.DTypeLike) -> Array:
    """Return an array like ``numpy.zeros`` that starts at a cache line."""
    return _at_line(np.zeros(_room(shape, dtype), np.uint8), shape, dtype)


def volume(shape: tuple[int, ...], dtype: npt.DTypeLike) -> Array:
    """Return an array like ``numpy.empty``, in the memory of an earlier one that is no longer used, if it fits."""
    return _at_line(np.asarray(_Loan(_taken(_room(shape, dtype)))), shape, dtype)


def _room(shape: tuple[int, ...], dtype: npt.DTypeLike) -> int:
    return math.prod(shape) * np.dtype(dtype).itemsize + LINE


def _at_line(memory: Array, shape: tuple[int, ...], dtype: npt.DTypeLike) -> Array:
    start = -memory.ctypes.data % LINE
    return memory[start : start + _room(shape, dtype) - LINE].view(dtype).reshape(shape)


def give_back() -> None:
    """Let go of the memory kept for volumes, when none is likely to be needed soon."""
    _free.clear()


M_MMAP_THRESHOLD, M_TRIM_THRESHOLD = -3, -1
"""The numbers of options in glibc's ``malloc.h``."""

MOST_FREED = 2**28
"""Freed memory that the allocator keeps, bytes."""


@cache
def keep_freed_memory() -> None:
    """Let the system's allocator keep freed memory for the next job: other allocators than glibc's ignore it.

    By default that gives large blocks back, and all beyond 64 MB; to get them again, page by page, took a quarter of
    the time of a flow between frames of 0.35 to 0.9 megapixels.
    """
    ask_allocator("mallopt", M_MMAP_THRESHOLD, HEAP_BLOCK)
    ask_allocator("mallopt", M_TRIM_THRESHOLD, MOST_FREED)


def ask_allocator(call: str, *arguments: int) -> None:
    """Call a function of glibc's allocator; another allocator has none of this name and is left as it is."""
    if sys.platform == "linux":
        with suppress(AttributeError):
            getattr(ctypes.CDLL(None), call)(*arguments)


@compiled(counted=False)
def copy(values: Array, to: Array) -> None:
    """Set ``to[:] = values[: to.size]``; Numba takes seconds to compile an assignment to a slice."""
    for at in range(to.size):
        to[at] = values[at]


@compiled(counted=False)
def fill(to: Array, value: Any) -> None:
    """Set ``to[:] = value`` of one dimension, as :func:`copy` does."""
    for at in range(to.size):
        to[at] = value
