"""The compilation of this project's loops, and the folder of their machine code; the only module that uses Numba.

A loop is compiled on its first call with arguments of new types. Machine code is kept beside this file, or in the
folder that ``NUMBA_CACHE_DIR`` names; a read-only install keeps it in the user's cache folder. If none of these can be
written to, every process compiles again. Kept machine code is loaded without Numba.

The folder is named after a digest of the sources of all loops together, since a loop contains those that it calls. So
nothing has to be deleted that another process, perhaps of another release, has just written or is about to load.
"""

from __future__ import annotations

import hashlib
import logging
import os
import pickle
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Hashable, Iterator, Set
from contextlib import ExitStack, contextmanager, suppress
from functools import cache, partial, update_wrapper
from importlib import import_module
from pathlib import Path
from types import FunctionType
from typing import Any, TypeVar, overload

import numpy as np

from stereolag.loops import numba_inside

__all__ = ["BEFORE_COMPILING", "FOLDER", "Deferred", "Loop", "compiled", "compiled_as"]

Function = TypeVar("Function", bound=Callable[..., Any])

HERE = Path(__file__).absolute()
SOURCES = HERE.parents[1]
"""The package, whose subpackages contain the loops."""

MAKES_CODE = re.compile(rb"\n(?:from|import) .*\b(?:numba|llvmlite|compilation|NamedTuple)\b")
"""Imports of every file with a loop, with an instruction for loops, or with a tuple that loops take.

With "^" in place of the line's end before it, it takes six times as long."""

WITH_LOOPS = ("core", "loops", "motion", "signals", "stereo", "templates")
"""Packages that contain loops, or tuples that loops take, so that their changes may change machine code."""

MAX_UNUSED_S = 7 * 24 * 3600
"""Seconds for which machine code of other sources is kept after a process last started with it."""

SCALARS = {kind: np.dtype(kind).str for kind in (int, float, bool, complex)} | {type(None): "None"}
"""Python's scalar types as those of NumPy, which are the same to machine code."""

ALIGNED_AND_WRITEABLE = 0x500
"""NumPy's flags of an array that machine code depends on, besides those of its layout."""

BEFORE_COMPILING: list[Callable[[], object]] = []
"""Steps before the next compilation, which register with Numba the functions that loops call."""

_COMPILING = threading.RLock()
"""Held while a loop is compiled or loaded: neither Numba nor LLVM's loader can do two at once."""


class Deferred:
    """An object that only Numba can make, which loops can name before Numba is loaded.

    Parameters
    ----------
    make
        Makes the object.
    """

    def __init__(self, make: Callable[[], Any]) -> None:
        self.made = cache(make)

    def __call__(self, *arguments: Any) -> Any:
        """Call the object."""
        return self.made()(*arguments)


