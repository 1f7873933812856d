"""Sweep: the offered values, the grid, and adopting a cell by a click."""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np
import pytest
from streamlit.testing.v1 import AppTest

from stereolag.assess.judging import TuningPair
from stereolag.assess.sweep import parameters, sweep
from stereolag.core.settings import changed
from stereolag.figures.maps import ContactSheet, sweep_bad, sweep_maps
from stereolag.io.settings import read_matcher
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS, preset
from stereolag.stereo.opencv import StereoBM
from stereolag.stereo.semi_global.cost_terms import MatchingCost
from stereolag.stereo.semi_global.matcher import SemiGlobalMatcher
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.stereo.windows.search import SearchArea
from stereolag.ui.depth.address import ADOPTED
from stereolag.ui.depth.tuning import Axis, settings_of_cell
from tests.app.depth_view import small_view


def sweeping() -> None:
    from stereolag.ui.depth.tuning import show_sweep
    from tests.app.depth_view import small_view

    show_sweep(small_view())


def blind_sweeping() -> None:
    from stereolag.ui.depth.tuning import show_sweep
    from tests.app.depth_view import small_view

    show_sweep(small_view(truth=False))


def sweeping_the_judge() -> None:
    from dataclasses import replace

    from stereolag.stereo.methods import preset
    from stereolag.ui.depth.tuning import show_sweep
    from tests.app.depth_view import small_view

    view = small_view(truth=False)
    result = preset("accurate").compute(view.pair.left, view.pair.right)
    show_sweep(replace(view, results={"Semi-global": result}))


def ended(app: AppTest) -> AppTest:
    app.session_state["depth.sweep"].job.result()
    return app.run()


def begun(values: tuple[str, str], script: Any = sweeping) -> AppTest:
    app = AppTest.from_function(script, default_timeout=120).run()
    for box, text in zip(app.text_input, values, strict=True):
        box.set_value(text)
    return app.run()


@pytest.mark.parametrize("matcher", [*(method() for method in METHODS), preset("fast"), preset("accurate")])
def test_every_value_offered_can_be_set(matcher: StereoMatcher) -> None:
    known = parameters(matcher)
    assert known
    for name, parameter in known.items():
        values = parameter.values(7)
        assert parameter.value in values
        assert 2 <= len(values) <= 7
        assert list(values) == sorted(set(values))
        fitting = 0
        for value in values:
            try:
                changed(matcher, {name: value})
                fitting += 1
            except ValueError as error:
                # A field alone never refuses, only a combination: a window larger than the search area, or P2 ≤ P1.
                assert any(words in str(error) for words in ("must be", "needs", "together"))
        assert fitting >= 2


def test_windows_are_tried_in_half_octaves_and_fractions_throughout() -> None:
    known = parameters(CorrelationMatcher(window_size=20, search=SearchArea.rectified(64)))
    assert known["window_size"].values(7) == (7, 10, 14, 20, 28, 40, 57)
    assert known["search.vertical"].values(4) == (0, 1, 2, 4)
    assert known["overlap"].values(5)[0] < 0.3
    assert parameters(StereoBM())["block_size"].values(5) == (11, 15, 21, 29, 43)


def test_what_has_no_effect_is_not_offered() -> None:
    assert "search.vertical" in parameters(CorrelationMatcher())
    assert "search.vertical" not in parameters(preset("fast"))
    assert "cost.gradient_limit" in parameters(SemiGlobalMatcher())
    assert "cost.gradient_limit" not in parameters(SemiGlobalMatcher(cost=MatchingCost(gradient=0)))
    assert "speckle_range" not in parameters(StereoBM())
    assert "speckle_range" in parameters(StereoBM(speckle_window_size=50))


@pytest.mark.parametrize(("script", "named"), [(sweeping, "bad-2"), (blind_sweeping, "estimated bad-2")])
def test_a_sweep_shows_a_map_and_a_figure_for_every_combination(script: Any, named: str) -> None:
    app = begun(("32, 64", "9 15;21"), script)
    assert not app.exception
    assert app.button[0].label == "Sweep 6 combinations"
    app = ended(app.button[0].click().run())
    assert not app.exception
    maps, bad = (json.loads(chart.proto.spec) for chart in app.get("plotly_chart"))
    assert maps["data"][0]["type"] == "image"
    assert bad["layout"]["xaxis"]["ticktext"] == ["9", "15", "21"]
    assert bad["layout"]["yaxis"]["ticktext"] == ["32", "64"]
    assert len(maps["data"][1]["text"]) == 6
    assert named in maps["data"][1]["text"][0]
    assert app.session_state["depth.sweep"].job.result().bad.shape == (2, 3)
    assert f"Right: {named}, %, lower is better." in app.caption[0].value
    assert ("estimated" in app.markdown[0].value) == (script is blind_sweeping)


