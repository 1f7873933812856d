"""Functions of the app's JavaScript modules, called from Python by Node."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

EVALUATE = Path(__file__).with_name("evaluate.js")


def node_path() -> str:
    """Return the path of Node: the one of the set-up, beside Python, or the system's; without one, skip the test."""
    path = shutil.which("node", path=os.pathsep.join((str(Path(sys.executable).parent), os.environ["PATH"])))
    if path is None:
        pytest.skip("Node is not installed")
    return path


class Node:
    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [node_path(), str(EVALUATE)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, encoding="utf-8"
        )

    def call(self, module: str, code: str, given: Any = None) -> Any:
        """Return what a function `(module, given) => …` returns; NaN becomes None, typed arrays become lists."""
        assert self._process.stdin is not None and self._process.stdout is not None
        self._process.stdin.write(json.dumps({"module": module, "code": code, "given": given}) + "\n")
        self._process.stdin.flush()
        answer = self._process.stdout.readline()
        assert answer, f"{module}: {code} failed; Node's message is on stderr"
        return json.loads(answer)

    def stop(self) -> None:
        self._process.communicate()
