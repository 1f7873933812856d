"""The maps of the depth page: their colours and outlines, the one before while one takes long, and of moved sliders."""

import threading
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from streamlit.testing.v1 import AppTest

from stereolag import CorrelationMatcher, samples
from stereolag.figures.pictures import edge_path
from stereolag.pair_sources import example_pair
from stereolag.stereo.matcher import StereoMatcher
from stereolag.ui import results
from stereolag.ui.controls import class_of
from stereolag.ui.depth import view
from stereolag.ui.depth.live import MovedSlider
from stereolag.ui.depth.view import OUTLINED
from tests.app import keys
from tests.app.pages import DEPTH, moved, open_page, open_unfolded, until
from tests.app.reading import figures, outlines, viewers
from tests.packed import unpacked, values_of

NEAR, FAR = "depth.colours.range.pair cube.near", "depth.colours.range.pair cube.far"


@pytest.fixture
def computed(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Return a list to which every matcher is added that computes a map."""
    matchers: list[Any] = []
    compute = StereoMatcher.compute

    def noted(self: StereoMatcher, *given: Any, **more: Any) -> Any:
        matchers.append(self)
        return compute(self, *given, **more)

    monkeypatch.setattr(StereoMatcher, "compute", noted)
    return matchers


def colours(app: AppTest) -> dict[str, Any]:
    return viewers(app)[0]["colours"]


def pictures(app: AppTest) -> list[str]:
    """Return what tells the pictures of the maps apart."""
    return [picture["digest"] for picture in viewers(app)[0]["pictures"]]


def test_the_range_follows_the_search_until_another_is_set() -> None:
    app = open_unfolded(DEPTH)
    assert (colours(app)["low"], colours(app)["high"]) == (0, 64)
    moved(app, {keys.DISPARITIES: 96})
    assert colours(app)["high"] == 96
    moved(app, {FAR: 8.0})
    moved(app, {keys.DISPARITIES: 64})
    assert (colours(app)["low"], colours(app)["high"]) == (8, 96)
    app.button(key="depth.colours.follow").click().run()
    assert (colours(app)["low"], colours(app)["high"]) == (0, 64)


def test_what_lies_beyond_the_colours_is_said_and_can_be_fitted_and_nothing_is_computed(computed: list[Any]) -> None:
    app = open_unfolded(DEPTH)

    def said() -> bool:
        return any("Outside the colour range" in markdown.value for markdown in app.markdown)

    assert not said()
    before = pictures(app)
    computed.clear()
    moved(app, {NEAR: 30.0})
    assert said()
    assert colours(app)["high"] == 30
    app.button(key="depth.colours.fit_beyond").click().run()
    assert not said()
    assert colours(app)["high"] > 40
    assert computed == []
    assert pictures(app) == before


def test_the_reports_preset_turns_the_colours_round_and_another_turns_them_back() -> None:
    app = open_unfolded(DEPTH)
    palette = bytes.fromhex(colours(app)["palette"])
    backwards = np.frombuffer(palette, np.uint8).reshape(256, 3)[::-1].tobytes()
    for preset, shown in (("report", backwards), ("fast", palette)):
        app.button(key=keys.preset_key(preset)).click().run()
        assert bytes.fromhex(colours(app)["palette"]) == shown


def test_the_switch_lays_the_edges_of_the_left_image_over_every_map(computed, monkeypatch):
    made: list[Any] = []
    monkeypatch.setattr(view, "edge_path", lambda image: made.append(image) or edge_path(image))
    app = open_unfolded(DEPTH)
    assert outlines(app) == {}
    assert made == []
    before = pictures(app)
    computed.clear()
    moved(app, {OUTLINED: True})
    assert computed == []
    assert outlines(app) == {"depth.bench": edge_path(example_pair(samples.stereo_pairs()["cube"]).left)}
    assert pictures(app) == before
    moved(app, {keys.WINDOW: 25, keys.PART: "Compare"})
    assert outlines(app).keys() == {"depth.bench", "depth.comparison"}
    assert len(made) == 1  # found once per pair
    assert outlines(moved(app, {OUTLINED: False})) == {}


def test_the_map_before_stays_until_the_new_one_is_there(monkeypatch: pytest.MonkeyPatch) -> None:
    app = open_page(DEPTH)
    before = figures(app)["Convolution"]
    began, gate, compute = threading.Event(), threading.Event(), CorrelationMatcher.compute

    def late(self, left, right, *, progress=None):
        began.set()
        gate.wait()
        return compute(self, left, right)

    monkeypatch.setattr(CorrelationMatcher, "compute", late)
    monkeypatch.setattr(results, "is_heavy", lambda estimate: True)
    moved(app, {keys.WINDOW: 31})
    assert figures(app)["Convolution"] == before | {"Of": "the previous settings"}
    began.wait()
    app.button(key="results.cancel.map correlation").click().run()
    gate.set()
    assert figures(app)["Convolution"] == before | {"Of": "the previous settings"}
    app.button(key="results.again.map correlation").click().run()
    until(lambda: "Of" not in figures(app.run())["Convolution"])
    assert figures(app)["Convolution"]["Coverage"] != before["Coverage"]


# The map of a slider that is moved, as its stream answers before the page runs


def answered(app: AppTest, key: str, value: int, *, whole: bool) -> tuple[dict[str, Any], list[bytes]]:
    """Return the header and the parts of the answer to a moved slider, from a thread as streams have."""
    change = MovedSlider(slider=class_of(key), value=value, whole=whole, parts=())
    with ThreadPoolExecutor(1) as pool:
        return unpacked(pool.submit(app.session_state["live.sliders"].answered, change).result())


def test_a_released_slider_has_the_map_that_the_page_brings_and_it_is_computed_once(computed: list[Any]) -> None:
    app = open_page(DEPTH)
    computed.clear()
    header, (picture,) = answered(app, keys.WINDOW, 17, whole=True)
    described, parts = unpacked(picture)
    assert app.slider(key=keys.WINDOW).value != 17  # Streamlit has not been told yet
    moved(app, {keys.WINDOW: 17})
    assert [matcher.window_size for matcher in computed] == [17]
    shown = viewers(app)[0]["pictures"][0]
    assert (header["title"], header["digest"], header["whole"]) == (shown["title"], shown["digest"], True)
    assert described["digest"] == header["digest"]
    assert values_of(described["readings"][0], parts).shape == (viewers(app)[0]["rows"], viewers(app)[0]["cols"])


def test_while_it_is_dragged_the_map_is_of_smaller_images_and_says_so() -> None:
    app = open_page(DEPTH)
    header, (picture,) = answered(app, keys.BLOCK, 21, whole=False)
    described, parts = unpacked(picture)
    values = values_of(described["readings"][0], parts)
    assert values.shape == (round(viewers(app)[0]["rows"] / 2), round(viewers(app)[0]["cols"] / 2))
    assert header["figures"][0]["label"] == "Preview"
    assert {one["label"] for one in header["figures"]} >= {"Coverage", "EPE"}
    assert np.nanmax(values) > 32  # px of the whole images


def test_there_is_no_map_if_it_would_take_long_or_the_settings_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    app = open_page(DEPTH)
    assert answered(app, keys.BLOCK, 20, whole=True)[1] == []  # even
    assert answered(app, "depth.unknown", 20, whole=True)[1] == []
    monkeypatch.setattr(results, "is_heavy", lambda _: True)
    for whole in (True, False):
        assert answered(app, keys.BLOCK, 45, whole=whole)[1] == []
