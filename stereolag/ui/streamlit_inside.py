"""All that the app takes from the inside of Streamlit, each with its reason; nothing else may reach in there.

Streamlit promises none of these names. `tests/app/test_streamlit_inside.py` fails when one of them moves, and when
Streamlit offers the thing itself.
"""

from __future__ import annotations

import gc
import signal
import sys
import threading
import time
from asyncio import AbstractEventLoop
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import streamlit as st
from starlette.formparsers import MultiPartParser
from streamlit import config, runtime
from streamlit.components.v2.types import ComponentRenderer
from streamlit.delta_generator import DeltaGenerator as Container
from streamlit.elements.lib.mutable_expander_container import ExpanderContainer as Expander
from streamlit.proto.Alert_pb2 import Alert
from streamlit.proto.BackMsg_pb2 import BackMsg
from streamlit.proto.ClientState_pb2 import ClientState
from streamlit.proto.Element_pb2 import Element
from streamlit.proto.ForwardMsg_pb2 import ForwardMsg
from streamlit.runtime.app_session import AppSession
from streamlit.runtime.scriptrunner import add_script_run_ctx, get_script_run_ctx
from streamlit.runtime.state.safe_session_state import SafeSessionState
from streamlit.runtime.uploaded_file_manager import UploadedFile
from streamlit.testing.v1 import AppTest
from websockets.exceptions import WebSocketException
from websockets.sync.client import connect

T = TypeVar("T")
R = TypeVar("R")

__all__ = ["ComponentRenderer", "Container", "Expander", "UploadedFile"]
# Types of values that Streamlit returns, but does not export.

# Styles


PAGE_STYLE = """
/* Readable line lengths, and pictures that fit the screen, however wide it is. */
[data-testid="stMainBlockContainer"] {
  max-width: 150rem; margin-inline: auto; padding: 0 clamp(0.75rem, 2.3vw, 2.25rem) 4rem;
}
/* The page's links are placed where Streamlit reserves room for a toolbar, of which only the menu is left. */
[data-testid="stHeader"] { background: transparent; }
[data-testid="stHeader"], [data-testid="stHeader"] * { pointer-events: none !important; }
[data-testid="stHeader"] :is(button, button *) { pointer-events: auto !important; }
/* On a phone only the current page's link has a name to be seen, so that all fit into one line. */
@media (max-width: 999px) {
  /* So that all inputs of a page stand in one line of a phone. */
  .st-key-page-head [data-testid="stButtonGroup"] button { padding-inline: 0.55rem; }
}
@media (max-width: 767px) {
  .st-key-page-links a:not([aria-current="page"]) [data-testid="stMarkdownContainer"] {
    position: absolute; width: 1px; height: 1px; overflow: hidden; clip-path: inset(50%);
  }
}
[data-testid="stMarkdownContainer"] :is(p, li) { max-width: 52rem; }
/* Tabs and choices that do not fit into one line go on in the next, rather than out of sight. */
[data-testid="stTabs"] [role="tablist"], [data-testid="stButtonGroup"] [role="radiogroup"] {
  flex-wrap: wrap; row-gap: 0;
}
/* The choice before the one taken, which may begin the next line: Streamlit leaves the edge between them to that. */
[data-testid="stButtonGroup"] [role="radiogroup"] button[aria-checked="false"]:not(:hover, :focus-visible) {
  border-right-color: light-dark(#e2dfd8, #343742) !important;
}
.st-key-page-head > * { max-width: 100%; }
.st-key-page-head > * [data-testid="stMarkdownContainer"] > p { padding-top: 0.35rem; }
/* The names of four methods in one line of the column of controls. */
.st-key-depth-tab [role="radiogroup"] button { padding-inline: 0.3rem; }
/* A table wider than a phone scrolls within its own box. */
[data-testid="stMarkdownContainer"]:has(> table) { overflow-x: auto; }
/* Links within text, because their colours are too close to the text colour. */
[data-testid="stMarkdownContainer"] :is(p, li) a { text-decoration: underline !important; }
/* Keyboard focus, which Streamlit marks too faintly here, or not at all. In the primary colours of the themes, which
   Streamlit exposes only to components. */
[data-testid="stMain"], [data-testid="stPageLink-NavLink"], [data-testid="stElementToolbar"] button {
  --ring: 2px solid light-dark(#5a4a9c, #a797f2);
}
[data-testid="stMain"]:focus-visible { outline: var(--ring); outline-offset: -2px; }
[data-testid="stPageLink-NavLink"]:focus-visible, [data-testid="stElementToolbar"] button:focus-visible {
  outline: var(--ring);
}
/* Streamlit shows the buttons over a picture only under the pointer. */
[data-testid="stElementToolbar"]:focus-within { opacity: 1; }
/* Streamlit writes white on the theme's colour, which is pale on the dark page, and darkens it under
   the pointer and with the focus. */
button[data-testid="stBaseButton-primary"] { color: light-dark(#fff, #14151b); }
button[data-testid="stBaseButton-primary"]:is(:hover, :focus-visible, :active) {
  background-color: light-dark(#483b7d, #b9adf5);
}
/* Axis numbers and titles, which Streamlit draws at a contrast of 3.6, and what it leaves in the other theme's colours
   if the theme changes while a chart is being drawn. */
.stPlotlyChart :is([class$="tick"] text, [class^="g-"][class$="title"] text, .legendtext) {
  fill: light-dark(#5b5964, #b4b2bd) !important;
}
.stPlotlyChart .main-svg { background: transparent !important; }
.stPlotlyChart :is(.bglayer, .legend) .bg { fill: none !important; }
"""
"""Styles of Streamlit's own elements that no theme option reaches; the classes st-key-… are documented, and in CSS."""


