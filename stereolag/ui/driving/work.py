"""The maps of a sequence, computed beside the page: begun, watched while they come, called off, and gone on with."""

from __future__ import annotations

import hashlib
import math
import threading
from dataclasses import dataclass, field

import streamlit as st
from cachetools import LRUCache

from stereolag.estimates import Estimate
from stereolag.motion.matcher import FlowMatcher
from stereolag.sequences import SequenceResult, SequenceState, run_sequence
from stereolag.sequences.fragments import VideoPieces
from stereolag.sequences.motion import MotionWatch, motion_watch
from stereolag.sequences.targets import SequenceMemory
from stereolag.ui.driving.frames import KEY, Drive
from stereolag.ui.driving.settings import Asked
from stereolag.ui.jobs import Job
from stereolag.ui.visits import this_visit

WORK = f"{KEY}.work"
FRAMES_AT_ONCE = 4
"""Whose pictures and maps are in memory together."""
EXAMPLES_KEPT = 2
"""Of some 40 MB each."""

_examples: LRUCache[str, DriveWork] = LRUCache(EXAMPLES_KEPT)
"""What was made of the example for one visitor, which the next sees at once."""
_examples_lock = threading.Lock()


@dataclass(eq=False)
class DriveWork:
    """What was made of a sequence so far.

    Attributes
    ----------
    name
        Tells the sequence and the settings from all others.
    watch
        Tells what moves; None where that was not asked for.
    kept, video
        Maps, figures and pictures, as far as they are there; in memory, as all that a visitor uploads.
    state
        How far it is.
    begun
        How often it was begun.
    job
        What does it.
    """

    name: str
    kept: SequenceMemory
    video: VideoPieces
    watch: MotionWatch | None = None
    state: SequenceState | None = None
    begun: int = 1
    job: Job[SequenceResult] = field(init=False)

    @property
    def video_name(self) -> str:
        """Return what tells the video from all others, 32 characters."""
        return hashlib.sha256(f"{self.name} {self.begun}".encode()).hexdigest()[:32]

    @property
    def computed(self) -> int:
        """Return how many frames the pieces of the video hold."""
        return self.video.collected


def work_on(drive: Drive, asked: Asked) -> DriveWork:
    """Return the work on a sequence with these settings; it begins where there is none, in place of any other."""
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
        video, watch = VideoPieces(drive.sequence.frame_rate), None
        if asked.motion is not None:
            method = next(iter(asked.matchers.values()))
            watch = motion_watch(drive.sequence, method, drive.calibration, asked.motion)
        work = DriveWork(name, SequenceMemory(), video, watch)
        _begin(work, drive, asked)
    st.session_state[WORK] = work
    return work


def go_on(work: DriveWork, drive: Drive, asked: Asked) -> None:
    """Go on with work that was called off: what is finished is drawn again and not computed again."""
    video = VideoPieces(drive.sequence.frame_rate)
    again = DriveWork(work.name, work.kept, video, work.watch, begun=work.begun + 1)
    _begin(again, drive, asked)
    st.session_state[WORK] = again


def _begin(work: DriveWork, drive: Drive, asked: Asked) -> None:
    def told(state: SequenceState) -> None:
        work.state = state

    def compute(job: Job[SequenceResult]) -> SequenceResult:
        try:
            result = run_sequence(
                drive.sequence,
                asked.matchers,
                work.kept,
                calibration=drive.calibration,
                steadiness=asked.steadiness,
                video=work.video,
                truth_in_video=asked.truth_in_video,
                motion=work.watch,
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


def estimate(drive: Drive, asked: Asked) -> Estimate:
    """Return what it takes to compute the maps of all frames."""
    left = drive.first.left
    each = [matcher.estimate(left.shape, left.dtype) for matcher in asked.matchers.values()]
    if asked.motion is not None:
        each.append(FlowMatcher().estimate(left.shape, left.dtype))
    memory = max(one.memory for one in each) + FRAMES_AT_ONCE * (2 * left.nbytes + 13 * left.shape[0] * left.shape[1])
    return Estimate(memory, len(drive.sequence) * math.fsum(one.seconds for one in each))
