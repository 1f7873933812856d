"""Reused memory, since getting new pages can take longer than filling them; copying and filling in loops."""

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
from stereolag.core.jobs import MAX_HEAP_BLOCK
from stereolag.loops.compilation import compiled

CACHE_LINE = 64
"""Bytes of a cache line. In a volume that starts at one, no sixteen lags straddle two lines."""

MAX_KEPT_BYTES = 64 * 2**20
"""Bytes; larger volumes are returned to the system."""

_free: deque[Array] = deque(maxlen=2)


class _Loan:
    """Memory in use, owned by an array, so that the loan ends with the last view of it."""

    def __init__(self, memory: Array) -> None:
        self.memory = memory
        self.__array_interface__ = memory.__array_interface__
        if memory.size <= MAX_KEPT_BYTES:
            weakref.finalize(self, _free.append, memory).atexit = False


def _bytes_for(size: int) -> Array:
    """Return at least `size` bytes: kept memory that is at most twice as large, or else new memory."""
    for _ in range(len(_free)):
        with suppress(IndexError):  # another thread took it
            memory = _free.popleft()
            if size <= memory.size <= 2 * size:
                return memory
            _free.append(memory)
    return np.empty(size, np.uint8)


def zeros(shape: tuple[int, ...], dtype: npt.DTypeLike) -> Array:
    """Return an array like ``numpy.zeros`` that starts at a cache line."""
    return _aligned(np.zeros(_padded_size(shape, dtype), np.uint8), shape, dtype)


def volume(shape: tuple[int, ...], dtype: npt.DTypeLike) -> Array:
    """Return an array like ``numpy.empty``, in the memory of an earlier one that is no longer in use, if it fits."""
    return _aligned(np.asarray(_Loan(_bytes_for(_padded_size(shape, dtype)))), shape, dtype)


def _padded_size(shape: tuple[int, ...], dtype: npt.DTypeLike) -> int:
    return math.prod(shape) * np.dtype(dtype).itemsize + CACHE_LINE


def _aligned(memory: Array, shape: tuple[int, ...], dtype: npt.DTypeLike) -> Array:
    start = -memory.ctypes.data % CACHE_LINE
    return memory[start : start + _padded_size(shape, dtype) - CACHE_LINE].view(dtype).reshape(shape)


def release_memory() -> None:
    """Release the memory kept for volumes."""
    _free.clear()


M_MMAP_THRESHOLD, M_TRIM_THRESHOLD = -3, -1
"""The numbers of options in glibc's ``malloc.h``."""

MAX_FREED_BYTES = 2**28
"""Bytes of freed memory that the allocator may keep."""


@cache
def keep_freed_memory() -> None:
    """Let glibc's allocator keep freed memory for the next job; other allocators ignore it.

    By default it returns large blocks, and everything above 64 MB, to the system. Getting them again, page by page,
    took a quarter of the time of a flow between frames of 0.35 to 0.9 megapixels.
    """
    ask_allocator("mallopt", M_MMAP_THRESHOLD, MAX_HEAP_BLOCK)
    ask_allocator("mallopt", M_TRIM_THRESHOLD, MAX_FREED_BYTES)


def ask_allocator(call: str, *arguments: int) -> None:
    """Call a function of glibc's allocator; other allocators have none of this name and stay as they are."""
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
