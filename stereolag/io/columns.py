"""Tables of numbers in text, as loggers, oscilloscopes and spreadsheets write them, read as recordings."""

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
from stereolag.core.typography import counted
from stereolag.io.clocks import MIN_ROWS, Recording, chosen_track, rises_evenly
from stereolag.io.column_clocks import (
    MIN_CONFORMING_SHARE,
    UNIX_RANGE_S,
    column_name,
    is_time_heading,
    recording_from_table,
    time_unit,
    with_fractions,
)
from stereolag.io.formats import WHAT
from stereolag.io.plain_lines import (
    ALLOWED,
    columns_of_json,
    decode_text,
    holds_objects,
    with_plain_values,
    without_comments,
    without_labels,
    without_nuls,
)
from stereolag.io.sources import quote
from stereolag.io.stamps import Times, date_and_clock, is_stamp, read_stamps

BLOCK_SIZE = 2**20
"""Characters parsed at a time."""
MAX_LINE_LENGTH = 100_000
"""Characters allowed in each of the lines from which the columns are recognised."""
MAX_FIELDS = 1000
"""Fields of a line above which it is not a row."""

MAX_OTHER_LINES = 200
"""Lines kept of the heading above the columns, and searched for a footer below them."""
PROBED_LINES = 2 * MAX_OTHER_LINES
"""Lines from which the columns are recognised."""
MAX_NAME_LINES = 3
"""Lines above the first row that may hold the names and units of the columns."""
MAX_SENSORS = 20
"""Sensors that may take turns in the lines of a text."""
MIN_FILLED_SHARE = 0.05
"""Share of filled rows below which a column counts as empty."""

Kind: TypeAlias = Literal["number", "stamp", "word", "missing"]

_SEPARATORS = (";", "\t", ",", "|", None)
_MISSING = re.compile(
    r"(?:[-+]?(?:1\.#\w+|nan(?:\(\w*\))?)|n\.?/?a\.?|#n/a|#[^\s,;]+[!?]|null|none|nil|missing|(?-i:MM)|burnout|over\w*"
    r"|ol|err(?:or)?|invalid|[-+]?∞|[-+*?.]+)?",
    re.IGNORECASE,
)
_COMMENT_MARK = re.compile(r"^\s*[#%/][#%/\s]*")
_SECTION_TITLE = re.compile(r"\[[\w ]+\]")
"""The title of a section, as in "[data]"."""
_SENTINEL = re.compile(r"-?9{3,}(?:\.9+)?")
_NUMBER_WITH_UNIT = re.compile(r"([-+]?[\d.,]+(?:[eE][-+]?\d+)?) ?(?:[%°Ωµμ$€£¥]|(?![eE])[A-Za-z])[^\d,;_]{0,5}")
_GROUPED = re.compile(r"[-+]?[1-9]\d{0,2}(?P<mark>[,.' ])\d{3}(?:(?P=mark)\d{3})*(?P<rest>(?!(?P=mark))[.,]\d*)?")
"""A number with thousands separators; 1,234 and 1.234 may be one."""

