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
    "refused, or a file cannot be read or written, said in one sentence"
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
        self.add_argument("--json", action="store_true", help="print one line of JSON, and nothing else")

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


def read(reader: Callable[..., T], *paths: str | None, **options: Any) -> T:
    """Return the result of a reader for some files; its errors name them."""
    try:
        return reader(*paths, **options)
    except ValueError as error:
        raise ValueError(f"{', '.join(filter(None, paths))}: {error}") from error


def add_frames(parser: argparse.ArgumentParser, one: str, other: str) -> None:
    """Add the flag that chooses a frame of each of two images to a parser."""
    frames = f"which frame of {one} and of {other}, where a GIF, WEBP, PNG or TIFF holds several: its number, from 1"
    parser.add_argument("--frames", type=int, nargs=2, metavar=("A", "B"), default=(1, 1), help=frames)


def read_frames(paths: Sequence[str], numbers: Sequence[int]) -> tuple[list[Image], list[dict[str, Any]], list[str]]:
    """Return frames of images, facts about them, and a line for each that is not the only one."""
    from stereolag.io.images import read_frame

    with ThreadPoolExecutor() as aside:
        frames = list(aside.map(lambda path, number: read(read_frame, path, number=number), paths, numbers))
    facts = [{"file": path, "frame": one.number, "frames": one.count} for path, one in zip(paths, frames, strict=True)]
    lines = ["{file}: frame {frame} of {frames}".format(**one) for one in facts if one["frames"] != 1]
    return [one.pixels for one in frames], facts, lines


def tell(figures: Mapping[str, Any], sentences: str, *, as_json: bool) -> None:
    """Print the figures as one line of JSON, with NaN and infinity as null, or else the sentences."""
    if as_json:
        from stereolag.io.results import figures_json

        print(figures_json(figures))
    else:
        print(sentences)


# Settings as flags.

NOTHING = "none"
"""The value of a flag for a setting without a value."""

ON = "on"
"""The value of a stage's flag without one: all settings of the stage are unchanged."""


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
        Other flags of fields: {"search.num-disparities": "num-disparities"}.
    hint
        Returns a further sentence about an unknown flag, by the name of its setting.
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
            document = _merged(self.settings.model_dump(), _unfolded(vars(options), kind), kind)
            return options, kind.model_validate(document)
        except SettingsError as error:
            problem = error.problems[0]
            self._parser.error(problem.renamed(_flag(problem.name)).sentence)


def _check_stages(given: Mapping[str, Any], kind: type[BaseModel]) -> None:
    """Refuse a stage whose own flag is neither on nor off, or is off although its settings are given."""
    for name, field in kind.model_fields.items():
        state = given.get(name)
        if state is None or not nested(field):
            continue
        inner = [one for one in given if one.startswith(f"{name}.")]
        one = next(iter(nested(field)[-1].model_fields))
        if state not in (ON, NOTHING):
            problem = f"{name} is {state!r}; its settings have flags of their own, such as {_flag(f'{name}.{one}')}."
        elif state == NOTHING and inner:
            problem = f"{name} is switched off, but {_flag(inner[0])} is given: leave one out."
        else:
            continue
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
            said = _switched(name, field, value) if NoneType in get_args(field.annotation) else _described(field)
            stage = parser.add_argument_group(f"{flag.removeprefix('--')} options", said)
            stage.add_argument(flag, nargs="?", const=ON, default=argparse.SUPPRESS, help=argparse.SUPPRESS)
            _add_flags(stage, inner, value, shortcuts, f"{path}{name}.")
            continue
        said, options = _described(field), choices(field)
        if name == KIND and len(kinds) > 1:
            titles = {one.model_fields[name].default: vars(one).get("title", one.__name__) for one in kinds}
            said, options = "; ".join(f"{option}: {title}" for option, title in titles.items()) + ".", tuple(titles)
        how: dict[str, Any] = {"metavar": f"{{{','.join(options)}}}" if options else base_type(field).__name__}
        if base_type(field) is bool:
            how = {"action": argparse.BooleanOptionalAction}
        flags = [flag, *(f"--{short}" for long, short in shortcuts.items() if long == flag.removeprefix("--"))]
        said = f"{said} (default: {NOTHING if value is None else value})".replace("%", "%%")
        parser.add_argument(*flags, dest=path + name, default=argparse.SUPPRESS, help=said, **how)


def _unfolded(given: Mapping[str, Any], kind: type[BaseModel]) -> dict[str, Any]:
    """Return the flags given as a document of the settings, nested as these are."""
    document: dict[str, Any] = {}
    for name in sorted(given):  # a stage's own flag before those of its settings
        first, _, inner = name.partition(".")
        if first not in kind.model_fields:  # of another settings object of the command
            continue
        if inner:
            document.setdefault(first, {})[inner] = given[name]
        else:
            document[first] = {} if given[name] == ON and nested(kind.model_fields[first]) else given[name]
    return document


def _described(field: FieldInfo) -> str:
    """Return the description of a field and its allowed values, in one or two sentences."""
    said = field.description or f"{field.title}."
    if choices(field) or nested(field) or base_type(field) is bool:
        return said
    allowed = allowed_values(field).removeprefix("are ").removeprefix("is ").replace(" or None", f" or {NOTHING}")
    return f"{said} {allowed[0].upper()}{allowed[1:]}."


def _flag(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _switched(name: str, field: FieldInfo, value: Any) -> str:
    """Return the description of a stage, whether it is on, and how to switch it on or off."""
    flag = _flag(name)
    state = (
        f"Off: {flag}, or any of these, switches it on" if value is None else f"On: {flag} {NOTHING} switches it off"
    )
    return f"{_described(field)} {state}."


def _merged(document: dict[str, Any], given: Mapping[str, Any], kind: type[BaseModel]) -> dict[str, Any]:
    """Return a document of settings changed by the given values, both nested."""
    merged = dict(document)
    for name, value in given.items():
        field = kind.model_fields[name]
        kinds = nested(field)
        if not isinstance(value, dict):
            merged[name] = _value(value, field)
            continue
        holder = merged[name] or {}
        chosen = _chosen_kind(kinds, holder, value)
        holder = {key: one for key, one in holder.items() if key in chosen.model_fields and key != KIND}
        if len(kinds) > 1:
            holder[KIND] = chosen.model_fields[KIND].default
        merged[name] = _merged(holder, value, chosen)
    return merged


def _chosen_kind(
    kinds: Sequence[type[BaseModel]], holder: Mapping[str, Any], given: Mapping[str, Any]
) -> type[BaseModel]:
    """Return which of several kinds is meant: the one named, the current one, or another that has all given settings.

    A contradiction is left to the validation.
    """
    if len(kinds) == 1:
        return kinds[0]
    by_name = {one.model_fields[KIND].default: one for one in kinds}
    present = by_name[holder[KIND]]
    if KIND in given:
        return by_name.get(given[KIND], present)
    fitting = [one for one in (present, *kinds) if set(given) <= set(one.model_fields)]
    return fitting[0] if fitting else present


def _value(text: Any, field: FieldInfo) -> Any:
    """Return a flag's text as a number or None if it is one; other texts are left for the settings to refuse."""
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
