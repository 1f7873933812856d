"""Columns of numbers as loggers, oscilloscopes and spreadsheets write them: channels, on the clock of their times."""

from __future__ import annotations

import csv
import io
import itertools
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Vector
from stereolag.io.clocks import Recording, chosen_track
from stereolag.io.column_clocks import FEWEST_ROWS, MOSTLY, UNIX_S, column_name, is_time, on_own_clock, unit_of
from stereolag.io.formats import WHAT
from stereolag.io.plain_lines import (
    ALLOWED,
    BLOCK,
    decoded,
    is_of_objects,
    without_comments,
    without_labels,
    without_nuls,
    written_plainly,
)
from stereolag.io.sources import quote
from stereolag.io.stamps import Times, date_and_clock, is_stamp, read_stamps, rounding_step

MAX_LINE = 100_000
"""Most characters of a line among those by which columns are recognised."""
MAX_FIELDS = 1000

MOST_LINES = 200
"""Most lines above the columns, and below them."""
PROBED = 2 * MOST_LINES
"""Lines by which columns are recognised."""
HEADING = 3
"""Lines above the first row that may hold the names and units of the columns."""
MOST_TURNS = 20
SPARSE = 0.05
"""Share of rows below which a column counts as empty."""

Kind: TypeAlias = Literal["number", "stamp", "word", "missing"]

_SEPARATORS = (";", "\t", ",", "|", None)
_MISSING = re.compile(
    r"(?:[-+]?(?:1\.#\w+|nan(?:\(\w*\))?)|n\.?/?a\.?|#n/a|#\w+[!?]|null|none|nil|missing|(?-i:MM)|burnout|over\w*|[-+]?∞|[-+*?.]+)?",
    re.IGNORECASE,
)
_SECTION = re.compile(r"\[[\w ]+\]")
"""A line that names what follows: "[data]"."""
_NINES = re.compile(r"-?9{3,}(?:\.9+)?")
_WITH_UNIT = re.compile(r"([-+]?[\d.,]+(?:[eE][-+]?\d+)?) ?(?:[%°Ωµμ$€£¥]|(?![eE])[A-Za-z])[^\d,;_]{0,5}")
_GROUPED = re.compile(r"[-+]?[1-9]\d{0,2}(?P<mark>[,.' ])\d{3}(?:(?P=mark)\d{3})*(?P<rest>(?!(?P=mark))[.,]\d*)?")
"""A number whose thousands are set apart; 1,234 or 1.234 may be one."""

_RATE = re.compile(
    r"sampl\w*[ _-]*(?:rate|freq\w*)|\bfs\b|abtastrate|actigraph\b.*\bat\b"
    r"|\brate(?=\W{1,3}[\d.,]+ ?k?(?:hz|sa?/s|sps)\b)",
    re.IGNORECASE,
)
_STEP = re.compile(
    r"sampl\w*[ _-]*(?:interval|period|time)|increment|h ?resolution|delta[ _]x|\b[xt]inc\w*|\bdt\b", re.IGNORECASE
)
_QUANTITY = re.compile(
    r"[\s,;:=|\"]*(?:[(\[](?P<within>(?:1 ?/)?[a-zµμ /]+)[)\]])?[\s,;:=|\"(\[]*"
    r"(?:(?P<grouped>\d{1,3}(?:[ ,]\d{3})+(?:\.\d+)?)(?= ?[kmg]?(?:hz|sa?/s))"
    r"|(?P<number>(?:\d+(?:[.,]\d+)?|\.\d+)(?:e[-+]?\d+)?))[\s,;|\"]*"
    r"(?P<unit>(?![a-z]\s*[=:])(?:(?:1|[a-zµμ]+)? ?(?:/|\bper\b) ?)?[a-zµμ]+(?:\^?-1)?)?",
    re.IGNORECASE,
)
_EACH = re.compile(r"(?<![\d.])(?![0.]+[^\d.])(\d{1,6}(?:\.\d{1,9})?) ?(\w*sec|[mµμun]?s|min)/sample\b")
LEAST_STATED, MOST_STATED = 1e-12, 1e12
"""Numbers between which a stated rate or interval is believed."""
_PREFIX = re.compile(r"([kKMG]|m(?=[hH]))(?i:hz|sa?/s|sps|\b)")
_PER = re.compile(r".*(?:/|\bper\b) ?(\w+)|(\w+?)\^?-1", re.IGNORECASE)
_PREFIXES = {"k": 1e3, "K": 1e3, "M": 1e6, "G": 1e9, "m": 1e-3}


