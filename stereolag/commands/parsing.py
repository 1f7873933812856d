"""Parsing of arguments for every command, exit codes, and errors of one sentence."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping
from typing import Any, NoReturn, TypeVar

T = TypeVar("T")

DONE, FAILED, WRONG_USAGE, NOT_FOUND, DAMAGED, INTERRUPTED = 0, 1, 2, 3, 4, 130
"""The exit codes of a command."""

CODES = (
    f"exit codes: {DONE} done; {FAILED} an input is refused, or a file cannot be read or written, said in one "
    f"sentence; {WRONG_USAGE} wrong usage, or a setting that is not allowed"
)


class CommandParser(argparse.ArgumentParser):
    """A parser that reports errors in one line.

    Parameters
    ----------
    command
        The name after ``stereolag``.
    description
        What the command does.
    usage
        Its arguments in one line.
    codes
        Further exit codes, as the end of a sentence.
    add_help
        Whether it answers ``--help``.
    """

    def __init__(
        self, command: str, description: str = "", usage: str = "", codes: str = "", *, add_help: bool = True
    ) -> None:
        self.command = command
        super().__init__(
            prog=f"stereolag {command}",
            description=description,
            usage=f"stereolag {command} {usage}",
            epilog=f"{CODES}{codes}.",
            allow_abbrev=False,
            add_help=add_help,
        )

    def error(self, message: str) -> NoReturn:
        """Print the message and exit."""
        self.exit(WRONG_USAGE, f"{self.prog}: {one_line(message)} (See {self.prog} --help.)\n")


def one_line(text: str) -> str:
    """Return a message as one line that ends like a sentence."""
    line = " ".join(text.split())
    return line if line.endswith((".", "!", "?")) else f"{line}."


def guarded(command: str, work: Callable[[], int]) -> int:
    """Return the exit code of some work; if an input is refused, print a sentence on the standard error.

    Parameters
    ----------
    command
        The command named in that sentence.
    work
        Returns the exit code when it is done.
    """
    try:
        return work()
    except KeyboardInterrupt:
        return INTERRUPTED
    except OSError as error:
        said = f"{error.filename}: {error.strerror}" if error.filename and error.strerror else str(error)
    except ValueError as error:
        said = str(error)
    except MemoryError:
        said = "There is not enough memory; give smaller images, or a smaller search."
    print(f"stereolag {command}: {one_line(said)}", file=sys.stderr)
    return FAILED


def read(reader: Callable[..., T], *paths: str, **options: Any) -> T:
    """Return the result of a reader for some files; its errors name them."""
    try:
        return reader(*paths, **options)
    except ValueError as error:
        raise ValueError(f"{', '.join(paths)}: {error}") from error


def add_output(parser: argparse.ArgumentParser) -> None:
    """Add the flag for a line of JSON to a parser."""
    parser.add_argument("--json", action="store_true", help="print one line of JSON, and nothing else")


def tell(figures: Mapping[str, Any], sentences: str, *, as_json: bool) -> None:
    """Print the figures as one line of JSON, with NaN and infinity as null, or else the sentences."""
    if as_json:
        from stereolag.io.results import figures_json

        print(figures_json(figures))
    else:
        print(sentences)
