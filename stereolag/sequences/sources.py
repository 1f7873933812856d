"""Frames of a stereo camera in folders, archives and videos, from which any process can read a frame by number."""

from __future__ import annotations

import glob
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from os import PathLike
from pathlib import Path, PurePosixPath
from typing import NamedTuple, TypeAlias

import numpy as np

from stereolag.assess.findings import Finding
from stereolag.assess.layout import Layout, likely_layout, views
from stereolag.core.arrays import FloatMap, Vector
from stereolag.core.inputs import Image
from stereolag.core.jobs import limits
from stereolag.geometry.calibration import Calibration
from stereolag.geometry.rectification import rectify, turned
from stereolag.io.clocks import at_one_rate
from stereolag.io.disparities import DISPARITY_SUFFIXES, read_disparity, read_stored_disparity
from stereolag.io.ground_truth import TruthFit, divisor_in_words, stored_truth_fit
from stereolag.io.guard import Guard, guarded, unguarded
from stereolag.io.images import IMAGE_SUFFIXES, read_image
from stereolag.io.pairing import matched_pairs, natural_order, pictures_by_side, suffix_of, unpaired_left
from stereolag.io.recordings import read_signal
from stereolag.io.sources import Archive, Source, beginning, is_archive, read_archive
from stereolag.io.videos import GAP_RATIO, MAX_RATE_HZ, MIN_RATE_HZ, VIDEO_SUFFIXES, GuardedVideo, VideoFile
from stereolag.samples import DriveExample
from stereolag.sequences.partners import clock_in_names, partners_by_name, partners_of_frames, same_rate
from stereolag.signals import signal_lag

MAX_FRAMES_TRIED = 10
"""Largest number of frames tried to find one whose true disparity can be read."""

MAX_SOUND_ERROR_S = 0.1
"""Largest lag between the sounds of two videos that begin together, s: by EBU R37, each may be 0.04 s early to 0.06 s
late."""

