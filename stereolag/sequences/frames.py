"""The work on one frame of a sequence, from files to maps and figures, and the places where these are stored."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import math
import os
import re
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, astuple, dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from stereolag.core.arrays import FloatMap
from stereolag.core.inputs import Image, as_grey
from stereolag.core.jobs import Progress
from stereolag.geometry.calibration import Calibration
from stereolag.geometry.scene import nearest_obstacle
from stereolag.io.disparities import DISPARITY_FORMATS, KITTI_SCALE, read_stored_disparity
from stereolag.io.results import csv_lines
from stereolag.io.settings import settings_document
from stereolag.io.sources import Source, write_file
from stereolag.sequences.motion import Steadiness, matched_turned, motion_since, steadied
from stereolag.sequences.sources import FrameReader, StereoSequence
from stereolag.stereo.evaluation import evaluate
from stereolag.stereo.matcher import DisparityMap, StereoMatcher
from stereolag.version import VERSION

PNG = ".png"

AnyMap = TypeVar("AnyMap", bound="DisparityMap | FrameMap")


class FrameTask(NamedTuple):
    """The work on one frame; it can be pickled, and is small if the frames are in files."""

    number: int
    reader: FrameReader
    matchers: Mapping[str, StereoMatcher]
    suffix: str = PNG
    calibration: Calibration | None = None
    in_colour: bool = True
    """Whether the left picture is returned unchanged; otherwise in grey."""
    steadiness: Steadiness | None = None
    """How maps are steadied by the previous frame; None: not at all."""
    with_truth: bool = False
    """Whether the true disparity is returned too."""
    turn: int = 0
    """Quarters by which the pictures are turned for the matching."""


@dataclass(frozen=True, eq=False)
class FrameMap:
    """The map of one method.

    Attributes
    ----------
    disparity
        (H, W) float32, px, NaN = none: bit for bit as read from `data`.
    data
        The bytes of its file.
    figures
        Those fields of a :class:`FrameRecord` that follow from this frame alone.
    """

    disparity: FloatMap
    data: bytes
    figures: Mapping[str, Any]

    def __reduce__(self) -> tuple[Any, ...]:
        # Only the file is sent between machines: it is a quarter of the map's size.
        return _from_file, (self.data, self.figures)


@dataclass(frozen=True, eq=False)
class MatchedFrame(Generic[AnyMap]):
    """One frame after matching, with its maps as matched or as stored in their files.

    Attributes
    ----------
    number
        The number of the frame.
    left
        The left picture; None for a damaged frame.
    maps
        {name of the method: its map}.
    problem
        Why there are no maps, in one sentence; otherwise "".
    truth
        The true disparity, px, if known; with files, also if requested.
    """

    number: int
    left: Image | None = None
    maps: Mapping[str, AnyMap] = field(default_factory=dict)
    problem: str = ""
    truth: FloatMap | None = None


def match_frame(task: FrameTask, progress: Progress | None = None) -> MatchedFrame[DisparityMap]:
    """Read and match one frame; a damaged or rejected frame is reported in the result, not raised.

    `progress` may raise to end the work early: its exception propagates, unless it is a ``ValueError`` or ``OSError``.
    """
    try:
        frame = task.reader()
        # Scores and vertical displacements are not needed here, and would be sent between machines.
        maps = {
            name: replace(matched_turned(matcher, frame, task.turn, progress), _score=None, _dy=None)
            for name, matcher in task.matchers.items()
        }
    except (ValueError, OSError) as error:
        return MatchedFrame(task.number, problem=_in_one_line(error))
    return MatchedFrame(task.number, frame.left, maps, truth=frame.truth)


def encoded_frame(
    task: FrameTask,
    matched: MatchedFrame[DisparityMap] | None = None,
    previous: MatchedFrame[DisparityMap] | None = None,
    *,
    progress: Progress | None = None,
) -> MatchedFrame[FrameMap]:
    """Match one frame, encode its maps and measure them.

    Parameters
    ----------
    task
        The work.
    matched
        The frame from :func:`match_frame`, if it has been matched already.
    previous
        The previous frame from :func:`match_frame`, by whose maps these are steadied.
    progress
        As for :func:`match_frame`.
    """
    matched = matched or match_frame(task, progress)
    if matched.left is None:
        return MatchedFrame(task.number, problem=matched.problem)
    try:
        maps = {
            name: FrameMap(
                as_stored(result.disparity, task.suffix),
                DISPARITY_FORMATS[task.suffix].write(result.disparity),
                figures_of(result, matched.truth, task.calibration),
            )
            for name, result in _steadied(task, matched, previous).items()
        }
    except ValueError as error:
        return MatchedFrame(task.number, problem=_in_one_line(error))
    return _as_requested(task, matched.left, maps, matched.truth)


def finished_frame(task: FrameTask, files: Mapping[str, Source]) -> MatchedFrame[FrameMap]:
    """Return a frame whose maps are read from their files, like :func:`encoded_frame`, but without figures."""
    try:
        frame = task.reader()
        maps = {name: FrameMap(read_back(file), b"", {}) for name, file in files.items()}
    except (ValueError, OSError) as error:
        return MatchedFrame(task.number, problem=_in_one_line(error))
    return _as_requested(task, frame.left, maps, frame.truth)


def _steadied(
    task: FrameTask, matched: MatchedFrame[DisparityMap], previous: MatchedFrame[DisparityMap] | None
) -> Mapping[str, DisparityMap]:
    """Return the maps steadied by the previous frame, if requested and possible, with the time for it added."""
    if task.steadiness is None or previous is None or previous.left is None or matched.left is None:
        return matched.maps
    start = time.perf_counter()
    motion = motion_since(previous.left, matched.left)
    if motion is None:
        return matched.maps
    motion_s = time.perf_counter() - start
    maps = {}
    for name, one in matched.maps.items():
        start = time.perf_counter()
        disparity = steadied(previous.maps[name], one, motion, task.steadiness)
        maps[name] = replace(one, disparity=disparity, elapsed_s=one.elapsed_s + motion_s + time.perf_counter() - start)
    return maps


def _as_requested(
    task: FrameTask, left: Image, maps: Mapping[str, FrameMap], truth: FloatMap | None
) -> MatchedFrame[FrameMap]:
    """Return a frame with its left picture in colour or grey, and its truth or not, as the task requests."""
    shown = left if task.in_colour else as_grey(left)
    return MatchedFrame(task.number, shown, maps, truth=truth if task.with_truth else None)


def as_stored(disparity: FloatMap, suffix: str) -> FloatMap:
    """Return a map rounded as in its file, so that frame-to-frame figures do not depend on whether it was read back."""
    if suffix != PNG:
        return disparity
    scaled = disparity * np.float32(KITTI_SCALE)
    np.rint(scaled, out=scaled)
    np.maximum(scaled, np.float32(1), out=scaled)  # NaN stays NaN
    scaled /= np.float32(KITTI_SCALE)
    return scaled


def read_back(file: Source) -> FloatMap:
    """Return the map in a file of a sequence, which, unlike a ground truth, may have no disparity at all."""
    found = read_stored_disparity(file)
    if not (np.isfinite(found.stored) & ~np.isin(found.stored, found.unknown)).any():
        return np.full(found.stored.shape, np.nan, np.float32)
    return found.divided(found.divisor or 1.0)


def _from_file(data: bytes, figures: Mapping[str, Any]) -> FrameMap:
    return FrameMap(read_back(data), data, figures)


def _in_one_line(error: Exception) -> str:
    """Return the message of an error in one line; of a file, its name without the path."""
    if isinstance(error, OSError) and error.strerror:
        return f"{Path(error.filename).name}: {error.strerror}." if error.filename else f"{error.strerror}."
    return " ".join(str(error).split())


BAD_PX = 2.0
"""Error from which a disparity counts as wrong, px."""

MOTION = "motion"
"""Entry of the method column in rows of motion figures."""


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
    coverage, filled
        Shares of the pixels whose disparity was measured, and filled in, 0..1.
    milliseconds
        Time for the matching alone, while other frames are matched in parallel.
    nearest_px, nearest_m
        Disparity and depth of the nearest obstacle; metres need a calibration.
    bad_2_percent, epe_px
        Percentage of pixels off by more than 2 px or missing, and the mean error of pixels with a disparity.
    own_speed_kmh, own_speed_error_kmh
        Speed of the camera since the previous frame, if accurate enough, and its standard error; only in rows of
        motion, whose coverage is that of the flow.
    moving
        Objects that move against the world, nearest first: distance, and speed if accurate enough.
    flicker_px
        Mean change of the disparity since the previous frame, where the picture did not change.
    problem
        Why there is no map; in rows of motion, the verdict on the two frames unless they are related, or why our own
        speed is not known; otherwise "".
    findings
        Codes of the problems that the input doctor finds with the sequence, the same in every row.
    """

    number: int
    name: str
    time_s: float
    method: str
    coverage: float = math.nan
    filled: float = math.nan
    milliseconds: float = math.nan
    nearest_px: float = math.nan
    nearest_m: float = math.nan
    bad_2_percent: float = math.nan
    epe_px: float = math.nan
    own_speed_kmh: float = math.nan
    own_speed_error_kmh: float = math.nan
    moving: str = ""
    flicker_px: float = math.nan
    problem: str = ""
    findings: str = ""