_RATE_WORDS = re.compile(
    r"sampl\w*[ _-]*(?:rate|freq\w*)|\bfs\b|(?:abtast|mess)(?:rate|frequenz)|actigraph\b.*\bat\b"
    r"|fr.quen\w+ (?:d.(?:.chantillonnage|acquisition)|de muestreo|di campionamento)"
    r"|\brate(?=\W{1,3}[\d.,]+ ?k?(?:hz|sa?/s|sps)\b)",
    re.IGNORECASE,
)
_STEP_WORDS = re.compile(
    r"sampl\w*[ _-]*(?:interval|period|time)|(?:abtast|mess|time|log\w*|scan|record\w*|measur\w*)[ _-]*interval\w*"
    r"|increment|h ?resolution|delta[ _]x|\b[xt]inc\w*|\bdt\b",
    re.IGNORECASE,
)
_QUANTITY = re.compile(
    r"[\s,;:=|\"]*(?:[(\[](?P<within>(?:1 ?/)?[a-zµμ /]+)[)\]])?[\s,;:=|\"(\[]*"
    r"(?:(?P<grouped>\d{1,3}(?:[ ,]\d{3})+(?:\.\d+)?)(?= ?[kmg]?(?:hz|sa?/s))"
    r"|(?P<number>(?:\d+(?:[.,]\d+)?|\.\d+)(?:e[-+]?\d+)?))[\s,;|\"]*"
    r"(?P<unit>(?![a-z]\s*[=:])(?:(?:1|[a-zµμ]+)? ?(?:/|\bper\b) ?)?[a-zµμ]+(?:\^?-1)?)?",
    re.IGNORECASE,
)
_VICON_SECTIONS = {"devices", "trajectories", "model outputs"}
"""Headings of Vicon, above a line that holds the rate alone."""
_SECONDS_PER_SAMPLE = re.compile(r"(?<![\d.])(?![0.]+[^\d.])(\d{1,6}(?:\.\d{1,9})?) ?(\w*sec|[mµμun]?s|min)/sample\b")
MIN_STATED, MAX_STATED = 1e-12, 1e12
"""Bounds of the rates and intervals accepted from a heading or a variable of a file."""
_UNIT_PREFIX = re.compile(r"([kKMG]|m(?=[hH]))(?i:hz|sa?/s|sps|\b)")
_PER_UNIT = re.compile(r".*(?:/|\bper\b) ?(\w+)|(\w+?)\^?-1", re.IGNORECASE)
_PREFIX_FACTORS = {"k": 1e3, "K": 1e3, "M": 1e6, "G": 1e9, "m": 1e-3}


def read_columns(data: bytes, track: int | str = 1) -> Recording:
    """Return the columns of a text as channels, on the clock given by its times or its heading.

    Each column holds numbers, times (dates, times of day, or numbers under a heading such as "time_ms"), or words,
    which are left out. Year, month, day, hour, minute and second may be separate columns. Lines above the columns are
    their heading; lines below are left out. Values may be missing (empty, NaN, "---") in up to half of a column, and
    are interpolated linearly. NUL bytes after a number are removed from a few lines (at most 5, and one in a hundred).
    If several sensors take turns, line by line, named in a column of words ("acc", "gyr", "acc"), each is a track.
    Lines may label their values ("t:20 value:3", or a JSON object), if all have the same labels.

    Parameters
    ----------
    data
        The text: UTF-8, UTF-16, or Latin-1; lines end in LF, CRLF or CR.
    track
        Number, from 1, or name of the sensor, if several take turns.

    Raises
    ------
    ValueError
        No column of numbers, too long a text, a field that is neither a number nor missing, a line with a different
        number of fields, or times that go back; the error names the line, the column and the field.
    """
    with_comments, mended = without_nuls(columns_of_json(decode_text(data)))
    with_comments = with_plain_values(with_comments)
    text = without_comments(with_comments)
    layout = None if holds_objects(text) else _layout(text, with_comments)
    if layout is None:
        lines = enumerate(text.split("\n"), start=1)
        first_line = next((f": line {number} is {quote(line.strip())}" for number, line in lines if line.strip()), "")
        text, labels = without_labels(text)
        layout = _layout(text, text) if labels else None
        if layout is None:
            raise ValueError(f"No line of the text holds a number{first_line}; {ALLOWED}.")
        if len(labels) == len(layout.kinds):
            layout = replace(layout, names=tuple(labels))
    if layout.separator == "," and (pointed := _with_decimal_points(text, layout)):
        text, layout = pointed, _layout(pointed, with_comments) or layout
    text, below = _without_footer(text, layout)
    number = chosen_track(layout.sensors, track)
    if len(layout.sensors) > 1:
        text = _rows_of_sensor(text, layout, layout.sensors[number - 1])
    table, stamps, line_numbers = _read_rows(text, layout)
    table = _without_sentinels(table)
    columns = layout.columns_of("number")
    for index, row in np.argwhere(np.isinf(table))[:1]:
        raise _field_error(line_numbers[row], f"{table[index, row]:g}", columns[index], layout, "finite numbers")
    clock, in_clock = _clock_of_stamps(layout, stamps, table, line_numbers)
    kept = [index for index in range(len(columns)) if index not in in_clock]
    rate, start_s = _stated_rate_and_start(layout)
    unix_start_s, rate_in_rows = _start_and_rate_in_rows(table)
    if rate_in_rows:
        table, line_numbers, rate = table[:, 2:], line_numbers[2:], rate_in_rows
    words = [column_name(column + 1, layout.names[column]) for column in layout.columns_of("word")]
    if (
        words
        and not stamps
        and len(table) == 1
        and is_time_heading(layout.names[columns[0]])
        and (np.diff(table[0]) > 0).all()
    ):
        raise ValueError(
            f"The {WHAT} holds no numbers beside the times in {column_name(columns[0] + 1, layout.names[columns[0]])}; "
            f"{words[0]} holds words."
        )
    recording = recording_from_table(
        table[kept],
        [layout.names[columns[index]] for index in kept],
        [columns[index] + 1 for index in kept],
        clock=clock,
        stated_rate=rate,
        lines=line_numbers,
    )
    notes = list(recording.notes)
    if words:
        notes.append(f"words left out: {', '.join(words)}")
    if clock and clock.epoch == "start" and clock.rounding == 60:
        notes.append("times read as hours and minutes")
    if below:
        notes.append(f"{counted(below, 'line')} below the columns left out")
    return replace(
        recording,
        mended_lines=mended + int(np.isnan(table).any(axis=0).sum()),
        start_s=unix_start_s or recording.start_s or start_s,
        epoch="1970" if unix_start_s else recording.epoch,
        tracks=layout.sensors,
        track=number,
        notes=tuple(notes),
    )


