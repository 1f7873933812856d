"""One visitor's data: out of reach of the others, never on disk, and freed when the visitor leaves; tested over
Streamlit's own protocol."""

import asyncio
import hashlib
import time
import urllib.request
from collections.abc import Coroutine, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.load import OWN, WINDOW, Server, own_pair, serving, windows_of, with_own_pair
from benchmarks.visitors import HOST, Visitor
from tests.app.uploads import wav
from tests.browser.serving import PROJECT, wait_until

RATE = 8_000
SECONDS = 17
SAMPLE = 64 * 1024

VISITORS, MOVES = 3, 7
MOST_LEFT_MB = 40
"""A third of the memory they take, and far more than the allocator retains."""

PATIENCE_S = 60


@pytest.fixture(scope="module")
def notes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the file in which the server logs every upload that would be written to disk."""
    return tmp_path_factory.mktemp("watch") / "notes.txt"


@pytest.fixture(scope="module")
def server(notes: Path) -> Iterator[Server]:
    (notes.parent / "sitecustomize.py").write_text(
        "import tempfile\n"
        "rollover = tempfile.SpooledTemporaryFile.rollover\n"
        "def noted(self):\n"
        f"    open({str(notes)!r}, 'a').write('an upload went to disk\\n')\n"
        "    return rollover(self)\n"
        "tempfile.SpooledTemporaryFile.rollover = noted\n"
        f"open({str(notes)!r}, 'a').write('watching\\n')\n"
    )
    with serving(
        {"PYTHONPATH": f"{notes.parent}:{PROJECT}", "STREAMLIT_SERVER_DISCONNECTED_SESSION_TTL": "1"}
    ) as running:
        yield running


def awaited(work: Coroutine[Any, Any, Any]) -> Any:
    """Run a coroutine in a separate thread and return its result, since a browser's loop may run in this one."""
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(asyncio.run, work).result()


def alike_but_for_a_burst(seed: int) -> np.ndarray:
    """Return silence with a burst away from the ends and the middle, the only parts Streamlit reads to name a file. The
    loudest sample is the same in all."""
    sound = np.zeros(SECONDS * RATE)
    sound[100] = 0.9
    start = sound.size // 4
    sound[start : start + RATE // 2] = np.random.default_rng(seed).uniform(-0.5, 0.5, RATE // 2)
    assert start * 2 > SAMPLE
    return sound


async def heard(server: Server, seed: int) -> dict[str, str]:
    """Return the digest of each recording on a new visitor's page, by its address."""
    sounds = [alike_but_for_a_burst(seed + sensor) for sensor in (0, 1)]
    async with Visitor(server.port, "Sensor_lag") as visitor:
        await visitor.choose("recordings", OWN)
        boxes = visitor.keys("recordings.")
        files = {box: wav(sound, RATE) for box, sound in zip(boxes, sounds, strict=True)}
        await visitor.upload(files, "wav")
        assert visitor.complaints() == []
        await visitor.open_tab("lag.part", "Listen")
        addresses = [one.audio.url for _, one in visitor.elements("audio")]
        contents = [await asyncio.to_thread(downloaded, server, address) for address in addresses]
    return {address: hashlib.sha256(content).hexdigest() for address, content in zip(addresses, contents, strict=True)}


def downloaded(server: Server, address: str) -> bytes:
    with urllib.request.urlopen(f"http://{HOST}:{server.port}{address}", timeout=PATIENCE_S) as answer:
        return bytes(answer.read())


def test_nobody_hears_the_recording_of_another(server: Server, notes: Path) -> None:
    """Not even if the files differ only where Streamlit does not look, or are equal; and no upload is written to
    disk."""
    by_visitor = [awaited(heard(server, seed)) for seed in (0, 2, 2)]
    # Both recordings, and both together before and after the lag is undone.
    assert [len(set(one.values())) for one in by_visitor] == [4, 4, 4]
    assert len({address for one in by_visitor for address in one}) == 12
    assert set(by_visitor[0].values()).isdisjoint(by_visitor[1].values())
    assert set(by_visitor[1].values()) == set(by_visitor[2].values())
    assert set(notes.read_text().splitlines()) == {"watching"}


async def moved_at_once(server: Server) -> str:
    """Move a slider as soon as it is drawn, while the page runs for the first time; return the query of its address."""
    visitor = Visitor(server.port)
    arriving = asyncio.create_task(visitor.arrive())
    try:
        async with asyncio.timeout(PATIENCE_S):
            while not visitor.keys(WINDOW):
                await asyncio.sleep(0.001)
            await visitor.move(WINDOW, 21)
            await visitor.settled()
            await arriving
    finally:
        await visitor.leave()
    return visitor.query


def test_a_slider_moved_before_the_page_has_run_to_its_end_acts(server: Server) -> None:
    for _ in range(3):
        assert "window_size=21" in awaited(moved_at_once(server))


async def visited(server: Server, visitors: int) -> float:
    """Let visitors upload their own pairs, move a slider and leave; return the memory with all of them there, MB."""
    async with AsyncExitStack() as everybody:
        for number in range(visitors):
            visitor = await everybody.enter_async_context(Visitor(server.port))
            await with_own_pair(visitor, own_pair(number))
            for window in windows_of(MOVES):
                await visitor.move(WINDOW, window)
                await visitor.settled()
        return server.megabytes()


def test_their_memory_is_given_back(server: Server) -> None:
    if not Path("/proc/self/statm").exists():
        pytest.skip("the memory of a process is read from /proc, which is not here")
    awaited(visited(server, 1))
    time.sleep(5)
    at_first = server.megabytes()
    with_all = awaited(visited(server, VISITORS))
    assert with_all > at_first + 2 * MOST_LEFT_MB
    wait_until(lambda: server.megabytes() <= at_first + MOST_LEFT_MB, told=lambda: f"{server.megabytes()} MB")
