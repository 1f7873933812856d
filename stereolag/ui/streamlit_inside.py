"""Everything the app uses of Streamlit's internals, each with its reason; no other module may use them.

Streamlit promises none of these names. `tests/app/test_streamlit_inside.py` fails when one of them moves, and when
Streamlit offers the same publicly.
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
/* The page's links are placed where Streamlit reserves room for a toolbar, of which only the menu remains. */
[data-testid="stHeader"] { background: transparent; }
[data-testid="stHeader"], [data-testid="stHeader"] * { pointer-events: none !important; }
[data-testid="stHeader"] :is(button, button *) { pointer-events: auto !important; }
@media (max-width: 999px) {
  /* All choices of inputs fit into one line. */
  .st-key-page-head [data-testid="stButtonGroup"] button { padding-inline: 0.55rem; }
}
/* On a phone only the current page's link shows its name, so that all fit into one line. */
@media (max-width: 767px) {
  .st-key-page-links a:not([aria-current="page"]) [data-testid="stMarkdownContainer"] {
    position: absolute; width: 1px; height: 1px; overflow: hidden; clip-path: inset(50%);
  }
}
[data-testid="stMarkdownContainer"] :is(p, li) { max-width: 52rem; }
/* Tabs and choices that do not fit into one line wrap into the next, rather than scroll out of sight. */
[data-testid="stTabs"] [role="tablist"], [data-testid="stButtonGroup"] [role="radiogroup"] {
  flex-wrap: wrap; row-gap: 0;
}
/* Unselected choices keep their right edge: Streamlit omits it before the selected one, which draws it instead but may
   begin the next line. */
[data-testid="stButtonGroup"] [role="radiogroup"] button[aria-checked="false"]:not(:hover, :focus-visible) {
  border-right-color: light-dark(#e2dfd8, #343742) !important;
}
.st-key-page-head > * { max-width: 100%; }
.st-key-page-head > * [data-testid="stMarkdownContainer"] > p { padding-top: 0.35rem; }
/* The names of four methods fit into one line of the column of controls. */
.st-key-depth-tab [role="radiogroup"] button { padding-inline: 0.3rem; }
/* A table wider than a phone scrolls within its own box. */
[data-testid="stMarkdownContainer"]:has(> table) { overflow-x: auto; }
/* Links within text are underlined, because their colours are too close to the text colour. */
[data-testid="stMarkdownContainer"] :is(p, li) a { text-decoration: underline !important; }
/* Keyboard focus, which Streamlit marks too faintly here, or not at all, in the primary colours of the themes, which
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
/* Streamlit writes white on the theme's colour, which is pale on the dark page, and darkens it on hover and with the
   focus. */
button[data-testid="stBaseButton-primary"] { color: light-dark(#fff, #14151b); }
button[data-testid="stBaseButton-primary"]:is(:hover, :focus-visible, :active) {
  background-color: light-dark(#483b7d, #b9adf5);
}
/* Axis numbers and titles, which Streamlit draws at a contrast of 3.6, and parts that keep the other theme's colours if
   the theme changes while a chart is being drawn. */
.stPlotlyChart :is([class$="tick"] text, [class^="g-"][class$="title"] text, .legendtext) {
  fill: light-dark(#5b5964, #b4b2bd) !important;
}
.stPlotlyChart .main-svg { background: transparent !important; }
.stPlotlyChart :is(.bglayer, .legend) .bg { fill: none !important; }
"""
"""Styles of Streamlit's own elements that no theme option reaches; only the classes st-key-… are documented."""


# Runs of a page


def is_history_step() -> bool:
    """Return whether this run was caused by a step back or forward in the browser; ``st.context`` does not say so."""
    return bool(getattr(get_script_run_ctx(), "is_history_navigation", False))


HEAD_START_S = 0.03
"""Time a browser needs to draw a map; it would process anything that arrives sooner before it shows the map."""


def give_head_start() -> None:
    """Let the browser draw what was sent: Streamlit has no way to mark something as urgent."""
    time.sleep(HEAD_START_S)


def in_this_session(work: Callable[[T], R]) -> Callable[[T], R]:
    """Return a function that works for this session, with its state and caches, whichever thread calls it.

    Runs of the page wait until it is done and the browser has had a head start, since they would keep both busy.
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
"""Waiting runs, by session."""


def _let_run(session: str) -> None:
    for run in _waiting.pop(session, ()):
        run()


def _event_loop() -> AbstractEventLoop | None:
    """Return the event loop that serves all sessions; None without a server."""
    with suppress(AttributeError, RuntimeError):
        return runtime.get_instance()._get_async_objs().eventloop
    return None


_reconnection = st.components.v2.component(
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

    Streamlit keeps the old page on the screen, although its files and results may be gone, and notifies only its own
    elements.
    """
    _reconnection(key="reconnection", on_back_change=lambda: None)