COLUMNS: Mapping[str, Callable[[str], Any]] = {
    one.name: {"int": int, "str": str}.get(str(one.type), lambda cell: float(cell or "nan"))
    for one in fields(FrameRecord)
}
"""{column of the table: function that reads its cells}."""


def figures_of(result: DisparityMap, truth: FloatMap | None, calibration: Calibration | None) -> dict[str, float]:
    """Return those fields of a :class:`FrameRecord` that follow from one frame alone.

    A ground truth of another size than the map is ignored: `bad_2_percent` and `epe_px` stay NaN.
    """
    # Filled-in disparities are not evidence: a filled gap beside a pole is not an obstacle.
    measured = result.measured
    nearest = nearest_obstacle(result.disparity, measured)
    figures = {
        "coverage": int(np.count_nonzero(measured)) / measured.size,
        "filled": float(np.count_nonzero(result.filled) / measured.size),
        "milliseconds": result.elapsed_s * 1e3,
        "nearest_px": nearest,
        "nearest_m": math.nan if calibration is None else float(calibration.depth(nearest)),
    }
    if truth is not None and truth.shape == result.disparity.shape:
        found = evaluate(result.disparity, truth, thresholds=(BAD_PX,))
        figures |= {"bad_2_percent": found.bad[BAD_PX], "epe_px": found.epe}
    return figures


