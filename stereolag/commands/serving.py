"""Start the app if it can serve a page, and say why if it cannot.

``stereolag app``, or ``python -P stereolag/commands/serving.py``: run as a file, it imports nothing from the library,
and can therefore report that the library cannot be imported. Streamlit's health address says nothing about the pages:
``--check`` opens one without a server, ``--probe`` requests one from a running server.
"""

from __future__ import annotations

import argparse
import ctypes
import logging
import os
import socket
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, suppress
from importlib import import_module
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]
INSTALLED = PACKAGE / "app" / "app.py"
APP = INSTALLED if INSTALLED.is_file() else PACKAGE.parent / "app.py"
"""The home page: inside the installed package, or beside it in a checkout."""

DESCRIPTION = """Start the app. Any other arguments go to "streamlit run", for example --server.address 127.0.0.1;
a path in it is absolute, since the app runs in its own folder."""

SERVER_MODULES = "io.guard", "ui.streamlit_inside", "warming"
"""Modules that the server needs, imported while the page is checked."""

MAX_WAIT_S = 300
"""Time limit for the first page: without machine code on disk, all of its loops are compiled."""


def check_page() -> None:
    """Open the home page once, as Streamlit's own tests do: without a browser or a server.

    Raises
    ------
    SystemExit
        The page shows an error, which is the message.
    """
    logging.disable()  # the server will log the same again
    from stereolag.ui.streamlit_inside import faults_of_script

    faults = faults_of_script(APP, MAX_WAIT_S)
    if faults:
        raise SystemExit(faults[0])


def page_fault() -> str | None:
    """Return in one line why the home page cannot be served, or None if it can.

    The page is opened in a separate process, which may fail in any way and whose memory is released.
    """
    command = [sys.executable, "-P", __file__, "--check"]
    # The import path of the server: Streamlit puts the app's folder first.
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(APP.parent), *sys.path])}
    ran = subprocess.run(command, cwd=APP.parent, env=environment, capture_output=True, text=True, check=False)
    if ran.returncode == 0:
        return None
    lines = ran.stderr.split("Traceback (most recent call last):")[-1].strip().splitlines()
    return lines[-1] if lines else f"Python ended with {ran.returncode}."


def port_fault(port: int, remedy: str) -> str | None:
    """Return in one line why a port cannot be listened on, and how to name another; None if it can."""
    dual_stack = socket.has_dualstack_ipv6()
    family = socket.AF_INET6 if dual_stack else socket.AF_INET
    try:
        with closing(socket.create_server(("", port), family=family, dualstack_ipv6=dual_stack)):
            return None
    except OverflowError:
        return f"{port} is not a port: ports go up to 65535."
    except OSError as error:
        reason = os.strerror(error.errno or 0)
        return f"Port {port} cannot be used ({reason}): name another, for example {remedy}."


M_ARENA_MAX = -8
"""The number of an option in glibc's ``malloc.h``."""


def share_freed_memory() -> None:
    """Let all threads share freed memory: by default glibc keeps that of each thread for this thread alone.

    Each would keep the memory of its largest job. This acts on threads that have not started yet; other allocators
    ignore it.
    """
    if sys.platform == "linux":
        with suppress(AttributeError):
            ctypes.CDLL(None).mallopt(M_ARENA_MAX, 1)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that are not Streamlit's to a parser."""
    parser.description = DESCRIPTION
    parser.add_argument("--port", type=int, default=8501, help="port to listen on; 8501 unless given")
    parser.add_argument("--check", action="store_true", help="open the home page once instead, without a server")
    parser.add_argument("--probe", action="store_true", help="ask the app on the port for the home page instead")


def start(options: argparse.Namespace, others: Sequence[str], *, remedy: str) -> int:
    """Start the app and return when it is stopped.

    Parameters
    ----------
    options
        Those of `add_options`.
    others
        All other arguments: options of ``streamlit run``.
    remedy
        A command that uses another port, suggested if this one is taken.

    Returns
    -------
    int
        The exit code: 1 if the app cannot be started or serves no page, after one line that says why.
    """
    share_freed_memory()
    try:
        Path.home()
    except RuntimeError:  # Streamlit needs it only to look for settings there
        os.environ["HOME"] = str(APP.parent)
    # Streamlit also reads .streamlit/config.toml of the current folder, where another app's settings must not apply.
    os.chdir(APP.parent)
    sys.path.insert(0, str(APP.parent))  # as Streamlit will
    if options.check:
        check_page()
        return 0
    if options.probe:
        from stereolag.ui.streamlit_inside import served_fault

        fault = served_fault(options.port)
        if fault:
            print(f"stereolag serves no page: {fault}", file=sys.stderr)
        return 1 if fault else 0
    try:
        fault = port_fault(options.port, remedy)
        if not fault:
            with ThreadPoolExecutor(1) as background:
                imported = background.submit(lambda: [import_module(f"stereolag.{name}") for name in SERVER_MODULES])
                fault = page_fault()
        if fault:
            print(f"stereolag cannot start: {fault}", file=sys.stderr)
            return 1
        imported.result()
        from stereolag.io.guard import start_guard
        from stereolag.ui.streamlit_inside import run_server
        from stereolag.warming import compiling_the_rest, warm

        start_guard()
        warm()  # so that the first visitor does not wait for it, and the time shown is that of the map alone
        with compiling_the_rest():
            run_server(APP, options.port, [*others])
    except KeyboardInterrupt:  # before the server handles it
        return 130
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Start the app from this file.

    Parameters
    ----------
    arguments
        Those of the command line by default.

    Returns
    -------
    int
        The exit code.
    """
    parser = argparse.ArgumentParser(allow_abbrev=False)
    add_options(parser)
    options, others = parser.parse_known_args(arguments)
    return start(options, others, remedy="PORT=8600 make run")


if __name__ == "__main__":
    sys.exit(main())
