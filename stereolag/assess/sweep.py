"""The numeric settings of a method, the values worth trying, and sweeps over all combinations of two."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
import numpy.typing as npt

from stereolag.assess.judging import Criterion, Judgement, TuningPair, criterion_of, widest_range
from stereolag.core.arrays import FloatMap
from stereolag.core.jobs import Estimate, Progress, part, silent
from stereolag.core.settings import Bounds, Number, Settings, changed, setting
from stereolag.stereo.matcher import StereoMatcher

HALF_OCTAVE = math.sqrt(2)
OUTWARDS = [sign * number for number in range(1, 13) for sign in (1, -1)]
ENOUGH_TO_TELL = 3
WHOLE_RANGE_UP_TO = 1.0
"""Parameters with an allowed range up to this wide are tried over all of it, the others around their current value."""


@dataclass(frozen=True)
class Parameter:
    """A number among the settings of a method.

    Attributes
    ----------
    name
        Dotted for nested settings: "search.vertical".
    title
        Its label on the page.
    value
        Its current value.
    bounds
        Its allowed range.
    """

    name: str
    title: str
    value: Number
    bounds: Bounds

    def values(self, count: int) -> tuple[Number, ...]:
        """Return at most `count` allowed values worth trying, ascending, including the current one.

        Sizes are tried in half octaves around their value, fractions over their whole range, and numbers that are zero
        or may be negative in doubling steps away from their value.
        """
        low, high, step = self.bounds.low, self.bounds.high, self.bounds.step
        if low is not None and high is not None and high - low <= WHOLE_RANGE_UP_TO:
            wanted = [low + (high - low) * number / (count - 1) for number in range(count)]
        elif self.value > 0 and (low is None or low >= 0):
            wanted = [self.value * HALF_OCTAVE**number for number in OUTWARDS]
        else:
            wanted = [self.value + step * math.copysign(2 ** (abs(number) - 1), number) for number in OUTWARDS]
        found: list[Number] = [self.value]
        for one in wanted:
            allowed = self._nearest(one)
            if allowed is not None and allowed not in found and len(found) < count:
                found.append(allowed)
        return tuple(sorted(found))

    def _nearest(self, wanted: float) -> Number | None:
        """Return the number nearest to `wanted` that is whole steps from the value; None beyond the bounds."""
        low, high, step = self.bounds.low, self.bounds.high, self.bounds.step
        nearest = self.value + step * round((wanted - self.value) / step)
        if (low is not None and nearest < low) or (high is not None and nearest > high):
            return None
        return round(nearest, 9)


def parameters(matcher: StereoMatcher) -> dict[str, Parameter]:
    """Return the numeric settings of a matcher that have an effect, by name, in order of declaration."""
    return {parameter.name: parameter for parameter in _within(matcher, "") if _free(matcher, parameter)}


def _free(matcher: StereoMatcher, parameter: Parameter) -> bool:
    """Return whether the other settings allow a parameter any value but its current one."""
    for value in parameter.values(ENOUGH_TO_TELL):
        try:
            if changed(matcher, {parameter.name: value}) != matcher:
                return True
        except ValueError:
            continue
    return False


def _within(settings: Settings, path: str) -> Iterator[Parameter]:
    for name, field in type(settings).model_fields.items():
        value = getattr(settings, name)
        if type(settings).obstacle(name, settings) is not None:
            continue
        if isinstance(value, Settings):
            yield from _within(value, f"{path}{name}.")
        elif isinstance(value, int | float) and not isinstance(value, bool):
            yield Parameter(f"{path}{name}", field.title or name, value, Bounds.of(field))


Axis = tuple[str, Sequence[Any]]
"""The name of a parameter and its values."""

Cell = tuple[StereoMatcher, float, FloatMap]


@dataclass(frozen=True, eq=False)
class Sweep:
    """A grid of settings (Fig. 3.3 of the report).

    Attributes
    ----------
    rows, cols
        (name, values) of the two parameters.
    bad
        (n_rows, n_cols) mean bad-2 over the pairs, %, lower is better; NaN without a map or a reference to judge it.
    criterion
        Whether `bad` is true or estimated bad-2.
    maps
        The disparity maps of the first pair, row by row, px; None if the settings are incompatible, do not fit the
        images, or were not tried.
    matchers
        The settings of each cell; None without a map.
    finished
        Whether all combinations were tried, and the sweep was not cancelled.
    """

    rows: tuple[str, tuple[Any, ...]]
    cols: tuple[str, tuple[Any, ...]]
    bad: npt.NDArray[np.float64]
    criterion: Criterion
    maps: tuple[tuple[FloatMap | None, ...], ...]
    matchers: tuple[tuple[StereoMatcher | None, ...], ...]
    finished: bool

    @property
    def best(self) -> tuple[int, int] | None:
        """Return the (row, col) of the best cell; None if none could be judged."""
        if np.isnan(self.bad).all():
            return None
        row, col = divmod(int(np.nanargmin(self.bad)), self.bad.shape[1])
        return row, col


def sweep(
    matcher: StereoMatcher,
    pairs: Sequence[TuningPair],
    *,
    rows: Axis,
    cols: Axis,
    progress: Progress | None = None,
    cancelled: Callable[[], bool] = lambda: False,
) -> Sweep:
    """Match one or more pairs at every combination of two parameters.

    Parameters
    ----------
    matcher
        Provides all other settings.
    pairs
        At least one; they are judged together, without those that cannot judge. If a parameter affects the search
        range, a reference measured in place of ground truth must cover the widest range of the sweep
        (:func:`range_of_sweep`).
    rows, cols
        (name, values), named as in :func:`stereolag.core.settings.changed`.
    progress
        Called with the fraction done.
    cancelled
        Called before every cell; True ends the sweep with the cells so far.

    Raises
    ------
    ValueError
        If there are no pairs, a parameter does not exist or is given twice, or it has no values.
    """
    if not pairs:
        raise ValueError("pairs is empty; give at least one.")
    if rows[0] == cols[0]:
        raise ValueError(f"both parameters are {rows[0]!r}; choose two different ones.")
    for name, values in (rows, cols):
        setting(matcher, name)
        if not values:
            raise ValueError(f"no values to try for {name!r}; give at least one.")
    report = progress or silent
    tried = _combinations(rows, cols)
    cells: list[Cell | None] = []
    for number, changes in enumerate(tried):
        if cancelled():
            break
        cells.append(_cell(matcher, changes, pairs, part(report, number, len(tried))))
    finished = len(cells) == len(tried)
    cells += [None] * (len(tried) - len(cells))
    report(1.0)
    grid = [cells[start : start + len(cols[1])] for start in range(0, len(cells), len(cols[1]))]
    return Sweep(
        rows=(rows[0], tuple(rows[1])),
        cols=(cols[0], tuple(cols[1])),
        bad=np.array([[np.nan if cell is None else cell[1] for cell in line] for line in grid]),
        criterion=criterion_of(pairs),
        maps=tuple(tuple(None if cell is None else cell[2] for cell in line) for line in grid),
        matchers=tuple(tuple(None if cell is None else cell[0] for cell in line) for line in grid),
        finished=finished,
    )


def range_of_sweep(matcher: StereoMatcher, *, rows: Axis, cols: Axis) -> tuple[int, int] | None:
    """Return the range that covers those of all combinations, (first disparity, number), px."""
    return widest_range(_fitting(matcher, rows, cols))


def estimate_sweep(matcher: StereoMatcher, pairs: Sequence[TuningPair], *, rows: Axis, cols: Axis) -> Estimate:
    """Return the memory and time of :func:`sweep`; memory is its largest cell plus the maps that it keeps.

    A cell that alone needs more memory than one job may take becomes a hole in the grid.
    """
    cells = [[pair.estimate(settings) for pair in pairs] for settings in _fitting(matcher, rows, cols)]
    maps = len(cells) * pairs[0].reference.size * np.dtype(np.float32).itemsize
    every = [one for cell in cells for one in cell]
    return Estimate(maps + max((one.memory for one in every), default=0), sum(one.seconds for one in every))


def _combinations(rows: Axis, cols: Axis) -> list[dict[str, Any]]:
    return [{rows[0]: row, cols[0]: col} for row in rows[1] for col in cols[1]]


def _fitting(matcher: StereoMatcher, rows: Axis, cols: Axis) -> Iterator[StereoMatcher]:
    """Yield the settings of all compatible combinations."""
    for changes in _combinations(rows, cols):
        with suppress(ValueError):
            yield changed(matcher, changes)


def _cell(
    matcher: StereoMatcher, changes: dict[str, Any], pairs: Sequence[TuningPair], progress: Progress
) -> Cell | None:
    """Return the settings of a cell, their mean bad-2 and the first pair's map.

    None leaves a hole in the grid, for example for a window larger than its search area or than the image.
    """
    try:
        settings = changed(matcher, changes)
        maps = (pair.map_of(settings, progress=part(progress, number, len(pairs))) for number, pair in enumerate(pairs))
        first = next(maps)
        bad = [
            Judgement.of(disparity, pair.reference).bad
            for disparity, pair in zip(chain([first], maps), pairs, strict=True)
        ]
    except ValueError:
        return None
    judged = [one for one in bad if not math.isnan(one)]
    return settings, sum(judged) / len(judged) if judged else math.nan, first