MAX_ARCHIVED_FILES = 20_000
"""Largest number of files in an archive of frames."""


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
        Quarters, counter-clockwise, by which the pictures of cameras one above the other are turned for the matching;
        their maps are turned back.
    findings
        Problems that the input doctor finds with the frames, for their table.
    notes
        Sentences about the frames: how two videos are paired, how true disparities are read, or why these may be wrong.
    intervals
        Times of the frames after the first, in intervals of the frame rate; None: whole numbers, without gaps.
    """

    names: tuple[str, ...]
    frame_rate: float
    reader: Callable[[int], FrameReader]
    has_truth: bool = False
    rectified: bool = False
    turn: int = 0
    findings: tuple[Finding, ...] = ()
    notes: tuple[str, ...] = ()
    intervals: Vector | None = None

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.names)

    def time_s(self, number: int) -> float:
        """Return the time of a frame, s after the first."""
        return float(number if self.intervals is None else self.intervals[number]) / self.frame_rate

    def intervals_before(self, number: int) -> float:
        """Return the time since the previous frame in usual intervals: 1, or more where frames were dropped."""
        intervals = (self.time_s(number) - self.time_s(number - 1)) * self.frame_rate
        return intervals if intervals > GAP_RATIO else 1.0

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

    def first_readable(self, max_tried: int | None = None) -> StereoFrame | None:
        """Return the first undamaged frame, among the first `max_tried` if given; None if all are damaged."""
        return next(filter(None, map(self.readable, range(len(self))[:max_tried])), None)


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
    rectified = rectify(raw.left, raw.right, calibration, alpha=alpha)
    turn_back = 0 if calibration.rig is None else -calibration.rig.turn
    return StereoFrame(turned(rectified.left, turn_back), turned(rectified.right, turn_back))


def _picture_sequence(
    files: Sequence[FrameFiles],
    frame_rate: float | None,
    source_of: Callable[[str], Source] = Path,
    guard: Guard = unguarded,
) -> StereoSequence:
    """Return the frames in separate picture files.

    How the true disparities of all frames are read follows from one of them; files of depth instead are ignored.
    """
    fit, note = _fit_of_truths(files, source_of, guard)
    if fit is not None and fit.is_depth:
        files = [one._replace(truth=None) for one in files]
    divisor = None if fit is None else fit.divisor
    lefts = [one.left for one in files]
    own_rate, intervals = clock_in_names(lefts)
    return StereoSequence(
        _frame_names(lefts),
        frame_rate or own_rate,
        lambda number: partial(_read_pictures, files[number], source_of, guard, divisor),
        has_truth=any(one.truth is not None for one in files),
        notes=(note,) if note else (),
        intervals=intervals,
    )


def _fit_of_truths(
    files: Sequence[FrameFiles], source_of: Callable[[str], Source], guard: Guard
) -> tuple[TruthFit | None, str]:
    """Return how the first readable true disparity fits its frame, and a sentence about it, or ""."""
    for one in [one for one in files if one.truth is not None and one.right is not None][:MAX_FRAMES_TRIED]:
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
    left, right = (_read_picture(name, source_of, guard) for name in (names.left, names.right))
    read_truth = guard(partial(read_disparity, divisor=divisor))
    return StereoFrame(left, right, None if names.truth is None else read_truth(source_of(names.truth)))


def _archived(archive: Path | Archive, name: str) -> bytes:
    """Return a file of an archive; one given by its path is opened once in each process."""
    return (archive if isinstance(archive, Archive) else _opened_once(archive)).read(name)


@lru_cache(maxsize=2)
def _opened_once(path: Path) -> Archive:
    return read_archive(path, max_files=MAX_ARCHIVED_FILES)


def _two_videos(left: VideoFile, right: VideoFile, frame_rate: float | None, guard: Guard) -> StereoSequence:
    """Return the frames of two videos that are shown at the same time."""
    rates = left.frame_rate, right.frame_rate
    late_s = _late_s(left, right, guard)
    is_late = 2 * abs(late_s) * min(rates) > 1  # half a frame
    clocks = left.times_s, right.times_s + late_s * is_late
    frames = partners_of_frames(*clocks)
    if not frames:
        raise ValueError(
            f"The videos have no moment in common: the right one begins {late_s:+,.2f} s after the left one."
        )
    times_s = np.array([clocks[1][other] if one is None else clocks[0][one] for one, other in frames])
    clock = "the clock of their file" if left.source == right.source else "their sound"
    notes = {
        f"By {clock}, the right video begins {abs(late_s):.2f} s {'after' if late_s > 0 else 'before'} the left one: "
        "frames are paired accordingly.": is_late,
        f"The videos have {rates[0]:.4g} and {rates[1]:.4g} frames a second. Each frame of the slower one is paired "
        f"with the nearest in time{'' if is_late else ', both counted from the beginning'}.": not same_rate(*rates),
    }
    return StereoSequence(
        _numbered(len(frames)),
        frame_rate or min(rates),
        lambda number: partial(_read_two, left, right, number, *frames[number]),
        notes=tuple(note for note, applies in notes.items() if applies),
        intervals=(times_s - times_s[0]) * min(rates),
    )


def _late_s(left: VideoFile, right: VideoFile, guard: Guard) -> float:
    """Return the time from the first frame of the left video to that of the right one, s.

    Two tracks of one file have its clock; of two files, the lag between their sounds tells it. 0 if that is not sure,
    or so small that cameras with a shared trigger may record it.
    """
    late_s = right.start_s - left.start_s
    if left.source == right.source:
        return late_s
    with suppress(ValueError):  # no sound, or none that can be read
        found = signal_lag(*at_one_rate(*(guard(read_signal)(one.source).channel(1) for one in (left, right))))
        late_s -= found.lag_subsample / found.sampling_rate
        if found.verdict == "sure" and abs(late_s) > MAX_SOUND_ERROR_S:
            return late_s
    return 0.0


def _read_two(left: VideoFile, right: VideoFile, number: int, of_left: int | None, of_right: int | None) -> StereoFrame:
    if of_left is None or of_right is None:
        side = "left" if of_left is None else "right"
        raise ValueError(f"The {side} video has no frame at the time of frame {number}.")
    return StereoFrame(left.frame(of_left), right.frame(of_right))


def _frame_names(paths: Sequence[str]) -> tuple[str, ...]:
    """Return the stems of pictures, numbered if they are not unique."""
    names = [PurePosixPath(path.replace("\\", "/")).stem for path in paths]
    if len(set(names)) < len(names):
        names = [f"{number:06d}_{name}" for number, name in enumerate(names)]
    return tuple(names)


def _numbered(count: int) -> tuple[str, ...]:
    return tuple(f"{number:06d}" for number in range(count))


def _read_both_views(read: Callable[[], Image], layout: Layout, crossed: bool) -> StereoFrame:
    left, right = views(read(), layout, crossed=crossed)
    return StereoFrame(np.ascontiguousarray(left), np.ascontiguousarray(right))


def _layout_of(pictures: Iterable[Callable[[], Image]]) -> tuple[Layout, bool] | None:
    """Return the layout of both views, and whether they are crossed, from the first picture that shows it; else None.

    Raises
    ------
    Anaglyph
        If the views are the colours of an anaglyph.
    """
    for read in pictures:
        try:
            picture = read()
        except (ValueError, OSError):  # a damaged frame
            continue
        if found := likely_layout(picture):
            return found
    return None


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
        Two folders of pictures or patterns of their paths ("drive/left_*.png"); two videos; or `left` alone: a folder
        or ZIP archive of pictures whose folders or names show the side ("left/000.png"), or which have both views in
        each, or one video of both views. Archives and videos may also be given as bytes or binary file objects.
    truth
        A folder or pattern of true disparities, with the names or in the order of the left pictures; an archive
        includes its own.
    frame_rate
        Hz; by default that of the slower video; of pictures, that of Unix times in their names, or 10.
    layout
        Layout of both views in each picture or frame, the left one first; by default found from the pictures.
    guard
        :func:`~stereolag.io.guard.guarded` to decode untrusted files in the guard process.

    Returns
    -------
    StereoSequence
        Pictures with the same name are paired; otherwise those whose names have the same number, or nearly the same
        time; otherwise all in the order of their names. Frames of two videos, or of the two tracks of one, are paired
        by their times; two videos count from their beginnings, unless the lag of their sounds is sure and above 0.1 s.
        A left picture without a right one counts as a damaged frame.

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
        sequence = _open_one(left, frame_rate, guard, video, layout)
    elif layout is not None:
        raise ValueError("A layout is that of frames with both views; these are two files.")
    elif (
        isinstance(left, str | PathLike)
        and (Path(left).is_dir() or suffix_of(str(left)) not in VIDEO_SUFFIXES)
        and (not Path(left).is_file() or suffix_of(str(left)) in {*IMAGE_SUFFIXES, "zip"})  # a video by its content
    ):
        lefts, rights = _pictures(left, IMAGE_SUFFIXES), _pictures(right, IMAGE_SUFFIXES)
        truths = [] if truth is None else _pictures(truth, DISPARITY_SUFFIXES)
        partners = partners_by_name(lefts, rights, "right pictures")
        known = partners_by_name(lefts, truths, "true disparities") if truths else [None] * len(lefts)
        sequence = _picture_sequence([*map(FrameFiles, lefts, partners, known)], frame_rate)
    else:
        sequence = _two_videos(video(left), video(right), frame_rate, guard)
    if len(sequence) > limits().max_frames:
        raise ValueError(f"The sequence has {len(sequence):,} frames; at most {limits().max_frames:,} are accepted.")
    return sequence


open_uploads = partial(open_sequence, guard=guarded)
"""Opens the frames in strangers' files; the guard decodes them."""


