"""Live streams: messages from a browser's camera or microphones, answered one by one over a websocket.

A page opens a stream in each of its runs, with the function that answers. Its component sends messages packed as items,
at most :data:`MAX_IN_FLIGHT` at a time, so that the newest is always on its way. Since each run brings a new function,
a moved control acts on the next message, and nothing is mounted again. The websocket is a route of the app beside
Streamlit's own, so a message takes no script run. If no such socket opens, because the app was started without its
routes or a proxy lets only Streamlit's through, messages come one at a time over Streamlit's connection, each with a
run of a fragment: slower, but otherwise the same.
"""

from __future__ import annotations

import asyncio
import json
import math
import secrets
import threading
import time
import weakref
from collections.abc import Callable, Coroutine, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, TypeVar
from urllib.parse import urlsplit

import streamlit as st
from pydantic import Base64Bytes, BaseModel, ConfigDict, Field
from starlette.routing import BaseRoute, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect
from websockets.server import ServerProtocol

from stereolag.core.inputs import Image
from stereolag.core.jobs import limits
from stereolag.io.guard import guarded
from stereolag.io.images import read_camera_frame
from stereolag.loops.bands import available_cores
from stereolag.ui.background_jobs import POLL_INTERVAL_S, Limiter
from stereolag.ui.components import component, packed_item
from stereolag.ui.navigation import fragment
from stereolag.ui.sentences import LIVE_WORDS

PATH = "/live"

MAX_IN_FLIGHT = 2
"""Number of messages that the browser sends before the first of them is answered."""

MAX_HEADER_BYTES = 65_536
"""Limit for the header of a message, bytes."""

MAX_WAITING_PER_PLACE = 4
"""Number of streams that may wait, for each place."""

MAX_IDLE_S = 3.0
"""Time without a message after which a stream loses its place, s: its visitor is gone, or looks at another tab."""

TOKEN_TIMEOUT_S = 5.0
"""Time within which a new connection must send its token, s."""

SECONDS_PER_MINUTE = 60.0

# Codes with which a stream is closed; the component explains them by `LIVE_WORDS`. 1009 is the server's own.
TOO_LARGE = 1009
MALFORMED = 4400
WRONG_TOKEN = 4401
TOO_LONG = 4408
FLOOD = 4429
FULL = 4503

T = TypeVar("T")


Whole = Annotated[int, Field(ge=0, le=2**53)]
"""A whole number that JavaScript represents exactly."""


class Message(BaseModel):
    """A message of a browser: the fields of its header, and its parts in bytes.

    Each page declares the fields of its messages; a stream that sends anything else is ended.
    """

    model_config = ConfigDict(strict=True, allow_inf_nan=False)

    parts: tuple[bytes, ...]


M = TypeVar("M", bound=Message)


class _Carried(BaseModel):
    """A message that came over Streamlit's own connection, with the number that identifies its answer."""

    number: Whole
    data: Base64Bytes


class _Header(BaseModel):
    """A header as it is sent, with the start and length of each part after it."""

    model_config = ConfigDict(strict=True, extra="allow")

    parts: list[tuple[int, int]]


class Stream:
    """A stream of one visitor, whether or not it is running, and whichever way its messages come.

    Attributes
    ----------
    name
        Distinguishes it from the visitor's other streams.
    token
        Proves that a connection belongs to the visitor; known only to the page.
    kind
        Type of its messages.
    answer
        Takes a message, and returns a packed item. It runs in a thread without a session, one message at a time;
        a ValueError is answered with its text.
    kept
        State that the answers need from one message to the next.
    brief
        Whether its messages are so few that it needs no place.
    carried
        The last answer to a message that came over Streamlit's own connection, delivered to the browser: the token,
        the number of the message, and either the answer or the code with which the stream ends.
    """

    def __init__(self, name: str, kind: type[Message], answer: Callable[[Any], bytes], brief: bool = False) -> None:
        self.name = name
        self.brief = brief
        self.token = secrets.token_urlsafe(32)
        self.kind = kind
        self.answer = answer
        self.kept: dict[str, Any] = {}
        self.connection: object = None
        self._number = 0
        self._began = self._last = -math.inf
        self._leaving: threading.Timer | None = None
        self.carried = self._packed()

    def answered(self, message: Message) -> bytes:
        """Return the answer to a message, or why there is none."""
        try:
            return self.answer(message)
        except ValueError as error:
            return packed_item({"error": str(error), "digest": "error"}).data

    def take(self, sent: object) -> None:
        """Answer a message that the browser sent over Streamlit's connection, unless it repeats the last one.

        Messages come one at a time, each with a run of a fragment.
        """
        now = time.monotonic()
        if now - self._last > MAX_IDLE_S:
            self._began = now
        self._last = now
        try:
            carried = _Carried.model_validate(sent)
            if carried.number == self._number:
                return
            self._number = carried.number
            message = _checked_message(carried.data, self.kind)
            if now - self._began > SECONDS_PER_MINUTE * limits().max_live_minutes:
                raise _Closed(TOO_LONG)
            self._keep_place()
            self.carried = self._packed(self.answered(message))
        except ValueError:
            self.carried = self._packed(end=MALFORMED)
        except _Closed as closed:
            self.carried = self._packed(end=closed.code)
            self._last = -math.inf  # the next message begins a new stream

    def _packed(self, *parts: bytes, **more: int) -> bytes:
        return packed_item({"kind": "carrier", "name": self.token, "number": self._number, **more}, parts).data

    def _keep_place(self) -> None:
        """Take or keep a place for ``MAX_IDLE_S`` from now; end the stream if there is none."""
        places = _places()
        if self._leaving is not None:
            self._leaving.cancel()
        if not places.admit(self.token):
            places.release(self.token)
            raise _Closed(FULL)
        self._leaving = threading.Timer(MAX_IDLE_S, places.release, (self.token,))
        self._leaving.daemon = True
        self._leaving.start()