# Lines.


def _split_fields(lines: Sequence[str], separator: str | None) -> list[list[str]]:
    """Return the fields of each line."""
    if separator is not None and any('"' in line for line in lines):
        with suppress(csv.Error):
            rows = list(csv.reader(lines, delimiter=separator, skipinitialspace=True))
            if len(rows) == len(lines):  # otherwise a quotation mark is never closed
                return rows
    return [line.replace('"', "").split(separator) for line in lines]


def _blocks(text: str, first_line: int) -> Iterator[tuple[int, str]]:
    """Yield the number of the first line and the text of each block of lines, from `first_line` on."""
    start = 0
    for _ in range(first_line - 1):
        start = text.index("\n", start) + 1
    while start < len(text):
        end = text.find("\n", start + BLOCK_SIZE) + 1 or len(text)
        block = text[start:end].removesuffix("\n")
        yield first_line, block
        first_line += block.count("\n") + 1
        start = end


# Layout of the columns.


@dataclass(frozen=True)
class _Layout:
    """The layout of the columns in a text.

    Attributes
    ----------
    separator
        The character between columns; None: spaces.
    kinds
        Content of each column; "missing" if it is empty.
    rows
        Number of rows among the probed lines.
    first
        Line number of the first row.
    heading
        The lines above it.
    names
        The heading of each column, "" if it has none.
    sensor_column, sensors
        The column of words that name the sensor of a line, and these words in their order.
    marks
        Thousands separator of each column, "" if it has none.
    """

    separator: str | None
    kinds: tuple[Kind, ...]
    rows: int
    first: int
    heading: tuple[str, ...] = ()
    names: tuple[str, ...] = ()
    sensor_column: int = 0
    sensors: tuple[str, ...] = ("1",)
    marks: tuple[str, ...] = ()

    def columns_of(self, kind: Kind) -> list[int]:
        """Return the columns of one kind."""
        return [column for column, one in enumerate(self.kinds) if one == kind]


def _layout(text: str, with_comments: str) -> _Layout | None:
    """Return the layout of a text without comments, None if no line holds a number.

    Its heading is taken from the text with comments, since these may belong to it.
    """
    lines = ((number, line.strip("\n")) for number, line in enumerate(io.StringIO(text), start=1))
    probed = list(itertools.islice(((number, line) for number, line in lines if line.strip()), PROBED_LINES))
    for number, line in probed:
        if len(line) > MAX_LINE_LENGTH:
            raise ValueError(f"Line {number} has {len(line):,} characters; at most {MAX_LINE_LENGTH:,} are accepted.")
    layouts = [layout for separator in _SEPARATORS if (layout := _layout_with(probed, separator))]
    if not layouts:
        return None
    most_rows = max(layout.rows for layout in layouts)
    likely = (layout for layout in layouts if 2 * layout.rows >= most_rows)
    best = min(likely, key=lambda layout: len(layout.columns_of("word")))
    # Tabs at the ends stand for columns without a name.
    above = itertools.islice(io.StringIO(with_comments), best.first - 1)
    heading = [_COMMENT_MARK.sub("", line.strip(" \n")) for line in above]
    heading = [
        line
        for line in heading
        if line.strip() and not (len(best.kinds) > 1 and _SECTION_TITLE.fullmatch(line.strip()))
    ]
    rows = [row for row in _split_fields([line for _, line in probed], best.separator) if _is_row(row, best)]
    columns = [[row[column].strip() for row in rows if len(row) > column] for column in range(len(best.kinds))]
    best = replace(
        best,
        heading=tuple(heading[-MAX_OTHER_LINES:]),
        names=_column_names(heading, best, is_numbered=columns[0][:MIN_ROWS] == [*map(str, range(1, MIN_ROWS + 1))]),
        marks=tuple(_thousands_mark_of_column(texts, best.separator) for texts in columns),
    )
    return _with_sensors(best, columns)


