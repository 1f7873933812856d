"""Targets for the maps and figures of a sequence: a folder, or the memory of the caller."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Protocol

from stereolag.io.sources import Source
from stereolag.sequences.matching import MatchedFrame
from stereolag.sequences.records import MOTION, FrameRecord


class SequenceTarget(Protocol):
    """Receives frames in order, and knows which are finished."""

    @property
    def colours(self) -> tuple[float, float] | None:
        """Return the disparities at the ends of the video's colour range, px; None until known."""

    def set_colours(self, colours: tuple[float, float]) -> None:
        """Store the colour range."""

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
    colours
        As in :class:`SequenceTarget`.
    """

    def __init__(self) -> None:
        self.maps: dict[tuple[int, str], bytes] = {}
        self.records: dict[tuple[int, str], FrameRecord] = {}
        self.colours: tuple[float, float] | None = None
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
