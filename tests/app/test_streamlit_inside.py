"""What the app takes from Streamlit's inside is there, and Streamlit does not offer it itself: else use what it offers.

A failure after an upgrade of Streamlit means: look at the reason in `stereolag/ui/streamlit_inside.py`, and whether it
still holds.
"""

import asyncio
import inspect
import re
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import Queue
from types import SimpleNamespace

import pytest
import streamlit as st
from starlette.formparsers import MultiPartParser
from streamlit import config
from streamlit.elements.widgets.number_input import NumberInputMixin
from streamlit.proto.ClientState_pb2 import ClientState
from streamlit.runtime.app_session import AppSession, AppSessionState
from streamlit.runtime.memory_media_file_storage import MemoryMediaFileStorage
from streamlit.runtime.memory_session_storage import MemorySessionStorage
from streamlit.runtime.runtime import Runtime
from streamlit.runtime.scriptrunner_utils.script_run_context import ScriptRunContext, get_script_run_ctx
from streamlit.runtime.state.safe_session_state import SafeSessionState
from streamlit.testing.v1 import AppTest
from streamlit.web.server.starlette import starlette_app

from stereolag.ui import streamlit_inside as inside
from stereolag.ui.results import remembered
from tests.app.pages import page_of

PACKAGE = Path(inside.__file__).parents[1]
STATIC = Path(st.__file__).parent / "static" / "static" / "js"


def test_types_steps_through_the_history_and_connections_that_come_back_are_not_offered() -> None:
    types = "Container DeltaGenerator Expander ExpanderContainer UploadedFile ComponentRenderer"
    assert not [name for name in types.split() if hasattr(st, name)]
    assert "is_history_navigation" in ScriptRunContext.__annotations__
    assert not [name for name in dir(st.context) if "histor" in name or "navig" in name]
    assert {name for name in dir(st) if "connect" in name} <= {"_connection", "connection", "connections"}
    assert "on_reconnect" not in inspect.signature(st.App).parameters


def test_a_box_takes_one_of_several_files_without_a_word_and_a_slider_tells_only_where_it_was_released() -> None:
    (script,) = STATIC.glob("FileUploader.*.js")
    assert "too-many-files" in script.read_text(encoding="utf-8")
    assert not {"on_extra", "overflow", "max_files"} & inspect.signature(st.file_uploader).parameters.keys()
    (script,) = STATIC.glob("Slider.*.js")
    assert "onChangeEnd" in script.read_text(encoding="utf-8")
    assert not {"live", "continuous", "on_input"} & inspect.signature(st.slider).parameters.keys()


def page_with_work() -> None:
    kept = {"inputs": "pair", "settings": "", "shared": False}
    remembered("own", make=lambda: b"of this visitor", **kept)
    st.session_state["work"] = inside.in_this_session(
        lambda name: (st.session_state[name], remembered("own", make=lambda: b"made anew", **kept))
    )


def test_work_in_another_thread_has_the_state_and_the_results_of_its_session() -> None:
    works = [page_of(page_with_work, {"size": 21}).session_state["work"] for _ in range(2)]
    with ThreadPoolExecutor(1) as pool:
        for work in works:
            assert pool.submit(work, "size").result() == (21, b"of this visitor")
        assert pool.submit(get_script_run_ctx, suppress_warning=True).result() is None


def test_a_number_box_copies_the_whole_state_of_the_session() -> None:
    assert "filtered_state" in inspect.getsource(NumberInputMixin)
    assert isinstance(SafeSessionState.filtered_state, property)


def test_a_request_of_a_page_that_was_left_is_run_as_if_it_were_still_there() -> None:
    asked = inspect.getsource(inside._run_again)
    assert "page_script_hash=client_state.page_script_hash" in asked
    assert "page_script_hash !=" not in asked
    assert AppSession.request_rerun is not inside._run_again


def test_only_parts_of_a_page_that_was_left_are_not_run(monkeypatch: pytest.MonkeyPatch) -> None:
    run: list[ClientState] = []
    monkeypatch.setattr(inside, "_run_again", lambda session, asked: run.append(asked))
    session = AppSession.__new__(AppSession)
    session.id = "one"
    session._state = AppSessionState.SHUTDOWN_REQUESTED  # so that nothing is to be closed
    session._client_state = ClientState()

    def is_run(**asked: str) -> bool:
        session.request_rerun(ClientState(**asked))
        return bool(run) and run.pop() is not None

    assert is_run(page_name="Depth_maps")
    session._client_state.page_script_hash = "home"  # Streamlit notes the page itself only after the end of the run
    assert is_run(page_script_hash="depth", fragment_id="maps")
    assert is_run(page_script_hash="lag")
    assert not is_run(page_script_hash="depth", fragment_id="maps")
    assert is_run(page_script_hash="lag", fragment_id="panels")


