"""A search or sweep in the background: its pair, its progress and its cancellation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import streamlit as st

from stereolag.core.jobs import Estimate
from stereolag.pair import Pair
from stereolag.ui.depth.pair_sets import Preparation, place_in_set
from stereolag.ui.jobs import Job
from stereolag.ui.visits import this_visit

BETWEEN_LOOKS_S = 0.3


@dataclass(frozen=True, eq=False)
class PairJob:
    """A job on a pair or on the set it belongs to.

    Attributes
    ----------
    digest
        Identifies the pair, or the set and the preparation of its pairs.
    asked
        The request that started the job.
    job
        The job itself.
    files, images
        Identify the pair shown when the job began, and its images.
    place
        Position of that pair in the set, in words; "" for a single pair.
    """

    digest: str
    asked: Any
    job: Job[Any]
    files: str = ""
    images: str = ""
    place: str = ""

    def is_on(self, pair: Pair) -> bool:
        """Return whether the page, showing this pair, would still give the job the same images."""
        return self.digest == _digest(pair) and (self.files != pair.id.files or self.images == pair.digest)


def job_on(pair: Pair, key: str) -> PairJob | None:
    """Return the job of a part of the page on this pair; cancel and forget a job on other images."""
    begun: PairJob | None = st.session_state.get(key)
    if begun is None or begun.is_on(pair):
        return begun
    forget_job(key)
    return None


def forget_job(key: str) -> None:
    """Cancel and forget the job of a part of the page."""
    st.session_state.pop(key).job.cancel()


def begin_job(pair: Pair, key: str, asked: object, work: Callable[[Job[Any]], Any], estimate: Estimate) -> None:
    """Start the job of a part of the page in its own thread."""
    job = Job(work, estimate)
    this_visit().jobs[key] = pair.id.judged, job
    st.session_state[key] = PairJob(_digest(pair), asked, job, pair.id.files, pair.digest, place_in_set(pair))


def _digest(pair: Pair) -> str:
    """Return the key of the images judged together; for a set, it includes the preparation of the other pairs."""
    return f"{pair.id.judged} {Preparation.chosen()}" if pair.id.collection else pair.id.judged
