"""A page as a visitor without a browser sees it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import Any

import numpy as np
import pytest
import streamlit as st
from streamlit.components.v2 import manifest_scanner
from streamlit.runtime.caching.cache_resource_api import clear_session_cache
from streamlit.runtime.scriptrunner.script_cache import ScriptCache
from streamlit.runtime.scriptrunner_utils import script_run_context
from streamlit.testing.v1 import AppTest, app_test, local_script_runner

from stereolag import samples
from stereolag.figures.pictures import as_rgb, png
from stereolag.reading import read_image
from stereolag.ui import uploads
from stereolag.ui.calibrate import examples, result
from stereolag.ui.depth import maps
from stereolag.ui.driving import frames
from tests.app import keys
from tests.app import uploads as uploaded

PROJECT = Path(__file__).resolve().parents[2]

OpenPage = Callable[..., AppTest]

SESSION = "test session id"
"""Of every page that AppTest opens."""


@pytest.fixture(scope="session", autouse=True)
def once_as_by_a_server() -> Iterator[None]:
    """Look for components in all installed packages, and compile the pages, once: AppTest does both for every run."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(manifest_scanner, "scan_component_manifests", cache(manifest_scanner.scan_component_manifests))
        patch.setattr(app_test, "ScriptCache", cache(ScriptCache))
        yield


@pytest.fixture(scope="session", autouse=True)
def nothing_sent_again() -> Iterator[None]:
    """Make no digests of what is sent: by them a server finds what a browser has already, and here there is none."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(script_run_context, "populate_hash_if_needed", lambda message: None)
        yield


@pytest.fixture(scope="session", autouse=True)
def woken_at_the_end() -> Iterator[None]:
    """Sleep until a run has ended: AppTest asks every millisecond, and takes the lock from the page each time."""
    ask = local_script_runner.require_widgets_deltas

    def wait(runner: local_script_runner.LocalScriptRunner, timeout: float = 3) -> None:
        thread = runner._script_thread
        assert thread is not None
        thread.join(timeout)
        ask(runner, 0 if thread.is_alive() else 1)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(local_script_runner, "require_widgets_deltas", wait)
        yield


@pytest.fixture(scope="session", autouse=True)
def nobody_on_the_way() -> Iterator[None]:
    """Do not wait for a browser to draw, nor for a second file to arrive: here there is no browser, and none comes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(maps, "HEAD_START_S", 0)
        patch.setattr(uploads, "ARRIVAL_S", 0.1)
        yield


@pytest.fixture(scope="module", autouse=True)
def a_new_server() -> None:
    """Forget, once a file, what visitors share, examples and what was computed of them: files run in any order."""
    st.cache_resource.clear()


@pytest.fixture(autouse=True)
def a_new_visitor() -> None:
    """Forget what the visitor before kept, who is the same one to Streamlit; what visitors share stays."""
    clear_session_cache(SESSION)


@pytest.fixture
def empty_caches() -> None:
    """Forget before a test what visitors share too: where it is told by the computing."""
    st.cache_resource.clear()


@pytest.fixture(autouse=True)
def no_failure_logged(caplog: pytest.LogCaptureFixture) -> Iterator[None]:
    """A page answers its own failures with a sentence: that a test does not see one is not enough."""
    yield
    failures = [record for record in caplog.get_records("call") if record.name == "stereolag" and record.exc_info]
    assert not failures, failures


@pytest.fixture
def open_page() -> OpenPage:
    """Return what opens a page by its path, with some controls as the visitor had them before, and runs it."""

    def opened(path: str, before: Mapping[str, Any] = MappingProxyType({})) -> AppTest:
        app = AppTest.from_file(PROJECT / "app.py", default_timeout=60)
        for key, value in before.items():
            app.session_state[key] = value
        if path != "app.py":
            app.switch_page(path)
        return app.run()

    return opened


@pytest.fixture
def open_unfolded(open_page: OpenPage) -> OpenPage:
    """Return what opens a page with all its controls drawn."""

    def opened(path: str) -> AppTest:
        app = open_page(path)
        if "Depth" in path:
            for fold in keys.FOLDS:
                app.session_state[fold] = True
            app.run()
        if "Rocketman" in path:
            app.session_state["template.see_why"] = "Damage it"
            app.run()
        return app

    return opened


@pytest.fixture(scope="module")
def small_boards() -> Iterator[None]:
    """Let the page that calibrates draw its example with few pairs of half the pixels."""
    smaller, whole = np.diag([0.7, 0.7, 1.0]), examples.drawn_rig()
    left, right = smaller @ whole.left_matrix, smaller @ whole.right_matrix
    rig = replace(whole, left_matrix=left, right_matrix=right, width=448, height=336)
    with pytest.MonkeyPatch.context() as patch:
        for module in (examples, result):
            patch.setattr(module, "drawn_rig", lambda: rig)
        patch.setattr(examples, "PAIRS", 6)
        patch.setattr(examples, "WRONG_PAIR", 3)
        st.cache_resource.clear()
        yield
        st.cache_resource.clear()