def table_lines(records: Iterable[FrameRecord], *, header: bool = False) -> str:
    """Return records as lines of the table, with or without its header; unknown figures are left empty."""
    rows = (map(_cell, astuple(record)) for record in records)
    return csv_lines([COLUMNS, *rows] if header else rows)


def read_records(path: Path) -> list[FrameRecord]:
    """Read a table, up to a line cut short by an interruption."""
    records: list[FrameRecord] = []
    text = path.read_text(encoding="utf-8")
    for row in csv.DictReader(io.StringIO(text[: text.rfind("\n") + 1])):
        if list(row) != list(COLUMNS) or None in row.values():
            break
        try:
            records.append(FrameRecord(**{name: COLUMNS[name](cell) for name, cell in row.items()}))
        except ValueError:
            break
    return records


def _cell(value: object) -> object:
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{value:.6g}"
    return value


@dataclass(eq=False)
class SequenceTarget(ABC):
    """Destination of the frames, which arrive in order; it knows which are finished.

    Attributes
    ----------
    records
        {(frame number, method): figures}, in order of arrival; motion added later comes after all others.
    finished
        {number of a finished frame: the methods that have maps}.
    colours
        The disparities at the ends of the video's colour range, px; None until known.
    largest_motion
        Displacement at the rim of the colour wheel of the flow, px; None until known.
    """

    records: dict[tuple[int, str], FrameRecord] = field(default_factory=dict)
    finished: dict[int, tuple[str, ...]] = field(default_factory=dict)
    colours: tuple[float, float] | None = None
    largest_motion: float | None = None

    @abstractmethod
    def file(self, number: int, method: str) -> Source:
        """Return the file of a finished frame's map: its path or its bytes."""

    def set_colours(self, colours: tuple[float, float]) -> None:
        """Store the colour range."""
        self.colours = colours

    def write(self, frame: MatchedFrame[FrameMap], records: Iterable[FrameRecord]) -> None:
        """Store a frame and its figures, one record per method; a damaged frame has only records."""
        self.add(records)
        if not frame.problem:
            self.finished[frame.number] = tuple(frame.maps)

    def add(self, records: Iterable[FrameRecord]) -> None:
        """Store figures of a frame whose maps are stored, replacing those of the same method."""
        self.records |= {(one.number, one.method): one for one in records}

    def close(self) -> None:  # noqa: B027  # most targets have nothing to do
        """Finish; no more frames follow."""


