"""Every page: it opens and leads to the others, says what it found, and writes numbers and units as readers expect."""

from __future__ import annotations

import ast
import json
import re
import time
from collections.abc import Iterator
from typing import Any

import pytest
from streamlit.testing.v1 import AppTest

from stereolag.core.typography import UNITS, typeset
from stereolag.ui.navigation import ICONS, PAGES
from tests.app import keys, uploads
from tests.app.conftest import figures, viewers
from tests.app.pages import DEPTH, FIND, LAG, PROJECT, OpenPage, numbers

# Otherwise their jobs run on during later tests.
pytestmark = pytest.mark.usefixtures("small_boards", "short_drive", "small_mazes", "small_pairs")

PATIENCE_S = 60.0

HYPHEN = re.compile(r"(?<![\w.,)\]`=“'-])-(?=\.?\d)")
GLUED = re.compile(rf"\d(?:\*\*)? ?(?:{UNITS})(?!\w)")
"""A unit glued to its number or separated from it by a breaking space."""
CODE = re.compile(r"`[^`]*`")

ELEMENTS = {"markdown", "caption", "header", "info", "success", "warning", "error"}
DRAWINGS = {"plotly_chart", "image", "dataframe", "audio"}


def announced(app: AppTest) -> bool:
    """Return whether a page announces its headline; wait for the job that some pages start with."""
    end = time.monotonic() + PATIENCE_S
    while not any(one.proto.component_name == "stereolag.announcement" for one in app.get("bidi_component")):
        if time.monotonic() > end:
            return False
        time.sleep(0.1)
        app.run()
    return True


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


def assert_written(app: AppTest) -> None:
    assert not app.exception
    said = [CODE.sub("", text) for text in texts(app)]
    assert len(said) >= 3
    for text in said:
        assert not HYPHEN.search(text), text
        assert not GLUED.search(text), text


@pytest.mark.parametrize("path", PAGES)
def test_every_page_runs_and_links_to_every_other(open_page: OpenPage, path: str) -> None:
    app = open_page(path)
    assert not app.error
    assert len(app.title) == 1
    assert len(app.get("page_link")) >= len(PAGES)
    # A picture stored as a separate file could be replaced before the browser fetches it.
    assert all(one.url.startswith("data:image/") for element in app.get("image") for one in element.proto.imgs)
    assert path == "app.py" or announced(app)
    assert_written(app)


def test_every_page_is_linked_and_described_and_has_an_icon() -> None:
    assert sorted(PAGES) == ["app.py", *sorted(f"pages/{path.name}" for path in (PROJECT / "pages").glob("*.py"))]
    described = (PROJECT / "docs" / "pages.md").read_text(encoding="utf-8")
    names = [name for name, _ in PAGES.values()][1:]
    for name in names:
        assert f"\n| {name} |" in described
        assert f"\n## {name}\n" in described
    assert {icon.stem for icon in ICONS.glob("*.svg")} == {name.lower().replace(" ", "_") for name in names}


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


def test_home_shows_the_three_measurements_as_computed(open_page: OpenPage) -> None:
    app = open_page("app.py")
    prose = " ".join(block.value for block in app.markdown)
    assert "50,082 samples" in prose
    assert typeset("378.17 m") in prose
    assert "row **200**, column **200**" in prose
    assert len(app.get("image")) == 2
    assert not app.get("plotly_chart")  # whose script is larger than all else on this page


def test_search_page_says_where_he_is_or_plainly_that_he_was_not_found_and_what_to_try(open_page: OpenPage) -> None:
    app = open_page(FIND)
    assert app.header[0].value == "Found at row 200, column 200"
    scored = []
    for method in ("fft", "sampled"):
        app.button_group(key="template.method").set_value(method).run()
        assert app.header[0].value == "Found at row 200, column 200"
        scored.append(int(numbers(app)["Candidates scored"].replace(",", "")))
    assert scored[1] < scored[0]
    app.button_group(key="pictures").set_value("maze_dulled").run()
    assert app.header[0].value == "Not found"
    assert "FFT" in app.warning[0].value
    app.button_group(key="template.method").set_value("fft")
    app.slider(key="template.min_score").set_value(1.0).run()
    assert app.header[0].value == "Not found"
    assert "The best place scores" in app.warning[0].value
    assert_written(app)


def test_depth_page_shows_both_methods_with_their_figures(open_page: OpenPage) -> None:
    app = open_page(DEPTH)
    assert {name: [*numbers] for name, numbers in figures(app).items()} == {
        name: ["Computed in", "Coverage", "Bad-2", "EPE"] for name in ("Convolution", "StereoBM")
    }
    (bench,) = viewers(app)
    titles = [one["title"] for one in bench["pictures"] if one["thumbnail"]]
    assert titles == ["Left image", "Right image", "Ground truth"]
    assert bench["legends"][0]["words"] == ["FAR", "NEAR"]
    app.slider(key=keys.SMALLEST).set_value(-20).run()
    for part in ("Why this match?", "Scoreboard"):
        app.button_group(key=keys.PART).set_value(part).run()
        assert_written(app)


SCENE = uploads.png(uploads.texture(60, 90))


@pytest.mark.parametrize(
    ("path", "inputs", "given", "missing"),
    [
        (LAG, "recordings", ("file_1", "a.wav", uploads.wav(uploads.noise(500))), "Sensor 2"),
        (FIND, "pictures", ("template", "a.png", SCENE), "Image"),
        (DEPTH, "pairs", ("left", "a.png", SCENE), "Right image"),
    ],
)
def test_a_page_opens_on_one_thing_to_try_and_says_which_file_is_missing(
    open_page: OpenPage, path: str, inputs: str, given: tuple[str, str, bytes], missing: str
) -> None:
    app = open_page(path)
    assert len([one for one in app.markdown if "Try first" in one.value]) == 1
    assert not (app.info or app.warning or app.error)
    app.button_group(key=inputs).set_value("own").run()
    assert "the page shows the example" in app.info[0].value
    assert any("stay in this session" in one.value for one in app.caption)
    name, file, data = given
    app.file_uploader(key=f"{inputs}.{name}").upload(file, data, "application/octet-stream")
    app.run()
    assert app.info[0].value.startswith(f"Still missing: {missing}. Until then the page shows the example")
