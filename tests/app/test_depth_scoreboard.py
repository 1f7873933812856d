"""The scoreboard: right figures, the best of them marked, and a note if there is no ground truth."""

from __future__ import annotations

import json

import numpy as np
import pytest
from streamlit.testing.v1 import AppTest

from stereolag.assess.judging import measured_reference
from stereolag.core.typography import typeset
from stereolag.figures.maps import ERROR_COLOURS, NO_TRUTH, error_png
from stereolag.figures.pictures import NO_ANSWER
from stereolag.io.images import read_image
from stereolag.stereo.evaluation import evaluate
from tests.app.depth_view import small_view


def scoreboard() -> None:
    from stereolag.ui.depth.comparing import show_scoreboard
    from tests.app.depth_view import small_view

    show_scoreboard(small_view())


def scoreboard_with_mask() -> None:
    from dataclasses import replace

    import numpy as np

    from stereolag.pair import PairId
    from stereolag.ui.depth.comparing import show_scoreboard
    from tests.app.depth_view import small_view

    view = small_view()
    visible = np.arange(view.pair.left.shape[1])[None].repeat(view.pair.left.shape[0], axis=0) > 100
    show_scoreboard(replace(view, pair=replace(view.pair, visible=visible, id=PairId("masked"))))


def scoreboard_without_truth() -> None:
    from dataclasses import replace

    from stereolag.stereo.methods import preset
    from stereolag.ui.depth.comparing import show_scoreboard
    from tests.app.depth_view import small_view

    view = small_view(truth=False)
    judge = preset("accurate").compute(view.pair.left, view.pair.right)
    show_scoreboard(replace(view, results={**view.results, "Semi-global": judge}))


def scoreboard_of_unrelated_images() -> None:
    from dataclasses import replace

    import numpy as np

    from stereolag.pair import PairId
    from stereolag.ui.depth.comparing import show_scoreboard
    from tests.app.depth_view import small_view

    view = small_view(truth=False)
    noise = np.random.default_rng(0).integers(0, 256, view.pair.right.shape, dtype=np.uint8)
    show_scoreboard(replace(view, pair=replace(view.pair, right=noise, id=PairId("unrelated"))))


def test_the_table_holds_the_figures_of_the_evaluation() -> None:
    app = AppTest.from_function(scoreboard, default_timeout=60).run()
    assert not app.exception
    view = small_view()
    table = app.dataframe[0].value
    assert list(table.index) == list(view.results)
    for name, result in view.results.items():
        judged = evaluate(result.disparity, view.pair.truth)
        assert table.loc[name, "Density"] == pytest.approx(100 * judged.density)
        assert table.loc[name, "EPE"] == pytest.approx(judged.epe)
        assert table.loc[name, "Bad-0.5"] == pytest.approx(judged.bad[0.5])
        assert table.loc[name, "D1-all"] == pytest.approx(judged.d1_all)
    assert len(app.get("imgs") or app.get("image")) == len(view.results)


def test_missing_pixels_can_be_left_out() -> None:
    app = AppTest.from_function(scoreboard, default_timeout=60).run()
    counted = app.dataframe[0].value
    left_out = app.segmented_control[0].set_value("are left out").run()
    assert not left_out.exception
    table = left_out.dataframe[0].value
    assert "D1-all" not in table
    assert (table["Bad-1"] < counted["Bad-1"]).all()


def test_the_best_of_each_column_is_marked_once() -> None:
    app = AppTest.from_function(scoreboard, default_timeout=60).run()
    styles = app.dataframe[0].proto.arrow_data.styler.styles
    table = app.dataframe[0].value
    best = [table["Density"].argmax(), *(table[name].argmin() for name in table.columns[1:])]
    for col, row in enumerate(best):
        assert f"row{row}_col{col}" in styles


def test_visible_pixels_are_judged_apart() -> None:
    app = AppTest.from_function(scoreboard_with_mask, default_timeout=60).run()
    assert not app.exception
    everything, visible = (table.value for table in app.dataframe)
    assert (visible["Density"] > everything["Density"]).all()
    assert any("Seen by both cameras" in one.value for one in app.markdown)


def test_the_curve_is_a_line_with_a_score_and_a_dot_without() -> None:
    app = AppTest.from_function(scoreboard, default_timeout=60).run()
    traces = json.loads(app.get("plotly_chart")[-1].proto.spec)["data"]
    assert [trace["mode"] for trace in traces] == ["lines", "markers", "markers"]


def test_without_truth_the_figures_are_estimates_and_say_by_what() -> None:
    app = AppTest.from_function(scoreboard_without_truth, default_timeout=60).run()
    assert not app.exception
    view = small_view(truth=False)
    reference = measured_reference(view.pair.left, view.pair.right, search_range=(0, 64))
    assert "**estimates**" in app.markdown[0].value
    measured = f"{100 * np.isfinite(reference).mean():.0f} % of the pixels that the accurate preset"
    assert typeset(measured) in app.markdown[0].value
    table = app.dataframe[0].value
    for name, result in view.results.items():
        judged = evaluate(result.disparity, reference, thresholds=(2.0,))
        assert table.loc[name, "Estimated bad-2"] == pytest.approx(judged.bad[2.0])
    assert table["Estimated bad-2"].is_monotonic_increasing
    assert "Semi-global" not in table.index
    assert "would judge itself" in app.caption[0].value
    assert len(app.get("imgs") or app.get("image")) == len(view.results)


def test_unrelated_images_are_not_judged() -> None:
    app = AppTest.from_function(scoreboard_of_unrelated_images, default_timeout=60).run()
    assert not app.exception
    assert "nothing to judge by" in app.info[0].value
    assert not app.dataframe


def test_the_map_of_errors_has_a_colour_for_everything() -> None:
    truth = np.array([[10, 10, 10, 10, np.nan]], dtype=np.float32)
    disparity = np.array([[10, 14, 99, np.nan, 10]], dtype=np.float32)
    picture = read_image(error_png(disparity, truth))[0].tolist()
    worst = ERROR_COLOURS[-1].tolist()
    assert picture == [ERROR_COLOURS[0].tolist(), worst, worst, list(NO_ANSWER), list(NO_TRUTH)]


def test_a_sparse_truth_is_drawn_thicker() -> None:
    truth = np.full((6, 7), np.nan, dtype=np.float32)
    truth[2, 3] = truth[5, 0] = 10
    picture = read_image(error_png(np.full((6, 7), 10, dtype=np.float32), truth))
    right = (picture == ERROR_COLOURS[0]).all(axis=2)
    expected = np.zeros((6, 7), dtype=bool)
    expected[1:4, 2:5] = expected[4:, :2] = True
    np.testing.assert_array_equal(right, expected)


def test_a_wide_map_of_errors_is_thinned_and_none_of_its_colours_mixed() -> None:
    truth = np.zeros((30, 4_000), dtype=np.float32)
    disparity = np.where(np.arange(4_000) % 7 < 3, np.float32(0), np.float32(10)) + truth
    picture = read_image(error_png(disparity, truth))
    assert picture.shape == (10, 1_334, 3)
    assert {tuple(pixel) for pixel in picture.reshape(-1, 3).tolist()} == {
        tuple(ERROR_COLOURS[0].tolist()),
        tuple(ERROR_COLOURS[-1].tolist()),
    }
