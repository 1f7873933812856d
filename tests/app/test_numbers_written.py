"""All texts of a page: true minus signs, no-break spaces before units, and an alternative for every drawing."""

from __future__ import annotations

import ast
import json
import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from streamlit.testing.v1 import AppTest

from stereolag.core.typography import UNITS
from tests.app import keys
from tests.app.conftest import viewers

OpenPage = Callable[..., AppTest]

PROJECT = Path(__file__).resolve().parents[2]

HYPHEN = re.compile(r"(?<![\w.,)\]`=“'-])-(?=\.?\d)")
GLUED = re.compile(rf"\d(?:\*\*)? ?(?:{UNITS})(?!\w)")
"""A unit glued to its number or separated from it by a breaking space."""
CODE = re.compile(r"`[^`]*`")

ELEMENTS = {"markdown", "caption", "header", "info", "success", "warning", "error"}
DRAWINGS = {"plotly_chart", "image", "dataframe", "audio"}


def calls() -> Iterator[tuple[str, ast.Call, ast.Attribute]]:
    """Yield the calls of methods and functions of modules in the code of the pages, with their places."""
    files = [PROJECT / "app.py", *(PROJECT / "pages").glob("*.py"), *(PROJECT / "stereolag/ui").rglob("*.py")]
    for path in files:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
                yield f"{path.name}:{node.lineno}", node, node.func


def test_text_goes_through_prose() -> None:
    straight = [
        place
        for place, _, called in calls()
        if called.attr in ELEMENTS and isinstance(called.value, ast.Name) and called.value.id == "st"
        if not place.startswith("prose.py")
    ]
    assert not straight, "write prose.caption and so on, which set the numbers"


def test_every_picture_chart_and_table_has_an_alternative() -> None:
    drawings = [(place, call) for place, call, called in calls() if called.attr in DRAWINGS]
    assert len(drawings) > 15
    assert [place for place, call in drawings if "alt" not in {one.arg for one in call.keywords}] == []


def texts(app: AppTest) -> Iterator[str]:
    """Yield the texts of a page, as far as they can be read without a browser."""
    for kind in (app.markdown, app.caption, app.header, app.info, app.success, app.warning, app.error):
        yield from (element.value for element in kind)
    for metric in app.metric:
        yield from (metric.value, metric.help or "")
    for element in app.get("image"):
        yield from (text for one in element.proto.imgs for text in (one.caption, one.alt))
    for viewer in viewers(app):
        for picture in viewer["pictures"]:
            yield picture["alternative"]
            yield from (figure["value"] for figure in picture["figures"])
        for legend in viewer["legends"]:
            yield from (*legend["words"], *(word for tick in legend["ticks"] for word in tick[1:]))
    for table in app.dataframe:
        yield from (str(cell) for cell in table.value.to_numpy().ravel() if isinstance(cell, str))
    for element in app.get("plotly_chart"):
        yield element.proto.alt
        yield from _of_figure(json.loads(element.proto.spec))


def _of_figure(part: Any, name: str = "") -> Iterator[str]:
    """Yield the texts of a figure: names, titles, labels and hover texts."""
    if isinstance(part, str) and name in ("text", "name", "ticktext", "hovertemplate", "title"):
        yield part
    elif isinstance(part, dict):
        for key, value in part.items():
            yield from _of_figure(value, key)
    elif isinstance(part, list):
        for one in part:
            yield from _of_figure(one, name)


def finished(app: AppTest) -> AppTest:
    """Run the page until no job is running."""
    end = time.monotonic() + 120
    while app.get("progress") or any("cancel" in (button.key or "") for button in app.button):
        assert time.monotonic() < end
        time.sleep(0.2)
        app.run()
    return app


def assert_written(app: AppTest) -> None:
    assert not app.exception
    said = [CODE.sub("", text) for text in texts(app)]
    assert len(said) > 5
    for text in said:
        assert not HYPHEN.search(text), text
        assert not GLUED.search(text), text


def test_home(open_page: OpenPage) -> None:
    assert_written(open_page("app.py"))


def test_a_negative_lag(open_page: OpenPage) -> None:
    app = open_page("pages/1_Sensor_lag.py")
    app.button_group(key="recordings").set_value("harbour").run()
    assert "\N{MINUS SIGN}31,234" in {metric.value for metric in app.metric}
    assert_written(app)


@pytest.mark.usefixtures("small_mazes")
def test_a_template_that_is_found_and_one_that_is_not(open_page: OpenPage) -> None:
    app = open_page("pages/2_Rocketman_search.py")
    assert_written(app)
    app.button_group(key="pictures").set_value("maze_dulled").run()
    app.slider(key="template.min_score").set_value(1.0).run()
    assert_written(app)


@pytest.mark.usefixtures("small_pairs")
def test_maps_of_negative_disparities(open_page: OpenPage) -> None:
    app = open_page("pages/3_Depth_maps.py")
    assert_written(app)
    app.slider(key=keys.SMALLEST).set_value(-20).run()
    app.button_group(key=keys.PART).set_value("Why this match?").run()
    assert_written(app)
    app.button_group(key=keys.PART).set_value("Scoreboard").run()
    assert_written(app)


@pytest.mark.usefixtures("small_boards")
def test_a_calibration(open_page: OpenPage) -> None:
    assert_written(finished(open_page("pages/4_Calibrate.py")))
