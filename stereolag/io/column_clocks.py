"""The clock of a table: which column holds the times, in which unit, and the recording of the others on it."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Vector
from stereolag.io.clocks import (
    MAX_FILL_RATIO,
    MIN_GAP_RATIO,
    Channels,
    Gap,
    Recording,
    check_size,
    interpolated,
    on_even_clock,
    rises_evenly,
)
from stereolag.io.formats import WHAT
from stereolag.io.sources import quote
from stereolag.io.stamps import DAY_S, Times, read_stamps, rounding_step

FEWEST_ROWS = 10
"""Columns of fewer rows have no clock among their numbers, and nothing below them."""
MOSTLY = 0.9
MOST_MISSING = 0.5
"""Share of missing values above which a column is left out."""
LONG_LOSS = 3
"""Values missing in a row that are named as a gap."""

_UNITS = {
    unit: seconds
    for names, seconds in (
        ("ns nanosecond", 1e-9),
        ("us µs μs usec micro microsecond", 1e-6),
        ("ms msec milli millisecond", 1e-3),
        ("s sec second sekunde sekunden", 1.0),
        ("min minute", 60.0),
        ("h hr hour", 3600.0),
        ("day tage", DAY_S),
    )
    for unit in names.split()
}
_OF_DAY = re.compile(r"\b(?:of|per) (?:the )?day\b")
_TIME = re.compile(r"time|zeit|stamp|elapsed|second|millis|micros|datum|date|\b(?:temps|tiempo|tempo|sec|x value)\b")
_COUNT = re.compile(
    r"#|\b(?:no|nr|num|number|index|idx|samples?|sequence|point|row|n|id|scan|cnt|count|counter|record|x)\b"
)

_ROUNDED_TO = {8: DAY_S, 10: 3600.0, 12: 60.0}
"""Seconds to which a date written as 20240513, 2024051310 or 202405131015 is rounded, by the number of digits."""

_DATED = re.compile(r"dat[eu]")
_FIRST = 3
"""Columns without a heading in which a date and a time of day are looked for."""

_YYMMDD = 100_000, 500_000
"""Numbers that are dates of the years 2010 to 2049 where their heading calls them so."""

UNIX_S = 1e9, 4e9
"""Seconds since 1970 of the years 2001 and 2096."""
_SERIAL_DAYS = ((25_569, 36_000, 73_000), (719_529, 730_000, 767_000))
"""Days as spreadsheets and MATLAB count them: the number of 1970-01-01, and the first and last taken for a date."""
_SERIAL_ROUNDING = 1e-5
_COUNTER = 2**32
_MOST_FALLS = 0.1
"""Share of steps that may go back in a column that its heading calls times: above, it is a signal."""


def column_name(number: int, name: str) -> str:
    """Return a column in words: its number and, if it has one, its heading."""
    return f"column {number} {quote(name)}" if name else f"column {number}"


def _words_of(name: str) -> str:
    return name.lower().replace("_", " ")


def unit_of(name: str) -> float | None:
    """Return the unit of time that a heading names, s; None if it names none."""
    words = _letters(_OF_DAY.sub("", _words_of(name)))
    return next((unit for word in words if (unit := _UNITS.get(word) or _UNITS.get(word.removesuffix("s")))), None)


def is_time(name: str) -> bool:
    """Return whether a heading is that of times: a unit alone is one, but "day" may count the days of a trial."""
    words = _letters(name)
    is_unit = bool(words) and all(_UNITS.get(word, DAY_S) < DAY_S for word in words)
    return bool(_TIME.search(_words_of(name)) or words[:1] == ["t"] or is_unit)


def _letters(name: str) -> list[str]:
    return re.findall(r"[a-zµμ]+", _words_of(name))


def _column_of_times(table: Channels, names: Sequence[str]) -> int | None:
    """Return the index of the column that holds times or counts, None if there is none."""
    if len(table) < 2:
        return None
    for index, name in enumerate(names):
        if is_time(name):
            values = table[index][~np.isnan(table[index])]
            steps = np.diff(values)
            falls = min((steps < 0).mean(), (steps > 0).mean()) if steps.size else 1.0  # the last may come first
            if falls <= (0.0 if name == "T" else _MOST_FALLS) and values[-1] != values[0]:
                return index
    return 0 if rises_evenly(table[0]) or (not names[0] and _rises_alone(table[0])) else None


def _rises_alone(values: Vector) -> bool:
    """Return whether values always rise, mostly by about the same: the uneven times of a file without a heading."""
    steps = np.diff(values)
    if values.size < FEWEST_ROWS or np.isnan(values).any() or (steps <= 0).any():
        return False
    return float((np.abs(steps / np.median(steps) - 1) < 0.5).mean()) >= MOSTLY


def times_in_numbers(values: Vector, name: str) -> tuple[Times, bool]:
    """Return a column of numbers as times, and whether these are seconds: not counts of an unknown unit."""
    there = ~np.isnan(values)
    first = float(values[there][0])
    unit, rounding = unit_of(name), rounding_step(values[there])
    width = len(f"{values[there].min():.0f}")
    earliest, latest = _YYMMDD
    is_dated = _DATED.search(name.lower()) and earliest <= values[there].min() <= values[there].max() < latest
    if is_dated and (values[there] % 100).max() > 12:  # not 201105, a month
        width = 8
        whole = (values + 20_000_000) * 1e6
    else:
        whole = values * 10.0 ** (14 - width) if width in _ROUNDED_TO else values
    if unit is None and is_time(name) and _are_digits_of_clocks(whole[there]):
        if rounding >= 1 and values[there].max() < 2400:  # hours and minutes, as 945, rather than minutes and seconds
            whole, width = 100 * values, 12
        times = read_stamps([f"{value:013.6f}" for value in whole])
        if not np.isnan(times.seconds[there]).any():
            return replace(times, rounding=_ROUNDED_TO.get(width, rounding)), True
    if unit is None:
        low, high = UNIX_S
        unit = next((size for size in (1.0, 1e-3, 1e-6, 1e-9) if low <= first * size < high), None)
        for zero, low, high in _SERIAL_DAYS if is_time(name) and rounding <= _SERIAL_ROUNDING else ():
            if low <= first < high:
                seconds = (values - first) * DAY_S
                return Times(seconds, (first - zero) * DAY_S, "1970", rounding * DAY_S), True
    is_count = unit is None and not is_time(name) and (rounding >= 1 or bool(_COUNT.search(_words_of(name))))
    unit = unit or 1.0
    epoch: Literal["1970", "start"] = "1970" if UNIX_S[0] <= first * unit < UNIX_S[1] else "start"
    return Times((values - first) * unit, first * unit, epoch, rounding * unit), not is_count


def _date_and_clock_in_digits(table: Channels, names: Sequence[str]) -> tuple[Times, int, int] | None:
    """Return the times that two columns of digits give, 20240513 or 240513 and 101500, and these; None if none do."""
    first = [not name and index < _FIRST for index, name in enumerate(names)]
    timed = [
        index for index, name in enumerate(names) if (is_time(name) or first[index]) and np.isfinite(table[index]).all()
    ]
    for date_, time in itertools.permutations(timed, 2):
        days = table[date_] + (20_000_000 if table[date_].max() < _YYMMDD[1] else 0)
        is_dated = (
            (first[date_] or _DATED.search(names[date_].lower()))
            and days.min() >= 19_000_101
            and days.max() < 21_000_000
        )
        is_clock = unit_of(names[time]) is None and 2400 <= table[time].max() < 1e6  # not 2359 without seconds
        rises = is_clock and (_are_digits_of_clocks(table[time]) or np.ptp(table[time] // 10_000) > 0)
        if is_dated and rises and _are_digits_of_clocks(1e6 * days + table[time]):
            texts = [f"{day:.0f}T{clock:013.6f}" for day, clock in zip(days, table[time], strict=True)]
            times = read_stamps(texts)
            if np.isfinite(times.seconds).all():
                return replace(times, rounding=rounding_step(table[time])), date_, time
    return None


_PARTS = tuple(
    re.compile(pattern)
    for pattern in (
        r"#?(?i:y{2,4}|year|yr|jahr)",
        r"(?i:mon|mo|month|monat)|MM",
        r"(?i:d{1,2}|day|dom|tag)",
        r"(?i:h{1,2}|hr|hour|hours|stunde)",
        r"(?i:mi|min|minute|minutes)|mm",
        r"(?i:s{1,2}|sec|second|seconds|sekunde)",
    )
)
"""Headings of the year, month, day, hour, minute and second, where each is a column."""


def _clock_in_parts(table: Channels, names: Sequence[str]) -> tuple[Times, list[int]] | None:
    """Return the times of a year, a day and an hour in columns of their own, and these columns; None if none are.

    Without a month, the day is that of the year.
    """
    found = [next((at for at, name in enumerate(names) if part.fullmatch(name.split(" ")[0])), None) for part in _PARTS]
    used = [at for at in found if at is not None]
    if None in (found[0], found[2], found[3]) or not np.isfinite(table[used]).all():
        return None
    limits = (2100, 12, 31 if found[1] is not None else 366, 24, 59, 60.999)
    read = zip(found, limits, (1970, 1, 1, 0, 0, 0), strict=True)
    parts = [(np.full(table.shape[1], usual) if at is None else table[at], limit) for at, limit, usual in read]
    # Only seconds may have a fraction.
    if any((part < 0).any() or part.max() > limit or (part % 1).any() for part, limit in parts[:5]):
        return None
    years, months, days, hours, minutes, seconds = (part for part, _ in parts)
    years = years + 2000 * (years.max() < 100)
    begun = (12 * (years - 1970) + months - 1).astype("datetime64[M]").astype("datetime64[D]").astype(np.int64)
    times = (begun + days - 1) * DAY_S + hours * 3600 + minutes * 60 + seconds
    finest = rounding_step(seconds) if found[5] is not None else 60.0 if found[4] is not None else 3600.0
    return Times(times - times[0], float(times[0]), "1970", finest), used


def _are_digits_of_clocks(values: Vector) -> bool:
    """Return whether numbers are dates with times of day, 20240513101500, or times of day alone, 101500.

    Seconds as short as these, counted on, would also end in 60 to 99, or have the same gaps.
    """
    days, clocks = np.divmod(values, 1e6)
    minutes, seconds = clocks // 100, clocks % 100
    if (values < 0).any() or (seconds >= 60).any() or (minutes % 100 >= 60).any() or (minutes >= 2400).any():
        return False
    if days.any():
        return bool(days.min() >= 19_000_101 and days.max() < 21_000_000)
    steps, in_seconds = np.diff(values), np.diff(minutes // 100 * 3600 + minutes % 100 * 60 + seconds)
    usual = np.median(steps[steps > 0]) if (steps > 0).any() else 0.0
    fewer_gaps = (in_seconds > MIN_GAP_RATIO * usual).sum() < (steps > MIN_GAP_RATIO * usual).sum()
    return bool(fewer_gaps and np.median(steps) < 40)


def on_own_clock(
    table: Channels,
    names: Sequence[str],
    numbers: Sequence[int],
    *,
    clock: Times | None = None,
    stated_rate: float | None = None,
    lines: npt.NDArray[np.int64] | None = None,
) -> Recording:
    """Return the columns of a table as channels, apart from those of times and counts, which give the clock.

    Parameters
    ----------
    table
        (columns, rows), NaN where a value is missing.
    names, numbers
        The heading of each column, "" if it has none, and its number in the file, from 1.
    clock
        The time of each row, if a column of words gave it.
    stated_rate
        Samples per second by the heading; taken if no column gives times.
    lines
        The line of each row, for errors; None: rows are counted.

    Raises
    ------
    ValueError
        Times that go back, columns without values, or a size beyond the limits.
    """
    notes = []
    for column in (column for column, name in enumerate(names) if len(table) > 1 and (is_time(name) or column == 0)):
        begun = _begun_again(table[column])
        if begun.any():
            table = table.copy()
            table[column] += _COUNTER * begun
            notes.append(f"{column_name(numbers[column], names[column])} began again at 2^32 and was counted on")
    with np.errstate(over="ignore", invalid="ignore"):
        clocks = {index for index, name in enumerate(names) if len(table) > 1 and _is_clock(table[index], name, index)}
        index = None if clock else _column_of_times(table, names)
    is_seconds = True
    if clock is None and (in_parts := _clock_in_parts(table, names)):
        clock, used = in_parts
        clocks.update(used)
        notes.append(f"times in {' and '.join(column_name(numbers[one], names[one]) for one in used)}")
    elif clock is None and (dated := _date_and_clock_in_digits(table, names)):
        clock, *both = dated
        clocks.update(both)
        notes.append(f"times in {' and '.join(column_name(numbers[one], names[one]) for one in both)}")
    elif index is not None:
        clock, is_seconds = times_in_numbers(table[index], names[index])
        clocks.add(index)
        notes.append(f"{'times' if is_seconds else 'counts'} in {column_name(numbers[index], names[index])}")
    kept = [column for column in range(len(table)) if column not in clocks] or [len(table) - 1]
    sparse = [column for column in kept if np.isnan(table[column]).mean() > MOST_MISSING]
    if sparse:
        named = ", ".join(column_name(numbers[column], names[column]) for column in sparse)
        if sparse == kept:
            raise ValueError(
                f"The {WHAT} has values in fewer than half of its lines ({named}); at least half are needed."
            )
        notes.append(f"mostly empty, left out: {named}")
    chosen = [column for column in kept if column not in sparse]
    check_size(len(chosen), table.shape[1])
    values = table[chosen] if len(chosen) < len(table) else table
    if clock is None:
        gaps = _losses(values, np.arange(values.shape[1]) / stated_rate) if stated_rate else ()
        recording = Recording(interpolated(values, None, values.shape[1]), stated_rate, gaps=gaps)
    else:
        recording = _clocked(values, clock, lines)
        recording = recording if is_seconds else _counted(recording, stated_rate)
    return replace(
        recording,
        names=tuple(names[column] for column in chosen),
        numbers=tuple(numbers[column] for column in chosen),
        notes=(*notes, *recording.notes),
    )


def _begun_again(values: Vector) -> npt.NDArray[np.int64]:
    """Return how often a counter of 32 bits, as millis() of an Arduino, has begun again before each of its values."""
    with np.errstate(over="ignore", invalid="ignore"):
        steps, longest = np.diff(values), MAX_FILL_RATIO * np.diff(values).max(initial=0.0)
        falls = steps < 0
        seamless = (steps[falls] + _COUNTER >= 0) & (steps[falls] + _COUNTER <= longest) & (longest < _COUNTER / 2)
    is_counter = falls.any() and seamless.all() and (values == np.floor(values)).all() and values.min() >= 0
    return np.cumsum(np.concatenate(([False], falls & bool(is_counter))))


def _is_clock(values: Vector, name: str, column: int) -> bool:
    """Return whether a column rises as its heading says that times or counts do."""
    is_count = bool(_COUNT.search(_words_of(name)))
    counted = float((np.diff(values) == 1).mean()) if values.size > 1 and (is_count or column == 0) else 0.0
    if is_count and counted > MOSTLY:  # it may begin again after 255
        return True
    return (is_time(name) or is_count or counted == 1) and rises_evenly(values)


def _clocked(values: Channels, clock: Times, lines: npt.NDArray[np.int64] | None) -> Recording:
    """Return values on the clock of their times."""
    notes = []
    kept = np.flatnonzero(~np.isnan(clock.seconds))
    if kept.size < clock.seconds.size:
        notes.append(f"{clock.seconds.size - kept.size} without a time left out")
    if (np.diff(clock.seconds[kept]) <= 0).all():
        kept = kept[::-1]
        notes.append("the last comes first: turned round")
    seconds, values = clock.seconds[kept], values[:, kept]
    for row in np.flatnonzero(np.diff(seconds) < 0)[:1]:
        place = f"Sample {kept[row + 1] + 1}" if lines is None else f"Line {lines[kept[row + 1]]}"
        step = seconds[row] - seconds[row + 1]
        raise ValueError(f"{place} goes back in time by {step:,.6g} s; sort the file by its times, or cut it there.")
    clock = Times(seconds - seconds[0], clock.start_s + float(seconds[0]), clock.epoch, clock.rounding)
    recording = on_even_clock(clock, values)
    gaps = tuple(sorted((*recording.gaps, *_losses(values, clock.seconds)), key=lambda gap: gap.start_s))
    return replace(recording, gaps=gaps, notes=(*notes, *recording.notes))


def _losses(values: Channels, seconds: Vector) -> tuple[Gap, ...]:
    """Return the gaps in which every channel lacks its values."""
    edges = np.flatnonzero(np.diff(np.isnan(values).all(axis=0), prepend=False, append=False))
    runs = [(first, last) for first, last in edges.reshape(-1, 2) if last - first >= LONG_LOSS and last < seconds.size]
    return tuple(
        Gap(float(seconds[first - 1] if first else 0.0), float(seconds[last] - seconds[first])) for first, last in runs
    )


def _counted(recording: Recording, rate: float | None) -> Recording:
    """Return a recording whose times are counts of an unknown unit at the stated rate, or at none."""
    per_count = recording.sampling_rate or 1.0
    missing = round(sum(gap.length_s for gap in recording.gaps) * per_count)
    notes = (*recording.notes, f"{missing:,} samples missing by their counts, filled") if missing else recording.notes
    unit_s = per_count / rate if rate else 0.0
    gaps = tuple(Gap(gap.start_s * unit_s, gap.length_s * unit_s) for gap in recording.gaps) if rate else ()
    return replace(recording, sampling_rate=rate, start_s=0.0, epoch="start", gaps=gaps, notes=notes)