def example_sequence(example: DriveExample) -> StereoSequence:
    """Return the frames of a bundled drive, with the true disparity of each."""
    files = zip(example.left, example.right, example.disparity, strict=True)
    return _picture_sequence([FrameFiles(*map(str, one)) for one in files], example.frame_rate)


def _open_one(
    source: Source, frame_rate: float | None, guard: Guard, video: type[VideoFile], layout: Layout | None
) -> StereoSequence:
    path = Path(source).absolute() if isinstance(source, str | PathLike) else None
    if path is not None and (path.is_dir() or (glob.has_magic(str(path)) and not path.exists())):
        names = sorted(_below(path) if path.is_dir() else _pictures(path, IMAGE_SUFFIXES), key=natural_order)
        return _of_files(names, frame_rate, path.joinpath, guard, layout)
    if is_archive(beginning(source)):
        archive = read_archive(source, max_files=MAX_ARCHIVED_FILES)
        return _of_files(archive.names, frame_rate, partial(_archived, path or archive), guard, layout)
    both = video(source)
    if both.tracks == 2 and layout is None:
        return _two_videos(both, video(both.source, track=1), frame_rate, guard)
    shown = (partial(both.frame, number) for number in sorted({0, len(both) // 2, len(both) - 1}))
    found, crossed = (layout, False) if layout else _layout_of(shown) or (Layout.BESIDE, False)
    return StereoSequence(
        _numbered(len(both)),
        frame_rate or both.frame_rate,
        lambda number: partial(_read_both_views, partial(both.frame, number), found, crossed),
        intervals=both.times_s * both.frame_rate,
    )


def _of_files(
    names: Sequence[str],
    frame_rate: float | None,
    source_of: Callable[[str], Source],
    guard: Guard,
    layout: Layout | None,
) -> StereoSequence:
    """Return the frames in the pictures of a folder or an archive: pairs by their names, or both views in each."""
    if layout is None and (files := _frames_among(names)):
        return _picture_sequence(files, frame_rate, source_of, guard)
    pictures = [name for name in names if suffix_of(name) in IMAGE_SUFFIXES]
    shown = (partial(_read_picture, name, source_of, guard) for name in pictures[:: max(1, len(pictures) // 2)])
    both = (layout, False) if layout and pictures else _layout_of(shown)
    if both is None:
        raise ValueError(
            f"There are no pictures named left and right, nor any with both views in it; files there: {len(names):,}."
        )
    own_rate, intervals = clock_in_names(pictures)
    return StereoSequence(
        _frame_names(pictures),
        frame_rate or own_rate,
        lambda number: partial(_read_both_views, partial(_read_picture, pictures[number], source_of, guard), *both),
        intervals=intervals,
    )


def _read_picture(name: str, source_of: Callable[[str], Source], guard: Guard) -> Image:
    return guard(read_image)(source_of(name))


def _below(folder: Path) -> list[str]:
    """Return the paths of all files in a folder and below it, relative to it."""
    return [one.relative_to(folder).as_posix() for one in folder.rglob("*") if one.is_file() and one.name[0] != "."]


def _frames_among(names: Sequence[str]) -> list[FrameFiles]:
    """Return the frames of one camera among files; with several cameras, by the most reliable naming convention."""
    pairs = matched_pairs(names)
    most_reliable = min((pair.convention for pair in pairs), default=0)
    pairs = [pair for pair in pairs if pair.convention == most_reliable]
    left, right = pictures_by_side(names)
    if 2 * len(pairs) < min(len(left), len(right)):  # the names of the pictures differ, too
        return [*map(FrameFiles, left, partners_by_name(left, right, "right pictures"))]
    frames = [FrameFiles(pair.left, pair.right, pair.truth) for pair in pairs]
    if frames:
        frames += [FrameFiles(name, None) for name in unpaired_left(names, pairs, most_reliable)]
    return sorted(frames, key=lambda frame: [natural_order(frame.left), frame.left])


def _pictures(source: Source, endings: Sequence[str]) -> list[str]:
    """Return the paths of the files in a folder or matching a pattern, in natural order."""
    if not isinstance(source, str | PathLike):
        raise ValueError("Pictures are named by a folder or a pattern; give a ZIP archive or videos as bytes.")
    path = Path(source)
    # Path.glob takes no absolute pattern.
    found = path.iterdir() if path.is_dir() else map(Path, glob.glob(str(source)))  # noqa: PTH207
    kept = [one for one in found if suffix_of(one.name) in endings and not one.name.startswith(".")]
    if not kept:
        raise ValueError(
            f"There are no pictures at {str(source)!r}; give each side as a folder or a pattern such as 'left/*.png', "
            "or one ZIP archive alone with both sides in it."
        )
    return sorted((str(one.absolute()) for one in kept), key=lambda name: [natural_order(name), name])
