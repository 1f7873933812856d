"""A search or a sweep beside the page: which pair it is on, how far it is, and its end when asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import streamlit as st

from stereolag.estimates import Estimate
from stereolag.ui.jobs import Job
from stereolag.ui.pairs import StereoPair
from stereolag.ui.visits import this_visit

BETWEEN_LOOKS_S = 0.3


@dataclass(frozen=True, eq=False)
class PairJob:
    """A job on a pair, or on the set to which it belongs: its digest, what was asked for, and the job that does it."""

    digest: str
    asked: Any
    job: Job[Any]


def job_on(pair: StereoPair, key: str) -> PairJob | None:
    """Return the job of a part of the page on this pair; one on another pair is called off and forgotten."""
    begun: PairJob | None = st.session_state.get(key)
    if begun is None or begun.digest == pair.judged:
        return begun
    forget_job(key)
    return None


def forget_job(key: str) -> None:
    """Call the job of a part of the page off and forget it."""
    st.session_state.pop(key).job.cancel()


def begin_job(pair: StereoPair, key: str, asked: object, work: Callable[[Job[Any]], Any], estimate: Estimate) -> None:
    """Start the job of a part of the page in a thread of its own."""
    job = Job(work, estimate)
    this_visit().jobs[key] = pair.judged, job
    st.session_state[key] = PairJob(pair.judged, asked, job)
