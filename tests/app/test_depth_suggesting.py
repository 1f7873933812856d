"""Suggest: a search in the background of the page, with progress, a stop button and reasons."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from streamlit.testing.v1 import AppTest

from stereolag.assess.judging import Criterion, Unjudged
from stereolag.assess.suggestion import Outcome, Suggestion, Trial
from stereolag.core.jobs import Estimate
from stereolag.core.typography import typeset
from stereolag.io.settings import read_matcher
from stereolag.stereo.finishing.stages import MedianFilter
from stereolag.stereo.opencv import StereoBM
from stereolag.ui.depth.pair_sets import PairJob
from stereolag.ui.depth.sentences import search_so_far, suggestion_in_words, value_in_words
from stereolag.ui.jobs import Job
from tests.app.depth_view import small_view

LIGHT = Estimate(0, 0.0)


def suggesting() -> None:
    from stereolag.ui.depth.tuning import show_suggest
    from tests.app.depth_view import small_view

    show_suggest(small_view())


def suggesting_blind() -> None:
    from dataclasses import replace

    from stereolag.stereo.methods import preset
    from stereolag.ui.depth.tuning import show_suggest
    from tests.app.depth_view import small_view

    view = small_view(truth=False)
    judge = preset("accurate").compute(view.pair.left, view.pair.right)
    show_suggest(replace(view, results={**view.results, "Semi-global": judge}))


def suggesting_with_blocks() -> None:
    from dataclasses import replace

    import streamlit as st

    from stereolag.stereo.opencv import StereoBM
    from stereolag.ui.depth.tuning import show_suggest
    from tests.app.depth_view import small_view

    view = small_view()
    size = st.session_state.get("block")
    if size is not None:
        found = StereoBM(num_disparities=64, block_size=size).compute(view.pair.left, view.pair.right)
        view = replace(view, results={**view.results, "StereoBM": found})
    show_suggest(view)


def begun(method: str = "StereoBM", script: Callable[[], None] = suggesting) -> AppTest:
    app = AppTest.from_function(script, default_timeout=60).run()
    app.segmented_control[0].set_value(method)
    app.segmented_control[1].set_value(10).run()
    return app.button[0].click().run()


def ended(app: AppTest) -> AppTest:
    app.session_state["depth.suggest"].job.result()
    return app.run()


def test_a_search_ends_with_reasons_and_settings_to_use() -> None:
    app = begun()
    assert not app.exception
    app.session_state["depth.suggest"].job.cancel()
    app = ended(app)
    assert not app.exception
    app = ended(begun())
    found = app.session_state["depth.suggest"].job.result()
    assert found.changes
    said = app.success[0].value
    assert typeset(f"Bad-2 on the whole images: **{found.bad_before:.1f} % → {found.bad:.1f} %**") in said
    assert list(app.dataframe[0].value.columns) == ["Setting", "Before", "Suggested"]
    assert len(app.dataframe[0].value) == len(found.changes)
    app.button[1].click().run()
    assert read_matcher(app.session_state["depth.adopt"].encode()) == found.matcher


def found_for_blocks(matcher: StereoBM, outcome: Outcome) -> AppTest:
    """Return the page after a search from StereoBM's defaults has found these settings."""
    app = AppTest.from_function(suggesting_with_blocks, default_timeout=60).run()
    start = StereoBM(num_disparities=64)
    found = Suggestion(start, matcher, outcome, Criterion.TRUE_BAD_2, 26.8, 30.0)
    job: Job[Suggestion] = Job(lambda job: found, LIGHT)
    job.result()
    app.session_state["depth.suggest"] = PairJob(small_view().pair.id.judged, start, job)
    app.segmented_control[0].set_value("StereoBM").run()
    assert not app.exception
    return app


def test_what_was_found_is_said_only_of_the_settings_asked_about() -> None:
    app = found_for_blocks(StereoBM(num_disparities=64), Outcome.AS_GOOD)
    assert "StereoBM" in app.success[0].value
    for name, shown in {"Convolution": 0, "StereoSGBM": 0, "StereoBM": 1}.items():
        app.segmented_control[0].set_value(name).run()
        assert not app.exception
        assert len(app.success) == shown, name
    app.session_state["block"] = 9
    assert not app.run().success
    app.session_state["block"] = None
    assert app.run().success


def test_a_suggestion_stays_once_it_is_in_use() -> None:
    better = StereoBM(num_disparities=64, block_size=11)
    app = found_for_blocks(better, Outcome.BETTER)
    assert "StereoBM" in app.success[0].value
    assert app.button[1].label == "Use these settings"
    app.session_state["block"] = 11
    app.run()
    assert app.button[1].label == "In use"
    assert app.button[1].disabled
    assert len(app.dataframe) == 1
    app.session_state["block"] = 9
    app.run()
    assert not app.success
    assert not app.dataframe


