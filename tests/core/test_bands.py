"""Rows shared among the cores, and the cores among the callers."""

from __future__ import annotations

import threading
import time

import pytest

from stereolag.loops.bands import available_cores, over_bands, row_bands


@pytest.mark.parametrize("rows", [1, 2, 7, 100])
@pytest.mark.parametrize("most_rows", [1, 3, 1000])
def test_bands_cover_every_row_once(rows: int, most_rows: int) -> None:
    seen: list[int] = []
    lock = threading.Lock()

    def work(first: int, end: int) -> None:
        assert end - first <= most_rows
        with lock:
            seen.extend(range(first, end))

    told: list[float] = []
    over_bands(work, rows, most_rows=most_rows, progress=told.append)
    assert sorted(seen) == list(range(rows))
    assert told == sorted(told)
    assert len(told) == len(row_bands(rows, most_rows))
    assert told[-1] == 1


def test_a_short_job_does_not_wait_for_all_of_a_long_one() -> None:
    """Submitting all bands at once used to make the short job wait for the last of them."""
    bands = 40 * available_cores()
    begun = threading.Event()

    def slow(first: int, end: int) -> None:
        begun.set()
        time.sleep(0.02)

    long_job = threading.Thread(target=over_bands, args=(slow, bands), kwargs={"most_rows": 1})
    long_job.start()
    begun.wait()
    over_bands(lambda first, end: None, 2)
    assert long_job.is_alive()
    long_job.join()


def test_the_first_error_ends_the_job() -> None:
    done: list[int] = []

    def work(first: int, end: int) -> None:
        if first == 0:
            raise ValueError("a bad row")
        time.sleep(0.01)
        done.append(first)

    with pytest.raises(ValueError, match="a bad row"):
        over_bands(work, 1000, most_rows=1)
    assert len(done) < 900
