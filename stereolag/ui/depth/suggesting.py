"""Settings found by search, and why these."""

from __future__ import annotations

from concurrent.futures import CancelledError
from dataclasses import dataclass, replace

import pandas as pd
import streamlit as st

from stereolag.stereo.matcher import StereoMatcher
from stereolag.tuning.parameters import parameters
from stereolag.tuning.suggestion import VALUES, Suggestion, suggest
from stereolag.ui.depth.address import adopt
from stereolag.ui.depth.sweeping import ask_method, objective_in_words
from stereolag.ui.depth.view import DepthView
from stereolag.ui.jobs import Job, waiting_in_words
from stereolag.ui.navigation import fragment
from stereolag.ui.pairs import StereoPair
from stereolag.ui.sentences import percent
from stereolag.ui.visits import this_visit

KEY = "depth.suggest"
BUDGETS_S = (10, 20, 60)
BETWEEN_LOOKS_S = 0.3


@dataclass(frozen=True, eq=False)
class Search:
    """A search for settings: on which pair, from which settings, and the job that does it."""

    digest: str
    start: StereoMatcher
    job: Job[Suggestion]


@fragment
def show_suggest(view: DepthView) -> None:
    """Ask for a method and a time, search its settings, and offer what was found."""
    st.markdown(
        "The search changes one setting at a time, keeps every change that raises the score, and starts over until "
        "nothing helps. " + objective_in_words(view),
        width=760,
    )
    matcher = ask_method(view, key=f"{KEY}.method")
    budget_s = st.segmented_control(
        "Time",
        BUDGETS_S,
        default=BUDGETS_S[1],
        format_func=lambda seconds: f"{seconds} s",
        required=True,
        key=f"{KEY}.budget",
    )
    search = _search_of(view.pair)
    running = search is not None and search.job.running
    st.button(
        "Suggest settings",
        key=f"{KEY}.start",
        on_click=_begin,
        args=(view.pair, matcher, budget_s),
        type="primary",
        icon=":material/auto_fix_high:",
        disabled=running,
    )
    if search is not None:
        st.fragment(_show_search, run_every=BETWEEN_LOOKS_S if running else None)(view, search, running)


def _search_of(pair: StereoPair) -> Search | None:
    """Return the search on this pair; one on another pair is called off and forgotten."""
    search: Search | None = st.session_state.get(KEY)
    if search is None or search.digest == pair.digest:
        return search
    search.job.cancel()
    del st.session_state[KEY]
    return None


def _begin(pair: StereoPair, matcher: StereoMatcher, budget_s: float) -> None:
    """Start a search in a thread of its own."""
    trials = sum(len(parameter.values(VALUES)) for parameter in parameters(matcher).values())

    def work(job: Job[Suggestion]) -> Suggestion:
        return suggest(
            matcher,
            pair.left,
            pair.right,
            ground_truth=pair.truth,
            budget_s=budget_s,
            progress=job.report,
            found=job.found,
            cancelled=lambda: job.cancelled,
        )

    once = matcher.estimate(pair.left.shape, pair.left.dtype)
    job = Job(work, replace(once, seconds=min(budget_s, trials * once.seconds)))
    this_visit().jobs[KEY] = pair.digest, job
    st.session_state[KEY] = Search(pair.digest, matcher, job)


def _show_search(view: DepthView, search: Search, was_running: bool) -> None:
    """Show how far the search is, or what it found."""
    if search.job.running:
        _show_progress(search.job)
        return
    if was_running:
        st.rerun(scope="app")
    try:
        found = search.job.result()
    except CancelledError:  # before its turn came
        return
    except ValueError as error:
        st.error(str(error))
        return
    _show_suggestion(view, search.start, found)


def _show_progress(job: Job[Suggestion]) -> None:
    """Show how far the search is and what it has found so far, and let it be ended."""
    best = job.so_far
    if job.ahead:
        st.info(waiting_in_words(job), icon=":material/groups:")
    else:
        st.progress(job.progress, _so_far(best) if best else "Looking at the settings in use …")
    st.button(
        "Cancel" if not job.cancelled else "Ending …",
        key=f"{KEY}.cancel",
        on_click=job.cancel,
        disabled=job.cancelled,
        icon=":material/stop_circle:",
        help="Ends the search; the best settings found so far stay.",
    )


def _so_far(best: Suggestion) -> str:
    rise = (
        f"{_percent(best.objective_before)} → {_percent(best.objective)}" if best.changes else _percent(best.objective)
    )
    return f"{best.tried} settings tried. Score so far: {rise}"


def _show_suggestion(view: DepthView, start: StereoMatcher, found: Suggestion) -> None:
    """Say what was found and why, and offer to use it."""
    notes = "" if found.finished else " The search was ended before it had tried everything."
    if found.scale < 1:
        notes += f" Tried on the pair at {percent(found.scale)} of its size, to get through in time."
    if not found.changes:
        st.success(
            f"Your settings are as good as any of the {found.tried} tried: {_percent(found.objective)}.{notes}",
            icon=":material/check_circle:",
        )
        return
    st.success(
        f"Of {found.tried} settings tried these are the best. Score: **{_percent(found.objective_before)} → "
        f"{_percent(found.objective)}**.{notes}",
        icon=":material/auto_fix_high:",
    )
    titles = {name: parameter.title for name, parameter in parameters(start).items()}
    gains = sorted(found.changes.items(), key=lambda change: -change[1][2])
    st.dataframe(
        pd.DataFrame(
            [(titles[name], f"{old:g}", f"{new:g}", 100 * gain) for name, (old, new, gain) in gains],
            columns=["Setting", "Before", "Suggested", "Gain"],
        ),
        column_config={
            "Before": st.column_config.TextColumn(alignment="right"),
            "Suggested": st.column_config.TextColumn(alignment="right"),
            "Gain": st.column_config.NumberColumn(
                format="+%.1f points",
                help="How much the change raised the score when it was made, in percentage points.",
            ),
        },
        hide_index=True,
        width=560,
        key=f"{KEY}.changes",
    )
    in_use = any(result.settings == found.matcher for result in view.results.values())
    if st.button(
        "In use" if in_use else "Use these settings", key=f"{KEY}.adopt", disabled=in_use, icon=":material/check:"
    ):
        adopt(found.matcher)


def _percent(objective: float) -> str:
    return f"{100 * objective:.1f} %"