class Loop(Deferred):
    """A function that runs as machine code, made or loaded on the first call with arguments of new types.

    Parameters
    ----------
    function
        The function in Python.
    fastmath
        LLVM's names of the permitted floating-point relaxations.
    counted
        Whether it counts references to arrays.
    """

    def __init__(self, function: FunctionType, fastmath: Set[str], counted: bool = True) -> None:
        update_wrapper(self, function)
        self.py_func = function
        self._parameters, self._defaults = function.__code__.co_argcount, function.__defaults__ or ()
        self._code: dict[Hashable, Callable[..., Any]] = {}
        options: dict[str, Any] = {
            "nogil": True,
            "error_model": "numpy",
            "fastmath": set(fastmath),
            "no_cfunc_wrapper": True,
            "_nrt": counted,
        }
        super().__init__(lambda: numba_inside.numba(Deferred).njit(no_cpython_wrapper=True, **options)(function))
        self.for_python = cache(lambda: numba_inside.numba(Deferred).njit(**options)(function))

    def __call__(self, *arguments: Any) -> Any:
        """Run the machine code for arguments of these types."""
        if len(arguments) < self._parameters:
            arguments += self._defaults[len(arguments) - self._parameters :]
        kinds = tuple(map(_kind, arguments))
        return (self._code.get(kinds) or self._find_code(kinds, arguments))(*arguments)

    def _find_code(self, kinds: tuple[Hashable, ...], arguments: tuple[Any, ...]) -> Callable[..., Any]:
        with _COMPILING:
            if kinds not in self._code:
                file = self._file(kinds)
                code = None if file is None else _load(file, self.py_func)
                self._code[kinds] = code or self._compile(file, arguments)
            return self._code[kinds]

    def _file(self, kinds: tuple[Hashable, ...]) -> Path | None:
        """Return the file of the machine code; None if it is not kept, as for loops outside this package."""
        source = Path(self.py_func.__code__.co_filename).absolute()
        if FOLDER is None or not source.is_relative_to(SOURCES):
            return None
        made_for = hashlib.sha256(f"{kinds} {numba_inside.processor()}".encode()).hexdigest()[:16]
        name = f"{source.stem}.{self.py_func.__qualname__}-{self.py_func.__code__.co_firstlineno}-{made_for}.code"
        return FOLDER / source.relative_to(SOURCES).parent / name.replace("<locals>", "")

    def _compile(self, file: Path | None, arguments: tuple[Any, ...]) -> Callable[..., Any]:
        while BEFORE_COMPILING:
            BEFORE_COMPILING.pop(0)()
        code, kept = numba_inside.compile_loop(self.for_python(), arguments)
        if file is not None and kept is not None:
            with suppress(OSError):  # a full disk: the next process compiles again
                file.parent.mkdir(parents=True, exist_ok=True)
                written = file.with_suffix(f".{os.getpid()}")
                written.write_bytes(kept.packed())
                written.replace(file)
        return code


def _load(file: Path, function: FunctionType) -> Callable[..., Any] | None:
    """Return the function whose machine code is in a file; None if there is no such file, or it is of no use here."""
    try:
        kept = numba_inside.MachineCode.unpacked(file.read_bytes())
        return None if kept is None else numba_inside.load(kept, function)
    except OSError:
        return None


def load_loader() -> None:
    """Load the loader of machine code now, not at the first call of a loop."""
    with _COMPILING:
        numba_inside.runtime()


def _kind(value: Any) -> Hashable:
    """Return the properties of an argument that machine code depends on: all but its values and sizes.

    Raises TypeError for anything but arrays and scalars of numbers, None, and tuples of them.
    """
    if isinstance(value, np.ndarray):
        flags = value.flags.num
        layout = "C" if flags & 1 else "F" if flags & 2 else "A"
        return value.dtype.str, value.ndim, layout, flags & ALIGNED_AND_WRITEABLE
    if scalar := SCALARS.get(type(value)):
        return scalar
    if isinstance(value, np.generic):
        return value.dtype.str
    if isinstance(value, tuple):
        return (type(value).__qualname__, *map(_kind, value))
    raise TypeError(f"A loop takes arrays, numbers and tuples of them, not {type(value).__qualname__}.")


@overload
def compiled(function: Function, /) -> Function: ...


@overload
def compiled(*, fastmath: Set[str] = ..., counted: bool = ...) -> Callable[[Function], Function]: ...


def compiled(function: Any = None, /, *, fastmath: Set[str] = frozenset(), counted: bool = True) -> Any:
    """Compile a function on first use, keep the machine code on disk, and release the interpreter lock while it runs.

    Use it as ``@compiled``, or as ``@compiled(fastmath={"reassoc", "contract"})`` where sums may be taken in any order.
    Numba's ``parallel=True`` is not used, since its default threading layer aborts the process when two sessions enter
    it at once; threads come from :mod:`stereolag.loops.bands`. Nor is ``fastmath`` as a whole: NaN has a meaning here.

    Parameters
    ----------
    function
        The function to compile; a division by zero gives infinity or NaN, as in NumPy.
    fastmath
        LLVM's names of the permitted floating-point relaxations.
    counted
        Whether references to arrays are counted, at every call and every access to a field of a record, across all
        cores. A loop that neither makes nor returns an array does not need it.
    """
    if function is None:
        return partial(compiled, fastmath=fastmath, counted=counted)
    if os.environ.get("NUMBA_DISABLE_JIT", "0") != "0":
        return function  # as Numba does: the documentation shows functions
    return Loop(function, fastmath, counted)


