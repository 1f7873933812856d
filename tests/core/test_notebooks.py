"""Results in notebooks: the verdict comes first, pictures are decodable and small, and the example notebook runs."""

import ast
import base64
import html
import io
import json
import re
import sys
import tempfile
import webbrowser
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image

import stereolag as sl
from stereolag.core.showing import Shown
from stereolag.stereo.matcher import DisparityMap

NOTEBOOK = Path(__file__).resolve().parents[2] / "docs/notebook.ipynb"
LARGEST = 400_000

RANDOM = np.random.default_rng(0)
SOUND, OTHER = RANDOM.normal(size=(2, 4_000))
TONE = np.sin(2 * np.pi * np.arange(4_000) / 50)
IMAGE = RANDOM.integers(0, 256, (120, 160), dtype=np.uint8)
TWICE = IMAGE.copy()
TWICE[80:100, 10:40] = IMAGE[40:60, 70:100]


def disparities(values: np.ndarray) -> DisparityMap:
    reason = np.where(np.isfinite(values), sl.Reason.MEASURED, sl.Reason.LOW_TEXTURE).astype(np.uint8)
    return DisparityMap(values.astype(np.float32), reason, None, None, 0.1, sl.preset("fast", num_disparities=64))


BLANK = disparities(np.where(np.arange(90) < 45, 7.0, np.nan) + np.zeros((60, 1)))
FOUND = sl.match_template(IMAGE, IMAGE[40:60, 70:100])

RESULTS: dict[str, tuple[Shown, str]] = {
    "sure": (sl.signal_lag(SOUND[:-300], SOUND[300:]), "Sensor 1 hears it 0.006803 s (300.00"),
    "by votes": (sl.signal_lag(SOUND[:-300], SOUND[300:], method="sampled", seed=0), "Sensor 1 hears it"),
    "repeats": (sl.signal_lag(TONE, TONE), "Cannot tell: it repeats every 50 samples."),
    "nothing": (sl.signal_lag(SOUND, OTHER), "Nothing in common found"),
    "reversed": (sl.signal_lag(SOUND[:-300], -SOUND[300:]), "Nothing in common found, but the opposite sign fits"),
    "found": (FOUND, "Found at row 40, column 70."),
    "without scores": (replace(FOUND, score_map=None), "Found at row 40, column 70."),
    "two": (sl.match_template(TWICE, IMAGE[40:60, 70:100], max_matches=2), "Found at two places."),
    "look-alikes": (sl.match_template(TWICE, IMAGE[40:60, 70:100]), "Two places fit equally well."),
    "not found": (sl.match_template(IMAGE[:, :90], IMAGE[40:60, 100:130]), "Not found."),
    "map": (BLANK, "50.0 % of the pixels measured, 50.0 % blank.50.0 % without a measurement: too little texture"),
    "blank map": (disparities(np.full((60, 90), np.nan)), "No pixel has a disparity."),
    "noise": (disparities(64 * RANDOM.random((900, 1_200))), "100.0 % of the pixels measured."),
}


def words(shown: str) -> str:
    """Return the text that is read, without tags and typesetting."""
    return html.unescape(re.sub("<[^>]*>", "", shown)).replace("\N{NO-BREAK SPACE}", " ")


@pytest.mark.parametrize("name", RESULTS)
def test_a_result_begins_with_its_verdict_and_brings_its_picture(name: str) -> None:
    result, verdict = RESULTS[name]
    shown, png = result._repr_html_(), result._repr_png_()
    assert words(shown).startswith(verdict)
    assert len(shown) < LARGEST
    sources = re.findall(r'src="data:image/png;base64,([^"]+)"', shown)
    assert "http" not in shown and "script" not in shown and shown.count("src=") == len(sources)
    if name == "without scores":
        assert png is None and not sources
        return
    assert png is not None and [base64.b64decode(one) for one in sources] == [png]
    assert min(Image.open(io.BytesIO(png)).convert("RGB").size) > 60
    assert re.search(r'alt="[^"]{30,}"', shown)


@pytest.mark.parametrize("name", ["repeats", "nothing", "reversed"])
def test_what_is_not_sure_names_no_lag_as_found_no_time_and_no_metres(name: str) -> None:
    shown = words(RESULTS[name][0]._repr_html_())
    assert not re.search(r"hears it \d|\d m\b|m/s|\. Score", shown)
    assert "The highest point scores" in shown
    assert "44,100 samples a second" in shown


def test_the_image_shows_what_the_result_does_not_hold(browser: list[str]) -> None:
    for result, image, said in ((FOUND, IMAGE, "Framed: row 40"), (BLANK, IMAGE[:60, :90], "50.0 %")):
        path = sl.show(result, image)
        assert path is not None and browser.pop() == path.as_uri()
        page = path.read_text(encoding="utf-8")
        assert page.startswith("<!doctype html>") and said in page.replace("\N{NO-BREAK SPACE}", " ")
        assert page.count("<img") == 1


def test_in_a_notebook_a_result_is_displayed_and_in_a_terminal_opened(browser, monkeypatch):
    displayed: list[str] = []
    display = SimpleNamespace(display=displayed.append, HTML=str)
    for name, in_notebook in (("ZMQInteractiveShell", True), ("TerminalInteractiveShell", False)):
        shell = type(name, (), {})()
        monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda shell=shell: shell))
        monkeypatch.setitem(sys.modules, "IPython.display", display)
        assert (sl.show(BLANK) is None) == in_notebook
    assert displayed == [BLANK._repr_html_()]
    assert len(browser) == 1


@pytest.mark.parametrize(
    ("result", "image", "sentence"),
    [
        (3, None, "result is a int; what can be shown is a SignalLag, TemplateSearch, DisparityMap."),
        (BLANK, IMAGE, "image is 160 × 120 pixels and the map 90 × 60."),
        (RESULTS["sure"][0], IMAGE, "image is given for a SignalLag; two recordings have none."),
    ],
)
def test_what_cannot_be_shown_is_refused(result: Any, image: Any, sentence: str) -> None:
    with pytest.raises(ValueError, match=re.escape(sentence)):
        sl.show(result, image)


def test_the_example_notebook_holds_no_outputs_and_runs(browser: list[str]) -> None:
    cells = [cell for cell in json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == "code"]
    names: dict[str, Any] = {}
    said = []
    for cell in cells:
        assert (cell["outputs"], cell["execution_count"]) == ([], None)
        *lines, last = ast.parse("".join(cell["source"])).body
        exec(compile(ast.Module(lines, []), NOTEBOOK.name, "exec"), names)
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), NOTEBOOK.name, "eval"), names)
            said += [words(value._repr_html_())] if isinstance(value, Shown) else []
        else:
            exec(compile(ast.Module([last], []), NOTEBOOK.name, "exec"), names)
    lag, tone, search, depth = said
    assert lag.startswith("Sensor 2 hears it 1.136 s")
    assert tone.startswith("Cannot tell")
    assert search.startswith("Found at row 528, column 982.")
    assert " % of the pixels measured" in depth[:40]
    assert len(browser) == 2


@pytest.fixture
def browser(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return the list of addresses opened, in place of a browser; files go to a folder of the test."""
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    return opened
