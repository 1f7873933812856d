"""The console command ``stereolag``: one subcommand a module of this package."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from stereolag.commands import serving
from stereolag.version import VERSION


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a subcommand.

    Parameters
    ----------
    arguments
        Those of the command line unless given.

    Returns
    -------
    int
        The code to exit with.
    """
    parser = argparse.ArgumentParser(prog="stereolag", description="Lag by correlation.", allow_abbrev=False)
    parser.add_argument("--version", action="version", version=VERSION)
    commands = parser.add_subparsers(dest="command", required=True, metavar="command")
    serving.add_options(commands.add_parser("app", help="start the app in a browser's reach", allow_abbrev=False))
    options, others = parser.parse_known_args(arguments)
    return serving.start(options, others, remedy="stereolag app --port 8600")
