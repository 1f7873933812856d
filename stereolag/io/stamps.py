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
_MONTHS = ["jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"]
_OTHER_MONTHS = {"mai": "may", "okt": "oct", "dez": "dec"}

_DATE = (
    r"(?P<first>\d{1,4})\.?(?P<mark>[-/. ])(?P<second>\d{1,2}|[A-Za-z]{3,9})\.?(?P=mark)(?P<third>\d{1,4})"
    r"|(?P<month>[A-Za-z]{3,9})\.? +(?P<day>\d{1,2}),? +(?P<year>\d{4})|(?P<packed>(?:19|20)\d{6})"
)
_CLOCK = (
    r"(?P<h>\d{1,5}):(?P<m>\d{1,2})(?::(?P<s>\d{1,2}))?(?:(?P<point>[.,:])(?P<f>\d{1,9}))?"
    r"|(?P<hms>\d{6})(?:[.,](?P<part>\d{1,9}))?"
)
_AFTER = r"(?P<half>[AaPp])\.?[Mm]\.?)?\s*(?P<zone>Z|[+-]\d\d:?\d\d|[A-Z]{3,4}"
_STAMP = re.compile(rf"(?:[A-Z][a-z]{{2,8}},? +)?(?:{_DATE})?(?:\s*T|\s*,|_)?\s*(?:(?:{_CLOCK})\s*(?:{_AFTER})?)?")
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
    is_packed = bool(found["packed"] and found["hms"])
    return is_packed or bool(found["first"] or found["month"]), is_packed or bool(found["h"])


def read_stamps(texts: Sequence[str]) -> Times:
    """Return the times that texts give, each a date, a time of day, or both; NaN for texts that give none that exists.

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
    clocks = [one for one in found if one and (one["h"] or one["hms"])]
    by_minutes = all(one["h"] and not one["s"] for one in clocks) and any(
        one["f"] or int(one["h"]) > 23 for one in clocks
    )
    milliseconds = len({len(one["f"]) for one in clocks if one["point"] == ":"}) > 1
    dates = [_date(one) if one else None for one in found]
    days, is_clear = _days({one for one in dates if one}, any(one["half"] for one in clocks))
    if any(dates) and not days:
        return Times(np.full(len(texts), np.nan), 0.0, "start", 1.0)
    first_day = min(days.values(), default=0)
    seconds = np.full(len(texts), np.nan)
    for row, (one, day) in enumerate(zip(found, dates, strict=True)):
        if one is not None and (one["h"] or one["hms"] or not clocks) and (day or not days):
            seconds[row] = _seconds(one, by_minutes=by_minutes, milliseconds=milliseconds)
            seconds[row] += (days[day] - first_day) * DAY_S if day else 0
    decimals = max((len(one["f"] or one["part"] or "") for one in clocks), default=0)
    rounding = 10.0**-decimals if any(one["s"] or one["hms"] or by_minutes for one in clocks) else 60.0
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


def _date(one: re.Match[str]) -> _Date | None:
    """Return the three parts of a date and what stands between them, None if there is no date."""
    if one["packed"]:
        return one["packed"][:4], "-", one["packed"][4:6], one["packed"][6:]
    if one["month"]:
        return one["day"], "-", one["month"], one["year"]
    return (one["first"], one["mark"], one["second"], one["third"]) if one["first"] else None


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
        name = second[:3].lower()
        second, order = str(_MONTHS.index(_OTHER_MONTHS.get(name, name)) + 1), "dmy"
    if len(first) > 2:
        order = "ymd"
    elif len(third) > 2 and order == "ymd":
        raise ValueError("the year comes last")
    numbers = dict(zip(order, map(int, (first, second, third)), strict=True))
    year = numbers["y"] + (0 if numbers["y"] >= 100 else 1900 if numbers["y"] >= 70 else 2000)
    return date(year, numbers["m"], numbers["d"]).toordinal() - _EPOCH


def _seconds(one: re.Match[str], *, by_minutes: bool, milliseconds: bool) -> float:
    """Return the time of day of a stamp, s, in UTC if it gives a zone."""
    if one["hms"]:
        hours, minutes, seconds, fraction = one["hms"][:2], one["hms"][2:4], one["hms"][4:], one["part"]
    else:
        hours, minutes, seconds, fraction = one["h"] or "0", one["m"] or "0", one["s"] or "0", one["f"]
    if by_minutes:
        hours, minutes, seconds = "0", hours, minutes
    hour = int(hours)
    if one["half"]:
        hour = hour % 12 + (12 if one["half"] in "pP" else 0)
    total = hour * 3600 + int(minutes) * 60 + float(seconds)
    if fraction:
        total += int(fraction) / (1000 if milliseconds else 10 ** len(fraction))
    zone = one["zone"]
    if zone and zone[0] in "+-":
        total -= int(zone[0] + "1") * (int(zone[1:3]) * 3600 + int(zone[-2:]) * 60)
    return total
