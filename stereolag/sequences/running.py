"""The job over the frames of a sequence: matching, writing, drawing and reporting; finished frames are kept."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import CancelledError
from contextlib import ExitStack
from pathlib import Path
from typing import BinaryIO

import numpy as np

from stereolag.core.inputs import Image
from stereolag.figures.pictures import as_rgb
from stereolag.geometry.calibration import Calibration
from stereolag.sequences.flicker import flicker, same_picture_size, still_pixels
from stereolag.sequences.folder import SequenceFolder
from stereolag.sequences.matching import PNG, FrameTask, MatchedFrame, finished_frame
from stereolag.sequences.motion import MotionWatch
from stereolag.sequences.records import FrameRecord, damaged_records
from stereolag.sequences.runners import PairRunner, Runner, SteadyRunner, in_order, runner_at
from stereolag.sequences.sources import StereoSequence, Truth
from stereolag.sequences.states import SequenceResult, SequenceState
from stereolag.sequences.steadying import Steadiness
from stereolag.sequences.targets import SequenceTarget
from stereolag.sequences.video import VideoWriter, common_range, panels
from stereolag.stereo.matcher import StereoMatcher

SAMPLED = 5
"""Frames, spread over the sequence, that determine the colour range before the first one is drawn."""


def run_sequence(
    sequence: StereoSequence,
    matchers: StereoMatcher | Mapping[str, StereoMatcher],
    out: str | os.PathLike[str] | SequenceTarget,
    *,
    calibration: Calibration | None = None,
    steadiness: Steadiness | None = None,
    video: str | os.PathLike[str] | BinaryIO | VideoWriter | None = None,
    colours: tuple[float, float] | None = None,
    truth_in_video: bool = False,
    motion: MotionWatch | None = None,
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
    steadiness
        Averages each map with the previous one where they agree: our own methods flicker less; off by default.
    video
        An ".mp4" path or a binary file, for the left pictures beside the maps of every method in one colour range; or a
        video writer, which is left open.
    colours
        The disparities at the ends of the colour range, px; by default chosen from five frames.
    truth_in_video
        Whether the video also shows the true disparity, after the maps.
    motion
        Detects motion; a video then shows the flow last, and moving things are outlined in the left picture.
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
        is not valid for a folder, the video has another ending, or `colours` is not a range.
    OSError
        If `out` cannot be written, or the scheduler cannot be reached.
    """
    named = {type(matchers).short_name: matchers} if isinstance(matchers, StereoMatcher) else dict(matchers)
    with ExitStack() as stack:
        target: SequenceTarget
        if isinstance(out, str | os.PathLike):
            target = SequenceFolder(Path(out), sequence, named, disparity_format, calibration, steadiness, again=again)
        else:
            target = out
        stack.callback(target.close)
        if colours is not None:
            low, high = colours
            if not -math.inf < low < high < math.inf:
                raise ValueError(
                    f"colours are {low:g} and {high:g} px; allowed are two finite numbers, the lower first."
                )
            target.set_colours(colours)
        writer = None
        if isinstance(video, VideoWriter):
            writer = video
        elif video is not None:
            writer = stack.enter_context(VideoWriter(video, sequence.frame_rate, len(sequence)))
        runner = stack.enter_context(runner_at(scheduler))
        job = _Job(
            sequence,
            named,
            target,
            writer,
            runner,
            calibration,
            steadiness,
            disparity_format,
            progress,
            cancelled,
            with_truth=truth_in_video and writer is not None,
            motion=motion,
        )
        return job.run()


class _Job:
    """One run of :func:`run_sequence`."""

    def __init__(
        self,
        sequence: StereoSequence,
        matchers: Mapping[str, StereoMatcher],
        target: SequenceTarget,
        writer: VideoWriter | None,
        runner: PairRunner,
        calibration: Calibration | None,
        steadiness: Steadiness | None,
        suffix: str,
        progress: Callable[[SequenceState], None] | None,
        cancelled: Callable[[], bool] | None,
        *,
        with_truth: bool,
        motion: MotionWatch | None,
    ) -> None:
        self._sequence, self._matchers, self._target, self._writer = sequence, matchers, target, writer
        self._calibration, self._steadiness, self._suffix = calibration, steadiness, suffix
        self._progress, self._cancelled, self._with_truth = progress, cancelled, with_truth
        self._motion = motion
        self._start = time.perf_counter()
        self._missing = [number for number in range(len(sequence)) if number not in target]
        self._done = self._before = len(sequence) - len(self._missing)
        self._runner: Runner = runner if steadiness is None else SteadyRunner(runner, self._missing, self._task)
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
            seen = self._motion.since_before(frame.number, self._look_at)
        if frame.number not in self._target:
            name, moment = self._sequence.names[frame.number], frame.number / self._sequence.frame_rate
            if frame.problem:
                self._damaged[name] = frame.problem
                records = damaged_records(frame.number, name, moment, tuple(self._matchers), frame.problem)
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
                if self._with_truth:
                    disparities.append(_truth_of(frame, frame.left))
                left, more = as_rgb(frame.left), []
                if self._motion is not None:
                    left, flow = self._motion.drawn(frame.left, seen)
                    more = [flow]
                self._writer.write(panels(left, disparities, self._target.colours, more=more))
        self._last = frame
        self._look()

    def _flicker(self, frame: MatchedFrame) -> dict[str, float]:
        unknown = dict.fromkeys(self._matchers, math.nan)
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
        return FrameTask(
            number,
            self._sequence.reader(number),
            self._matchers,
            self._suffix,
            self._calibration,
            in_colour=self._writer is not None,
            steadiness=self._steadiness,
            with_truth=self._with_truth,
        )

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
