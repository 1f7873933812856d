"""The figures of a sequence: those of one frame, and the table with one row for each frame and method."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from stereolag.geometry.calibration import Calibration
from stereolag.geometry.scene import ground_of
from stereolag.sequences.sources import Truth
from stereolag.stereo.evaluation import evaluate
from stereolag.stereo.matcher import DisparityMap

LEAST_SHARE = 0.001
"""Least share of the pixels: anything smaller is more likely a mismatch than an obstacle."""

LOWEST, HIGHEST = 0.2, 2.0
"""Range of heights above the ground of an obstacle, in camera heights: excludes kerbs and bridges."""


def nearest_obstacle(disparity: npt.ArrayLike) -> float:
    """Return the disparity of the nearest obstacle, px: robustly, the one that a thousandth of the pixels reach.

    Parameters
    ----------
    disparity
        (H, W) px; NaN = none.

    Returns
    -------
    disparity
        px; NaN if there is none. If a ground is seen, its pixels and anything overhanging the road do not count: the
        height of a point above the ground, as a share of the camera's, is ``1 - d_ground / d``.

    Raises
    ------
    ValueError
        If the array is not (H, W).
    """
    values = np.asarray(disparity, dtype=np.float32)
    if values.ndim != 2 or values.size == 0:
        raise ValueError(f"disparity has shape {values.shape}; allowed is (rows, cols) with at least one pixel.")
    known = np.isfinite(values) & (values > 0)
    ground = ground_of(values)
    if ground is not None:
        below = np.float32(ground.slope) * (np.arange(len(values), dtype=np.float32) - np.float32(ground.horizon))
        with np.errstate(invalid="ignore"):
            known &= (values * np.float32(1 - LOWEST) > below[:, None]) & (
                values * np.float32(1 - HIGHEST) < below[:, None]
            )
    obstacles = values[known]
    rank = max(1, round(LEAST_SHARE * values.size))
    if obstacles.size < rank:
        return math.nan
    return float(np.partition(obstacles, obstacles.size - rank)[obstacles.size - rank])


BAD_PX = 2.0

MOTION = "motion"
"""Entry of the method column in rows of motion figures."""


class FrameFigures(NamedTuple):
    """The figures of a :class:`FrameRecord` that follow from one frame alone; NaN = unknown."""

    coverage: float = math.nan
    milliseconds: float = math.nan
    nearest_px: float = math.nan
    nearest_m: float = math.nan
    bad_2_percent: float = math.nan
    epe_px: float = math.nan


@dataclass(frozen=True, slots=True)
class FrameRecord:
    """The figures of one frame by one method; NaN = unknown.

    Attributes
    ----------
    number, name
        The number and name of the frame.
    time_s
        Its time in the sequence, s.
    method
        The name of the matcher.
    coverage
        Share of the pixels that have a disparity, 0..1.
    milliseconds
        Time for the matching alone, while other frames were matched in parallel.
    nearest_px, nearest_m
        Disparity and depth of the nearest obstacle; metres need a calibration.
    bad_2_percent, epe_px
        Percentage of pixels off by more than 2 px or missing, and the mean error of pixels with a disparity.
    own_speed_kmh
        Speed of the camera since the previous frame; only in rows of motion, whose coverage is that of the flow.
    moving
        Things that move against the world, nearest first: distance, and speed if known well enough.
    flicker_px
        Mean change of the disparity since the previous frame, where the picture did not change.
    problem
        Why there is no map; "" if there is one.
    """

    number: int
    name: str
    time_s: float
    method: str
    coverage: float = math.nan
    milliseconds: float = math.nan
    nearest_px: float = math.nan
    nearest_m: float = math.nan
    bad_2_percent: float = math.nan
    epe_px: float = math.nan
    own_speed_kmh: float = math.nan
    moving: str = ""
    flicker_px: float = math.nan
    problem: str = ""


COLUMNS = tuple(field.name for field in fields(FrameRecord))
_WHOLE, _TEXTS = {"number"}, {"name", "method", "moving", "problem"}


def figures_of(result: DisparityMap, truth: Truth | None, calibration: Calibration | None) -> FrameFigures:
    """Return the figures that follow from one frame alone.

    A ground truth of another size than the map is ignored: `bad_2_percent` and `epe_px` stay NaN.
    """
    # Filled-in disparities are no evidence: a filled gap beside a pole is no obstacle.
    nearest = nearest_obstacle(np.where(result.filled, np.float32(np.nan), result.disparity))
    figures = FrameFigures(
        coverage=result.coverage,
        milliseconds=result.elapsed_s * 1e3,
        nearest_px=nearest,
        nearest_m=math.nan if calibration is None else float(calibration.depth(nearest)),
    )
    if truth is None or truth.shape != result.disparity.shape:
        return figures
    found = evaluate(result.disparity, truth, thresholds=(BAD_PX,))
    return figures._replace(bad_2_percent=found.bad[BAD_PX], epe_px=found.epe)


def damaged_records(number: int, name: str, time_s: float, methods: Sequence[str], problem: str) -> list[FrameRecord]:
    """Return the rows of the table for a frame without maps."""
    return [FrameRecord(number, name, time_s, method, problem=problem) for method in methods]


def header() -> str:
    """Return the header line of the table, with its newline."""
    return _line(COLUMNS)


def lines(records: Iterable[FrameRecord]) -> str:
    """Return records as lines of the table; unknown figures are left empty."""
    return "".join(_line([_cell(value) for value in asdict(record).values()]) for record in records)


def read_records(path: Path) -> list[FrameRecord]:
    """Read a table back; a line cut short by an interruption, and everything after it, is skipped."""
    records: list[FrameRecord] = []
    text = path.read_text(encoding="utf-8")
    for row in csv.DictReader(io.StringIO(text[: text.rfind("\n") + 1])):
        if tuple(row) != COLUMNS or None in row.values():
            break
        try:
            records.append(FrameRecord(**{name: _value(name, cell) for name, cell in row.items()}))
        except ValueError:
            break
    return records


def _value(name: str, cell: str) -> Any:
    if name in _TEXTS:
        return cell
    return int(cell) if name in _WHOLE else float(cell or "nan")


def _cell(value: object) -> object:
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{value:.6g}"
    return value


def _line(cells: Sequence[object]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(cells)
    return text.getvalue()