def test_a_cell_is_taken_over_from_the_list_too_the_best_first() -> None:
    app = ended(begun(("48, 64", "11, 15")).button[0].click().run())
    cells = next(box for box in app.selectbox if box.label == "Take settings over")
    shares = [float(option.rpartition(": ")[2].removesuffix(" %")) for option in cells.options]
    assert len(shares) == 4
    assert shares == sorted(shares)
    row, col = map(int, re.findall(r" (\d+)[,:]", cells.options[0]))
    cells.set_value(cells.options[0]).run()
    assert not app.exception
    taken = read_matcher(app.session_state[ADOPTED].encode())
    assert isinstance(taken, CorrelationMatcher)
    assert (taken.search.num_disparities, taken.window_size) == (row, col)


def test_other_values_ask_for_another_sweep() -> None:
    app = ended(begun(("48, 64", "11, 15")).button[0].click().run())
    assert len(app.get("plotly_chart")) == 2
    app.text_input[1].set_value("11").run()
    assert not app.get("plotly_chart")
    app.text_input[1].set_value("15, 11").run()
    assert len(app.get("plotly_chart")) == 2


def test_a_sweep_can_be_called_off_and_keeps_its_maps() -> None:
    app = begun(("32, 48, 64", "9, 11, 13, 15, 17, 19, 21, 23")).button[0].click().run()
    assert app.button[0].disabled
    cancel = next(button for button in app.button if button.label == "Cancel")
    app = ended(cancel.click().run())
    assert not app.exception
    assert not app.button[0].disabled
    assert not app.session_state["depth.sweep"].job.result().finished
    assert "ended before" in app.caption[0].value


def test_maps_of_the_judge_itself_have_no_figure() -> None:
    app = AppTest.from_function(sweeping_the_judge, default_timeout=120).run()
    assert "nothing to judge Semi-global by" in app.markdown[0].value
    app.text_input[0].set_value("32, 64")
    app.text_input[1].set_value("7, 9").run()
    app = ended(app.button[0].click().run())
    assert not app.exception
    (maps,) = (json.loads(chart.proto.spec) for chart in app.get("plotly_chart"))
    assert "not judged" in maps["data"][1]["text"][0]


@pytest.mark.parametrize(
    ("text", "said"),
    [("5, wide", "not a list of whole numbers"), ("", "has 0 values"), (", ".join(map(str, range(30))), "30 values")],
)
def test_values_that_are_none_are_named(text: str, said: str) -> None:
    app = begun((text, "15"))
    assert not app.exception
    assert said in app.error[0].value
    assert not app.button


def test_one_setting_against_itself_is_refused() -> None:
    app = AppTest.from_function(sweeping, default_timeout=60).run()
    app.selectbox[0].set_value("window_size").run()
    assert not app.exception
    assert "two different settings" in app.error[0].value


def test_a_cell_gives_its_settings_to_the_page() -> None:
    matcher = CorrelationMatcher(window_size=15, search=SearchArea.rectified(64))
    known = parameters(matcher)
    axes = (
        Axis(known["search.num_disparities"], (32, 64)),
        Axis(known["window_size"], (9, 15, 21)),
    )
    wanted = CorrelationMatcher(window_size=21, search=SearchArea.rectified(32))
    assert settings_of_cell(matcher, axes, 0, 2) == wanted


def test_the_figures_show_holes_and_frames() -> None:
    view = small_view()
    tuning_pair = TuningPair.of(view.pair.left, view.pair.right, view.pair.truth)
    centred = CorrelationMatcher(window_size=9, search=SearchArea.centred(33))
    grid = sweep(centred, [tuning_pair], rows=("window_size", [9, 41]), cols=("search.search_size", [33, 64]))
    sheet = ContactSheet.of(grid, view.pair.left.shape)
    assert sheet.maps.shape == (2 * sheet.height, 2 * sheet.width)
    assert np.isnan(sheet.maps[sheet.height :, : sheet.width]).all()
    for figure in (
        sweep_maps(sheet, ("Window", "Search area"), view.colours, (0, 0)),
        sweep_bad(sheet, ("Window", "Search area"), (0, 0)),
    ):
        assert [shape.line.dash for shape in figure.layout.shapes] == ["solid", "dot"]
        assert "does not fit" in figure.data[1].text[2]
