"""What several tests of the library need."""

from __future__ import annotations

import pytest
from commanded import Command, Ran

from stereolag.commands import main


@pytest.fixture
def ran(capsys: pytest.CaptureFixture[str]) -> Command:
    """Return a function that runs a command as its console script does and returns its exit code and output."""

    def run(*arguments: object) -> Ran:
        try:
            code = main([str(one) for one in arguments])
        except SystemExit as ended:
            code = int(ended.code or 0)
        return Ran(code, *capsys.readouterr())

    return run
