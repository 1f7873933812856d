"""Text made ready for the search for columns: decoded, without labels and comments, its times in common notation."""

from __future__ import annotations

import codecs
import itertools
import json
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from datetime import date, datetime, timedelta
from typing import Any, TypeAlias
from zoneinfo import ZoneInfo

import numpy as np

from stereolag.io.formats import EXPORT_NUMBERS, WHAT
from stereolag.io.sources import HEADER_BYTES

SEARCHED_SIZE = 2**20
"""Characters in which a rare notation is looked for."""
SEARCHED_SIZE_NO_COLON = 2**15
"""The same for a notation without a colon: fewer, since the search takes longer where digits are everywhere."""

MAX_TEXT_BYTES = 64 * 2**20
ALLOWED = "allowed are numbers, times and words in columns separated by comma, semicolon, tab, bar or space"

MAX_MENDED_LINES = 5
MIN_LINES_PER_MENDED = 100
"""NUL bytes are removed from at most `MAX_MENDED_LINES` lines, and from at most one in `MIN_LINES_PER_MENDED`."""

Replacement: TypeAlias = str | Callable[[re.Match[str]], str]


def _calendar_date(ordinal: re.Match[str]) -> str:
    """Return a day of the year as a date, unchanged if the year has no such day."""
    day = date(int(ordinal[1]), 1, 1) + timedelta(int(ordinal[3]) - 1)
    return f"{day}T" if day.year == int(ordinal[1]) else ordinal[0]


def _with_offset(local: re.Match[str]) -> str:
    """Return a time with the UTC offset of its zone instead of the name, unchanged if either does not exist."""
    with suppress(ValueError, KeyError):
        return datetime.fromisoformat(local[1]).replace(tzinfo=ZoneInfo(local[2])).isoformat()
    return local[0]


_RARE_STAMPS: tuple[tuple[re.Pattern[str], Replacement], ...] = (
    (  # Mon May 13 10:15:00 2024, as C, Python and `date` write it
        re.compile(
            r"\b[A-Z][a-z]{2} (?P<month>[A-Z][a-z]{2}) {1,2}(?P<day>\d{1,2}) (?P<clock>\d\d:\d\d:\d\d(?:\.\d+)?)"
            r"(?: (?P<zone>[A-Z]{3,4}))? (?P<year>(?:19|20)\d\d)\b"
        ),
        r"\g<day>-\g<month>-\g<year> \g<clock>\g<zone>",
    ),
    (  # Mon May 13 2024 10:15:00 GMT+0200 (Central European Summer Time), as JavaScript writes it
        re.compile(r"\b[A-Z][a-z]{2} ([A-Z][a-z]{2}) (\d\d) ((?:19|20)\d\d) (?=\d\d:\d\d:\d\d)"),
        r"\2-\1-\3 ",
    ),
    (
        re.compile(r"(?<=\d) (?:GMT|UTC)([+-]\d{1,2}):?([0-5]\d)?\b(?: \([A-Za-z ]+\))?"),
        lambda zone: f"{int(zone[1]):+03}:{zone[2] or '00'}",
    ),
    # 2024-05-13 10:15:00 0.5,1.5
    (
        re.compile(r"^(\d{4}-\d\d-\d\d[ T][\d:.]+) (?=[-+]?\d*\.\d+,|[-+]?\d+,[-+]?\d*\.\d)", re.MULTILINE),
        r"\1, ",
    ),
    # 2024-134T10:15:00, a day of the year
    (re.compile(r"(?<![\w:./-])((?:19|20)\d\d)([-:])([0-3]\d\d)(?:T|\2)(?=\d\d:\d\d)"), _calendar_date),
    (  # 2024-05-13 10:15:00 Europe/Berlin
        re.compile(r"(\d{4}-\d\d-\d\d[ T]\d\d:\d\d(?::\d\d(?:\.\d+)?)?) ?\[?([A-Z][a-z]+/[A-Z]\w+)\]?"),
        _with_offset,
    ),
    (re.compile(r"(Z|[+-]\d\d:?\d\d)\[[\w/]+\]"), r"\1"),  # 10:15:00+02:00[Europe/Berlin], as Java writes it
    (  # 1 days 02:03:04, 1.02:03:04: a time elapsed, as pandas and .NET write it
        re.compile(r"(?<![\w.:/-])(\d{1,4})(?: ?d(?:ays?)?,? ?|\.)(\d{1,2})(?=:\d\d:\d\d)"),
        lambda elapsed: str(24 * int(elapsed[1]) + int(elapsed[2])),
    ),
    (re.compile(r"'\[?(\d{1,5}:\d\d[:\d.]*)(?: (\d\d/\d\d/\d{4})\])?'"), r"\2 \1"),  # as PhysioNet writes times
    (re.compile(r"(?<=\d) Uhr\b"), ""),
    (re.compile(r"(?<=\d) ?([AaPp])\. [Mm]\."), r"\1M"),  # 10:58:00 p. m., as in Spanish
    (re.compile(r"(?:上午|오전) ?(\d{1,2}:[\d:.]+)"), r"\1AM"),
    (re.compile(r"(?:下午|오후) ?(\d{1,2}:[\d:.]+)"), r"\1PM"),
)
_STAMPS_WITHOUT_COLON: tuple[tuple[re.Pattern[str], Replacement], ...] = (
    (  # 13.05.2024 10.15.00, 2024-05-13_10-15-00
        re.compile(
            r"((?:19|20)\d\d-\d\d-\d\d|\b\d{1,2}(?:([.-])\d{1,2}\2(?:19|20)|/\d{1,2}/(?:19|20)?)\d\d)([ T_;,\t]+)"
            r"([0-2]?\d)([.-])([0-5]\d)\5([0-5]\d)(?!\d)"
        ),
        r"\1\3\4:\6:\7",
    ),
    (  # 13.05.2024 22.58 before another mark between columns than the space within
        re.compile(
            r"((?:19|20)\d\d-\d\d-\d\d|\b\d{1,2}([./-])\d{1,2}\2(?:19|20)\d\d) ([0-2]?\d)\.([0-5]\d)(?=\"?[;,\t])"
        ),
        r"\1 \3:\4",
    ),
    (re.compile(r"((?:19|20)\d\d)年(\d{1,2})月(\d{1,2})日"), r"\1-\2-\3"),
    (
        re.compile(r"(\d{1,2})[時时点](\d{1,2})分(?:(\d{1,2})秒)?"),
        lambda clock: ":".join(filter(None, clock.groups())),
    ),
    (  # 10h15, 10 h 15 min 30 s
        re.compile(r"(?<![\w.])(\d{1,2}) ?h ?([0-5]\d)(?: ?(?:min|mn?|')(?: ?([0-5]\d)(?: ?s)?)?)?(?!\.?\w)"),
        lambda clock: ":".join(filter(None, clock.groups())),
    ),
)

