"""Live streams over a real websocket, without a page: answers, places, and messages that break the rules."""

import base64
import io
import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from typing import Any

import numpy as np
import pytest
import uvicorn
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from starlette.applications import Starlette
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from stereolag import StereoBM, preset
from stereolag.core.jobs import limits, set_defaults
from stereolag.core.searches import TemplateQuery
from stereolag.ui import calibrate_live, streams
from stereolag.ui.components import packed_item
from stereolag.ui.depth import live as depth
from stereolag.ui.driving import inputs as driving
from stereolag.ui.lag import inputs as lag
from stereolag.ui.search import parts as following
from stereolag.ui.streams import PATH, Message, Stream, frame, is_own_page, parse_message
from tests.browser.serving import free_port
from tests.packed import unpacked

PATIENCE_S = 30


class Numbered(Message):
    number: int = 0


class Anything(Message, extra="allow"):
    """A message with any header."""


def echo(message: Numbered) -> bytes:
    return packed_item({"number": message.number}, message.parts).data


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    """Serve the route of streams alone."""
    port = free_port()
    app = Starlette(routes=streams.routes())
    server = uvicorn.Server(uvicorn.Config(app, port=port, log_level="error", ws="websockets-sansio"))
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    while not server.started:
        time.sleep(0.01)
    yield port
    server.should_exit = True
    thread.join()


@pytest.fixture
def open_stream(port: int) -> Iterator[Callable[..., tuple[Stream, ClientConnection]]]:
    """Return a function that makes a stream and connects to it."""
    kept: list[Stream] = []
    open_sockets = ExitStack()

    def opened(answer: Callable[[Numbered], bytes] = echo, brief: bool = False) -> tuple[Stream, ClientConnection]:
        stream = Stream("test", Numbered, answer, brief)
        streams._streams[stream.token] = stream
        kept.append(stream)
        socket = open_sockets.enter_context(connected(port))
        socket.send(stream.token)
        return stream, socket

    with open_sockets:
        yield opened


def connected(port: int, origin: str | None = None) -> connect:
    own = origin or f"http://localhost:{port}"
    return connect(f"ws://localhost:{port}{PATH}", origin=own, proxy=None, max_size=None)  # type: ignore[arg-type]


@contextmanager
def limited(**values: int) -> Iterator[None]:
    """Set limits for a while, and begin with all places free."""
    before = limits()
    set_defaults(**values)
    streams._places.cache_clear()
    yield
    set_defaults(**{name: getattr(before, name) for name in values})
    streams._places.cache_clear()


def told(socket: ClientConnection) -> dict[str, Any]:
    """Return the header of the next answer, or the next state."""
    received = socket.recv(timeout=PATIENCE_S)
    return json.loads(received) if isinstance(received, str) else unpacked(received)[0]


def next_answer(socket: ClientConnection) -> dict[str, Any]:
    received = told(socket)
    while "state" in received:
        received = told(socket)
    return received


def send(socket: ClientConnection, number: int = 0) -> None:
    socket.send(packed_item({"number": number}).data)


def number_answered(socket: ClientConnection, number: int) -> Any:
    """Send a number, and return the one that is answered."""
    send(socket, number)
    return next_answer(socket)["number"]


def code_of_end(socket: ClientConnection, *messages: Any) -> int:
    """Code a connection is closed with once it has sent these messages, or as many as it could before it was."""
    with pytest.raises(ConnectionClosed) as ended:
        for message in messages:
            socket.send(message)
        while True:
            socket.recv(timeout=PATIENCE_S)
    assert ended.value.rcvd is not None
    return ended.value.rcvd.code


@given(st.dictionaries(st.text(), st.integers() | st.text()), st.lists(st.binary()))
def test_a_message_is_read_as_it_was_packed(header: dict[str, Any], parts: list[bytes]) -> None:
    header = {name: value for name, value in header.items() if name not in ("parts", "digest")}
    message = parse_message(packed_item(header, parts).data, Anything)
    assert {**(message.model_extra or {}), "digest": ""} == {**header, "digest": ""}
    assert message.parts == tuple(parts)


