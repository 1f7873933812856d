"""Sweep of a pair over every combination of two settings."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
import numpy.typing as npt

from stereolag.assess.tuning.judgement import Judgement
from stereolag.assess.tuning.objective import Criterion, TuningPair, criterion_of, widest_range
from stereolag.core.arrays import FloatMap
from stereolag.core.estimates import Estimate
from stereolag.core.progress import Progress, part, silent
from stereolag.core.settings import changed, setting
from stereolag.stereo.matcher import StereoMatcher

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
