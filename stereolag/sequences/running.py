"""The job over the frames of a sequence, on threads or a Dask cluster: matching, writing, drawing and reporting."""

from __future__ import annotations

import math
import os
import signal
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError, Future
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from functools import cache, partial
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO, TypeAlias

import numpy as np

from stereolag.core.arrays import Rgb
from stereolag.figures.pictures import as_rgb, disparity_range
from stereolag.geometry.calibration import Calibration
from stereolag.loops.bands import available_cores, lone_threads
from stereolag.sequences.frames import (
    MOTION,
    PNG,
    FrameMap,
    FrameRecord,
    FrameTask,
    MatchedFrame,
    SequenceFolder,
    SequenceTarget,
    encoded_frame,
    finished_frame,
    match_frame,
)
from stereolag.sequences.motion import (
    SAMPLED_FRAMES,
    FrameMotion,
    MotionDetector,
    SequenceSettings,
    flicker,
    same_picture_size,
    still_pixels,
)
from stereolag.sequences.sources import StereoSequence
from stereolag.sequences.video import SequenceVideo, VideoWriter, panels
from stereolag.stereo.matcher import DisparityMap, StereoMatcher

LOCAL = "local"
"""Scheduler address for a cluster of processes on this machine that lasts as long as the job."""

POLL_S = 0.1
"""Interval at which the job checks for cancellation and reports its progress, s."""

_COUNT_WORKERS_S = 5.0
"""Interval at which a cluster's workers are counted, s."""

_RESULT_TIMEOUT_S = 30.0
"""Long, as Dask fails with an UnboundLocalError if it expires while the result comes from its worker, s."""


Pending: TypeAlias = Future[MatchedFrame[FrameMap]]
"""A frame being matched somewhere; Dask has futures of its own, with the same methods."""

Promise: TypeAlias = Callable[[], MatchedFrame[DisparityMap]]
"""Returns a frame's own maps, which are computed once."""

Runner: TypeAlias = "ThreadRunner | DaskRunner"
"""Matches several frames at once, and can steady each with the previous one.

`submit` starts the work on a frame. To steady it, `match` is called first, which returns a promise of a frame's own
maps; `submit` takes the promises of the frame and of the previous one. `max_in_flight` is the largest number of frames
worked on at once, which bounds memory however long the sequence is; `crashes` are the errors raised for a frame that
repeatedly kills its worker, and counts as damaged.
"""


def in_order(
    runner: Runner, submit: Callable[[FrameTask], Pending], tasks: Iterable[FrameTask], poll: Callable[[], None]
) -> Iterator[MatchedFrame[FrameMap]]:
    """Yield the frames in the order of their tasks, with no more in flight than the runner allows.

    Parameters
    ----------
    runner
        The runner that does the work.
    submit
        Starts a frame on it.
    tasks
        The work.
    poll
        Called ten times a second while waiting; an exception from it ends the job.
    """

    def started(task: FrameTask) -> tuple[int, Pending, threading.Event]:
        pending, done = submit(task), threading.Event()
        pending.add_done_callback(lambda _: done.set())
        return task.number, pending, done

    remaining = iter(tasks)
    waiting: deque[tuple[int, Pending, threading.Event]] = deque()
    try:
        while True:
            # The limit may fall once a worker has died.
            waiting.extend(map(started, islice(remaining, max(0, runner.max_in_flight - len(waiting)))))
            if not waiting:
                return
            poll()
            number, pending, done = waiting[0]
            if not done.wait(POLL_S):
                continue
            try:
                frame = pending.result(timeout=_RESULT_TIMEOUT_S)
            except TimeoutError:  # its worker has died since
                continue
            except runner.crashes:
                frame = MatchedFrame(number, problem="This frame crashed every worker that took it.")
            waiting.popleft()
            yield frame
    finally:
        for _, pending, _ in waiting:
            pending.cancel()


