"""An address restores the depth page; presets set its controls, and reset takes them back."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from streamlit.testing.v1 import AppTest

from tests.app import keys
from tests.app.conftest import PROJECT, figures, viewers

pytestmark = pytest.mark.usefixtures("small_pairs")

OpenPage = Callable[..., AppTest]
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


def tab(app: AppTest, method: str) -> AppTest:
    """Open the controls of a method."""
    return app.button_group(key=keys.TAB).set_value(method).run()


def test_the_address_says_what_is_not_as_at_first() -> None:
    app = linked()
    assert address(app) == {}
    app.slider(key=keys.WINDOW).set_value(31)
    app.button_group(key="pairs").set_value("square").run()
    tab(app, "bm").slider(key=keys.BLOCK).set_value(9).run()
    assert address(app) == {"pair": "square", "window_size": "31", "bm.block_size": "9"}
    tab(app, "correlation").slider(key=keys.WINDOW).set_value(20).run()
    assert address(app) == {"pair": "square", "bm.block_size": "9"}


def test_a_link_opens_the_page_as_it_was() -> None:
    link = {"pair": "square", "size": "1/2", "window_size": "31", "search.num_disparities": "40", "bm.block_size": "9"}
    app = linked(**{name.replace(".", "__"): value for name, value in link.items()})
    assert app.button_group(key="pairs").value == "square"
    assert app.slider(key=keys.WINDOW).value == 31
    assert (
        app.slider(key=keys.setting("correlation", "search.rectified.num_disparities", "pair square 1/2")).value == 40
    )
    assert tab(app, "bm").slider(key=keys.BLOCK).value == 9
    assert address(app) == link
    assert not app.warning


def test_a_link_to_a_square_search() -> None:
    app = linked(search__kind="centred", search__search_size="60", overlap="0.5")
    assert app.button_group(key=keys.SEARCH).value == "centred"
    assert app.slider(key=keys.SEARCH_SIZE).value == 60


@pytest.mark.parametrize(
    ("name", "value"),
    [("pair", "nowhere"), ("window_size", "1"), ("bm__block_size", "20"), ("size", "3"), ("maps", "bm,x"), ("x", "1")],
)
def test_a_bad_link_is_answered_with_a_sentence_and_opens_the_page(name: str, value: str) -> None:
    app = linked(**{name: value})
    sentences = [warning.value for warning in app.warning if "ignored" in warning.value]
    assert len(sentences) == 1
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
    app.button(key=keys.preset_key("reset")).click().run()
    assert not app.exception
    assert app.slider(key=keys.WINDOW).value == 20
    assert tab(app, "bm").slider(key=keys.BLOCK).value == 21
    tab(app, "correlation")
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
    app = linked(maps="sgm,sgbm", sgm__window_size="15")
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


def test_the_accurate_preset_shows_its_map_and_reset_brings_the_first_back(open_page: OpenPage) -> None:
    app = open_page(DEPTH)
    app.button(key=keys.preset_key("accurate")).click().run()
    assert not app.exception
    assert app.button_group(key=keys.TAB).value == "sgm"
    assert list(figures(app)) == ["StereoBM", "Semi-global"]
    assert address(app)["maps"] == "bm,sgm"
    app.button(key=keys.preset_key("reset")).click().run()
    assert list(figures(app)) == ["Convolution", "StereoBM"]
    assert address(app) == {}


def test_settings_within_settings_that_do_not_fit_together_are_refused_with_a_sentence() -> None:
    app = linked(maps="sgm")
    app.slider(key=keys.setting("sgm", "optimisation.penalty_small")).set_value(200).run()
    assert not app.exception
    assert [error.value for error in app.error] == [
        "penalty_small is 200, penalty_at_edges 80 and penalty_large 400; each must be at least as large as the one "
        "before."
    ]