def read_columns(data: bytes, track: int | str = 1) -> Recording:
    """Return the columns of a text as channels, on the clock that its times or its heading give.

    Each column holds numbers, times (dates, times of day, or numbers under a heading such as "time_ms"), or words,
    which are left out. Year, month, day, hour, minute and second may be columns of their own. Lines above the columns
    are their heading; lines below are left out. Values may be missing (empty, NaN, "---") in up to half of a column,
    and lie on a straight line between their neighbours. NUL bytes after a number are removed from a few lines (at most
    5, and one in a hundred). If several sensors take turns, line by line, named in a column of words ("acc", "gyr",
    "acc"), each is a track. Lines may name their values ("t:20 value:3", or an object of JSON), if all name the same.

    Parameters
    ----------
    data
        The text: UTF-8, UTF-16, or Latin-1; lines end in LF, CRLF or CR.
    track
        Number, from 1, or name of the sensor, if several take turns.

    Raises
    ------
    ValueError
        No column of numbers, too long a text, a field that is neither a number nor missing, a line with another count
        of fields, or times that go back; the error names the line, the column and the field.
    """
    whole, mended = without_nuls(decoded(data))
    whole = written_plainly(whole)
    text = without_comments(whole)
    layout = None if is_of_objects(text) else _layout(text, whole)
    if layout is None:
        every = enumerate(text.split("\n"), start=1)
        said = next((f": line {number} is {quote(line.strip())}" for number, line in every if line.strip()), "")
        text, labels = without_labels(text)
        layout = _layout(text, text) if labels else None
        if layout is None:
            raise ValueError(f"No line of the text holds a number{said}; {ALLOWED}.")
        if len(labels) == len(layout.kinds):
            layout = replace(layout, names=tuple(labels))
    text, below = _without_footer(text, layout)
    number = chosen_track(layout.turns, track)
    if len(layout.turns) > 1:
        text = _of_one(text, layout, layout.turns[number - 1])
    table, stamps, lines = _read(text, layout)
    table = _without_nines(table)
    columns = layout.of("number")
    for index, row in np.argwhere(np.isinf(table))[:1]:
        raise _unreadable(lines[row], f"{table[index, row]:g}", columns[index], layout, "finite numbers")
    clock, within = _clock_of_stamps(layout, stamps, table, lines)
    kept = [index for index in range(len(columns)) if index != within]
    rate, start_s = _stated(layout)
    begun_s, stated = _start_and_rate(table)
    if stated:  # as wearables write them
        table, lines, rate = table[:, 2:], lines[2:], stated
    words = [column_name(column + 1, layout.names[column]) for column in layout.of("word")]
    if words and not stamps and len(table) == 1 and is_time(layout.names[columns[0]]) and (np.diff(table[0]) > 0).all():
        times = column_name(columns[0] + 1, layout.names[columns[0]])
        raise ValueError(f"The {WHAT} holds no numbers beside the times in {times}; {words[0]} holds words.")
    recording = on_own_clock(
        table[kept],
        [layout.names[columns[index]] for index in kept],
        [columns[index] + 1 for index in kept],
        clock=clock,
        stated_rate=rate,
        lines=lines,
    )
    notes = list(recording.notes)
    if words:
        notes.append(f"words left out: {', '.join(words)}")
    if clock and clock.epoch == "start" and clock.rounding == 60:
        notes.append("times read as hours and minutes")
    if below:
        notes.append(f"{below} line{'s' * (below > 1)} below the columns left out")
    mended += int(np.isnan(table).any(axis=0).sum())
    recording = replace(recording, tracks=layout.turns, track=number)
    if stated:
        recording = replace(recording, start_s=begun_s, epoch="1970")
    return replace(recording, start_s=recording.start_s or start_s, mended_lines=mended, notes=tuple(notes))


