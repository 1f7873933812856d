"""``make run``: it prints one working address and contacts no other host; without a page it prints one sentence."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from queue import Queue
from threading import Thread

import pytest
from streamlit.proto.ForwardMsg_pb2 import ForwardMsg

from stereolag.commands.serving import page_fault
from stereolag.streamlit_inside import served_fault
from tests.browser.serving import PROJECT, free_port, served_process
from tests.protocol import visit

LAUNCHER = "stereolag/commands/serving.py"
PATIENCE_S = 120

WATCH = """
import os, sys
def note(event, details):
    if event in ("socket.connect", "socket.sendto"):
        address = details[1]
    elif event in ("socket.getaddrinfo", "socket.gethostbyname"):
        address = details
    else:
        return
    host = address[0] if isinstance(address, tuple) else None
    if host not in (None, "", "localhost", "127.0.0.1", "::1", "::", "0.0.0.0"):
        with open(os.environ["ASKED"], "a") as asked:
            asked.write(f"{event} {host}\\n")
sys.addaudithook(note)
"""
"""Runs in every Python process that starts, and logs every access to another host."""


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    """Return an environment that logs accesses to other hosts in a file called asked."""
    (tmp_path / "sitecustomize.py").write_text(WATCH)
    return os.environ | {"PYTHONPATH": str(tmp_path), "ASKED": str(tmp_path / "asked"), "PYTHONUNBUFFERED": "1"}


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


@contextmanager
def started(environment: dict[str, str], port: int) -> Iterator[tuple[subprocess.Popen[str], Queue[str]]]:
    """Run the launcher, wait for its first printed address, and yield the process and its lines of output."""
    command = [sys.executable, "-P", LAUNCHER, "--port", str(port)]
    lines: Queue[str] = Queue()
    with subprocess.Popen(
        command, cwd=PROJECT, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as process:
        assert process.stdout is not None
        Thread(target=lambda stream: [lines.put(line) for line in stream], args=[process.stdout], daemon=True).start()
        try:
            end = time.monotonic() + PATIENCE_S
            while not any("http" in line for line in list(lines.queue)):
                assert process.poll() is None, list(lines.queue)
                assert time.monotonic() < end
                time.sleep(0.05)
            yield process, lines
        finally:
            process.kill()


def test_it_serves_a_page_at_the_one_address_it_prints_and_asks_nobody(
    environment: dict[str, str], port: int, tmp_path: Path
) -> None:
    with (tmp_path / "sitecustomize.py").open("a") as more:  # it needs no home folder
        more.write("\nimport pwd\npwd.getpwuid = {}.__getitem__  # as for a user nobody knows\n")
    del environment["HOME"]
    with started(environment, port) as (process, lines):
        (printed,) = [line.split()[-1] for line in list(lines.queue) if "http" in line]
        assert printed == f"http://localhost:{port}"
        messages = visit(printed)
        assert messages[-1].script_finished == ForwardMsg.FINISHED_SUCCESSFULLY
        shown = [message.delta.new_element for message in messages if message.WhichOneof("type") == "delta"]
        assert any("50,082 samples" in element.markdown.body for element in shown)
        assert not [element for element in shown if element.WhichOneof("type") == "exception"]
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=PATIENCE_S) == 0
    everything = "".join(lines.queue)
    assert everything.count("://") == 1, everything
    assert "Traceback" not in everything
    assert not (tmp_path / "asked").exists(), (tmp_path / "asked").read_text()


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


def test_a_probe_tells_what_is_wrong_with_the_page_of_a_healthy_process(
    environment: dict[str, str], port: int, tmp_path: Path
) -> None:
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
