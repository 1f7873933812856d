"""The real app on a free port, and a real browser to open it."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path

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

START_TIMEOUT_S = 60


def free_port() -> int:
    """Return a port without a listener."""
    with socket.socket() as listener:
        listener.bind(("localhost", 0))
        return int(listener.getsockname()[1])


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
            _wait_until_healthy(server, f"http://localhost:{port}/_stcore/health")
            yield server
        finally:
            server.terminate()


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


def _wait_until_healthy(server: subprocess.Popen[bytes], url: str) -> None:
    deadline = time.monotonic() + START_TIMEOUT_S
    while time.monotonic() < deadline and server.poll() is None:
        try:
            with urllib.request.urlopen(url, timeout=5):
                return
        except (urllib.error.URLError, ConnectionError, TimeoutError):
            time.sleep(0.1)
    raise RuntimeError(f"the app did not start within {START_TIMEOUT_S} s")