_streams: weakref.WeakValueDictionary[str, Stream] = weakref.WeakValueDictionary()
"""All streams by token; each lives as long as its visitor's session."""

_mounted: list[BaseRoute] = []


def open_stream(name: str, kind: type[M], answer: Callable[[M], bytes] | None = None, *, brief: bool = False) -> Stream:
    """Return the visitor's stream of this name; from now on `answer`, if given, answers its messages."""
    stream: Stream = st.session_state.setdefault(f"live.{name}", Stream(name, kind, _not_ready, brief))
    stream.answer = answer or stream.answer
    _streams[stream.token] = stream
    return stream


def close_stream(name: str) -> None:
    """Forget the visitor's stream of this name, with the state that its answers kept."""
    st.session_state.pop(f"live.{name}", None)


def connected(stream: Stream, words: Mapping[str, Any]) -> dict[str, Any]:
    """Return the part of a component's data that ``web/shared/live.js`` needs to send messages to a stream.

    `words` are the texts of its panel, which extend or replace those common to all live panels. Also mount the carrier
    of messages for when no socket opens.
    """
    _mount_carrier(stream)
    return {**address_of(stream), "words": LIVE_WORDS | {**words}}


def address_of(stream: Stream) -> dict[str, Any]:
    """Return the data with which ``web/shared/socket.js`` opens the socket of a stream; no address without routes."""
    base = st.get_option("server.baseUrlPath").strip("/")
    path = f"/{base}{PATH}" if base else PATH
    return {"address": path if _mounted else None, "token": stream.token}


@fragment
def _mount_carrier(stream: Stream) -> None:
    key = f"live.{stream.name}.carrier"
    component("delivery")(
        key=key,
        data=stream.carried,
        on_message_change=lambda: stream.take(st.session_state[key].message),
    )


def _not_ready(message: Message) -> bytes:
    raise ValueError("The page is not ready yet.")


def routes() -> list[BaseRoute]:
    """Return the routes that the app needs for streams; without them, messages come over Streamlit's connection."""
    _mounted[:] = [WebSocketRoute(PATH, _serve)]
    return _mounted


def frame(jpeg: bytes, *, grey: bool = False) -> Image:
    """Return a camera frame sent by a browser: (rows, cols, 3) uint8, or (rows, cols) if `grey`, which is faster.

    Raises
    ------
    ValueError
        Not a JPEG, or one with more pixels than a live frame may have.
    """
    return guarded(read_camera_frame)(jpeg, limits().max_live_megapixels * 1_000_000, grey=grey)


@cache
def _places() -> Limiter:
    """Return the places of running streams."""
    return Limiter(0, limits().max_live_streams)


@cache
def _pool() -> ThreadPoolExecutor:
    # First come, first served, and one message of a stream at a time, so every visitor gets the same share.
    return ThreadPoolExecutor(available_cores(), thread_name_prefix="live")


@dataclass(eq=False)
class _Closed(Exception):  # noqa: N818
    """The stream ends, with the code that tells the browser why."""

    code: int


def is_own_page(headers: Mapping[str, str]) -> bool:
    """Return whether a request comes from a page of this app, by the origin that browsers send."""
    origin, host = headers.get("origin"), headers.get("host")
    return bool(origin and host) and urlsplit(origin).netloc == host


def parse_message(data: bytes, kind: type[M]) -> M:
    """Return a message of this type from its bytes, as :func:`.packed_item` packs them.

    Raises
    ------
    ValueError
        Anything else.
    """
    length = int.from_bytes(data[:4], "little")
    if not 2 <= length <= min(MAX_HEADER_BYTES, len(data) - 4):
        raise ValueError("The message has no header.")
    header = _Header.model_validate_json(data[4 : 4 + length])
    body = memoryview(data)[4 + length :]
    if any(not 0 <= start <= start + size <= len(body) for start, size in header.parts):
        raise ValueError("The parts are not where the header says.")
    if sum(size for _, size in header.parts) > len(body):
        raise ValueError("The parts overlap.")
    parts = tuple(bytes(body[start : start + size]) for start, size in header.parts)
    return kind.model_validate({**(header.model_extra or {}), "parts": parts})


