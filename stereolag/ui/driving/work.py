"""The maps of a sequence, computed in the background: started, watched as they arrive, cancelled and resumed."""

from __future__ import annotations

import hashlib
import math
import threading
from dataclasses import dataclass, field

import streamlit as st
from cachetools import LRUCache

from stereolag.core.jobs import Estimate
from stereolag.motion.flow import FlowMatcher
from stereolag.sequences import SequenceResult, SequenceSettings, SequenceState, SequenceVideo, run_sequence
from stereolag.sequences.targets import SequenceMemory
from stereolag.sequences.video import VideoPieces
from stereolag.ui.driving.frames import KEY, Drive
from stereolag.ui.driving.settings import DriveSettings
from stereolag.ui.results import Job, this_visit

WORK = f"{KEY}.work"
FRAMES_AT_ONCE = 4
"""Number of frames whose pictures and maps are in memory together."""
EXAMPLES_KEPT = 2
"""Number of results for the example that are kept, some 40 MB each."""

_examples: LRUCache[str, DriveWork] = LRUCache(EXAMPLES_KEPT)
"""Results for the example: computed for one visitor, shown to the next at once."""
_examples_lock = threading.Lock()


@dataclass(eq=False)
class DriveWork:
    """The work on a sequence so far.

    Attributes
    ----------
    name
        Identifies the sequence and the settings.
    kept, video
        Maps, figures and pictures so far; in memory, like everything a visitor uploads.
    state
        Progress; None before the first report.
    begun
        Number of times it was started.
    job
        The job that does the work.
    """

    name: str
    kept: SequenceMemory
    video: VideoPieces
    state: SequenceState | None = None
    begun: int = 1
    job: Job[SequenceResult] = field(init=False)

    @property
    def video_name(self) -> str:
        """Return the name that identifies the video, 32 characters."""
        return hashlib.sha256(f"{self.name} {self.begun}".encode()).hexdigest()[:32]

    @property
    def computed(self) -> int:
        """Return the number of frames in the pieces of the video."""
        return self.video.collected


def work_on(drive: Drive, asked: DriveSettings) -> DriveWork:
    """Return the work on a sequence with these settings; start it if there is none, in place of any other."""
    settings = [f"{name} {matcher.model_dump_json()}" for name, matcher in asked.matchers.items()]
    job = map(repr, (drive.calibration, asked.truth_in_video, asked.motion, asked.steadiness))
    name = hashlib.sha256("\0".join([drive.digest, *job, *settings]).encode()).hexdigest()
    kept: DriveWork | None = st.session_state.get(WORK)
    if kept is not None and kept.name == name:
        return kept
    if kept is not None:
        kept.job.cancel()
    with _examples_lock:
        work = _examples.get(name)
    if work is None:
        work = DriveWork(name, SequenceMemory(), VideoPieces(drive.sequence.frame_rate))
        _begin(work, drive, asked)
    st.session_state[WORK] = work
    return work


def go_on(work: DriveWork, drive: Drive, asked: DriveSettings) -> None:
    """Resume cancelled work: finished frames are drawn again, not computed again."""
    video = VideoPieces(drive.sequence.frame_rate)
    again = DriveWork(work.name, work.kept, video, begun=work.begun + 1)
    _begin(again, drive, asked)
    st.session_state[WORK] = again


def _begin(work: DriveWork, drive: Drive, asked: DriveSettings) -> None:
    def told(state: SequenceState) -> None:
        work.state = state

    def compute(job: Job[SequenceResult]) -> SequenceResult:
        try:
            result = run_sequence(
                drive.sequence,
                asked.matchers,
                work.kept,
                calibration=drive.calibration,
                settings=SequenceSettings(steadiness=asked.steadiness, motion=asked.motion),
                video=SequenceVideo(work.video, with_truth=asked.truth_in_video),
                progress=told,
                cancelled=lambda: job.cancelled,
            )
        finally:
            work.video.close()
        if drive.example and not result.cancelled:
            with _examples_lock:
                _examples[work.name] = work
        return result

    work.job = Job(compute, estimate(drive, asked))
    this_visit().jobs[WORK] = work.name, work.job


def estimate(drive: Drive, asked: DriveSettings) -> Estimate:
    """Return the cost of computing the maps of all frames."""
    left = drive.first.left
    each = [matcher.estimate(left.shape, left.dtype) for matcher in asked.matchers.values()]
    if asked.motion is not None:
        each.append(FlowMatcher().estimate(left.shape, left.dtype))
    memory = max(one.memory for one in each) + FRAMES_AT_ONCE * (2 * left.nbytes + 13 * left.shape[0] * left.shape[1])
    return Estimate(memory, len(drive.sequence) * math.fsum(one.seconds for one in each))