def with_header(header: bytes, rest: bytes = b"") -> bytes:
    return len(header).to_bytes(4, "little") + header + rest


@given(st.binary() | st.builds(with_header, st.binary(min_size=2)))
def test_garbage_is_refused(garbage: bytes) -> None:
    with pytest.raises(ValueError):
        parse_message(garbage, Anything)


@pytest.mark.parametrize(
    "header",
    [f'{{"parts": {parts}}}' for parts in ("[[0,9]]", "[[-1,1]]", "[1]", "7", "null", '[["a",1]]', "[[1e999,1]]")]
    + ['{"parts": [[0,8],[0,8]]}', "[" * 60_000],  # as many copies as a header has room for; deeper than a stack
)
def test_parts_that_are_not_there_are_refused(header: str) -> None:
    with pytest.raises(ValueError):
        parse_message(with_header(header.encode(), bytes(8)), Anything)


def as_jpeg(rows: int, cols: int) -> bytes:
    file = io.BytesIO()
    Image.fromarray(np.random.default_rng(0).integers(0, 256, (rows, cols, 3), dtype=np.uint8)).save(file, "JPEG")
    return file.getvalue()


def answering_pages() -> dict[str, tuple[type[Message], Callable[[Any], bytes]]]:
    """Return what the messages of each page hold, and what answers them."""
    beside = depth.Camera("beside", crossed=False, width=640)
    matcher = StereoBM(num_disparities=16)
    return {
        "depth": (depth.Frame, partial(depth.answer, {}, [matcher], beside, None)),
        "calibrate": (calibrate_live.Shown, calibrate_live.Taking().answer),
        "lag": (lag.Piece, partial(lag.answer, {}, speed=340.0, max_lag=None)),
        "search": (following.Frame, partial(following.answer, {}, TemplateQuery())),
        "driving": (driving.Recorded, driving.Recording().add),
    }


WRONG: st.SearchStrategy[Any] = (
    st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.lists(st.integers()) | st.just(10**400)
)
SIDES = st.fixed_dictionaries(dict.fromkeys(("row", "col", "height", "width"), st.integers(0, 40)))
FIELDS = {
    "freeze": st.booleans() | st.integers(0, 9),
    "box": SIDES | st.dictionaries(st.text(), WRONG),
    "rate": st.sampled_from([44_100, 48_000.0]),
    "devices": st.integers(0, 3),
    "begun": st.integers(0, 2),
    "at": st.floats(0, 1e6),
}
PARTS = [as_jpeg(*shape) for shape in ((40, 80), (1, 1), (1, 2), (9, 30))]
PARTS += [b"", b"\xff\xd8\xff", bytes(4000), bytes(4001)]


@pytest.mark.parametrize("page", ["depth", "calibrate", "lag", "search", "driving"])
@given(
    st.fixed_dictionaries(FIELDS),
    st.dictionaries(st.sampled_from([*FIELDS]), WRONG, max_size=2),
    st.lists(st.sampled_from(PARTS), max_size=3),
)
def test_whatever_a_page_is_sent_is_answered_or_refused(page, header, wrong, parts):
    kind, answer = answering_pages()[page]
    with suppress(ValueError):
        message = parse_message(packed_item(header | wrong, parts).data, kind)
        assert unpacked(Stream(page, kind, answer).answered(message))[0]["digest"]


def test_of_a_frame_only_its_left_view_and_the_maps_as_shown_are_kept() -> None:
    """Each visitor's last ones stay in memory: a byte a pixel of the view, four of disparities, one of reasons."""
    kept: dict[str, Any] = {}
    beside = depth.Camera("beside", crossed=False, width=640)
    asked = depth.Frame(parts=(as_jpeg(120, 320),), freeze=False)
    depth.answer(kept, [preset("fast", num_disparities=16)], beside, None, asked)
    (result,) = kept["results"]
    left, right = kept["pair"].left, kept["pair"].right
    assert left.base is None and sum(one.nbytes for one in (left, result.disparity, result.reason)) == 6 * 120 * 160
    assert right.shape == left.shape and not any([*right.strides, *result.score.strides])