_STRAY_NULS = re.compile(r"(?<=[0-9.])\0+(?=[ \t,;\n]|\Z)")
"""NUL characters directly after a complete number."""
_PLAIN = str.maketrans("\N{NO-BREAK SPACE}\N{NARROW NO-BREAK SPACE}\N{THIN SPACE}\N{MINUS SIGN}’", "   -'")

_COMMENT = re.compile(r"^[ \t]*(?:#(?!N/A)|%|//)[^\n]*|(?<=[\d.])[ \t]+(?:#|//)[^\n]*", re.MULTILINE)
_SPACE_IN_VALUE = re.compile(r"(?<![\w.])([+-]) +(?=[\d.])|(?<=\d) +([AaPp]\.?[Mm]\b\.?)")
"""A space after a sign, or before AM and PM, where it does not separate columns."""
_LOG_PREFIX = re.compile(
    r"^(?:(?P<time>[\d:.]+) -> |\[ *(?P<within>(?:\d[\w/-]*)?[ \d]*[:.][\d:.]*)\][ \t]*)", re.MULTILINE
)
"""The mark that a serial monitor (Arduino, CoolTerm) or a log writes after the time, or around it."""
_SERIES = re.compile(
    r"^TIMESERIES (?P<name>\S+), \d+ samples?, (?P<rate>[\d.]+) sps, "
    r"(?P<start>\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(?:\.\d+)?), "
    r"(?:SLIST\b.*\n(?P<values>(?:(?!TIMESERIES).*(?:\n|\Z))*?)(?=TIMESERIES|\Z)|TSPAIR\b.*\n)",
    re.MULTILINE,
)
"""A segment of a seismogram: six samples a line below their start and rate, or one a line after its time."""
_CURRENCY = re.compile(r"[$€£¥] ?(?=[-+]?[\d.])")
_FORTRAN_EXPONENT = re.compile(r"(?<=[\d.])[dD](?=[-+]\d\d\d?\b)")