@contextmanager
def runner_at(scheduler: str | None) -> Iterator[Runner]:
    """Open the runner for a scheduler; None means threads of this process.

    Raises
    ------
    ValueError
        If Dask is not installed.
    ConnectionError
        If there is no scheduler at that address.
    """
    with ExitStack() as stack:
        if scheduler is None:
            yield stack.enter_context(closing(ThreadRunner()))
            return
        try:
            import distributed
        except ImportError as error:
            raise ValueError(
                "A scheduler needs the package dask.distributed: pip install 'stereolag[cluster]'."
            ) from error
        address: Any = scheduler
        if scheduler == LOCAL:
            address = stack.enter_context(
                distributed.LocalCluster(  # type: ignore[no-untyped-call]
                    n_workers=available_cores(),
                    threads_per_worker=1,
                    dashboard_address=None,
                    silence_logs="ERROR",
                    preload=__name__,
                )
            )
        client_class: Any = distributed.Client
        try:
            client = client_class(address, timeout="10s", set_as_default=False)
        except (OSError, ValueError, TypeError) as error:
            raise ConnectionError(f"There is no Dask scheduler at {scheduler!r}: {error}") from error
        stack.callback(client.close)
        yield DaskRunner(client, (distributed.KilledWorker,))


def dask_setup(worker: object) -> None:
    """Make a local worker ignore Ctrl-C, which the terminal sends to all processes; Dask calls this at startup.

    The process that started the job ends it, and the workers with it.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)


class ThreadRunner:
    """Runner on threads of this process, one frame on each core."""

    crashes: tuple[type[Exception], ...] = ()

    def __init__(self) -> None:
        self.max_in_flight = available_cores() + 2
        self._stop = threading.Event()
        self._pool = lone_threads("frames")

    def close(self) -> None:
        """Abandon each frame in flight after the current stage of its matching."""
        self._stop.set()
        self._pool.shutdown(wait=True, cancel_futures=True)

    def match(self, task: FrameTask) -> Promise:
        """Return a promise of a frame, which is matched by the first thread that needs it while others wait.

        A promise waits for no other promise, so threads cannot deadlock.
        """
        lock = threading.Lock()
        matched = cache(partial(match_frame, task, self._check_stopped))

        def promise() -> MatchedFrame[DisparityMap]:
            with lock:
                return matched()

        return promise

    def submit(self, task: FrameTask, own: Promise | None = None, previous: Promise | None = None) -> Pending:
        """Start a frame as soon as a thread is free; with promises, steadied by the previous frame."""

        def frame() -> MatchedFrame[FrameMap]:
            matched = [None if promise is None else promise() for promise in (own, previous)]
            return encoded_frame(task, *matched, progress=self._check_stopped)

        return self._pool.submit(frame)

    def _check_stopped(self, fraction: float) -> None:
        if self._stop.is_set():
            raise CancelledError


class DaskRunner:
    """Runner on a Dask cluster, whose workers read the frames themselves; frames of a dead worker go to another one.

    Parameters
    ----------
    client
        A ``distributed.Client``.
    crashes
        As in :data:`Runner`.
    """

    def __init__(self, client: Any, crashes: tuple[type[Exception], ...]) -> None:
        self._client, self.crashes = client, crashes
        self._counted_at = -math.inf
        self.max_in_flight = 4

    def match(self, task: FrameTask) -> Any:
        """Have a worker match a frame and keep the result."""
        return self._client.submit(match_frame, task, pure=False)

    def submit(self, task: FrameTask, own: Any = None, previous: Any = None) -> Any:
        """Send a frame to a worker; with promises, to the one that has its maps, steadied by the previous frame."""
        if time.monotonic() - self._counted_at > _COUNT_WORKERS_S:
            # The number of frames in flight follows the workers, which come and go.
            self._counted_at = time.monotonic()
            workers = self._client.scheduler_info(n_workers=-1)["workers"].values()
            self.max_in_flight = max(4, 3 * sum(worker["nthreads"] for worker in workers))
        return self._client.submit(encoded_frame, task, own, previous, pure=False)


@dataclass(frozen=True)
class SequenceState:
    """The progress of a job.

    Attributes
    ----------
    done, total
        Numbers of frames; those finished by an earlier job count as done.
    damaged
        Number of frames done without a map.
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
        (:class:`~stereolag.sequences.frames.FrameRecord`) and ``sequence.json``. Frames already finished there are not
        matched again. Or a :class:`~stereolag.sequences.frames.SequenceTarget`, which keeps them elsewhere.
    calibration
        Provides the distance of the nearest obstacle in metres.
    settings
        Steadying by the previous frame, and motion: a video then shows the flow last, and moving objects are outlined
        in the left picture. Both are off by default.
    video
        An ".mp4" path or a binary file, for the left pictures beside the maps of every method in one colour range; or a
        :class:`~stereolag.sequences.video.SequenceVideo`, which has more options.
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
    task = FrameTask(
        0,
        partial(sequence.frame, 0),
        named,
        disparity_format,
        calibration,
        in_colour=video is not None,
        steadiness=settings.steadiness,
        with_truth=video is not None and video.with_truth,
        turn=sequence.turn,
    )
    with ExitStack() as stack:
        target = out if isinstance(out, SequenceTarget) else SequenceFolder(Path(out), sequence, task, again=again)
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
        detector = None
        if settings.motion is not None:
            method = next(iter(named.values()))
            detector = MotionDetector(sequence, method, calibration, settings.motion, target.largest_motion)
        runner = stack.enter_context(runner_at(scheduler))
        job = _Job(sequence, task, target, writer, detector, runner, progress, cancelled)
        was_cancelled = False
        try:
            for frame in job.frames():
                job.finish(frame)
        except CancelledError:
            was_cancelled = True
        return SequenceResult(
            len(sequence),
            job.done - job.done_before - len(job.damaged),
            job.done_before,
            job.damaged,
            cancelled=was_cancelled,
            elapsed_s=time.perf_counter() - job.start,
        )