# Lines.


def _split(lines: Sequence[str], separator: str | None) -> list[list[str]]:
    """Return the fields of each line."""
    if separator is not None and any('"' in line for line in lines):
        with suppress(csv.Error):
            rows = list(csv.reader(lines, delimiter=separator, skipinitialspace=True))
            if len(rows) == len(lines):  # otherwise a quote is never closed
                return rows
    return [line.replace('"', "").split(separator) for line in lines]


def _blocks(text: str, first_line: int) -> Iterator[tuple[int, str]]:
    """Yield the lines from `first_line` on in blocks, with the number of the first line of each."""
    start = 0
    for _ in range(first_line - 1):
        start = text.index("\n", start) + 1
    while start < len(text):
        end = text.find("\n", start + BLOCK) + 1 or len(text)
        block = text[start:end].removesuffix("\n")
        yield first_line, block
        first_line += block.count("\n") + 1
        start = end


# What the columns are.


@dataclass(frozen=True)
class _Layout:
    """How the lines of a text are to be read.

    Attributes
    ----------
    separator
        The character between columns; None: spaces.
    kinds
        What each column holds; "missing" if it is empty.
    rows
        Number of lines, of those looked at, that are rows of the columns.
    first
        Number of the line of the first row.
    heading
        The lines above it.
    names
        The heading of each column, "" if it has none.
    label, turns
        The column of words by which lines take turns, and these words in their order.
    marks
        What sets thousands apart in each column, "" if nothing does.
    """

    separator: str | None
    kinds: tuple[Kind, ...]
    rows: int
    first: int
    heading: tuple[str, ...] = ()
    names: tuple[str, ...] = ()
    label: int = 0
    turns: tuple[str, ...] = ("1",)
    marks: tuple[str, ...] = ()

    def of(self, kind: Kind) -> list[int]:
        """Return the columns of one kind."""
        return [column for column, one in enumerate(self.kinds) if one == kind]


def _layout(text: str, whole: str) -> _Layout | None:
    """Return how a text is to be read, None if no line holds a number; comments, its heading, are in `whole` alone."""
    lines = ((number, line.strip("\n")) for number, line in enumerate(io.StringIO(text), start=1))
    probed = list(itertools.islice(((number, line) for number, line in lines if line.strip()), PROBED))
    for number, line in probed:
        if len(line) > MAX_LINE:
            raise ValueError(f"Line {number} has {len(line):,} characters; at most {MAX_LINE:,} are accepted.")
    found = [one for separator in _SEPARATORS if (one := _layout_by(probed, separator))]
    if not found:
        return None
    if found[0].separator == "," and _is_one_column([line for _, line in probed], found[0]):
        found = [one for one in found if one.separator is None] or found
    most = max(one.rows for one in found)
    best = min((one for one in found if 2 * one.rows >= most), key=lambda one: len(one.of("word")))
    heading = [line.strip().lstrip("#%/ \t") for line in itertools.islice(io.StringIO(whole), best.first - 1)]
    heading = [line for line in heading if line and not (len(best.kinds) > 1 and _SECTION.fullmatch(line))]
    heading = heading[-MOST_LINES:]
    best = _with_turns(best, [line for _, line in probed])
    rows = [row for row in _split([line for _, line in probed], best.separator) if _is_row(row, best)]
    columns = ([row[column].strip() for row in rows if len(row) > column] for column in range(len(best.kinds)))
    marks = tuple(_mark_of(texts, best.separator) for texts in columns)
    return replace(best, heading=tuple(heading), names=_names(heading, best), marks=marks)


