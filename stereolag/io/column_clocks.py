"""The clock of a table: the column of times and its unit, and the other columns as a recording on that clock."""

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
    MIN_ROWS,
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

MIN_CONFORMING_SHARE = 0.9
"""Share of rows that must follow a pattern for a whole column to be taken to follow it."""
MAX_MISSING_SHARE = 0.5
"""Share of missing values above which a column is left out."""
MIN_GAP_ROWS = 3
"""Consecutive rows without values that are reported as a gap."""

_UNIT_SECONDS = {
    unit: seconds
    for names, seconds in (
        ("ns nsec nanosec nanosecond", 1e-9),
        ("us µs μs usec micro microsec microsecond", 1e-6),
        ("ms msec milli millisec millisecond", 1e-3),
        ("s sec second sekunde sekunden", 1.0),
        ("min minute", 60.0),
        ("h hr hour", 3600.0),
        ("day tage doy jd bjd hjd mjd", DAY_S),
        ("year yr jahr", 365.25 * DAY_S),
    )
    for unit in names.split()
}
_PER_DAY = re.compile(r"\b(?:of|per) (?:the )?day\b")
_TIME_WORDS = re.compile(
    r"time|zeit|stamp|elapsed|second|millis|micros|datum|date|julian"
    r"|\b(?:temps|tiempo|tempo|sec|ts|x value|[bhm]?jd)\b"
)
_COUNT_WORDS = re.compile(
    r"#|\b(?:no|nr|num|number|index|idx|samples?|seq|sequence|point|row|n|id|scan|cnt|count|counter|record|ticks|x)\b"
)

_ROUNDING_BY_DIGITS = {8: DAY_S, 10: 3600.0, 12: 60.0}
"""Rounding, s, of a date written as 20240513, 2024051310 or 202405131015, by its number of digits."""

_DATE_WORDS = re.compile(r"dat[eu]")
_CLOCK_COLUMNS = 3
"""Number of columns at the beginning that may be a date and a time of day without a heading."""

_YYMMDD_RANGE = 100_000, 500_000
"""Numbers taken for dates (2010 to 2049, YYMMDD) under a heading that names dates."""

UNIX_RANGE_S = 1e9, 4e9
"""Unix times taken for dates, s: the years 2001 to 2096."""
_SERIAL_DAYS = (
    (40_587, 45_000, 100_000, re.compile(r"\bmjd\b")),
    (25_569, 36_000, 73_000, _TIME_WORDS),
    (719_529, 730_000, 767_000, _TIME_WORDS),
    (2_440_587.5, 2_450_000, 2_490_000, _TIME_WORDS),
)
"""Modified Julian days, those of spreadsheets and of MATLAB, and Julian days: the number of 1970-01-01, the range taken
for dates, and the headings under which they are."""
_TICKS = ((1e-7, 62_135_596_800.0), (1e-7, 11_644_473_600.0), (1e-6, 11_644_473_600.0))
"""Counts since the years 1 and 1601, of .NET, Windows and WebKit: their unit, s, and the seconds to 1970."""
_MAX_SERIAL_ROUNDING = 1e-5
"""Rounding of serial days, about a second, above which they are not taken for times."""
_COUNTER_SIZE = 2**32
"""Values of a 32-bit counter, after which it begins again at 0."""
_MAX_FALLING_SHARE = 0.1
"""Share of steps backwards above which a column under a time heading is a signal."""


def column_name(number: int, name: str) -> str:
    """Return a phrase that names a column: its number and, if it has one, its heading."""
    return f"column {number} {quote(name)}" if name else f"column {number}"


def _normalised(name: str) -> str:
    return re.sub(r"(?<=[a-z]{2})(?=[A-Z])", " ", name).lower().replace("_", " ")


def time_unit(name: str) -> float | None:
    """Return the unit of time named in a heading, s; None if there is none."""
    words = _words(_PER_DAY.sub("", _normalised(name)))
    units = (_UNIT_SECONDS.get(word) or _UNIT_SECONDS.get(word.removesuffix("s")) for word in words)
    return next(filter(None, units), None)


