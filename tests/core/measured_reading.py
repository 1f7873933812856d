"""Cost of reading files, each made and read in separate processes, so that the memory is the reader's alone."""

from __future__ import annotations

import json
import os
import signal
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import BinaryIO

from hostile_cases import READERS, HostileFile
from hostile_files import hostile_files

from benchmarks.memory import peak_mb, reset_peak, resident_mb

DEADLINE_S = 60


@dataclass(frozen=True)
class Reading:
    """Cost and outcome of reading one file.

    Attributes
    ----------
    name, reader
        As in the :class:`HostileFile`.
    file_mb, seconds, extra_mb
        The file's size, the CPU time, which other work does not prolong, and the rise of the resident memory above its
        level with the file loaded.
    answer
        "read" and the shape of the result, the sentence that refuses the file, or the error.
    fault
        Whether it went wrong: an error other than ValueError, one of several lines, a warning, or no end.
    """

    name: str
    reader: str
    file_mb: float
    seconds: float
    extra_mb: float
    answer: str
    fault: bool


def in_own_process(job: Callable[[], str]) -> str | None:
    """Return the answer of `job`, run in its own fork; None if that died or did not end."""
    receiving, sending = os.pipe()
    child = os.fork()
    if not child:
        os.close(receiving)
        signal.alarm(DEADLINE_S)
        try:
            answer = job()
            with os.fdopen(sending, "w") as pipe:
                pipe.write(answer)
        finally:
            os._exit(0)
    os.close(sending)
    with os.fdopen(receiving) as pipe:
        answer = pipe.read()
    os.waitpid(child, 0)
    return answer or None


def measured(file: HostileFile) -> Reading:
    """Return the cost and outcome of reading a file."""
    with open(os.memfd_create("hostile"), "w+b", buffering=0) as store:  # noqa: PTH123
        in_own_process(lambda: str(store.write(file.make())))
        size = os.fstat(store.fileno()).st_size / 1e6
        if not size:
            return Reading(file.name, file.reader, 0, 0, 0, "the file could not be made", True)
        answer = in_own_process(lambda: json.dumps(asdict(_read(file, store))))
    if answer is None:
        return Reading(file.name, file.reader, size, DEADLINE_S, 0, "the process died or did not end", True)
    return Reading(**json.loads(answer))


def _read(file: HostileFile, store: BinaryIO) -> Reading:
    store.seek(0)
    data = store.read()
    before = resident_mb()
    reset_peak()
    start = time.process_time()
    answer, fault = answer_of(READERS[file.reader], data)
    seconds = time.process_time() - start
    return Reading(file.name, file.reader, len(data) / 1e6, seconds, peak_mb() - before, answer, fault)


def answer_of(read: Callable[[bytes], object], data: bytes) -> tuple[str, bool]:
    """Return a reader's answer to a file as text, and whether it is a fault."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            found = read(data)
        except ValueError as error:
            answer, fault = str(error), "\n" in str(error) or not str(error).strip() or type(error) is not ValueError
        except BaseException as error:
            return f"{type(error).__name__}: {error}", True
        else:
            answer, fault = f"read {_shape(found)}".strip(), False
    return (f"{answer} (warns: {caught[0].message})", True) if caught else (answer, fault)


def _shape(found: object) -> str:
    found = getattr(found, "channels", found)
    return f"{found.shape} {found.dtype}" if hasattr(found, "shape") else ""


if __name__ == "__main__":
    files = hostile_files()
    print(json.dumps([asdict(measured(files[name])) for name in json.load(sys.stdin)]))