def test_a_search_that_runs_is_seen_and_ended_beside_every_method() -> None:
    app = AppTest.from_function(suggesting_blind, default_timeout=60).run()
    end = threading.Event()

    def work(job: Job[Suggestion]) -> Suggestion:
        job.report(0.5)
        while not (job.cancelled or end.wait(0.001)):
            pass
        return Suggestion(StereoBM(), StereoBM(), Outcome.AS_GOOD, Criterion.ESTIMATED_BAD_2, 30.0, 30.0)

    job = Job(work, LIGHT)
    app.session_state["depth.suggest"] = PairJob(small_view(truth=False).pair.id.judged, StereoBM(), job)
    try:
        for name in ("Convolution", "Semi-global"):
            app.segmented_control[0].set_value(name).run()
            assert not app.exception
            assert "StereoBM" in app.get("progress")[0].proto.text
        next(button for button in app.button if button.label == "Cancel").click().run()
        assert job.cancelled
    finally:
        end.set()


def test_without_ground_truth_it_says_estimated_and_by_what() -> None:
    app = begun("StereoBM", suggesting_blind)
    assert "**estimated** against the accurate preset" in app.markdown[0].value
    app = ended(app)
    assert "Estimated bad-2" in app.success[0].value


def test_nothing_judges_the_judge() -> None:
    app = AppTest.from_function(suggesting_blind, default_timeout=60).run()
    app.segmented_control[0].set_value("Semi-global").run()
    assert not app.exception
    assert "nothing to judge Semi-global by" in app.info[0].value
    assert not app.button


@pytest.mark.parametrize(
    ("outcome", "said"),
    [
        (
            Outcome.AS_GOOD,
            "Your StereoBM settings are as good: none of the 2 tried is clearly better. Estimated bad-2: **30.0 %**.",
        ),
        (Outcome.BETTER, "The best of 2 tried for StereoBM. Estimated bad-2 on the whole images: **30.0 % → 26.8 %**."),
        (Unjudged.TOO_LITTLE_MEASURED, "nothing to judge by"),
    ],
)
def test_what_came_of_it_in_words(outcome: Outcome | Unjudged, said: str) -> None:
    start, other = StereoBM(), StereoBM(block_size=11)
    third = Trial(StereoBM(block_size=9), 31, -1, whole=True)
    trials = Trial(other, 25, 3.1, whole=False), Trial(other, 26.8, 3.2, whole=True), third
    found = Suggestion(start, other, outcome, Criterion.ESTIMATED_BAD_2, 26.8, 30.0, trials)
    assert said in suggestion_in_words(found)
    none = Suggestion(start, start, Outcome.AS_GOOD, Criterion.TRUE_BAD_2, 30.0, 30.0)
    assert suggestion_in_words(none) == "StereoBM has no other settings to try over this range. Bad-2: **30.0 %**."
    assert search_so_far(none) == "StereoBM: 0 tried. Yours: bad-2 30.0 %."
    assert search_so_far(found) == "StereoBM: 2 tried. Yours: estimated bad-2 30.0 %. The best so far: 3.2 points less."


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (None, "off"),
        (True, "on"),
        (0.95, "0.95"),
        (9, "9"),
        ("zncc", "zncc"),
        (MedianFilter(), "Median radius 6, Median contrast 25"),
    ],
)
def test_values_in_words(value: object, said: str) -> None:
    assert value_in_words(value) == said


def test_cancel_keeps_the_best_so_far() -> None:
    app = begun("StereoSGBM")
    cancel = [button for button in app.button if button.label == "Cancel"]
    assert cancel
    assert app.button[0].disabled
    cancel[0].click().run()
    app = ended(app)
    assert not app.exception
    found = app.session_state["depth.suggest"].job.result()
    assert not found.finished
    assert "ended before" in app.success[0].value


def test_a_search_on_another_pair_is_called_off() -> None:
    app = begun("StereoSGBM")
    search = app.session_state["depth.suggest"]
    app.session_state["depth.suggest"] = replace(search, digest="another pair")
    app.run()
    assert not app.exception
    assert search.job.cancelled
    assert "depth.suggest" not in app.session_state
    assert not app.button[0].disabled
    search.job.result()


def test_a_job_runs_beside_and_can_be_called_off() -> None:
    started = threading.Event()

    def work(job: Job[str]) -> str:
        job.report(0.5)
        job.found("something")
        started.set()
        while not job.cancelled:
            threading.Event().wait(0.001)
        return "ended"

    job = Job(work, LIGHT)
    assert started.wait(10)
    assert job.running
    assert (job.progress, job.so_far) == (0.5, "something")
    job.cancel()
    assert job.result() == "ended"
    assert not job.running


def test_an_error_of_the_work_is_not_lost() -> None:
    def refuse(job: Job[Any]) -> None:
        raise ValueError("no")

    job = Job(refuse, LIGHT)
    with pytest.raises(ValueError, match="no"):
        job.result()
    assert not job.running