def _checked_message(data: bytes, kind: type[M]) -> M:
    """Return a message of this type; end the stream if it is too large or malformed."""
    if len(data) > limits().max_live_message_mb * 2**20:
        raise _Closed(TOO_LARGE)
    try:
        return parse_message(data, kind)
    except ValueError:
        raise _Closed(MALFORMED) from None


def _refuse_early(socket: WebSocket, max_bytes: int) -> None:
    """Have the server refuse a larger message as soon as it is announced, before any of it is stored.

    By default, it does so only beyond the maximum size of Streamlit's messages, far larger than any frame. A route
    cannot lower that, so this finds the connection behind the route. Other servers store such a message until read.
    """
    connection = getattr(getattr(socket._receive, "__self__", None), "conn", None)
    if isinstance(connection, ServerProtocol):
        connection.max_message_size = max_bytes


async def _serve(socket: WebSocket) -> None:
    """Serve one connection: its first message is the token of a stream, and all others are answered."""
    if not is_own_page(socket.headers):
        await socket.close()
        return
    # Twice the limit: the browser learns from the code TOO_LARGE only once the whole frame has arrived.
    _refuse_early(socket, 2 * limits().max_live_message_mb * 2**20)
    await socket.accept()
    with suppress(WebSocketDisconnect, RuntimeError):  # RuntimeError: sent to a browser that has just gone
        try:
            await _answer_all(socket, await _stream_of(socket))
        except _Closed as end:
            await socket.close(end.code)


async def _stream_of(socket: WebSocket) -> Stream:
    """Return the stream whose token is the first message of a connection."""
    try:
        first = await asyncio.wait_for(socket.receive(), TOKEN_TIMEOUT_S)
    except TimeoutError:
        raise _Closed(WRONG_TOKEN) from None
    stream = _streams.get(first.get("text") or "")
    if stream is None:
        raise _Closed(WRONG_TOKEN)
    return stream


async def _answer_all(socket: WebSocket, stream: Stream) -> None:
    allowed = limits()
    stream.connection = connection = object()  # a later connection of the same stream ends this one
    arrived: asyncio.Queue[Message] = asyncio.Queue(2 * MAX_IN_FLIGHT)
    receiving = asyncio.create_task(_receive(socket, stream, arrived))
    places = _places()
    end = time.monotonic() + SECONDS_PER_MINUTE * allowed.max_live_minutes
    try:
        while (remaining_s := end - time.monotonic()) > 0:
            try:
                message = await _unless_over(receiving, arrived.get(), min(MAX_IDLE_S, remaining_s))
            except TimeoutError:
                places.release(connection)
                continue
            if stream.connection is not connection:
                raise _Closed(WRONG_TOKEN)
            if not (stream.brief or places.holds(connection)):
                try:
                    await _unless_over(receiving, _wait_for_place(socket, connection), remaining_s)
                except TimeoutError:
                    break
                await _send_state(socket, "running", 0)
            started = time.monotonic()
            answer = await asyncio.get_running_loop().run_in_executor(_pool(), stream.answered, message)
            await socket.send_bytes(answer)
            await asyncio.sleep(max(0.0, started + 1 / allowed.max_live_fps - time.monotonic()))
        raise _Closed(TOO_LONG)
    finally:
        receiving.cancel()
        places.release(connection)


async def _wait_for_place(socket: WebSocket, connection: object) -> None:
    """Wait for a place; tell the browser its position in the queue, initially and whenever that changes."""
    places, reported = _places(), 0
    while not places.admit(connection):
        position = places.turn(connection)
        if position > MAX_WAITING_PER_PLACE * limits().max_live_streams:
            raise _Closed(FULL)
        if position != reported:
            await _send_state(socket, "waiting", position)
            reported = position
        await asyncio.sleep(POLL_INTERVAL_S)


async def _unless_over(receiving: asyncio.Task[None], waiting: Coroutine[Any, Any, T], timeout: float) -> T:
    """Return the result of `waiting`; raise the end of `receiving` if that comes first, or TimeoutError."""
    task = asyncio.create_task(waiting)
    try:
        done, _ = await asyncio.wait([task, receiving], timeout=timeout, return_when=asyncio.FIRST_COMPLETED)
        if receiving in done:
            receiving.result()
        if not done:
            raise TimeoutError
        return await task
    finally:
        task.cancel()


async def _receive(socket: WebSocket, stream: Stream, arrived: asyncio.Queue[Message]) -> None:
    """Put all messages of a connection into a queue until the browser ends it or breaks a rule."""
    while True:
        received = await socket.receive()
        if received["type"] == "websocket.disconnect":
            raise WebSocketDisconnect(received.get("code", 1000))
        try:
            arrived.put_nowait(_checked_message(received.get("bytes") or b"", stream.kind))
        except asyncio.QueueFull:
            raise _Closed(FLOOD) from None


async def _send_state(socket: WebSocket, state: str, ahead: int) -> None:
    await socket.send_text(json.dumps({"state": state, "ahead": ahead}))
