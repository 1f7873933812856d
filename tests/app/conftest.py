"""Fixtures for pages under AppTest, without a browser."""

import json
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import streamlit as st
from streamlit.components.v2 import manifest_scanner
from streamlit.runtime.caching.cache_resource_api import clear_session_cache
from streamlit.runtime.scriptrunner.script_cache import ScriptCache
from streamlit.runtime.scriptrunner_utils import script_run_context
from streamlit.testing.v1 import AppTest, app_test, local_script_runner

from stereolag import Diagnosis, read_image, read_signal, samples
from stereolag.figures.pictures import as_rgb, png
from stereolag.ui import background_jobs, calibrate, streamlit_inside, uploads
from stereolag.ui.driving import inputs
from tests.app import uploads as uploaded

SESSION = "test session id"
"""Session id of every page that AppTest opens."""


@pytest.fixture(scope="session", autouse=True)
def without_a_browser() -> Iterator[None]:
    """Leave out what AppTest does too often, and what is done or waited for on account of a browser."""
    ask, only_scripts = local_script_runner.require_widgets_deltas, cache(ScriptCache)
    run = AppTest._run

    def wait(runner: local_script_runner.LocalScriptRunner, timeout: float = 3) -> None:
        """Sleep until a run has ended: AppTest polls every millisecond, and takes the lock from the page each time."""
        thread = runner._script_thread
        assert thread is not None
        thread.join(timeout)
        ask(runner, 0 if thread.is_alive() else 1)

    def run_without_a_failure(app: AppTest, *given: Any, **more: Any) -> AppTest:
        """Run a page: none may fail, in any run of any test."""
        run(app, *given, **more)
        assert not app.exception, [one.message for one in app.exception]
        return app

    with pytest.MonkeyPatch.context() as patch:
        # A server scans installed packages for components and compiles the pages only once.
        patch.setattr(manifest_scanner, "scan_component_manifests", cache(manifest_scanner.scan_component_manifests))
        for module in (app_test, local_script_runner):
            patch.setattr(module, "ScriptCache", only_scripts)
        # Hashes of messages save sending them again.
        patch.setattr(script_run_context, "populate_hash_if_needed", lambda message: None)
        patch.setattr(local_script_runner, "require_widgets_deltas", wait)
        patch.setattr(AppTest, "_run", run_without_a_failure)
        # Nobody has to draw a map first, and no second file is on its way.
        patch.setattr(streamlit_inside, "HEAD_START_S", 0)
        patch.setattr(uploads, "REPLACEMENT_WAIT_S", 0.1)
        # Without a server there are no ended sessions to forget, and the thread that does so would fail at times.
        patch.setattr(background_jobs, "_give_memory_back_after", lambda departures: None)
        yield


@pytest.fixture(autouse=True)
def a_new_visitor(request: pytest.FixtureRequest) -> None:
    """Clear the previous visitor's cache, because Streamlit sees the same session; the shared caches stay.

    Not in a file with ``ONE_VISITOR = True``, whose tests go on with the results of those before.
    """
    if not getattr(request.module, "ONE_VISITOR", False):
        clear_session_cache(SESSION)


@pytest.fixture
def empty_caches() -> None:
    """Clear the shared caches too, for tests that observe the computation."""
    st.cache_resource.clear()


@pytest.fixture(autouse=True)
def no_failure_logged(caplog: pytest.LogCaptureFixture) -> Iterator[None]:
    """Fail a test if a page failed: a page turns its own failures into a sentence, which a test may not look at."""
    yield
    failures = [record for record in caplog.get_records("call") if record.name == "stereolag" and record.exc_info]
    assert not failures, failures


DRIVE = ("left", "right", "disparity", "occlusion", "objects")


def with_camera_of_part(calibration: Path, folder: Path, row: int, col: int, rows: int, cols: int) -> Path:
    """Write the calibration of a part of the pictures to a folder, and return its path."""
    known = json.loads(calibration.read_text())
    known |= {"cx": known["cx"] - col, "cy": known["cy"] - row, "width": cols, "height": rows}
    (folder / "calibration.json").write_text(json.dumps(known))
    return folder / "calibration.json"


@pytest.fixture(scope="session")
def part_of_drive(tmp_path_factory: pytest.TempPathFactory) -> samples.DriveExample:
    """Return the road ahead in the first frames of the bundled drive."""
    (whole,), folder = samples.drives().values(), tmp_path_factory.mktemp("drive")
    row, col, rows, cols = 180, 240, 180, 400
    paths = {name: tuple(folder / f"{name}{number}.png" for number in range(4)) for name in DRIVE}
    for name, number in product(DRIVE, range(4)):
        image = read_image(getattr(whole, name)[number])[row : row + rows, col : col + cols]
        paths[name][number].write_bytes(uploaded.png(image, compress_level=1))
    calibration = with_camera_of_part(whole.calibration, folder, row, col, rows, cols)
    return replace(whole, calibration=calibration, **paths)