# Runs of a page


def is_history_step() -> bool:
    """Return whether this run was caused by a step back or forward in the browser; ``st.context`` does not tell."""
    return bool(getattr(get_script_run_ctx(), "is_history_navigation", False))


HEAD_START_S = 0.03
"""Time a browser needs to draw a map; it would process anything that arrives sooner before it shows the map."""


def give_head_start() -> None:
    """Let the browser draw what was sent: no element or option of Streamlit says that something is urgent."""
    time.sleep(HEAD_START_S)


def in_this_session(work: Callable[[T], R]) -> Callable[[T], R]:
    """Return a function that does its work for this session in any thread, which has its state and caches meanwhile.

    Runs of the page wait for it and a head start: what they send would keep the browser and the processor busy.
    """
    session = get_script_run_ctx()

    def work_for_session(given: T) -> R:
        loop = None if session is None else _event_loop()
        if session is not None and loop is not None:
            _waiting.setdefault(session.session_id, [])
        try:
            with ThreadPoolExecutor(1, initializer=add_script_run_ctx, initargs=(None, session)) as aside:
                return aside.submit(work, given).result()
        finally:
            if session is not None and loop is not None:
                loop.call_soon_threadsafe(loop.call_later, HEAD_START_S, _let_run, session.session_id)

    return work_for_session


_waiting: dict[str, list[Callable[[], None]]] = {}
"""Runs that wait, by their session."""


def _let_run(session: str) -> None:
    for run in _waiting.pop(session, ()):
        run()


def _event_loop() -> AbstractEventLoop | None:
    """Return the loop in whose thread Streamlit serves all sessions; None without a server."""
    with suppress(AttributeError, RuntimeError):
        return runtime.get_instance()._get_async_objs().eventloop
    return None


_watch = st.components.v2.component(
    "stereolag.reconnection",
    js="""
export default function ({ setTriggerValue }) {
  const app = document.querySelector("[data-testid=stApp]");
  const connected = () => app.dataset.testConnectionState === "CONNECTED";
  let before = connected();
  const observer = new MutationObserver(() => {
    const now = connected();
    if (now && !before) setTriggerValue("back", true);
    before = now;
  });
  observer.observe(app, { attributes: true, attributeFilter: ["data-test-connection-state"] });
  return () => observer.disconnect();
}
""",
)


def run_again_when_reconnected() -> None:
    """Rerun the page when its connection comes back; must be called outside any fragment.

    Streamlit keeps the old page on the screen, whose files and results may be gone, and tells only its own elements.
    """
    _watch(key="reconnection", on_back_change=lambda: None)