def _with_sensors(layout: _Layout, columns: Sequence[Sequence[str]]) -> _Layout:
    """Return a layout with its sensors, if the words of a column take turns in a fixed order."""
    for column in layout.columns_of("word"):
        words = columns[column]
        sensors = tuple(dict.fromkeys(words))
        in_turn = [word == later for word, later in zip(words, words[len(sensors) :], strict=False)]
        are_enough = 1 < len(sensors) <= MAX_SENSORS and len(in_turn) >= MIN_ROWS
        if are_enough and sum(in_turn) >= MIN_CONFORMING_SHARE * len(in_turn):
            return replace(layout, sensor_column=column, sensors=sensors)
    return layout


def _rows_of_sensor(text: str, layout: _Layout, sensor: str) -> str:
    """Return a text in which the rows of other sensors are blank, so that all lines keep their numbers."""
    lines = text.split("\n")
    for number, row in enumerate(_split_fields(lines[layout.first - 1 :], layout.separator), start=layout.first - 1):
        if len(row) > layout.sensor_column and row[layout.sensor_column].strip() != sensor:
            lines[number] = ""
    return "\n".join(lines)


def _with_decimal_points(text: str, layout: _Layout) -> str | None:
    """Return a text with points for decimal commas between commas that separate columns; None if it has none.

    Then each column of integers is followed by one of digits without a sign: fewer names stand above them, or in each
    of these some begin with 0 or follow -0.
    """
    lines = text.split("\n")
    rows = [line.split(",") for line in lines[layout.first - 1 :][:PROBED_LINES]]
    rows = [row for row in rows if _is_row(row, layout)]
    numbers, width = layout.columns_of("number"), len(layout.kinds)
    after = numbers[1::2]
    if [*zip(numbers[::2], after, strict=False)] != [(column - 1, column) for column in after] or len(numbers) % 2:
        return None
    if not all(
        row[column].isdigit() and re.fullmatch(r"\s*[-+]?\d+", row[column - 1]) for row in rows for column in after
    ):
        return None
    names = [name for name in layout.heading[-1:] for name in name.split(",") if _kind(name) == "word"]
    are_clear = all(
        any(row[column - 1].strip() == "-0" or re.match(r"0\d", row[column]) for row in rows) for column in after
    )
    if not (len(names) == width - len(after) > 1 or (are_clear and (width == 2 or len(names) != width))):
        return None
    for number, row in enumerate(line.split(",") for line in lines):
        if number >= layout.first - 1 and len(row) == width:
            fields = (
                (row[column - 1] + "." + row[column]) if column in after else row[column]
                for column in range(width)
                if column + 1 not in after
            )
            lines[number] = ",".join(fields)
    return "\n".join(lines)