@dataclass(eq=False)
class SequenceMemory(SequenceTarget):
    """Target that keeps everything in memory: nothing that a visitor uploads is written to disk.

    Attributes
    ----------
    maps
        {(frame number, method): bytes of the map}.
    """

    maps: dict[tuple[int, str], bytes] = field(default_factory=dict)

    def file(self, number: int, method: str) -> Source:
        """Return the bytes of a map."""
        return self.maps[number, method]

    def write(self, frame: MatchedFrame[FrameMap], records: Iterable[FrameRecord]) -> None:
        """Store a frame and its figures."""
        self.maps |= {(frame.number, method): one.data for method, one in frame.maps.items()}
        super().write(frame, records)


TABLE_NAME = "frames.csv"
"""File name of the table of figures."""

MANIFEST_NAME = "sequence.json"
"""File name of the record of the inputs."""

_FOLDER_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
_PNG_END = b"IEND\xaeB`\x82"


class SequenceFolder(SequenceTarget):
    """A folder with a map for every frame and method, ``METHOD/FRAME.png``, and a table of figures, ``frames.csv``.

    Parameters
    ----------
    path
        Created if missing.
    sequence, task
        The frames, and the work on each. They are recorded in ``sequence.json``; a folder begun with others is refused.
    again
        Whether to discard finished frames and their recorded inputs.

    Raises
    ------
    ValueError
        If the folder has frames from other inputs, a method's name is not valid for a folder, or a search range does
        not fit the files.
    OSError
        If the folder cannot be created or written.
    """

    def __init__(self, path: Path, sequence: StereoSequence, task: FrameTask, *, again: bool) -> None:
        _check(task.matchers, task.suffix)
        super().__init__()
        self._path, self._suffix = path, task.suffix
        self._names, self._methods = sequence.names, tuple(task.matchers)
        self._document = _document(sequence, task)
        self.colours = None if again else self._recorded_colours()
        for method in self._methods:
            (path / method).mkdir(parents=True, exist_ok=True)
        if not again and (path / TABLE_NAME).is_file():
            self.records = {
                (one.number, one.method): one for one in read_records(path / TABLE_NAME) if self._is_finished(one)
            }
        self.finished = {
            number: self._methods
            for number in range(len(sequence))
            if all((number, method) in self.records for method in self._methods)
        }
        self._write_manifest()
        self._rewrite_table()
        self._table = (path / TABLE_NAME).open("a", encoding="utf-8")

    def file(self, number: int, method: str) -> Path:
        """Return the path of a map."""
        return self._path / method / f"{self._names[number]}{self._suffix}"

    def set_colours(self, colours: tuple[float, float]) -> None:
        """Record the colour range, so that it is kept when the work is resumed."""
        super().set_colours(colours)
        self._write_manifest()

    def write(self, frame: MatchedFrame[FrameMap], records: Iterable[FrameRecord]) -> None:
        """Write the maps of a frame, each atomically, and then its rows of the table."""
        for method, one in frame.maps.items():
            write_file(self.file(frame.number, method), one.data, synced=False)
        super().write(frame, records)

    def add(self, records: Iterable[FrameRecord]) -> None:
        """Write figures to the table, replacing those of the same method."""
        records = [*records]
        self._table.write(table_lines(records))
        self._table.flush()
        super().add(records)

    def close(self) -> None:
        """Sort the table."""
        self._table.close()
        self._rewrite_table()

    def _is_finished(self, record: FrameRecord) -> bool:
        """Return whether a row of the table is valid and its map complete: a power failure may cut a file short."""
        if record.method not in self._methods or record.number >= len(self._names):
            return record.method == MOTION and record.number < len(self._names)
        if record.problem:
            return False
        try:
            with self.file(record.number, record.method).open("rb") as file:
                file.seek(-len(_PNG_END), os.SEEK_END)
                return self._suffix != PNG or file.read() == _PNG_END
        except OSError:  # missing, or shorter than that
            return False

    def _recorded_colours(self) -> tuple[float, float] | None:
        """Return the colour range recorded in the folder; refuse a folder begun with other inputs."""
        manifest = self._path / MANIFEST_NAME
        if not manifest.is_file():
            return None
        try:
            recorded = json.loads(manifest.read_text(encoding="utf-8"))
            differing = [
                name for name, value in self._document.items() if recorded["made_of"].get(name, value) != value
            ]
            colours = recorded["colours"]
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise ValueError(f"{manifest} is damaged; begin again, or choose another folder.") from error
        if differing:
            raise ValueError(
                f"{self._path} holds frames made with other {' and '.join(differing)}; continue with the same, "
                "begin again, or choose another folder."
            )
        return None if colours is None else (float(colours[0]), float(colours[1]))

    def _write_manifest(self) -> None:
        digest = hashlib.sha256(json.dumps(self._document, sort_keys=True).encode()).hexdigest()
        document = {"digest": digest, "made_of": self._document, "colours": self.colours}
        write_file(self._path / MANIFEST_NAME, (json.dumps(document, indent=2) + "\n").encode())

    def _rewrite_table(self) -> None:
        """Write the table anew, sorted by frames and then by methods, motion last."""
        order = {method: place for place, method in enumerate(self._methods)}
        ordered = sorted(self.records.values(), key=lambda one: (one.number, order.get(one.method, len(order))))
        write_file(self._path / TABLE_NAME, table_lines(ordered, header=True).encode())