_share = st.components.v2.component(
    "stereolag.sharing",
    js="""
const ZONE = "[data-testid=stFileUploaderDropzone]";
const PATIENCE_MS = 2000;
const TRIES = 5;
const isForOne = (zone) => !zone.querySelector("input").multiple;
const boxOf = (label) => [...document.querySelectorAll(ZONE)].find((zone) => zone.ariaLabel === label);
const part = (label, id) => boxOf(label)?.closest("[data-testid=stFileUploader]").querySelector(`[data-testid=${id}]`);
const give = (label, file) => {
  const dataTransfer = new DataTransfer();
  dataTransfer.items.add(file);
  boxOf(label)?.dispatchEvent(new DragEvent("drop", { bubbles: true, cancelable: true, dataTransfer }));
};
// Whether a box has a file that it had not before and that has arrived, or is folded away.
const has = async (label, before) => {
  for (let end = performance.now() + PATIENCE_MS; performance.now() < end; ) {
    await new Promise((done) => setTimeout(done, 50));
    if (part(label, "stFileChipIconSpinner")) end = performance.now() + PATIENCE_MS;
    else if ((part(label, "stFileChip") ?? before) !== before) return true;
  }
  return !boxOf(label);
};
export default function ({ setStateValue }) {
  const share = async (event) => {
    const zone = event.target.closest(ZONE);
    const files = [...event.dataTransfer.files].sort((one, other) => one.name.localeCompare(other.name));
    if (!zone || !isForOne(zone) || files.length < 2) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    const row = zone.closest("[data-testid=stHorizontalBlock]");
    const zones = row ? [...row.querySelectorAll(ZONE)].filter(isForOne) : [zone];
    const shared = files.map((file, at) => [file, zones[at]?.ariaLabel ?? ""]);
    // One after the other: a run of the page, which each file causes, may draw a box anew while it takes another.
    for (const [file, label] of shared.filter(([, label]) => label)) {
      const before = part(label, "stFileChip");
      for (let tries = 0; tries < TRIES; tries += 1) {
        give(label, file);
        if (await has(label, before)) break;
      }
    }
    setStateValue("shared", shared.map(([{ name }, label]) => [name, label]));
  };
  window.addEventListener("drop", share, true);
  return () => window.removeEventListener("drop", share, true);
}
""",
)


def files_shared_out() -> list[list[str]]:
    """Share files dropped together on a box for one among it and those beside it, by name: return which went where.

    Streamlit keeps the first and says nothing of the others. The name of a file is followed by the label of its box, ""
    if none was left.
    """
    return _share(key="files-shared", on_shared_change=lambda: None).shared or []


_run_again = AppSession.request_rerun


def _run_again_unless_left(session: AppSession, asked: ClientState | None) -> None:
    """Request a run, unless a part of a page asks for it that the visitor has left.

    Streamlit would run nothing under the name of the old page, at which the browser empties the new one.
    """
    if asked is not None:
        noted = session._client_state
        if not asked.fragment_id:
            # Streamlit notes a page only once it runs, and one that an address names only after its first run, until
            # which it notes the home page: only then is there a name beside it.
            noted.page_script_hash, noted.page_name = asked.page_script_hash, asked.page_name
        elif asked.page_script_hash != noted.page_script_hash and not noted.page_name:
            return
    run = partial(_run_again, session, asked)
    if session.id in _waiting:
        _waiting[session.id].append(run)
    else:
        run()


AppSession.request_rerun = _run_again_unless_left  # type: ignore[assignment, method-assign]


class _LookedUp(Mapping[str, Any]):
    """The state of a session by the keys of a script, each looked up when it is asked for."""

    def __init__(self, state: SafeSessionState) -> None:
        self._state = state

    def __getitem__(self, key: str) -> Any:
        return self._state[key]

    def __iter__(self) -> Iterator[str]:
        return iter(_whole_state(self._state))

    def __len__(self) -> int:
        return len(_whole_state(self._state))


_whole_state = SafeSessionState.filtered_state.fget  # type: ignore[attr-defined]

# Every number box copies the whole state of the session to look up its own value in the copy: with the depth page's
# 200 entries and five boxes that was a fifth of the time its script takes after the move of a slider.
SafeSessionState.filtered_state = property(_LookedUp)  # type: ignore[assignment, method-assign]


# Memory


def freeze_imports() -> None:
    """Exempt all present objects from garbage collection, whose pauses they would lengthen with many sessions.

    What was frozen before is collected first: it includes reference cycles of the session that was open then.
    """
    gc.unfreeze()
    gc.collect()
    gc.freeze()


