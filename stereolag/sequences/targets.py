"""Where the maps and figures of a sequence go: a folder, or the memory of who asked for them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Protocol

from stereolag.reading.sources import Source
from stereolag.sequences.matching import MatchedFrame
from stereolag.sequences.records import MOTION, FrameRecord


class SequenceTarget(Protocol):
    """Takes frame after frame in their order, and knows which it has."""

    @property
    def colours(self) -> tuple[float, float] | None:
        """Return the disparities, px, at the ends of the colours of the video; None until they are known."""

    def set_colours(self, colours: tuple[float, float]) -> None:
        """Keep the range of colours."""

    def __contains__(self, number: int) -> bool:
        """Return whether a frame is finished."""

    def lacks_motion(self, number: int) -> bool:
        """Return whether there is no record of the motion in a frame."""

    def files(self, number: int) -> Mapping[str, Source]:
        """Return the maps of a finished frame, by method."""

    def add(self, records: Iterable[FrameRecord]) -> None:
        """Keep figures of a frame whose maps are kept, in place of those of the same method."""

    def write(self, frame: MatchedFrame, records: Iterable[FrameRecord]) -> None:
        """Keep a frame and its figures, one record a method; of a damaged frame there are records alone."""

    def close(self) -> None:
        """Be told that no more frames come."""


class SequenceMemory:
    """Keeps everything in memory: nothing that a visitor uploads is written to disk.

    Attributes
    ----------
    maps
        {(number of the frame, method): the bytes of its map}.
    records
        {(number of the frame, method): its figures}, in the order in which the frames came.
    colours
        As in :class:`SequenceTarget`.
    """

    def __init__(self) -> None:
        self.maps: dict[tuple[int, str], bytes] = {}
        self.records: dict[tuple[int, str], FrameRecord] = {}
        self.colours: tuple[float, float] | None = None
        self._finished: dict[int, tuple[str, ...]] = {}

    def set_colours(self, colours: tuple[float, float]) -> None:
        """Keep the range of colours."""
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
        """Keep figures, those of motion added later after all others."""
        self.records |= {(one.number, one.method): one for one in records}

    def write(self, frame: MatchedFrame, records: Iterable[FrameRecord]) -> None:
        """Keep a frame."""
        self.add(records)
        if not frame.problem:
            self.maps |= {(frame.number, method): one.data for method, one in frame.maps.items()}
            self._finished[frame.number] = tuple(frame.maps)

    def close(self) -> None:
        """Have nothing to do."""
