"""The arguments of a command: its parser, its exit codes and errors of one sentence, and settings as flags.

Each field of a settings class is a flag. Their values go into a document that the settings themselves validate, so that
a flag is refused with the same :class:`~stereolag.core.settings.SettingsError` as a control or a file.

A library that makes flags, pydantic-settings, needs as many lines here and takes a tenth of a command's time to import.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from types import NoneType
from typing import TYPE_CHECKING, Any, Generic, NoReturn, TypeVar, get_args

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from stereolag.core.settings import (
    KIND,
    Problem,
    Settings,
    SettingsError,
    allowed_values,
    base_type,
    choices,
    nested,
    unknown_setting,
)

if TYPE_CHECKING:
    from stereolag.core.inputs import Image

T = TypeVar("T")
S = TypeVar("S", bound=Settings)

DONE, WRONG_USAGE, DOUBTFUL, FAILED, INTERRUPTED = 0, 2, 3, 4, 130
"""The exit codes of a command."""

CODES = (
    f"exit codes: {DONE} done; {WRONG_USAGE} wrong usage, or a setting that is not allowed; {FAILED} an input is "
    "refused, or a file cannot be read or written: one sentence says why"
)


class CommandParser(argparse.ArgumentParser):
    """A parser that reports errors in one line, with the flag for a line of JSON.

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
        Whether it has the flag ``--help``.
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
        self.add_argument("--json", action="store_true", help="print one line of JSON, and nothing else")

    def error(self, message: str) -> NoReturn:
        """Print the message and exit."""
        self.exit(WRONG_USAGE, f"{self.prog}: {one_line(message)} (See {self.prog} --help.)\n")


def one_line(text: str) -> str:
    """Return a message as one line that ends like a sentence."""
    line = " ".join(text.split())
    return line if line.endswith((".", "!", "?")) else f"{line}."


def exit_code_of(command: str, work: Callable[[], int]) -> int:
    """Run the work of a command and return the exit code; if an input is refused, print a sentence on standard error.

    Parameters
    ----------
    command
        The name of the command, for that sentence.
    work
        Returns the exit code if no input is refused.
    """
    try:
        return work()
    except KeyboardInterrupt:
        return INTERRUPTED
    except OSError as error:
        message = f"{error.filename}: {error.strerror}" if error.filename and error.strerror else str(error)
    except ValueError as error:
        message = str(error)
    except MemoryError:
        message = "There is not enough memory; give smaller images, or a smaller search."
    print(f"stereolag {command}: {one_line(message)}", file=sys.stderr)
    return FAILED


def read(reader: Callable[..., T], *paths: str | None, **options: Any) -> T:
    """Return the result of a reader for some files, whose names are added to its errors."""
    try:
        return reader(*paths, **options)
    except ValueError as error:
        raise ValueError(f"{', '.join(filter(None, paths))}: {error}") from error


def add_frames(parser: argparse.ArgumentParser, first: str, second: str) -> None:
    """Add the flag that chooses a frame of each of two images to a parser."""
    parser.add_argument(
        "--frames",
        type=int,
        nargs=2,
        metavar=("A", "B"),
        default=(1, 1),
        help=f"which frame of {first} and of {second}, where a GIF, WEBP, HEIC, AVIF, PNG or TIFF "
        "holds several: its number, from 1",
    )


def read_frames(paths: Sequence[str], numbers: Sequence[int]) -> tuple[list[Image], list[dict[str, Any]], list[str]]:
    """Return frames of images, facts about each, and a line for each that comes from a file of several frames."""
    from stereolag.io.images import read_frame

    with ThreadPoolExecutor() as threads:
        frames = list(threads.map(lambda path, number: read(read_frame, path, number=number), paths, numbers))
    facts = [
        {"file": path, "frame": frame.number, "frames": frame.count} for path, frame in zip(paths, frames, strict=True)
    ]
    lines = ["{file}: frame {frame} of {frames}".format(**fact) for fact in facts if fact["frames"] != 1]
    return [frame.pixels for frame in frames], facts, lines


