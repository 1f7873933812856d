"""A visitor of the running app without a browser, who uses Streamlit's protocol as its page does."""

from __future__ import annotations

import asyncio
import http.client
import json
import time
import uuid
from collections.abc import AsyncIterator, Callable, Iterator, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from types import TracebackType
from typing import Any
from urllib.parse import parse_qsl

from streamlit.proto.BackMsg_pb2 import BackMsg
from streamlit.proto.Block_pb2 import Block
from streamlit.proto.ClientState_pb2 import ClientState
from streamlit.proto.Common_pb2 import FileURLs
from streamlit.proto.Delta_pb2 import Delta
from streamlit.proto.Element_pb2 import Element
from streamlit.proto.ForwardMsg_pb2 import ForwardMsg
from streamlit.proto.NewSession_pb2 import NewSession
from streamlit.proto.Slider_pb2 import Slider
from streamlit.proto.WidgetStates_pb2 import WidgetState
from websockets.asyncio.client import ClientConnection, connect
from websockets.typing import Subprotocol

HOST = "localhost"
XSRF_COOKIE = "_streamlit_xsrf"
TIMEOUT_S = 240
MAX_MESSAGE_BYTES = 256 * 2**20
DELIVERY_COMPONENT = "stereolag.delivery"
"""The component that delivers an item to others; its first picture on the page is the first map."""

WIDGETS = ("slider", "button_group", "checkbox", "number_input", "file_uploader", "button", "selectbox", "text_input")

Path = tuple[int, ...]


@dataclass
class Drawn:
    """An element on the page, the fragment that drew it, and the run that last drew it."""

    element: Element
    fragment: str
    run: str


@dataclass
class Move:
    """A slider move: the times at which it was due, was sent, and at which the map of it or of a later move arrived."""

    value: float
    due: float
    sent: float
    answered: float | None = None

    @property
    def latency(self) -> float | None:
        """Return the time from when it was due to its map, s; None until that has arrived."""
        return None if self.answered is None else self.answered - self.due


@dataclass
class _Run:
    """Messages received for one run of the script."""

    name: str = ""
    fragments: tuple[str, ...] = ()
    images: dict[Path, float] = field(default_factory=dict)


