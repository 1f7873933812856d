"""One window of a map: its best match as the matcher finds it, and the curve fitted through the scores there."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import FloatMap
from stereolag.stereo.windows.matches import WindowQuery
from stereolag.stereo.windows.search import LagRange

Surface: TypeAlias = npt.NDArray[np.float64]
"""(n_dy, n_dx) scores; NaN = no candidate."""

Lag: TypeAlias = tuple[int, int]
"""(dy, dx), right minus left, px."""

SAME_TOP = 0.02
"""Twice the distance, px, up to which two maxima count as the same: the compiled fit approximates its logarithms."""


def window_start(at: int, end: int, size: int, step: int) -> int:
    """Return the start of the window whose cell contains the pixel; near the border, of the nearest whole window."""
    return int(np.clip((at - (size - step) // 2) // step, 0, (end - size) // step)) * step


def best_match(surface: Surface, query: WindowQuery) -> tuple[Lag | None, FloatMap]:
    """Return the lag of the highest score, the shortest if several are equal, and the scores around it."""
    lags, vertical = query.lags, int(query.lags.rows > 1)
    nothing = np.full((1 + 2 * vertical, 3), np.nan, np.float32)
    if np.isnan(surface).all():
        return None, nothing
    highest = float(np.nanmax(surface))
    dy, dx = lags.ranked()
    first = np.argmax(surface[dy - lags.dy_first, dx - lags.dx_first] >= highest)
    row, col = int(dy[first]) - lags.dy_first, int(dx[first]) - lags.dx_first
    framed = np.pad(surface, 1, mode="wrap") if query.circular else np.pad(surface, 1, constant_values=np.nan)
    around = framed[row + 1 - vertical : row + 2 + vertical, col : col + 3].astype(np.float32)
    return (int(dy[first]), int(dx[first])), around


def highest(surface: Surface, lags: LagRange) -> Lag | None:
    """Return the first lag with the highest score; None without a candidate."""
    if np.isnan(surface).all():
        return None
    row, col = divmod(int(np.nanargmax(surface)), surface.shape[1])
    return row + lags.dy_first, col + lags.dx_first


def score_at(surface: Surface, lags: LagRange, lag: Lag | None) -> float:
    """Return the score of a lag of the search; NaN if the lag is None."""
    return float("nan") if lag is None else float(surface[lag[0] - lags.dy_first, lag[1] - lags.dx_first])


def fitted_curve(around: FloatMap, offset: tuple[float, float], at: npt.NDArray[np.float64]) -> Surface:
    """Return the curve along dx through a sub-pixel peak: a Gaussian, or a parabola if a score is not positive.

    Parameters
    ----------
    around
        (3, 3) or (1, 3) scores around the peak; NaN = no candidate.
    offset
        (dy, dx) from the peak to the sub-pixel peak, px.
    at
        (n,) dx from the peak, px.

    Returns
    -------
    ndarray
        (n,) float64 scores; NaN if a neighbour along the row is missing.
    """
    scores = around.astype(np.float64)
    middle = scores[len(scores) // 2]
    if not np.isfinite(middle).all():
        return np.full(at.shape, np.nan)
    gaussian = bool((scores > 0).all())
    section = _section(np.log(scores) if gaussian else scores, offset)
    if section is None:
        gaussian = bool((middle > 0).all())
        section = _through_three(np.log(middle) if gaussian else middle)
    height, slope, bend = section
    curve = height + slope * at + bend * at**2
    return np.asarray(np.exp(curve) if gaussian else curve)


def _through_three(values: Surface) -> tuple[float, float, float]:
    """Return the constant, linear and quadratic coefficients of the parabola through the values at -1, 0 and 1."""
    low, top, high = values
    return top, (high - low) / 2, (low - 2 * top + high) / 2


def _section(values: Surface, offset: tuple[float, float]) -> tuple[float, float, float] | None:
    """Return the same coefficients along dx for the paraboloid fitted to (3, 3) values, at the dy of its maximum.

    None if its maximum differs from `offset`, which was then fitted to the row alone, or if there is only one row.
    """
    if len(values) == 1 or not np.isfinite(values).all():
        return None
    dy, dx = np.mgrid[-1:2, -1:2].reshape(2, -1).astype(np.float64)
    terms = np.column_stack([np.ones(9), dx, dx**2, dy, dy**2, dx * dy])
    height, slope, bend, slope_y, bend_y, twist = np.linalg.lstsq(terms, values.ravel(), rcond=None)[0]
    at = offset[0]
    section = height + slope_y * at + bend_y * at**2, slope + twist * at, bend
    return section if abs(section[1] + 2 * bend * offset[1]) < SAME_TOP * abs(bend) else None
