"""The command ``stereolag``, run in this process as by its console script."""

import json
from collections.abc import Callable
from typing import Any, NamedTuple


class Ran(NamedTuple):
    """The exit code and output of a command."""

    code: int
    out: str
    err: str

    @property
    def figures(self) -> dict[str, Any]:
        """Return the printed JSON, which must be a single line."""
        (line,) = self.out.splitlines()
        return dict(json.loads(line))


Command = Callable[..., Ran]


def assert_refused(told: Ran, command: str, code: int, said: str) -> None:
    """Check that a command did nothing and said why, in one line that starts with its name."""
    assert (told.code, told.out, len(told.err.splitlines())) == (code, "", 1)
    assert said in told.err and told.err.startswith(f"stereolag {command}: ")
