"""The compilation of this project's loops, and the folder of their machine code; the one door to Numba.

Machine code is kept beside this file, or in the folder that ``NUMBA_CACHE_DIR`` names; a read-only install keeps it in
the user's cache folder. If none of these can be written to, every process compiles again.

The folder is named after the sources of the machine code. Numba checks only the file of the outermost function, and
would keep using outdated code of the functions that this one calls. Besides, nothing has to be deleted that another
process, perhaps of another release, has just written or is about to load.
"""

from __future__ import annotations

import hashlib
import logging
import os
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Set
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, TypeVar, overload

import numba
from numba import types as numba_types
from numba.extending import overload as compiled_as

from stereolag.loops.numba_inside import FunctionCache, rtsys

__all__ = ["FOLDER", "compiled", "compiled_as", "numba_types"]

Function = TypeVar("Function", bound=Callable[..., Any])

HERE = Path(__file__).absolute()
SOURCES = HERE.parents[1]
"""The package, whose subpackages contain the loops."""

MAKES_CODE = re.compile(rb"\n(?:from|import) .*\b(?:numba|llvmlite|compilation|NamedTuple)\b")
"""Imports of every file with a loop, with an instruction for loops, or with a tuple that loops take. (With "^" in place
of the line's end before it, it takes six times as long.)"""

WITHOUT_LOOPS = {"ui", "commands", "figures"}
"""Packages above all loops, whose changes leave machine code as it is."""

UNUSED_S = 7 * 24 * 3600
"""Time for which machine code of other sources is kept after a process last started with it."""

CONFIG: Any = numba.config


class OwnCode:
    """The place of a loop's machine code, as Numba asks a locator class for it (``NUMBA_CACHE_LOCATOR_CLASSES``)."""

    def __init__(self, function: Callable[..., Any], file: str) -> None:
        self._line = function.__code__.co_firstlineno
        self._room = Path(file).absolute().relative_to(SOURCES).parent

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> OwnCode:
        """Return the locator of a loop."""
        return cls(py_func, py_file)

    def get_cache_path(self) -> str:
        """Return the folder: one per subpackage, since two of them may have files of the same name."""
        assert FOLDER is not None
        return str(FOLDER / self._room)

    def ensure_cache_path(self) -> None:
        """Make the folder; Numba calls this before it writes."""
        Path(self.get_cache_path()).mkdir(parents=True, exist_ok=True)

    def get_source_stamp(self) -> str:
        """Return the stamp that must match for machine code to be used: the folder's name, a hash of the sources."""
        assert FOLDER is not None
        return FOLDER.name

    def get_disambiguator(self) -> str:
        """Return the line of a function, which distinguishes it from others of the same name in its file."""
        return str(self._line)


class OwnCache(FunctionCache):
    """The machine code of a loop on disk, loaded without what only a compilation needs.

    Numba makes all that it can compile known first, a third of a command's time; a compilation does so by itself.
    """

    def load_overload(self: Any, sig: Any, target_context: Any) -> Any:
        """Return the machine code for a signature; None if it is not kept."""
        rtsys.initialize(target_context)  # the functions that machine code calls
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)


@overload
def compiled(function: Function, /) -> Function: ...


@overload
def compiled(*, fastmath: Set[str]) -> Callable[[Function], Function]: ...


def compiled(function: Any = None, /, *, fastmath: Set[str] = frozenset()) -> Any:
    """Compile a function on first use, keep the machine code on disk, and release the interpreter lock while it runs.

    Use it as ``@compiled``, or as ``@compiled(fastmath={"reassoc", "contract"})`` where sums may be taken in any order.
    Never ``parallel=True``: its default threading layer aborts the process when two sessions enter it at once; the
    threads are ours (:mod:`stereolag.loops.bands`). Never all of ``fastmath``: NaN has a meaning here.

    Parameters
    ----------
    function
        The function to compile; a division by zero gives infinity or NaN, as in NumPy.
    fastmath
        LLVM's names of the permitted floating-point relaxations.
    """
    if function is None:
        return partial(compiled, fastmath=fastmath)
    loop: Any = numba.njit(nogil=True, error_model="numpy", fastmath=set(fastmath))(function)
    if FOLDER is not None and Path(function.__code__.co_filename).absolute().is_relative_to(SOURCES):
        # Numba chooses the locator now, and for functions that are not ours its own.
        others, CONFIG.CACHE_LOCATOR_CLASSES = CONFIG.CACHE_LOCATOR_CLASSES, f"{__name__}.{OwnCode.__name__}"
        try:
            loop._cache = OwnCache(function)  # type: ignore[no-untyped-call]
        finally:
            CONFIG.CACHE_LOCATOR_CLASSES = others
    return loop


def folder_name() -> str:
    """Return a folder name for this Python, this Numba and the current sources of the loops.

    Contents are compared, not times: an archive or a wrong clock can give a file any date.
    """
    digest = hashlib.sha256(f"{sys.implementation.cache_tag} {numba.__version__}".encode())
    for source in sorted(SOURCES.rglob("*.py")):
        if source.relative_to(SOURCES).parts[0] in WITHOUT_LOOPS:
            continue
        with suppress(OSError):  # an editor's lock, or a file that an upgrade is just removing
            text = source.read_bytes()
            if MAKES_CODE.search(b"\n" + text):
                digest.update(f"\0{source.relative_to(SOURCES).as_posix()}\0".encode() + text)
    return f"stereolag-{digest.hexdigest()[:16]}"


def _prepared(folder: Path) -> Path:
    """Return a folder in which machine code can be kept, and delete folders beside it that are long unused.

    A process that still runs with a deleted folder compiles again on demand. Raises OSError if the folder cannot be
    made or written to.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=folder):
        pass
    with suppress(OSError):  # another user's folder keeps its time
        os.utime(folder)
    for other in folder.parent.glob("stereolag-" + 16 * "[0-9a-f]"):
        with suppress(OSError):  # another process may be doing the same
            if time.time() - other.stat().st_mtime > UNUSED_S:
                shutil.rmtree(other, ignore_errors=True)
    return folder


def _find_folder() -> Path | None:
    """Choose the folder before anything is compiled, and log it if it is not the usual one; None if there is none."""
    usual = Path(CONFIG.CACHE_DIR).absolute() if CONFIG.CACHE_DIR else HERE.with_name("__pycache__")
    name, log = folder_name(), logging.getLogger("stereolag")
    try:
        return _prepared(usual / name)
    except OSError as error:
        reason = f"{usual} cannot be used ({error.strerror or error})"
    advice = "To choose the place, set NUMBA_CACHE_DIR to a folder that only this user can write to."
    with suppress(RuntimeError, OSError):  # a user without a home
        own = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "stereolag")
        own.mkdir(mode=0o700, parents=True, exist_ok=True)  # whoever writes code there can make us run it
        folder = _prepared(own / name)
        log.warning("Machine code is kept in %s: %s. %s", own, reason, advice)
        return folder
    log.warning("Machine code is not kept, and compiled anew at every start: %s. %s", reason, advice)
    return None


FOLDER: Path | None = _find_folder()
"""Folder of the machine code on disk; None if it is not kept."""
