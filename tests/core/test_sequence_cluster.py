"""The same job on a Dask cluster: bit-identical maps, and nothing lost with a worker."""

import importlib.util
import multiprocessing
import os
import signal
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from small_drives import archive, contents, write_folders

from stereolag import preset
from stereolag.sequences import SequenceSettings, SequenceState, Steadiness, open_sequence, run_sequence, running

pytestmark = pytest.mark.filterwarnings("ignore")
if importlib.util.find_spec("distributed") is None:
    pytest.skip("Dask is not installed", allow_module_level=True)
DISPARITIES = [4 + number % 6 for number in range(12)]
ACCURATE = preset("accurate", num_disparities=16)


@pytest.fixture(scope="module", autouse=True)
def bare_main() -> Iterator[None]:
    """Keep new processes from running the main program again: tests of pages leave the app there."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "__main__", ModuleType("__main__"))
        yield


@pytest.fixture(scope="module")
def cluster(bare_main: None) -> Iterator[Any]:
    """Start a scheduler and two workers, each in its own process."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import distributed  # here, because it takes half a second of every collection

        with distributed.LocalCluster(
            n_workers=2,
            threads_per_worker=1,
            processes=True,
            dashboard_address=None,
            scheduler_port=0,
            silence_logs="CRITICAL",
        ) as started:
            yield started


@pytest.fixture
def folders(tmp_path: Path) -> tuple[Path, Path]:
    return write_folders(tmp_path / "drive", DISPARITIES)[:2]


def flickers(out: Path) -> list[str]:
    return [line.split(",")[-2] for line in (out / "frames.csv").read_text().splitlines()]


def test_a_worker_killed_midway_loses_nothing(cluster: Any, folders: tuple[Path, Path], tmp_path: Path) -> None:
    """Some frames wait for others, and are kept on the workers meanwhile."""
    settings = SequenceSettings(steadiness=Steadiness())
    killed: list[int] = []

    async def stay_away() -> None:
        pass

    def kill(state: SequenceState) -> None:
        if state.done < 2 or killed:
            return
        # A worker takes its results and its running tasks with it.
        busy = {
            address: len(worker.processing) + len(worker.has_what)
            for address, worker in cluster.scheduler.workers.items()
        }
        victim = max(busy, key=lambda address: busy[address])
        assert busy[victim] > 0
        nanny = next(one for one in cluster.workers.values() if one.worker_address == victim)
        killed.append(nanny.pid)
        nanny.instantiate = stay_away  # no replacement: the other worker finishes alone
        os.kill(killed[0], signal.SIGKILL)

    picture = folders[1] / "007.png"
    whole = picture.read_bytes()
    picture.write_bytes(whole[:400])
    sequence, here = open_sequence(*folders), tmp_path / "threads"
    away = tmp_path / "cluster"
    result = run_sequence(
        sequence, {"maps": ACCURATE}, away, settings=settings, scheduler=cluster.scheduler_address, progress=kill
    )
    assert killed
    assert (result.matched, list(result.damaged)) == (11, ["007"])
    run_sequence(sequence, {"maps": ACCURATE}, here, settings=settings)
    assert contents(away) == contents(here)
    assert flickers(away) == flickers(here)


def test_a_run_goes_on_here_where_a_cluster_left_it(cluster, tmp_path, monkeypatch):
    """The workers read the archive from its bytes; looks come while frames are on their way from a worker."""
    monkeypatch.setattr(running, "POLL_S", 0.001)
    out, states = tmp_path / "out", list[SequenceState]()

    def cancelled() -> bool:
        return bool(states) and states[-1].done >= 3

    sequence, address = open_sequence(archive(DISPARITIES)), cluster.scheduler_address
    result = run_sequence(
        sequence, {"maps": ACCURATE}, out, scheduler=address, progress=states.append, cancelled=cancelled
    )
    assert result.cancelled and result.matched == 3
    away = contents(out)
    assert run_sequence(sequence, {"maps": ACCURATE}, out).finished_before == len(away) == 3
    assert len(contents(out)) == 12
    run_sequence(sequence, {"maps": ACCURATE}, tmp_path / "here")
    assert away.items() <= contents(tmp_path / "here").items()


def test_ctrl_c_in_a_terminal_leaves_local_workers_to_the_command(folders, tmp_path, capfd, monkeypatch):
    monkeypatch.setattr(running, "available_cores", lambda: 1)  # one worker is enough to show it
    others = {process.pid for process in multiprocessing.active_children()}
    told = set[int]()

    def interrupt(state: SequenceState) -> None:
        if state.done >= 2 and not told:
            told.update(one.pid for one in multiprocessing.active_children() if one.pid and one.pid not in others)
            for worker in told:
                os.kill(worker, signal.SIGINT)

    result = run_sequence(open_sequence(*folders), ACCURATE, tmp_path / "out", scheduler="local", progress=interrupt)
    assert told and result.matched == 12
    assert capfd.readouterr().err == ""
