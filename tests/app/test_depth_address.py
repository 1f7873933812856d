"""The depth page is opened by its address as it was, set to what a preset says, and reset."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from streamlit.testing.v1 import AppTest

from tests.app.conftest import PROJECT

OpenPage = Callable[[str], AppTest]
DEPTH = "pages/3_Depth_maps.py"


def linked(**parameters: str) -> AppTest:
    app = AppTest.from_file(PROJECT / "app.py", default_timeout=60).switch_page(DEPTH)
    for name, value in parameters.items():
        app.query_params[name.replace("__", ".")] = value
    app.run()
    assert not app.exception
    return app


def address(app: AppTest) -> dict[str, str]:
    return {name: value if isinstance(value, str) else value[0] for name, value in app.query_params.items()}


def test_the_address_says_what_is_not_as_at_first() -> None:
    app = linked()
    assert address(app) == {}
    app.slider(key="depth.window").set_value(31)
    app.slider(key="depth.bm.block").set_value(9)
    app.button_group(key="pairs").set_value("square").run()
    assert address(app) == {"pair": "square", "window_size": "31", "bm.block_size": "9"}
    app.slider(key="depth.window").set_value(20).run()
    assert address(app) == {"pair": "square", "bm.block_size": "9"}


def test_a_link_opens_the_page_as_it_was() -> None:
    link = {"pair": "square", "size": "1/2", "window_size": "31", "search.num_disparities": "40", "bm.block_size": "9"}
    app = linked(**{name.replace(".", "__"): value for name, value in link.items()})
    assert app.button_group(key="pairs").value == "square"
    assert app.slider(key="depth.window").value == 31
    assert app.slider(key="depth.bm.block").value == 9
    assert app.slider(key="depth.disparities.pair square 1/2").value == 40
    assert address(app) == link
    assert not app.warning


def test_a_link_to_a_square_search() -> None:
    app = linked(search__kind="centred", search__search_size="60", overlap="0.5")
    assert app.button_group(key="depth.search").value == "centred"
    assert app.slider(key="depth.search_size.pair cube").value == 60


@pytest.mark.parametrize(
    ("name", "value"), [("pair", "nowhere"), ("window_size", "1"), ("bm__block_size", "20"), ("size", "3"), ("x", "1")]
)
def test_a_bad_link_is_answered_with_a_sentence_and_opens_the_page(name: str, value: str) -> None:
    app = linked(**{name: value})
    sentences = [warning.value for warning in app.warning if "ignored" in warning.value]
    assert len(sentences) == 1
    assert not app.error
    assert address(app) == {}


def test_presets_set_the_controls_and_reset_takes_them_back(open_unfolded: OpenPage) -> None:
    app = open_unfolded(DEPTH)
    app.button(key="depth.preset.report").click().run()
    assert not app.exception
    assert app.button_group(key="depth.search").value == "centred"
    assert app.slider(key="depth.search_size.pair cube").value == 40
    app.button(key="depth.preset.dense").click().run()
    assert not app.exception
    assert app.slider(key="depth.window").value == 11
    assert app.slider(key="depth.disparities.pair cube").value == 64
    assert app.toggle(key="depth.left_right").value
    app.slider(key="depth.bm.block").set_value(9).run()
    app.button(key="depth.preset.reset").click().run()
    assert not app.exception
    assert app.slider(key="depth.window").value == 20
    assert app.slider(key="depth.bm.block").value == 21
    assert not app.toggle(key="depth.left_right").value


def test_what_does_not_apply_is_disabled_and_counts_for_nothing(open_unfolded: OpenPage) -> None:
    app = open_unfolded(DEPTH)
    assert app.slider(key="depth.bm.speckle_range").disabled
    app.slider(key="depth.bm.speckle_window_size").set_value(50).run()
    assert not app.slider(key="depth.bm.speckle_range").disabled
    assert app.slider(key="depth.cost.census").disabled
    app.toggle(key="depth.median").set_value(True).run()
    app.slider(key="depth.overlap").set_value(0.5)
    app.button_group(key="depth.search").set_value("centred").run()
    assert app.toggle(key="depth.median").disabled
    assert not app.error
    app.button_group(key="depth.search").set_value("rectified").run()
    assert app.toggle(key="depth.median").value