_LABEL = re.compile(
    r"[\"'](?P<quoted>[^\"'\n]{1,60})[\"']\s?:\s?(?=[-+\d\"'ntfNTF])"
    r"|(?<![\w.\"'])(?P<bare>[A-Za-zµ°_][\w .()/%²°µ-]{0,40}?)\s?[:=]\s?(?=[-+]?\.?\d)"
)
_OBJECTS = re.compile(r"\[?\s*\{[^\[\]{}\n]+\}\s*(?:,?\s*[\]{]|\Z)")
_JSON = re.compile(r"\s*[\[{]\s*(?:[\[{\"\]}]|-?\d[\d.eE+-]*\s*(?:,|\]?\s*\Z))")
"""The beginning of JSON, unlike that of a line after its time in brackets."""
_OBJECT = re.compile(r"^[ \t]{0,9}\[?[ \t]{0,9}\{|\}[ \t]{0,9},?[ \t]{0,9}\]?[ \t]{0,9}$", re.MULTILINE)
PROBED_LINES = 400
"""Lines from which the labels of values are recognised."""


def decode_text(data: bytes) -> str:
    """Return bytes as text with LF line ends; ValueError if it is too long."""
    if len(data) > MAX_TEXT_BYTES:
        raise ValueError(
            f"The text has {len(data) / 1e6:.0f} MB; at most {MAX_TEXT_BYTES / 1e6:.0f} MB are accepted: save it as "
            "WAV or NPY instead."
        )
    even, odd = (data[start:HEADER_BYTES:2].count(0) for start in (0, 1))
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        text = data.decode("utf-16", errors="replace")
    elif max(even, odd) > 0.4 * min(len(data), HEADER_BYTES) and min(even, odd) == 0:  # UTF-16 without a mark
        text = data.decode("utf-16-be" if even else "utf-16-le", errors="replace")
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = data.decode("latin-1")
    text = text.removesuffix("\x1a").replace("\r\n", "\n").replace("\r", "\n")
    return text.translate(_PLAIN)


