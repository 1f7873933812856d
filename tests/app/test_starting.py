"""``make run``: without a page it prints one sentence. What it prints and serves otherwise: ``tests/package``."""

import os
import platform
import shutil
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from stereolag.commands.serving import page_fault
from stereolag.ui.streamlit_inside import served_fault
from tests.browser.serving import PROJECT, free_port, served_process

LAUNCHER = "stereolag/commands/serving.py"
PATIENCE_S = 120

STORES = """
import ctypes, sys, threading
from stereolag.commands.serving import share_freed_memory
if "shared" in sys.argv:
    share_freed_memory()
for _ in range(4):
    taken, end = threading.Barrier(2), threading.Event()
    threading.Thread(target=lambda: (bytes(10_000), taken.wait(), end.wait()), daemon=True).start()
    taken.wait()
libc = ctypes.CDLL(None)
libc.fopen.restype = ctypes.c_void_p
file = libc.fopen(sys.argv[1].encode(), b"w")
libc.malloc_info(0, ctypes.c_void_p(file))
libc.fclose(ctypes.c_void_p(file))
"""
"""Writes what glibc keeps of the freed memory of a few threads into a file."""


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    """Return this process's environment, but without its own import path."""
    return os.environ | {"PYTHONPATH": str(tmp_path), "PYTHONUNBUFFERED": "1"}


@pytest.fixture
def port() -> int:
    return free_port()


def refused(environment: dict[str, str], *arguments: str, project: Path = PROJECT) -> str:
    """Run the launcher in a case where it must give up, and return the one line that it prints."""
    command = [sys.executable, "-P", LAUNCHER, *arguments]
    ran = subprocess.run(
        command, cwd=project, env=environment, capture_output=True, text=True, check=False, timeout=PATIENCE_S
    )
    assert (ran.returncode, ran.stdout) == (1, "")
    (line,) = ran.stderr.splitlines()
    return line


def test_an_install_without_its_own_files_says_so(environment: dict[str, str], port: int, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(PROJECT / "stereolag/commands", copy / "stereolag/commands")
    for name in ("__init__.py", "__init__.pyi", "version.py"):  # a package, or the one installed would be found
        shutil.copy(PROJECT / "stereolag" / name, copy / "stereolag")
    shutil.copy(PROJECT / "app.py", copy)
    line = refused(environment, "--port", str(port), project=copy)
    assert line.startswith("stereolag cannot start: ModuleNotFoundError: No module named 'stereolag.")


def test_a_process_that_dies_is_told_of(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "sitecustomize.py").write_text("import os; os.abort()")
    monkeypatch.syspath_prepend(tmp_path)
    assert page_fault() == "Python ended with -6."


def test_a_port_in_use_is_told_of(environment: dict[str, str]) -> None:
    with socket.create_server(("", 0)) as listener:
        taken = listener.getsockname()[1]
        line = refused(environment, "--port", str(taken))
    assert line == (
        f"stereolag cannot start: Port {taken} cannot be used (Address already in use): "
        "name another, for example PORT=8600 make run."
    )
    assert refused(environment, "--port", "70000").endswith("70000 is not a port: ports go up to 65535.")


FAULTS = {
    "raise ValueError('nothing\\nthere')": "ValueError: nothing there",
    "import streamlit as st; st.error('Something failed.')": "Something failed.",
    "import streamlit as st; st.warning('The file is large.')": None,
}


def test_a_probe_tells_what_is_wrong_with_the_page_of_a_healthy_process(environment, port, tmp_path):
    page, part = tmp_path / "page.py", tmp_path / "part.py"
    page.write_text("import")
    with served_process(str(page), port=port, environment={"STREAMLIT_CLIENT_SHOW_ERROR_DETAILS": "full"}):
        assert served_fault(port) == "The page cannot be compiled."
        page.write_text(f"exec(open({str(part)!r}).read())")
        for script, fault in FAULTS.items():
            part.write_text(script)
            assert served_fault(port) == fault
        probe = [sys.executable, "-P", LAUNCHER, "--probe", "--port", str(port)]
        assert subprocess.run(probe, cwd=PROJECT, env=environment, check=False).returncode == 0
        part.write_text("raise ValueError('nothing\\nthere')")
        line = refused(environment, "--probe", "--port", str(port))
        assert line == "stereolag serves no page: ValueError: nothing there"


def test_a_probe_tells_that_nobody_listens(port: int) -> None:
    assert "refused" in (served_fault(port) or "")


@pytest.mark.skipif(not shutil.which("make"), reason="make is not installed")
def test_make_run_starts_it_on_the_port_that_is_named() -> None:
    command = ["make", "--no-print-directory", "--dry-run", "run", "PORT=8642"]
    made = subprocess.run(command, cwd=PROJECT, capture_output=True, text=True, check=True)
    assert made.stdout.splitlines()[-1].endswith(f"python -P {LAUNCHER} --port 8642")
    assert "http" not in made.stdout


@pytest.mark.skipif("glibc" not in platform.libc_ver(), reason="other allocators share all memory")
def test_freed_memory_is_kept_once_for_all_threads_of_a_server(tmp_path: Path) -> None:
    stores = []
    for asked in ("shared", "by default"):
        subprocess.run([sys.executable, "-c", STORES, str(tmp_path / "stores.xml"), asked], cwd=PROJECT, check=True)
        stores.append((tmp_path / "stores.xml").read_text().count("<heap "))
    assert stores[0] == 1 < stores[1]