def print_result(figures: Mapping[str, Any], sentences: str, *, as_json: bool) -> None:
    """Print the figures as one line of JSON, with NaN and infinity as null, or else the sentences."""
    if as_json:
        from stereolag.io.results import figures_json

        print(figures_json(figures))
    else:
        print(sentences)


# Settings as flags.

NOTHING = "none"
"""The text of a flag that sets its setting to None."""

ON = "on"
"""The value of a stage's flag given without one: the stage is on, with its settings unchanged."""


class SettingsFlags(Generic[S]):
    """The flags of one settings object.

    Parameters
    ----------
    parser
        Gets a flag for every field, with its bounds and default. The flag of an optional stage switches it on, or off
        with "none"; any flag of the stage's settings also switches it on.
    settings
        The settings to change.
    shortcuts
        Additional flags of fields: {"search.num-disparities": "num-disparities"}.
    hint
        Returns another sentence about an unknown flag, by the name of its setting.
    """

    def __init__(
        self,
        parser: CommandParser,
        settings: S,
        shortcuts: Mapping[str, str] | None = None,
        hint: Callable[[str], str] = lambda name: "",
    ) -> None:
        self._hint = hint
        self._parser = parser
        self.settings = settings
        _add_flags(parser, [type(settings)], settings, shortcuts or {})

    def parsed(self, arguments: Sequence[str]) -> tuple[argparse.Namespace, S]:
        """Return the arguments, and the settings changed by the flags; the parser reports errors.

        Raises
        ------
        SystemExit
            From the parser's ``error``.
        """
        options, others = self._parser.parse_known_args(arguments)
        kind = type(self.settings)
        if others:
            name = others[0].partition("=")[0].lstrip("-").replace("-", "_")
            if not others[0].startswith("--"):
                self._parser.error(f"{others[0]!r} is one argument too many.")
            self._parser.error(f"{unknown_setting(kind, name, _flag)} {self._hint(name)}")
        try:
            _check_stages(vars(options), kind)
            document = _merge(self.settings.model_dump(), _nested_document(vars(options), kind), kind)
            return options, kind.model_validate(document)
        except SettingsError as error:
            problem = error.problems[0]
            self._parser.error(problem.renamed(_flag(problem.name)).sentence)


def _check_stages(given: Mapping[str, Any], kind: type[BaseModel]) -> None:
    """Refuse a stage whose own flag is neither on nor off, or is off although its settings are given."""
    for name, field in kind.model_fields.items():
        if name not in given or not nested(field):
            continue
        inner = [setting for setting in given if setting.startswith(f"{name}.")]
        if given[name] not in (ON, NOTHING):
            example = _flag(f"{name}.{next(iter(nested(field)[-1].model_fields))}")
            problem = f"{name} is {given[name]!r}; its settings have flags of their own, such as {example}."
            raise SettingsError((Problem(name, problem),))
        if given[name] == NOTHING and inner:
            problem = f"{name} is switched off, but {_flag(inner[0])} is given: leave one out."
            raise SettingsError((Problem(name, problem),))


def _add_flags(
    parser: argparse._ActionsContainer,
    kinds: Sequence[type[BaseModel]],
    values: BaseModel | None,
    shortcuts: Mapping[str, str],
    path: str = "",
) -> None:
    """Add a flag for each field of all kinds, those of `values` first; none is validated.

    A field that allows several kinds of settings needs flags for each of them.
    """
    fields: dict[str, FieldInfo] = {}
    for kind in sorted(kinds, key=lambda kind: not isinstance(values, kind)):
        fields = fields | {name: field for name, field in kind.model_fields.items() if name not in fields}
    for name, field in fields.items():
        value = getattr(values, name, field.default)
        flag = _flag(path + name)
        if inner := nested(field):
            is_optional = NoneType in get_args(field.annotation)
            text = _stage_description(name, field, value) if is_optional else _description(field)
            stage = parser.add_argument_group(f"{flag.removeprefix('--')} options", text)
            stage.add_argument(flag, nargs="?", const=ON, default=argparse.SUPPRESS, help=argparse.SUPPRESS)
            _add_flags(stage, inner, value, shortcuts, f"{path}{name}.")
            continue
        text, options = _description(field), choices(field)
        if name == KIND and len(kinds) > 1:
            titles = {kind.model_fields[name].default: vars(kind).get("title", kind.__name__) for kind in kinds}
            text, options = "; ".join(f"{option}: {title}" for option, title in titles.items()) + ".", tuple(titles)
        form: dict[str, Any] = {"metavar": f"{{{','.join(options)}}}" if options else base_type(field).__name__}
        if base_type(field) is bool:
            form = {"action": argparse.BooleanOptionalAction}
        flags = [flag, *(f"--{short}" for long, short in shortcuts.items() if long == flag.removeprefix("--"))]
        text = f"{text} (default: {NOTHING if value is None else value})".replace("%", "%%")
        parser.add_argument(*flags, dest=path + name, default=argparse.SUPPRESS, help=text, **form)


