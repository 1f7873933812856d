"""The map of a slider that is moved, as its stream answers before the page runs."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from streamlit.testing.v1 import AppTest

from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.ui import results
from stereolag.ui.controls import class_of
from stereolag.ui.depth.live import MovedSlider
from tests.app import keys
from tests.app.conftest import viewers
from tests.app.pages import DEPTH, OpenPage
from tests.packed import unpacked, values_of

Answer = tuple[dict[str, Any], list[bytes]]


def answered(app: AppTest, key: str, value: int, *, whole: bool) -> Answer:
    """Return the header and the parts of the answer to a moved slider, from a thread as streams have."""
    moved = MovedSlider(slider=class_of(key), value=value, whole=whole, parts=())
    with ThreadPoolExecutor(1) as pool:
        return unpacked(pool.submit(app.session_state["live.sliders"].answered, moved).result())


@pytest.fixture
def app(open_page: OpenPage, small_pairs: Any) -> AppTest:
    return open_page(DEPTH)


def test_a_released_slider_has_the_map_that_the_page_brings_and_it_is_computed_once(
    app: AppTest, monkeypatch: pytest.MonkeyPatch
) -> None:
    computed: list[int] = []
    compute = CorrelationMatcher.compute
    monkeypatch.setattr(
        CorrelationMatcher, "compute", lambda self, *a, **b: computed.append(self.window_size) or compute(self, *a, **b)
    )
    header, (picture,) = answered(app, keys.WINDOW, 17, whole=True)
    described, parts = unpacked(picture)
    assert app.slider(key=keys.WINDOW).value != 17  # Streamlit has not been told yet
    app.slider(key=keys.WINDOW).set_value(17).run()
    assert computed == [17]
    shown = viewers(app)[0]["pictures"][0]
    assert (header["title"], header["digest"], header["whole"]) == (shown["title"], shown["digest"], True)
    assert described["digest"] == header["digest"]
    assert values_of(described["readings"][0], parts).shape == (viewers(app)[0]["rows"], viewers(app)[0]["cols"])


def test_while_it_is_dragged_the_map_is_of_smaller_images_and_says_so(app: AppTest) -> None:
    header, (picture,) = answered(app, keys.BLOCK, 21, whole=False)
    described, parts = unpacked(picture)
    values = values_of(described["readings"][0], parts)
    rows, cols = viewers(app)[0]["rows"], viewers(app)[0]["cols"]
    assert values.shape == (round(rows / 2), round(cols / 2))
    assert header["figures"][0]["label"] == "Preview"
    assert {one["label"] for one in header["figures"]} >= {"Coverage", "EPE"}
    assert np.nanmax(values) > 32  # px of the whole images


def test_there_is_no_map_if_it_would_take_long_or_the_settings_are_refused(
    app: AppTest, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert answered(app, keys.BLOCK, 20, whole=True)[1] == []  # even
    assert answered(app, "depth.unknown", 20, whole=True)[1] == []
    monkeypatch.setattr(results, "is_heavy", lambda _: True)
    for whole in (True, False):
        assert answered(app, keys.BLOCK, 45, whole=whole)[1] == []
