"""The real app on a free port, and a real browser to open it."""

import os
import shutil
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, sync_playwright

PROJECT = Path(__file__).resolve().parents[2]

CHROMIUM = (os.environ.get("CHROMIUM", ""), "/usr/bin/chromium")
CHROMIUM_OPTIONS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    # A listener on a page's console makes V8 keep stack traces. Their positions, if computed only on demand, require
    # parsing all of Plotly again: half a second per page.
    "--js-flags=--no-enable-lazy-source-positions",
)

NGINX = shutil.which("nginx", path=os.pathsep.join([os.environ["PATH"], "/usr/sbin"]))  # Debian installs it there

PATIENCE_S = 120


def free_port() -> int:
    """Return a port without a listener."""
    with socket.socket() as listener:
        listener.bind(("localhost", 0))
        return int(listener.getsockname()[1])


def status_of(url: str) -> int | None:
    """Return the status of an answer, or None if there is none."""
    try:
        with urllib.request.urlopen(url, timeout=5) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as refused:
        with refused:
            return refused.code
    except (urllib.error.URLError, ConnectionError, TimeoutError):
        return None


def is_healthy(port: int) -> bool:
    return status_of(f"http://localhost:{port}/_stcore/health") == 200


def wait_until(
    met: Callable[[], object], process: subprocess.Popen[Any] | None = None, told: Callable[[], str] = str
) -> None:
    """Wait for a condition; fail after two minutes, or once the process that should meet it has ended."""
    end = time.monotonic() + PATIENCE_S
    while not met():
        assert process is None or process.poll() is None, told()
        assert time.monotonic() < end, told()
        time.sleep(0.05)


@contextmanager
def served_process(
    script: str = "app.py", *, port: int, environment: Mapping[str, str] | None = None
) -> Iterator[subprocess.Popen[bytes]]:
    """Run the app on a port with additional environment variables, and yield its process once it is healthy."""
    command = [sys.executable, "-m", "streamlit", "run", script, "--server.port", str(port)]
    options = ["--server.headless", "true"]
    variables = os.environ | {"PYTHONPATH": str(PROJECT)} | dict(environment or {})
    with subprocess.Popen(command + options, cwd=PROJECT, env=variables, stdout=subprocess.DEVNULL) as server:
        try:
            wait_until(lambda: is_healthy(port), server)
            yield server
        finally:
            server.terminate()


@contextmanager
def served_alone(
    command: Sequence[str | Path], port: int, printed: Path, *, ended_by: signal.Signals, **options: Any
) -> Iterator[subprocess.Popen[bytes]]:
    """Run a command that serves the app and prints to a file; expect it to end well by a signal."""
    with printed.open("w") as log, subprocess.Popen(command, stdout=log, stderr=log, **options) as server:
        try:
            wait_until(lambda: is_healthy(port), server, lambda: printed.read_text())
            yield server
        finally:
            server.send_signal(ended_by)
            assert server.wait(PATIENCE_S) == 0


@contextmanager
def served_app(
    script: str = "app.py", *, port: int | None = None, environment: Mapping[str, str] | None = None
) -> Iterator[str]:
    """Run the app, by default on a free port, and yield its address."""
    port = port or free_port()
    with served_process(script, port=port, environment=environment):
        yield f"http://localhost:{port}"


class Server:
    """The app on a free port, with restarts.

    Attributes
    ----------
    address
        Its address, the same after a restart.
    """

    def __init__(self) -> None:
        self._port = free_port()
        self.address = f"http://localhost:{self._port}"
        self._running = ExitStack()
        self.start()

    def start(self) -> None:
        self._running.enter_context(served_process(port=self._port))

    def stop(self) -> None:
        self._running.close()


def chromium_path() -> str | None:
    """Return the path of Chromium, at $CHROMIUM or in Debian's place; None if it is missing."""
    return next((path for path in CHROMIUM if Path(path).is_file()), None)


@contextmanager
def chromium(path: str, *, scale: float = 1) -> Iterator[Browser]:
    """Run headless Chromium with a single context: a page in its own context fetches 7 MB of scripts again."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=list(CHROMIUM_OPTIONS))
        browser.new_context(device_scale_factor=scale).new_page()
        try:
            yield browser
        finally:
            browser.close()