def _nested_document(given: Mapping[str, Any], kind: type[BaseModel]) -> dict[str, Any]:
    """Return the given flags as a document with the nesting of the settings."""
    document: dict[str, Any] = {}
    for name in sorted(given):  # a stage's own flag before those of its settings
        first, _, inner = name.partition(".")
        if first not in kind.model_fields:  # it belongs to other settings of the command
            continue
        if inner:
            document.setdefault(first, {})[inner] = given[name]
        else:
            document[first] = {} if given[name] == ON and nested(kind.model_fields[first]) else given[name]
    return document


def _description(field: FieldInfo) -> str:
    """Return the description of a field and its allowed values, in one or two sentences."""
    text = field.description or f"{field.title}."
    if choices(field) or nested(field) or base_type(field) is bool:
        return text
    allowed = allowed_values(field).removeprefix("are ").removeprefix("is ").replace(" or None", f" or {NOTHING}")
    return f"{text} {allowed[0].upper()}{allowed[1:]}."


def _flag(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _stage_description(name: str, field: FieldInfo, value: Any) -> str:
    """Return the description of a stage, whether it is on, and how to switch it on or off."""
    flag = _flag(name)
    state = (
        f"Off: {flag}, or any of these, switches it on" if value is None else f"On: {flag} {NOTHING} switches it off"
    )
    return f"{_description(field)} {state}."


def _merge(document: dict[str, Any], given: Mapping[str, Any], kind: type[BaseModel]) -> dict[str, Any]:
    """Return a document of settings changed by the given values, both nested."""
    merged = dict(document)
    for name, value in given.items():
        field = kind.model_fields[name]
        kinds = nested(field)
        if not isinstance(value, dict):
            merged[name] = _parsed_value(value, field)
            continue
        inner = merged[name] or {}
        chosen = _chosen_kind(kinds, inner, value)
        inner = {key: entry for key, entry in inner.items() if key in chosen.model_fields and key != KIND}
        if len(kinds) > 1:
            inner[KIND] = chosen.model_fields[KIND].default
        merged[name] = _merge(inner, value, chosen)
    return merged


def _chosen_kind(
    kinds: Sequence[type[BaseModel]], document: Mapping[str, Any], given: Mapping[str, Any]
) -> type[BaseModel]:
    """Return the kind of settings that is meant: the one named, else the first that has all given settings.

    The present kind, that of `document`, comes first, and stays if none has them all: the validation refuses these.
    """
    if len(kinds) == 1:
        return kinds[0]
    by_name = {kind.model_fields[KIND].default: kind for kind in kinds}
    present = by_name[document[KIND]]
    if KIND in given:
        return by_name.get(given[KIND], present)
    return next((kind for kind in (present, *kinds) if set(given) <= set(kind.model_fields)), present)


def _parsed_value(text: Any, field: FieldInfo) -> Any:
    """Return a flag's text as a number or None if it is one; other texts are left to the validation."""
    if not isinstance(text, str) or choices(field):
        return text
    if text == NOTHING:
        return None
    for kind in (int, float):
        try:
            number = kind(text)
        except ValueError:
            continue
        return number if math.isfinite(number) else text
    return text