def compiled_as(function: Callable[..., Any]) -> Callable[[Function], Function]:
    """Replace a plain function in compiled code by one chosen by the types of the arguments.

    The decorated function takes Numba's types and returns the function to compile.
    """

    def decorate(choose: Function) -> Function:
        BEFORE_COMPILING.append(lambda: import_module("numba.extending").overload(function, strict=False)(choose))
        return choose

    return decorate


def folder_name() -> str:
    """Return a folder name for this Python, this Numba and the current sources of the loops.

    Contents are compared, not times: an archive or a wrong clock can give a file any date.
    """
    digest = hashlib.sha256(f"{sys.implementation.cache_tag} ".encode() + numba_inside.version())
    for source in sorted(source for package in WITH_LOOPS for source in (SOURCES / package).rglob("*.py")):
        with suppress(OSError):  # an editor's lock, or a file that an upgrade is just removing
            text = source.read_bytes()
            if MAKES_CODE.search(b"\n" + text):
                digest.update(f"\0{source.relative_to(SOURCES).as_posix()}\0".encode() + text)
    return f"stereolag-{digest.hexdigest()[:16]}"


def _prepare(folder: Path) -> Path:
    """Make a folder for machine code, delete folders beside it that have not been used for long, and return it.

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
            if time.time() - other.stat().st_mtime > MAX_UNUSED_S:
                shutil.rmtree(other, ignore_errors=True)
    return folder


def _find_folder() -> Path | None:
    """Choose the folder before anything is compiled, and log it if it is not the usual one; None if none is usable."""
    usual = Path(named).absolute() if (named := os.environ.get("NUMBA_CACHE_DIR")) else HERE.with_name("__pycache__")
    name, log = folder_name(), logging.getLogger("stereolag")
    try:
        return _prepare(usual / name)
    except OSError as error:
        reason = f"{usual} cannot be used ({error.strerror or error})"
    advice = "To choose the place, set NUMBA_CACHE_DIR to a folder that only this user can write to."
    with suppress(RuntimeError, OSError):  # a user without a home
        own = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "stereolag")
        own.mkdir(mode=0o700, parents=True, exist_ok=True)  # whoever writes code there can make us run it
        folder = _prepare(own / name)
        log.warning("Machine code is kept in %s: %s. %s", own, reason, advice)
        return folder
    log.warning("Machine code is not kept, and compiled anew at every start: %s. %s", reason, advice)
    return None


FOLDER: Path | None = _find_folder()
"""Folder of the machine code on disk; None if it is not kept."""


_HELP_TAKEN = threading.Lock()
"""Acquired once and never released: by the first caller that another process helps to compile, or to refuse help."""


def compile_alone() -> bool:
    """Prevent this process from starting another one to help it compile; return whether it still could have."""
    return _HELP_TAKEN.acquire(blocking=False)


@contextmanager
def python_process(*arguments: str, **options: Any) -> Iterator[Any]:
    """Run another Python process with the import path of this one, as `subprocess.Popen`, until the context ends.

    Not by multiprocessing, which would run the user's script again.
    """
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    process = subprocess.Popen([sys.executable, "-P", *arguments], env=environment, **options)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


@contextmanager
def compiling_beside(module: str, *arguments: Any) -> Iterator[None]:
    """Let another process compile some of the loops meanwhile, if no machine code is kept yet.

    A process compiles one loop at a time, and finds loops compiled by another one on disk.

    Parameters
    ----------
    module
        The module whose function ``compile_share`` the other process calls.
    arguments
        Arguments of the call.
    """
    code = f"import pickle, sys; from {module} import compile_share; compile_share(*pickle.load(sys.stdin.buffer))"
    nothing_kept = compile_alone() and FOLDER is not None and not any(FOLDER.rglob("*.code"))
    with ExitStack() as running:
        if nothing_kept and sys.executable and not hasattr(sys, "frozen"):
            quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
            with suppress(OSError):
                helper = running.enter_context(python_process("-c", code, stdin=subprocess.PIPE, **quiet))
                with helper.stdin:
                    pickle.dump(arguments, helper.stdin)
        yield