def _with_turns(layout: _Layout, lines: Sequence[str]) -> _Layout:
    """Return a layout with the words of a column that come in turn, one after another, if there is such a column."""
    rows = [row for row in _split(lines, layout.separator) if _is_row(row, layout)]
    for column in layout.of("word"):
        words = [row[column].strip() for row in rows if len(row) > column]
        turns = tuple(dict.fromkeys(words))
        again = [word == later for word, later in zip(words, words[len(turns) :], strict=False)]
        if 1 < len(turns) <= MOST_TURNS and len(again) >= FEWEST_ROWS and sum(again) >= MOSTLY * len(again):
            return replace(layout, label=column, turns=turns)
    return layout


def _of_one(text: str, layout: _Layout, word: str) -> str:
    """Return a text with blanks in place of the rows of others, so that its lines keep their numbers."""
    lines = text.split("\n")
    for number, row in enumerate(_split(lines[layout.first - 1 :], layout.separator), start=layout.first - 1):
        if len(row) > layout.label and row[layout.label].strip() != word:
            lines[number] = ""
    return "\n".join(lines)


def _is_one_column(lines: Sequence[str], layout: _Layout) -> bool:
    """Return whether what looks like two columns of integers is one of numbers with a decimal comma.

    There, the digits after the comma have no sign, and some begin with 0, or the integer is -0.
    """
    rows = [row for row in _split(lines, ",") if _is_row(row, layout)]
    if layout.kinds != ("number", "number") or not all(row[1].isdigit() for row in rows):
        return False
    return any(row[0].strip() == "-0" or (row[1][0] == "0" and len(row[1]) > 1) for row in rows)


def _layout_by(lines: Sequence[tuple[int, str]], separator: str | None) -> _Layout | None:
    """Return how lines are to be read by a separator, None if that finds no column of numbers."""
    if separator and not any(separator in line for _, line in lines):
        return None
    rows = _split([line for _, line in lines], separator)
    rows = [row if len(row) <= MAX_FIELDS else [] for row in rows]
    kinds = [[_kind(field) for field in row] for row in rows]
    widths = Counter(len(row) for row in kinds if "number" in row)
    if not widths:
        return None
    width = widths.most_common(1)[0][0]
    columns = zip(*(row for row in kinds if len(row) == width), strict=True)
    layout = _Layout(separator, tuple(map(_kind_of_column, columns)), 0, 0)
    fitting = [_is_row(row, layout) for row in rows]
    if "number" not in layout.kinds or not any(fitting):
        return None
    # A line of the heading may look like a row; but lines after the first row are rows as well, all of them if there
    # is anything beside the first.
    beside, first = layout.of("missing"), fitting.index(True)
    for row, fits in enumerate(fitting):
        later = fitting[row + 1 : row + 1 + FEWEST_ROWS]
        has_more = any(rows[row][column].strip() for column in beside if column < len(rows[row]))
        if fits and (all(later) if has_more else 2 * sum(later) >= len(later)):
            first = row
            break
    return replace(layout, rows=sum(fitting), first=lines[first][0])


def _kind(field: str) -> Kind:
    field = field.strip()
    if _MISSING.fullmatch(field):
        return "missing"
    return "number" if _number(field) is not None else "stamp" if is_stamp(field) else "word"


def _kind_of_column(kinds: Sequence[Kind]) -> Kind:
    counts = Counter(kinds)
    if len(kinds) - counts["missing"] < SPARSE * len(kinds) or counts["missing"] == len(kinds):
        return "missing"
    return max(("number", "stamp", "word"), key=lambda kind: counts[kind])


def _is_row(row: Sequence[str], layout: _Layout) -> bool:
    """Return whether the fields of a line are those of a row, at least half of its numbers there."""
    there = 0
    for column, kind in enumerate(layout.kinds):
        if kind in ("number", "stamp"):
            found = _kind(row[column]) if column < len(row) else "word"
            if found not in (kind, "missing"):
                return False
            there += kind == found == "number"
    return 2 * there >= len(layout.of("number")) and not any(map(str.strip, row[len(layout.kinds) :]))


