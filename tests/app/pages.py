"""Helpers that open pages of the app without a browser, and act on them."""

import time
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from streamlit.testing.v1 import AppTest

from tests.app import keys
from tests.app.reading import controls

PROJECT = Path(__file__).resolve().parents[2]

LAG, FIND, DEPTH = "pages/1_Sensor_lag.py", "pages/2_Rocketman_search.py", "pages/3_Depth_maps.py"

CALIBRATE, DRIVING = "pages/4_Calibrate.py", "pages/5_Driving.py"


def _script() -> None:
    import streamlit as st

    st.session_state["script"]()


def page_of(script: Callable[[], None], state: Mapping[str, Any] = MappingProxyType({})) -> AppTest:
    """Return a page that is one function, after its first run; other than with AppTest alone, its names are known."""
    app = AppTest.from_function(_script, default_timeout=120)
    for key, value in {"script": script, **state}.items():
        app.session_state[key] = value
    return app.run()


def open_page(path: str, before: Mapping[str, Any] = MappingProxyType({})) -> AppTest:
    """Return a page, with some controls already set, after its first run."""
    app = AppTest.from_file(PROJECT / "app.py", default_timeout=120)
    for key, value in before.items():
        app.session_state[key] = value
    if path != "app.py":
        app.switch_page(path)
    return app.run()


def open_unfolded(path: str) -> AppTest:
    app = open_page(path)
    if path == DEPTH:
        for fold in keys.FOLDS:
            app.session_state[fold] = True
    if path == FIND:
        app.session_state["template.part"] = "Damage it"
    return app.run()


def arrive(app: AppTest, path: str | None = None, **parameters: str) -> AppTest:
    """Run a page with this address, by default the current page; ``__`` stands for a dot in a parameter's name."""
    if path is not None:
        app.switch_page(path)
    app.query_params.clear()
    app.query_params |= {name.replace("__", "."): value for name, value in parameters.items()}
    app.run()
    return app


def linked(path: str, **parameters: str) -> AppTest:
    """Return a page of a new visitor, opened by a link."""
    return arrive(AppTest.from_file(PROJECT / "app.py", default_timeout=120), path, **parameters)


def moved(app: AppTest, values: Mapping[str, Any]) -> AppTest:
    """Return the page after a run with new values of controls, by their keys."""
    for key, value in values.items():
        controls(app)[key].set_value(value)
    return app.run()


def uploaded(app: AppTest, inputs: str, **files: tuple[str, bytes]) -> AppTest:
    """Return the page after files were given to its boxes; each has a name and its bytes."""
    for box, (name, data) in files.items():
        app.file_uploader(key=f"{inputs}.{box}").upload(name, data, "application/octet-stream")
    return app.run()


def until(holds: Callable[[], object], pause_s: float = 0.005) -> None:
    """Wait until something holds; a test has a time limit of its own."""
    while not holds():
        time.sleep(pause_s)


def finished(app: AppTest) -> AppTest:
    """Run a page until no job is running."""

    def ended() -> bool:
        working = app.get("progress") or any("cancel" in (button.key or "") for button in app.button)
        return not working or not app.run()

    until(ended, pause_s=0.1)
    return app
