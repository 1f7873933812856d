"""Frames of a stereo camera: folders, patterns, archives and videos, which any process can read by number."""

from __future__ import annotations

import glob
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from os import PathLike
from pathlib import Path, PurePosixPath
from typing import NamedTuple, TypeAlias

import numpy as np

from stereolag.assess.findings import Finding
from stereolag.assess.layout import Anaglyph, Layout, likely_layout, views
from stereolag.core.arrays import FloatMap
from stereolag.core.inputs import Image
from stereolag.core.jobs import limits
from stereolag.geometry.calibration import Calibration
from stereolag.geometry.rectification import rectify, turned
from stereolag.io.disparities import read_disparity, read_stored_disparity
from stereolag.io.ground_truth import TruthFit, divisor_in_words, stored_truth_fit
from stereolag.io.guard import Guard, guarded, unguarded
from stereolag.io.images import read_image
from stereolag.io.pairing import PICTURE_ENDINGS, TRUTH_ENDINGS, left_alone, matched_pairs, natural_order
from stereolag.io.sources import Archive, Source, beginning, is_archive, quote, read_archive
from stereolag.io.videos import MAX_RATE_HZ, MIN_RATE_HZ, VIDEO_SUFFIXES, GuardedVideo, VideoFile
from stereolag.samples import DriveExample

USUAL_RATE = 10.0
"""Default frame rate of pictures, which do not record one, Hz."""

MOST_TRIED = 10
"""Most frames that are tried for one whose true disparity can be read."""

MAX_ARCHIVED = 20_000
"""Most files in an archive of frames."""


class StereoFrame(NamedTuple):
    """One frame: the simultaneous pictures of both cameras, and the true disparity, px, if known."""

    left: Image
    right: Image
    truth: FloatMap | None = None

    def turned(self, quarters: int) -> tuple[Image, Image]:
        """Return both pictures turned by quarters, counter-clockwise."""
        return turned(self.left, quarters), turned(self.right, quarters)


class FrameFiles(NamedTuple):
    """The file names of one frame; None if a file is missing."""

    left: str
    right: str | None
    truth: str | None = None


FrameReader: TypeAlias = Callable[[], StereoFrame]
"""Reads one frame, here or in another process; raises ``ValueError`` or ``OSError`` if it is damaged."""


@dataclass(frozen=True, eq=False)
class StereoSequence:
    """Frames of a stereo camera, by number.

    Attributes
    ----------
    names
        Unique names of the frames: those of the left pictures without endings, or the frame numbers in a video.
    frame_rate
        Hz.
    reader
        Returns a reader for a frame: small, picklable, and with no file open.
    has_truth
        Whether any frame has a true disparity.
    rectified
        Whether frames are rectified when they are read.
    turn
        Quarters, counter-clockwise, by which the pictures of cameras one above the other are turned to be matched;
        their maps are turned back.
    findings
        What the input doctor finds wrong with the frames, for their table.
    notes
        Sentences about the true disparities: how they are read, or what speaks against them.
    """

    names: tuple[str, ...]
    frame_rate: float
    reader: Callable[[int], FrameReader]
    has_truth: bool = False
    rectified: bool = False
    turn: int = 0
    findings: tuple[Finding, ...] = ()
    notes: tuple[str, ...] = ()

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

    def readable(self, number: int) -> StereoFrame | None:
        """Read a frame as :meth:`frame` does; None if it is damaged or missing."""
        try:
            return self.frame(number)
        except (ValueError, OSError):
            return None

    def first_readable(self, looked_at: int | None = None) -> StereoFrame | None:
        """Return the first undamaged frame, among the first `looked_at` if given; None if all are damaged."""
        frames = map(self.readable, range(len(self))[:looked_at])
        return next((frame for frame in frames if frame is not None), None)


def rectified_sequence(
    sequence: StereoSequence, calibration: Calibration, alpha: float | None = None
) -> StereoSequence:
    """Return the frames of a raw stereo camera, rectified when they are read, without their true disparities.

    Parameters
    ----------
    sequence
        The raw frames.
    calibration
        With its ``rig``, the two cameras before rectification; :func:`stereolag.rectify` returns that of the result.
    alpha
        The framing, as for :func:`stereolag.rectify`.
    """
    return replace(
        sequence,
        reader=lambda number: partial(_read_rectified, sequence.reader(number), calibration, alpha),
        has_truth=False,
        rectified=True,
        turn=0 if calibration.rig is None else calibration.rig.turn,
    )


def _read_rectified(reader: FrameReader, calibration: Calibration, alpha: float | None) -> StereoFrame:
    raw = reader()
    straight = rectify(raw.left, raw.right, calibration, alpha=alpha)
    back = 0 if calibration.rig is None else -calibration.rig.turn
    return StereoFrame(turned(straight.left, back), turned(straight.right, back))


