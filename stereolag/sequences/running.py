"""The job over the frames of a sequence, on threads or a Dask cluster: matching, writing, drawing and reporting."""

from __future__ import annotations

import math
import os
import signal
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import CancelledError, Future
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cache, partial
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO, TypeAlias

import numpy as np

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
    SAMPLED,
    MotionWatch,
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

LOOKS_S = 0.1
"""Interval at which the job checks for cancellation."""

_CONNECTS_S = "10s"
_COUNTS_S = 5.0
_FETCHES_S = 30.0
"""Dask fails with an UnboundLocalError if the time for a result runs out while it comes from its worker."""


Pending: TypeAlias = Future[MatchedFrame[FrameMap]]
"""A frame being matched somewhere; Dask has futures of its own, with the same methods."""

Promise: TypeAlias = Callable[[], MatchedFrame[DisparityMap]]
"""Returns a frame's own maps, which are computed once."""

Runner: TypeAlias = "ThreadRunner | DaskRunner"
"""Matches several frames at once, and can steady each with the previous one.

`match` returns a promise of a frame's own maps, to be passed to `submit`, usually twice, which starts a frame: with
promises, steadied by the previous one. `at_once` is the largest number of frames in flight, which bounds memory however
long the sequence is; `crashes` are raised by a frame that repeatedly kills its worker, and counts as damaged.
"""


