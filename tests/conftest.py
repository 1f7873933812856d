"""Fixtures and settings of all tests, including the real data if this machine has it."""

import gc
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings
from xdist.scheduler import LoadFileScheduling

from tests.snapshots import Snapshot, Texts, compare, place_of

PROJECT = Path(__file__).resolve().parents[1]

# Set before NumPy is imported: its threads busy-wait for each other and take the processor from the other workers.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Otherwise every process that a test starts recompiles all sources, which takes a second each.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# No deadline, because the first example of a compiled loop waits for its machine code, long on a busy machine. The same
# examples in every run, so that a failure is due to the change under test.
settings.register_profile("stereolag", deadline=None, derandomize=True, max_examples=40)
settings.load_profile("stereolag")


LONGEST_FIRST = ("browser", "package", "app", "core")

OF_WHOLE_PAGES = ("test_pages.py", "test_driving.py", "test_live_calibrate.py", "test_proxy.py")
"""Files for a browser that open every page, or one with the longest examples: half of the time of all such files."""


class TwoBrowsers(LoadFileScheduling):
    """Each worker takes a file at a time, but those for a browser in two halves: no third one starts a browser and an
    app of its own, which computes all examples anew."""

    def _split_scope(self, nodeid: str) -> str:
        file = Path(super()._split_scope(nodeid))
        if file.parent.name != "browser":
            return str(file)
        return "whole pages" if file.name in OF_WHOLE_PAGES else "parts of pages"


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> TwoBrowsers | None:
    return TwoBrowsers(config, log) if config.getvalue("dist") == "loadfile" else None


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """Run one worker more than there are cores: those with a browser or other processes often wait for them."""
    return (os.cpu_count() or 1) + 1


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Run the folders with the slowest files first: a worker takes one file at a time, and short ones fill the end."""
    order = {folder: at for at, folder in enumerate(LONGEST_FIRST)}
    items.sort(key=lambda item: order.get(item.nodeid.split("/")[1], -1))


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[Any]:
    """Look for no garbage while tests are collected, nor later among what was: every search would go through it all."""
    gc.disable()
    collected = yield
    gc.enable()
    gc.freeze()
    return collected


@pytest.fixture(scope="session", autouse=True)
def _unsynced_files() -> Iterator[None]:
    """Write no file through to the disk, which takes up to 20 ms each: a test's files need not survive a power cut."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("os.fsync", lambda descriptor: None)
        yield


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Return the folder of real recordings and pairs with ground truth; skip the test if it is absent."""
    folder = Path(os.environ.get("STEREOLAG_DATA", PROJECT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"the real data are not at {folder} (set STEREOLAG_DATA)")
    return folder


@pytest.fixture
def snapshot(request: pytest.FixtureRequest) -> Iterator[Snapshot]:
    """Return a function that compares the texts of a test with its snapshot, to be called once (tests/snapshots.py)."""
    assert request.node.name == request.node.originalname, "a test with parameters has no single snapshot: use a loop"
    calls = []

    def compared(texts: Texts) -> None:
        calls.append(texts)
        compare(place_of(request.path, request.node.name), texts)

    yield compared
    assert len(calls) == 1
