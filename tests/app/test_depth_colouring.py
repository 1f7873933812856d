"""The colours of the maps: locked for a pair, and changed without computing anything again."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from streamlit.testing.v1 import AppTest

from stereolag.stereo.matcher import StereoMatcher
from tests.app import keys

DEPTH = "pages/3_Depth_maps.py"
RANGE = "depth.colours.range.pair cube"


def test_changing_only_the_colours_computes_nothing(
    open_unfolded: Callable[[str], AppTest], monkeypatch: pytest.MonkeyPatch
) -> None:
    app = open_unfolded(DEPTH)
    computed: list[str] = []
    monkeypatch.setattr(StereoMatcher, "compute", lambda self, *_, **__: computed.append(type(self).__name__))
    app.slider(key=RANGE).set_value((0.0, 40.0)).run()
    assert not app.exception
    assert computed == []


def test_the_range_holds_still_until_it_is_fitted_again(open_unfolded: Callable[[str], AppTest]) -> None:
    app = open_unfolded(DEPTH)
    first = app.slider(key=RANGE).value
    app.slider(key=keys.WINDOW).set_value(7).run()
    assert app.slider(key=RANGE).value == first
    app.slider(key=RANGE).set_value((0.0, 40.0)).run()
    assert app.slider(key=RANGE).value == (0.0, 40.0)
    app.button(key="depth.colours.fit").click().run()
    assert app.slider(key=RANGE).value == first
