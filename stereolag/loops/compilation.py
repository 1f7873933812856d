"""How this project compiles a loop, and where the machine code is kept.

It is kept beside the sources, or where ``NUMBA_CACHE_DIR`` says. An install that cannot be written to keeps it in the
user's cache folder or in the temporary one, if nobody else can write there: whoever can write machine code that we
load can make us do anything. Where nothing of this can be had, every process compiles anew.
"""

from __future__ import annotations

import hashlib
import logging
import os
import stat
import tempfile
from collections.abc import Callable, Iterator, Set
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, TypeVar, cast, overload

import numba
from numba.core.caching import InTreeCacheLocator, UserProvidedCacheLocator
from numba.misc.appdirs import user_cache_dir

Function = TypeVar("Function", bound=Callable[..., Any])

SOURCES = Path(__file__).parent
STAMP = "stereolag_sources.sha256"
"""The file that says from which sources the machine code beside it was made."""

CONFIG: Any = numba.config
OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


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


def forget_older_code(folder: Path) -> None:
    """Delete machine code that was made from other sources than those of today.

    Numba compares it with the file of the outermost function alone, and would go on using what that calls. Contents are
    compared, not times: an archive or a clock can date a file at will. Several processes may do this at once.

    Parameters
    ----------
    folder
        Where machine code is kept; made where there is none.

    Raises
    ------
    OSError
        It cannot be made, written to or cleared.
    """
    digest = hashlib.sha256()
    for source in sorted(SOURCES.glob("*.py")):
        digest.update(source.name.encode() + b"\0" + source.read_bytes() + b"\0")
    folder.mkdir(parents=True, exist_ok=True)
    # Nobody is to read a stamp that is half written; and a folder that takes no file is of no use.
    with tempfile.TemporaryDirectory(dir=folder) as aside:
        stamp = Path(aside, STAMP)
        stamp.write_text(digest.hexdigest(), encoding="ascii")
        with suppress(FileNotFoundError):
            if (folder / STAMP).read_bytes() == stamp.read_bytes():
                return
        for code in folder.glob("*.nb[ic]"):
            code.unlink(missing_ok=True)  # another process may be at the same work
        stamp.replace(folder / STAMP)


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


def _usual_folder() -> Path:
    """Return where Numba looks first: the operator's folder, or the one beside the sources."""
    locator: Any = UserProvidedCacheLocator if CONFIG.CACHE_DIR else InTreeCacheLocator
    return Path(locator(compiled, __file__).get_cache_path())


def _other_folders() -> Iterator[Path]:
    """Give the folders that stand in, best first."""
    with suppress(RuntimeError, OSError):  # a user without a home
        yield Path(cast(Any, user_cache_dir)("stereolag", appauthor=False)).expanduser()
    with suppress(FileNotFoundError):  # a machine without a temporary folder
        user = os.geteuid() if hasattr(os, "geteuid") else "user"
        yield Path(tempfile.gettempdir(), f"stereolag-{user}")


def _find_place() -> bool:
    """Settle where machine code is kept, before anything is compiled, and say so where it is not the usual place.

    Returns
    -------
    bool
        Whether it is kept at all.
    """
    usual = _usual_folder()
    try:
        forget_older_code(usual)
    except OSError as error:
        reason = f"{usual} cannot be used ({error.strerror or error})"
    else:
        return True
    log = logging.getLogger("stereolag")
    advice = "To choose the place, set NUMBA_CACHE_DIR to a folder that only this user can write to."
    for folder in _other_folders():
        CONFIG.CACHE_DIR = str(folder)
        with suppress(OSError):
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            if is_private(folder):
                forget_older_code(_usual_folder())
                log.warning("Machine code is kept in %s: %s. %s", folder, reason, advice)
                return True
    CONFIG.CACHE_DIR = ""
    log.warning("Machine code is not kept, and compiled anew at every start: %s. %s", reason, advice)
    return False


KEPT = _find_place()
"""Whether machine code is kept on disk: what the loops give to Numba as ``cache``."""
