"""Pictures of two cameras that belong together: by their names, by the numbers or times in them, or by their order."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import PurePath

import numpy as np

from stereolag.core.arrays import Indices, Vector
from stereolag.io.videos import DEFAULT_RATE_HZ, MAX_RATE_HZ, MIN_RATE_HZ, usual_interval

SAME_RATE = 0.01
"""Relative difference up to which the frame rates of two videos with as many frames are taken for one."""

UNIX_TIME = re.compile(r"(?<!\d)(1\d{9})\.?(\d*)(?!\d)")
"""A time since 1970 in seconds, of the years 2001 to 2033, and its fraction, with a point or as further digits."""


def partners_by_name(names: Sequence[str], others: Sequence[str], what: str) -> list[str | None]:
    """Return the partner of each file among those of another camera, or of another kind.

    Partners have the same stem, or numbers less than half a frame apart: frame numbers, or times. If neither holds for
    half of the files, they have the same position in both lists.

    Parameters
    ----------
    names, others
        Paths in natural order.
    what
        The kind of the others, for the error.

    Raises
    ------
    ValueError
        If nothing in the names agrees, and there are not as many of each.
    """
    by_stem = {PurePath(other).stem: other for other in others}
    same = [by_stem.get(PurePath(name).stem) for name in names]
    for found in (same, _partners_by_number(names, others)):
        if 2 * sum(one is not None for one in found) >= min(len(names), len(others)):
            return found
    if any(same):
        return same
    if len(names) != len(others):
        raise ValueError(
            f"There are {len(names):,} left pictures and {len(others):,} {what}, with other names; either their names "
            "or their number must match."
        )
    return list(others)


def _partners_by_number(names: Sequence[str], others: Sequence[str]) -> list[str | None]:
    numbers = [_numbers_in(each) for each in (names, others)]
    if not all(numbers):
        return []
    first = min(numbers[0][0], numbers[1][0])  # nanoseconds since 1970 exceed the precision of a float
    times, times_of_others = (np.array([number - first for number in each], float) for each in numbers)
    return [None if other is None else others[other] for other in partners_in_time(times, times_of_others)]


def _numbers_in(names: Sequence[str]) -> list[int]:
    """Return the numbers by which names differ, in ascending order; empty if there are none.

    Several in one name, such as seconds and their fraction, are joined if all but the first have fixed widths.
    """
    digits = [re.findall(r"\d+", PurePath(name).stem) for name in names]
    if len({*map(len, digits)}) != 1:
        return []
    varying = [column for column in zip(*digits, strict=True) if len({*column}) > 1 or len(names) == 1]
    if any(len({*map(len, column)}) > 1 for column in varying[1:]):
        return []
    numbers = [int("".join(parts)) for parts in zip(*varying, strict=True)]
    return numbers if all(one < other for one, other in pairwise(numbers)) else []


def clock_in_names(names: Sequence[str]) -> tuple[float, Vector | None]:
    """Return the frame rate of pictures named by Unix times, Hz, and their times after the first in its intervals.

    Of other pictures, the default rate and None.
    """
    found = [UNIX_TIME.search(PurePath(name).stem) for name in names]
    times = np.array([float(f"{time[1]}.{time[2]}") for time in found if time is not None])
    interval = float(np.median(np.diff(times))) if len(times) == len(names) > 1 else 0.0
    if not MIN_RATE_HZ <= 1 / max(interval, 1e-9) <= MAX_RATE_HZ:
        return DEFAULT_RATE_HZ, None
    return 1 / interval, (times - times[0]) / interval


def partners_in_time(times: Vector, others: Vector) -> list[int | None]:
    """Return for each time the index of the other that belongs to it.

    That is the nearest one, if no other time is nearer to it, and it is less than half the smaller of the two median
    intervals away; None if there is none. Times ascend.
    """
    interval = min((float(np.median(np.diff(one))) for one in (times, others) if len(one) > 1), default=0.0)
    found, back = _nearest(times, others), _nearest(others, times)
    apart = np.abs(others[found] - times)
    belongs = (back[found] == np.arange(len(times))) & ((apart < interval / 2) | (apart == 0))
    return [int(other) if belongs[number] else None for number, other in enumerate(found)]


def _nearest(times: Vector, others: Vector) -> Indices:
    """Return for each time the index of the nearest other."""
    after = np.searchsorted(others, times).clip(0, len(others) - 1)
    before = (after - 1).clip(0)
    return np.where(times - others[before] <= others[after] - times, before, after)


def partners_of_frames(times_s: Vector, others_s: Vector) -> list[tuple[int | None, int | None]]:
    """Return the numbers of the frames of two videos that belong together, an entry for each frame of the slower one.

    Files of cameras with a shared trigger may state slightly different rates: of as many frames, from the same time on
    and at rates that differ by less than 1 %, the times are divided by the usual intervals. Entries begin with the
    later video, and end with the one that ends first.
    """
    left, right = (usual_interval(times) or 1.0 for times in (times_s, others_s))
    if same_rate(left, right) and len(times_s) == len(others_s) and times_s[0] == others_s[0]:
        times_s, others_s = times_s / left, others_s / right
    if right > left and not same_rate(left, right):
        return [(other, number) for number, other in _while_both_run(partners_in_time(others_s, times_s))]
    return [*_while_both_run(partners_in_time(times_s, others_s))]


def same_rate(one: float, other: float) -> bool:
    """Return whether two frame rates, or two intervals, are taken for one."""
    return abs(one - other) <= SAME_RATE * max(one, other)


def _while_both_run(partners: Sequence[int | None]) -> list[tuple[int, int | None]]:
    known = [number for number, other in enumerate(partners) if other is not None] or [0, -1]
    return [*enumerate(partners)][known[0] : known[-1] + 1]
