"""Settings found by search, and how much better they are."""

from __future__ import annotations

from concurrent.futures import CancelledError

import pandas as pd
import streamlit as st

from stereolag.assess.judging import Criterion, Unjudged, judges_itself
from stereolag.assess.suggestion import Outcome, Suggestion, estimate_suggestion, suggest_for_all
from stereolag.core.settings import title_of
from stereolag.stereo.matcher import StereoMatcher
from stereolag.ui import prose
from stereolag.ui.depth.address import adopt
from stereolag.ui.depth.judging import (
    JUDGED_BY,
    UNJUDGED,
    criterion_on,
    known_truth,
    search_so_far,
    suggestion_in_words,
    tuning_pairs,
    value_in_words,
)
from stereolag.ui.depth.pair_jobs import BETWEEN_LOOKS_S, PairJob, begin_job, job_on
from stereolag.ui.depth.pair_sets import JudgedPairs
from stereolag.ui.depth.sweeping import ask_method
from stereolag.ui.depth.view import DepthView
from stereolag.ui.jobs import Job
from stereolag.ui.navigation import fragment
from stereolag.ui.pairs import StereoPair
from stereolag.ui.states import show_busy, show_refused

KEY = "depth.suggest"
BUDGETS_S = (10, 20, 60)


@fragment
def show_suggest(view: DepthView) -> None:
    """Ask for a method and a time, search its settings, and offer the best found."""
    criterion = criterion_on(view.pair)
    prose.markdown(
        "The search range and the tolerances of the checks are kept; settings that go well together are tried in "
        "combination, and the best of them compared with yours on the whole images. "
        + JudgedPairs.of(view.pair).sentence
        + JUDGED_BY[criterion],
        width=760,
    )
    matcher = ask_method(view, key=f"{KEY}.method")
    budget_s = st.segmented_control(
        "Time",
        BUDGETS_S,
        default=BUDGETS_S[0],
        format_func=lambda seconds: f"{seconds} s",
        required=True,
        key=f"{KEY}.budget",
    )
    begun = job_on(view.pair, KEY)
    running = begun is not None and begun.job.running
    if criterion is Criterion.ESTIMATED_BAD_2 and judges_itself(matcher):
        prose.info(UNJUDGED[Unjudged.JUDGES_ITSELF], icon=":material/balance:")
    else:
        st.button(
            "Suggest settings",
            key=f"{KEY}.start",
            on_click=_begin,
            args=(view.pair, matcher, budget_s),
            type="primary",
            icon=":material/auto_fix_high:",
            disabled=running,
        )
    if begun is not None:
        st.fragment(_show_search, run_every=BETWEEN_LOOKS_S if running else None)(view, matcher, begun, running)


def _begin(pair: StereoPair, matcher: StereoMatcher, budget_s: float) -> None:
    """Start a search in its own thread."""
    pairs = JudgedPairs.of(pair)

    def work(job: Job[Suggestion]) -> Suggestion:
        return suggest_for_all(
            matcher,
            tuning_pairs(pairs, matcher.search_range(), job),
            budget_s=budget_s,
            progress=job.report,
            found=job.found,
            cancelled=lambda: job.cancelled,
        )

    estimate = estimate_suggestion(
        matcher, pair.left.shape, pair.left.dtype, blind=known_truth(pair) is None, budget_s=budget_s
    )
    begin_job(pair, KEY, matcher, work, estimate)


def _show_search(view: DepthView, matcher: StereoMatcher, begun: PairJob, was_running: bool) -> None:
    """Show the progress of the search, or its result if `matcher` has the settings it started from or found."""
    if begun.job.running:
        so_far: Suggestion | None = begun.job.so_far
        text = search_so_far(so_far) if so_far else f"Looking at the {begun.asked.title} settings in use …"
        ending = "Ends the search; the best settings found so far stay."
        show_busy(begun.job, text, key=f"{KEY}.cancel", ending=ending)
        return
    if was_running:
        st.rerun(scope="app")
    try:
        found: Suggestion = begun.job.result()
    except CancelledError:  # cancelled before its turn came
        return
    except ValueError as error:
        if matcher == begun.asked:
            show_refused(error)
        return
    if matcher in (begun.asked, found.matcher):
        _show_suggestion(view, found)


def _show_suggestion(view: DepthView, found: Suggestion) -> None:
    """Show the result, and offer to use the settings if they are better."""
    if isinstance(found.outcome, Unjudged):
        prose.info(suggestion_in_words(found), icon=":material/balance:")
        return
    better = found.outcome is Outcome.BETTER
    prose.success(suggestion_in_words(found), icon=":material/auto_fix_high:" if better else ":material/check_circle:")
    if not better:
        return
    st.dataframe(
        pd.DataFrame(
            [
                (title_of(type(found.start), name), value_in_words(old), value_in_words(new))
                for name, (old, new) in found.changes.items()
            ],
            columns=["Setting", "Before", "Suggested"],
        ),
        hide_index=True,
        width=640,
        key=f"{KEY}.changes",
        alt="Settings that change, before and as suggested.",
    )
    in_use = any(result.settings == found.matcher for result in view.results.values())
    if st.button(
        "In use" if in_use else "Use these settings", key=f"{KEY}.adopt", disabled=in_use, icon=":material/check:"
    ):
        adopt(found.matcher)
