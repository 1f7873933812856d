"""Machine code: kept where this user alone can write, never older than its sources, and never in the way of a start."""

from __future__ import annotations

import os
import shutil
import stat
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from stereolag.loops.compilation import STAMP, forget_older_code, is_private

PROJECT = Path(__file__).resolve().parents[2]

SMALL_LAG = """
import numpy as np
import stereolag as sl
sound = np.random.default_rng(0).normal(size=400)
print(sl.signal_lag(sound[4:], sound[:-4], method="direct", max_lag=9).lag)
"""
"""A measurement of few loops: each start without machine code compiles them."""

TWO_LOOPS = """
import inner
from compilation import compiled
@compiled
def outer(number):
    return inner.inner(number)
print(outer(1))
"""
INNER = """
from compilation import compiled
@compiled
def inner(number):
    return number + {}
"""


@pytest.fixture
def install(tmp_path: Path) -> Path:
    """Return a folder that holds a copy of the package, without machine code, and nothing else."""
    folder = tmp_path / "install"
    shutil.copytree(PROJECT / "stereolag", folder / "stereolag", ignore=shutil.ignore_patterns("__pycache__"))
    return folder


@pytest.fixture
def loops(tmp_path: Path) -> Path:
    """Return a folder with the decorator alone and two loops, of which one calls the other."""
    folder = tmp_path / "loops"
    folder.mkdir()
    shutil.copy(PROJECT / "stereolag/loops/compilation.py", folder)
    (folder / "outer.py").write_text(TWO_LOOPS)
    (folder / "inner.py").write_text(INNER.format(1))
    return folder


def run(
    folder: Path, *arguments: str, before: Sequence[str] = (), **variables: str
) -> subprocess.CompletedProcess[str]:
    """Run Python on what a folder holds, by a user who has no home, with a temporary folder beside it."""
    temporary = folder.parent / "temporary"
    temporary.mkdir(exist_ok=True)
    nowhere = folder.parent / "a file"
    nowhere.touch()
    environment = {
        "PATH": os.environ["PATH"],
        "PYTHONPATH": str(folder),
        "PYTHONDONTWRITEBYTECODE": "1",
        "XDG_CACHE_HOME": str(nowhere),
        "TMPDIR": str(temporary),
    }
    command = [*before, sys.executable, "-W", "error", *arguments]
    return subprocess.run(
        command, cwd=folder.parent, env=environment | variables, capture_output=True, text=True, check=False
    )


def code_in(folder: Path) -> dict[str, int]:
    """Return the files of machine code anywhere in a folder, and when each was written."""
    return {str(file): file.stat().st_mtime_ns for file in folder.rglob("*.nbc")}


def test_a_first_start_keeps_machine_code_beside_the_sources_and_says_nothing(install: Path) -> None:
    ran = run(install, "-c", SMALL_LAG)
    assert (ran.stdout, ran.stderr) == ("4\n", "")
    assert code_in(install / "stereolag")
    assert not code_in(install.parent / "temporary")


def test_without_a_place_beside_the_sources_code_is_kept_in_the_temporary_folder(install: Path) -> None:
    (install / "stereolag/loops/__pycache__").touch()  # a file: not even root makes a folder of it
    first = run(install, "-c", SMALL_LAG)
    assert first.stdout == "4\n", first.stderr
    kept = code_in(install.parent / "temporary")
    second = run(install, "-c", SMALL_LAG)
    assert second.stdout == "4\n"
    assert kept
    assert code_in(install.parent / "temporary") == kept
    for ran in (first, second):
        (line,) = ran.stderr.splitlines()
        assert line.startswith(f"Machine code is kept in {install.parent / 'temporary'}")
        assert line.endswith("set NUMBA_CACHE_DIR to a folder that only this user can write to.")