def _layout_with(lines: Sequence[tuple[int, str]], separator: str | None) -> _Layout | None:
    """Return the layout of numbered lines with a given separator, None if it gives no column of numbers."""
    if separator and not any(separator in line for _, line in lines):
        return None
    rows = _split_fields([line for _, line in lines], separator)
    rows = [row if len(row) <= MAX_FIELDS else [] for row in rows]
    kinds = [[_kind(field) for field in row] for row in rows]
    widths = Counter(len(row) for row in kinds if "number" in row)
    width = max(widths, key=lambda width: widths[width], default=0)
    columns = zip(*(row for row in kinds if len(row) == width), strict=True)
    layout = _Layout(separator, tuple(map(_kind_of_column, columns)), 0, 0)
    fitting = [_is_row(row, layout) for row in rows]
    if "number" not in layout.kinds or not any(fitting):
        return None
    # A line of the heading may look like a row, but after the first row most lines are rows: all of them if the line
    # holds text in a column that is otherwise empty. Below the names, BIOPAC writes the number of samples of each
    # channel, but not of the times in the first column.
    empty, first = layout.columns_of("missing"), fitting.index(True)
    for row, fits in enumerate(fitting):
        later = fitting[row + 1 : row + 1 + MIN_ROWS]
        has_more = any(rows[row][column].strip() for column in empty if column < len(rows[row]))
        counts = {field.strip() for field in rows[row][1:]} - {""}
        holds_counts = fits and not rows[row][0].strip() and len(counts) == 1 and "".join(counts).isdigit()
        if holds_counts and all(other[0].strip() for other in rows[row + 1 : row + 1 + MIN_ROWS] if other):
            continue
        if fits and (all(later) if has_more else 2 * sum(later) >= len(later)):
            first = row
            break
    # Some loggers write their serial number behind the first row.
    first -= first > 0 and len(rows[first - 1]) > width and _is_row(rows[first - 1][:width], layout)
    return replace(layout, rows=sum(fitting), first=lines[first][0])


def _kind(field: str) -> Kind:
    field = field.strip()
    if _MISSING.fullmatch(field):
        return "missing"
    return "number" if _parse_number(field) is not None else "stamp" if is_stamp(field) else "word"


def _kind_of_column(kinds: Sequence[Kind]) -> Kind:
    counts = Counter(kinds)
    if len(kinds) - counts["missing"] < MIN_FILLED_SHARE * len(kinds) or counts["missing"] == len(kinds):
        return "missing"
    return max(("number", "stamp", "word"), key=lambda kind: counts[kind])


def _is_row(row: Sequence[str], layout: _Layout) -> bool:
    """Return whether the fields of a line are those of a row, with at least half of its numbers."""
    number_count = 0
    for column, kind in enumerate(layout.kinds):
        if kind in ("number", "stamp"):
            found = _kind(row[column]) if column < len(row) else "word"
            if found not in (kind, "missing"):
                return False
            number_count += kind == found == "number"
    return 2 * number_count >= len(layout.columns_of("number")) and not any(map(str.strip, row[len(layout.kinds) :]))


def _parse_number(field: str, mark: str = "") -> float | None:
    """Return the number in a field, which may have a decimal comma, thousands separators or a unit; None if none.

    A single comma or point separates thousands only if it is the `mark` of the column.
    """
    if "_" in field:
        return None
    if (grouped := _thousands_mark(field)) or mark:
        field = field.replace(grouped or mark, "")
    for text in (field, field.replace(",", ".")):
        with suppress(ValueError):
            return float(text)
    with_unit = _NUMBER_WITH_UNIT.fullmatch(field)
    return _parse_number(with_unit[1], mark) if with_unit else None


def _thousands_mark(field: str) -> str:
    """Return the thousands separator of a number, if it cannot be a decimal mark; otherwise ""."""
    found = _GROUPED.fullmatch(field)
    is_clear = found and (found["mark"] in "' " or found["rest"] or field.count(found["mark"]) > 1)
    return found["mark"] if found and is_clear else ""


def _thousands_mark_of_column(texts: Sequence[str], separator: str | None) -> str:
    """Return the thousands separator of a column, "" if it has none.

    A "1,234" holds a thousand if other numbers are integers below a thousand: any between commas as separators, where
    it is quoted, otherwise more than ten times the 1, since 499,667 and 500 have a decimal comma.
    """
    mark = next(filter(None, map(_thousands_mark, texts)), "")
    below = [abs(int(text)) for text in texts if re.fullmatch(r"[-+]?\d{1,3}", text)]
    for one in ",." if below and not mark else "":
        marked = [text for text in texts if one in text]
        if marked and all(map(_GROUPED.fullmatch, marked)):
            highest = max(abs(int(text.partition(one)[0])) for text in marked)
            mark = one if one == separator or max(below) > max(99, 10 * highest) else ""
    return mark


