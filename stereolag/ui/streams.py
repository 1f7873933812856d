"""Live streams: messages from a browser's camera or microphones, answered one by one over a websocket.

A page opens a stream in each of its runs, with the function that answers; its component sends messages packed as items,
at most :data:`IN_FLIGHT` at a time, so that the newest is always on its way. Since each run brings a new function, a
moved control acts on the next message, and nothing is mounted again. The websocket is a route of the app beside
Streamlit's own: a message takes no run of a script. Where no such socket opens, since the app was started without its
routes or a proxy lets only Streamlit's through, messages come one at a time over Streamlit's, each with a run of a
fragment: slower, and otherwise the same.
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
from stereolag.ui.background_jobs import LOOKS_S, Limiter
from stereolag.ui.components import component, packed_item
from stereolag.ui.navigation import fragment
from stereolag.ui.sentences import LIVE_WORDS

PATH = "/live"
IN_FLIGHT = 2
"""Messages that the browser sends before the first of them is answered."""
HEADER_BYTES = 65_536
QUEUE_PER_PLACE = 4
"""Streams that may wait for each place there is."""
IDLE_S = 3.0
"""A stream that sends nothing for so long gives its place to the next: its visitor is gone, or looks at another tab."""
GREETING_S = 5.0
SECONDS_PER_MINUTE = 60.0

WRONG_TOKEN, MALFORMED, TOO_LARGE, FLOOD, TOO_LONG, FULL = 4401, 4400, 1009, 4429, 4408, 4503
"""Codes with which a stream is closed; the component explains them by :data:`LIVE_WORDS`. The server's own is 1009."""

T = TypeVar("T")


Whole = Annotated[int, Field(ge=0, le=2**53)]
"""A number that a browser counts with."""


class Message(BaseModel):
    """A message of a browser: the fields of its header, and its parts in bytes.

    A page declares what its own ones hold; a stream that sends anything else is ended.
    """

    model_config = ConfigDict(strict=True, allow_inf_nan=False)

    parts: tuple[bytes, ...]


M = TypeVar("M", bound=Message)


class _Carried(BaseModel):
    """A message that came over Streamlit's own connection, with the number by which its answer is known."""

    number: Whole
    data: Base64Bytes


class _Places(BaseModel):
    """A header as it is sent: where the parts begin after it, and how long each is."""

    model_config = ConfigDict(strict=True, extra="allow")

    parts: list[tuple[int, int]]


class Stream:
    """A stream of one visitor, whether or not it is running, by whichever way its messages come.

    Attributes
    ----------
    name
        Tells it from the visitor's others.
    token
        Proves that a connection belongs to the visitor; known to the page alone.
    kind
        What its messages hold.
    answer
        Takes a message, and returns a packed item. It runs in a thread without a session, one message at a time;
        a ValueError is answered with its text.
    kept
        Whatever the answers need from one message to the next.
    brief
        Whether its messages are few, so that it takes no place of a camera.
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
        """Return the answer to a message, or the sentence that says why there is none."""
        try:
            return self.answer(message)
        except ValueError as error:
            return packed_item({"error": str(error), "digest": "error"}).data

    def take(self, sent: object) -> None:
        """Answer a message that the browser sent over Streamlit's connection, unless it is the last one once more.

        They come one at a time; each is one run of a fragment.
        """
        most, now = limits(), time.monotonic()
        if now - self._last > IDLE_S:
            self._began = now
        self._last = now
        try:
            carried = _Carried.model_validate(sent)
            if carried.number == self._number:
                return
            self._number = carried.number
            message = _taken(carried.data, self.kind)
            if now - self._began > SECONDS_PER_MINUTE * most.max_live_minutes:
                raise _Closed(TOO_LONG)
            self._keep_place()
            self.carried = self._packed(self.answered(message))
        except ValueError:
            self.carried = self._packed(end=MALFORMED)
        except _Closed as closed:
            self.carried = self._packed(end=closed.code)
            self._last = -math.inf  # the next message begins a stream of its own

    def _packed(self, *parts: bytes, **more: int) -> bytes:
        return packed_item({"kind": "carrier", "name": self.token, "number": self._number, **more}, parts).data

    def _keep_place(self) -> None:
        """Take a place of a running stream, or keep it, for ``IDLE_S`` from now; end the stream if there is none."""
        places = _places()
        if self._leaving is not None:
            self._leaving.cancel()
        if not places.admit(self.token):
            places.release(self.token)
            raise _Closed(FULL)
        self._leaving = threading.Timer(IDLE_S, places.release, (self.token,))
        self._leaving.daemon = True
        self._leaving.start()


_streams: weakref.WeakValueDictionary[str, Stream] = weakref.WeakValueDictionary()
"""All streams by their tokens; each lives as long as the session of its visitor."""

_mounted: list[BaseRoute] = []


def open_stream(name: str, kind: type[M], answer: Callable[[M], bytes] | None = None, *, brief: bool = False) -> Stream:
    """Return the visitor's stream of a name; `answer` answers its messages, of a kind, from now on, if given."""
    stream: Stream = st.session_state.setdefault(f"live.{name}", Stream(name, kind, _not_ready, brief))
    stream.answer = answer or stream.answer
    _streams[stream.token] = stream
    return stream


