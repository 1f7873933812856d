"""Files that a button makes when it is pressed, kept until the browser has fetched them."""

from collections.abc import Callable
from unittest.mock import MagicMock

import pytest
from streamlit.runtime import Runtime
from streamlit.runtime.media_file_manager import MediaFileManager
from streamlit.runtime.memory_media_file_storage import MemoryMediaFileStorage

from stereolag.ui import background_jobs, downloads


class Clock:
    """Replacement for the timers of `private_files`: their callbacks run when `pass_by` is called."""

    def __init__(self) -> None:
        self.waiting: dict[object, Callable[[], None]] = {}

    def timer(self, seconds: float, call: Callable[[], None]) -> MagicMock:
        assert seconds == downloads.KEPT_S
        timer = MagicMock()
        timer.start.side_effect = lambda: self.waiting.update({timer: call})
        timer.cancel.side_effect = lambda: self.waiting.pop(timer, None)
        return timer

    def pass_by(self) -> None:
        for ended in [*self.waiting.values()]:
            ended()


@pytest.fixture
def files(monkeypatch: pytest.MonkeyPatch) -> MediaFileManager:
    """Return a server's file store, without a server."""
    store = MediaFileManager(MemoryMediaFileStorage("/media"))
    server = MagicMock(spec=Runtime, media_file_mgr=store)
    server._get_async_objs.return_value.eventloop.call_soon_threadsafe.side_effect = lambda call: call()
    monkeypatch.setattr(Runtime, "_instance", server)
    monkeypatch.setattr(downloads, "_recent_files", downloads._RecentFiles())
    return store


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr("threading.Timer", clock.timer)
    return clock


def made_file(files: MediaFileManager, text: str) -> str:
    """Draw a download button for a file of that text, press it, and return the file name for the browser to fetch."""
    before = set(files._deferred_callables)
    downloads.download_button("Curve CSV", lambda: text, "curve.csv", "text/csv", key=text)
    (pressed,) = set(files._deferred_callables) - before
    return files.execute_deferred(pressed).rpartition("/")[2]


def end_runs(files: MediaFileManager) -> None:
    """End three script runs, as other visitors' runs end."""
    for _ in range(3):
        files.remove_orphaned_files()


def fetched(files: MediaFileManager, name: str) -> bytes | None:
    found = files.read_file(name)
    return found and found.content


def test_a_file_can_be_fetched_after_the_runs_of_other_visitors_until_its_time_is_over(files, clock):
    for times in range(3):
        names = [made_file(files, f"lag {sign}{times}") for sign in "−+"]
        end_runs(files)
        assert [fetched(files, name) for name in names] == [f"lag {sign}{times}".encode() for sign in "−+"]
        clock.pass_by()
        end_runs(files)
        assert [fetched(files, name) for name in names] == [None, None]
    made_file(files, "lag 3")  # at coordinates that were used before: there were never more than two files
    kept = {at for one in files._files_by_session_and_coord.values() for at in one if at.startswith("private_files.")}
    assert len(kept) == 2


def test_many_large_files_are_not_all_kept(files, clock, monkeypatch):
    monkeypatch.setattr(downloads, "MAX_KEPT_BYTES", 100)
    names = [made_file(files, text) for text in ("a" * 60, "b" * 30, "c" * 50, "d" * 300)]
    end_runs(files)
    assert [fetched(files, name) for name in names] == [None, None, None, b"d" * 300]
    names = [made_file(files, text) for text in ("e" * 40, "f" * 40, "g" * 40)]
    end_runs(files)
    assert [fetched(files, name) for name in names] == [None, b"f" * 40, b"g" * 40]
    clock.pass_by()
    end_runs(files)
    assert [fetched(files, name) for name in names] == [None, None, None]


def test_it_is_given_back_with_the_memory_of_the_last_visitor(files: MediaFileManager, clock: Clock) -> None:
    name = made_file(files, "lag 5")
    clock.pass_by()
    files.remove_orphaned_files()  # as happens when their session ends
    assert fetched(files, name)
    background_jobs.give_memory_back()
    assert fetched(files, name) is None
