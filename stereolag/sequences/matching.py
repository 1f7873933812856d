"""Processing of one frame of a sequence, from its files to the bytes of its maps, the same wherever it runs."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from stereolag.core.arrays import FloatMap
from stereolag.core.inputs import Image, as_grey
from stereolag.core.jobs import Progress
from stereolag.geometry.calibration import Calibration
from stereolag.io.disparities import DISPARITY_FORMATS, KITTI_SCALE, read_stored_disparity
from stereolag.io.sources import Source
from stereolag.sequences.records import FrameFigures, figures_of
from stereolag.sequences.sources import FrameReader, Truth
from stereolag.sequences.steadying import Motion, Steadiness, motion_since, steadied
from stereolag.stereo.matcher import DisparityMap, StereoMatcher

PNG = ".png"


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
    """How the previous frame is used."""
    with_truth: bool = False
    """Whether the true disparity is returned too."""


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
        The figures computed from this frame alone.
    """

    disparity: FloatMap
    data: bytes
    figures: FrameFigures

    def __reduce__(self) -> tuple[Any, ...]:
        # Only the file is sent between machines: it is a fourth of the map's size.
        return _from_file, (self.data, self.figures)


@dataclass(frozen=True, eq=False)
class MatchedFrame:
    """One frame after matching.

    Attributes
    ----------
    number
        The number of the frame.
    left
        The left picture; None for a damaged frame.
    maps
        The maps, by name of the method.
    problem
        Why there are no maps, in one sentence; "" if there are.
    truth
        The true disparity, px, if requested and known.
    """

    number: int
    left: Image | None = None
    maps: Mapping[str, FrameMap] = field(default_factory=dict)
    problem: str = ""
    truth: Truth | None = None


@dataclass(frozen=True, eq=False)
class FrameMaps:
    """The maps of one frame by itself, which the next frame may use.

    Attributes
    ----------
    left
        The left picture; None for a damaged frame.
    truth
        The true disparity if known, px.
    maps
        The maps, by name of the method.
    problem
        Why there are no maps; "" if there are.
    """

    left: Image | None = None
    truth: Truth | None = None
    maps: Mapping[str, DisparityMap] = field(default_factory=dict)
    problem: str = ""


def matched_frame(task: FrameTask, progress: Progress | None = None) -> MatchedFrame:
    """Read, match and encode one frame by itself; a damaged or rejected frame is reported in the result, not raised.

    `progress` may raise to end the work early: its exception propagates, unless it is a ``ValueError`` or ``OSError``.
    """
    return encoded_frame(task, match_frame(task, progress))


def match_frame(task: FrameTask, progress: Progress | None = None) -> FrameMaps:
    """Read and match one frame, as :func:`matched_frame` does."""
    try:
        frame = task.reader()
        maps = {}
        for name, matcher in task.matchers.items():
            result = matcher.compute(frame.left, frame.right, progress=progress)
            # Scores and vertical displacements are not needed here, and would be sent between machines.
            maps[name] = replace(result, _score=None, _dy=None)
    except (ValueError, OSError) as error:
        return FrameMaps(problem=_in_one_line(error))
    return FrameMaps(frame.left, frame.truth, maps)


def encoded_frame(task: FrameTask, own: FrameMaps, before: FrameMaps | None = None) -> MatchedFrame:
    """Encode and measure the maps of a frame, steadied by those of the previous frame if given."""
    if own.left is None:
        return MatchedFrame(task.number, problem=own.problem)
    start = time.perf_counter()
    motion = None
    if task.steadiness is not None and before is not None and before.left is not None:
        motion = motion_since(before.left, own.left)
    moved_s = time.perf_counter() - start
    maps = {}
    try:
        for name, one in own.maps.items():
            result = one
            if motion is not None and task.steadiness is not None and before is not None:
                result = _steady(one, before.maps[name], motion, task.steadiness, moved_s)
            data = DISPARITY_FORMATS[task.suffix].write(result.disparity)
            figures = figures_of(result, own.truth, task.calibration)
            maps[name] = FrameMap(as_stored(result.disparity, task.suffix), data, figures)
    except ValueError as error:
        return MatchedFrame(task.number, problem=_in_one_line(error))
    return _handed_back(task, own.left, own.truth, maps)


def finished_frame(task: FrameTask, files: Mapping[str, Source]) -> MatchedFrame:
    """Read a frame whose maps have been written, as :func:`matched_frame` would return it, but without figures."""
    try:
        frame = task.reader()
        maps = {name: FrameMap(read_back(file), b"", FrameFigures()) for name, file in files.items()}
    except (ValueError, OSError) as error:
        return MatchedFrame(task.number, problem=_in_one_line(error))
    return _handed_back(task, frame.left, frame.truth, maps)


def _handed_back(task: FrameTask, left: Image, truth: Truth | None, maps: Mapping[str, FrameMap]) -> MatchedFrame:
    shown = left if task.in_colour else as_grey(left)
    return MatchedFrame(task.number, shown, maps, truth=truth if task.with_truth else None)


def as_stored(disparity: FloatMap, suffix: str) -> FloatMap:
    """Return a map as stored in its file, so that frame-to-frame figures do not depend on whether it was read back."""
    if suffix != PNG:
        return disparity
    scaled = np.rint(disparity * np.float32(KITTI_SCALE))
    return np.asarray(np.maximum(scaled, np.float32(1)) / np.float32(KITTI_SCALE))  # NaN stays NaN


def read_back(file: Source) -> FloatMap:
    """Return the map in a file of a sequence; unlike a ground truth, it may have no disparity at all."""
    found = read_stored_disparity(file)
    known = found.stored.any() if found.zero_is_unknown else np.isfinite(found.stored).any()
    if not known:
        return np.full(found.stored.shape, np.nan, np.float32)
    return found.divided(found.divisor or 1.0)


def _steady(
    now: DisparityMap, before: DisparityMap, motion: Motion, settings: Steadiness, moved_s: float
) -> DisparityMap:
    """Return the steadied map, with the time for steadying added."""
    start = time.perf_counter()
    disparity = steadied(before, now, motion, settings)
    elapsed = now.elapsed_s + moved_s + time.perf_counter() - start
    return replace(now, disparity=disparity, elapsed_s=elapsed)


def _from_file(data: bytes, figures: FrameFigures) -> FrameMap:
    return FrameMap(read_back(data), data, figures)


def _in_one_line(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror:
        return f"{Path(error.filename).name}: {error.strerror}." if error.filename else f"{error.strerror}."
    return " ".join(str(error).split())