def keep_uploads_in_memory() -> None:
    """Keep uploads off the disk: by default, one above 1 MB is written to a temporary file on its way into memory."""
    MultiPartParser.spool_max_size = st.get_option("server.maxUploadSize") * 2**20


FORGETTING_S = 5.0
"""How long to wait for Streamlit's event loop to forget sessions, s; it may have ended."""


def forget_ended_sessions() -> None:
    """Drop expired sessions and their files; Streamlit does so only when the next session or run ends, maybe never.

    Its event loop does it, which the store of sessions belongs to; this returns once it is done.
    """
    loop = _event_loop()
    if loop is None:
        return
    server, forgotten = runtime.get_instance(), threading.Event()

    def forget() -> None:
        with suppress(AttributeError):  # another version of Streamlit drops them itself, later
            server._session_mgr._session_storage._cache.expire()  # type: ignore[attr-defined]
        server.media_file_mgr.remove_orphaned_files()
        forgotten.set()

    with suppress(RuntimeError):  # the loop has ended
        loop.call_soon_threadsafe(forget)
        forgotten.wait(FORGETTING_S)


def keep_file(content: bytes, file_name: str, media_type: str, coordinates: str) -> None:
    """Keep a file in Streamlit's store until another takes its coordinates.

    Streamlit itself drops a file made on demand at the end of the second run after that, of any visitor.
    """
    files = runtime.get_instance().media_file_mgr
    files.add(content, media_type, coordinates, file_name, is_for_static_download=True)


def forget_file(coordinates: str) -> None:
    """Drop a file from the store: it does so only when another one takes the coordinates."""
    if runtime.exists():
        runtime.get_instance().media_file_mgr.add(b"", "text/plain", coordinates, is_for_static_download=True)


# Starting the server, and asking a running one


def faults_of_script(script: Path, patience_s: float) -> list[str]:
    """Run a page once as Streamlit's own tests do, without a browser or a server, and return its faults in lines.

    Streamlit starts a server whatever happens in a page.
    """
    config.set_option("client.showErrorDetails", "full")  # visitors may see fewer details
    page = AppTest.from_file(script, default_timeout=patience_s).run()
    return [f"{one.proto.type}: {one.message}" for one in page.exception] + [one.value for one in page.error]


def run_server(script: Path, port: int, others: list[str]) -> None:
    """Serve an app in this process until it is stopped, as ``streamlit run`` does.

    A server with routes of its own is stopped by signals that it raises again once everything is closed; the process
    would then end as if it had been killed.
    """
    from streamlit.web import cli

    for one in (signal.SIGINT, signal.SIGTERM):
        signal.signal(one, lambda *_: sys.exit(0))
    cli.main(["run", str(script), "--server.port", str(port), *others], prog_name="streamlit")


PROBE_PATIENCE_S = 60
"""How long a page may take on a busy machine."""


def served_fault(port: int) -> str | None:
    """Return in one line why the app on a local port does not serve its home page, or None if it does.

    Unlike ``/_stcore/health``, this runs the page in the process of the app: the health check of a container.
    """
    end = time.monotonic() + PROBE_PATIENCE_S
    address = f"ws://localhost:{port}/_stcore/stream"
    try:
        # A proxy in the environment does not apply to this machine.
        with connect(address, proxy=None, open_timeout=PROBE_PATIENCE_S, max_size=None) as page:
            page.send(BackMsg(rerun_script=ClientState()).SerializeToString())
            while True:
                message = ForwardMsg.FromString(page.recv(timeout=end - time.monotonic(), decode=False))
                kind = message.WhichOneof("type")
                if kind == "delta" and (fault := _fault(message.delta.new_element)):
                    return fault
                if kind == "script_finished" and message.script_finished != ForwardMsg.FINISHED_EARLY_FOR_RERUN:
                    well = message.script_finished == ForwardMsg.FINISHED_SUCCESSFULLY
                    return None if well else "The page cannot be compiled."
    except TimeoutError:
        return f"No page came within {PROBE_PATIENCE_S} s."
    except (OSError, WebSocketException) as error:
        return str(error)


def _fault(element: Element) -> str | None:
    """Return the failure that an element reports, in one line, or None if it reports none."""
    if element.WhichOneof("type") == "exception":
        return " ".join(f"{element.exception.type}: {element.exception.message}".split())
    if element.WhichOneof("type") == "alert" and element.alert.format == Alert.ERROR:
        return " ".join(element.alert.body.split())
    return None