def _number(field: str, mark: str = "") -> float | None:
    """Return the number in a field: with a decimal comma, thousands set apart or a unit as well; None if there is none.

    A single comma or point sets thousands apart only if it is the `mark` of the column.
    """
    if "_" in field:
        return None
    if (grouped := _mark_of_thousands(field)) or mark:
        field = field.replace(grouped or mark, "")
    for text in (field, field.replace(",", ".")):
        with suppress(ValueError):
            return float(text)
    with_unit = _WITH_UNIT.fullmatch(field)
    return _number(with_unit[1], mark) if with_unit else None


def _mark_of_thousands(field: str) -> str:
    """Return the mark that sets the thousands of a number apart, if it cannot be a decimal one; otherwise ""."""
    found = _GROUPED.fullmatch(field)
    is_clear = found and (found["mark"] in "' " or found["rest"] or field.count(found["mark"]) > 1)
    return found["mark"] if found and is_clear else ""


def _mark_of(texts: Sequence[str], separator: str | None) -> str:
    """Return the mark that sets thousands apart in a column, "" if none does.

    In quotes between commas, 1,234 is a thousand beside whole numbers that are less.
    """
    mark = next(filter(None, map(_mark_of_thousands, texts)), "")
    if mark or separator != ",":
        return mark
    with_comma = [text for text in texts if "," in text]
    are_thousands = bool(with_comma) and all(map(_GROUPED.fullmatch, with_comma))
    return "," if are_thousands and any(re.fullmatch(r"[-+]?\d{1,3}", text) for text in texts) else ""


def _names(heading: Sequence[str], layout: _Layout) -> tuple[str, ...]:
    """Return the heading of each column: what the lines directly above the first row say, from top to bottom."""
    width = len(layout.kinds)
    names: list[list[str]] = []
    for line in reversed(heading[-HEADING:]):
        fields = [field.strip() for field in _split([line], layout.separator)[0]]
        if layout.separator is None and len(fields) != width:
            fields = re.split(r"\s{2,}|\t", line.strip())
        while len(fields) > width and not fields[-1]:
            fields.pop()
        if len(fields) != width or (width == 1 and names) or not any(_kind(field) == "word" for field in fields):
            break
        if names and any(
            (named := pattern.search(line)) and _quantity(line, named.end(), 1, layout) for pattern in (_RATE, _STEP)
        ):
            break
        names.insert(0, fields)
    return tuple(" ".join(filter(None, parts)) for parts in zip(*names, strict=True)) or ("",) * width


def _stated(layout: _Layout) -> tuple[float | None, float]:
    """Return the sampling rate that the heading states, None if none, and the time of the first sample, s."""
    rate, start_s = None, 0.0
    rows = [_split([line], layout.separator)[0] for line in layout.heading]
    for line, row, below in zip(layout.heading, rows, [*rows[1:], []], strict=False):
        under = {field.strip().lower(): value for field, value in zip(row, below, strict=False)}
        start_s = _number(under.get("start", "")) or start_s
        for pattern, power in ((_RATE, 1), (_STEP, -1)):
            if rate is None and (named := pattern.search(line)):
                beneath = next((value for field, value in under.items() if pattern.search(field)), "")
                value = _quantity(line, named.end(), power, layout) or _quantity(beneath, 0, power, layout)
                rate = value**power if value else None
        if rate is None and (each := _EACH.search(line)):
            rate = 1 / (float(each[1]) * (unit_of(each[2]) or 1.0))
    return rate, start_s


def _start_and_rate(table: npt.NDArray[np.float64]) -> tuple[float, float]:
    """Return the start, Unix seconds, and the rate that the first two rows state, alike in all columns; else 0, 0."""
    low, high = UNIX_S
    if table.shape[1] < FEWEST_ROWS or np.ptp(table[:, :2], axis=0).any() or (np.abs(table[:, 2:]) >= low).any():
        return 0.0, 0.0
    start_s, rate = table[0, :2].tolist()
    return (start_s, rate) if low <= start_s < high and rate > 0 else (0.0, 0.0)


