"""The console command ``stereolag``: each subcommand is a module of this package.

The module of a measuring command has `run`, which takes its arguments and returns the exit code. It is imported on
demand, so that no command waits for the imports of another.
"""

from __future__ import annotations

import argparse
import atexit
import gc
import os
import sys
from collections.abc import Sequence
from importlib import import_module

from stereolag.version import VERSION

MEASURING = {
    "depth": "the depth map of a stereo pair",
    "lag": "the lag between two recordings",
    "find": "the place of a template in an image",
    "sequence": "the depth maps of every frame that a stereo camera took",
    "calibrate": "the calibration of a stereo camera from pictures of a board",
}
"""The measuring commands, each a module of this package, and their results; new ones are listed here."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a subcommand.

    Parameters
    ----------
    arguments
        Those of the command line by default.

    Returns
    -------
    int
        The exit code.
    """
    given = list(sys.argv[1:] if arguments is None else arguments)
    if given and given[0] in MEASURING:
        # Without this, pydantic looks for plugins in everything that is installed.
        os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
        # Without this, a second thread keeps a core busy, waiting for matrices.
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        gc.disable()  # imports leave no garbage
        from stereolag.commands.arguments import exit_code_of

        module = import_module(f"{__name__}.{given[0]}")
        gc.enable()
        atexit.register(gc.freeze)  # the collection at exit would take 0.07 s
        return exit_code_of(given[0], lambda: int(module.run(given[1:])))

    from stereolag.commands import serving

    parser = argparse.ArgumentParser(prog="stereolag", description="Lag by correlation.", allow_abbrev=False)
    parser.add_argument("--version", action="version", version=VERSION)
    commands = parser.add_subparsers(dest="command", required=True, metavar="command")
    serving.add_options(commands.add_parser("app", help="start the app, for use in a browser", allow_abbrev=False))
    for name, result in MEASURING.items():
        commands.add_parser(name, help=result)
    options, others = parser.parse_known_args(given)
    return serving.start(options, others, remedy="stereolag app --port 8600")
