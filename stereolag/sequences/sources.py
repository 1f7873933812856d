"""Frames of a stereo camera: folders, patterns, archives and videos, which any process can read by number."""

from __future__ import annotations

import glob
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from os import PathLike
from pathlib import Path, PurePosixPath
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from stereolag.core.inputs import Image
from stereolag.core.jobs import limits
from stereolag.geometry.calibration import Calibration
from stereolag.geometry.rectification import rectify
from stereolag.io.disparities import read_disparity
from stereolag.io.guard import Door, guarded, unguarded
from stereolag.io.images import read_image
from stereolag.io.pairing import PICTURE_ENDINGS, TRUTH_ENDINGS, left_alone, matched_pairs, natural_order
from stereolag.io.sources import Archive, Source, is_archive, quote, read_archive
from stereolag.io.videos import LEAST_RATE, MOST_RATE, VIDEO_ENDINGS, GuardedVideo, VideoFile
from stereolag.samples import DriveExample

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
    door: Door = unguarded

    @property
    def has_truth(self) -> bool:
        """Return whether a frame has a file of true disparities."""
        return _any_truth(self.files)

    def reader(self, number: int) -> FrameReader:
        """Return a reader for a frame from the archive."""
        return partial(_read_archived, self.archive, self.files[number], self.door)


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


def _read_archived(archive: Path | Archive, names: FrameFiles, door: Door) -> StereoFrame:
    files = archive if isinstance(archive, Archive) else _opened_once(archive)
    left, right = (door(read_image)(files.read(name)) for name in (names.left, _right_of(names)))
    return StereoFrame(left, right, None if names.truth is None else door(read_disparity)(files.read(names.truth)))


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


_BEGINNING = 4


def open_sequence(
    left: Source,
    right: Source | None = None,
    *,
    truth: str | PathLike[str] | None = None,
    frame_rate: float | None = None,
) -> StereoSequence:
    """Open the frames of a stereo camera.

    Parameters
    ----------
    left, right
        Two folders of pictures or patterns of their paths ("drive/left_*.png"); two videos; or `left` alone: a ZIP
        archive of pictures whose folders or names show the side ("left/000.png"), or one video with both pictures side
        by side. Archives and videos may also be given as bytes or binary file objects.
    truth
        A folder or pattern of true disparities, with the names or in the order of the left pictures; an archive
        includes its own.
    frame_rate
        Hz; by default that of the video, or 10 for pictures.

    Returns
    -------
    StereoSequence
        Pictures with the same name are paired; if the two sides have no name in common, they are paired in the order of
        their names. A left picture without a right one counts as a damaged frame.

    Raises
    ------
    ValueError
        If there is nothing to read, the sides cannot be paired, the frame rate is implausible, or there are more
        frames, pixels or seconds than the limits in force.
    """
    return _opened(left, right, truth, frame_rate, unguarded)


def open_uploads(left: bytes, right: bytes | None = None) -> StereoSequence:
    """Open the frames in strangers' files as :func:`open_sequence` does; the guard decodes them."""
    return _opened(left, right, None, None, guarded)


def _opened(
    left: Source,
    right: Source | None,
    truth: str | PathLike[str] | None,
    frame_rate: float | None,
    door: Door,
) -> StereoSequence:
    video = VideoFile if door is unguarded else GuardedVideo
    if frame_rate is not None and not LEAST_RATE <= frame_rate <= MOST_RATE:
        raise ValueError(f"frame_rate is {frame_rate} Hz; allowed are {LEAST_RATE} to {MOST_RATE} Hz.")
    if right is None:
        sequence = _of_one(left, frame_rate, door, video)
    elif _holds_video(left):
        sequence = TwoVideos(video(left), video(right), frame_rate)
    else:
        sequence = _of_pictures(left, right, truth, frame_rate or USUAL_RATE)
    if len(sequence) > limits().max_frames:
        raise ValueError(f"The sequence has {len(sequence):,} frames; at most {limits().max_frames:,} are accepted.")
    return sequence


def example_sequence(example: DriveExample) -> StereoSequence:
    """Return the frames of a bundled drive, with the true disparity of each."""
    files = zip(example.left, example.right, example.disparity, strict=True)
    return PictureFiles(
        tuple(path.stem for path in example.left),
        tuple(FrameFiles(str(left), str(right), str(truth)) for left, right, truth in files),
        example.frame_rate,
    )