def is_time_heading(name: str) -> bool:
    """Return whether a heading names times. A unit alone does, apart from "day", which may count days of a trial."""
    words = _words(name)
    is_unit = bool(words) and all(_UNIT_SECONDS.get(word, DAY_S) < DAY_S for word in words)
    return bool(_TIME_WORDS.search(_normalised(name)) or words[:1] == ["t"] or is_unit)


def _words(name: str) -> list[str]:
    return re.findall(r"[a-zµμ]+", _normalised(name))


def _time_column(table: Channels, names: Sequence[str]) -> int | None:
    """Return the index of the column of times or counts, None if there is none."""
    if len(table) < 2:
        return None
    for index, name in enumerate(names):
        if is_time_heading(name):
            values = table[index][~np.isnan(table[index])]
            steps = np.diff(values)
            # The last time may come first.
            falling = min((steps < 0).mean(), (steps > 0).mean()) if steps.size else 1.0
            if falling <= (0.0 if name in ("T", "Ts") else _MAX_FALLING_SHARE) and values[-1] != values[0]:
                return index
    return 0 if rises_evenly(table[0]) or (not names[0] and _rises_steadily(table[0])) else None


def _rises_steadily(values: Vector) -> bool:
    """Return whether values always rise, mostly by similar steps, as uneven times without a heading do."""
    steps = np.diff(values)
    always_rise = values.size >= MIN_ROWS and not np.isnan(values).any() and (steps > 0).all()
    return bool(always_rise and (np.abs(steps / np.median(steps) - 1) < 0.5).mean() >= MIN_CONFORMING_SHARE)


def times_from_numbers(values: Vector, name: str) -> tuple[Times, bool]:
    """Return a column of numbers as times, and whether they are seconds rather than counts of an unknown unit."""
    is_valid = ~np.isnan(values)
    valid = values[is_valid]
    first = float(valid[0])
    unit, rounding = time_unit(name), rounding_step(valid)
    digits = len(f"{valid.min():.0f}")
    earliest, latest = _YYMMDD_RANGE
    is_dated = _DATE_WORDS.search(name.lower()) and earliest <= valid.min() <= valid.max() < latest
    if is_dated and (valid % 100).max() > 12:  # not 201105, a month
        digits = 8
        stamps = (values + 20_000_000) * 1e6
    else:
        stamps = values * 10.0 ** (14 - digits) if digits in _ROUNDING_BY_DIGITS else values
    if unit is None and is_time_heading(name) and _are_clock_digits(stamps[is_valid]):
        if rounding >= 1 and valid.max() < 2400:  # hours and minutes, as 945, rather than minutes and seconds
            stamps, digits = 100 * values, 12
        times = read_stamps([f"{stamp:013.6f}" for stamp in stamps])
        if not np.isnan(times.seconds[is_valid]).any():
            return replace(times, rounding=_ROUNDING_BY_DIGITS.get(digits, rounding)), True
    if unit == DAY_S or (unit is None and rounding <= _MAX_SERIAL_ROUNDING):
        for zero, earliest_day, latest_day, heading in _SERIAL_DAYS:
            if earliest_day <= first < latest_day and heading.search(_normalised(name)):
                return Times((values - first) * DAY_S, (first - zero) * DAY_S, "1970", rounding * DAY_S), True
    if unit is None:
        low, high = UNIX_RANGE_S
        unit = next((size for size in (1.0, 1e-3, 1e-6, 1e-9) if low <= first * size < high), None)
        for size, before in _TICKS:
            if low <= first * size - before < high:
                return Times((values - first) * size, first * size - before, "1970", max(rounding, 1.0) * size), True
    is_count = (
        unit is None and not is_time_heading(name) and (rounding >= 1 or bool(_COUNT_WORDS.search(_normalised(name))))
    )
    unit = unit or 1.0
    epoch: Literal["1970", "start"] = "1970" if UNIX_RANGE_S[0] <= first * unit < UNIX_RANGE_S[1] else "start"
    return Times((values - first) * unit, first * unit, epoch, rounding * unit), not is_count