def _column_names(heading: Sequence[str], layout: _Layout, *, is_numbered: bool) -> tuple[str, ...]:
    """Return the heading of each column: its fields in the lines directly above the first row, top to bottom.

    `is_numbered` means that the first column numbers the rows, from 1.
    """
    width = len(layout.kinds)
    names: list[list[str]] = []
    for line in reversed(heading[-MAX_NAME_LINES:]):
        fields = [field.strip() for field in _split_fields([line], layout.separator)[0]]
        if not names and is_numbered and len(fields) == width - 1:  # by R, without a name
            fields = ["", *fields]
        if not names and layout.separator and len(fields) > width > 1 and all(fields[:width]):
            fields = fields[:width]  # the last columns are empty
        if layout.separator is None and len(fields) != width:
            fields = re.split(r"\s{2,}|\t", line.strip())
        while len(fields) > width and not fields[-1]:
            fields.pop()
        if not names and "".join({*fields}).isdigit():  # BIOPAC's numbers of samples
            continue
        if len(fields) != width or (width == 1 and names) or not any(_kind(field) == "word" for field in fields):
            break
        if names and any(
            (named := pattern.search(line)) and _quantity_at(line, named.end(), 1, layout)
            for pattern in (_RATE_WORDS, _STEP_WORDS)
        ):
            break
        names.insert(0, fields)
    return tuple(" ".join(filter(None, parts)) for parts in zip(*names, strict=True)) or ("",) * width


def _stated_rate_and_start(layout: _Layout) -> tuple[float | None, float]:
    """Return the sampling rate in the heading, Hz, None if there is none, and the time of the first sample, s."""
    rate, start_s = None, 0.0
    rows = [_split_fields([line], layout.separator)[0] for line in layout.heading]
    for line, row, below in zip(layout.heading, rows, [*rows[1:], []], strict=False):
        under = {field.strip().lower(): text for field, text in zip(row, below, strict=False)}
        start_s = _parse_number(under.get("start", "")) or start_s
        for pattern, power in ((_RATE_WORDS, 1), (_STEP_WORDS, -1)):
            if rate is None and (named := pattern.search(line)):
                beneath = next((text for field, text in under.items() if pattern.search(field)), "")
                value = _quantity_at(line, named.end(), power, layout) or _quantity_at(beneath, 0, power, layout)
                rate = value**power if value else None
        if rate is None and line.lower() in _VICON_SECTIONS:
            rate = _parse_number("".join(below))
        if rate is None and (interval := _SECONDS_PER_SAMPLE.search(line)):
            rate = 1 / (float(interval[1]) * (time_unit(interval[2]) or 1.0))
    return rate, start_s


def _start_and_rate_in_rows(table: npt.NDArray[np.float64]) -> tuple[float, float]:
    """Return the start, Unix seconds, and the rate, Hz, in the first two rows, as wearables write them; otherwise 0, 0.

    Both are the same in all columns.
    """
    low, high = UNIX_RANGE_S
    if table.shape[1] < MIN_ROWS or np.ptp(table[:, :2], axis=0).any() or (np.abs(table[:, 2:]) >= low).any():
        return 0.0, 0.0
    start_s, rate = table[0, :2].tolist()
    return (start_s, rate) if low <= start_s < high and rate > 0 else (0.0, 0.0)


def _quantity_at(text: str, place: int, power: int, layout: _Layout) -> float:
    """Return the rate, Hz (power 1), or interval, s (power -1), at a place in a heading; 0 if there is none."""
    found = _QUANTITY.match(text, place)
    if found is None:
        return 0.0
    number, unit = found["grouped"], found["within"] or found["unit"] or ""
    if number:
        number = number.replace(" ", "").replace(",", "." if layout.separator == ";" else "")
    elif layout.separator == "," and "," in found["number"]:  # the next field
        number, unit = found["number"].partition(",")[0], found["within"] or ""
    else:
        number = found["number"].replace(",", ".")
    value, prefix, per = float(number), _UNIT_PREFIX.match(unit), _PER_UNIT.fullmatch(unit)
    if not MIN_STATED < value < MAX_STATED:
        return 0.0
    seconds = time_unit(unit) or 1.0
    if power < 0:
        return value * seconds
    if per:
        value /= time_unit(per[1] or per[2]) or 1.0
    elif seconds != 1.0:  # every 5 min
        return 1 / (value * seconds)
    return value * (_PREFIX_FACTORS[prefix[1]] if prefix else 1.0)