@pytest.mark.parametrize(
    ("page", "header", "parts"),
    [
        ("depth", {}, []),
        ("depth", {"freeze": 1}, [b""]),
        ("calibrate", {}, [b"", b"", b""]),
        ("calibrate", {"at": float("nan")}, [b""]),
        ("lag", {"rate": 1e9, "devices": 1, "begun": 1}, [b"12", b"12"]),
        ("lag", {"rate": True, "devices": 1, "begun": 1}, [b"12", b"12"]),
        ("lag", {"rate": 48_000, "devices": 1, "begun": 1}, [b"12", b"1234"]),
        ("lag", {"rate": 48_000, "devices": 1, "begun": 1}, [b"1", b"1"]),
        ("search", {"box": {"row": float("nan")}}, [b""]),
        ("driving", {}, [b"", b""]),
        ("driving", {"at": float("inf")}, [b"", b""]),
    ],
)
def test_a_message_that_lacks_what_its_page_needs_is_refused(page, header, parts):
    with pytest.raises(ValueError):
        parse_message(packed_item(header, parts).data, answering_pages()[page][0])


def test_every_message_is_answered_in_order_by_the_latest_settings(open_stream: Any) -> None:
    stream, socket = open_stream()
    assert [number_answered(socket, number) for number in range(20)] == [*range(20)]
    stream.answer = lambda message: packed_item({"number": -message.number}).data
    assert number_answered(socket, 21) == -21


def test_a_refused_message_is_answered_with_a_sentence(open_stream: Any) -> None:
    def refuse(message: Message) -> bytes:
        raise ValueError("No board.")

    _, socket = open_stream(refuse)
    send(socket)
    assert next_answer(socket)["error"] == "No board."


def test_only_the_page_that_knows_the_token_is_answered(port: int, open_stream: Any) -> None:
    for first in ("", "x" * 43, b"\0"):
        with connected(port) as socket:
            assert code_of_end(socket, first) == streams.WRONG_TOKEN
    for origin in ("http://elsewhere.example", f"http://localhost:{port + 1}", "null"):
        with pytest.raises(InvalidStatus), connected(port, origin):
            pass
    assert not is_own_page({"host": "localhost"})
    stream, first_socket = open_stream()
    with connected(port) as second:  # of the same page, in another tab or after a reload
        second.send(stream.token)
        assert number_answered(second, 1) == 1
        assert code_of_end(first_socket, packed_item({}).data) == streams.WRONG_TOKEN


@pytest.mark.parametrize(
    ("messages", "code"),
    [
        (["text"], streams.MALFORMED),
        ([b"garbage"], streams.MALFORMED),
        ([packed_item({"number": "one"}).data], streams.MALFORMED),
        ([bytes(2 * 2**20)], streams.TOO_LARGE),
        ([packed_item({}).data] * 50, streams.FLOOD),
    ],
)
def test_a_connection_that_breaks_the_rules_is_closed(messages: list[Any], code: int, open_stream: Any) -> None:
    def slow(message: Message) -> bytes:
        time.sleep(0.2)
        return echo(message)

    with limited(max_live_message_mb=1):
        _, socket = open_stream(slow)
        assert code_of_end(socket, *messages) == code
        _, another = open_stream()
        assert number_answered(another, 1) == 1


def test_a_message_far_too_large_is_refused_before_it_has_come(open_stream: Any) -> None:
    _, socket = open_stream()
    assert number_answered(socket, 1) == 1
    socket.socket.sendall(b"\x82\xff" + (50 * 2**20).to_bytes(8) + bytes(4))  # it announces 50 MB, and none of it comes
    assert code_of_end(socket) == streams.TOO_LARGE
    _, another = open_stream()
    assert number_answered(another, 1) == 1


