"""What is known of every frame: one line of a table for each frame and method."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from stereolag.geometry.calibration import Calibration
from stereolag.sequences.obstacles import nearest_obstacle
from stereolag.sequences.sources import Truth
from stereolag.stereo.evaluation import evaluate
from stereolag.stereo.matcher import DisparityMap

BAD_PX = 2.0

MOTION = "motion"
"""What stands in the column of the method in the lines that tell of motion."""


class FrameFigures(NamedTuple):
    """What a frame alone tells of the map of one method: those of a :class:`FrameRecord`; NaN = not known."""

    coverage: float = math.nan
    milliseconds: float = math.nan
    nearest_px: float = math.nan
    nearest_m: float = math.nan
    bad_2_percent: float = math.nan
    epe_px: float = math.nan


@dataclass(frozen=True, slots=True)
class FrameRecord:
    """The figures of one frame by one method; NaN = not known.

    Attributes
    ----------
    number, name
        Of the frame.
    time_s
        When it is shown, s.
    method
        The name of the matcher.
    coverage
        Share of the pixels that have a disparity, 0..1.
    milliseconds
        Of the matching alone, while other frames were being matched beside it.
    nearest_px, nearest_m
        Disparity and depth of the nearest obstacle; metres with a calibration.
    bad_2_percent, epe_px
        Pixels that are off by more than 2 px or missing, and the mean error of the others, against the truth.
    own_speed_kmh
        Of the camera since the frame before; in the lines of the motion alone, whose coverage is that of the flow.
    moving
        What moves against the world, nearest first: its distance, and its speed where that is known well enough.
    flicker_px
        Mean change of the disparity since the frame before, where the picture did not change.
    problem
        Why there is no map, "" where there is one.
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
    """Return the figures of one frame that it alone tells.

    A truth of another size than the map is not held against it: `bad_2_percent` and `epe_px` stay NaN.
    """
    # What was filled in says nothing of its own, and a filled gap beside a pole is no obstacle.
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
    """Return the lines of the table for a frame without maps."""
    return [FrameRecord(number, name, time_s, method, problem=problem) for method in methods]


def header() -> str:
    """Return the first line of the table, with its end."""
    return _line(COLUMNS)


def lines(records: Iterable[FrameRecord]) -> str:
    """Return records as lines of the table; a figure that is not known is left empty."""
    return "".join(_line([_cell(value) for value in asdict(record).values()]) for record in records)


def read_records(path: Path) -> list[FrameRecord]:
    """Read a table back; a line that an interruption cut short, and what is behind it, is left out."""
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
