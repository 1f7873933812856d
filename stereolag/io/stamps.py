"""Times read from text: dates and times of day in the notations of loggers and spreadsheets."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import date
from typing import Literal, TypeAlias

import numpy as np

from stereolag.core.arrays import Vector

MAX_DECIMALS = 9
"""Decimals of a second that are distinguished in times."""

DAY_S = 86_400
_EPOCH_DAY = date(1970, 1, 1).toordinal()
_MONTHS = {
    name: number
    for number, names in enumerate(
        (
            *("jan ene gen", "feb fév fev", "mar mär mrt", "apr avr abr", "may mai mei maj mag", "jun juin giu"),
            *("jul juil lug", "aug aoû ago", "sep set", "oct okt ott out", "nov", "dec dez déc dic"),
        ),
        start=1,
    )
    for name in names.split()
}

_ZONE_HOURS = {
    zone: int(hours)
    for zone, hours in re.findall(
        r"([A-Z]+)([-+]\d)",
        "PST-8 PDT-7 MST-7 MDT-6 CST-6 CDT-5 EST-5 EDT-4 CET+1 MEZ+1 BST+1 CEST+2 MESZ+2 EET+2 EEST+3 MSK+3 JST+9",
    )
}
"""Offsets of the zones that logs name by letters, hours ahead of UTC; unknown zones are taken for UTC."""

_DATE = (
    r"(?P<first>\d{1,4})\.?(?P<mark>[-/. ])(?P<second>\d{1,2}|[^\W\d_]{3,10})\.?(?P=mark)(?P<third>\d{1,4})(?!\d)\.?"
    r"|(?P<dd>\d{1,2})\.(?P<mm>\d{1,2})\.(?=,?\s*\d{1,2}:)"
    r"|(?P<month>[A-Za-z]{3,9})\.? +(?P<day>\d{1,2}),? +(?P<year>\d{4})|(?P<packed>(?:19|20)\d{6})"
)
_CLOCK = (
    r"(?P<h>\d{1,5}):(?P<m>\d{1,2})(?::(?P<s>\d{1,2}))?(?:(?P<point>[.,:])(?P<f>\d{1,9}))?"
    r"|(?P<hms>\d{6})(?:[.,](?P<part>\d{1,9}))?"
)
_HALF_AND_ZONE = r"(?P<half>[AaPp])(?:\.?[Mm]\.?)?(?![A-Za-z]))?\s*(?P<zone>Z|[+-]\d\d:?\d\d|(?<=\d)[+-]\d\d|[A-Z]{3,4}"
_STAMP = re.compile(
    rf"(?:[A-Z][a-z]{{2,8}},? +)?(?:(?:{_DATE}):?)?(?:\s*T|\s*,|[_-])?\s*(?:(?:{_CLOCK})\s*(?:{_HALF_AND_ZONE})?)?"
)
_ISO_STAMP = re.compile(r"(?:1[7-9]|2[01])\d\d-\d\d-\d\d[T ]\d\d:\d\d:\d\d(?:\.\d+)?")
"""An ISO time in the years that 64 bits hold in nanoseconds."""
_MIDNIGHT_STEP_S = -DAY_S / 2
"""Step between times of day, s, below which midnight has passed."""

MIN_TIME_OF_DAY_S = 60
"""First time, s, below which times are elapsed times, not times of day."""

_NO_YEAR_MARK, _LEAP_YEAR = "..", "2000"
"""The separator in the parts of a date without a year, and the year in which its days are counted."""

_YEAR_DAYS = 365

Epoch: TypeAlias = Literal["start", "midnight", "1970"]
_DateParts: TypeAlias = tuple[str, str, str, str]


@dataclass(frozen=True)
class Times:
    """Times of samples.

    Attributes
    ----------
    seconds
        (N,) seconds after `start_s`, NaN where missing.
    start_s, epoch
        Time of the first sample, s, and its zero, as those of :class:`~stereolag.io.clocks.Recording`.
    rounding
        Step to which the times are rounded, s.
    """

    seconds: Vector
    start_s: float
    epoch: Epoch
    rounding: float


def rounding_step(times: Vector) -> float:
    """Return the power of ten to which times are rounded, at least 1e-9."""
    sample = times[:: max(1, times.size // 1000)] - times[0]
    finest = 2 * float(np.spacing(np.abs(times[[0, -1]]).max()))
    for digits in range(MAX_DECIMALS):
        scaled = sample * 10.0**digits
        if (np.abs(scaled - np.round(scaled)) <= 1e-6 + finest * 10.0**digits).all():
            return max(finest, 10.0**-digits)
    return 10.0**-MAX_DECIMALS


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
    """Return the times in texts, each a date, a time of day, or both; NaN for texts without a time that exists.

    If all are like 10.15.00 and are not successive dates, they are times of day.

    Where day and month could be exchanged, the order that makes the dates span the shortest time is taken; if the dates
    remain ambiguous, the times count from midnight. Times of day continue after midnight. Of two numbers, the first is
    minutes if it is above 23 or the second has a fraction, otherwise hours.
    """
    if all(map(_ISO_STAMP.fullmatch, texts)):
        with suppress(ValueError):
            moments = np.array(texts, dtype="datetime64[ns]")  # ten times as fast as the rest
            first = moments[0].astype("datetime64[D]")
            seconds = (moments - first).astype(np.int64) * 1e-9
            return _times_from_seconds(seconds, int(first.astype(np.int64)) * DAY_S, "1970", rounding_step(seconds))
    stamps = [_STAMP.fullmatch(text) for text in texts]
    clocks = [stamp for stamp in stamps if stamp and (stamp["h"] or stamp["hms"])]
    by_minutes = all(clock["h"] and not clock["s"] for clock in clocks) and any(
        clock["f"] or int(clock["h"]) > 23 for clock in clocks
    )
    milliseconds = len({len(clock["f"]) for clock in clocks if clock["point"] == ":"}) > 1
    dates = [_date_parts(stamp) if stamp else None for stamp in stamps]
    days, is_unambiguous = _days_of_dates(set(filter(None, dates)), any(clock["half"] for clock in clocks))
    are_dotted = not clocks and all(parts[1] == "." and len(parts[3]) < 4 for parts in dates if parts)
    steps = np.abs(np.diff([days[parts] for parts in dates if parts])) if days else np.empty(0)
    are_years = bool(steps.size) and np.median(steps) >= _YEAR_DAYS and steps.max() > _YEAR_DAYS + 1
    if are_dotted and any(dates) and (not days or are_years):  # 10.15.00
        return read_stamps([text.replace(".", ":") for text in texts])
    if any(dates) and not days:
        return Times(np.full(len(texts), np.nan), 0.0, "start", 1.0)
    first_day = min(days.values(), default=0)
    seconds = np.full(len(texts), np.nan)
    for row, (stamp, parts) in enumerate(zip(stamps, dates, strict=True)):
        if stamp is not None and (stamp["h"] or stamp["hms"] or not clocks) and (parts or not days):
            seconds[row] = _time_of_day(stamp, by_minutes=by_minutes, milliseconds=milliseconds) + (
                (days[parts] - first_day) * DAY_S if parts else 0
            )
    decimals = max((len(clock["f"] or clock["part"] or "") for clock in clocks), default=0)
    rounding = 10.0**-decimals if any(clock["s"] or clock["hms"] or by_minutes for clock in clocks) else 60.0
    if days:
        return _times_from_seconds(
            seconds,
            first_day * DAY_S if is_unambiguous else 0,
            "1970" if is_unambiguous else "midnight",
            rounding if clocks else DAY_S,
        )
    valid = ~np.isnan(seconds)
    seconds[valid] += DAY_S * np.cumsum(np.diff(seconds[valid], prepend=seconds[valid][:1]) < _MIDNIGHT_STEP_S)
    first_s = seconds[valid][:1]
    is_elapsed = by_minutes or not first_s.size or first_s[0] < MIN_TIME_OF_DAY_S or first_s[0] >= DAY_S
    return _times_from_seconds(seconds, 0, "start" if is_elapsed else "midnight", rounding)


def _times_from_seconds(seconds: Vector, day_s: int, epoch: Epoch, rounding: float) -> Times:
    first = float(seconds[~np.isnan(seconds)][0]) if not np.isnan(seconds).all() else 0.0
    return Times(seconds - first, day_s + first, epoch, rounding)


def _date_parts(stamp: re.Match[str]) -> _DateParts | None:
    """Return the three parts of a date and the separator between them, None if there is no date."""
    if stamp["packed"]:
        return stamp["packed"][:4], "-", stamp["packed"][4:6], stamp["packed"][6:]
    if stamp["month"]:
        return stamp["day"], "-", stamp["month"], stamp["year"]
    if stamp["dd"]:
        return stamp["dd"], _NO_YEAR_MARK, stamp["mm"], _LEAP_YEAR
    return (stamp["first"], stamp["mark"], stamp["second"], stamp["third"]) if stamp["first"] else None


def _days_of_dates(dates: set[_DateParts], has_am_pm: bool) -> tuple[dict[_DateParts, int], bool]:
    """Return the day of each date, from 1970, and whether it is unambiguous; {} if no order makes all of them exist."""
    orders = {}
    for order in ("dmy", "mdy", "ymd"):
        with suppress(ValueError):
            orders[order] = {parts: _day_number(parts, order) for parts in dates}
    if not dates or not orders:
        return {}, True
    spans = {order: max(days.values()) - min(days.values()) for order, days in orders.items()}
    likely = [order for order, span in spans.items() if span == min(spans.values())]
    european = any("." in parts for parts in dates)
    chosen = "mdy" if has_am_pm and not european and "mdy" in likely else likely[0]
    is_unambiguous = european or has_am_pm or all(orders[chosen] == orders[order] for order in likely)
    return orders[chosen], is_unambiguous and not any(_NO_YEAR_MARK in parts for parts in dates)


def _day_number(parts: _DateParts, order: str) -> int:
    """Return the day of a date, from 1970, in the given order unless its parts show another; ValueError if none."""
    first, mark, second, third = parts
    if mark == _NO_YEAR_MARK:
        order = "dmy"
    if second.isalpha():
        month = second.lower()
        second, order = str(_MONTHS.get(month[:4], _MONTHS.get(month[:3], 0))), "dmy"
    if len(first) > 2:
        order = "ymd"
    elif len(third) > 2 and order == "ymd":
        raise ValueError("the year comes last")
    numbers = dict(zip(order, map(int, (first, second, third)), strict=True))
    year = numbers["y"] + (0 if numbers["y"] >= 100 else 1900 if numbers["y"] >= 70 else 2000)
    return date(year, numbers["m"], numbers["d"]).toordinal() - _EPOCH_DAY


def _time_of_day(stamp: re.Match[str], *, by_minutes: bool, milliseconds: bool) -> float:
    """Return the time of day of a stamp, s, in UTC if it gives a zone."""
    if stamp["hms"]:
        hours, minutes, seconds, fraction = stamp["hms"][:2], stamp["hms"][2:4], stamp["hms"][4:], stamp["part"]
    else:
        hours, minutes, seconds, fraction = stamp["h"] or "0", stamp["m"] or "0", stamp["s"] or "0", stamp["f"]
    if by_minutes:
        hours, minutes, seconds = "0", hours, minutes
    hour = int(hours)
    if stamp["half"]:
        hour = hour % 12 + (12 if stamp["half"] in "pP" else 0)
    total = hour * 3600 + int(minutes) * 60 + float(seconds)
    if fraction:
        total += int(fraction) / (1000 if milliseconds else 10 ** len(fraction))
    zone = stamp["zone"]
    total -= _ZONE_HOURS.get(zone, 0) * 3600
    if zone and zone[0] in "+-":
        total -= int(zone[0] + "1") * (int(zone[1:3]) * 3600 + int(zone[3:].lstrip(":") or 0) * 60)
    return total