def _check(matchers: Mapping[str, StereoMatcher], suffix: str) -> None:
    """Raise an error if a method has no valid name for a folder, or a search range that does not fit the files."""
    if not matchers:
        raise ValueError("No matcher was given; at least one is needed.")
    if suffix not in DISPARITY_FORMATS:
        raise ValueError(f"disparity_format is {suffix!r}; allowed are {', '.join(DISPARITY_FORMATS)}.")
    for name, matcher in matchers.items():
        if not _FOLDER_NAME.fullmatch(name):
            raise ValueError(f"{name!r} is not a folder name; allowed are letters, digits, '-', '_' and '.'.")
        first, count = matcher.reach() or (0, 0)
        if suffix == PNG and (first < 0 or first + count > 256):
            raise ValueError(
                f"{name} searches disparities from {first} to {first + count - 1} px; KITTI's PNG holds 0 to 255 px, "
                ".pfm and .npy hold any."
            )


def _document(sequence: StereoSequence, task: FrameTask) -> dict[str, Any]:
    """Return the inputs of maps and table as JSON values, under names for an error message."""
    names = hashlib.sha256("\n".join(sequence.names).encode()).hexdigest()
    frames = {"count": len(sequence), "names": names, "rate": sequence.frame_rate} | (
        {"turned": sequence.turn} if sequence.turn else {}
    )
    first = sequence.first_readable(1)
    # The frames of every video are named by their numbers: the first pictures tell one from another.
    document = {
        "version": VERSION,
        "settings": {name: settings_document(matcher) for name, matcher in task.matchers.items()},
        "frames": frames | ({"rectified": True} if sequence.rectified else {}),
        "format": task.suffix,
        "calibration": None if task.calibration is None else asdict(task.calibration) | {"rig": None},
        "steadiness": None if task.steadiness is None else task.steadiness.model_dump(mode="json"),
    } | (
        {} if first is None else {"pictures": hashlib.sha256(first.left.tobytes() + first.right.tobytes()).hexdigest()}
    )
    normalised: dict[str, Any] = json.loads(json.dumps(document))
    return normalised