@pytest.fixture
def healthy_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    """Spare a test that does not ask for the doctor of drives the seconds that it takes."""
    monkeypatch.setattr(inputs, "diagnose_sequence", lambda sequence: Diagnosis((), None, (0, 64)))


@pytest.fixture(scope="session")
def parts_of_pairs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, samples.StereoExample]:
    """Return a crop of each bundled pair, a tenth of its area, with its ground truth and calibration."""
    parts = {}
    for name, whole in samples.stereo_pairs().items():
        folder = tmp_path_factory.mktemp(f"{name}-part")
        images = {one: read_image(getattr(whole, one)) for one in ("left", "right", "disparity", "occlusion")}
        height, width = images["left"].shape[:2]
        row, col = PART_OF_PAIR.get(name, ((height - 120) // 2, (width - 240) // 2))
        for one, image in images.items():
            (folder / f"{one}.png").write_bytes(uploaded.png(image[row : row + 120, col : col + 240], compress_level=1))
        paths = {one: folder / f"{one}.png" for one in images}
        calibration = with_camera_of_part(whole.calibration, folder, row, col, 120, 240)
        parts[name] = replace(whole, calibration=calibration, **paths)
    return parts


PART_OF_PAIR = {"cube": (80, 100), "road": (10, 560)}
"""First row and column of a crop that is not central: the cube at its nearest, and the sky over the road."""


@pytest.fixture(scope="session")
def parts_of_mazes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, samples.MazeExample]:
    """Return a sixteenth of each maze, with Rocketman in it."""
    folder, parts = tmp_path_factory.mktemp("mazes"), {}
    for name, whole in samples.mazes().items():
        row, col = whole.row - 200, whole.col - 200
        path = folder / f"{name}.png"
        path.write_bytes(png(as_rgb(read_image(whole.picture)[row : row + 400, col : col + 600])))
        parts[name] = replace(whole, picture=path, row=200, col=200)
    return parts


@pytest.fixture(scope="session")
def short_recordings(tmp_path_factory: pytest.TempPathFactory) -> dict[str, samples.RecordingExample]:
    """Return both pairs of recordings with their lags, made of parts of the coast, which are compared much faster."""
    folder, examples = tmp_path_factory.mktemp("recordings"), dict(samples.recordings())
    coast, harbour = examples["coast"], examples["harbour"]
    first, second = (read_signal(path).channels[0] for path in (coast.signal_1, coast.signal_2))
    for example, signals in ((coast, (first, second)), (harbour, (second[coast.lag + harbour.lag :], first))):
        paths = {side: folder / f"{example.name}.{side}.wav" for side in ("signal_1", "signal_2")}
        for path, signal in zip(paths.values(), signals, strict=True):
            path.write_bytes(uploaded.wav(signal[:100_000], 44_100))
        examples[example.name] = replace(example, **paths)
    return examples


@pytest.fixture(scope="module", autouse=True)
def small_examples(
    part_of_drive: samples.DriveExample,
    parts_of_pairs: dict[str, samples.StereoExample],
    parts_of_mazes: dict[str, samples.MazeExample],
    short_recordings: dict[str, samples.RecordingExample],
) -> Iterator[None]:
    """Make the pages of a test file show parts of their examples, and few and small drawn boards.

    The shared examples and results are cleared before and after: files run in any order. Tests in tests/core look at
    the whole examples.
    """
    smaller, whole = np.diag([0.55, 0.55, 1.0]), calibrate.drawn_rig()
    left, right = smaller @ whole.left_matrix, smaller @ whole.right_matrix
    rig = replace(whole, left_matrix=left, right_matrix=right, width=352, height=264)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(inputs, "drives", lambda: {part_of_drive.name: part_of_drive})
        patch.setattr(samples, "stereo_pairs", lambda: parts_of_pairs)
        patch.setattr(samples, "mazes", lambda: parts_of_mazes)
        patch.setattr(samples, "recordings", lambda: short_recordings)
        patch.setattr(calibrate, "drawn_rig", lambda: rig)
        patch.setattr(calibrate, "EXAMPLE_PAIRS", 6)
        patch.setattr(calibrate, "MISMATCHED_PAIR", 3)
        st.cache_resource.clear()
        yield
        st.cache_resource.clear()
