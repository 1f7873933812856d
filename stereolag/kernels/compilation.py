"""How this project compiles a loop: one decorator, so that every loop keeps the same rules."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Compile a function on first use, keep the machine code on disk, and release the interpreter lock while it runs.

    Never ``parallel=True``: its default threading layer aborts the process when two sessions enter it at once; the
    threads are ours (:mod:`stereolag.kernels.bands`). Never ``fastmath``: NaN is an answer here.
    """
    return cast(Function, numba.njit(nogil=True, cache=True, error_model="numpy")(function))


def forget_older_code() -> None:
    """Delete machine code that is older than any of the sources beside it.

    Numba compares it with the file of the outermost function alone, and would go on using what that calls.
    """
    folder = Path(__file__).parent
    newest = max(source.stat().st_mtime for source in folder.glob("*.py"))
    for code in (folder / "__pycache__").glob("*.nb[ic]"):
        with suppress(FileNotFoundError):  # another process may be at the same work
            if code.stat().st_mtime < newest:
                code.unlink()


forget_older_code()
