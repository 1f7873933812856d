"""Helpers that open pages of the app without a browser, and read what they show."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from streamlit.testing.v1 import AppTest

from stereolag.ui.controls import exact_key

PROJECT = Path(__file__).resolve().parents[2]

LAG, FIND, DEPTH = "pages/1_Sensor_lag.py", "pages/2_Rocketman_search.py", "pages/3_Depth_maps.py"
CALIBRATE, DRIVING = "pages/4_Calibrate.py", "pages/5_Driving.py"

OpenPage = Callable[..., AppTest]
Shown = Callable[[AppTest], str]


def _script() -> None:
    import streamlit as st

    st.session_state["script"]()


def page_of(script: Callable[[], None], state: Mapping[str, Any] = MappingProxyType({})) -> AppTest:
    """Return a page that is one function, after its first run; other than with AppTest alone, its names are known."""
    app = AppTest.from_function(_script, default_timeout=120)
    for key, value in {"script": script, **state}.items():
        app.session_state[key] = value
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


def address(app: AppTest) -> dict[str, str]:
    """Return the parameters in the address of a page."""
    return {name: value if isinstance(value, str) else value[0] for name, value in app.query_params.items()}


def ignored(app: AppTest) -> list[str]:
    """Return the warnings about an address."""
    return [warning.value for warning in app.warning if "ignored" in warning.value]


def numbers(app: AppTest) -> dict[str, str]:
    """Return the numbers of a result, by their labels: as large numbers, or in a line below its headline."""
    lines = [one for caption in app.caption for one in NUMBER.findall(caption.value) if " · " in caption.value]
    return {metric.label: metric.value for metric in app.metric} | dict(lines)


NUMBER = re.compile(r"(?:^| · )([^·*]+) \*\*(.+?)\*\*")
LAG_FOUND = re.compile(r"Sensor ([12]) hears it .*?\(([\d,.]+)")


def lag_found(app: AppTest) -> int:
    """Return the lag in the headline, in whole samples."""
    said = app.header[0].value
    if "at the same time" in said:
        return 0
    found = LAG_FOUND.search(said)
    assert found is not None, said
    return round(float(found[2].replace(",", ""))) * (1 if found[1] == "2" else -1)


def captions(app: AppTest) -> str:
    """Return all captions of a page, with their tooltips, as one text."""
    return " ".join(f"{caption.value} {caption.help}" for caption in app.caption)


def charts(app: AppTest) -> list[dict[str, Any]]:
    return [json.loads(chart.proto.spec) for chart in app.get("plotly_chart")]


def controls(app: AppTest) -> dict[str, Any]:
    """Return the controls that can be moved, without the boxes beside sliders, by their keys."""
    widgets = [*app.slider, *app.number_input, *app.selectbox, *app.toggle, *app.get("button_group")]
    boxes = {exact_key(slider.key) for slider in app.slider}
    return {widget.key: widget for widget in widgets if not widget.disabled and widget.key not in boxes}


def labelled(elements: Iterable[Any], label: str) -> Any:
    """Return the element with this label."""
    return next(one for one in elements if one.label == label)


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
