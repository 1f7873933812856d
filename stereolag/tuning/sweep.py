"""A pair at every combination of two settings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from stereolag.arrays import FloatMap
from stereolag.estimates import Estimate
from stereolag.progress import Progress, silent
from stereolag.settings import changed, setting
from stereolag.stereo.matcher import StereoMatcher
from stereolag.tuning.objective import TuningPair

Cell = tuple[StereoMatcher, float, FloatMap]


@dataclass(frozen=True, eq=False)
class Sweep:
    """A grid of settings (Fig. 3.3 of the report).

    Attributes
    ----------
    rows, cols
        (name, values) of the two parameters.
    objectives
        (n_rows, n_cols) float, higher is better; NaN where the settings do not fit together or do not fit the images.
    maps
        The disparity maps, row by row, in px of full size; None where there is none.
    matchers
        The settings of each cell; None where there is no map.
    """

    rows: tuple[str, tuple[Any, ...]]
    cols: tuple[str, tuple[Any, ...]]
    objectives: npt.NDArray[np.float64]
    maps: tuple[tuple[FloatMap | None, ...], ...]
    matchers: tuple[tuple[StereoMatcher | None, ...], ...]

    @property
    def best(self) -> tuple[int, int] | None:
        """Return (row, col) of the best cell; None where no cell could be computed."""
        if np.isnan(self.objectives).all():
            return None
        row, col = divmod(int(np.nanargmax(self.objectives)), self.objectives.shape[1])
        return row, col


def sweep(
    matcher: StereoMatcher,
    pair: TuningPair,
    *,
    rows: tuple[str, Sequence[Any]],
    cols: tuple[str, Sequence[Any]],
    progress: Progress | None = None,
) -> Sweep:
    """Compute a pair at every combination of two parameters.

    Parameters
    ----------
    matcher
        Gives all other settings.
    pair
        The pair.
    rows, cols
        (name, values), named as in :func:`stereolag.settings.changed`.
    progress
        Called with the fraction done after every cell.

    Raises
    ------
    ValueError
        A parameter that does not exist, one and the same twice, or no values.
    """
    if rows[0] == cols[0]:
        raise ValueError(f"both parameters are {rows[0]!r}; choose two different ones.")
    for name, values in (rows, cols):
        setting(matcher, name)
        if not values:
            raise ValueError(f"no values to try for {name!r}; give at least one.")
    report = progress or silent
    cells: list[list[Cell | None]] = []
    for row_value in rows[1]:
        cells.append([])
        for col_value in cols[1]:
            cells[-1].append(_cell(matcher, {rows[0]: row_value, cols[0]: col_value}, pair))
            report(sum(map(len, cells)) / (len(rows[1]) * len(cols[1])))
    return Sweep(
        rows=(rows[0], tuple(rows[1])),
        cols=(cols[0], tuple(cols[1])),
        objectives=np.array([[np.nan if cell is None else cell[1] for cell in line] for line in cells]),
        maps=tuple(tuple(None if cell is None else cell[2] for cell in line) for line in cells),
        matchers=tuple(tuple(None if cell is None else cell[0] for cell in line) for line in cells),
    )


def estimate_sweep(
    matcher: StereoMatcher, pair: TuningPair, *, rows: tuple[str, Sequence[Any]], cols: tuple[str, Sequence[Any]]
) -> Estimate:
    """Return what :func:`sweep` will take: its largest cell, and the maps of all.

    A cell that alone needs more than one job may take is a hole in the grid.
    """
    cells = []
    for row_value in rows[1]:
        for col_value in cols[1]:
            try:
                cells.append(pair.estimate(changed(matcher, {rows[0]: row_value, cols[0]: col_value})))
            except ValueError:  # a hole
                continue
    maps = len(cells) * pair.left.shape[0] * pair.left.shape[1] * np.dtype(np.float32).itemsize
    return Estimate(maps + max((cell.memory for cell in cells), default=0), sum(cell.seconds for cell in cells))


def _cell(matcher: StereoMatcher, changes: dict[str, Any], pair: TuningPair) -> Cell | None:
    """Return the settings of a cell, their objective and their map.

    None is a hole in the grid, not an end of it: a window larger than its search area, or than the image.
    """
    try:
        settings = changed(matcher, changes)
        return (settings, *pair.objective(settings))
    except ValueError:
        return None