def _quantity(text: str, place: int, power: int, layout: _Layout) -> float:
    """Return the rate, Hz (power 1), or the interval, s (-1), that stands at a place of a heading; 0 if none does."""
    said = _QUANTITY.match(text, place)
    if said is None:
        return 0.0
    number, unit = said["grouped"], said["within"] or said["unit"] or ""
    if number:
        number = number.replace(" ", "").replace(",", "." if layout.separator == ";" else "")
    elif layout.separator == "," and "," in said["number"]:  # the next field
        number, unit = said["number"].partition(",")[0], said["within"] or ""
    else:
        number = said["number"].replace(",", ".")
    value, prefix, per = float(number), _PREFIX.match(unit), _PER.fullmatch(unit)
    if not LEAST_STATED < value < MOST_STATED:
        return 0.0
    seconds = unit_of(unit) or 1.0
    if power < 0:
        return value * seconds
    if per:
        value /= unit_of(per[1] or per[2]) or 1.0
    elif seconds != 1.0:  # every 5 min
        return 1 / (value * seconds)
    return value * (_PREFIXES[prefix[1]] if prefix else 1.0)


def _without_footer(text: str, layout: _Layout) -> tuple[str, int]:
    """Return the text up to its last row, and the number of lines below that."""
    end, below = len(text.rstrip()), 0
    while layout.rows >= FEWEST_ROWS and below <= MOST_LINES and end > 0:
        start = text.rfind("\n", 0, end) + 1
        if _is_row(_split([text[start:end]], layout.separator)[0], layout):
            return text[:end], below
        below += 1
        end = len(text[:start].rstrip()) if end - start < MAX_LINE else 0
    return text, 0


# Reading them.


def _read(text: str, layout: _Layout) -> tuple[npt.NDArray[np.float64], dict[int, list[str]], npt.NDArray[np.int64]]:
    """Return the (columns, rows) of numbers, NaN where missing; the texts of each column of times; the rows' lines."""
    numbers, parts, lines = layout.of("number"), [], []
    stamps: dict[int, list[str]] = {column: [] for column in layout.of("stamp")}
    heading = {line.strip() for line in layout.heading[-HEADING:]}
    for first, block in _blocks(text, layout.first):
        table, size = _quick(block, layout), block.count("\n") + 1
        if table is not None and table.shape[1] == size:
            places = np.arange(first, first + size)
        else:
            whole = block.split("\n")
            # A logger that is started anew writes its heading again.
            left_out = {"", *heading} if table is None else {""}
            kept = [(row, line) for row, line in enumerate(whole, start=first) if line.strip() not in left_out]
            places = np.array([row for row, _ in kept], dtype=np.int64)
        if table is None:
            columns = _checked(_split([line for _, line in kept], layout.separator), places, layout)
            table = np.array([_values(columns[column], places, column, layout) for column in numbers])
            for column, texts in stamps.items():
                texts.extend(map(str.strip, columns[column]))
        parts.append(table)
        lines.append(places)
    return np.concatenate(parts, axis=1), stamps, np.concatenate(lines)