class Visitor:
    """One visitor of a page, from opening it to leaving.

    Parameters
    ----------
    port
        The app's port on this machine.
    page
        The page's name in the address, such as ``Depth_maps``; "" for the home page.
    """

    def __init__(self, port: int, page: str = "Depth_maps") -> None:
        self._port = port
        self._page = page
        self._cookie = ""
        self._session = ""
        self._page_hash = ""
        self._socket: ClientConnection | None = None
        self._reader: asyncio.Task[None] | None = None
        self._drawn: dict[Path, Drawn] = {}
        self._states: dict[str, WidgetState] = {}
        self._cached: dict[str, tuple[ForwardMsg, int, str]] = {}
        self._expanders: set[str] = set()
        self._tabs: set[str] = set()
        self._repeats: dict[str, asyncio.Task[None]] = {}
        self._maps = 0
        self._runs = self._max_cached_age = 0
        self._run = _Run()
        self._finished = 0
        self._change = asyncio.Condition()
        self._addresses: dict[str, list[FileURLs]] = {}
        self.query = ""
        self.moves: list[Move] = []
        self.received_bytes = 0

    async def __aenter__(self) -> Visitor:
        await self.arrive()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        await self.leave()

    async def arrive(self) -> None:
        """Open the page and wait until its script has run."""
        self._cookie = await asyncio.to_thread(self._fetch_cookie)
        self._socket = await connect(
            f"ws://{HOST}:{self._port}/_stcore/stream",
            subprotocols=[Subprotocol("streamlit"), Subprotocol(self._cookie or "PLACEHOLDER_AUTH_TOKEN")],
            origin=f"http://{HOST}:{self._port}",  # type: ignore[arg-type]
            additional_headers={"Cookie": f"{XSRF_COOKIE}={self._cookie}"},
            max_size=MAX_MESSAGE_BYTES,
        )
        self._reader = asyncio.create_task(self._read())
        await self._send_and_wait(ClientState(page_name=self._page))

    async def leave(self) -> None:
        """Close the page."""
        self._stop_repeats()
        if self._socket is not None:
            await self._socket.close()
        if self._reader is not None:
            await self._reader

    def elements(self, kind: str) -> Iterator[tuple[Path, Element]]:
        """Yield the elements of a kind in page order."""
        for path in sorted(self._drawn):
            element = self._drawn[path].element
            if element.WhichOneof("type") == kind:
                yield path, element

    def complaints(self) -> list[str]:
        """Return the page's error messages and exceptions."""
        said = [one.exception.message for _, one in self.elements("exception")]
        return said + [one.alert.body for _, one in self.elements("alert") if one.alert.format == one.alert.ERROR]

    def keys(self, prefix: str) -> list[str]:
        """Return those keys of the page's widgets that begin with a prefix."""
        identities = [getattr(one.element, kind).id for one, kind in self._widgets()]
        return [key for key in (_key_of(one) for one in identities) if key.startswith(prefix)]

    async def choose(self, key: str, option: str) -> None:
        """Choose an option of a segmented control by its label, and wait until the script has run."""
        drawn, widget = self._widget(key)
        state = WidgetState(id=widget)
        state.string_array_value.data.append(option)
        await self._set(state, drawn.fragment)

    async def open_tab(self, key: str, name: str) -> None:
        """Open a tab by its name, and wait until the script has run."""
        identity = next(one for one in self._tabs if _key_of(one) == key)
        await self._set(WidgetState(id=identity, string_value=name), "")

    async def upload(self, files: Mapping[str, bytes], ending: str = "png") -> None:
        """Upload a file to the uploader of each key, and wait until the script has run after each."""
        for key, content in files.items():
            drawn, widget = self._widget(key)
            name = f"{key}.{ending}"
            request = BackMsg()
            request.file_urls_request.request_id = uuid.uuid4().hex
            request.file_urls_request.file_names.append(name)
            request.file_urls_request.session_id = self._session
            await self._send(request)
            identity = request.file_urls_request.request_id
            await self._until(lambda identity=identity: identity in self._addresses, f"an address for {name}")
            address = self._addresses.pop(identity)[0]
            await asyncio.to_thread(self._put, address.upload_url, name, content)
            state = WidgetState(id=widget)
            info = state.file_uploader_state_value.uploaded_file_info.add()
            info.file_id, info.name, info.size = address.file_id, name, len(content)
            info.file_urls.CopyFrom(address)
            await self._set(state, drawn.fragment)

    async def press(self, key: str) -> None:
        """Press a button, and wait until the script has run."""
        drawn, widget = self._widget(key)
        await self._set(WidgetState(id=widget, trigger_value=True), drawn.fragment)

    async def trigger(self, component: str, event: str, value: object) -> None:
        """Send a value of a component to Python, as its ``setTriggerValue`` does, and wait until the script has run."""
        drawn = next(
            one for one in self._drawn.values() if one.element.bidi_component.component_name == f"stereolag.{component}"
        )
        state = WidgetState(id=f"$$STREAMLIT_INTERNAL_KEY_{drawn.element.bidi_component.id}__events")
        state.json_trigger_value = json.dumps([{"event": event, "value": value}])
        await self._set(state, drawn.fragment)

    async def press_for_map(self, key: str) -> None:
        """Press a button and wait for another map."""
        async with self.another_map():
            await self.press(key)

    @asynccontextmanager
    async def another_map(self) -> AsyncIterator[None]:
        """Wait for another map after the actions in the context, which may cause several runs of the script."""
        maps = self._maps
        yield
        await self._until(lambda: self._maps > maps, "another map")

    async def slide(self, key: str, value: float) -> None:
        """Move a slider without measuring it, and wait until the script has run."""
        drawn, widget = self._widget(key)
        state = WidgetState(id=widget)
        state.double_array_value.data.append(value)
        await self._set(state, drawn.fragment)

    async def move(self, key: str, value: float, due: float | None = None) -> Move:
        """Move a slider without waiting; `due` is its planned time on the clock of ``time.perf_counter``."""
        drawn, widget = self._widget(key)
        state = WidgetState(id=widget)
        state.double_array_value.data.append(value)
        self._states[widget] = state
        now = time.perf_counter()
        moved = Move(value, now if due is None else due, now)
        self.moves.append(moved)
        await self._send(self._rerun(drawn.fragment))
        return moved

    async def settled(self) -> None:
        """Wait until every move has its map and the script has run."""
        await self._until(lambda: all(one.answered is not None for one in self.moves), "the maps of all moves")

    async def _set(self, state: WidgetState, fragment: str) -> None:
        self._states[state.id] = state
        finished = self._finished
        await self._send(self._rerun(fragment))
        if state.WhichOneof("value") in {"trigger_value", "json_trigger_value"}:
            del self._states[state.id]
        await self._until(lambda: self._finished > finished, f"the run after a change of {_key_of(state.id)}")

    async def _send_and_wait(self, state: ClientState) -> None:
        finished = self._finished
        message = BackMsg()
        message.rerun_script.CopyFrom(state)
        await self._send(message)
        await self._until(lambda: self._finished > finished, "the first run")

    def _rerun(self, fragment: str) -> BackMsg:
        message = BackMsg()
        state = message.rerun_script
        state.query_string = self.query
        state.page_script_hash = self._page_hash
        state.fragment_id = fragment
        state.widget_states.widgets.extend(self._states.values())
        state.cached_message_hashes.extend(self._cached)
        return message

    async def _send(self, message: BackMsg) -> None:
        assert self._socket is not None
        await self._socket.send(message.SerializeToString())

    async def _until(self, holds: Callable[[], bool], awaited: str) -> None:
        """Wait until a condition holds; `awaited` is its description for errors."""
        reader = self._reader
        assert reader is not None
        try:
            async with asyncio.timeout(TIMEOUT_S), self._change:
                await self._change.wait_for(lambda: holds() or reader.done())
        except TimeoutError as error:
            raise TimeoutError(f"{awaited} did not come within {TIMEOUT_S} s") from error
        if not holds():
            raise ConnectionError(f"the app closed the connection before {awaited} came")

    async def _read(self) -> None:
        assert self._socket is not None
        try:
            async for data in self._socket:
                assert isinstance(data, bytes)
                self.received_bytes += len(data)
                self._handle(ForwardMsg.FromString(data))
                async with self._change:
                    self._change.notify_all()
        finally:
            async with self._change:
                self._change.notify_all()

    def _handle(self, message: ForwardMsg) -> None:
        kind = message.WhichOneof("type")
        if kind == "ref_hash":
            before, _, fragment = self._cached[message.ref_hash]
            self._cached[message.ref_hash] = before, self._runs, fragment
            self._draw([*message.metadata.delta_path], before.delta)
        elif kind == "delta":
            if message.metadata.cacheable:
                self._cached[message.hash] = message, self._runs, message.delta.fragment_id
            self._draw([*message.metadata.delta_path], message.delta)
        elif kind == "new_session":
            self._run = _Run(message.metadata.run.script_run_id, tuple(message.metadata.run.fragment_ids))
            self._start_run(message.new_session)
        elif kind == "navigation":
            self._page_hash = message.navigation.page_script_hash
        elif kind == "page_info_changed":
            self.query = message.page_info_changed.query_string
        elif kind == "auto_rerun":
            self._repeat(message.auto_rerun.fragment_id, message.auto_rerun.interval)
        elif kind == "stop_auto_rerun":
            for fragment in message.stop_auto_rerun.fragment_ids:
                self._stop_repeat(fragment)
        elif kind == "file_urls_response":
            self._addresses[message.file_urls_response.response_id] = [*message.file_urls_response.file_urls]
        elif kind == "script_finished":
            self._finish_run(message.script_finished)

    def _start_run(self, session: NewSession) -> None:
        self._session = session.initialize.session_id or self._session
        if not self._run.fragments:
            self._stop_repeats()
        self._max_cached_age = session.config.max_cached_message_age

    def _repeat(self, fragment: str, interval: float) -> None:
        """Rerun a fragment at an interval, as the script requested."""

        async def repeat() -> None:
            while True:
                await asyncio.sleep(interval)
                message = self._rerun(fragment)
                message.rerun_script.is_auto_rerun = True
                await self._send(message)

        self._stop_repeat(fragment)
        self._repeats[fragment] = asyncio.create_task(repeat())

    def _stop_repeat(self, fragment: str) -> None:
        task = self._repeats.pop(fragment, None)
        if task is not None:
            task.cancel()

    def _stop_repeats(self) -> None:
        for fragment in [*self._repeats]:
            self._stop_repeat(fragment)

    def _draw(self, where: list[int], delta: Delta) -> None:
        path = tuple(where)
        kind = delta.WhichOneof("type")
        if kind == "new_transient":
            return
        before = self._drawn.pop(path, None)
        if kind == "add_block":
            self._record_block(delta.add_block)
            return
        element = delta.new_element
        for inner in [one for one in self._drawn if one[: len(path)] == path]:
            del self._drawn[inner]
        self._drawn[path] = Drawn(element, delta.fragment_id, self._run.name)
        drawn_as = element.WhichOneof("type")
        if _is_picture(element) and (before is None or _source(before.element) != _source(element)):
            self._run.images[path] = time.perf_counter()
        elif drawn_as in WIDGETS:
            self._record_state(element)

    def _record_block(self, block: Block) -> None:
        """Record tabs, and the state of expanders, that report to the script when they are opened."""
        if block.tab_container.id:
            self._tabs.add(block.tab_container.id)
        part = block.expandable
        if part.id:
            self._expanders.add(part.id)
            self._states.setdefault(part.id, WidgetState(id=part.id, bool_value=part.expanded))

    def _record_state(self, element: Element) -> None:
        """Record the state of a widget as the page would send it: the visitor's choice, or else the script's value."""
        kind = element.WhichOneof("type")
        assert kind is not None
        widget = getattr(element, kind)
        if kind == "button" or (widget.id in self._states and not getattr(widget, "set_value", False)):
            return
        state = WidgetState(id=widget.id)
        if kind == "slider":
            state.double_array_value.data.extend(widget.value if widget.set_value else widget.default)
            if widget.type == Slider.SELECT_SLIDER:
                return
        elif kind == "button_group":
            chosen = widget.raw_values if widget.set_value else [widget.options[one].content for one in widget.default]
            state.string_array_value.data.extend(chosen)
        elif kind == "checkbox":
            state.bool_value = widget.value if widget.set_value else widget.default
        elif kind == "number_input":
            given = widget.HasField("value") if widget.set_value else widget.HasField("default")
            number = widget.value if widget.set_value else widget.default
            if given and widget.data_type == widget.INT:
                state.int_value = int(number)
            elif given:
                state.double_value = number
        elif kind == "file_uploader":
            state.file_uploader_state_value.SetInParent()
        else:
            return
        self._states[widget.id] = state

    def _finish_run(self, status: int) -> None:
        self._runs += 1
        run = self._run
        if status in (ForwardMsg.FINISHED_SUCCESSFULLY, ForwardMsg.FINISHED_FRAGMENT_RUN_SUCCESSFULLY):
            for path, drawn in [*self._drawn.items()]:
                if drawn.run != run.name and (not run.fragments or drawn.fragment in run.fragments):
                    del self._drawn[path]
            if not run.fragments:
                current = {getattr(one.element, kind).id for one, kind in self._widgets()}
                current |= self._expanders | self._tabs
                self._states = {name: state for name, state in self._states.items() if name in current}
            for name, (_, used, fragment) in [*self._cached.items()]:
                if (not run.fragments or fragment in run.fragments) and self._runs - used > self._max_cached_age:
                    del self._cached[name]
        maps = [path for path, one in self.elements("bidi_component") if _is_picture(one)][:1]
        shown = [run.images[path] for path in maps if path in run.images]
        self._maps += bool(shown)
        value = float(dict(parse_qsl(self.query)).get("window_size", "nan"))
        answered = [index for index, one in enumerate(self.moves) if one.value == value]
        if shown and answered:
            for one in self.moves[: answered[-1] + 1]:
                one.answered = one.answered or shown[0]
        self._finished += 1

    def _widgets(self) -> list[tuple[Drawn, str]]:
        """Return the page's widgets and their kinds, in page order."""
        drawn = [self._drawn[path] for path in sorted(self._drawn)]
        kinds = [(one, one.element.WhichOneof("type") or "") for one in drawn]
        return [(one, kind) for one, kind in kinds if kind in WIDGETS]

    def _widget(self, key: str) -> tuple[Drawn, str]:
        """Return the widget with a key, and its ID."""
        for drawn, kind in self._widgets():
            identity = str(getattr(drawn.element, kind).id)
            if _key_of(identity) == key:
                return drawn, identity
        raise LookupError(f"There is no widget of the key {key} on the page. {' '.join(self.complaints())}")

    def _fetch_cookie(self) -> str:
        """Return the token that the app sends to every browser."""
        connection = http.client.HTTPConnection(HOST, self._port, timeout=TIMEOUT_S)
        try:
            for path in (f"/{self._page}", "/_stcore/health", "/_stcore/host-config"):
                connection.request("GET", path)
                answer = connection.getresponse()
                answer.read()
                for part in (answer.getheader("Set-Cookie") or "").split(";"):
                    name, _, value = part.strip().partition("=")
                    if name == XSRF_COOKIE:
                        return value
        finally:
            connection.close()
        return ""

    def _put(self, address: str, name: str, content: bytes) -> None:
        """Send a file as a browser does with a form."""
        boundary = uuid.uuid4().hex
        head = f'--{boundary}\r\nContent-Disposition: form-data; name="{name}"; filename="{name}"\r\n'
        body = f"{head}Content-Type: image/png\r\n\r\n".encode() + content + f"\r\n--{boundary}--\r\n".encode()
        connection = http.client.HTTPConnection(HOST, self._port, timeout=TIMEOUT_S)
        try:
            headers = {
                "Content-Type": f"multipart/form-data; boundary={boundary}",
                "X-Xsrftoken": self._cookie,
                "Cookie": f"{XSRF_COOKIE}={self._cookie}",
            }
            connection.request("PUT", address, body, headers)
            answer = connection.getresponse()
            said = answer.read()
            if answer.status >= 300:
                raise ConnectionError(f"the app refused a file with {answer.status}: {said[:200]!r}")
        finally:
            connection.close()


def _key_of(identity: str) -> str:
    """Return the key that the script gave a widget: the part after a fixed prefix and a digest."""
    return identity.split("-", 2)[-1]


def _is_picture(element: Element) -> bool:
    """Return whether an element delivers a picture, of a map or an image."""
    delivery = (
        element.WhichOneof("type") == "bidi_component" and element.bidi_component.component_name == DELIVERY_COMPONENT
    )
    return delivery and _header(element)["kind"] == "pictures"


def _source(element: Element) -> str:
    """Return the digest that identifies a picture."""
    return str(_header(element)["digest"])


def _header(element: Element) -> dict[str, Any]:
    """Return the header of a delivered item."""
    data = element.bidi_component.bytes
    header: dict[str, Any] = json.loads(data[4 : 4 + int.from_bytes(data[:4], "little")])
    return header
