"""The outlines of the left image over the maps of the depth page."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from streamlit.testing.v1 import AppTest

from stereolag import samples
from stereolag.figures.pictures import edge_path
from stereolag.pair import example_pair
from stereolag.stereo.matcher import StereoMatcher
from stereolag.ui.depth import maps
from stereolag.ui.depth.maps import OUTLINED
from tests.app import keys
from tests.app.conftest import outlines, viewers

pytestmark = pytest.mark.usefixtures("small_pairs")

DEPTH = "pages/3_Depth_maps.py"


def test_the_switch_lays_the_edges_of_the_left_image_over_every_map(
    open_unfolded: Callable[[str], AppTest], monkeypatch: pytest.MonkeyPatch
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


def test_other_parts_without_maps_have_no_outlines(open_unfolded: Callable[[str], AppTest]) -> None:
    app = open_unfolded(DEPTH)
    app.toggle(key=OUTLINED).set_value(True)
    app.button_group(key=keys.PART).set_value("Why this match?").run()
    assert not app.exception
    assert outlines(app).keys() == {"depth.bench"}