def _clock_from_digits(table: Channels, names: Sequence[str]) -> tuple[Times, list[int]] | None:
    """Return the times in a column of dates and one of times of day, and these columns; None if there are none.

    Dates are numbers like 20240513 or 240513, times of day like 101500.
    """
    unnamed = [not name and index < _CLOCK_COLUMNS for index, name in enumerate(names)]
    timed = [
        index
        for index, name in enumerate(names)
        if (is_time_heading(name) or unnamed[index]) and np.isfinite(table[index]).all()
    ]
    for date_, time in itertools.permutations(timed, 2):
        days = table[date_] + (20_000_000 if table[date_].max() < _YYMMDD_RANGE[1] else 0)
        is_dated = (
            (unnamed[date_] or _DATE_WORDS.search(names[date_].lower()))
            and days.min() >= 19_000_101
            and days.max() < 21_000_000
        )
        is_clock = time_unit(names[time]) is None and 2400 <= table[time].max() < 1e6  # not 2359 without seconds
        rises = is_clock and (_are_clock_digits(table[time]) or np.ptp(table[time] // 10_000) > 0)
        if is_dated and rises and _are_clock_digits(1e6 * days + table[time]):
            times = read_stamps([f"{day:.0f}T{clock:013.6f}" for day, clock in zip(days, table[time], strict=True)])
            if np.isfinite(times.seconds).all():
                return replace(times, rounding=rounding_step(table[time])), [date_, time]
    return None


_PART_HEADINGS = tuple(
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
"""Headings of columns for the year, month, day, hour, minute and second."""


def _clock_from_parts(table: Channels, names: Sequence[str]) -> tuple[Times, list[int]] | None:
    """Return the times in separate columns for year, day, hour and so on, and these columns; None if there are none.

    Without a month, the day is the day of the year.
    """
    found = [
        next((column for column, name in enumerate(names) if heading.fullmatch(name.split(" ")[0])), None)
        for heading in _PART_HEADINGS
    ]
    used = [column for column in found if column is not None]
    if None in (found[0], found[2], found[3]) or not np.isfinite(table[used]).all():
        return None
    limits = (2100, 12, 31 if found[1] is not None else 366, 24, 59, 60.999)
    parts = [
        (np.full(table.shape[1], default) if column is None else table[column], limit)
        for column, limit, default in zip(found, limits, (1970, 1, 1, 0, 0, 0), strict=True)
    ]
    # Only seconds may have a fraction.
    if any((part < 0).any() or part.max() > limit or (part % 1).any() for part, limit in parts[:5]):
        return None
    years, months, days, hours, minutes, seconds = (part for part, _ in parts)
    years = years + 2000 * (years.max() < 100)
    month_starts = (12 * (years - 1970) + months - 1).astype("datetime64[M]").astype("datetime64[D]").astype(np.int64)
    times = (month_starts + days - 1) * DAY_S + hours * 3600 + minutes * 60 + seconds
    rounding = rounding_step(seconds) if found[5] is not None else 60.0 if found[4] is not None else 3600.0
    return Times(times - times[0], float(times[0]), "1970", rounding), used


def _are_clock_digits(values: Vector) -> bool:
    """Return whether numbers are dates with times of day, 20240513101500, or times of day alone, 101500.

    Elapsed seconds would also end in 60 to 99, or have no fewer gaps when read as times of day.
    """
    days, clocks = np.divmod(values, 1e6)
    minutes, seconds = clocks // 100, clocks % 100
    if (values < 0).any() or (seconds >= 60).any() or (minutes % 100 >= 60).any() or (minutes >= 2400).any():
        return False
    if days.any():
        return bool(days.min() >= 19_000_101 and days.max() < 21_000_000)
    steps, in_seconds = np.diff(values), np.diff(minutes // 100 * 3600 + minutes % 100 * 60 + seconds)
    longest_regular = MIN_GAP_RATIO * (np.median(steps[steps > 0]) if (steps > 0).any() else 0.0)
    fewer_gaps = (in_seconds > longest_regular).sum() < (steps > longest_regular).sum()
    return bool(fewer_gaps and np.median(steps) < 40)


def recording_from_table(
    table: Channels,
    names: Sequence[str],
    numbers: Sequence[int],
    *,
    clock: Times | None = None,
    stated_rate: float | None = None,
    lines: npt.NDArray[np.int64] | None = None,
) -> Recording:
    """Return the columns of a table as channels; columns of times and counts give the clock instead.

    Parameters
    ----------
    table
        (columns, rows), NaN where a value is missing.
    names, numbers
        The heading of each column, "" if it has none, and its number in the file, from 1.
    clock
        The time of each row, if other columns or arrays of the file gave it.
    stated_rate
        Sampling rate in the heading, Hz; used if no column gives times.
    lines
        The line number of each row, for errors; None: errors number the rows.

    Raises
    ------
    ValueError
        Times that go back, columns without values, or a size beyond the limits.
    """
    notes = []
    for column, name in enumerate(names) if len(table) > 1 else ():
        if (is_time_heading(name) or column == 0) and (wraps := _counter_wraps(table[column])).any():
            table = table.copy()
            table[column] += _COUNTER_SIZE * wraps
            notes.append(f"{column_name(numbers[column], name)} began again at 2^32 and was continued")
    with np.errstate(over="ignore", invalid="ignore"):
        clocks = {
            column
            for column, name in enumerate(names)
            if len(table) > 1 and _is_time_or_count(table[column], name, column)
        }
        clock, used, is_seconds = (clock, [], True) if clock else _find_clock(table, names)
    clocks.update(used)
    if used:
        used_names = " and ".join(column_name(numbers[column], names[column]) for column in used)
        notes.append(f"{'times' if is_seconds else 'counts'} in {used_names}")
    signals = [column for column in range(len(table)) if column not in clocks] or [len(table) - 1]
    sparse = [column for column in signals if np.isnan(table[column]).mean() > MAX_MISSING_SHARE]
    if sparse:
        sparse_names = ", ".join(column_name(numbers[column], names[column]) for column in sparse)
        if sparse == signals:
            raise ValueError(
                f"The {WHAT} has values in fewer than half of its lines ({sparse_names}); at least half are needed."
            )
        notes.append(f"mostly empty, left out: {sparse_names}")
    kept = [column for column in signals if column not in sparse]
    check_size(len(kept), table.shape[1])
    values = table[kept] if len(kept) < len(table) else table
    if clock is None:
        gaps = _missing_stretches(values, np.arange(values.shape[1]) / stated_rate) if stated_rate else ()
        recording = Recording(interpolated(values, None, values.shape[1]), stated_rate, gaps=gaps)
    else:
        recording = _recording_on_clock(values, clock, lines)
        recording = recording if is_seconds else _on_stated_rate(recording, stated_rate)
    return replace(
        recording,
        names=tuple(names[column] for column in kept),
        numbers=tuple(numbers[column] for column in kept),
        notes=(*notes, *recording.notes),
    )


def _find_clock(table: Channels, names: Sequence[str]) -> tuple[Times | None, list[int], bool]:
    """Return the times in columns of numbers, if there are any, these columns, and whether the times are seconds.

    Times that are not seconds are counts of an unknown unit.
    """
    found, is_seconds = _clock_from_parts(table, names) or _clock_from_digits(table, names), True
    if found is None:
        column = _time_column(table, names)
        if column is None:
            return None, [], True
        times, is_seconds = times_from_numbers(table[column], names[column])
        found = times, [column]
    clock, fraction = with_fractions(found[0], table, names) if is_seconds else (found[0], None)
    return clock, found[1] if fraction is None else [*found[1], fraction], is_seconds


def with_fractions(times: Times, table: Channels, names: Sequence[str]) -> tuple[Times, int | None]:
    """Return times with the fractions of their seconds, and the index of the column of these, None if there is none."""
    for index, name in enumerate(names):
        unit = time_unit(name) or 0.0
        fraction = table[index] * unit
        if unit < times.rounding <= 1 and fraction.min() >= 0 and 0 < fraction.max() < 1:
            seconds, start_s = times.seconds + fraction - fraction[0], times.start_s + float(fraction[0])
            return Times(seconds, start_s, times.epoch, rounding_step(table[index]) * unit), index
    return times, None


def _counter_wraps(values: Vector) -> npt.NDArray[np.int64]:
    """Return how often a 32-bit counter, such as millis() of an Arduino, began again at 0 before each of its values."""
    with np.errstate(over="ignore", invalid="ignore"):
        steps, longest = np.diff(values), MAX_FILL_RATIO * np.diff(values).max(initial=0.0)
        falls = steps < 0
        unwrapped = steps[falls] + _COUNTER_SIZE
        seamless = (unwrapped >= 0) & (unwrapped <= longest) & (longest < _COUNTER_SIZE / 2)
    is_counter = falls.any() and seamless.all() and (values == np.floor(values)).all() and values.min() >= 0
    return np.cumsum(np.concatenate(([False], falls & bool(is_counter))))


def _is_time_or_count(values: Vector, name: str, column: int) -> bool:
    """Return whether a column holds times or counts, by its heading and its steps."""
    is_count = bool(_COUNT_WORDS.search(_normalised(name)))
    unit_steps = float((np.diff(values) == 1).mean()) if values.size > 1 and (is_count or column == 0) else 0.0
    may_begin_again = is_count and unit_steps > MIN_CONFORMING_SHARE  # after 255
    return may_begin_again or ((is_time_heading(name) or is_count or unit_steps == 1) and rises_evenly(values))


def _recording_on_clock(values: Channels, clock: Times, lines: npt.NDArray[np.int64] | None) -> Recording:
    """Return values as a recording on the clock of their times."""
    notes = []
    kept = np.flatnonzero(~np.isnan(clock.seconds))
    if kept.size < clock.seconds.size:
        notes.append(f"{clock.seconds.size - kept.size} without a time left out")
    if (np.diff(clock.seconds[kept]) <= 0).all():
        kept = kept[::-1]
        notes.append("the last comes first: reversed")
    seconds, values = clock.seconds[kept], values[:, kept]
    for row in np.flatnonzero(np.diff(seconds) < 0)[:1]:
        place = f"Sample {kept[row + 1] + 1}" if lines is None else f"Line {lines[kept[row + 1]]}"
        step = seconds[row] - seconds[row + 1]
        raise ValueError(f"{place} goes back in time by {step:,.6g} s; sort the file by its times, or cut it there.")
    clock = Times(seconds - seconds[0], clock.start_s + float(seconds[0]), clock.epoch, clock.rounding)
    recording = on_even_clock(clock, values)
    gaps = tuple(sorted((*recording.gaps, *_missing_stretches(values, clock.seconds)), key=lambda gap: gap.start_s))
    return replace(recording, gaps=gaps, notes=(*notes, *recording.notes))


def _missing_stretches(values: Channels, seconds: Vector) -> tuple[Gap, ...]:
    """Return the gaps in which no channel has a value."""
    edges = np.flatnonzero(np.diff(np.isnan(values).all(axis=0), prepend=False, append=False))
    return tuple(
        Gap(float(seconds[first - 1] if first else 0.0), float(seconds[last] - seconds[first]))
        for first, last in edges.reshape(-1, 2)
        if last - first >= MIN_GAP_ROWS and last < seconds.size
    )


def _on_stated_rate(recording: Recording, rate: float | None) -> Recording:
    """Return a recording whose times are counts of an unknown unit at the stated rate; None: without a rate."""
    per_count = recording.sampling_rate or 1.0
    missing = round(sum(gap.length_s for gap in recording.gaps) * per_count)
    notes = (*recording.notes, f"{missing:,} samples missing by their counts, filled") if missing else recording.notes
    unit_s = per_count / rate if rate else 0.0
    gaps = tuple(Gap(gap.start_s * unit_s, gap.length_s * unit_s) for gap in recording.gaps) if rate else ()
    return replace(recording, sampling_rate=rate, start_s=0.0, epoch="start", gaps=gaps, notes=notes)