def _without_footer(text: str, layout: _Layout) -> tuple[str, int]:
    """Return the text up to its last row, and the number of lines below it."""
    end, below = len(text.rstrip()), 0
    while layout.rows >= MIN_ROWS and below <= MAX_OTHER_LINES and end > 0:
        start = text.rfind("\n", 0, end) + 1
        if _is_row(_split_fields([text[start:end]], layout.separator)[0], layout):
            return text[:end], below
        below += 1
        end = len(text[:start].rstrip()) if end - start < MAX_LINE_LENGTH else 0
    return text, 0


# The values.


def _read_rows(
    text: str, layout: _Layout
) -> tuple[npt.NDArray[np.float64], dict[int, list[str]], npt.NDArray[np.int64]]:
    """Return (columns, rows) numbers, NaN where missing; the texts of each column of times; each row's line number."""
    numbers, tables, line_numbers = layout.columns_of("number"), [], []
    stamps: dict[int, list[str]] = {column: [] for column in layout.columns_of("stamp")}
    heading = {line.strip() for line in layout.heading[-MAX_NAME_LINES:]}
    for first, block in _blocks(text, layout.first):
        table, size = _read_numbers(block, layout), block.count("\n") + 1
        if table is not None and table.shape[1] == size:
            places = np.arange(first, first + size)
        else:
            lines = block.split("\n")
            # A logger writes its heading again when it is restarted.
            skipped = {"", *heading} if table is None else {""}
            kept = [(number, line) for number, line in enumerate(lines, start=first) if line.strip() not in skipped]
            places = np.array([number for number, _ in kept], dtype=np.int64)
        if table is None:
            columns = _columns_of_rows(_split_fields([line for _, line in kept], layout.separator), places, layout)
            table = np.array([_parse_column(columns[column], places, column, layout) for column in numbers])
            for column, texts in stamps.items():
                texts.extend(map(str.strip, columns[column]))
        tables.append(table)
        line_numbers.append(places)
    return np.concatenate(tables, axis=1), stamps, np.concatenate(line_numbers)


