"""A map that takes long: the previous map stays in its place until then, and says so."""

from __future__ import annotations

import threading
from collections.abc import Callable

import pytest
from streamlit.testing.v1 import AppTest

from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.ui import results
from tests.app import keys
from tests.app.conftest import figures

OpenPage = Callable[..., AppTest]


def test_the_map_before_stays_until_the_new_one_is_there(open_page: OpenPage, monkeypatch: pytest.MonkeyPatch) -> None:
    app = open_page("pages/3_Depth_maps.py")
    before = figures(app)["Convolution"]
    began, gate, compute = threading.Event(), threading.Event(), CorrelationMatcher.compute

    def late(self, left, right, *, progress=None):
        began.set()
        assert gate.wait(60)
        return compute(self, left, right)

    monkeypatch.setattr(CorrelationMatcher, "compute", late)
    monkeypatch.setattr(results, "is_heavy", lambda estimate: True)
    app.slider(key=keys.WINDOW).set_value(25).run()
    assert figures(app)["Convolution"] == before | {"Of": "the settings before"}
    assert began.wait(60)
    app.button(key="results.cancel.map correlation").click().run()
    gate.set()
    assert figures(app)["Convolution"] == before | {"Of": "the settings before"}
    app.button(key="results.again.map correlation").click().run()
    while "Of" in figures(app)["Convolution"]:
        app.run()
    assert figures(app)["Convolution"]["Coverage"] != before["Coverage"]
