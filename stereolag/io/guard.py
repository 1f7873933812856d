"""The guard: untrusted files are read in worker processes, with limits on time and memory.

A reader is a plain function from bytes to their content. A script calls it directly: for its own files the limits on
pixels and samples are enough. A server calls it through :func:`guarded`, in a worker process: if a file
takes more time or memory than is allowed, or crashes its decoder, that worker ends, and the server and its other
visitors are not affected. Workers are started ahead, so that nobody waits for one to start or to be replaced.
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

MAX_CPU_S = 5.0
"""Processor time allowed for one file, up to the two limits below; in proportion to higher limits."""
REFERENCE_MEGAPIXELS = 50
"""Limit on the size of images up to which `MAX_CPU_S` is allowed."""
REFERENCE_MEGASAMPLES = 30
"""Limit on the size of recordings up to which `MAX_CPU_S` is allowed."""
WALL_CLOCK_FACTOR = 3
"""Elapsed time allowed for one file, as a multiple of its processor time: the machine may be busy."""

BASE_MEMORY_BYTES = 2**29
"""Memory allowed for one file, apart from its values."""
BYTES_PER_VALUE = 16
"""Memory allowed in addition for each pixel and sample of the largest files accepted."""

MAX_CONCURRENT_JOBS = 8
"""Files read at a time."""
MAX_IDLE_WORKERS = 2
"""Workers kept while there is nothing to read."""
MAX_OPEN_FILES = 4
"""Files kept open at a time; a closed one is opened again when it is needed."""

TOO_SLOW = "The file takes more time to read than is allowed; save it again, in another format."
TOO_LARGE = "The file takes more memory to read than is allowed; save it again, in another format."
CRASHED = "The file is damaged: it cannot be decoded."

_PRELOADED = ("stereolag.io.calibrations", "stereolag.io.disparities", "stereolag.io.recordings", "av")


class Guard(Protocol):
    """Decides where a reader runs: :func:`guarded`, in a worker, or :func:`unguarded`, in this process."""

    def __call__(self, reader: Callable[P, T], /) -> Callable[P, T]:
        """Return a function with the parameters and the result of `reader`."""
        ...


def unguarded(reader: Callable[P, T], /) -> Callable[P, T]:
    """Return the reader itself, for one's own files."""
    return reader


def guarded(reader: Callable[P, T], /) -> Callable[P, T]:
    """Return a function that calls a reader in a worker.

    It raises ValueError as the reader does, or if that takes too much time or memory, or crashes. The reader, its
    arguments and its result must be picklable.
    """

    def read(*args: P.args, **kwargs: P.kwargs) -> T:
        return _pool.run(partial(reader, *args, **kwargs))

    return read


def start_guard() -> None:
    """Start a worker ahead, so that the first file does not wait for it."""
    _pool.start()


class GuardedObject(Generic[T]):
    """An object made from an untrusted file by ``make(*args)`` in its own worker; made again if that worker ends."""

    def __init__(self, make: Callable[..., T], *args: Any) -> None:
        self._make = partial(_hold, make, *args)
        self._lock = threading.Lock()
        self._worker: _Worker | None = None

    def ask(self, function: Callable[..., Any], *args: Any) -> Any:
        """Return ``function(object, *args)``; errors as of :func:`guarded`. Threads take turns."""
        with self._lock:
            _pool.note_use(self)
            if self._worker is None or self._worker.ended:
                self._worker = _pool.take()
                weakref.finalize(self, self._worker.end)
                self._worker.run(self._make)
            return self._worker.run(partial(_call_on_held, function, *args))

    def close(self) -> None:
        """End the worker, unless it is busy."""
        if self._lock.acquire(blocking=False):
            if self._worker is not None:
                self._worker.end()
            self._lock.release()


class _Worker:
    """A process that runs jobs, one at a time."""

    def __init__(self) -> None:
        # Not multiprocessing, which would run the page's script again: Streamlit makes it the main module.
        environment = {name: value for name, value in os.environ.items() if not name.startswith(PREFIX)}
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", f"from {__name__} import serve; serve()"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=environment | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path)), "OPENBLAS_NUM_THREADS": "1"},
            start_new_session=True,  # Ctrl+C is for the server alone
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._jobs, self._answers = self._process.stdin, self._process.stdout
        _pool.workers.add(self)

    @property
    def ended(self) -> bool:
        """Return whether the process has ended."""
        return self._process.poll() is not None

    def run(self, job: partial[T]) -> T:
        """Return the result of a job; ValueError if the job raises one or the worker ends."""
        sizes = limits()
        seconds = MAX_CPU_S * max(
            1, sizes.max_megapixels / REFERENCE_MEGAPIXELS, sizes.max_megasamples / REFERENCE_MEGASAMPLES
        )
        memory = min(BASE_MEMORY_BYTES + BYTES_PER_VALUE * (sizes.max_pixels + sizes.max_samples), machine_memory())
        is_late = threading.Event()
        timer = threading.Timer(WALL_CLOCK_FACTOR * seconds, self._kill_late, (is_late,))
        timer.daemon = True
        timer.start()
        try:
            message = sizes.model_dump(), (seconds, 2 * WALL_CLOCK_FACTOR * seconds, memory), job
            pickle.dump(message, self._jobs, protocol=5)
            self._jobs.flush()
            outcome: tuple[T, Exception | None] = pickle.load(self._answers)
        except (OSError, EOFError, pickle.UnpicklingError):
            # The worker has ended.
            self.end()
            out_of_time = is_late.is_set() or self._process.wait() == -getattr(signal, "SIGPROF", 0)
            raise ValueError(TOO_SLOW if out_of_time else CRASHED) from None
        except BaseException:  # an interrupted exchange cannot be continued
            self.end()
            raise
        finally:
            timer.cancel()
            timer.join()
        result, error = outcome
        if error is not None:
            raise error
        return result

    def _kill_late(self, is_late: threading.Event) -> None:
        is_late.set()
        self._process.kill()

    def end(self) -> None:
        """End the process now; if it has ended by itself, its own exit code remains."""
        self._process.kill()
        # Leaving the process closes its streams and waits for it; a message may be left that can no longer be sent.
        with suppress(OSError), self._process:
            pass


