"""Where maps and figures of a sequence are kept: a folder, which recognises finished frames, or memory."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Protocol

from stereolag.geometry.calibration import Calibration
from stereolag.io.disparities import DISPARITY_FORMATS
from stereolag.io.settings import settings_document
from stereolag.io.sources import Source, write_file
from stereolag.sequences.matching import PNG, MatchedFrame
from stereolag.sequences.records import MOTION, FrameRecord, header, lines, read_records
from stereolag.sequences.sources import StereoSequence
from stereolag.sequences.steadying import Steadiness
from stereolag.stereo.matcher import StereoMatcher
from stereolag.version import VERSION


class SequenceTarget(Protocol):
    """Receives frames in order, and knows which are finished."""

    @property
    def colours(self) -> tuple[float, float] | None:
        """Return the disparities at the ends of the video's colour range, px; None until known."""

    def set_colours(self, colours: tuple[float, float]) -> None:
        """Store the colour range."""

    largest_motion: float | None
    """Displacement at the rim of the colour wheel of the flow, px; None until known."""

    def __contains__(self, number: int) -> bool:
        """Return whether a frame is finished."""

    def lacks_motion(self, number: int) -> bool:
        """Return whether there is no record of the motion in a frame."""

    def files(self, number: int) -> Mapping[str, Source]:
        """Return the maps of a finished frame, by method."""

    def add(self, records: Iterable[FrameRecord]) -> None:
        """Store figures of a frame whose maps are stored, replacing those of the same method."""

    def write(self, frame: MatchedFrame, records: Iterable[FrameRecord]) -> None:
        """Store a frame and its figures, one record per method; a damaged frame has only records."""

    def close(self) -> None:
        """Finish; no more frames follow."""


class SequenceMemory:
    """Target that keeps everything in memory: nothing that a visitor uploads is written to disk.

    Attributes
    ----------
    maps
        {(frame number, method): bytes of the map}.
    records
        {(frame number, method): figures}, in order of arrival.
    colours, largest_motion
        As in :class:`SequenceTarget`.
    """

    def __init__(self) -> None:
        self.maps: dict[tuple[int, str], bytes] = {}
        self.records: dict[tuple[int, str], FrameRecord] = {}
        self.colours: tuple[float, float] | None = None
        self.largest_motion: float | None = None
        self._finished: dict[int, tuple[str, ...]] = {}

    def set_colours(self, colours: tuple[float, float]) -> None:
        """Store the colour range."""
        self.colours = colours

    def __contains__(self, number: int) -> bool:
        """Return whether a frame is finished."""
        return number in self._finished

    def lacks_motion(self, number: int) -> bool:
        """Return whether there is no record of the motion in a frame."""
        return (number, MOTION) not in self.records

    def files(self, number: int) -> Mapping[str, Source]:
        """Return the bytes of the maps of a frame."""
        return {method: self.maps[number, method] for method in self._finished[number]}

    def add(self, records: Iterable[FrameRecord]) -> None:
        """Store figures; motion added later comes after all others."""
        self.records |= {(one.number, one.method): one for one in records}

    def write(self, frame: MatchedFrame, records: Iterable[FrameRecord]) -> None:
        """Store a frame and its figures."""
        self.add(records)
        if not frame.problem:
            self.maps |= {(frame.number, method): one.data for method, one in frame.maps.items()}
            self._finished[frame.number] = tuple(frame.maps)

    def close(self) -> None:
        """Do nothing."""


TABLE, MANIFEST = "frames.csv", "sequence.json"

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
_PNG_END = b"IEND\xaeB`\x82"