@contextmanager
def examples_of(module: ModuleType, kind: str, parts: Mapping[str, Any]) -> Iterator[None]:
    """Let a module have other examples of a kind, and nothing that was made of those before."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, kind, lambda: parts)
        st.cache_resource.clear()
        yield
        st.cache_resource.clear()


@pytest.fixture(scope="module")
def short_drive() -> Iterator[None]:
    """Let the page of drives begin with the first frames of its example, all of which tests/core looks at."""
    (whole,) = samples.drives().values()
    paths = {name: getattr(whole, name)[:8] for name in ("left", "right", "disparity", "occlusion", "objects")}
    with examples_of(frames, "drives", {whole.name: replace(whole, **paths)}):
        yield


@pytest.fixture(scope="session")
def parts_of_pairs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, samples.StereoExample]:
    """Return a sixth of each bundled pair, with all that is known of it."""
    parts = {}
    for name, whole in samples.stereo_pairs().items():
        folder = tmp_path_factory.mktemp(f"{name}-part")
        images = {one: read_image(getattr(whole, one)) for one in ("left", "right", "disparity", "occlusion")}
        height, width = images["left"].shape[:2]
        row, col = PART_OF_PAIR.get(name, ((height - 160) // 2, (width - 320) // 2))
        for one, image in images.items():
            (folder / f"{one}.png").write_bytes(uploaded.png(image[row : row + 160, col : col + 320], compress_level=1))
        known = json.loads(whole.calibration.read_text())
        known |= {"cx": known["cx"] - col, "cy": known["cy"] - row, "width": 320, "height": 160}
        (folder / "calibration.json").write_text(json.dumps(known))
        paths = {one: folder / f"{one}.png" for one in images}
        parts[name] = replace(whole, calibration=folder / "calibration.json", **paths)
    return parts


PART_OF_PAIR = {"cube": (80, 100), "road": (10, 560)}
"""Its first row and column, where not the middle: what is as near as the cube is as a whole, the sky over the road."""


@pytest.fixture(scope="module")
def small_pairs(parts_of_pairs: dict[str, samples.StereoExample]) -> Iterator[None]:
    """Let the depth page match a part of each example, all of which other tests of this folder and tests/core match."""
    with examples_of(samples, "stereo_pairs", parts_of_pairs):
        yield


@pytest.fixture(scope="session")
def parts_of_mazes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, samples.MazeExample]:
    """Return a sixteenth of each maze, he in it."""
    folder, parts = tmp_path_factory.mktemp("mazes"), {}
    for name, whole in samples.mazes().items():
        row, col = whole.row - 200, whole.col - 200
        path = folder / f"{name}.png"
        path.write_bytes(png(as_rgb(read_image(whole.picture)[row : row + 400, col : col + 600])))
        parts[name] = replace(whole, picture=path, row=200, col=200)
    return parts


@pytest.fixture(scope="module")
def small_mazes(parts_of_mazes: dict[str, samples.MazeExample]) -> Iterator[None]:
    """Let the page of templates search a part of each maze."""
    with examples_of(samples, "mazes", parts_of_mazes):
        yield


def viewers(app: AppTest) -> list[dict[str, Any]]:
    """Return what the sets of linked pictures on a page are told about themselves."""
    all_of_them = [element.proto for element in app.get("bidi_component")]
    return [json.loads(one.json) for one in all_of_them if one.component_name == "stereolag.linked_pictures"]


def outlines(app: AppTest) -> dict[str, str]:
    """Return the paths that lie over the maps, by the name of the set of linked pictures."""
    all_of_them = [element.proto for element in app.get("bidi_component")]
    drawn = [json.loads(one.json) for one in all_of_them if one.component_name == "stereolag.outlines"]
    return {one["name"]: one["path"] for one in drawn}


def figures(app: AppTest) -> dict[str, dict[str, str]]:
    """Return the numbers below each map of the depth page, by title and label."""
    bench = next(viewer for viewer in viewers(app) if viewer["name"] == "depth.bench")
    return {
        picture["title"]: {figure["label"]: figure["value"] for figure in picture["figures"]}
        for picture in bench["pictures"]
        if picture["figures"]
    }


@pytest.fixture
def shown() -> Callable[[AppTest], str]:
    """Return what makes a digest of every picture, chart and headline on a page; times do not count."""

    def digest(app: AppTest) -> str:
        pictures = [picture.url for element in app.get("image") for picture in element.proto.imgs]
        charts = [element.proto.spec for element in app.get("plotly_chart")]
        headlines = [header.value for header in app.header]
        linked = viewers(app)
        for picture in (picture for viewer in linked for picture in viewer["pictures"]):
            picture["figures"] = [figure for figure in picture["figures"] if figure["label"] != "Took"]
        all_shown = (*pictures, *charts, *headlines, json.dumps(linked), json.dumps(outlines(app)))
        return hashlib.sha256("\0".join(all_shown).encode()).hexdigest()

    return digest
