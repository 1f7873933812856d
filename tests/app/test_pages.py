"""Every page: it opens and leads to the others, says what it found, and writes numbers and units as readers expect."""

import ast
import json
import re
from collections.abc import Iterator
from functools import cache
from typing import Any

import pytest
from streamlit.testing.v1 import AppTest

from stereolag.core.typography import UNITS, typeset
from stereolag.ui.navigation import ICONS, PAGES
from tests.app import keys, uploads
from tests.app.pages import DEPTH, FIND, LAG, PROJECT, moved, open_page, until, uploaded
from tests.app.reading import captions, figures, numbers, viewers

HYPHEN = re.compile(r"(?<![\w.,)\]`=“'-])-(?=\.?\d)")
GLUED = re.compile(rf"\d(?:\*\*)? ?(?:{UNITS})(?!\w)")
"""A unit glued to its number or separated from it by a breaking space."""
CODE = re.compile(r"`[^`]*`")

ELEMENTS = {"markdown", "caption", "header", "info", "success", "warning", "error"}
DRAWINGS = {"plotly_chart", "image", "dataframe", "audio"}


def announced(app: AppTest) -> bool:
    return any(one.proto.component_name == "stereolag.announcement" for one in app.get("bidi_component"))


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
    said = [CODE.sub("", text) for text in texts(app)]
    assert len(said) >= 3
    for text in said:
        assert not HYPHEN.search(text), text
        assert not GLUED.search(text), text


@pytest.mark.parametrize("path", PAGES)
def test_every_page_runs_and_links_to_every_other(path: str) -> None:
    app = open_page(path)
    assert not app.error
    assert len(app.title) == 1
    assert len(app.get("page_link")) >= len(PAGES)
    # A picture stored as a separate file could be replaced before the browser fetches it.
    assert all(one.url.startswith("data:image/") for element in app.get("image") for one in element.proto.imgs)
    if path != "app.py":  # some pages start with a job
        until(lambda: announced(app.run()), pause_s=0.1)
    assert_written(app)


def test_every_page_is_linked_and_described_and_has_an_icon() -> None:
    assert sorted(PAGES) == ["app.py", *sorted(f"pages/{path.name}" for path in (PROJECT / "pages").glob("*.py"))]
    described = (PROJECT / "docs" / "pages.md").read_text(encoding="utf-8")
    names = [name for name, _ in PAGES.values()][1:]
    for name in names:
        assert f"\n| {name} |" in described
        assert f"\n## {name}\n" in described
    assert {icon.stem for icon in ICONS.glob("*.svg")} == {name.lower().replace(" ", "_") for name in names}


@cache
def calls() -> list[tuple[str, ast.Call, ast.Attribute]]:
    """Return the calls of methods and functions of modules in the code of the pages, with their places."""
    files = [PROJECT / "app.py", *(PROJECT / "pages").glob("*.py"), *(PROJECT / "stereolag/ui").rglob("*.py")]
    return [
        (f"{path.name}:{node.lineno}", node, node.func)
        for path in files
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)
    ]


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


def test_home_shows_the_three_measurements_as_computed() -> None:
    app = open_page("app.py")
    prose = " ".join(block.value for block in app.markdown)
    assert "50,082 samples" in prose
    assert typeset("378.17 m") in prose
    assert "row **200**, column **200**" in prose
    assert len(app.get("image")) == 2
    assert not app.get("plotly_chart")  # whose script is larger than all else on this page


def test_search_page_says_where_he_is_or_plainly_that_he_was_not_found_and_what_to_try() -> None:
    app, scored = open_page(FIND), []
    for method in ("fft", "sampled"):
        moved(app, {"template.method": method})
        assert app.header[0].value == "Found at row 200, column 200"
        scored.append(int(numbers(app)["Candidates scored"].replace(",", "")))
    assert scored[1] < scored[0]
    assert app.slider(key="template.max_rotation").disabled
    assert any("no score map" in caption.value for caption in app.caption)
    moved(app, {"pictures": "maze_dulled"})
    assert app.header[0].value == "Not found"
    assert "FFT" in app.warning[0].value
    assert_written(app)


def test_depth_page_shows_both_methods_with_their_figures() -> None:
    app = open_page(DEPTH)
    labels = ["Computed in", "Coverage", "Bad-2", "EPE"]
    assert {name: [*of_map] for name, of_map in figures(app).items()} == {"Convolution": labels, "StereoBM": labels}
    (bench,) = viewers(app)
    titles = [one["title"] for one in bench["pictures"] if one["thumbnail"]]
    assert titles == ["Left image", "Right image", "Ground truth"]
    assert bench["legends"][0]["words"] == ["FAR", "NEAR"]
    moved(app, {keys.SMALLEST: -20})
    for part in ("Why this match?", "Scoreboard"):
        assert_written(moved(app, {keys.PART: part}))


SCENE = uploads.texture(60, 90)


@pytest.mark.parametrize(
    ("path", "inputs", "given", "missing"),
    [
        (LAG, "recordings", {"file_1": ("a.wav", uploads.wav(uploads.noise(500)))}, "Sensor 2"),
        (FIND, "pictures", uploads.pngs(template=SCENE), "Image"),
        (DEPTH, "pairs", uploads.pngs(left=SCENE), "Right image"),
    ],
)
def test_a_page_opens_on_one_thing_to_try_and_says_which_file_is_missing(path, inputs, given, missing):
    app = open_page(path)
    assert len([one for one in app.markdown if "Try first" in one.value]) == 1
    assert not (app.info or app.warning or app.error)
    moved(app, {inputs: "own"})
    assert "the page shows the example" in app.info[0].value
    assert "stay in this session" in captions(app)
    uploaded(app, inputs, **given)
    assert app.info[0].value.startswith(f"Still missing: {missing}. Until then the page shows the example")