class SequenceFolder:
    """A folder with a map for every frame and method, ``METHOD/FRAME.png``, and a table of figures, ``frames.csv``.

    Parameters
    ----------
    path
        Created if missing.
    sequence, matchers, suffix, calibration, steadiness
        The inputs of the maps and the table. They are recorded in ``sequence.json``; a folder begun with other inputs
        is refused.
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

    def __init__(
        self,
        path: Path,
        sequence: StereoSequence,
        matchers: Mapping[str, StereoMatcher],
        suffix: str,
        calibration: Calibration | None,
        steadiness: Steadiness | None = None,
        *,
        again: bool,
    ) -> None:
        _check(matchers, suffix)
        self._path, self._suffix = path, suffix
        self._names, self._methods = sequence.names, tuple(matchers)
        self._document = _document(sequence, matchers, suffix, calibration, steadiness)
        self.colours: tuple[float, float] | None = None if again else self._noted()
        """The disparities at the ends of the video's colour range, px; None until known."""
        self.largest_motion: float | None = None
        for method in matchers:
            (path / method).mkdir(parents=True, exist_ok=True)
        self._records = {} if again else self._finished()
        self._note()
        self._rewrite_table()
        self._table = (path / TABLE).open("a", encoding="utf-8")

    def __contains__(self, number: int) -> bool:
        """Return whether a frame is finished."""
        return all((number, method) in self._records for method in self._methods)

    def lacks_motion(self, number: int) -> bool:
        """Return whether there is no record of the motion in a frame."""
        return (number, MOTION) not in self._records

    def files(self, number: int) -> Mapping[str, Path]:
        """Return the paths of a frame's maps, by method."""
        return {method: self._file(number, method) for method in self._methods}

    def set_colours(self, colours: tuple[float, float]) -> None:
        """Record the colour range, so that it is kept when the work is resumed."""
        self.colours = colours
        self._note()

    def write(self, frame: MatchedFrame, records: Iterable[FrameRecord]) -> None:
        """Write the maps of a frame, each atomically, and then its rows of the table."""
        for method, one in frame.maps.items():
            write_file(self._file(frame.number, method), one.data, synced=False)
        self.add(records)

    def add(self, records: Iterable[FrameRecord]) -> None:
        """Write figures to the table, replacing those of the same method."""
        new = {(record.number, record.method): record for record in records}
        self._table.write(lines(new.values()))
        self._table.flush()
        self._records |= new

    def close(self) -> None:
        """Sort the table."""
        self._table.close()
        self._rewrite_table()

    def _file(self, number: int, method: str) -> Path:
        return self._path / method / f"{self._names[number]}{self._suffix}"

    def _finished(self) -> dict[tuple[int, str], FrameRecord]:
        if not (self._path / TABLE).is_file():
            return {}
        return {
            (record.number, record.method): record
            for record in read_records(self._path / TABLE)
            if not record.problem
            and record.number < len(self._names)
            and (
                record.method == MOTION
                or (record.method in self._methods and _is_whole(self._file(record.number, record.method)))
            )
        }

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
        document = {"digest": _digest(self._document), "made_of": self._document, "colours": self.colours}
        write_file(self._path / MANIFEST, (json.dumps(document, indent=2) + "\n").encode())

    def _rewrite_table(self) -> None:
        order = {method: place for place, method in enumerate(self._methods)}
        ordered = sorted(self._records.values(), key=lambda one: (one.number, order.get(one.method, len(order))))
        write_file(self._path / TABLE, (header() + lines(ordered)).encode())


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


def _document(
    sequence: StereoSequence,
    matchers: Mapping[str, StereoMatcher],
    suffix: str,
    calibration: Calibration | None,
    steadiness: Steadiness | None,
) -> dict[str, Any]:
    """Return the inputs of maps and table, under names that an error message can use."""
    names = hashlib.sha256("\n".join(sequence.names).encode()).hexdigest()
    frames = {"count": len(sequence), "names": names, "rate": sequence.frame_rate}
    document = {
        "version": VERSION,
        "settings": {name: settings_document(matcher) for name, matcher in matchers.items()},
        "frames": frames | ({"rectified": True} if sequence.rectified else {}),
        "format": suffix,
        "calibration": None if calibration is None else asdict(calibration) | {"rig": None},
        "steadiness": None if steadiness is None else steadiness.model_dump(mode="json"),
    }
    normalised: dict[str, Any] = json.loads(json.dumps(document))
    return normalised


def _digest(document: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(document, sort_keys=True).encode()).hexdigest()


def _is_whole(path: Path) -> bool:
    """Return whether a file exists and is complete: after a power failure it may be cut short."""
    try:
        with path.open("rb") as file:
            file.seek(0, 2)
            if file.tell() < len(_PNG_END):
                return False
            file.seek(-len(_PNG_END), 2)
            return path.suffix != PNG or file.read() == _PNG_END
    except OSError:
        return False
