"""How far a job over a sequence is, and what came of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class SequenceState:
    """How far a job is.

    Attributes
    ----------
    done, total
        Frames; those that were finished before count as done.
    damaged
        How many of them have no map.
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
    """What came of a job.

    Attributes
    ----------
    total
        Frames of the sequence.
    matched, finished_before
        How many frames were matched now, and how many had been before.
    damaged
        {name of the frame: why there is no map}.
    cancelled
        Whether it was called off before its end; calling it again goes on.
    elapsed_s
        Seconds.
    """

    total: int
    matched: int
    finished_before: int
    damaged: Mapping[str, str]
    cancelled: bool
    elapsed_s: float