def test_runs_wait_for_what_is_made_for_their_session_in_another_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    run: Queue[str] = Queue()
    loop, begun, end = asyncio.new_event_loop(), threading.Event(), threading.Event()
    monkeypatch.setattr(inside, "_run_again", lambda session, asked: run.put(session.id))
    monkeypatch.setattr(inside, "get_script_run_ctx", lambda: SimpleNamespace(session_id="own"))
    monkeypatch.setattr(inside, "add_script_run_ctx", lambda *_: None)
    monkeypatch.setattr(inside.runtime, "get_instance", lambda: SimpleNamespace(_get_async_objs=lambda: one))
    one, sessions = SimpleNamespace(eventloop=loop), {name: AppSession.__new__(AppSession) for name in ("own", "other")}
    for name, session in sessions.items():
        session.id, session._client_state = name, ClientState()
        session._state = AppSessionState.SHUTDOWN_REQUESTED

    def work(given: int) -> int:
        begun.set()
        assert end.wait(30)
        return -given

    with ThreadPoolExecutor(2) as pool:
        serving = pool.submit(loop.run_forever)
        working = pool.submit(inside.in_this_session(work), 1)
        assert begun.wait(30)
        for name in ("own", "other", "own"):
            loop.call_soon_threadsafe(sessions[name].request_rerun, None)
        assert run.get(timeout=30) == "other"
        assert run.empty()
        end.set()
        assert working.result() == -1
        assert [run.get(timeout=30) for _ in range(2)] == ["own", "own"]
        loop.call_soon_threadsafe(sessions["own"].request_rerun, None)
        assert run.get(timeout=30) == "own"  # at once, as nothing is made any more
        loop.call_soon_threadsafe(loop.stop)
        serving.result()
    loop.close()


def test_uploads_above_a_megabyte_go_to_the_disk_unless_the_parser_is_told() -> None:
    assert "spool_max_size" in vars(MultiPartParser)
    assert not [option for option in config.get_config_options() if "spool" in option]
    assert "spool_max_size" not in inspect.getsource(starlette_app)


def test_expired_sessions_are_dropped_only_by_the_hand_of_the_next_one() -> None:
    storage = MemorySessionStorage(ttl_seconds=0)
    assert hasattr(storage._cache, "expire")
    assert hasattr(Runtime, "_get_async_objs")
    assert not hasattr(Runtime, "expire_sessions")
    assert "Timer" not in inspect.getsource(MemorySessionStorage)


def test_a_file_made_on_demand_has_no_time_to_live() -> None:
    parameters = inspect.signature(st.download_button).parameters.keys()
    assert not [name for name in parameters if name in ("ttl", "keep", "scope", "private")]
    assert "secret" not in inspect.getsource(MemoryMediaFileStorage)


def test_no_option_of_the_theme_sets_what_the_styles_set() -> None:
    options = " ".join(config.get_config_options())
    assert not re.search(r"theme\.\S*(?:contentWidth|maxWidth|focus|toolbar|lineLength)", options, re.IGNORECASE)


def bound_page() -> None:
    import streamlit as st

    if not st.session_state.get("folded"):
        st.slider("Size", 3, 101, 11, step=2, key="correlation.size", bind="query-params", persist_state="session")


def opened_with(**parameters: str) -> AppTest:
    app = AppTest.from_function(bound_page)
    for name, value in parameters.items():
        app.query_params[name.replace("_", ".")] = value
    return app.run()


def test_controls_bound_to_the_address_fall_short_of_ours() -> None:
    app = opened_with(correlation_size="20")
    assert app.slider[0].value == 20  # between two steps
    app.session_state["folded"] = True
    app.run()
    assert not app.query_params
    app = opened_with(correlation_size="999")
    assert app.slider[0].value == 11
    assert not app.warning
    assert opened_with(size="21").slider[0].value == 11


@pytest.mark.parametrize("mark", sorted(set(re.findall(r'data-testid=\\?"?(\w+)', inspect.getsource(inside)))))
def test_streamlit_s_elements_have_the_marks_that_the_styles_name(mark: str) -> None:
    scripts = (path.read_text(encoding="utf-8") for path in STATIC.glob("*.js"))
    pattern = mark.removesuffix("-primary").removesuffix("-NavLink")
    assert any(pattern in script for script in scripts)


def test_no_other_file_reaches_into_streamlit() -> None:
    imports = r"\bstreamlit\.[a-z]\w*\b(?=[\w.]* import)|from streamlit import|\bstarlette\.(?!routing|websockets)"
    within = re.compile(rf"{imports}|data-test|\.st[A-Z]\w+")
    files = [path for path in PACKAGE.rglob("*.*") if path.suffix in {".py", ".css", ".js"} and path.stem != "fflate"]
    reaching = {path.relative_to(PACKAGE).as_posix() for path in files if within.search(path.read_text("utf-8"))}
    assert reaching == {"ui/streamlit_inside.py"}