class _WorkerPool:
    """The workers: those that are free, and those of guarded objects."""

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Begin without workers; after a fork, they remain with the parent process."""
        self._lock = threading.Lock()
        self._slots = threading.BoundedSemaphore(MAX_CONCURRENT_JOBS)
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
                    kept = not worker.ended and len(self._free) < MAX_IDLE_WORKERS
                    if kept:
                        self._free.append(worker)
                if not kept:
                    worker.end()

    def take(self) -> _Worker:
        """Return a free worker, and start another if it was the last one."""
        with self._lock:
            self._free = [worker for worker in self._free if not worker.ended]
            worker = self._free.pop() if self._free else _Worker()
            if not self._free:
                self._free.append(_Worker())
        return worker

    def note_use(self, guarded_object: GuardedObject[Any]) -> None:
        """Record that an object is in use, and close the least recently used ones if there are too many."""
        with self._lock:
            self._in_use[id(guarded_object)] = weakref.ref(guarded_object)
            self._in_use.move_to_end(id(guarded_object))
            excess = max(0, len(self._in_use) - MAX_OPEN_FILES)
            oldest = [self._in_use.popitem(last=False)[1]() for _ in range(excess)]
        for unused in filter(None, oldest):
            unused.close()


_pool = _WorkerPool()


atexit.register(_pool.end)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.forget)


# In the worker.


def serve() -> None:
    """Answer jobs until the server is gone."""
    jobs, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # printed text must not get into the answers
    warnings.simplefilter("ignore")
    with suppress(OSError):
        # If the machine runs out of memory, this process ends before the server does.
        Path("/proc/self/oom_score_adj").write_text("1000")
    for name in _PRELOADED:
        importlib.import_module(name)
    from stereolag.io.images import UnseenFrames

    warnings.simplefilter("error", UnseenFrames)
    for number in (1, 2):  # decoders report every damaged file, which does not belong in the server's log
        os.dup2(os.open(os.devnull, os.O_WRONLY), number)
    while True:
        try:
            defaults, allowance, job = pickle.load(jobs)
        except EOFError:
            return
        set_defaults(**defaults)
        _limit(*allowance)
        answer = _answer(job)
        _limit(0, 0, None)
        try:
            pickle.dump(answer, answers, protocol=5)
            answers.flush()
        except BrokenPipeError:
            os._exit(0)


def _answer(job: Callable[[], Any]) -> tuple[Any, Exception | None]:
    try:
        return job(), None
    except ValueError as error:
        return None, ValueError(str(error))
    except MemoryError:
        return None, ValueError(TOO_LARGE)
    except Exception:  # a bug of the reader, for the log of the server
        return None, RuntimeError(f"A reader failed.\n{traceback.format_exc()}")


def _limit(cpu_s: float, elapsed_s: float, memory: int | None) -> None:
    """Limit time and memory, bytes, from now on, where the system can; 0 and None: no limit."""
    if sys.platform == "win32":
        return
    import resource

    # The signals of these timers end the process. The server ends it before the second one does, unless it has ended.
    signal.setitimer(signal.ITIMER_PROF, cpu_s)
    signal.setitimer(signal.ITIMER_REAL, elapsed_s)
    address_space = resource.RLIM_INFINITY if memory is None else memory + _address_space()
    with suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_AS, (address_space, resource.getrlimit(resource.RLIMIT_AS)[1]))


def _address_space() -> int:
    """Return the address space in use, bytes; 0 where Linux does not tell it."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:  # not Linux
        return 0


_held: list[Any] = []
"""The object of the :class:`GuardedObject` that uses this worker."""


def _hold(make: Callable[..., Any], *args: Any) -> None:
    _held[:] = [make(*args)]


def _call_on_held(function: Callable[..., Any], *args: Any) -> Any:
    return function(_held[0], *args)