class _Job:
    """One run of :func:`run_sequence`; `task` is the work on every frame, without its number and reader."""

    def __init__(
        self,
        sequence: StereoSequence,
        task: FrameTask,
        target: SequenceTarget,
        writer: VideoWriter | None,
        detector: MotionDetector | None,
        runner: Runner,
        progress: Callable[[SequenceState], None] | None,
        cancelled: Callable[[], bool] | None,
    ) -> None:
        self._sequence, self._every_task, self._target, self._writer = sequence, task, target, writer
        self._detector, self._runner, self._progress, self._cancelled = detector, runner, progress, cancelled
        self._record = partial(FrameRecord, findings="; ".join(one.code for one in sequence.findings))
        self.start = time.perf_counter()
        self._missing = [number for number in range(len(sequence)) if number not in target.finished]
        self.done = self.done_before = len(sequence) - len(self._missing)
        self.damaged: dict[str, str] = {}
        self._last: MatchedFrame[FrameMap] | None = None
        # Each frame is matched for itself and for the next one; the promise of its maps is dropped after its last use.
        self._uses = Counter(one for number in self._missing for one in (number, number - 1))
        self._promises: dict[int, Any] = {}

    def frames(self) -> Iterator[MatchedFrame[FrameMap]]:
        """Yield every frame to match, and finished ones that the video or the motion needs."""
        missing = set(self._missing)
        sampled_numbers: list[int] = []
        if self._writer is not None and self._target.colours is None:
            available = self._missing or range(len(self._sequence))
            places = np.linspace(0, len(available) - 1, min(len(available), SAMPLED_FRAMES))
            sampled_numbers = [available[place] for place in np.unique(places.round().astype(int))]
        # The frames sampled for the colours are started first, and the others right after them.
        numbers = sorted(self._missing, key=lambda number: number not in sampled_numbers)
        matched = in_order(self._runner, self._submit, map(self._task, numbers), self._poll)
        sampled = {number: next(matched) if missing else self._read_back(number) for number in sampled_numbers}
        if sampled:
            maps = [one.disparity[::4, ::4] for frame in sampled.values() for one in frame.maps.values()]
            self._target.set_colours(disparity_range(maps))
        for number in range(len(self._sequence)):
            self._poll()
            if number in missing:
                yield sampled.pop(number) if number in sampled else next(matched)
            elif self._writer is not None or (
                self._detector is not None and (number, MOTION) not in self._target.records
            ):
                yield self._read_back(number)

    def _submit(self, task: FrameTask) -> Pending:
        if task.steadiness is None:
            return self._runner.submit(task)
        previous = self._promise_of(task.number - 1) if task.number else None
        return self._runner.submit(task, self._promise_of(task.number), previous)

    def _promise_of(self, number: int) -> Any:
        """Return the promise of a frame's own maps."""
        self._uses[number] -= 1
        if number not in self._promises:
            self._promises[number] = self._runner.match(self._task(number))
        return self._promises[number] if self._uses[number] > 0 else self._promises.pop(number)

    def finish(self, frame: MatchedFrame[FrameMap]) -> None:
        """Detect the motion of a frame, write the frame if it is new, and add it to the video."""
        motion = None
        if self._detector is not None and not frame.problem:
            self._detector.lock_colours(self._poll)
            self._target.largest_motion = self._detector.largest
            motion = self._detector.motion_of(frame.number, self._poll)
        self._write(frame, motion)
        if self._writer is not None:
            self._draw(self._writer, frame, motion)
        self._last = frame
        self._poll()

    def _write(self, frame: MatchedFrame[FrameMap], motion: FrameMotion | None) -> None:
        """Write a frame and its records; of a finished one, those of its motion alone."""
        name = self._sequence.names[frame.number]
        record = partial(self._record, frame.number, name, self._sequence.time_s(frame.number))
        motion_records = [] if motion is None else [record(MOTION, **motion.figures())]
        if frame.number in self._target.finished:
            self._target.add(motion_records)
            return
        if frame.problem:
            self.damaged[name] = frame.problem
            records = [record(method, problem=frame.problem) for method in self._every_task.matchers]
        else:
            flickers = self._flicker(frame)
            records = [
                record(method, flicker_px=flickers.get(method, math.nan), **one.figures)
                for method, one in frame.maps.items()
            ]
        self._target.write(frame, records + motion_records)
        self.done += 1

    def _draw(self, writer: VideoWriter, frame: MatchedFrame[FrameMap], motion: FrameMotion | None) -> None:
        """Add a frame to the video."""
        if frame.left is None or self._target.colours is None:
            writer.write_blank()
            return
        disparities = [one.disparity for one in frame.maps.values()]
        if self._every_task.with_truth:
            truth = frame.truth
            if truth is None or truth.shape != frame.left.shape[:2]:
                truth = np.full(frame.left.shape[:2], np.nan, np.float32)
            disparities.append(truth)
        pictures: Sequence[Rgb] = (
            [as_rgb(frame.left)] if self._detector is None else self._detector.pictures(frame.left, motion)
        )
        writer.write(panels(pictures[0], disparities, self._target.colours, others=pictures[1:]))

    def _flicker(self, frame: MatchedFrame[FrameMap]) -> dict[str, float]:
        """Return the flicker of each method's map since the previous frame; empty if that is not available."""
        previous = self._last
        if previous is None or previous.number != frame.number - 1:
            if frame.number - 1 not in self._target.finished:
                return {}
            previous = self._read_back(frame.number - 1)
        if frame.left is None or previous.left is None or not same_picture_size(previous.left, frame.left):
            return {}
        still = still_pixels(previous.left, frame.left)
        return {
            method: flicker(previous.maps[method].disparity, one.disparity, still) for method, one in frame.maps.items()
        }

    def _read_back(self, number: int) -> MatchedFrame[FrameMap]:
        """Return a finished frame."""
        files = {method: self._target.file(number, method) for method in self._target.finished[number]}
        return finished_frame(self._task(number), files)

    def _task(self, number: int) -> FrameTask:
        return self._every_task._replace(number=number, reader=self._sequence.reader(number))

    def _poll(self, fraction: float = 0.0) -> None:
        """Report the progress, and raise CancelledError if the job was cancelled.

        It can be passed as a callback that reports the progress of a part, whose `fraction` is ignored.
        """
        if self._cancelled is not None and self._cancelled():
            raise CancelledError
        if self._progress is not None:
            elapsed, new = time.perf_counter() - self.start, self.done - self.done_before
            remaining = elapsed / new * (len(self._sequence) - self.done) if new else math.nan
            self._progress(SequenceState(self.done, len(self._sequence), len(self.damaged), elapsed, remaining))
