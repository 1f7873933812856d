"""The compilation of this project's loops, and the folder of their machine code.

It is kept beside this file, or in the folder that ``NUMBA_CACHE_DIR`` names. A read-only install keeps it in the
user's cache folder or in the temporary one, if nobody else can write there: whoever can write the machine code that we
load can make us run anything. If none of these can be used, every process compiles again.

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
import stat
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Set
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, TypeVar, cast, overload

import numba
from numba.core.caching import CompileResultCacheImpl, _CacheLocator
from numba.misc.appdirs import user_cache_dir

Function = TypeVar("Function", bound=Callable[..., Any])

HERE = Path(__file__).absolute()
SOURCES = HERE.parents[1]
"""The package, whose subpackages contain the loops."""

MAKES_CODE = re.compile(rb"^(?:from|import) .*\b(?:numba|llvmlite|compilation|NamedTuple)\b", re.MULTILINE)
"""Imports of every file with a loop, with an instruction for loops, or with a tuple that loops take."""

UNUSED_S = 7 * 24 * 3600
"""Time for which machine code of other sources is kept after a process last started with it or added to it."""

CONFIG: Any = numba.config
OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


class OwnCode(_CacheLocator):
    """The folder of the machine code of our own loops only, declared in the way that Numba offers for some files."""

    def __init__(self, function: Callable[..., Any], file: Path) -> None:
        self._line = function.__code__.co_firstlineno
        self._room = file.relative_to(SOURCES).parent

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> OwnCode | None:
        """Return the locator of a loop; None if the loop is not ours."""
        file = Path(py_file).absolute()
        return cls(py_func, file) if FOLDER is not None and file.is_relative_to(SOURCES) else None

    def get_cache_path(self) -> str:
        """Return the folder: one per subpackage, since two of them may have files of the same name."""
        return str(cast(Path, FOLDER) / self._room)

    def ensure_cache_path(self) -> None:
        """Make the folder; Numba calls this before it writes."""
        Path(self.get_cache_path()).mkdir(parents=True, exist_ok=True)
        _touch(cast(Path, FOLDER))

    def get_source_stamp(self) -> str:
        """Return the stamp that must match for machine code to be used: the folder's name, a hash of the sources."""
        return cast(Path, FOLDER).name

    def get_disambiguator(self) -> str:
        """Return the line of a function, which distinguishes it from others of the same name in its file."""
        return str(self._line)


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
    return numba.njit(nogil=True, cache=KEPT, error_model="numpy", fastmath=set(fastmath))(function)


def folder_name() -> str:
    """Return a folder name for this Python, this Numba and the current sources of the loops.

    Contents are compared, not times: an archive or a wrong clock can give a file any date.
    """
    digest = hashlib.sha256(f"{sys.implementation.cache_tag} {numba.__version__}".encode())
    for folder, folders, files in os.walk(SOURCES):
        folders[:] = sorted(set(folders) - {"__pycache__"})
        for source in (Path(folder, file) for file in sorted(files) if file.endswith(".py")):
            with suppress(OSError):  # an editor's lock, or a file that an upgrade is just removing
                text = source.read_bytes()
                if MAKES_CODE.search(text):
                    digest.update(f"\0{source.relative_to(SOURCES).as_posix()}\0".encode() + text)
    return f"stereolag-{digest.hexdigest()[:16]}"


def prepare(folder: Path) -> None:
    """Make sure that machine code can be kept in a folder, and delete folders beside it that are long unused.

    A process that still runs with a deleted folder compiles again on demand.

    Parameters
    ----------
    folder
        Named by `folder_name`.

    Raises
    ------
    OSError
        The folder cannot be made or written to.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=folder):
        pass
    _touch(folder)
    for other in folder.parent.glob("stereolag-" + 16 * "[0-9a-f]"):
        with suppress(OSError):  # another process may be doing the same
            if time.time() - other.stat().st_mtime > UNUSED_S:
                shutil.rmtree(other, ignore_errors=True)


def _touch(folder: Path) -> None:
    """Mark a folder as in use."""
    with suppress(OSError):  # another user's folder keeps its time
        os.utime(folder)


def is_private(folder: Path) -> bool:
    """Return whether only this user and root can put a file into a folder, or another folder in its place."""
    if not hasattr(os, "geteuid"):
        return True  # Windows: folders below the user's profile are the user's
    own = folder.lstat()
    if not stat.S_ISDIR(own.st_mode) or own.st_uid != os.geteuid() or own.st_mode & OTHERS_WRITE:
        return False
    above = [parent.lstat() for parent in (*folder.absolute().parents, *folder.resolve().parents)]
    return all(
        status.st_uid in (0, os.geteuid())
        # In a sticky folder such as /tmp, nobody can move the files of others; the mode of a link means nothing.
        and (not status.st_mode & OTHERS_WRITE or bool(status.st_mode & stat.S_ISVTX) or stat.S_ISLNK(status.st_mode))
        for status in above
    )


def _usual_root() -> Path:
    """Return the folder that the operator named, or the one in which Python keeps the bytecode of this file."""
    return Path(CONFIG.CACHE_DIR).absolute() if CONFIG.CACHE_DIR else HERE.with_name("__pycache__")


def _other_roots() -> Iterator[Path]:
    """Yield the fallback folders, best first."""
    with suppress(RuntimeError, OSError):  # a user without a home
        yield Path(cast(Any, user_cache_dir)("stereolag", appauthor=False)).expanduser()
    with suppress(FileNotFoundError):  # a machine without a temporary folder
        user = os.geteuid() if hasattr(os, "geteuid") else "user"
        yield Path(tempfile.gettempdir(), f"stereolag-{user}")


def _find_folder() -> Path | None:
    """Choose the folder of the machine code before anything is compiled, and log it if it is not the usual one.

    Returns
    -------
    Path | None
        None if machine code is not kept.
    """
    usual = _usual_root()
    name = folder_name()
    try:
        prepare(usual / name)
    except OSError as error:
        reason = f"{usual} cannot be used ({error.strerror or error})"
    else:
        return usual / name
    log = logging.getLogger("stereolag")
    advice = "To choose the place, set NUMBA_CACHE_DIR to a folder that only this user can write to."
    for root in _other_roots():
        with suppress(OSError):
            root.mkdir(mode=0o700, parents=True, exist_ok=True)
            if is_private(root):
                prepare(root / name)
                log.warning("Machine code is kept in %s: %s. %s", root, reason, advice)
                return root / name
    log.warning("Machine code is not kept, and compiled anew at every start: %s. %s", reason, advice)
    return None


FOLDER: Path | None = _find_folder()
"""Folder of the machine code on disk; None if it is not kept."""

KEPT = FOLDER is not None
"""Whether machine code is kept at all, which Numba calls ``cache``."""

CompileResultCacheImpl._locator_classes = [OwnCode, *CompileResultCacheImpl._locator_classes]