def test_places_are_given_in_order_of_arrival_and_given_back(open_stream: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(streams, "MAX_IDLE_S", 0.5)
    with limited(max_live_streams=1):
        _, first = open_stream()
        send(first)
        assert told(first) == {"state": "running", "ahead": 0}
        sockets = [open_stream()[1] for _ in range(streams.MAX_WAITING_PER_PLACE)]
        for ahead, socket in enumerate(sockets, 1):
            send(socket, ahead)
            assert told(socket) == {"state": "waiting", "ahead": ahead}
        _, brief = open_stream(brief=True)
        send(brief, 9)
        assert told(brief)["number"] == 9  # it needs no place
        _, one_too_many = open_stream()
        assert code_of_end(one_too_many, packed_item({}).data) == streams.FULL
        first.close()
        assert told(sockets[0]) == {"state": "running", "ahead": 0}
        assert told(sockets[0])["number"] == 1
        # It sends nothing more, and the place goes to the next by itself.
        assert next_answer(sockets[1])["number"] == 2
        sockets[2].close()
        assert next_answer(sockets[3])["number"] == 4


def test_a_stream_ends_when_its_time_is_over_also_while_it_waits(open_stream: Any, monkeypatch: Any) -> None:
    with limited(max_live_streams=1, max_live_minutes=1):
        _, first = open_stream()
        assert number_answered(first, 1) == 1
        monkeypatch.setattr(streams, "SECONDS_PER_MINUTE", 0.5)
        _, waiting = open_stream()
        assert code_of_end(waiting, packed_item({}).data) == streams.TOO_LONG
    with limited(max_live_minutes=1):
        _, socket = open_stream()
        assert code_of_end(socket, packed_item({}).data) == streams.TOO_LONG


def by_streamlit(stream: Stream, number: int, data: bytes | int = 0) -> int:
    """Send a message or a number over Streamlit's own connection; return the number answered, or how that ended."""
    packed = packed_item({"number": data}).data if isinstance(data, int) else data
    stream.take({"number": number, "data": base64.b64encode(packed).decode()})
    header, parts = unpacked(stream.carried)
    assert (header["name"], header["number"]) == (stream.token, number)
    return int(header["end"] if "end" in header else unpacked(parts[0])[0]["number"])


def test_messages_over_the_own_connection_of_streamlit_are_answered_and_kept_to_the_same_rules(
    open_stream: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(streams, "MAX_IDLE_S", 0.5)
    answered = []

    def noted(message: Numbered) -> bytes:
        answered.append(message.number)
        return echo(message)

    first, second = (Stream(name, Numbered, noted) for name in ("first", "second"))
    with limited(max_live_message_mb=1, max_live_streams=1):
        assert [by_streamlit(first, 5, 1) for _ in range(2)] == [1, 1]
        assert answered == [1]  # and not again
        assert by_streamlit(second, 1) == streams.FULL
        _, socket = open_stream()
        send(socket, 7)
        assert told(socket) == {"state": "waiting", "ahead": 1}
        assert by_streamlit(first, 6, 2) == 2
        assert next_answer(socket)["number"] == 7  # nothing more came, and the place is the next one's
        assert by_streamlit(first, 7) == streams.FULL
        socket.close()
        assert by_streamlit(first, 8, bytes(2 * 2**20)) == streams.TOO_LARGE
        assert by_streamlit(first, 9, b"garbage") == streams.MALFORMED
        first.take({"number": 10, "data": "no base64"})
        assert unpacked(first.carried)[0]["end"] == streams.MALFORMED
    monkeypatch.setattr(streams, "SECONDS_PER_MINUTE", 0.0)
    with limited(max_live_minutes=1):
        timed = Stream("timed", Numbered, echo)
        ends = [by_streamlit(timed, number) for number in (1, 2, 3, 4)]
        assert ends == [0, streams.TOO_LONG] * 2  # the third begins anew


def test_frames_are_decoded_within_limits() -> None:
    assert frame(as_jpeg(30, 40)).shape == (30, 40, 3)
    small = as_jpeg(8, 8)
    at = small.index(b"\xff\xc0") + 5
    bomb = small[:at] + (60_000).to_bytes(2, "big") * 2 + small[at + 4 :]
    for bad, said in ((bomb, "3,600,000,000 pixels"), (b"\x89PNG", "not a JPEG"), (small[:100], "damaged")):
        with pytest.raises(ValueError, match=said):
            frame(bad)
