"""The guard: strangers' files are read in processes of their own, with limits on time and memory.

A reader is a plain function from bytes to their content. A script calls it directly: for its own files the limits on
pixels and samples are enough. A server calls it through :func:`guarded`, in a worker process: if a file
takes more time or memory than is allowed, or crashes its decoder, that worker ends, and the server and its other
visitors do not notice. Workers are started ahead, so that nobody waits for one to start or to be replaced.
"""

from __future__ import annotations

import atexit
import importlib
import os
import pickle
import signal
import subprocess
import sys
import threading
import traceback
import warnings
import weakref
from collections import OrderedDict
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, Generic, ParamSpec, Protocol, TypeVar

from stereolag.core.jobs import PREFIX, limits, machine_memory, set_defaults

P = ParamSpec("P")
T = TypeVar("T")

READING_S = 5.0
"""Processor time allowed for one file at the usual limits of a server; more where these are higher."""
USUAL_MEGAPIXELS, USUAL_MEGASAMPLES = 50, 30
PATIENCE = 3
"""By the clock, reading may take this many times as long: the machine may be busy."""

MEMORY = 2**29
BYTES_PER_VALUE = 16
"""Memory allowed for one file: `MEMORY`, and so much for each pixel and sample of the largest file accepted."""

AT_ONCE = 8
"""Most files read at a time."""
SPARES = 2
"""Most workers kept while there is nothing to read."""
KEPT_OPEN = 4
"""Most files kept open at a time; when another is needed, it is opened again."""

TOO_SLOW = "The file takes more time to read than is allowed; save it again, in another format."
TOO_LARGE = "The file takes more memory to read than is allowed; save it again, in another format."
CRASHED = "The file is damaged: it cannot be decoded."

_PRELOADED = ("stereolag.io.calibrations", "stereolag.io.disparities", "stereolag.io.recordings", "av")


class Door(Protocol):
    """Turns a reader into one that runs elsewhere: :func:`guarded`, or :func:`unguarded` for none."""

    def __call__(self, reader: Callable[P, T], /) -> Callable[P, T]:
        """Return a function with the parameters and the result of `reader`."""
        ...


def unguarded(reader: Callable[P, T], /) -> Callable[P, T]:
    """Return the reader itself, as for one's own files."""
    return reader


def guarded(reader: Callable[P, T], /) -> Callable[P, T]:
    """Return a function that calls a reader in a worker.

    It raises ValueError as the reader does, or if that takes too much time or memory, or crashes. The reader, its
    arguments and its result must be picklable.
    """

    def read(*args: P.args, **kwargs: P.kwargs) -> T:
        return _guard.run(partial(reader, *args, **kwargs))

    return read


def start_guard() -> None:
    """Start a worker ahead, so that the first file need not wait for it."""
    _guard.start()


class GuardedObject(Generic[T]):
    """An object that ``make(*args)`` returns for a stranger's file, in a worker of its own, replaced when that ends."""

    def __init__(self, make: Callable[..., T], *args: Any) -> None:
        self._make = partial(_keep, make, *args)
        self._turn = threading.Lock()
        self._worker: _Worker | None = None

    def ask(self, function: Callable[..., Any], *args: Any) -> Any:
        """Return ``function(object, *args)``; errors as of :func:`guarded`. Threads take turns."""
        with self._turn:
            _guard.note_use(self)
            if self._worker is None or self._worker.ended:
                self._worker = _guard.take()
                weakref.finalize(self, self._worker.end)
                self._worker.run(self._make)
            return self._worker.run(partial(_of_kept, function, *args))

    def close(self) -> None:
        """End the worker, unless it is being asked just now."""
        if self._turn.acquire(blocking=False):
            if self._worker is not None:
                self._worker.end()
            self._turn.release()


class _Worker:
    """A process that runs jobs, one at a time."""

    def __init__(self) -> None:
        # Not by multiprocessing, which would run the page's script again: Streamlit makes it the main module.
        environment = {name: value for name, value in os.environ.items() if not name.startswith(PREFIX)}
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", f"from {__name__} import serve; serve()"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=environment | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path)), "OPENBLAS_NUM_THREADS": "1"},
            start_new_session=True,  # Ctrl+C is for the server alone
        )
        _guard.workers.add(self)

    @property
    def ended(self) -> bool:
        """Return whether the process has ended."""
        return self._process.poll() is not None

    def run(self, job: partial[T]) -> T:
        """Return the result of a job; ValueError if the job raises one or the worker ends."""
        most = limits()
        seconds = READING_S * max(1, most.max_megapixels / USUAL_MEGAPIXELS, most.max_megasamples / USUAL_MEGASAMPLES)
        memory = min(MEMORY + BYTES_PER_VALUE * (most.max_pixels + most.max_samples), machine_memory())
        late = threading.Event()
        watch = threading.Timer(PATIENCE * seconds, self._end_late, (late,))
        watch.daemon = True
        watch.start()
        try:
            outcome: tuple[T, Exception | None] = self._exchanged(
                (most.model_dump(), (seconds, 2 * PATIENCE * seconds, memory), job)
            )
        except (OSError, EOFError, pickle.UnpicklingError):
            # The worker has ended; nothing that a file does can end it otherwise.
            self.end()
            out_of_time = late.is_set() or self._process.wait() == -getattr(signal, "SIGPROF", 0)
            raise ValueError(TOO_SLOW if out_of_time else CRASHED) from None
        except BaseException:  # an interrupted exchange cannot be continued
            self.end()
            raise
        finally:
            watch.cancel()
            watch.join()
        result, error = outcome
        if error is not None:
            raise error
        return result

    def _exchanged(self, message: Any) -> Any:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        pickle.dump(message, self._process.stdin, protocol=5)
        self._process.stdin.flush()
        return pickle.load(self._process.stdout)

    def _end_late(self, late: threading.Event) -> None:
        late.set()
        self._process.kill()

    def end(self) -> None:
        """End the process now; if it is ending by itself, its own exit code stays."""
        self._process.kill()
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout):
            with suppress(OSError):  # what was not sent any more
                if stream is not None:
                    stream.close()