def close_stream(name: str) -> None:
    """Forget the visitor's stream of a name, with all that its answers would need."""
    st.session_state.pop(f"live.{name}", None)


def connected(stream: Stream, words: Mapping[str, Any]) -> dict[str, Any]:
    """Return the part of a component's data that ``web/shared/live.js`` needs to send messages to a stream.

    `words` are those of its panel, beside or in place of those of every live panel. Beside the component, it mounts the
    way by which messages come where no socket opens.
    """
    _mount_carrier(stream)
    return {**address_of(stream), "words": LIVE_WORDS | {**words}}


def address_of(stream: Stream) -> dict[str, Any]:
    """Return what ``web/shared/socket.js`` needs to open the socket of a stream; no address if there are none."""
    base = st.get_option("server.baseUrlPath").strip("/")
    path = f"/{base}{PATH}" if base else PATH
    return {"address": path if _mounted else None, "token": stream.token}


@fragment
def _mount_carrier(stream: Stream) -> None:
    key = f"live.{stream.name}.carrier"

    def take() -> None:
        stream.take(st.session_state[key].message)

    component("delivery")(key=key, data=stream.carried, on_message_change=take)


def _not_ready(message: Message) -> bytes:
    raise ValueError("The page is not ready yet.")


def routes() -> list[BaseRoute]:
    """Return the routes that the app needs for streams; pages without them say that there is nothing live."""
    _mounted[:] = [WebSocketRoute(PATH, _serve)]
    return _mounted


def frame(jpeg: bytes, *, grey: bool = False) -> Image:
    """Return a frame that a camera's browser sent: (rows, cols, 3) uint8, or (rows, cols) if `grey`, which is faster.

    Raises
    ------
    ValueError
        Not a JPEG, or one of more pixels than a live frame may have.
    """
    return guarded(read_camera_frame)(jpeg, limits().max_live_megapixels * 1_000_000, grey=grey)


@cache
def _places() -> Limiter:
    """Return the places of running streams."""
    return Limiter(0, limits().max_live_streams)


@cache
def _pool() -> ThreadPoolExecutor:
    # First come, first served, and one message of a stream at a time: everybody has the same share.
    return ThreadPoolExecutor(available_cores(), thread_name_prefix="live")


