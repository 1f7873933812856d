"""Live streams of the app without a browser: maps a second, latency, fairness, and memory."""

from __future__ import annotations

import argparse
import asyncio
import base64
import json
import statistics
import time
from collections import deque
from collections.abc import Callable

import cv2
import numpy as np
from websockets.asyncio.client import connect

from benchmarks.load import PAIRS, WINDOW, Figures, Server, serving, windows_of
from benchmarks.visitors import HOST, Visitor
from stereolag import samples
from stereolag.core.searches import TemplateQuery
from stereolag.figures.pictures import jpeg
from stereolag.io.images import read_image
from stereolag.ui.calibrate_live import FRAMES_TO_AGREE, Shown, Taking
from stereolag.ui.components import packed_item
from stereolag.ui.depth.maps import SHOWN
from stereolag.ui.matcher_controls import preset_key
from stereolag.ui.search.parts import Frame
from stereolag.ui.search.parts import answer as follow
from stereolag.ui.streams import MAX_IN_FLIGHT
from tests.core.moving_patch import frames
from tests.held_boards import obeying
from tests.held_boards import taken as board_pictures

SECONDS = 6.0
PATIENCE_S = 60.0
"""Time for an answer after which a stream fails, s."""

CLIENTS = (0, 1, 2, 4, 8)
"""Numbers of simultaneous streams; with 0 there is only the bystander, whose maps take memory too."""

METHODS = {"fast": "Convolution", "StereoBM": "StereoBM"}
LIVE = "Live camera"
CAMERA = "stereolag.stereo_camera"
ENVIRONMENT = {"STEREOLAG_MAX_LIVE_FPS": "240"}


def frame() -> bytes:
    """Return a frame of a stereo camera: both views of the example, 640 × 480 each, beside each other, as a JPEG."""
    example = samples.stereo_pairs()["cube"]
    both = np.hstack([read_image(example.left), read_image(example.right)])
    return cv2.imencode(".jpg", both[:, :, ::-1], (cv2.IMWRITE_JPEG_QUALITY, 85))[1].tobytes()


async def camera_of(visitor: Visitor, maps: str) -> dict[str, str]:
    """Choose the live camera with the maps of one method, and return the arguments of its component."""
    await visitor.press(preset_key("fast"))
    await visitor.choose(SHOWN, maps)
    await visitor.choose(PAIRS, LIVE)
    parts = [one.bidi_component for _, one in visitor.elements("bidi_component")]
    told: dict[str, str] = next(json.loads(one.json) for one in parts if one.component_name == CAMERA)
    return told