def _of_one(source: Source, frame_rate: float | None, door: Door, video: type[VideoFile]) -> StereoSequence:
    path = Path(source).resolve() if isinstance(source, str | PathLike) else None
    if path is not None and path.is_dir():
        raise ValueError(f"{quote(path.name)} is a folder; give two, of the left and of the right pictures.")
    if not is_archive(_beginning(source)):
        return SideBySideVideo(video(source), frame_rate)
    archive = read_archive(source, max_files=MAX_ARCHIVED)
    files = tuple(_frames_among(archive.names))
    if not files:
        raise ValueError(f"The archive of {len(archive.names):,} files holds no pictures named left and right.")
    names = _frame_names([one.left for one in files])
    return ArchivedPictures(names, files, path or archive, frame_rate or USUAL_RATE, door)


def _frames_among(names: Sequence[str]) -> list[FrameFiles]:
    """Return the frames of one camera among files; with several cameras, by the most reliable naming convention."""
    pairs = matched_pairs(names)
    surest = min((pair.convention for pair in pairs), default=0)
    pairs = [pair for pair in pairs if pair.convention == surest]
    frames = [FrameFiles(pair.left, pair.right, pair.truth) for pair in pairs]
    if frames:
        frames += [FrameFiles(name, None) for name in left_alone(names, pairs, surest)]
    return sorted(frames, key=lambda frame: [natural_order(frame.left), frame.left])


def _of_pictures(left: Source, right: Source, truth: str | PathLike[str] | None, frame_rate: float) -> PictureFiles:
    lefts, rights = _pictures(left, PICTURE_ENDINGS), _pictures(right, PICTURE_ENDINGS)
    truths = [] if truth is None else _pictures(truth, TRUTH_ENDINGS)
    partners = _partners(lefts, rights, "right pictures")
    known = _partners(lefts, truths, "true disparities") if truths else [None] * len(lefts)
    files = tuple(map(FrameFiles, lefts, partners, known))
    return PictureFiles(_frame_names(lefts), files, frame_rate)


def _pictures(source: Source, endings: frozenset[str]) -> list[str]:
    """Return the paths of the files in a folder or matching a pattern, in natural order."""
    if not isinstance(source, str | PathLike):
        raise ValueError("Pictures are named by a folder or a pattern; give a ZIP archive or videos as bytes.")
    path = Path(source)
    # Path.glob takes no absolute pattern.
    found = path.iterdir() if path.is_dir() else map(Path, glob.glob(str(source)))  # noqa: PTH207
    kept = [one for one in found if one.suffix.removeprefix(".").casefold() in endings and not one.name.startswith(".")]
    if not kept:
        raise ValueError(
            f"There are no pictures at {str(source)!r}; allowed are folders, patterns such as 'left/*.png'."
        )
    return sorted((str(one.absolute()) for one in kept), key=lambda name: [natural_order(name), name])


def _partners(names: Sequence[str], others: Sequence[str], what: str) -> list[str | None]:
    """Return the partner of each file: the one with its name, or the one at its position if no names agree."""
    by_name = {Path(other).stem: other for other in others}
    found = [by_name.get(Path(name).stem) for name in names]
    if any(found):
        return found
    if len(names) != len(others):
        raise ValueError(
            f"There are {len(names):,} left pictures and {len(others):,} {what}, with other names; either their names "
            "or their number must match."
        )
    return list(others)


def _frame_names(paths: Sequence[str]) -> tuple[str, ...]:
    """Return the names of frames: the stems of their files, numbered if they are not unique."""
    parts = [PurePosixPath(path.replace("\\", "/")) for path in paths]
    stems = [path.stem for path in parts]
    if len(set(stems)) == len(stems):
        return tuple(stems)
    return tuple(f"{number:06d}_{stem}" for number, stem in enumerate(stems))


def _holds_video(source: Source) -> bool:
    if isinstance(source, str | PathLike):
        return Path(source).suffix.removeprefix(".").casefold() in VIDEO_ENDINGS and not Path(source).is_dir()
    return True


def _beginning(source: Source) -> bytes:
    if isinstance(source, str | PathLike):
        with Path(source).open("rb") as file:
            return file.read(_BEGINNING)
    if isinstance(source, bytes | bytearray | memoryview):
        return bytes(source[:_BEGINNING])
    source.seek(0)
    return source.read(_BEGINNING)