class _Closed(Exception):  # noqa: N818
    """The stream ends, with the code that tells the browser why."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


def is_own_page(headers: Mapping[str, str]) -> bool:
    """Return whether a request comes from a page of this app: browsers name the origin of the page that connects."""
    origin, host = headers.get("origin"), headers.get("host")
    return bool(origin and host) and urlsplit(origin).netloc == host


def parse_message(data: bytes, kind: type[M]) -> M:
    """Return a message of a kind, packed as :func:`.packed_item` packs one.

    Raises
    ------
    ValueError
        Anything else.
    """
    length = int.from_bytes(data[:4], "little")
    if not 2 <= length <= min(HEADER_BYTES, len(data) - 4):
        raise ValueError("The message has no header.")
    header = _Places.model_validate_json(data[4 : 4 + length])
    body = memoryview(data)[4 + length :]
    if any(not 0 <= start <= start + size <= len(body) for start, size in header.parts):
        raise ValueError("The parts are not where the header says.")
    if sum(size for _, size in header.parts) > len(body):
        raise ValueError("The parts overlap.")
    parts = tuple(bytes(body[start : start + size]) for start, size in header.parts)
    return kind.model_validate({**(header.model_extra or {}), "parts": parts})


def _taken(data: bytes, kind: type[M]) -> M:
    """Return a message of a kind, unless it is larger than allowed or anything else, which ends its stream."""
    if len(data) > limits().max_live_message_mb * 2**20:
        raise _Closed(TOO_LARGE)
    try:
        return parse_message(data, kind)
    except ValueError:
        raise _Closed(MALFORMED) from None


def _refuse_early(socket: WebSocket, most_bytes: int) -> None:
    """Have the server refuse a larger message as soon as it is announced, before any of it is kept.

    It does so only beyond the size of a message of Streamlit, which is much more than any frame, and a route has no way
    to say less: this finds the connection behind the route. Another server would keep such a message until it is read.
    """
    connection = getattr(getattr(socket._receive, "__self__", None), "conn", None)
    if isinstance(connection, ServerProtocol):
        connection.max_message_size = most_bytes


async def _serve(socket: WebSocket) -> None:
    """Serve one connection: its first message is the token of a stream, all others are to be answered."""
    if not is_own_page(socket.headers):
        await socket.close()
        return
    # A browser is told by its code that a frame is too large only once the whole frame has come.
    _refuse_early(socket, 2 * limits().max_live_message_mb * 2**20)
    await socket.accept()
    with suppress(WebSocketDisconnect, RuntimeError):  # RuntimeError: sent to a browser that has just gone
        try:
            await _answer_all(socket, await _greeted(socket))
        except _Closed as end:
            await socket.close(end.code)


async def _greeted(socket: WebSocket) -> Stream:
    try:
        first = await asyncio.wait_for(socket.receive(), GREETING_S)
    except TimeoutError:
        raise _Closed(WRONG_TOKEN) from None
    stream = _streams.get(first.get("text") or "")
    if stream is None:
        raise _Closed(WRONG_TOKEN)
    return stream


async def _answer_all(socket: WebSocket, stream: Stream) -> None:
    most = limits()
    stream.connection = connection = object()  # a later connection of the same stream ends this one
    arrived: asyncio.Queue[Message] = asyncio.Queue(2 * IN_FLIGHT)
    receiving = asyncio.create_task(_receive(socket, stream, arrived))
    places = _places()
    end = time.monotonic() + SECONDS_PER_MINUTE * most.max_live_minutes
    try:
        while (left := end - time.monotonic()) > 0:
            try:
                message = await _unless_over(receiving, arrived.get(), min(IDLE_S, left))
            except TimeoutError:
                places.release(connection)
                continue
            if stream.connection is not connection:
                raise _Closed(WRONG_TOKEN)
            if not (stream.brief or places.holds(connection)):
                try:
                    await _unless_over(receiving, _wait_for_place(socket, connection), left)
                except TimeoutError:
                    break
                await _say(socket, "running", 0)
            started = time.monotonic()
            answer = await asyncio.get_running_loop().run_in_executor(_pool(), stream.answered, message)
            await socket.send_bytes(answer)
            await asyncio.sleep(max(0.0, started + 1 / most.max_live_fps - time.monotonic()))
        raise _Closed(TOO_LONG)
    finally:
        receiving.cancel()
        places.release(connection)


async def _wait_for_place(socket: WebSocket, connection: object) -> None:
    """Wait for a place; tell the browser how many streams are ahead, at first and whenever that changes."""
    places, told = _places(), 0
    while not places.admit(connection):
        ahead = places.turn(connection)
        if ahead > QUEUE_PER_PLACE * limits().max_live_streams:
            raise _Closed(FULL)
        if ahead != told:
            await _say(socket, "waiting", ahead)
            told = ahead
        await asyncio.sleep(LOOKS_S)


async def _unless_over(receiving: asyncio.Task[None], waiting: Coroutine[Any, Any, T], timeout: float) -> T:
    """Return the result of waiting; raise what ended receiving if that is first, TimeoutError if both take longer."""
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
    """Put all messages of a connection into a queue until the browser ends it, or breaks a rule."""
    while True:
        received = await socket.receive()
        if received["type"] == "websocket.disconnect":
            raise WebSocketDisconnect(received.get("code", 1000))
        data = received.get("bytes")
        try:
            arrived.put_nowait(_taken(data or b"", stream.kind))
        except asyncio.QueueFull:
            raise _Closed(FLOOD) from None


async def _say(socket: WebSocket, state: str, ahead: int) -> None:
    await socket.send_text(json.dumps({"state": state, "ahead": ahead}))
