"""Every control of every page moves what is shown."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from streamlit.testing.v1 import AppTest

OpenPage = Callable[[str], AppTest]
Shown = Callable[[AppTest], str]

LAG, SEARCH, DEPTH = "pages/1_Sensor_lag.py", "pages/2_Rocketman_search.py", "pages/3_Depth_maps.py"

# page: control: what it is moved to
MOVES: dict[str, dict[str, Any]] = {
    LAG: {
        "recordings": "harbour",
        "lag.method": "phat",
        "lag.rate.recordings coast": 48_000.0,
        "lag.speed.recordings coast": 1_500.0,
        "lag.max.recordings coast": 1_000,
        "lag.from.recordings coast.50082": 1_000,
    },
    SEARCH: {
        "pictures": "maze_dulled",
        "template.method": "sampled",
        "template.min_score": 0.2,
        "template.max_matches": 5,
    },
    DEPTH: {
        "pairs": "square",
        "pairs.size": "1/2",
        "depth.view": "Truth",
        "depth.window": 9,
        "depth.overlap": 0.5,
        "depth.search": "centred",
        "depth.disparities.pair cube": 32,
        "depth.smallest": 20,
        "depth.vertical": 1,
        "depth.score": "cross",
        "depth.optimisation": True,
        "depth.texture": True,
        "depth.ambiguity": True,
        "depth.left_right": True,
        "depth.speckle": True,
        "depth.filling": True,
        "depth.median": True,
        "depth.bm.block": 9,
        "depth.bm.disparities.pair cube": 32,
        "depth.bm.smallest": 20,
        "depth.bm.uniqueness": 60,
        "depth.bm.texture": 8_010,
        "depth.bm.speckle_window_size": 200,
        "depth.bm.disp12_max_diff": 0,
        "depth.bm.pre_filter_cap": 3,
        "depth.part": "Scoreboard",
        "depth.colours.range.pair cube": (10.0, 90.0),
        "depth.colours.palette": "turbo",
        "depth.sgbm.block": 9,
        "depth.sgbm.disparities.pair cube": 32,
        "depth.sgbm.smallest": 20,
        "depth.sgbm.uniqueness": 60,
        "depth.sgbm.p1": 600,
        "depth.sgbm.p2": 3_000,
        "depth.sgbm.speckle_window_size": 1_000,
        "depth.sgbm.speckle_range": 0,
        "depth.sgbm.disp12_max_diff": 8,
        "depth.sgbm.pre_filter_cap": 63,
    },
}
# What must be set first: there is one exact copy, others count where more are wanted and less is enough.
FIRST: dict[str, dict[str, Any]] = {
    "template.min_score": {"template.max_matches": 5},
    "template.max_matches": {"template.min_score": 0.2},
    "depth.search": {"depth.overlap": 0.5},  # a square is searched in a moment if there are few windows
    "depth.texture": {"pairs": "road"},  # its sky is flat
} | {
    key: {"depth.part": "Scoreboard"}
    for key in MOVES[DEPTH]
    if key.startswith("depth.sgbm.")  # a third method there
}
SEEN_IN_THE_TIME_ALONE = {"depth.engine"}
ONLY_WITH_A_SQUARE_SEARCH: dict[str, Any] = {"depth.search_size.pair cube": 60, "depth.reach": 0}


def controls(app: AppTest) -> dict[str, Any]:
    widgets = [*app.slider, *app.number_input, *app.selectbox, *app.toggle, *app.get("button_group")]
    return {widget.key: widget for widget in widgets if not widget.disabled}


@pytest.mark.parametrize("page", MOVES)
def test_every_control_of_the_page_is_tested_here(open_unfolded: OpenPage, page: str) -> None:
    assert controls(open_unfolded(page)).keys() - SEEN_IN_THE_TIME_ALONE == MOVES[page].keys()


@pytest.mark.parametrize(("page", "key"), [(page, key) for page, moves in MOVES.items() for key in moves])
def test_moving_a_control_changes_what_is_shown(open_unfolded: OpenPage, shown: Shown, page: str, key: str) -> None:
    app = open_unfolded(page)
    for other, value in FIRST.get(key, {}).items():
        controls(app)[other].set_value(value).run()
    before = shown(app)
    controls(app)[key].set_value(MOVES[page][key]).run()
    assert not app.exception
    assert not app.error
    assert shown(app) != before


@pytest.mark.parametrize("key", ONLY_WITH_A_SQUARE_SEARCH)
def test_moving_a_control_of_the_square_search_changes_what_is_shown(
    open_unfolded: OpenPage, shown: Shown, key: str
) -> None:
    app = open_unfolded(DEPTH)
    controls(app)["depth.window"].set_value(31)
    controls(app)["depth.overlap"].set_value(0.5)  # few windows: a large square is searched in a moment
    controls(app)["depth.search"].set_value("centred").run()
    before = shown(app)
    controls(app)[key].set_value(ONLY_WITH_A_SQUARE_SEARCH[key]).run()
    assert not app.exception
    assert not app.error
    assert shown(app) != before


def test_going_back_to_a_setting_shows_the_same_again(open_unfolded: OpenPage, shown: Shown) -> None:
    app = open_unfolded(DEPTH)
    before = shown(app), [metric.value for metric in app.metric]
    app.slider(key="depth.window").set_value(31).run()
    app.slider(key="depth.window").set_value(20).run()
    assert (shown(app), [metric.value for metric in app.metric]) == before


def test_a_window_larger_than_its_search_area_is_refused_and_the_last_map_stays(
    open_unfolded: OpenPage, shown: Shown
) -> None:
    app = open_unfolded(DEPTH)
    controls(app)["depth.overlap"].set_value(0.5)
    controls(app)["depth.search"].set_value("centred").run()
    controls(app)["depth.search_size.pair cube"].set_value(60).run()
    before = shown(app)
    controls(app)["depth.window"].set_value(91).run()
    assert not app.exception
    assert [error.value for error in app.error] == [
        "search_size is 60 px and window_size 91 px; the search area must be at least as large as the window."
    ]
    assert shown(app) == before
    assert app.slider(key="depth.window").value == 91


def test_folding_settings_away_changes_nothing(open_unfolded: OpenPage, shown: Shown) -> None:
    app = open_unfolded(DEPTH)
    for key, value in {"depth.left_right": True, "depth.smallest": 20, "depth.bm.smallest": 20}.items():
        controls(app)[key].set_value(value).run()
    before = shown(app)
    for fold in ("depth.more", "depth.bm.more"):
        app.session_state[fold] = False
        app.run()
        assert shown(app) == before
    assert "depth.smallest" not in controls(app)
    app.session_state["depth.more"] = True
    app.run()
    assert controls(app)["depth.smallest"].value == 20
    assert controls(app)["depth.left_right"].value
    assert shown(app) == before


def test_an_adopted_value_beyond_the_page_s_own_bounds_is_kept_when_folded_away(open_page: OpenPage) -> None:
    app = open_page(f"{DEPTH}")
    app.session_state["depth.smallest"] = app.session_state["depth.smallest.adopted"] = -100
    app.run()
    app.session_state["depth.more"] = True
    app.run()
    assert app.slider(key="depth.smallest").value == -100