def _picture_sequence(
    files: Sequence[FrameFiles],
    frame_rate: float | None,
    source_of: Callable[[str], Source] = Path,
    guard: Guard = unguarded,
) -> StereoSequence:
    """Return the frames in separate picture files; they are named by the stems, numbered if these are not unique.

    One frame tells how the true disparities of all are to be read; depth in their place is left out.
    """
    fit, note = _fit_of_truths(files, source_of, guard)
    if fit is not None and fit.is_depth:
        files = [one._replace(truth=None) for one in files]
    divisor = None if fit is None else fit.divisor
    names = [PurePosixPath(one.left.replace("\\", "/")).stem for one in files]
    if len(set(names)) < len(names):
        names = [f"{number:06d}_{name}" for number, name in enumerate(names)]
    return StereoSequence(
        tuple(names),
        frame_rate or USUAL_RATE,
        lambda number: partial(_read_pictures, files[number], source_of, guard, divisor),
        has_truth=any(one.truth is not None for one in files),
        notes=(note,) if note else (),
    )


def _fit_of_truths(
    files: Sequence[FrameFiles], source_of: Callable[[str], Source], guard: Guard
) -> tuple[TruthFit | None, str]:
    """Return how the first true disparity that can be read fits its frame, and a sentence if that is to be said."""
    for one in [one for one in files if one.truth is not None and one.right is not None][:MOST_TRIED]:
        with suppress(ValueError, OSError):  # a damaged frame
            left, right, _ = _read_pictures(one._replace(truth=None), source_of, guard)
            stored = guard(read_stored_disparity)(source_of(one.truth or ""))
            fit = stored_truth_fit(stored, left, right)
            return fit, fit.doubt or divisor_in_words(stored, fit.divisor)
    return None, ""


def _read_pictures(
    names: FrameFiles, source_of: Callable[[str], Source], guard: Guard, divisor: float | None = None
) -> StereoFrame:
    if names.right is None:
        raise ValueError(f"{Path(names.left).name} has no picture of the right camera.")
    left, right = (guard(read_image)(source_of(name)) for name in (names.left, names.right))
    if names.truth is None:
        return StereoFrame(left, right)
    return StereoFrame(left, right, guard(partial(read_disparity, divisor=divisor))(source_of(names.truth)))


def _archived(archive: Path | Archive, name: str) -> bytes:
    """Return a file of an archive, given by its path, which every process opens once, or by its bytes."""
    return (archive if isinstance(archive, Archive) else _opened_once(archive)).read(name)


@lru_cache(maxsize=2)
def _opened_once(path: Path) -> Archive:
    return read_archive(path, max_files=MAX_ARCHIVED)


def _video_sequence(read: Callable[[int], StereoFrame], count: int, frame_rate: float) -> StereoSequence:
    return StereoSequence(
        tuple(f"{number:06d}" for number in range(count)), frame_rate, lambda number: partial(read, number)
    )


def _read_two(left: VideoFile, right: VideoFile, number: int) -> StereoFrame:
    return StereoFrame(left.frame(number), right.frame(number))


def _read_halves(video: VideoFile, layout: Layout, crossed: bool, number: int) -> StereoFrame:
    left, right = views(video.frame(number), layout, crossed=crossed)
    return StereoFrame(np.ascontiguousarray(left), np.ascontiguousarray(right))


