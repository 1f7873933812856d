"""The command or the short program that reproduces a lag or a template search."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from stereolag.core.searches import LagSearch, TemplateQuery
from stereolag.core.settings import Settings
from stereolag.io.programs import file_literal, text_literal
from stereolag.version import VERSION

_LAG = '''\
"""Measure the lag between two recordings: positive where the second hears the event later.

Written by stereolag {version}, which it needs. The recordings lie beside this file.
"""

from pathlib import Path

import stereolag as sl

FOLDER = Path(__file__).resolve().parent

signal_1 = sl.read_signal(FOLDER / {first}).channels[0]
signal_2 = sl.read_signal(FOLDER / {second}).channels[0]

result = sl.signal_lag(
    signal_1,
    signal_2,
{settings}
)
print(f"lag {{result.lag}} samples, {{result.time_s:.6g}} s, score {{result.score:.3f}}: {{result.verdict}}")
'''

_FIND = '''\
"""Find a template in an image: row and column of its top-left pixel.

Written by stereolag {version}, which it needs. The images lie beside this file.
"""

from pathlib import Path

import stereolag as sl

FOLDER = Path(__file__).resolve().parent

image = sl.read_image(FOLDER / {image})
template = sl.read_image(FOLDER / {template})
{mask}
result = sl.match_template(
    image,
    template,
{settings}
)
for match in result.matches[: result.clear]:
    print(f"row {{match.row}}, column {{match.col}}, score {{match.score:.3f}}")
if not result.found:
    print(f"Not found: {{result.reason}}")
'''


def lag_command(search: LagSearch, first: str, second: str) -> str:
    """Return the command that measures the same lag, for two files with one recording each."""
    return _command("lag", [first, second], search)


def lag_script(search: LagSearch, first: str, second: str) -> str:
    """Return a Python program that measures the same lag; every setting is written out.

    Parameters
    ----------
    search
        The settings.
    first, second
        The names of the two files beside the program; folders in them are dropped.
    """
    return _LAG.format(
        version=VERSION, first=file_literal(first), second=file_literal(second), settings=_written(search.model_dump())
    )


def find_command(query: TemplateQuery, image: str, template: str, mask: str | None = None) -> str:
    """Return the command that finds the same places."""
    return _command("find", [image, template, *([] if mask is None else ["--mask", mask])], query)


def find_script(query: TemplateQuery, image: str, template: str, mask: str | None = None) -> str:
    """Return a Python program that finds the same places; every setting is written out.

    Parameters
    ----------
    query
        The settings.
    image, template, mask
        The names of the files beside the program; folders in them are dropped. A mask is above 0 where the template
        counts; None for no mask.
    """
    masked = "" if mask is None else f"mask = sl.read_image(FOLDER / {file_literal(mask)})\n"
    settings = _written(query.arguments)
    return _FIND.format(
        version=VERSION,
        image=file_literal(image),
        template=file_literal(template),
        mask=masked,
        settings=settings if mask is None else f"    mask=mask,\n{settings}",
    )


def _command(name: str, files: Sequence[str], settings: Settings) -> str:
    """Return a command with flags for all settings that have a value."""
    flags = [
        _flag(field.replace("_", "-"), getattr(settings, field))
        for field in type(settings).model_fields
        if getattr(settings, field) is not None
    ]
    return " ".join(["stereolag", name, *files, *flags])


def _flag(name: str, value: object) -> str:
    if isinstance(value, bool):
        return f"--{name}" if value else f"--no-{name}"
    if isinstance(value, list | tuple):
        return f"--{name} {','.join(map(str, value))}"
    exact = isinstance(value, float) and float(f"{value:.12g}") == value
    return f"--{name} {value:.12g}" if exact else f"--{name} {value}"


def _written(arguments: Mapping[str, object]) -> str:
    """Return the arguments of a call, and the seed, one per line."""
    return "\n".join(f"    {name}={_literal(value)}," for name, value in [*arguments.items(), ("seed", 0)])


def _literal(value: object) -> str:
    return text_literal(value) if isinstance(value, str) else repr(value)