def _without_sentinels(table: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return a table with NaN in place of -9999, 9999.9 and the like, which loggers write for a missing value.

    Such an extreme is a sentinel if it is farther from the other values of its column than those are from each other.
    """
    for column in table:
        for extreme in (np.nanmin(column), np.nanmax(column)) if np.isfinite(column).any() else ():
            rest = column[(column != extreme) & np.isfinite(column)]
            may_be_sentinel = _SENTINEL.fullmatch(f"{extreme:.10g}") and rest.size >= MIN_ROWS
            # A trigger has only two values, one of which may look like a sentinel.
            if may_be_sentinel and 0 < np.ptp(rest) < np.abs(rest - extreme).min():
                column[column == extreme] = np.nan
    return table


def _read_numbers(block: str, layout: _Layout) -> npt.NDArray[np.float64] | None:
    """Return the columns of a block if it holds only plain numbers; otherwise None."""
    if set(layout.kinds) != {"number"} or any(layout.marks) or not block.strip():
        return None
    with suppress(ValueError):
        plain = block if layout.separator == "," else block.replace(",", ".")  # a decimal comma
        table = np.loadtxt(io.StringIO(plain), delimiter=layout.separator, comments=None, ndmin=2)
        if table.shape[1] == len(layout.kinds):
            return table.T
    return None


def _columns_of_rows(rows: list[list[str]], lines: npt.NDArray[np.int64], layout: _Layout) -> list[tuple[str, ...]]:
    """Return the columns of rows; ValueError if one has more or fewer fields than the rest."""
    width, needed = len(layout.kinds), max((*layout.columns_of("number"), *layout.columns_of("stamp"))) + 1
    if set(map(len, rows)) != {width}:
        for row, line in zip(rows, lines, strict=True):
            if len(row) < needed or (line != layout.first and any(map(str.strip, row[width:]))):
                raise ValueError(
                    f"Line {line} holds {len(row)} field{'s' * (len(row) > 1)} and the lines before it {width}; "
                    "complete or remove it."
                )
    return list(itertools.zip_longest(*rows, fillvalue=""))[:width] or [()] * width


def _parse_column(texts: Sequence[str], lines: npt.NDArray[np.int64], column: int, layout: _Layout) -> Vector:
    """Return the numbers of a column, NaN where missing; ValueError for anything else."""
    mark = layout.marks[column]
    commas = layout.separator != "," and any("," in text for text in texts[:PROBED_LINES])
    with suppress(ValueError):
        if not mark and not any("_" in text for text in texts):
            plain = (text.replace(",", ".") for text in texts) if commas else texts
            return np.fromiter(map(float, plain), np.float64, len(texts))
    values = np.empty(len(texts))
    for row, text in enumerate(map(str.strip, texts)):
        value = np.nan if _MISSING.fullmatch(text) else _parse_number(text, mark)
        if value is None:
            raise _field_error(lines[row], text, column, layout, "numbers")
        values[row] = value
    return values


def _field_error(line: int, text: str, column: int, layout: _Layout, expected: str) -> ValueError:
    place = f" in {column_name(column + 1, layout.names[column])}" if len(layout.kinds) > 1 else ""
    return ValueError(
        f"Line {line} holds {quote(text)}{place}, where other lines hold {expected}; correct or remove it."
    )


# The times.


def _clock_of_stamps(
    layout: _Layout, stamps: dict[int, list[str]], table: npt.NDArray[np.float64], lines: npt.NDArray[np.int64]
) -> tuple[Times | None, list[int]]:
    """Return the times in columns of dates and times of day, and the indices of the columns of numbers among them.

    A date and a time of day may be in two columns, and fractions of seconds in a third. A date that never changes, or
    a version number that looks like one, is not a clock.
    """
    parts = {
        column: date_and_clock(next((text for text in texts if is_stamp(text)), "")) for column, texts in stamps.items()
    }
    changing = [one for one, texts in stamps.items() if len({*texts}) > 1] or [one for one in stamps if parts[one][1]]
    number: int | None = None
    column = next(iter(changing or stamps), None)
    if column is None:
        return None, []
    other = next((one for one in stamps if parts[one] == (not parts[column][0], not parts[column][1])), None)
    texts = stamps[column]
    if other is not None:
        date, time = (column, other) if parts[column][0] else (other, column)
        texts = [f"{day} {clock}" for day, clock in zip(stamps[date], stamps[time], strict=True)]
    elif parts[column] != (True, True):
        texts, number = _with_numbers(texts, parts[column][1], table, layout, column)
    if not changing and number is None:
        return None, []
    times = read_stamps(texts)
    for row in np.flatnonzero(np.isnan(times.seconds)):
        if not _MISSING.fullmatch(stamps[column][row]):
            raise _field_error(int(lines[row]), texts[row], column, layout, "times")
    times, fraction = with_fractions(times, table, [layout.names[column] for column in layout.columns_of("number")])
    return times, [index for index in (number, fraction) if index is not None]


def _with_numbers(
    texts: list[str], are_clocks: bool, table: npt.NDArray[np.float64], layout: _Layout, column: int
) -> tuple[list[str], int | None]:
    """Return times of day with the dates in a column of numbers, 20240513, or dates with times of day, 22.58.

    Also the index of that column; the texts alone and None if there is none. Beside dates, numbers are
    times of day if the times then rise evenly.
    """
    for index, number in enumerate(layout.columns_of("number")):
        values, name = table[index], layout.names[number]
        if are_clocks and (not name or is_time_heading(name)) and 19_000_101 <= values.min() <= values.max() < 21e6:
            return [f"{day:.0f} {text}" for day, text in zip(values, texts, strict=True)], index
        hours, minutes = np.divmod(np.rint(100 * values), 100)
        is_beside = not are_clocks and abs(number - column) == 1 and time_unit(name) is None
        if is_beside and minutes.any() and np.ptp(hours) and np.allclose(values, hours + minutes / 100):
            both = [f"{day} {hour:.0f}:{minute:.0f}" for day, hour, minute in zip(texts, hours, minutes, strict=True)]
            if 0 <= hours.min() <= hours.max() < 24 and minutes.max() < 60 and rises_evenly(read_stamps(both).seconds):
                return both, index
    return texts, None