_file_sharing = st.components.v2.component(
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
// Whether a box has received a new file, or is folded away.
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
    // One after the other: each file causes a run of the page, which may redraw a box while it receives another file.
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
    """Distribute files dropped together on a box for one file among it and the boxes beside it, in order of name.

    Streamlit would keep the first and silently drop the others. Return the name of each file and the label of its box,
    "" if no box was left.
    """
    return _file_sharing(key="files-shared", on_shared_change=lambda: None).shared or []


_run_again = AppSession.request_rerun


def _run_again_unless_left(session: AppSession, asked: ClientState | None) -> None:
    """Request a run, unless the request comes from a fragment of a page that the visitor has left.

    Streamlit would run nothing under the name of the old page, and the browser would then empty the new one.
    """
    if asked is not None:
        noted = session._client_state
        if not asked.fragment_id:
            # Streamlit records a page only once it runs; a page named in the address is recorded after its first run,
            # until then as the home page with the other page's name.
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
    """The state of a session by the keys of a script, each looked up on access."""

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
# 200 entries and five boxes, that took a fifth of the script's time after the move of a slider.
SafeSessionState.filtered_state = property(_LookedUp)  # type: ignore[assignment, method-assign]


# Memory


def freeze_imports() -> None:
    """Exempt all present objects from garbage collection, since they would lengthen its pauses with many sessions.

    Objects frozen before are collected first: they include reference cycles of the session that was open then.
    """
    gc.unfreeze()
    gc.collect()
    gc.freeze()


def keep_uploads_in_memory() -> None:
    """Keep uploads off the disk: by default, those above 1 MB go through a temporary file on their way into memory."""
    MultiPartParser.spool_max_size = st.get_option("server.maxUploadSize") * 2**20


FORGET_TIMEOUT_S = 5.0
"""Longest wait for Streamlit's event loop to forget sessions, s; the loop may have ended."""


def forget_ended_sessions() -> None:
    """Drop expired sessions and their files; Streamlit does so only when the next session or run ends, maybe never.

    The store of sessions belongs to Streamlit's event loop, so the loop does it; this function returns once it is done.
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
        forgotten.wait(FORGET_TIMEOUT_S)


def keep_file(content: bytes, file_name: str, media_type: str, coordinates: str) -> None:
    """Keep a file in Streamlit's store until another takes its coordinates.

    Streamlit itself drops a file made on demand at the end of the second run after that, of any visitor.
    """
    runtime.get_instance().media_file_mgr.add(content, media_type, coordinates, file_name, is_for_static_download=True)


def forget_file(coordinates: str) -> None:
    """Drop a file from the store, which happens only when another one takes its coordinates."""
    if runtime.exists():
        runtime.get_instance().media_file_mgr.add(b"", "text/plain", coordinates, is_for_static_download=True)


# Starting the server, and asking a running one


def faults_of_script(script: Path, patience_s: float) -> list[str]:
    """Run a page once, without a browser or a server, and return its errors, one line each.

    Streamlit itself would start a server even for a page that fails.
    """
    config.set_option("client.showErrorDetails", "full")  # visitors may see fewer details
    page = AppTest.from_file(script, default_timeout=patience_s).run()
    return [f"{one.proto.type}: {one.message}" for one in page.exception] + [one.value for one in page.error]


def run_server(script: Path, port: int, others: list[str]) -> None:
    """Serve an app in this process until it is stopped, as ``streamlit run`` does.

    An app with its own routes raises the signal that stops it again once everything is closed, so that the process
    would appear to have been killed.
    """
    from streamlit.web import cli

    for one in (signal.SIGINT, signal.SIGTERM):
        signal.signal(one, lambda *_: sys.exit(0))
    cli.main(["run", str(script), "--server.port", str(port), *others], prog_name="streamlit")


PROBE_TIMEOUT_S = 60
"""Time a page may take on a busy machine, s."""


def served_fault(port: int) -> str | None:
    """Return in one line why the app on a local port does not serve its home page, or None if it does.

    This is the health check of a container. Unlike ``/_stcore/health``, it runs the page in the process of the app.
    """
    end = time.monotonic() + PROBE_TIMEOUT_S
    address = f"ws://localhost:{port}/_stcore/stream"
    try:
        # A proxy in the environment does not apply to this machine.
        with connect(address, proxy=None, open_timeout=PROBE_TIMEOUT_S, max_size=None) as page:
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
        return f"No page came within {PROBE_TIMEOUT_S} s."
    except (OSError, WebSocketException) as error:
        return str(error)


def _fault(element: Element) -> str | None:
    """Return the failure that an element reports, in one line, or None if it reports none."""
    if element.WhichOneof("type") == "exception":
        return " ".join(f"{element.exception.type}: {element.exception.message}".split())
    if element.WhichOneof("type") == "alert" and element.alert.format == Alert.ERROR:
        return " ".join(element.alert.body.split())
    return None
