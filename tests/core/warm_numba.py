"""A process with Numba ready that forks for each script to run: a new interpreter would take seconds to load Numba."""

from __future__ import annotations

import json
import os
import runpy
import signal
import socket
import sys
import traceback
from pathlib import Path

import numba


def run(folder: str, arguments: list[str], environment: dict[str, str]) -> None:
    """Run ``outer.py`` of a folder as a script."""
    os.environ.clear()
    os.environ.update(environment)
    sys.path.insert(0, str(Path(folder).parents[1]))
    sys.argv[1:] = arguments
    runpy.run_path(f"{folder}/outer.py", run_name="__main__")


if __name__ == "__main__":
    numba.njit(lambda: 0)()  # the first compilation initialises Numba for all forks
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    asked = socket.socket(fileno=int(sys.argv[1]))
    while True:
        request, streams, _, _ = socket.recv_fds(asked, 65_536, 3)
        if not request:
            break
        if not os.fork():
            for number, stream in enumerate(streams):
                os.dup2(stream, number)
                os.close(stream)
            asked.close()
            try:
                run(*json.loads(request))
            except BaseException:
                traceback.print_exc()
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(0)
        for stream in streams:
            os.close(stream)
        asked.send(b"taken")
