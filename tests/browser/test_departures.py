"""What visitors uploaded and computed is given back when they have left; asked in Streamlit's own protocol."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AsyncExitStack
from pathlib import Path

import pytest

from benchmarks.load import WINDOW, Server, own_pair, serving, windows_of, with_own_pair
from benchmarks.visitors import Visitor

VISITORS, MOVES = 4, 7
MOST_LEFT_MB = 40
"""A third of what they take, and far more than what the allocator keeps of it."""

PATIENCE_S = 60


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    if not Path("/proc/self/statm").exists():
        pytest.skip("the memory of a process is read from /proc, which is not here")
    with serving({"STREAMLIT_SERVER_DISCONNECTED_SESSION_TTL": "1"}) as running:
        yield running


def visited(server: Server, visitors: int) -> float:
    """Return what :func:`visit` does; in a thread of its own, since a browser's loop may run in this one."""
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(lambda: asyncio.run(visit(server, visitors))).result()


async def visit(server: Server, visitors: int) -> float:
    """Let visitors come with pairs of their own, move, and leave; return the memory with all of them there, MB."""
    async with AsyncExitStack() as everybody:
        for number in range(visitors):
            visitor = await everybody.enter_async_context(Visitor(server.port))
            await with_own_pair(visitor, own_pair(number))
            for window in windows_of(MOVES):
                await visitor.move(WINDOW, window)
                await visitor.settled()
        return server.megabytes()


def test_their_memory_is_given_back(server: Server) -> None:
    visited(server, 1)
    time.sleep(5)
    at_first = server.megabytes()
    with_all = visited(server, VISITORS)
    assert with_all > at_first + 3 * MOST_LEFT_MB
    end = time.monotonic() + PATIENCE_S
    while (left := server.megabytes()) > at_first + MOST_LEFT_MB and time.monotonic() < end:
        time.sleep(0.5)
    assert left <= at_first + MOST_LEFT_MB