def in_order(
    runner: Runner, submit: Callable[[FrameTask], Pending], tasks: Iterable[FrameTask], look: Callable[[], None]
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
    look
        Called ten times a second while waiting; an exception from it ends the job.
    """

    def started(task: FrameTask) -> tuple[int, Pending, threading.Event]:
        pending, done = submit(task), threading.Event()
        pending.add_done_callback(lambda _: done.set())
        return task.number, pending, done

    coming = iter(tasks)
    waiting: deque[tuple[int, Pending, threading.Event]] = deque()
    try:
        while True:
            room = max(0, runner.at_once - len(waiting))  # the limit may fall once a worker has died
            waiting.extend(map(started, islice(coming, room)))
            if not waiting:
                return
            look()
            number, pending, done = waiting[0]
            if not done.wait(LOOKS_S):
                continue
            try:
                frame = pending.result(timeout=_FETCHES_S)
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
            yield stack.enter_context(ThreadRunner())
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
        opening: Any = distributed.Client
        try:
            client = opening(address, timeout=_CONNECTS_S, set_as_default=False)
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
    """Runner on threads of this process, one frame on each core.

    On exit, frames in flight end within a stage of the matching.
    """

    crashes: tuple[type[Exception], ...] = ()

    def __init__(self) -> None:
        self.at_once = available_cores() + 2
        self._stop = threading.Event()
        self._pool = lone_threads("frames")

    def __enter__(self) -> ThreadRunner:
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._pool.shutdown(wait=True, cancel_futures=True)

    def match(self, task: FrameTask) -> Promise:
        """Return a promise of a frame: the first thread that asks matches it while others wait; none can deadlock."""
        lock = threading.Lock()
        found = cache(partial(match_frame, task, self._stop_here))

        def promised() -> MatchedFrame[DisparityMap]:
            with lock:
                return found()

        return promised

    def submit(self, task: FrameTask, own: Promise | None = None, before: Promise | None = None) -> Pending:
        """Start a frame as soon as a thread is free."""

        def frame() -> MatchedFrame[FrameMap]:
            promised = [None if one is None else one() for one in (own, before)]
            return encoded_frame(task, *promised, progress=self._stop_here)

        return self._pool.submit(frame)

    def _stop_here(self, fraction: float) -> None:
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
        self._looked = -math.inf
        self.at_once = 4

    def match(self, task: FrameTask) -> Any:
        """Have a worker match a frame and keep the result."""
        return self._client.submit(match_frame, task, pure=False)

    def submit(self, task: FrameTask, own: Any = None, before: Any = None) -> Any:
        """Send a frame to a worker: with promises, to the one that has its maps."""
        if time.monotonic() - self._looked > _COUNTS_S:
            # The number of frames in flight follows the workers, which come and go.
            self._looked = time.monotonic()
            workers = self._client.scheduler_info(n_workers=-1)["workers"].values()
            self.at_once = max(4, 3 * sum(worker["nthreads"] for worker in workers))
        return self._client.submit(encoded_frame, task, own, before, pure=False)


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
        watch = None
        if settings.motion is not None:
            method = next(iter(named.values()))
            watch = MotionWatch(sequence, method, calibration, settings.motion, target.largest_motion)
        runner = stack.enter_context(runner_at(scheduler))
        job = _Job(sequence, task, target, writer, watch, runner, progress, cancelled)
        ended = False
        try:
            for frame in job.frames():
                job.take(frame)
        except CancelledError:
            ended = True
        new, elapsed = job.done - job.done_before, time.perf_counter() - job.start
        return SequenceResult(
            len(sequence), new - len(job.damaged), job.done_before, job.damaged, cancelled=ended, elapsed_s=elapsed
        )


class _Job:
    """One run of :func:`run_sequence`; `task` is the work on a frame but for its number and reader."""

    def __init__(
        self,
        sequence: StereoSequence,
        task: FrameTask,
        target: SequenceTarget,
        writer: VideoWriter | None,
        watch: MotionWatch | None,
        runner: Runner,
        progress: Callable[[SequenceState], None] | None,
        cancelled: Callable[[], bool] | None,
    ) -> None:
        self._sequence, self._each, self._target, self._writer, self._motion = sequence, task, target, writer, watch
        self._runner, self._progress, self._cancelled = runner, progress, cancelled
        self._record = partial(FrameRecord, findings="; ".join(one.code for one in sequence.findings))
        self.start = time.perf_counter()
        self._missing = [number for number in range(len(sequence)) if number not in target.finished]
        self.done = self.done_before = len(sequence) - len(self._missing)
        self.damaged: dict[str, str] = {}
        self._last: MatchedFrame[FrameMap] | None = None
        # Each frame is matched for itself and for the next one; the promise of its maps is dropped after its last use.
        self._uses = Counter(one for number in self._missing for one in (number, number - 1))
        self._promised: dict[int, Any] = {}

    def frames(self) -> Iterator[MatchedFrame[FrameMap]]:
        """Yield every frame to match, and finished ones that the video or the motion needs."""
        chosen: list[int] = []
        if self._writer is not None and self._target.colours is None:
            among = self._missing or range(len(self._sequence))
            places = np.unique(np.linspace(0, len(among) - 1, min(len(among), SAMPLED)).round().astype(int))
            chosen = [among[place] for place in places]
        missing = set(self._missing)
        # The frames chosen for the colours come first, and the others at once behind them.
        numbers = [*(chosen if missing else ()), *(one for one in self._missing if one not in chosen)]
        coming = in_order(self._runner, self._submit, map(self._task, numbers), self._look)
        sampled = {number: next(coming) if missing else self._read_back(number) for number in chosen}
        if chosen:
            maps = [one.disparity[::4, ::4] for frame in sampled.values() for one in frame.maps.values()]
            self._target.set_colours(disparity_range(maps))
        for number in range(len(self._sequence)):
            self._look()
            if number in missing:
                yield sampled.pop(number) if number in sampled else next(coming)
            elif self._writer is not None or (
                self._motion is not None and (number, MOTION) not in self._target.records
            ):
                yield self._read_back(number)

    def _submit(self, task: FrameTask) -> Pending:
        if task.steadiness is None:
            return self._runner.submit(task)
        before = self._own(task.number - 1) if task.number else None
        return self._runner.submit(task, self._own(task.number), before)

    def _own(self, number: int) -> Any:
        """Return the promise of a frame's own maps."""
        self._uses[number] -= 1
        if number not in self._promised:
            self._promised[number] = self._runner.match(self._task(number))
        return self._promised[number] if self._uses[number] > 0 else self._promised.pop(number)

    def take(self, frame: MatchedFrame[FrameMap]) -> None:
        """Write a frame if it is new, and draw it."""
        motion = None
        if self._motion is not None and not frame.problem:
            self._motion.lock_colours(self._look)
            self._target.largest_motion = self._motion.largest
            motion = self._motion.since_before(frame.number, self._look)
        name, moment = self._sequence.names[frame.number], frame.number / self._sequence.frame_rate
        record = partial(self._record, frame.number, name, moment)
        moved = [] if motion is None else [record(MOTION, **motion.figures())]
        if frame.number in self._target.finished:
            self._target.add(moved)
        else:
            if frame.problem:
                self.damaged[name] = frame.problem
                records = [record(method, problem=frame.problem) for method in self._each.matchers]
            else:
                changes = self._flicker(frame)
                records = [
                    record(method, flicker_px=changes.get(method, math.nan), **one.figures)
                    for method, one in frame.maps.items()
                ]
            self._target.write(frame, records + moved)
            self.done += 1
        if self._writer is not None:
            if frame.left is None or self._target.colours is None:
                self._writer.write_blank()
            else:
                disparities = [one.disparity for one in frame.maps.values()]
                if self._each.with_truth:
                    truth = frame.truth
                    if truth is None or truth.shape != frame.left.shape[:2]:
                        truth = np.full(frame.left.shape[:2], np.nan, np.float32)
                    disparities.append(truth)
                left, more = as_rgb(frame.left), []
                if self._motion is not None:
                    left, flow = self._motion.drawn(frame.left, motion)
                    more = [flow]
                self._writer.write(panels(left, disparities, self._target.colours, more=more))
        self._last = frame
        self._look()

    def _flicker(self, frame: MatchedFrame[FrameMap]) -> dict[str, float]:
        """Return the flicker of each method's map since the previous frame; nothing if that is not known."""
        before = self._last
        if before is None or before.number != frame.number - 1:
            if frame.number - 1 not in self._target.finished:
                return {}
            before = self._read_back(frame.number - 1)
        if frame.left is None or before.left is None or not same_picture_size(before.left, frame.left):
            return {}
        still = still_pixels(before.left, frame.left)
        return {
            method: flicker(before.maps[method].disparity, one.disparity, still) for method, one in frame.maps.items()
        }

    def _read_back(self, number: int) -> MatchedFrame[FrameMap]:
        files = {method: self._target.file(number, method) for method in self._target.finished[number]}
        return finished_frame(self._task(number), files)

    def _task(self, number: int) -> FrameTask:
        return self._each._replace(number=number, reader=self._sequence.reader(number))

    def _look(self, fraction: float = 0.0) -> None:
        """Report the progress; raise CancelledError if the job was cancelled. Also reports that of a part of it."""
        if self._cancelled is not None and self._cancelled():
            raise CancelledError
        if self._progress is not None:
            elapsed, new = time.perf_counter() - self.start, self.done - self.done_before
            remaining = elapsed / new * (len(self._sequence) - self.done) if new else math.nan
            self._progress(SequenceState(self.done, len(self._sequence), len(self.damaged), elapsed, remaining))