async def stream(
    port: int, told: dict[str, str], seconds: float, in_flight: int = MAX_IN_FLIGHT
) -> list[tuple[float, float]]:
    """Send frames for a while, and return the time and the latency of each answer, s."""
    data, answers = packed_item({}, [frame()]).data, []
    sent: deque[float] = deque()
    address = f"ws://{HOST}:{port}{told['address']}"
    async with connect(address, origin=f"http://{HOST}:{port}", max_size=None) as socket:  # type: ignore[arg-type]
        await socket.send(told["token"])
        end = time.perf_counter() + seconds
        while time.perf_counter() < end:
            while len(sent) < in_flight:
                sent.append(time.perf_counter())
                await socket.send(data)
            if isinstance(await asyncio.wait_for(socket.recv(), PATIENCE_S), bytes):
                now = time.perf_counter()
                answers.append((now, now - sent.popleft()))
    return answers[len(answers) // 4 :]  # the caches are empty for the first answers


async def carried(visitor: Visitor, seconds: float) -> list[tuple[float, float]]:
    """Send frames over Streamlit's own connection for a while, and return the same as :func:`stream`."""
    data, answers = packed_item({}, [frame()]).data, []
    end = time.perf_counter() + seconds
    while (sent := time.perf_counter()) < end:
        message = {"number": len(answers) + 1, "data": base64.b64encode(data).decode()}
        await visitor.trigger("carrier", "message", message)
        now = time.perf_counter()
        answers.append((now, now - sent))
    return answers[len(answers) // 4 :]


def rate(answers: list[tuple[float, float]]) -> float:
    """Return the answers a second."""
    return (len(answers) - 1) / (answers[-1][0] - answers[0][0])


async def alone(server: Server) -> Figures:
    """Return the rates and latencies of one stream for each method, with one and with two frames in flight."""
    figures: Figures = {}
    for name, maps in METHODS.items():
        async with Visitor(server.port) as visitor:
            told = await camera_of(visitor, maps)
            for in_flight in (1, MAX_IN_FLIGHT):
                answers = await stream(server.port, told, SECONDS, in_flight)
                title = f"{name}, {in_flight} in flight"
                figures[f"{title}: maps a second"] = round(rate(answers), 1)
                figures[f"{title}: latency, median ms"] = round(1000 * statistics.median(one for _, one in answers))
            title = f"{name}, over Streamlit's own connection"
            answers = await carried(visitor, SECONDS)
            figures[f"{title}: maps a second"] = round(rate(answers), 1)
            figures[f"{title}: latency, median ms"] = round(1000 * statistics.median(one for _, one in answers))
    return figures


async def together(server: Server, count: int) -> Figures:
    """Return the rates of several streams, and how long a visitor of an example meanwhile waits after slider moves."""
    visitors, bystander = [Visitor(server.port) for _ in range(count)], Visitor(server.port)
    try:
        told = []
        for visitor in visitors:
            await visitor.arrive()
            told.append(await camera_of(visitor, METHODS["fast"]))
        await bystander.arrive()
        streams = asyncio.gather(*(stream(server.port, one, SECONDS + 2) for one in told))
        for window in windows_of(12):
            await asyncio.sleep(0.5)
            await bystander.move(WINDOW, window)
        rates = [rate(one) for one in await streams]
        await bystander.settled()
        waits = sorted(one.latency or 0 for one in bystander.moves)
    finally:
        await asyncio.gather(*(visitor.leave() for visitor in [*visitors, bystander]))
    shares = {"least": min(rates), "most": max(rates)} if rates else {}
    return {
        **{f"{count} streams: maps a second each, {name}": round(share, 1) for name, share in shares.items()},
        f"{count} streams: bystander p95 ms": round(1000 * waits[int(0.95 * (len(waits) - 1))]),
        f"{count} streams: RSS MB": round(server.megabytes()),
    }


async def measured(minutes: float) -> Figures:
    """Return all figures."""
    with serving(ENVIRONMENT) as server:
        figures = await alone(server)
        for count in CLIENTS:
            figures |= await together(server, count)
        if minutes:
            async with Visitor(server.port) as visitor:
                told = await camera_of(visitor, METHODS["fast"])
                await stream(server.port, told, 60)
                figures["long stream: RSS after 1 min, MB"] = round(server.megabytes())
                await stream(server.port, told, 60 * (minutes - 1))
                figures[f"long stream: RSS after {minutes:g} min, MB"] = round(server.megabytes())
        return figures


def following_ms() -> list[float]:
    """Return the processor time of the answer to each frame of a moving sign, ms."""
    side, kept, took = 64, {}, []
    for number, one in enumerate(frames(1, rows=480, cols=640, side=side)):
        row, col = (round(at - side / 2) for at in one.middle)
        box = None if number else {"row": row, "col": col, "height": side, "width": side}
        message = Frame(parts=(jpeg(one.picture),), number=number, box=box)
        took.append(processor_ms(lambda message=message: follow(kept, TemplateQuery(), message)))
    return took[1:]


def calibrating_ms() -> list[float]:
    """Return the processor time of the answer to each frame with a board in both views, ms."""
    taking, took = Taking(), []
    for _, poses in obeying(4):
        views = [cv2.resize(view, (640, 480), interpolation=cv2.INTER_CUBIC) for view in board_pictures(poses)]
        shown = (jpeg(np.hstack(views)),)
        for _ in range(4):
            message = Shown(parts=shown, at=100.0 * len(took))
            took.append(processor_ms(lambda message=message: taking.answer(message)))
    return took[FRAMES_TO_AGREE:]  # until then the kind of board is not known


def processor_ms(act: Callable[[], object]) -> float:
    """Return the processor time of a call, ms: elapsed time would depend on other processes."""
    start = time.process_time()
    act()
    return 1000 * (time.process_time() - start)


def answering() -> Figures:
    """Return the processor times of the answers to messages of the pages without maps."""
    return {
        f"{name}: CPU of a frame, {share} ms": round(float(np.quantile(took, at)), 1)
        for name, took in (("following", following_ms()), ("calibrating", calibrating_ms()))
        for share, at in (("median", 0.5), ("p90", 0.9))
    }


def live_table(minutes: float = 10) -> tuple[str, Figures]:
    """Return the figures of live streams as Markdown and as numbers."""
    figures = answering() | asyncio.run(measured(minutes))
    lines = ["| live, two views of 640 × 480 | |", "|---|---|"] + [
        f"| {name} | {one:g} |" for name, one in figures.items()
    ]
    return "\n".join(lines), figures


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.live", description=__doc__)
    parser.add_argument("--minutes", type=float, default=0, help="length of a long stream, whose memory is measured")
    print(live_table(parser.parse_args().minutes)[0])


if __name__ == "__main__":
    main()
