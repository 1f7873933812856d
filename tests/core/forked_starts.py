"""Python processes with Numba already imported, forked from one parent to save a second each."""

from __future__ import annotations

import json
import os
import runpy
import socket
import subprocess
import sys
import tempfile
import traceback
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO


@dataclass(frozen=True)
class Start:
    """A running program: its standard input, output and error."""

    told: TextIO
    out: TextIO
    err: TextIO

    def ended(self, line: str = "") -> tuple[str, str]:
        """Send a last line of input; return the remaining output and the errors once it has ended."""
        with self.told, self.out, self.err:
            self.told.write(line)
            self.told.flush()
            return self.out.read(), self.err.read()


class Forks:
    """A process that has imported Numba and forks for every program to start."""

    def __init__(self) -> None:
        self._here, there = socket.socketpair()
        with there:
            command = [sys.executable, "-B", "-W", "error", __file__, str(there.fileno())]
            self._process = subprocess.Popen(command, pass_fds=[there.fileno()])

    def start(self, program: Path, *arguments: str, variables: Mapping[str, str]) -> Start:
        """Run a program like ``python program arguments``, with only these environment variables."""
        order = json.dumps([str(program), arguments, dict(variables)]).encode()
        (given, told), (out, printed), (err, erred) = os.pipe(), os.pipe(), os.pipe()
        socket.send_fds(self._here, [order], [given, printed, erred])
        for theirs in (given, printed, erred):
            os.close(theirs)
        return Start(os.fdopen(told, "w"), os.fdopen(out), os.fdopen(err))

    def close(self) -> None:
        """End the process; programs that are still running continue."""
        self._here.close()
        self._process.wait()


def _serve(orders: socket.socket) -> None:
    import numba

    numba.njit(lambda: 0)()  # the first compilation initialises Numba for all forks
    while True:
        order, streams, *_ = socket.recv_fds(orders, 65_536, 3)
        if not order:
            return
        if not os.fork():
            orders.close()
            _run(*json.loads(order), streams)
        for stream in streams:
            os.close(stream)


def _run(program: str, arguments: list[str], variables: dict[str, str], streams: list[int]) -> None:
    """Turn this fork into the requested program, and exit when it ends."""
    import numba

    code = 1
    try:
        for number, stream in enumerate(streams):
            os.dup2(stream, number)
            os.close(stream)
        sys.stdin = open(0, closefd=False)  # noqa: SIM115
        os.environ.clear()
        os.environ.update(variables)
        numba.config.reload_config()
        tempfile.tempdir = None
        sys.argv = [program, *arguments]
        sys.path[0] = str(Path(program).parent)
        runpy.run_path(program, run_name="__main__")
        code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


if __name__ == "__main__":
    # Nobody waits for the forks: ignoring the signal keeps them from becoming zombies.
    import signal

    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    _serve(socket.socket(fileno=int(sys.argv[1])))
