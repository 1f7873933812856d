"""An address restores the depth page; presets set its controls, and reset takes them back."""

from __future__ import annotations

import pytest
from streamlit.testing.v1 import AppTest

from tests.app import keys
from tests.app.conftest import figures, viewers
from tests.app.pages import DEPTH, OpenPage, address, ignored, linked

pytestmark = pytest.mark.usefixtures("small_pairs")


def tab(app: AppTest, method: str) -> AppTest:
    """Open the controls of a method."""
    return app.button_group(key=keys.TAB).set_value(method).run()


def test_the_address_says_what_is_not_as_at_first() -> None:
    app = linked(DEPTH)
    assert address(app) == {}
    app.slider(key=keys.WINDOW).set_value(31)
    app.button_group(key="pairs").set_value("square").run()
    tab(app, "bm").slider(key=keys.BLOCK).set_value(9).run()
    assert address(app) == {"pair": "square", "window_size": "31", "bm.block_size": "9"}
    tab(app, "correlation").slider(key=keys.WINDOW).set_value(20).run()
    assert address(app) == {"pair": "square", "bm.block_size": "9"}


def test_a_link_opens_the_page_as_it_was() -> None:
    link = {"pair": "square", "size": "1/2", "window_size": "31", "search.num_disparities": "40", "bm.block_size": "9"}
    app = linked(DEPTH, **link)
    assert app.button_group(key="pairs").value == "square"
    assert app.slider(key=keys.WINDOW).value == 31
    disparities = keys.setting("correlation", "search.rectified.num_disparities", "pair square 1/2")
    assert app.slider(key=disparities).value == 40
    assert tab(app, "bm").slider(key=keys.BLOCK).value == 9
    assert address(app) == link
    assert not app.warning
    app = linked(DEPTH, search__kind="centred", search__search_size="60", overlap="0.5")
    assert app.button_group(key=keys.SEARCH).value == "centred"
    assert app.slider(key=keys.SEARCH_SIZE).value == 60


def test_what_is_bad_in_a_link_is_answered_with_a_sentence_each_and_opens_the_page() -> None:
    bad = {"pair": "nowhere", "window_size": "1", "bm.block_size": "20", "size": "3", "maps": "bm,x", "x": "1"}
    app = linked(DEPTH, **bad)
    said = ignored(app)
    assert len(said) == len(bad)
    assert all(any(f"“{value}”" in sentence for sentence in said) for value in bad.values())
    assert not app.error
    assert address(app) == {}


def test_presets_set_the_controls_and_reset_takes_them_back(open_unfolded: OpenPage) -> None:
    app = open_unfolded(DEPTH)
    app.button(key=keys.preset_key("report")).click().run()
    assert not app.exception
    assert app.button_group(key=keys.SEARCH).value == "centred"
    assert app.slider(key=keys.SEARCH_SIZE).value == 20
    app.button(key=keys.preset_key("fast")).click().run()
    assert not app.exception
    assert app.slider(key=keys.WINDOW).value == 11
    assert app.slider(key=keys.DISPARITIES).value == 64
    assert app.toggle(key=keys.LEFT_RIGHT).value
    tab(app, "bm").slider(key=keys.BLOCK).set_value(9).run()
    app.button(key=keys.preset_key("accurate")).click().run()
    assert not app.exception
    assert app.button_group(key=keys.TAB).value == "sgm"
    assert list(figures(app)) == ["StereoBM", "Semi-global"]
    assert address(app)["maps"] == "bm,sgm"
    app.button(key=keys.preset_key("reset")).click().run()
    assert not app.exception
    assert list(figures(app)) == ["Convolution", "StereoBM"]
    assert address(app) == {}
    assert tab(app, "bm").slider(key=keys.BLOCK).value == 21
    assert tab(app, "correlation").slider(key=keys.WINDOW).value == 20
    assert not app.toggle(key=keys.LEFT_RIGHT).value


def test_what_does_not_apply_is_disabled_and_counts_for_nothing(open_unfolded: OpenPage) -> None:
    app = open_unfolded(DEPTH)
    app.toggle(key=keys.MEDIAN).set_value(True).run()
    app.slider(key=keys.OVERLAP).set_value(0.5)
    app.button_group(key=keys.SEARCH).set_value("centred").run()
    assert app.toggle(key=keys.MEDIAN).disabled
    assert not app.error
    app.button_group(key=keys.SEARCH).set_value("rectified").run()
    assert app.toggle(key=keys.MEDIAN).value


def test_the_maps_shown_stand_in_the_address() -> None:
    app = linked(DEPTH, maps="sgm,sgbm", sgm__window_size="15")
    assert list(figures(app)) == ["StereoSGBM", "Semi-global"]
    assert app.slider(key=keys.setting("sgm", "window_size")).value == 15
    assert address(app) == {"maps": "sgbm,sgm", "sgm.window_size": "15"}
    app.button_group(key=keys.SHOWN).set_value(["bm"]).run()
    assert list(figures(app)) == ["StereoBM"]
    assert address(app)["maps"] == "bm"
    tab(app, "correlation")
    assert list(figures(app)) == ["Convolution", "StereoBM"]


def test_without_a_map_chosen_none_is_shown_and_one_is_asked_for(open_page: OpenPage) -> None:
    app = open_page(DEPTH)
    app.button_group(key=keys.SHOWN).set_value([]).run()
    assert not app.exception
    assert not app.error
    assert "depth.bench" not in {viewer["name"] for viewer in viewers(app)}
    assert [info.value for info in app.info] == ["No map is chosen. Choose one above."]
    assert address(app) == {}
    app.button_group(key=keys.PART).set_value("Compare").run()
    assert not app.exception
    assert [(viewer["colours"]["low"], viewer["colours"]["high"]) for viewer in viewers(app)] == [(0, 64)]
    app.button_group(key=keys.SHOWN).set_value(["sgbm"]).run()
    assert list(figures(app)) == ["StereoSGBM"]
    app.button_group(key=keys.SHOWN).set_value([]).run()
    tab(app, "bm")
    assert app.button_group(key=keys.SHOWN).value == ["bm"]
    assert list(figures(app)) == ["StereoBM"]
    assert not app.info


def test_settings_within_settings_that_do_not_fit_together_are_refused_with_a_sentence() -> None:
    app = linked(DEPTH, maps="sgm")
    app.slider(key=keys.setting("sgm", "optimisation.penalty_small")).set_value(200).run()
    assert not app.exception
    assert [error.value for error in app.error] == [
        "penalty_small is 200, penalty_at_edges 80 and penalty_large 400; each must be at least as large as the one "
        "before."
    ]
