"""A search or a sweep beside the page: which pair it is on, how far it is, and its end when asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import streamlit as st

from stereolag.estimates import Estimate
from stereolag.ui.depth.pair_sets import Preparation, place_in_set
from stereolag.ui.jobs import Job
from stereolag.ui.pairs import StereoPair
from stereolag.ui.visits import this_visit

BETWEEN_LOOKS_S = 0.3


@dataclass(frozen=True, eq=False)
class PairJob:
    """A job on a pair, or on the set to which it belongs.

    Attributes
    ----------
    digest
        Tells the pair, or the set and how its pairs are prepared.
    asked
        What was asked for.
    job
        That does it.
    files, images
        Tell the pair that was looked at when it began, and its images.
    place
        Which pair of the set that is, in words; "" of a pair alone.
    """

    digest: str
    asked: Any
    job: Job[Any]
    files: str = ""
    images: str = ""
    place: str = ""

    def is_on(self, pair: StereoPair) -> bool:
        """Return whether its images are still those that the page would give it where this pair is looked at."""
        return self.digest == _digest(pair) and (self.files != pair.files or self.images == pair.digest)


def job_on(pair: StereoPair, key: str) -> PairJob | None:
    """Return the job of a part of the page on this pair; one on other images is called off and forgotten."""
    begun: PairJob | None = st.session_state.get(key)
    if begun is None or begun.is_on(pair):
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
    st.session_state[key] = PairJob(_digest(pair), asked, job, pair.files, pair.digest, place_in_set(pair))


def _digest(pair: StereoPair) -> str:
    """Return what tells the images judged together: of a set, the others are prepared as the page says."""
    return f"{pair.judged} {Preparation.chosen()}" if pair.collection else pair.judged