def _layout_of(video: VideoFile) -> tuple[Layout, bool]:
    """Return how both views stand in the frames of a video, from its first or its middle one; side by side if unseen.

    Raises
    ------
    Anaglyph
        A video whose views are in its colours.
    """
    for number in {0: None, len(video) // 2: None}:
        try:
            found = likely_layout(video.frame(number))
        except Anaglyph:
            raise
        except (ValueError, OSError):  # a damaged frame
            continue
        if found is not None:
            return found
    return Layout.BESIDE, False


def open_sequence(
    left: Source,
    right: Source | None = None,
    *,
    truth: str | PathLike[str] | None = None,
    frame_rate: float | None = None,
    layout: Layout | None = None,
    guard: Guard = unguarded,
) -> StereoSequence:
    """Open the frames of a stereo camera.

    Parameters
    ----------
    left, right
        Two folders of pictures or patterns of their paths ("drive/left_*.png"); two videos; or `left` alone: a ZIP
        archive of pictures whose folders or names show the side ("left/000.png"), or one video with both pictures, side
        by side or one above the other. Archives and videos may also be given as bytes or binary file objects.
    truth
        A folder or pattern of true disparities, with the names or in the order of the left pictures; an archive
        includes its own.
    frame_rate
        Hz; by default that of the video, or 10 for pictures.
    layout
        How both views stand in the frames of one video, the left one first; by default found from them.
    guard
        :func:`~stereolag.io.guard.guarded` to have the guard decode strangers' files.

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
    video = VideoFile if guard is unguarded else GuardedVideo
    if frame_rate is not None and not MIN_RATE_HZ <= frame_rate <= MAX_RATE_HZ:
        raise ValueError(f"frame_rate is {frame_rate} Hz; allowed are {MIN_RATE_HZ} to {MAX_RATE_HZ} Hz.")
    if right is None:
        sequence = _of_one(left, frame_rate, guard, video, layout)
    elif layout is not None:
        raise ValueError("A layout is that of one video with both views; these are two.")
    elif isinstance(left, str | PathLike) and (Path(left).is_dir() or _ending(Path(left)) not in VIDEO_SUFFIXES):
        lefts, rights = _pictures(left, PICTURE_ENDINGS), _pictures(right, PICTURE_ENDINGS)
        truths = [] if truth is None else _pictures(truth, TRUTH_ENDINGS)
        partners = _partners(lefts, rights, "right pictures")
        known = _partners(lefts, truths, "true disparities") if truths else [None] * len(lefts)
        sequence = _picture_sequence([*map(FrameFiles, lefts, partners, known)], frame_rate)
    else:
        two = video(left), video(right)
        sequence = _video_sequence(partial(_read_two, *two), min(map(len, two)), frame_rate or two[0].frame_rate)
    if len(sequence) > limits().max_frames:
        raise ValueError(f"The sequence has {len(sequence):,} frames; at most {limits().max_frames:,} are accepted.")
    return sequence


open_uploads = partial(open_sequence, guard=guarded)
"""Opens the frames in strangers' files; the guard decodes them."""


def example_sequence(example: DriveExample) -> StereoSequence:
    """Return the frames of a bundled drive, with the true disparity of each."""
    files = zip(example.left, example.right, example.disparity, strict=True)
    return _picture_sequence([FrameFiles(*map(str, one)) for one in files], example.frame_rate)


def _of_one(
    source: Source, frame_rate: float | None, guard: Guard, video: type[VideoFile], layout: Layout | None
) -> StereoSequence:
    path = Path(source).resolve() if isinstance(source, str | PathLike) else None
    if path is not None and path.is_dir():
        raise ValueError(f"{quote(path.name)} is a folder; give two, of the left and of the right pictures.")
    if not is_archive(beginning(source)):
        both = video(source)
        found, crossed = _layout_of(both) if layout is None else (layout, False)
        if found is Layout.BESIDE and (both.width < 2 or both.width % 2):
            raise ValueError(f"The video is {both.width} px wide; two pictures side by side have an even width.")
        return _video_sequence(partial(_read_halves, both, found, crossed), len(both), frame_rate or both.frame_rate)
    if layout is not None:
        raise ValueError("A layout is that of one video with both views; this is an archive.")
    archive = read_archive(source, max_files=MAX_ARCHIVED)
    files = _frames_among(archive.names)
    if not files:
        raise ValueError(f"The archive holds no pictures named left and right; files in it: {len(archive.names):,}.")
    return _picture_sequence(files, frame_rate, partial(_archived, path or archive), guard)


def _frames_among(names: Sequence[str]) -> list[FrameFiles]:
    """Return the frames of one camera among files; with several cameras, by the most reliable naming convention."""
    pairs = matched_pairs(names)
    surest = min((pair.convention for pair in pairs), default=0)
    pairs = [pair for pair in pairs if pair.convention == surest]
    frames = [FrameFiles(pair.left, pair.right, pair.truth) for pair in pairs]
    if frames:
        frames += [FrameFiles(name, None) for name in left_alone(names, pairs, surest)]
    return sorted(frames, key=lambda frame: [natural_order(frame.left), frame.left])


def _pictures(source: Source, endings: frozenset[str]) -> list[str]:
    """Return the paths of the files in a folder or matching a pattern, in natural order."""
    if not isinstance(source, str | PathLike):
        raise ValueError("Pictures are named by a folder or a pattern; give a ZIP archive or videos as bytes.")
    path = Path(source)
    # Path.glob takes no absolute pattern.
    found = path.iterdir() if path.is_dir() else map(Path, glob.glob(str(source)))  # noqa: PTH207
    kept = [one for one in found if _ending(one) in endings and not one.name.startswith(".")]
    if not kept:
        raise ValueError(
            f"There are no pictures at {str(source)!r}; give each side as a folder or a pattern such as 'left/*.png', "
            "or one ZIP archive alone with both sides in it."
        )
    return sorted((str(one.absolute()) for one in kept), key=lambda name: [natural_order(name), name])


def _partners(names: Sequence[str], others: Sequence[str], what: str) -> list[str | None]:
    """Return the partner of each file: the one with its name, with its number, or at its position if neither agree."""
    by_name = {_stem(other): other for other in others}
    found = [by_name.get(_stem(name)) for name in names]
    if any(found):
        return found
    mine, by_number = [_number(name) for name in names], {_number(other): other for other in others}
    if len({*mine}) == len(names) and len(by_number) == len(others) and any(one in by_number for one in mine):
        return [by_number.get(one) for one in mine]
    if len(names) != len(others):
        raise ValueError(
            f"There are {len(names):,} left pictures and {len(others):,} {what}, with other names; either their names "
            "or their number must match."
        )
    return list(others)


def _stem(name: str) -> str:
    return Path(name).stem


def _number(name: str) -> int | None:
    """Return the last number in the name of a file; a lost frame must not shift the others."""
    numbers = re.findall(r"\d+", _stem(name))
    return int(numbers[-1]) if numbers else None


def _ending(path: Path) -> str:
    return path.suffix.removeprefix(".").casefold()