def _without_nines(table: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return a table with NaN for -9999, 9999.9 and the like, where the rest of a column is nowhere near.

    Loggers write them for a missing value. The rest is near if it comes as close as its own values lie apart.
    """
    for column in table:
        for extreme in (np.nanmin(column), np.nanmax(column)) if np.isfinite(column).any() else ():
            rest = column[(column != extreme) & np.isfinite(column)]
            if not _NINES.fullmatch(f"{extreme:.10g}") or rest.size < FEWEST_ROWS:
                continue
            if 0 < np.ptp(rest) < np.abs(rest - extreme).min():  # not one of two values, as of a trigger
                column[column == extreme] = np.nan
    return table


def _quick(block: str, layout: _Layout) -> npt.NDArray[np.float64] | None:
    """Return the columns of a block that holds plain numbers alone; otherwise None."""
    if set(layout.kinds) != {"number"} or any(layout.marks) or not block.strip():
        return None
    with suppress(ValueError):
        plain = block if layout.separator == "," else block.replace(",", ".")  # a decimal comma
        table = np.loadtxt(io.StringIO(plain), delimiter=layout.separator, comments=None, ndmin=2)
        if table.shape[1] == len(layout.kinds):
            return table.T
    return None


def _checked(rows: list[list[str]], lines: npt.NDArray[np.int64], layout: _Layout) -> list[tuple[str, ...]]:
    """Return the columns of rows; ValueError if one has more or fewer fields than the rest."""
    width, needed = len(layout.kinds), max((*layout.of("number"), *layout.of("stamp"))) + 1
    if set(map(len, rows)) != {width}:
        for row, line in zip(rows, lines, strict=True):
            if len(row) < needed or any(map(str.strip, row[width:])):
                raise ValueError(
                    f"Line {line} holds {len(row)} field{'s' * (len(row) > 1)} and the lines before it {width}; "
                    "complete or remove it."
                )
        rows = [[*row[:width], *("",) * (width - len(row))] for row in rows]
    return list(zip(*rows, strict=True)) or [()] * width


def _values(texts: Sequence[str], lines: npt.NDArray[np.int64], column: int, layout: _Layout) -> Vector:
    """Return the numbers of a column, NaN where missing; ValueError about anything else."""
    mark = layout.marks[column]
    commas = layout.separator != "," and any("," in text for text in texts[:PROBED])
    with suppress(ValueError):
        if not mark and not any("_" in text for text in texts):
            plain = (text.replace(",", ".") for text in texts) if commas else texts
            return np.fromiter(map(float, plain), np.float64, len(texts))
    values = np.empty(len(texts))
    for row, text in enumerate(map(str.strip, texts)):
        value = np.nan if _MISSING.fullmatch(text) else _number(text, mark)
        if value is None:
            raise _unreadable(lines[row], text, column, layout, "numbers")
        values[row] = value
    return values


def _unreadable(line: int, text: str, column: int, layout: _Layout, expected: str) -> ValueError:
    place = f" in {column_name(column + 1, layout.names[column])}" if len(layout.kinds) > 1 else ""
    return ValueError(
        f"Line {line} holds {quote(text)}{place}, where other lines hold {expected}; correct or remove it."
    )


# Their times.


def _clock_of_stamps(
    layout: _Layout, stamps: dict[int, list[str]], table: npt.NDArray[np.float64], lines: npt.NDArray[np.int64]
) -> tuple[Times | None, int | None]:
    """Return the times that dates and times of day give, and the index of a column of numbers that refines them.

    A date and a time of day may stand in two columns, and fractions of seconds in a third. A date alone that stays the
    same, or a version that looks like one, is no clock.
    """
    parts = {
        column: date_and_clock(next((text for text in texts if is_stamp(text)), "")) for column, texts in stamps.items()
    }
    column = next((one for one, texts in stamps.items() if parts[one][1] or len({*texts}) > 1), None)
    if column is None:
        return None, None
    other = next((one for one in stamps if parts[one] == (not parts[column][0], not parts[column][1])), None)
    texts = stamps[column]
    if other is not None:
        date, time = (column, other) if parts[column][0] else (other, column)
        texts = [f"{day} {clock}" for day, clock in zip(stamps[date], stamps[time], strict=True)]
    times = read_stamps(texts)
    for row in np.flatnonzero(np.isnan(times.seconds)):
        if not _MISSING.fullmatch(stamps[column][row]):
            raise _unreadable(int(lines[row]), texts[row], column, layout, "times")
    for index, number in enumerate(layout.of("number")):
        unit = unit_of(layout.names[number])
        if unit is None or not unit < times.rounding <= 1:
            continue
        finer = table[index] * unit
        if finer.min() >= 0 and 0 < finer.max() < 1:
            start_s = times.start_s + float(finer[0])
            return Times(
                times.seconds + finer - finer[0], start_s, times.epoch, rounding_step(table[index]) * unit
            ), index
    return times, None
