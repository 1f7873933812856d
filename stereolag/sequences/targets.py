"""Where maps and figures of a sequence are kept: a folder, which recognises finished frames, or memory."""

from __future__ import annotations

import hashlib
import json
import os
import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from stereolag.io.images import DISPARITY_FORMATS
from stereolag.io.settings import settings_document
from stereolag.io.sources import Source, write_file
from stereolag.sequences.frames import (
    MOTION,
    PNG,
    FrameMap,
    FrameRecord,
    FrameTask,
    MatchedFrame,
    read_records,
    table_lines,
)
from stereolag.sequences.sources import StereoSequence
from stereolag.stereo.matcher import StereoMatcher
from stereolag.version import VERSION


class SequenceTarget(ABC):
    """Receives frames in order, and knows which are finished.

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

    def __init__(self) -> None:
        self.records: dict[tuple[int, str], FrameRecord] = {}
        self.finished: dict[int, tuple[str, ...]] = {}
        self.colours: tuple[float, float] | None = None
        self.largest_motion: float | None = None

    @abstractmethod
    def file(self, number: int, method: str) -> Source:
        """Return a map of a finished frame."""

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


class SequenceMemory(SequenceTarget):
    """Target that keeps everything in memory: nothing that a visitor uploads is written to disk.

    Attributes
    ----------
    maps
        {(frame number, method): bytes of the map}.
    """

    def __init__(self) -> None:
        super().__init__()
        self.maps: dict[tuple[int, str], bytes] = {}

    def file(self, number: int, method: str) -> Source:
        """Return the bytes of a map."""
        return self.maps[number, method]

    def write(self, frame: MatchedFrame[FrameMap], records: Iterable[FrameRecord]) -> None:
        """Store a frame and its figures."""
        self.maps |= {(frame.number, method): one.data for method, one in frame.maps.items()}
        super().write(frame, records)


TABLE, MANIFEST = "frames.csv", "sequence.json"

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
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
        self.colours = None if again else self._noted()
        for method in self._methods:
            (path / method).mkdir(parents=True, exist_ok=True)
        if not again and (path / TABLE).is_file():
            self.records = {
                (one.number, one.method): one for one in read_records(path / TABLE) if self._is_finished(one)
            }
        for number in range(len(sequence)):
            if all((number, method) in self.records for method in self._methods):
                self.finished[number] = self._methods
        self._note()
        self._rewrite_table()
        self._table = (path / TABLE).open("a", encoding="utf-8")

    def file(self, number: int, method: str) -> Path:
        """Return the path of a map."""
        return self._path / method / f"{self._names[number]}{self._suffix}"

    def set_colours(self, colours: tuple[float, float]) -> None:
        """Record the colour range, so that it is kept when the work is resumed."""
        super().set_colours(colours)
        self._note()

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
        """Return whether a row of the table counts, and its map is complete: a power failure may cut a file short."""
        if record.problem or record.number >= len(self._names):
            return False
        if record.method not in self._methods:
            return record.method == MOTION
        try:
            with self.file(record.number, record.method).open("rb") as file:
                file.seek(-len(_PNG_END), os.SEEK_END)
                return self._suffix != PNG or file.read() == _PNG_END
        except OSError:  # missing, or shorter than that
            return False

    def _noted(self) -> tuple[float, float] | None:
        """Return the colour range recorded in the folder; refuse a folder begun with other inputs."""
        manifest = self._path / MANIFEST
        if not manifest.is_file():
            return None
        try:
            noted = json.loads(manifest.read_text(encoding="utf-8"))
            differing = [name for name, value in self._document.items() if noted["made_of"].get(name) != value]
            colours = noted["colours"]
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise ValueError(f"{manifest} is damaged; begin again, or choose another folder.") from error
        if differing:
            raise ValueError(
                f"{self._path} holds frames made with other {' and '.join(differing)}; continue with the same, "
                "begin again, or choose another folder."
            )
        return None if colours is None else (float(colours[0]), float(colours[1]))

    def _note(self) -> None:
        digest = hashlib.sha256(json.dumps(self._document, sort_keys=True).encode()).hexdigest()
        document = {"digest": digest, "made_of": self._document, "colours": self.colours}
        write_file(self._path / MANIFEST, (json.dumps(document, indent=2) + "\n").encode())

    def _rewrite_table(self) -> None:
        order = {method: place for place, method in enumerate(self._methods)}
        ordered = sorted(self.records.values(), key=lambda one: (one.number, order.get(one.method, len(order))))
        write_file(self._path / TABLE, table_lines(ordered, header=True).encode())


def _check(matchers: Mapping[str, StereoMatcher], suffix: str) -> None:
    if not matchers:
        raise ValueError("No matcher was given; at least one is needed.")
    for name in matchers:
        if not _NAME.fullmatch(name):
            raise ValueError(f"{name!r} is not a folder name; allowed are letters, digits, '-', '_' and '.'.")
    if suffix not in DISPARITY_FORMATS:
        raise ValueError(f"disparity_format is {suffix!r}; allowed are {', '.join(DISPARITY_FORMATS)}.")
    for name, matcher in matchers.items():
        reach = matcher.reach()
        if suffix == PNG and reach is not None and (reach[0] < 0 or sum(reach) > 256):
            raise ValueError(
                f"{name} searches disparities from {reach[0]} to {sum(reach) - 1} px; KITTI's PNG holds 0 to 255 px, "
                ".pfm and .npy hold any."
            )


def _document(sequence: StereoSequence, task: FrameTask) -> dict[str, Any]:
    """Return the inputs of maps and table, under names that an error message can use."""
    names = hashlib.sha256("\n".join(sequence.names).encode()).hexdigest()
    frames = {"count": len(sequence), "names": names, "rate": sequence.frame_rate}
    document = {
        "version": VERSION,
        "settings": {name: settings_document(matcher) for name, matcher in task.matchers.items()},
        "frames": frames | ({"rectified": True} if sequence.rectified else {}),
        "format": task.suffix,
        "calibration": None if task.calibration is None else asdict(task.calibration) | {"rig": None},
        "steadiness": None if task.steadiness is None else task.steadiness.model_dump(mode="json"),
    }
    normalised: dict[str, Any] = json.loads(json.dumps(document))
    return normalised
