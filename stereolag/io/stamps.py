"""Times as files give them: dates and times of day in words, as loggers and spreadsheets write them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import date
from typing import Literal, TypeAlias

import numpy as np

from stereolag.core.arrays import Vector

MOST_DIGITS = 9

DAY_S = 86_400
_EPOCH = date(1970, 1, 1).toordinal()
_MONTHS = ["jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"]
_OTHER_MONTHS = {"mai": "may", "okt": "oct", "dez": "dec"}

_ZONES = {
    zone: int(hours)
    for zone, hours in re.findall(
        r"([A-Z]+)([-+]\d)",
        "PST-8 PDT-7 MST-7 MDT-6 CST-6 CDT-5 EST-5 EDT-4 CET+1 MEZ+1 BST+1 CEST+2 MESZ+2 EET+2 EEST+3 MSK+3 JST+9",
    )
}
"""Hours by which the zones that logs name in letters are ahead of UTC; others are taken for UTC."""

_DATE = (
    r"(?P<first>\d{1,4})\.?(?P<mark>[-/. ])(?P<second>\d{1,2}|[A-Za-z]{3,9})\.?(?P=mark)(?P<third>\d{1,4})(?!\d)"
    r"|(?P<dd>\d{1,2})\.(?P<mm>\d{1,2})\.(?=,?\s*\d{1,2}:)"
    r"|(?P<month>[A-Za-z]{3,9})\.? +(?P<day>\d{1,2}),? +(?P<year>\d{4})|(?P<packed>(?:19|20)\d{6})"
)
_CLOCK = (
    r"(?P<h>\d{1,5}):(?P<m>\d{1,2})(?::(?P<s>\d{1,2}))?(?:(?P<point>[.,:])(?P<f>\d{1,9}))?"
    r"|(?P<hms>\d{6})(?:[.,](?P<part>\d{1,9}))?"
)
_AFTER = r"(?P<half>[AaPp])\.?[Mm]\.?)?\s*(?P<zone>Z|[+-]\d\d:?\d\d|(?<=\d)[+-]\d\d|[A-Z]{3,4}"
_STAMP = re.compile(
    rf"(?:[A-Z][a-z]{{2,8}},? +)?(?:(?:{_DATE}):?)?(?:\s*T|\s*,|_)?\s*(?:(?:{_CLOCK})\s*(?:{_AFTER})?)?"
)
_ISO = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d(?:\.\d+)?")
_NEXT_DAY = -DAY_S / 2
"""A step of a time of day, s, below which midnight has passed."""

EARLIEST_S = 60
"""Times that begin before this are elapsed ones, not times of day, s."""

_NO_YEAR, _LEAP_YEAR = "..", "2000"
"""What stands between the parts of a date without a year, and the year that counts its days."""

_YEAR_DAYS = 365

Epoch: TypeAlias = Literal["start", "midnight", "1970"]
_Date: TypeAlias = tuple[str, str, str, str]


@dataclass(frozen=True)
class Times:
    """Times as (N,) seconds after `start_s`, NaN where missing; what that counts from, and the step of rounding, s."""

    seconds: Vector
    start_s: float
    epoch: Epoch
    rounding: float


def rounding_step(times: Vector) -> float:
    """Return the power of ten to which times are rounded, 1e-9 if to none that is coarser."""
    sample = times[:: max(1, times.size // 1000)] - times[0]
    finest = 2 * float(np.spacing(np.abs(times[[0, -1]]).max()))
    for digits in range(MOST_DIGITS):
        scaled = sample * 10.0**digits
        if (np.abs(scaled - np.round(scaled)) <= 1e-6 + finest * 10.0**digits).all():
            return max(finest, 10.0**-digits)
    return 10.0**-MOST_DIGITS


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
    return is_packed or bool(found["first"] or found["dd"] or found["month"]), is_packed or bool(found["h"])


def read_stamps(texts: Sequence[str]) -> Times:
    """Return the times that texts give, each a date, a time of day, or both; NaN for texts that give none that exists.

    Where all are like 10.15.00 and no dates that follow each other, they are times of day.

    Where day and month cannot be told apart, those are taken that make the times follow most closely; if they still
    cannot be told apart, the times count from midnight. Times of day go on after midnight. Of two numbers, the first
    is minutes if it is above 23 or the second has a fraction, otherwise hours.
    """
    whole = np.empty(0, dtype="datetime64[ns]")
    if all(map(_ISO.fullmatch, texts)):
        with suppress(ValueError):
            whole = np.array(texts, dtype="datetime64[ns]")  # ten times as fast as the rest
    if whole.size and not np.isnat(whole).any():
        first = whole[0].astype("datetime64[D]")
        seconds = (whole - first).astype(np.int64) * 1e-9
        return _from_first(seconds, int(first.astype(np.int64)) * DAY_S, "1970", rounding_step(seconds))
    found = [_STAMP.fullmatch(text) for text in texts]
    clocks = [one for one in found if one and (one["h"] or one["hms"])]
    by_minutes = all(one["h"] and not one["s"] for one in clocks) and any(
        one["f"] or int(one["h"]) > 23 for one in clocks
    )
    milliseconds = len({len(one["f"]) for one in clocks if one["point"] == ":"}) > 1
    dates = [_date(one) if one else None for one in found]
    days, is_clear = _days({one for one in dates if one}, any(one["half"] for one in clocks))
    dotted = not clocks and all(one[1] == "." and len(one[3]) < 4 for one in dates if one)
    apart = np.abs(np.diff([days[one] for one in dates if one])) if days else np.empty(0)
    are_years = bool(apart.size) and np.median(apart) >= _YEAR_DAYS and apart.max() > _YEAR_DAYS + 1
    if dotted and any(dates) and (not days or are_years):  # 10.15.00
        return read_stamps([text.replace(".", ":") for text in texts])
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
        return _from_first(
            seconds,
            first_day * DAY_S if is_clear else 0,
            "1970" if is_clear else "midnight",
            rounding if clocks else DAY_S,
        )
    there = ~np.isnan(seconds)
    seconds[there] += DAY_S * np.cumsum(np.diff(seconds[there], prepend=seconds[there][:1]) < _NEXT_DAY)
    first = seconds[there][:1]
    is_elapsed = by_minutes or not first.size or first[0] < EARLIEST_S or first[0] >= DAY_S
    return _from_first(seconds, 0, "start" if is_elapsed else "midnight", rounding)


def _from_first(seconds: Vector, day_s: int, epoch: Epoch, rounding: float) -> Times:
    first = float(seconds[~np.isnan(seconds)][0]) if not np.isnan(seconds).all() else 0.0
    return Times(seconds - first, day_s + first, epoch, rounding)


def _date(one: re.Match[str]) -> _Date | None:
    """Return the three parts of a date and what stands between them, None if there is no date."""
    if one["packed"]:
        return one["packed"][:4], "-", one["packed"][4:6], one["packed"][6:]
    if one["month"]:
        return one["day"], "-", one["month"], one["year"]
    if one["dd"]:
        return one["dd"], _NO_YEAR, one["mm"], _LEAP_YEAR
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
    is_clear = european or half_days or all(orders[chosen] == orders[order] for order in likely)
    return orders[chosen], is_clear and not any(_NO_YEAR in one for one in dates)


def _day(parts: _Date, order: str) -> int:
    """Return the day of a date, from 1970, in the given order unless it says its own; ValueError if there is none."""
    first, mark, second, third = parts
    if mark == _NO_YEAR:
        order = "dmy"
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
    total -= _ZONES.get(zone, 0) * 3600
    if zone and zone[0] in "+-":
        total -= int(zone[0] + "1") * (int(zone[1:3]) * 3600 + int(zone[3:].lstrip(":") or 0) * 60)
    return total