def test_a_read_only_install_works_though_it_holds_older_code(install: Path) -> None:
    mount = ["unshare", "--mount", "sh", "-c", 'mount --bind "$0" "$0" && mount -o remount,ro,bind "$0" && exec "$@"']
    command = [*mount, str(install)]
    if not shutil.which("unshare") or subprocess.run([*command, "true"], capture_output=True, check=False).returncode:
        pytest.skip("this user may not mount a folder read-only")
    older = install / "stereolag/loops/__pycache__/bands.older-1.py311.nbi"
    older.parent.mkdir()
    older.touch()
    os.utime(older, (0, 0))
    ran = run(install, "-c", SMALL_LAG, before=command)
    assert ran.stdout == "4\n", ran.stderr
    (line,) = ran.stderr.splitlines()
    assert "(Read-only file system)" in line
    assert older.exists()


def test_older_code_that_cannot_be_deleted_is_not_used(install: Path) -> None:
    stuck = install / "stereolag/loops/__pycache__/bands.older-1.py311.nbi"
    stuck.mkdir(parents=True)
    os.utime(stuck, (0, 0))
    ran = run(install, "-c", SMALL_LAG)
    assert ran.stdout == "4\n", ran.stderr
    assert len(ran.stderr.splitlines()) == 1


def test_without_any_place_loops_are_compiled_anew(loops: Path) -> None:
    (loops / "__pycache__").touch()
    squatted = loops.parent / "temporary" / f"stereolag-{os.geteuid()}"
    squatted.mkdir(parents=True)
    squatted.chmod(0o777)
    ran = run(loops, str(loops / "outer.py"))
    assert ran.stdout == "2\n", ran.stderr
    (line,) = ran.stderr.splitlines()
    assert line.startswith("Machine code is not kept, and compiled anew at every start")
    assert not code_in(loops.parent)


def test_the_folder_that_the_operator_names_is_used_and_nothing_is_said(loops: Path) -> None:
    (loops / "__pycache__").touch()
    ran = run(loops, str(loops / "outer.py"), NUMBA_CACHE_DIR=str(loops.parent / "named"))
    assert (ran.stdout, ran.stderr) == ("2\n", "")
    assert code_in(loops.parent / "named")


@pytest.mark.parametrize("mtime", [0, 4_000_000_000])
def test_an_answer_is_never_that_of_older_sources_whatever_their_dates(loops: Path, mtime: int) -> None:
    def answer() -> str:
        for source in loops.glob("*.py"):
            os.utime(source, (mtime, mtime))
        ran = run(loops, str(loops / "outer.py"))
        assert ran.stderr == ""
        return ran.stdout

    assert answer() == "2\n"
    kept = code_in(loops)
    assert answer() == "2\n"
    assert code_in(loops) == kept
    (loops / "inner.py").write_text(INNER.format(2))
    assert answer() == "3\n"


def test_many_at_once_forget_older_code(tmp_path: Path) -> None:
    for name in range(200):
        (tmp_path / f"{name}.nbc").touch()
    with ThreadPoolExecutor(8) as executor:
        list(executor.map(forget_older_code, [tmp_path] * 16))
    assert [file.name for file in tmp_path.iterdir()] == [STAMP]
    (tmp_path / "newer.nbc").touch()
    forget_older_code(tmp_path)
    assert (tmp_path / "newer.nbc").exists()


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="Windows keeps a user's folders apart by itself")
def test_a_folder_in_which_others_can_write_is_not_private(tmp_path: Path) -> None:
    folder = tmp_path / "between" / "code"
    folder.mkdir(parents=True)
    folder.chmod(0o700)
    assert is_private(folder)
    folder.chmod(0o722)
    assert not is_private(folder)
    folder.chmod(0o700)
    folder.parent.chmod(0o777)
    assert not is_private(folder)
    folder.parent.chmod(0o777 | stat.S_ISVTX)
    assert is_private(folder)
    link = tmp_path / "link"
    link.symlink_to(folder)
    assert not is_private(link)


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can give a folder away")
def test_a_folder_of_another_user_is_not_private(tmp_path: Path) -> None:
    folder = tmp_path / "theirs" / "code"
    folder.mkdir(parents=True)
    folder.chmod(0o700)
    os.chown(folder, 1234, 1234)
    assert not is_private(folder)
    os.chown(folder, 0, 0)
    os.chown(folder.parent, 1234, 1234)
    assert not is_private(folder)
