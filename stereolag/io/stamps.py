"""Dates and times of day in words, as loggers and spreadsheets write them, in seconds."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from datetime import date
from typing import TypeAlias

import numpy as np

from stereolag.core.arrays import Vector
from stereolag.io.clocks import Epoch, Times, granule

DAY_S = 86_400
_EPOCH = date(1970, 1, 1).toordinal()
_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")

_DATE = r"(\d{1,4})([-/. ])(\d{1,2}|[A-Za-z]{3,9})\.?\2(\d{1,4})|((?:19|20)\d{6})"
_CLOCK = r"(\d{1,5}):(\d{1,2})(?::(\d{1,2}))?(?:([.,:])(\d{1,9}))?|(\d{6})(?:[.,](\d{1,9}))?"
_STAMP = re.compile(
    rf"(?:{_DATE})?(?:\s*T|\s*,|_)?\s*(?:(?:{_CLOCK})\s*(?:([AaPp])\.?[Mm]\.?)?\s*(Z|UTC|GMT|[+-]\d\d:?\d\d)?)?"
)
_ISO = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d(?:\.\d+)?")
_NEXT_DAY = -DAY_S / 2
"""A step of a time of day, s, below which midnight has passed."""

EARLIEST_S = 60
"""Times that begin before this are elapsed ones, not times of day, s."""

_Date: TypeAlias = tuple[str, str, str, str]


def is_stamp(text: str) -> bool:
    """Return whether a text is a date, a time of day, or both."""
    return any(date_and_clock(text))


def date_and_clock(text: str) -> tuple[bool, bool]:
    """Return whether a text gives a date, and whether it gives a time of day."""
    found = _STAMP.fullmatch(text)
    if found is None:
        return False, False
    # Six or eight digits alone are a number.
    return bool(found[1] or (found[5] and found[11])), bool(found[6] or (found[5] and found[11]))


def read_stamps(texts: Sequence[str]) -> Times:
    """Return the times that texts give, each a date, a time of day, or both; NaN for texts that give none.

    Where day and month cannot be told apart, those are taken that make the times follow most closely; if they still
    cannot be told apart, the times count from midnight. Times of day go on after midnight. Of two numbers, the first
    is minutes if it is above 23 or the second has a fraction, otherwise hours.
    """
    whole = np.empty(0, dtype="datetime64[ns]")
    if _ISO.fullmatch(texts[0]):
        with suppress(ValueError):
            whole = np.array(texts, dtype="datetime64[ns]")  # ten times as fast as the rest
    if whole.size and not np.isnat(whole).any():
        first = whole[0].astype("datetime64[D]")
        seconds = (whole - first).astype(np.int64) * 1e-9
        return _counted(seconds, int(first.astype(np.int64)) * DAY_S, "1970", granule(seconds))
    found = [_STAMP.fullmatch(text) for text in texts]
    clocks = [one for one in found if one and (one[6] or one[11])]
    by_minutes = all(one[6] and not one[8] for one in clocks) and any(one[10] or int(one[6]) > 23 for one in clocks)
    milliseconds = len({len(one[10]) for one in clocks if one[9] == ":"}) > 1
    days, is_clear = _days({_date(one) for one in found if one and (one[1] or one[5])}, any(one[13] for one in clocks))
    first_day = min(days.values(), default=0)
    seconds = np.full(len(texts), np.nan)
    for row, one in enumerate(found):
        if one is None or (clocks and not (one[6] or one[11])) or (days and not (one[1] or one[5])):
            continue
        seconds[row] = _seconds(one, by_minutes=by_minutes, milliseconds=milliseconds)
        if days:
            seconds[row] += (days[_date(one)] - first_day) * DAY_S
    decimals = max((len(one[10] or one[12] or "") for one in clocks), default=0)
    rounding = 10.0**-decimals if any(one[8] or one[11] or by_minutes for one in clocks) else 60.0
    if days:
        return _counted(
            seconds,
            first_day * DAY_S if is_clear else 0,
            "1970" if is_clear else "midnight",
            rounding if clocks else DAY_S,
        )
    there = ~np.isnan(seconds)
    seconds[there] += DAY_S * np.cumsum(np.diff(seconds[there], prepend=seconds[there][:1]) < _NEXT_DAY)
    first = seconds[there][:1]
    is_elapsed = by_minutes or not first.size or first[0] < EARLIEST_S or first[0] >= DAY_S
    return _counted(seconds, 0, "start" if is_elapsed else "midnight", rounding)


def _counted(seconds: Vector, day_s: int, epoch: Epoch, rounding: float) -> Times:
    first = float(seconds[~np.isnan(seconds)][0]) if not np.isnan(seconds).all() else 0.0
    return Times(seconds - first, day_s + first, epoch, rounding)


def _date(one: re.Match[str]) -> _Date:
    return (one[5][:4], "-", one[5][4:6], one[5][6:]) if one[5] else (one[1], one[2], one[3], one[4])


def _days(dates: set[_Date], half_days: bool) -> tuple[dict[_Date, int], bool]:
    """Return the day of each date, from 1970, and whether day and month can be told apart; {} if a day is none."""
    orders = {}
    for order in ("dmy", "mdy", "ymd"):
        try:
            orders[order] = {one: _day(one, order) for one in dates}
        except ValueError:
            continue
    if not dates or not orders:
        return {}, True
    spans = {order: max(days.values()) - min(days.values()) for order, days in orders.items()}
    likely = [order for order, span in spans.items() if span == min(spans.values())]
    european = any("." in one for one in dates)
    chosen = "mdy" if half_days and not european and "mdy" in likely else likely[0]
    return orders[chosen], european or half_days or all(orders[chosen] == orders[order] for order in likely)


def _day(parts: _Date, order: str) -> int:
    """Return the day of a date, from 1970, in the given order unless it says its own; ValueError if there is none."""
    first, _, second, third = parts
    if second.isalpha():
        second, order = str(_MONTHS.index(second[:3].lower()) + 1), "dmy"
    if len(first) > 2:
        order = "ymd"
    elif len(third) > 2 and order == "ymd":
        raise ValueError("the year comes last")
    numbers = dict(zip(order, map(int, (first, second, third)), strict=True))
    year = numbers["y"] + (0 if numbers["y"] >= 100 else 1900 if numbers["y"] >= 70 else 2000)
    return date(year, numbers["m"], numbers["d"]).toordinal() - _EPOCH


def _seconds(one: re.Match[str], *, by_minutes: bool, milliseconds: bool) -> float:
    """Return the time of day of a stamp, s, in UTC if it gives a zone."""
    if one[11]:
        hours, minutes, seconds, fraction = one[11][:2], one[11][2:4], one[11][4:], one[12]
    else:
        hours, minutes, seconds, fraction = one[6] or "0", one[7] or "0", one[8] or "0", one[10]
    if by_minutes:
        hours, minutes, seconds = "0", hours, minutes
    hour = int(hours)
    if one[13]:
        hour = hour % 12 + (12 if one[13] in "pP" else 0)
    total = hour * 3600 + int(minutes) * 60 + float(seconds)
    if fraction:
        total += int(fraction) / (1000 if milliseconds else 10 ** len(fraction))
    zone = one[14]
    if zone and zone[0] in "+-":
        total -= int(zone[0] + "1") * (int(zone[1:3]) * 3600 + int(zone[-2:]) * 60)
    return total
