"""Opening of frame sequences given as folders, patterns, an archive or videos."""

from __future__ import annotations

import glob
from collections.abc import Sequence
from os import PathLike
from pathlib import Path, PurePosixPath

from stereolag.core.jobs import limits
from stereolag.io.archives import is_archive, read_archive
from stereolag.io.pairing import PICTURE_ENDINGS, TRUTH_ENDINGS, left_alone, matched_pairs, natural_order
from stereolag.io.sources import Source, quoted
from stereolag.io.videos import LEAST_RATE, MOST_RATE, VIDEO_ENDINGS, VideoFile
from stereolag.samples import DriveExample
from stereolag.sequences.sources import (
    MAX_ARCHIVED,
    USUAL_RATE,
    ArchivedPictures,
    FrameFiles,
    PictureFiles,
    SideBySideVideo,
    StereoSequence,
    TwoVideos,
)

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
    if frame_rate is not None and not LEAST_RATE <= frame_rate <= MOST_RATE:
        raise ValueError(f"frame_rate is {frame_rate} Hz; allowed are {LEAST_RATE} to {MOST_RATE} Hz.")
    if right is None:
        sequence = _of_one(left, frame_rate)
    elif _holds_video(left):
        sequence = TwoVideos(VideoFile(left), VideoFile(right), frame_rate)
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


def _of_one(source: Source, frame_rate: float | None) -> StereoSequence:
    path = Path(source).resolve() if isinstance(source, str | PathLike) else None
    if path is not None and path.is_dir():
        raise ValueError(f"{quoted(path.name)} is a folder; give two, of the left and of the right pictures.")
    if not is_archive(_beginning(source)):
        return SideBySideVideo(VideoFile(source), frame_rate)
    archive = read_archive(source, max_files=MAX_ARCHIVED)
    files = tuple(_frames_among(archive.names))
    if not files:
        raise ValueError(f"The archive of {len(archive.names):,} files holds no pictures named left and right.")
    return ArchivedPictures(_frame_names([one.left for one in files]), files, path or archive, frame_rate or USUAL_RATE)


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