class _Guard:
    """The workers that are free, and the objects that have one of their own."""

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Begin without workers; in a forked process, they stay with the one that it was forked from."""
        self._lock = threading.Lock()
        self._slots = threading.BoundedSemaphore(AT_ONCE)
        self._free: list[_Worker] = []
        self._in_use: OrderedDict[int, weakref.ref[GuardedObject[Any]]] = OrderedDict()
        self.workers: weakref.WeakSet[_Worker] = weakref.WeakSet()

    def end(self) -> None:
        """End all workers."""
        for worker in list(self.workers):
            worker.end()

    def start(self) -> None:
        """Start a worker if none is free."""
        with self._lock:
            if not self._free:
                self._free.append(_Worker())

    def run(self, job: partial[T]) -> T:
        """Run a job in a worker."""
        with self._slots:
            worker = self.take()
            try:
                return worker.run(job)
            finally:
                with self._lock:
                    kept = not worker.ended and len(self._free) < SPARES
                    if kept:
                        self._free.append(worker)
                if not kept:
                    worker.end()

    def take(self) -> _Worker:
        """Return a free worker, and start another if it was the last."""
        with self._lock:
            self._free = [worker for worker in self._free if not worker.ended]
            worker = self._free.pop() if self._free else _Worker()
            if not self._free:
                self._free.append(_Worker())
        return worker

    def note_use(self, of: GuardedObject[Any]) -> None:
        """Note that an object is in use; of too many, close those that were not used for longest."""
        with self._lock:
            self._in_use[id(of)] = weakref.ref(of)
            self._in_use.move_to_end(id(of))
            beyond = max(0, len(self._in_use) - KEPT_OPEN)
            oldest = [self._in_use.popitem(last=False)[1]() for _ in range(beyond)]
        for one in oldest:
            if one is not None:
                one.close()


_guard = _Guard()


atexit.register(_guard.end)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_guard.forget)


# In the worker.


def serve() -> None:
    """Answer jobs until the server is gone."""
    jobs, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever is printed must not get among the answers
    warnings.simplefilter("ignore")
    with suppress(OSError):
        # If the machine runs out of memory, this process ends before the server does.
        Path("/proc/self/oom_score_adj").write_text("1000")
    for name in _PRELOADED:
        importlib.import_module(name)
    from stereolag.io.images import UnseenFrames

    warnings.simplefilter("error", UnseenFrames)
    for number in (1, 2):  # decoders comment on every damaged file, which are no news for the server's log
        os.dup2(os.open(os.devnull, os.O_WRONLY), number)
    while True:
        try:
            values, most, job = pickle.load(jobs)
        except EOFError:
            return
        set_defaults(**values)
        _limit(*most)
        answer = _answer_to(job)
        _limit(0, 0, None)
        try:
            pickle.dump(answer, answers, protocol=5)
            answers.flush()
        except BrokenPipeError:
            os._exit(0)


def _answer_to(job: Callable[[], Any]) -> tuple[Any, Exception | None]:
    try:
        return job(), None
    except ValueError as error:
        return None, ValueError(str(error))
    except MemoryError:
        return None, ValueError(TOO_LARGE)
    except Exception:  # an error of the reader, for the log of the server
        return None, RuntimeError(f"A reader failed.\n{traceback.format_exc()}")


def _limit(seconds: float, by_the_clock: float, memory: int | None) -> None:
    """Limit time and memory from now on, where the system can; 0 and None are no limits."""
    if sys.platform == "win32":
        return
    import resource

    # Their signals end the process; the second does if the server, which would do it, has ended.
    signal.setitimer(signal.ITIMER_PROF, seconds)
    signal.setitimer(signal.ITIMER_REAL, by_the_clock)
    most = resource.RLIM_INFINITY if memory is None else memory + _address_space()
    with suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_AS, (most, resource.getrlimit(resource.RLIMIT_AS)[1]))


def _address_space() -> int:
    try:
        return int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:  # not Linux
        return 0


_kept: list[Any] = []


def _keep(make: Callable[..., Any], *args: Any) -> None:
    _kept[:] = [make(*args)]


def _of_kept(function: Callable[..., Any], *args: Any) -> Any:
    return function(_kept[0], *args)