def without_nuls(text: str) -> tuple[str, int]:
    """Return the text without stray NUL characters, and the number of lines that had some."""
    if "\0" not in text:
        return text, 0
    allowed = min(MAX_MENDED_LINES, (text.count("\n") + 1) // MIN_LINES_PER_MENDED)
    mended = _STRAY_NULS.sub("", text)
    lines = {text.count("\n", 0, found.start()) for found in itertools.islice(_STRAY_NULS.finditer(text), allowed + 1)}
    if "\0" in mended or len(lines) > allowed:
        raise ValueError(f"Line {text.count(chr(10), 0, text.index(chr(0))) + 1} holds a NUL byte; {ALLOWED}.")
    return mended, len(lines)


def with_plain_values(text: str) -> str:
    """Return a text with its times and numbers in common notation, without currency signs and marks of logs."""
    for patterns, size in (
        (_RARE_STAMPS, SEARCHED_SIZE if ":" in text else 0),
        (_STAMPS_WITHOUT_COLON, SEARCHED_SIZE_NO_COLON),
    ):
        for pattern, replacement in patterns:
            if pattern.search(text, 0, size):
                text = pattern.sub(replacement, text)
    if text.startswith("TIMESERIES "):
        text = _SERIES.sub(_as_columns, text)
    text = _replace_if_marked(text, "$€£¥", _CURRENCY, "")
    text = _replace_if_marked(text, "dD", _FORTRAN_EXPONENT, "e")
    separator = ", " if "," in text else " "
    return _replace_if_marked(text, ("-> ", "["), _LOG_PREFIX, rf"\g<time>\g<within>{separator}")


def without_comments(text: str) -> str:
    """Return a text without comments, and without spaces in its numbers and times."""
    text = _replace_if_marked(text, ("#", "%", "//"), _COMMENT, "")
    return _replace_if_marked(text, ("+ ", "- ", "M", "m"), _SPACE_IN_VALUE, r"\1\2")


def columns_of_json(text: str) -> str:
    """Return JSON, or JSON in every line, as columns between tabs below their names; any other text unchanged.

    It holds rows, each an object, a list or a number, or columns by their names; what else it holds becomes the
    heading. The last line may be cut off.

    Raises
    ------
    ValueError
        JSON that is broken, or holds neither rows nor columns.
    """
    if not _JSON.match(text[:HEADER_BYTES]):
        return text
    lines = [line for line in text.split("\n") if line.strip()]
    heading, rows, table = "", list[Any](), list[dict[str, Any]]()
    with suppress(ValueError, RecursionError):
        for line in lines:
            rows.append(json.loads(line))
    with suppress(ValueError, RecursionError):
        tree = rows if 1 < len(rows) >= len(lines) - 1 else json.loads(text)
        if isinstance(tree, dict):
            found = dict(_leaves(tree, "", lists=False))
            columns = {name: leaf for name, leaf in found.items() if isinstance(leaf, list)}
            longest = max(map(len, columns.values()), default=0)
            heading = "".join(f"{name}: {leaf}\n" for name, leaf in found.items() if name not in columns)
            columns = {name: leaf for name, leaf in columns.items() if len(leaf) == longest}
            tree = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
            if len(columns) == 1 and any(isinstance(row, dict | list) for row in next(iter(columns.values()))):
                (tree,) = columns.values()
        table = [dict(_leaves(row, "", lists=True)) for row in tree]
    names = dict.fromkeys(name for row in table for name in row)
    if not table or len(names) * len(table) > len(text):  # names of which most rows have no value
        if holds_objects(text):
            return text
        raise ValueError(f"The {WHAT} is a JSON file, which is not read: {EXPORT_NUMBERS}.")
    fields: list[Iterable[str]] = [
        [] if all(map(str.isdigit, names)) else names,
        *([str(row.get(name, "nan")) for name in names] for row in table),
    ]
    return heading + "\n".join("\t".join(re.sub(r"\s", " ", field) for field in row) for row in fields)


def _leaves(tree: Any, name: str, *, lists: bool) -> Iterator[tuple[str, Any]]:
    """Yield the values in nested objects, and in lists if these are taken apart, by their names joined by points."""
    children = tree.items() if isinstance(tree, dict) else enumerate(tree) if lists and isinstance(tree, list) else None
    if children is None:
        yield name, "nan" if tree is None else tree
    else:
        for key, child in children:
            yield from _leaves(child, f"{name}.{key}" if name else str(key), lists=lists)


def holds_objects(text: str) -> bool:
    """Return whether a text consists of JSON objects."""
    return bool(_OBJECTS.match(text[:HEADER_BYTES].lstrip()))


def without_labels(text: str) -> tuple[str, list[str]]:
    """Return a text without the labels of its values, and the labels; unchanged and [] if its lines have none.

    Labelled lines are ``t:20 value:3`` of a microcontroller and ``{"t": 20, "value": 3}`` of JSON.

    Raises
    ------
    ValueError
        A line with other labels than the first one, or in another order.
    """
    lines = text.split("\n")
    probed = [_labels(line) for line in lines[:PROBED_LINES]]
    labels, count = Counter(filter(None, probed)).most_common(1)[0] if any(probed) else ((), 0)
    if 2 * count <= sum(map(bool, probed)):
        return text, []
    first = probed.index(labels)
    last = next(number for number in range(len(lines) - 1, -1, -1) if _labels(lines[number]) == labels)
    for number, line in enumerate(lines[first : last + 1], start=first):
        others = _labels(line)
        if others and others != labels:
            raise ValueError(
                f"Line {number + 1} holds {', '.join(others)}, and the lines before it {', '.join(labels)}; a line "
                "must hold the same values in the same order."
            )
        lines[number] = _LABEL.sub("", line)
    return _OBJECT.sub("", "\n".join(lines)), [*labels]


def _labels(line: str) -> tuple[str, ...]:
    return tuple(found["quoted"] or found["bare"] for found in _LABEL.finditer(line))


def _replace_if_marked(text: str, marks: Iterable[str], pattern: re.Pattern[str], replacement: str) -> str:
    """Return a text with a pattern replaced; the slow search takes place only if the text holds one of the marks."""
    return pattern.sub(replacement, text) if any(mark in text for mark in marks) else text


def _as_columns(series: re.Match[str]) -> str:
    """Return a segment of a seismogram as columns of times and samples, below their names."""
    values = (series["values"] or "").split()
    with suppress(ValueError, ZeroDivisionError):
        offsets = np.round(np.arange(len(values)) * (1e9 / float(series["rate"]))).astype("timedelta64[ns]")
        times = np.datetime64(series["start"], "ns") + offsets
        rows = (f"{time} {value}\n" for time, value in zip(times, values, strict=True))
        return f"time {series['name']}\n{''.join(rows)}"
    return series[0]
