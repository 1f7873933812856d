"""The table of all methods, and repeated run times of one method."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pytest
from streamlit.testing.v1 import AppTest

from stereolag.figures.recordings import run_times
from stereolag.ui.lag import comparison

OpenPage = Callable[..., AppTest]
BUTTON = "lag.comparison.recordings coast.button"


def waited(app: AppTest) -> AppTest:
    """Return the page once its job is done."""
    for _ in range(300):
        if not any(one.label == "Cancel" for one in app.button):
            return app
        time.sleep(0.2)
        app.run()
    raise AssertionError("the job goes on and on")


def test_every_method_has_a_row_with_its_lag_and_verdict(open_page: OpenPage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(comparison, "LONGEST_S", 3.0)
    app = open_page("pages/1_Sensor_lag.py")
    assert not app.dataframe
    app.button(key=BUTTON).click().run()
    table = waited(app).dataframe[0].value
    assert list(table["Method"]) == ["FFT", "GCC-PHAT", "Sampled", "Direct"]
    assert list(table["Lag, samples"]) == ["50,082"] * 3 + ["–"]
    assert list(table["Verdict"]) == ["sure"] * 3 + ["left out"]
    assert table["Took"][3].startswith("about ")


def test_runs_are_timed_and_drawn(open_page: OpenPage) -> None:
    app = open_page("pages/1_Sensor_lag.py")
    app.slider(key="lag.runs").set_value(10).run()
    app.button(key="lag.run_times.recordings coast.button").click().run()
    waited(app)
    assert any(one.value.startswith("FFT: half of the runs took less than ") for one in app.caption)
    app.slider(key="lag.runs").set_value(20).run()
    assert not any("half of the runs" in one.value for one in app.caption)


def test_the_histogram_holds_every_run_and_the_median() -> None:
    seconds = np.random.default_rng(0).uniform(0.01, 0.02, 51)
    figure = run_times(seconds)
    assert len(figure.data[0].x) == 51
    assert figure.layout.shapes[0].x0 == pytest.approx(1e3 * np.median(seconds))
