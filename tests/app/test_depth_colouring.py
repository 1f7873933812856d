"""The colours of the maps: locked for a pair, and changed without recomputing anything."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from streamlit.testing.v1 import AppTest

from stereolag.stereo.matcher import StereoMatcher
from tests.app import keys
from tests.app.conftest import viewers

pytestmark = pytest.mark.usefixtures("small_pairs")

DEPTH = "pages/3_Depth_maps.py"
NEAR, FAR = "depth.colours.range.pair cube.near", "depth.colours.range.pair cube.far"


def colours(app: AppTest) -> dict[str, Any]:
    return viewers(app)[0]["colours"]


def test_changing_only_the_colours_computes_nothing(
    open_unfolded: Callable[[str], AppTest], monkeypatch: pytest.MonkeyPatch
) -> None:
    app = open_unfolded(DEPTH)
    computed: list[str] = []
    monkeypatch.setattr(StereoMatcher, "compute", lambda self, *_, **__: computed.append(type(self).__name__))
    pictures = [picture["digest"] for picture in viewers(app)[0]["pictures"]]
    app.number_input(key=NEAR).set_value(40.0).run()
    assert not app.exception
    assert computed == []
    assert colours(app)["high"] == 40
    assert [picture["digest"] for picture in viewers(app)[0]["pictures"]] == pictures


def test_the_range_follows_the_search_until_another_is_set(open_unfolded: Callable[[str], AppTest]) -> None:
    app = open_unfolded(DEPTH)
    assert (colours(app)["low"], colours(app)["high"]) == (0, 64)
    app.slider(key=keys.DISPARITIES).set_value(96).run()
    assert colours(app)["high"] == 96
    app.number_input(key=FAR).set_value(8.0).run()
    app.slider(key=keys.DISPARITIES).set_value(64).run()
    assert (colours(app)["low"], colours(app)["high"]) == (8, 96)
    app.button(key="depth.colours.follow").click().run()
    assert (colours(app)["low"], colours(app)["high"]) == (0, 64)


def test_what_lies_beyond_the_colours_is_said_and_can_be_fitted(open_unfolded: Callable[[str], AppTest]) -> None:
    app = open_unfolded(DEPTH)
    said = "beyond the colour range"
    assert not [markdown for markdown in app.markdown if said in markdown.value]
    app.number_input(key=NEAR).set_value(30.0).run()
    assert [markdown for markdown in app.markdown if said in markdown.value]
    app.button(key="depth.colours.fit_beyond").click().run()
    assert not [markdown for markdown in app.markdown if said in markdown.value]
    assert colours(app)["high"] > 40


def test_near_is_bright_and_the_reports_preset_turns_the_colours_round(
    open_unfolded: Callable[[str], AppTest],
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
