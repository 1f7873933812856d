"""Progress and result of a job over a sequence."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


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
