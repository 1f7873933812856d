"""The maps of the depth page: their colours and outlines, and the map before while one takes long."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
import pytest
from streamlit.testing.v1 import AppTest

from stereolag import samples
from stereolag.figures.pictures import edge_path
from stereolag.pair import example_pair
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.ui import results
from stereolag.ui.depth import maps
from stereolag.ui.depth.maps import OUTLINED
from tests.app import keys
from tests.app.conftest import figures, outlines, viewers
from tests.app.pages import DEPTH, OpenPage

pytestmark = pytest.mark.usefixtures("small_pairs")

NEAR, FAR = "depth.colours.range.pair cube.near", "depth.colours.range.pair cube.far"


def colours(app: AppTest) -> dict[str, Any]:
    return viewers(app)[0]["colours"]


def test_changing_only_the_colours_computes_nothing(open_unfolded: OpenPage, monkeypatch: pytest.MonkeyPatch) -> None:
    app = open_unfolded(DEPTH)
    computed: list[str] = []
    monkeypatch.setattr(StereoMatcher, "compute", lambda self, *_, **__: computed.append(type(self).__name__))
    pictures = [picture["digest"] for picture in viewers(app)[0]["pictures"]]
    app.number_input(key=NEAR).set_value(40.0).run()
    assert not app.exception
    assert computed == []
    assert colours(app)["high"] == 40
    assert [picture["digest"] for picture in viewers(app)[0]["pictures"]] == pictures


def test_the_range_follows_the_search_until_another_is_set(open_unfolded: OpenPage) -> None:
    app = open_unfolded(DEPTH)
    assert (colours(app)["low"], colours(app)["high"]) == (0, 64)
    app.slider(key=keys.DISPARITIES).set_value(96).run()
    assert colours(app)["high"] == 96
    app.number_input(key=FAR).set_value(8.0).run()
    app.slider(key=keys.DISPARITIES).set_value(64).run()
    assert (colours(app)["low"], colours(app)["high"]) == (8, 96)
    app.button(key="depth.colours.follow").click().run()
    assert (colours(app)["low"], colours(app)["high"]) == (0, 64)


def test_what_lies_beyond_the_colours_is_said_and_can_be_fitted(open_unfolded: OpenPage) -> None:
    app = open_unfolded(DEPTH)
    said = "beyond the colour range"
    assert not [markdown for markdown in app.markdown if said in markdown.value]
    app.number_input(key=NEAR).set_value(30.0).run()
    assert [markdown for markdown in app.markdown if said in markdown.value]
    app.button(key="depth.colours.fit_beyond").click().run()
    assert not [markdown for markdown in app.markdown if said in markdown.value]
    assert colours(app)["high"] > 40


def test_near_is_bright_and_the_reports_preset_turns_the_colours_round(
    open_unfolded: OpenPage,
) -> None:
    app = open_unfolded(DEPTH)

    def brightness() -> list[int]:
        palette = np.frombuffer(bytes.fromhex(colours(app)["palette"]), np.uint8).reshape(256, 3)
        return [int(palette[end].sum()) for end in (0, -1)]

    far, near = brightness()
    assert near > far
    app.button(key=keys.preset_key("report")).click().run()
    assert brightness() == [near, far]
    app.button(key=keys.preset_key("fast")).click().run()
    assert brightness() == [far, near]


def test_the_switch_lays_the_edges_of_the_left_image_over_every_map(
    open_unfolded: OpenPage, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[Any] = []
    monkeypatch.setattr(maps, "edge_path", lambda image: made.append(image) or edge_path(image))
    app = open_unfolded(DEPTH)
    assert outlines(app) == {}
    assert made == []
    pictures = [picture["digest"] for picture in viewers(app)[0]["pictures"]]
    computed: list[str] = []
    with monkeypatch.context() as patch:
        patch.setattr(StereoMatcher, "compute", lambda self, *_, **__: computed.append(type(self).__name__))
        app.toggle(key=OUTLINED).set_value(True).run()
    assert not app.exception
    assert computed == []
    assert outlines(app) == {"depth.bench": edge_path(example_pair(samples.stereo_pairs()["cube"]).left)}
    assert [picture["digest"] for picture in viewers(app)[0]["pictures"]] == pictures
    app.slider(key=keys.WINDOW).set_value(25).run()
    app.button_group(key=keys.PART).set_value("Compare").run()
    assert outlines(app).keys() == {"depth.bench", "depth.comparison"}
    assert len(made) == 1  # found once per pair
    app.toggle(key=OUTLINED).set_value(False).run()
    assert outlines(app) == {}


def test_the_map_before_stays_until_the_new_one_is_there(open_page: OpenPage, monkeypatch: pytest.MonkeyPatch) -> None:
    app = open_page(DEPTH)
    before = figures(app)["Convolution"]
    began, gate, compute = threading.Event(), threading.Event(), CorrelationMatcher.compute

    def late(self, left, right, *, progress=None):
        began.set()
        assert gate.wait(60)
        return compute(self, left, right)

    monkeypatch.setattr(CorrelationMatcher, "compute", late)
    monkeypatch.setattr(results, "is_heavy", lambda estimate: True)
    app.slider(key=keys.WINDOW).set_value(31).run()
    assert figures(app)["Convolution"] == before | {"Of": "the settings before"}
    assert began.wait(60)
    app.button(key="results.cancel.map correlation").click().run()
    gate.set()
    assert figures(app)["Convolution"] == before | {"Of": "the settings before"}
    app.button(key="results.again.map correlation").click().run()
    while "Of" in figures(app)["Convolution"]:
        app.run()
    assert figures(app)["Convolution"]["Coverage"] != before["Coverage"]
