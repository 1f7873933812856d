"""Suggest: a search beside the page, with progress, an end when asked for, and reasons."""

from __future__ import annotations

import threading
from dataclasses import replace
from typing import Any

import pytest
from streamlit.testing.v1 import AppTest

from stereolag.estimates import Estimate
from stereolag.reading import read_matcher
from stereolag.ui.jobs import Job

LIGHT = Estimate(0, 0.0)


def suggesting() -> None:
    from stereolag.ui.depth.suggesting import show_suggest
    from tests.app.depth_view import small_view

    show_suggest(small_view())


def begun(method: str = "StereoBM") -> AppTest:
    app = AppTest.from_function(suggesting, default_timeout=60).run()
    app.segmented_control[0].set_value(method)
    app.segmented_control[1].set_value(10)
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
    assert "these are the best" in app.success[0].value
    table = app.dataframe[0].value
    assert len(table) == len(found.changes)
    assert (table["Gain"] > 0).all()
    app.button[1].click().run()
    assert read_matcher(app.session_state["depth.adopt"].encode()) == found.matcher


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
