"""How this project compiles a loop, and where the machine code is kept.

It is kept beside this file, or where ``NUMBA_CACHE_DIR`` says. An install that cannot be written to keeps it in the
user's cache folder or in the temporary one, if nobody else can write there: whoever can write machine code that we
load can make us do anything. Where nothing of this can be had, every process compiles anew.

There it lies in a folder named by the sources it was made from. Numba compares it with the file of the outermost
function alone, and would go on using what that calls; and nothing has to be deleted that another process, perhaps of
another release, has just written or is about to load.
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
"""The package, somewhere in which the loops lie."""

MAKES_CODE = re.compile(rb"^(?:from|import) .*\b(?:numba|llvmlite|compilation|NamedTuple)\b", re.MULTILINE)
"""What a file with a loop, with an instruction for loops, or with a tuple that loops take, imports."""

UNUSED_S = 7 * 24 * 3600
"""How long machine code of other sources is kept after a process last started with it or added to it."""

CONFIG: Any = numba.config
OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


class OwnCode(_CacheLocator):
    """Where Numba keeps the machine code of our loops, and of no others: its way to say so for some files alone."""

    def __init__(self, function: Callable[..., Any], file: Path) -> None:
        self._line = function.__code__.co_firstlineno
        self._room = file.relative_to(SOURCES).parent

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> OwnCode | None:
        """Return the place of a loop; None where it is not ours."""
        file = Path(py_file).absolute()
        return cls(py_func, file) if FOLDER is not None and file.is_relative_to(SOURCES) else None

    def get_cache_path(self) -> str:
        """Return the folder: one a room, since two of them may hold files of the same name."""
        return str(cast(Path, FOLDER) / self._room)

    def ensure_cache_path(self) -> None:
        """Make the folder, which Numba asks for before it writes."""
        Path(self.get_cache_path()).mkdir(parents=True, exist_ok=True)
        _touch(cast(Path, FOLDER))

    def get_source_stamp(self) -> str:
        """Return what must be the same for machine code to be used: the sources, by which the folder is named."""
        return cast(Path, FOLDER).name

    def get_disambiguator(self) -> str:
        """Return what tells apart two functions of one name in one file."""
        return str(self._line)


@overload
def compiled(function: Function, /) -> Function: ...


@overload
def compiled(*, fastmath: Set[str]) -> Callable[[Function], Function]: ...


def compiled(function: Any = None, /, *, fastmath: Set[str] = frozenset()) -> Any:
    """Compile a function on first use, keep the machine code on disk, and release the interpreter lock while it runs.

    Use it as ``@compiled``, or as ``@compiled(fastmath={"reassoc", "contract"})`` where sums may be taken in any order.
    Never ``parallel=True``: its default threading layer aborts the process when two sessions enter it at once; the
    threads are ours (:mod:`stereolag.loops.bands`). Never the whole of ``fastmath``: NaN means something here.

    Parameters
    ----------
    function
        What is compiled; a division by zero gives infinity or NaN, as in NumPy.
    fastmath
        LLVM's names of the liberties that floating-point arithmetic may take.
    """
    if function is None:
        return partial(compiled, fastmath=fastmath)
    return numba.njit(nogil=True, cache=KEPT, error_model="numpy", fastmath=set(fastmath))(function)


def folder_name() -> str:
    """Return a name for what this Python and this Numba make of the loops of today.

    Contents are compared, not times: an archive or a clock can date a file at will.
    """
    digest = hashlib.sha256(f"{sys.implementation.cache_tag} {numba.__version__}".encode())
    for folder, folders, files in os.walk(SOURCES):
        folders[:] = sorted(set(folders) - {"__pycache__"})
        for source in (Path(folder, file) for file in sorted(files) if file.endswith(".py")):
            with suppress(OSError):  # an editor's lock, or a file that an upgrade takes away just now
                text = source.read_bytes()
                if MAKES_CODE.search(text):
                    digest.update(f"\0{source.relative_to(SOURCES).as_posix()}\0".encode() + text)
    return f"stereolag-{digest.hexdigest()[:16]}"


def prepare(folder: Path) -> None:
    """Make sure that machine code can be kept in a folder, and forget what has long been of no use beside it.

    Who still runs with what is forgotten here compiles it again when asked for it.

    Parameters
    ----------
    folder
        Named by `folder_name`.

    Raises
    ------
    OSError
        It cannot be made or written to.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=folder):
        pass
    _touch(folder)
    for other in folder.parent.glob("stereolag-" + 16 * "[0-9a-f]"):
        with suppress(OSError):  # another process may be at the same work
            if time.time() - other.stat().st_mtime > UNUSED_S:
                shutil.rmtree(other, ignore_errors=True)


def _touch(folder: Path) -> None:
    """Note that a folder is in use."""
    with suppress(OSError):  # another user's folder keeps its time
        os.utime(folder)


def is_private(folder: Path) -> bool:
    """Return whether nobody but this user and root can put a file into a folder, or another folder in its place."""
    if not hasattr(os, "geteuid"):
        return True  # Windows: folders below the user's profile are the user's
    own = folder.lstat()
    if not stat.S_ISDIR(own.st_mode) or own.st_uid != os.geteuid() or own.st_mode & OTHERS_WRITE:
        return False
    above = [parent.lstat() for parent in (*folder.absolute().parents, *folder.resolve().parents)]
    return all(
        status.st_uid in (0, os.geteuid())
        # In a sticky folder, as /tmp is, nobody moves what is another's; the mode of a link means nothing.
        and (not status.st_mode & OTHERS_WRITE or bool(status.st_mode & stat.S_ISVTX) or stat.S_ISLNK(status.st_mode))
        for status in above
    )


def _usual_root() -> Path:
    """Return what the operator named, or the folder in which Python keeps its own code of this file."""
    return Path(CONFIG.CACHE_DIR).absolute() if CONFIG.CACHE_DIR else HERE.with_name("__pycache__")


def _other_roots() -> Iterator[Path]:
    """Give the folders that stand in, best first."""
    with suppress(RuntimeError, OSError):  # a user without a home
        yield Path(cast(Any, user_cache_dir)("stereolag", appauthor=False)).expanduser()
    with suppress(FileNotFoundError):  # a machine without a temporary folder
        user = os.geteuid() if hasattr(os, "geteuid") else "user"
        yield Path(tempfile.gettempdir(), f"stereolag-{user}")


def _find_folder() -> Path | None:
    """Settle where machine code is kept, before anything is compiled, and say so where it is not the usual place.

    Returns
    -------
    Path | None
        None: it is not kept.
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
"""Where machine code is kept on disk."""

KEPT = FOLDER is not None
"""Whether it is kept at all: what the loops give to Numba as ``cache``."""

CompileResultCacheImpl._locator_classes = [OwnCode, *CompileResultCacheImpl._locator_classes]
