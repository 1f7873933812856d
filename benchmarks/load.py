"""Load test of the app without a browser: visitors who each move a slider on their own pair."""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import statistics
import subprocess
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np

from benchmarks.visitors import Move, Visitor
from stereolag import samples
from stereolag.ui.matcher_controls import preset_key, setting_key
from tests.browser.serving import free_port, served_process

LEFT, RIGHT = "pairs.left", "pairs.right"
PAIRS, OWN = "pairs", "Your own files"
WINDOW = setting_key("correlation", "window_size")
FIRST_WINDOW = 11
ACCURATE = preset_key("accurate")
PLAIN = "depth.start.undo"
DISPARITIES = setting_key("correlation", "search.rectified.num_disparities", "")
ALONE_MOVES = 20
WIDTH, HEIGHT = 700, 500
LARGE_WIDTH, LARGE_HEIGHT, LARGE_DISPARITIES = 3000, 2000, 256
BYSTANDER_CAP_S = 240.0

RESULTS = Path(__file__).parent / "results"

Figures = dict[str, float]


class Server:
    """The app in its own process, with its processor time and memory."""

    def __init__(self, process: subprocess.Popen[bytes], port: int) -> None:
        self.process = process
        self.port = port

    def cpu_seconds(self) -> float:
        """Return the processor time used so far, s."""
        fields = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def megabytes(self) -> float:
        """Return the resident memory, MB."""
        return int(Path(f"/proc/{self.process.pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def machine_seconds() -> float:
    """Return the processor time used by the whole machine, s."""
    user, nice, system, _, _, interrupts, soft = map(int, Path("/proc/stat").read_text().split()[1:8])
    return (user + nice + system + interrupts + soft) / os.sysconf("SC_CLK_TCK")


@contextmanager
def serving(environment: Mapping[str, str] | None = None) -> Iterator[Server]:
    """Run the app on a free port, its threads sharing freed memory as in ``stereolag app``."""
    port = free_port()
    with served_process(port=port, environment={"MALLOC_ARENA_MAX": "1"} | dict(environment or {})) as process:
        yield Server(process, port)


def own_pair(seed: int, width: int = WIDTH, height: int = HEIGHT, largest: float = 48) -> dict[str, bytes]:
    """Return the files of a textured pair whose disparity rises from 4 px at the left to `largest`."""
    random = np.random.default_rng(seed)
    texture = np.zeros((height, width + int(largest)), dtype=np.float32)
    for cells in (4, 2, 1):
        noise = random.random((-(-height // cells), -(-texture.shape[1] // cells)), dtype=np.float32)
        texture += cv2.resize(noise, texture.shape[::-1], interpolation=cv2.INTER_LINEAR) * (255 / 3)
    scene = np.clip(texture, 0, 255).astype(np.uint8)
    cols, rows = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    left = cv2.cvtColor(np.ascontiguousarray(scene[:, :width]), cv2.COLOR_GRAY2RGB)
    shift = 4 + (largest - 4) * cols / width
    right = cv2.cvtColor(cv2.remap(scene, cols + shift, rows, cv2.INTER_LINEAR), cv2.COLOR_GRAY2RGB)
    encoded = [cv2.imencode(".png", picture, [cv2.IMWRITE_PNG_COMPRESSION, 1])[1] for picture in (left, right)]
    return dict(zip((LEFT, RIGHT), (one.tobytes() for one in encoded), strict=True))


async def with_own_pair(visitor: Visitor, files: dict[str, bytes]) -> None:
    """Upload a pair, and wait for its maps."""
    await visitor.choose(PAIRS, OWN)
    async with visitor.another_map():
        await visitor.upload(files)
    complaints = visitor.complaints()
    if complaints:
        raise RuntimeError(f"the page complains: {complaints[0]}")


async def move_on(visitor: Visitor, windows: Sequence[int], every: float, phase: float = 0) -> None:
    """Move the window slider to each value on schedule, whether or not earlier moves were answered."""
    start = time.perf_counter() + phase
    for number, window in enumerate(windows):
        due = start + number * every
        await asyncio.sleep(max(0, due - time.perf_counter()))
        await visitor.move(WINDOW, window, due)
    await visitor.settled()


def windows_of(moves: int) -> list[int]:
    """Return this many different window sizes, none equal to the initial one."""
    return [window for window in range(9, 102) if window != FIRST_WINDOW][:moves]


def latencies(moves: Sequence[Move]) -> list[float]:
    """Return the latency of every answered move, ms."""
    return [1000 * one.latency for one in moves if one.latency is not None]


async def alone(server: Server, name: str = "alone", *, plain: bool = False) -> Figures:
    """Return the latencies and costs of a single visitor who moves again after each map.

    If `plain`, the visitor undoes the fast preset that is set for uploaded pairs: without checks and finishing, as when
    the first figures were recorded, the cost of the page can be separated from that of the map.
    """
    async with Visitor(server.port) as visitor:
        await with_own_pair(visitor, own_pair(1_000_000))
        if plain:
            await visitor.press_for_map(PLAIN)
        await visitor.move(WINDOW, 101)
        await visitor.settled()
        cpu, start = server.cpu_seconds(), len(visitor.moves)
        received = visitor.received_bytes
        for window in windows_of(ALONE_MOVES):
            await visitor.move(WINDOW, window)
            await visitor.settled()
            await asyncio.sleep(0.2)
        times = latencies(visitor.moves[start:])
        return {
            f"{name}: CPU s a move": round((server.cpu_seconds() - cpu) / ALONE_MOVES, 4),
            f"{name}: kB a move": round((visitor.received_bytes - received) / ALONE_MOVES / 1000, 1),
            **_spread(name, times),
        }


async def together(server: Server, users: int, every: float, moves: int) -> Figures:
    """Return the latencies and costs of this many visitors who all move their sliders."""
    visitors: list[Visitor] = []
    figures: Figures = {}
    try:
        start = time.perf_counter()
        for number in range(users):
            visitors.append(Visitor(server.port))
            await visitors[-1].arrive()
            await with_own_pair(visitors[-1], own_pair(number))
        figures["all there after s"] = round(time.perf_counter() - start, 1)
        figures["RSS with all, before moving, MB"] = round(server.megabytes())
        cpu, ours, machine, start = server.cpu_seconds(), time.process_time(), machine_seconds(), time.perf_counter()
        await asyncio.gather(
            *(
                move_on(visitor, windows_of(moves), every, every * number / users)
                for number, visitor in enumerate(visitors)
            )
        )
        elapsed = time.perf_counter() - start
        cpu, ours, machine = server.cpu_seconds() - cpu, time.process_time() - ours, machine_seconds() - machine
        made = [one for visitor in visitors for one in visitor.moves]
        figures |= _spread("together", latencies(made))
        figures["together: CPU s a move"] = round(cpu / len(made), 4)
        figures["together: cores used"] = round(cpu / elapsed, 2)
        figures["together: cores used by the visitors themselves"] = round(ours / elapsed, 2)
        figures["together: cores used by all else on the machine"] = round((machine - cpu - ours) / elapsed, 2)
        figures["RSS with all, MB"] = round(server.megabytes())
        figures["complaints"] = sum(len(visitor.complaints()) for visitor in visitors)
    finally:
        await asyncio.gather(*(visitor.leave() for visitor in visitors))
    return figures


async def bystander(server: Server, users: int) -> Figures:
    """Return the latencies of a visitor on an example while others run accurate matching on large pairs."""
    visitors = [Visitor(server.port) for _ in range(users)]
    onlooker = Visitor(server.port)
    peak = 0.0
    try:
        for number, visitor in enumerate(visitors):
            await visitor.arrive()
            await with_own_pair(visitor, own_pair(number, LARGE_WIDTH, LARGE_HEIGHT, LARGE_DISPARITIES - 8))
            await visitor.choose("pairs.size", "Full")
            for slider in visitor.keys(DISPARITIES):
                await visitor.slide(slider, LARGE_DISPARITIES)
        await onlooker.arrive()
        await onlooker.choose(PAIRS, samples.stereo_pairs()["road"].title)
        before = server.megabytes()
        start = time.perf_counter()
        jobs = [asyncio.create_task(visitor.press_for_map(ACCURATE)) for visitor in visitors]
        done = asyncio.gather(*jobs, return_exceptions=True)
        windows = windows_of(92)
        while not done.done() and time.perf_counter() - start < BYSTANDER_CAP_S:
            due = start + len(onlooker.moves)
            await asyncio.sleep(max(0, due - time.perf_counter()))
            await onlooker.move(WINDOW, windows[len(onlooker.moves) % len(windows)], due)
            peak = max(peak, server.megabytes())
        elapsed = time.perf_counter() - start
        finished = sum(one.done() for one in jobs)
        for job in jobs:
            job.cancel()
        waiting = sum(one.answered is None for one in onlooker.moves)
    finally:
        await asyncio.gather(*(visitor.leave() for visitor in [*visitors, onlooker]))
    return {
        "bystander: unanswered moves": waiting,
        **_spread("bystander", latencies(onlooker.moves)),
        "heavy: RSS before, MB": round(before),
        "heavy: RSS peak, MB": round(peak),
        "heavy: finished": finished,
        "heavy: s until all were done": round(elapsed, 1),
    }


async def measured(users: int, every: float, moves: int, stay_away: float) -> Figures:
    """Return all figures of the load: one visitor alone, all together, and the memory after they left."""
    with serving() as server:
        async with Visitor(server.port) as first:
            await with_own_pair(first, own_pair(2_000_000))
        await asyncio.sleep(1)
        figures: Figures = {"users": users, "every s": every, "moves each": moves}
        figures["RSS at first, MB"] = round(server.megabytes())
        figures |= await alone(server)
        figures |= await alone(server, "alone, plain settings", plain=True)
        figures |= await together(server, users, every, moves)
        if stay_away:
            await asyncio.sleep(stay_away)
            figures[f"RSS {stay_away:g} s after the last left, MB"] = round(server.megabytes())
        return figures


def load_table(users: int = 20, every: float = 2.0, moves: int = 15, stay_away: float = 60) -> tuple[str, Figures]:
    """Return the load figures as Markdown and as numbers."""
    return _table(asyncio.run(measured(users, every, moves, stay_away)))


def short_load_table(users: int = 20, moves: int = 5) -> str:
    """Return the figures of a shorter load as Markdown, beside those kept in `benchmarks/results`."""
    figures = asyncio.run(measured(users, 2.0, moves, 0))
    kept = json.loads((RESULTS / "load.json").read_text(encoding="utf-8"))["figures"]
    named = [name for name in figures if name.endswith(("p95 ms", "CPU s a move"))]
    lines = ["| load | now | kept |", "|---|---|---|"]
    return "\n".join(lines + [f"| {name} | {figures[name]:g} | {kept.get(name, '')} |" for name in named])


def bystander_table(users: int = 10) -> tuple[str, Figures]:
    """Return the bystander figures as Markdown and as numbers."""

    async def run() -> Figures:
        with serving() as server:
            return {"heavy users": users} | await bystander(server, users)

    return _table(asyncio.run(run()))


def _table(figures: Figures) -> tuple[str, Figures]:
    lines = ["| load | |", "|---|---|"] + [f"| {name} | {value:g} |" for name, value in figures.items()]
    return "\n".join(lines), figures


def _spread(name: str, times: Sequence[float]) -> Figures:
    if not times:
        return {}
    ordered = sorted(times)
    return {
        f"{name}: p50 ms": round(statistics.median(ordered)),
        f"{name}: p95 ms": round(ordered[min(len(ordered) - 1, int(0.95 * len(ordered)))]),
        f"{name}: max ms": round(ordered[-1]),
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.load", description=__doc__)
    parser.add_argument("--users", type=int, help="how many visitors; 20 by default, 10 with --bystander")
    parser.add_argument("--every", type=float, default=2.0, help="seconds between the moves of one visitor")
    parser.add_argument("--moves", type=int, default=15, help="moves of each visitor, at most 92")
    parser.add_argument("--stay-away", type=float, default=60, help="seconds to wait after the last left; 0: none")
    parser.add_argument("--bystander", action="store_true", help="one visitor beside others with heavy work")
    asked = parser.parse_args()
    if asked.bystander:
        table, _ = bystander_table(asked.users or 10)
    else:
        table, _ = load_table(asked.users or 20, asked.every, min(asked.moves, 92), asked.stay_away)
    print(table)


if __name__ == "__main__":
    main()
