"""The guard: whatever a stranger's file does, the server and its other visitors do not notice."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from benchmarks.memory import peak_extra_memory
from benchmarks.picture_bytes import by_pillow, noise
from stereolag.core import jobs as limits_module
from stereolag.core.jobs import limits
from stereolag.io import guard
from stereolag.io.guard import GuardedObject, guarded
from stereolag.io.images import read_image

PICTURE = by_pillow("PNG", noise(3, 40))


def test_a_guarded_reader_gives_what_the_reader_gives() -> None:
    found = guarded(read_image)(PICTURE)
    np.testing.assert_array_equal(found, read_image(PICTURE))
    assert found.dtype == np.uint8
    assert found.flags.writeable
    with pytest.raises(ValueError, match=r"^This is not an image that can be read, or its beginning is damaged;"):
        guarded(read_image)(b"no image")


@pytest.fixture
def hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guard, "MAX_CPU_S", 0.2 / max(1, limits().max_megasamples / guard.REFERENCE_MEGASAMPLES))
    monkeypatch.setattr(guard, "WALL_CLOCK_FACTOR", 25)


@pytest.mark.usefixtures("hasty")
@pytest.mark.parametrize(
    ("job", "sentence"),
    [
        (partial(sum, range(10**12)), guard.TOO_SLOW),
        (os.abort, guard.CRASHED),
        (partial(os._exit, 0), guard.CRASHED),
        pytest.param(
            partial(bytes, 2**40),
            guard.TOO_LARGE,
            marks=pytest.mark.skipif(sys.platform != "linux", reason="no limit on memory"),
        ),
    ],
    ids=["processor time", "crash", "end", "memory"],
)
def test_what_takes_too_much_is_refused_and_the_next_file_is_read(job: partial[object], sentence: str) -> None:
    start = time.monotonic()
    with pytest.raises(ValueError) as caught:
        guarded(job)()
    assert str(caught.value) == sentence
    assert time.monotonic() - start < 20
    assert guarded(read_image)(PICTURE).shape == (40, 40, 3)


@pytest.mark.usefixtures("hasty")
def test_nobody_waits_for_another_s_slow_file_which_is_refused_in_the_end() -> None:
    with ThreadPoolExecutor(3) as others:
        slow = [others.submit(guarded(time.sleep), 60) for _ in range(3)]
        for _ in range(5):
            assert guarded(read_image)(PICTURE).shape == (40, 40, 3)
        assert not any(one.done() for one in slow)
        assert [str(one.exception(20)) for one in slow] == [guard.TOO_SLOW] * 3


def test_the_limits_of_the_server_hold_in_the_worker(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits_module, "_defaults", {"max_megapixels": 4})
    limits.cache_clear()
    try:
        with pytest.raises(ValueError, match="at most 4 megapixels"):
            guarded(read_image)(by_pillow("PNG", noise(1, 2100)))
        assert guarded(read_image)(by_pillow("PNG", noise(1, 2000))).shape == (2000, 2000)
    finally:
        limits.cache_clear()


@pytest.mark.skipif(sys.platform != "linux", reason="memory as counted by Linux")
def test_the_server_takes_no_memory_but_that_of_the_result() -> None:
    data = by_pillow("PNG", np.zeros((4000, 4000, 3), np.uint8))
    guarded(read_image)(data)
    assert peak_extra_memory(lambda: guarded(read_image)(data)) < 60


def test_an_object_keeps_its_state_and_is_made_again_when_its_worker_has_ended() -> None:
    counter = GuardedObject(bytearray, b"a")
    counter.ask(bytearray.append, 98)
    assert counter.ask(bytes) == b"ab"
    with pytest.raises(ValueError, match="damaged"):
        counter.ask(_end)
    assert counter.ask(bytes) == b"a"


def _end(_: object) -> None:
    os._exit(1)


def test_of_many_objects_those_unused_for_longest_are_closed_and_made_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guard, "MAX_OPEN_FILES", 1)
    objects = [GuardedObject(bytearray, bytes([number])) for number in range(2)]
    for one in objects:
        one.ask(bytes)
    workers = [one._worker for one in objects if one._worker is not None]
    assert sum(not worker.ended for worker in workers) == guard.MAX_OPEN_FILES
    assert [one.ask(bytes) for one in objects] == [bytes([number]) for number in range(len(objects))]
    del one, objects
    assert all(worker.ended for worker in workers)


def test_a_reader_that_fails_is_an_error_of_the_program() -> None:
    with pytest.raises(RuntimeError, match="TypeError: 'int' object is not iterable"):
        guarded(list)(7)


SCRIPT = """
import os, sys, threading, time
from functools import partial
from stereolag.io import guard
from stereolag.io.guard import guarded, start_guard
guard.MAX_CPU_S, guard.WALL_CLOCK_FACTOR = 0.02, 20
start_guard()
def sleep():
    try:
        guarded(time.sleep)(60)
    except ValueError:
        pass
threading.Thread(target=sleep, daemon=True).start()
print(guarded(os.getpid)(), flush=True)
time.sleep(float(sys.argv[1]))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="processes as listed by Linux")
@pytest.mark.parametrize("end", ["exit", "kill"])
def test_no_worker_outlives_the_server(end: str) -> None:
    command = [sys.executable, "-W", "error", "-c", SCRIPT, "0" if end == "exit" else "60"]
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
    ) as server:
        worker = int(server.stdout.readline())
        if end == "kill":
            server.send_signal(signal.SIGKILL)
        said = server.stderr.read()
        server.wait(20)
    assert said == ""
    for _ in range(100):
        if not Path(f"/proc/{worker}").exists():
            return
        time.sleep(0.1)
    pytest.fail("the worker goes on")
