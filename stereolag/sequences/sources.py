"""Sources of the frames of a stereo camera, which any process can read by number."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from stereolag.core.inputs import Image
from stereolag.geometry.calibration import Calibration
from stereolag.geometry.rectification import rectify
from stereolag.io.archives import Archive, read_archive
from stereolag.io.disparities import read_disparity
from stereolag.io.images import read_image
from stereolag.io.videos import VideoFile

USUAL_RATE = 10.0
"""Default frame rate of pictures, which do not record one, Hz."""

MAX_ARCHIVED = 20_000
"""Most files in an archive of frames."""

Truth: TypeAlias = npt.NDArray[np.float32]


class StereoFrame(NamedTuple):
    """One frame: the simultaneous pictures of both cameras, and the true disparity, px, if known."""

    left: Image
    right: Image
    truth: Truth | None = None


class FrameFiles(NamedTuple):
    """The file names of one frame; None if a file is missing."""

    left: str
    right: str | None
    truth: str | None = None


FrameReader: TypeAlias = Callable[[], StereoFrame]
"""Reads one frame, here or in another process; raises ``ValueError`` or ``OSError`` if it is damaged."""


class StereoSequence(ABC):
    """Frames of a stereo camera, by number.

    Attributes
    ----------
    names
        Unique names of the frames: those of the left pictures without endings, or the frame numbers in a video.
    frame_rate
        Hz.
    rectified
        Whether frames are rectified when they are read.
    """

    names: tuple[str, ...]
    frame_rate: float
    rectified: bool = False

    @property
    def has_truth(self) -> bool:
        """Return whether any frame has a true disparity."""
        return False

    @abstractmethod
    def reader(self, number: int) -> FrameReader:
        """Return a reader for a frame: small, picklable, and with no file open."""

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.names)

    def frame(self, number: int) -> StereoFrame:
        """Read a frame.

        Raises
        ------
        IndexError
            If there is no such frame.
        ValueError, OSError
            If the frame is damaged or missing; other frames are unaffected.
        """
        if not 0 <= number < len(self):
            raise IndexError(f"frame {number} of a sequence of {len(self)}; allowed are 0 to {len(self) - 1}.")
        return self.reader(number)()

    def first_readable(self, looked_at: int | None = None) -> StereoFrame | None:
        """Return the first undamaged frame, among the first `looked_at` if given; None if all are damaged."""
        for number in range(len(self))[:looked_at]:
            try:
                return self.frame(number)
            except (ValueError, OSError):
                continue
        return None


@dataclass(frozen=True, eq=False)
class PictureFiles(StereoSequence):
    """Frames in separate picture files, given by paths."""

    names: tuple[str, ...]
    files: tuple[FrameFiles, ...]
    frame_rate: float = USUAL_RATE

    @property
    def has_truth(self) -> bool:
        """Return whether a frame has a file of true disparities."""
        return _any_truth(self.files)

    def reader(self, number: int) -> FrameReader:
        """Return a reader for a frame from its files."""
        return partial(_read_files, self.files[number])


@dataclass(frozen=True, eq=False)
class ArchivedPictures(StereoSequence):
    """Frames in the picture files of one archive, given by its path, which every process opens once, or its bytes."""

    names: tuple[str, ...]
    files: tuple[FrameFiles, ...]
    archive: Path | Archive
    frame_rate: float = USUAL_RATE

    @property
    def has_truth(self) -> bool:
        """Return whether a frame has a file of true disparities."""
        return _any_truth(self.files)

    def reader(self, number: int) -> FrameReader:
        """Return a reader for a frame from the archive."""
        return partial(_read_archived, self.archive, self.files[number])


class TwoVideos(StereoSequence):
    """Frames of two videos, as many as in the shorter one."""

    def __init__(self, left: VideoFile, right: VideoFile, frame_rate: float | None = None) -> None:
        self._left, self._right = left, right
        self.names = _numbers(min(len(left), len(right)))
        self.frame_rate = frame_rate or left.frame_rate

    def reader(self, number: int) -> FrameReader:
        """Return a reader for a frame from both videos."""
        return partial(_read_two, self._left, self._right, number)


class SideBySideVideo(StereoSequence):
    """Frames of one video whose left half is the left camera's picture."""

    def __init__(self, video: VideoFile, frame_rate: float | None = None) -> None:
        if video.width < 2 or video.width % 2:
            raise ValueError(f"The video is {video.width} px wide; two pictures side by side have an even width.")
        self._video = video
        self.names = _numbers(len(video))
        self.frame_rate = frame_rate or video.frame_rate

    def reader(self, number: int) -> FrameReader:
        """Return a reader for a frame that splits it into halves."""
        return partial(_read_halves, self._video, number)


class RectifiedSequence(StereoSequence):
    """Frames of a raw stereo camera, rectified when they are read.

    Parameters
    ----------
    sequence
        The raw frames.
    calibration
        With its ``rig``, the two cameras before rectification; :func:`stereolag.rectify` returns that of the result.
    alpha
        The framing, as for :func:`stereolag.rectify`.
    """

    rectified = True

    def __init__(self, sequence: StereoSequence, calibration: Calibration, alpha: float | None = None) -> None:
        self._sequence, self._calibration, self._alpha = sequence, calibration, alpha
        self.names, self.frame_rate = sequence.names, sequence.frame_rate

    def reader(self, number: int) -> FrameReader:
        """Return a reader that rectifies a frame and drops its true disparity, which belongs to the raw pictures."""
        return partial(_read_rectified, self._sequence.reader(number), self._calibration, self._alpha)


def _read_rectified(reader: FrameReader, calibration: Calibration, alpha: float | None) -> StereoFrame:
    raw = reader()
    straight = rectify(raw.left, raw.right, calibration, alpha=alpha)
    return StereoFrame(straight.left, straight.right)


def _any_truth(files: tuple[FrameFiles, ...]) -> bool:
    return any(one.truth is not None for one in files)


def _numbers(count: int) -> tuple[str, ...]:
    return tuple(f"{number:06d}" for number in range(count))


def _read_files(names: FrameFiles) -> StereoFrame:
    left, right = (read_image(Path(name)) for name in (names.left, _right_of(names)))
    return StereoFrame(left, right, None if names.truth is None else read_disparity(Path(names.truth)))


def _read_archived(archive: Path | Archive, names: FrameFiles) -> StereoFrame:
    files = archive if isinstance(archive, Archive) else _opened_once(archive)
    left, right = (read_image(files.read(name)) for name in (names.left, _right_of(names)))
    return StereoFrame(left, right, None if names.truth is None else read_disparity(files.read(names.truth)))


@lru_cache(maxsize=2)
def _opened_once(path: Path) -> Archive:
    return read_archive(path, max_files=MAX_ARCHIVED)


def _read_two(left: VideoFile, right: VideoFile, number: int) -> StereoFrame:
    return StereoFrame(left.frame(number), right.frame(number))


def _read_halves(video: VideoFile, number: int) -> StereoFrame:
    both = video.frame(number)
    middle = both.shape[1] // 2
    return StereoFrame(np.ascontiguousarray(both[:, :middle]), np.ascontiguousarray(both[:, middle:]))


def _right_of(names: FrameFiles) -> str:
    if names.right is None:
        raise ValueError(f"{Path(names.left).name} has no picture of the right camera.")
    return names.right
