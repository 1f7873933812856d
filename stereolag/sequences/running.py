"""The job over the frames of a sequence: matching, writing, drawing and reporting; finished frames are kept."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import CancelledError
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import BinaryIO

import numpy as np

from stereolag.core.inputs import Image
from stereolag.figures.pictures import as_rgb
from stereolag.geometry.calibration import Calibration
from stereolag.sequences.matching import PNG, FrameTask, MatchedFrame, finished_frame
from stereolag.sequences.motion import MotionWatch, SequenceSettings
from stereolag.sequences.records import FrameRecord, damaged_records
from stereolag.sequences.runners import PairRunner, Runner, SteadyRunner, in_order, runner_at
from stereolag.sequences.sources import StereoSequence, Truth
from stereolag.sequences.steadying import flicker, same_picture_size, still_pixels
from stereolag.sequences.targets import SequenceFolder, SequenceTarget
from stereolag.sequences.video import SequenceVideo, VideoWriter, common_range, panels
from stereolag.stereo.matcher import StereoMatcher


@dataclass(frozen=True)
class SequenceState:
    """The progress of a job.

    Attributes
    ----------
    done, total
        Numbers of frames; those finished by an earlier job count as done.
    damaged
        Number of them without a map.
    elapsed_s, remaining_s
        Seconds; `remaining_s` is NaN until the first frame is done.
    """

    done: int
    total: int
    damaged: int
    elapsed_s: float
    remaining_s: float


@dataclass(frozen=True)
class SequenceResult:
    """The result of a job.

    Attributes
    ----------
    total
        Number of frames in the sequence.
    matched, finished_before
        Numbers of frames matched by this job, and finished by an earlier one.
    damaged
        {name of the frame: why there is no map}.
    cancelled
        Whether it was cancelled before its end; running it again resumes the work.
    elapsed_s
        Elapsed time, s.
    """

    total: int
    matched: int
    finished_before: int
    damaged: Mapping[str, str]
    cancelled: bool
    elapsed_s: float


SAMPLED = 5
"""Frames, spread over the sequence, that determine the colour range before the first one is drawn."""


def run_sequence(
    sequence: StereoSequence,
    matchers: StereoMatcher | Mapping[str, StereoMatcher],
    out: str | os.PathLike[str] | SequenceTarget,
    *,
    calibration: Calibration | None = None,
    settings: SequenceSettings | None = None,
    video: str | os.PathLike[str] | BinaryIO | SequenceVideo | None = None,
    disparity_format: str = PNG,
    scheduler: str | None = None,
    again: bool = False,
    progress: Callable[[SequenceState], None] | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> SequenceResult:
    """Match every frame of a sequence and write its maps, a table of figures and, if wanted, a video.

    Parameters
    ----------
    sequence
        From :func:`stereolag.sequences.open_sequence`.
    matchers
        One, or several by the names of their folders.
    out
        The output folder, for ``METHOD/FRAME.png`` (disparity × 256 in 16 bits, as in KITTI), ``frames.csv``
        (:class:`~stereolag.sequences.records.FrameRecord`) and ``sequence.json``. Frames already finished there are not
        matched again. Or a :class:`~stereolag.sequences.targets.SequenceTarget`, which keeps them elsewhere.
    calibration
        Provides the distance of the nearest obstacle in metres.
    settings
        Steadying by the previous frame, and motion: a video then shows the flow last, and moving things are outlined in
        the left picture. Both are off by default.
    video
        An ".mp4" path or a binary file, for the left pictures beside the maps of every method in one colour range; or a
        :class:`~stereolag.sequences.video.SequenceVideo`, which says more.
    disparity_format
        ``".png"``, or ``".pfm"`` or ``".npy"``, which can store any disparity.
    scheduler
        The address of a Dask scheduler, ``"tcp://host:8786"``; ``"local"`` for processes on this machine; None for
        threads of this process. The maps are identical bit for bit.
    again
        Match everything again, even if `out` was made with other settings.
    progress
        Called with the state of the job ten times a second.
    cancelled
        Called as often; once it returns True the job ends within a second, and finished frames are kept.

    Returns
    -------
    SequenceResult
        Damaged frames are left out and listed here.

    Raises
    ------
    ValueError
        If `out` was made with other settings, frames or version, a search range does not fit the files, a method's name
        is not valid for a folder, or the video has another ending.
    OSError
        If `out` cannot be written, or the scheduler cannot be reached.
    """
    named = {type(matchers).short_name: matchers} if isinstance(matchers, StereoMatcher) else dict(matchers)
    settings = settings or SequenceSettings()
    if video is not None and not isinstance(video, SequenceVideo):
        video = SequenceVideo(video)
    with ExitStack() as stack:
        target: SequenceTarget
        if isinstance(out, str | os.PathLike):
            target = SequenceFolder(
                Path(out), sequence, named, disparity_format, calibration, settings.steadiness, again=again
            )
        else:
            target = out
        stack.callback(target.close)
        writer = None
        if video is not None:
            if video.colours is not None:
                target.set_colours(video.colours)
            writer = (
                video.file
                if isinstance(video.file, VideoWriter)
                else stack.enter_context(VideoWriter(video.file, sequence.frame_rate, len(sequence)))
            )
        watch = None
        if settings.motion is not None:
            method = next(iter(named.values()))
            watch = MotionWatch(sequence, method, calibration, settings.motion, target.largest_motion)
        task = FrameTask(
            0,
            partial(sequence.frame, 0),
            named,
            disparity_format,
            calibration,
            in_colour=writer is not None,
            steadiness=settings.steadiness,
            with_truth=video is not None and video.with_truth,
        )
        runner = stack.enter_context(runner_at(scheduler))
        return _Job(sequence, task, target, writer, watch, runner, progress, cancelled).run()


class _Job:
    """One run of :func:`run_sequence`; `task` is the work on a frame but for its number and reader."""

    def __init__(
        self,
        sequence: StereoSequence,
        task: FrameTask,
        target: SequenceTarget,
        writer: VideoWriter | None,
        watch: MotionWatch | None,
        runner: PairRunner,
        progress: Callable[[SequenceState], None] | None,
        cancelled: Callable[[], bool] | None,
    ) -> None:
        self._sequence, self._each, self._target, self._writer, self._motion = sequence, task, target, writer, watch
        self._progress, self._cancelled = progress, cancelled
        self._start = time.perf_counter()
        self._missing = [number for number in range(len(sequence)) if number not in target]
        self._done = self._before = len(sequence) - len(self._missing)
        self._runner: Runner = runner if task.steadiness is None else SteadyRunner(runner, self._missing, self._task)
        self._matched, self._damaged = 0, dict[str, str]()
        self._last: MatchedFrame | None = None

    def run(self) -> SequenceResult:
        """Process all frames in order."""
        ended = False
        try:
            for frame in self._frames():
                self._take(frame)
        except CancelledError:
            ended = True
        elapsed = time.perf_counter() - self._start
        return SequenceResult(
            len(self._sequence), self._matched, self._before, self._damaged, cancelled=ended, elapsed_s=elapsed
        )

    def _frames(self) -> Iterator[MatchedFrame]:
        """Yield every frame to match, and finished ones that the video or the motion needs."""
        sampled: dict[int, MatchedFrame] = {}
        if self._writer is not None and self._target.colours is None:
            numbers = _spread(self._missing or range(len(self._sequence)), SAMPLED)
            tasks = map(self._task, numbers)
            found = in_order(self._runner, tasks, self._look) if self._missing else map(self._read_back, numbers)
            sampled = {frame.number: frame for frame in found}
            self._target.set_colours(
                common_range([one.disparity for frame in sampled.values() for one in frame.maps.values()])
            )
        missing = set(self._missing)
        others = [number for number in self._missing if number not in sampled]
        coming = in_order(self._runner, map(self._task, others), self._look)
        for number in range(len(self._sequence)):
            self._look()
            if number in missing:
                yield sampled.pop(number) if number in sampled else next(coming)
            elif self._writer is not None or (self._motion is not None and self._target.lacks_motion(number)):
                yield self._read_back(number)

    def _take(self, frame: MatchedFrame) -> None:
        """Write a frame if it is new, and draw it."""
        seen = None
        if self._motion is not None and not frame.problem:
            self._motion.lock_colours(self._look_at)
            self._target.largest_motion = self._motion.largest
            seen = self._motion.since_before(frame.number, self._look_at)
        if frame.number not in self._target:
            name, moment = self._sequence.names[frame.number], frame.number / self._sequence.frame_rate
            if frame.problem:
                self._damaged[name] = frame.problem
                records = damaged_records(frame.number, name, moment, tuple(self._each.matchers), frame.problem)
            else:
                changes = self._flicker(frame)
                records = [
                    FrameRecord(frame.number, name, moment, method, flicker_px=changes[method], **one.figures._asdict())
                    for method, one in frame.maps.items()
                ]
                if self._motion is not None and seen is not None:
                    records.append(self._motion.record(frame.number, seen))
            self._target.write(frame, records)
            self._matched += not frame.problem
            self._done += 1
        elif self._motion is not None and seen is not None:
            self._target.add([self._motion.record(frame.number, seen)])
        if self._writer is not None:
            if frame.left is None or self._target.colours is None:
                self._writer.write_blank()
            else:
                disparities = [one.disparity for one in frame.maps.values()]
                if self._each.with_truth:
                    disparities.append(_truth_of(frame, frame.left))
                left, more = as_rgb(frame.left), []
                if self._motion is not None:
                    left, flow = self._motion.drawn(frame.left, seen)
                    more = [flow]
                self._writer.write(panels(left, disparities, self._target.colours, more=more))
        self._last = frame
        self._look()

    def _flicker(self, frame: MatchedFrame) -> dict[str, float]:
        unknown = dict.fromkeys(self._each.matchers, math.nan)
        before = self._last
        if frame.number == 0:
            return unknown
        if before is None or before.number != frame.number - 1:
            if frame.number - 1 not in self._target:
                return unknown
            before = self._read_back(frame.number - 1)
        if frame.left is None or before.left is None or not same_picture_size(before.left, frame.left):
            return unknown
        still = still_pixels(before.left, frame.left)
        return {
            method: flicker(before.maps[method].disparity, one.disparity, still) for method, one in frame.maps.items()
        }

    def _read_back(self, number: int) -> MatchedFrame:
        return finished_frame(self._task(number), self._target.files(number))

    def _task(self, number: int) -> FrameTask:
        return self._each._replace(number=number, reader=self._sequence.reader(number))

    def _look_at(self, fraction: float) -> None:
        self._look()

    def _look(self) -> None:
        """Report the progress; raise CancelledError if the job was cancelled."""
        if self._cancelled is not None and self._cancelled():
            raise CancelledError
        if self._progress is not None:
            elapsed, new = time.perf_counter() - self._start, self._done - self._before
            left = len(self._sequence) - self._done
            remaining = elapsed / new * left if new else math.nan
            self._progress(SequenceState(self._done, len(self._sequence), len(self._damaged), elapsed, remaining))


def _truth_of(frame: MatchedFrame, left: Image) -> Truth:
    rows, cols = left.shape[:2]
    if frame.truth is None or frame.truth.shape != (rows, cols):
        return np.full((rows, cols), np.nan, np.float32)
    return frame.truth


def _spread(numbers: list[int] | range, count: int) -> list[int]:
    """Return at most `count` of the numbers, from the first to the last, as evenly spaced as possible."""
    if len(numbers) <= count:
        return list(numbers)
    return [numbers[round(place * (len(numbers) - 1) / (count - 1))] for place in range(count)]
