"""The parts of the depth page that look closer at the maps: comparison, values, reasons, scores, and in 3-D."""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import plotly.io
import pytest
from streamlit.testing.v1 import AppTest

from stereolag import CorrelationMatcher, evaluate, preset, read_image
from stereolag.assess.explaining import explain_match
from stereolag.assess.judging import measured_reference
from stereolag.core.typography import typeset
from stereolag.figures.clouds import birds_eye, point_cloud
from stereolag.figures.maps import ERROR_COLOURS, NO_TRUTH, error_png
from stereolag.figures.pictures import NO_ANSWER
from stereolag.geometry.scene import birds_eye_view
from stereolag.pair import PairId
from stereolag.ui.depth.comparing import show_comparison, show_scoreboard
from stereolag.ui.depth.distances import VIEWS, show_readout, show_space
from stereolag.ui.depth.explaining import show_blanks, show_inspection, show_overlap
from tests.app.depth_view import part_of_page, small_view
from tests.app.reading import charts, viewers
from tests.packed import delivered, told

METHODS = ["Convolution", "StereoBM", "StereoSGBM"]


def titles(app: AppTest) -> list[str]:
    return [picture["title"] for picture in viewers(app)[0]["pictures"]]


# Compare


def test_every_method_stands_beside_the_truth_in_one_range() -> None:
    app = part_of_page(show_comparison)
    assert titles(app) == ["Left image", *METHODS, "Ground truth", "Convolution − Ground truth", "Agreement"]
    legends = [legend["title"] for legend in viewers(app)[0]["legends"]]
    assert legends == ["disparity, px, and distance", "", "difference, px", "agreement"]
    assert typeset("All 3 methods agree to 1 px") in app.markdown[-1].value
    assert typeset("are wrong by more than 1 px") in app.markdown[-1].value
    app.selectbox(key="depth.comparison.first").set_value("Ground truth").run()
    app.selectbox(key="depth.comparison.second").set_value("StereoBM").run()
    assert "Ground truth − StereoBM" in titles(app)


def test_without_truth_the_methods_are_held_against_each_other() -> None:
    app = part_of_page(show_comparison, small_view(truth=False))
    assert titles(app)[-2:] == ["Convolution − StereoSGBM", "Agreement"]
    assert "wrong" not in app.markdown[-1].value


# Values

A, B = (105, 150), (30, 200)


def read(*points: tuple[int, int], **kind: bool) -> AppTest:
    view = small_view(**kind)
    return part_of_page(show_readout, view, {f"depth.readout.points.{view.pair.digest}": [*points]})


def table(app: AppTest) -> dict[str, list[str]]:
    rows = next(block.value for block in app.markdown if block.value.startswith("| ")).splitlines()[2:]
    cells = [[cell.strip() for cell in row.strip("|").split("|")] for row in rows]
    return {name.strip("*"): rest for name, *rest in cells}


def test_two_points_have_disparities_depths_and_a_distance() -> None:
    app = read(A, B)
    assert typeset("15.3 px·m") in app.markdown[0].value
    said, disparity = table(app), float(small_view().pair.truth[A])
    assert list(said) == [*METHODS, "Ground truth"]
    assert said["Ground truth"][:2] == [typeset(f"{disparity:.2f} px"), typeset(f"{15.3 / disparity:.4g} m")]
    assert "score" in said["Convolution"][0]
    assert all("±" in said["StereoSGBM"][cell] for cell in (1, 3, 4))
    assert "median error" in app.caption[0].value


def test_a_blank_pixel_says_why_and_without_one_the_first_step_is_said() -> None:
    app = read((80, 3))
    assert table(app)["StereoBM"] == ["none: out of frame", "–"]
    assert [any("First click" in one.value for one in page.caption) for page in (app, read())] == [False, True]


def test_one_known_distance_makes_it_metric_and_can_be_forgotten() -> None:
    def depths_sent(app: AppTest) -> list[dict[str, float] | None]:
        return [picture["depths"][0] for picture in viewers(app)[0]["pictures"] if picture["depths"]]

    app = read(A, calibrated=False, truth=False)
    assert "Relative" in app.markdown[0].value
    assert set(map(str, depths_sent(app))) == {"None"}
    assert len(table(app)["Convolution"]) == 1
    app.number_input(key="depth.readout.metres").set_value(0.325).run()
    app.button(key="depth.readout.use").click().run()
    assert "**0.325\N{NO-BREAK SPACE}m** that you entered" in app.markdown[0].value
    assert table(app)["Convolution"][1].startswith("0.325")
    assert all(depths_sent(app))
    app.button(key="depth.readout.forget").click().run()
    assert "Relative" in app.markdown[0].value


# Why this match?


def pixel_key() -> str:
    return f"depth.inspection.pixel.{small_view().pair.digest}"


def verdict(app: AppTest) -> str:
    return str([*app.success, *app.warning][0].value)


def test_a_pixel_has_its_window_its_scores_its_row_and_the_disparity_by_each_method() -> None:
    app = part_of_page(show_inspection)
    assert len(app.get("plotly_chart")) == len(app.get("image")) == 4
    marks = next(item["marks"] for item in delivered(app, "description") if item["marks"])
    assert [mark["width"] for mark in marks] == [78, 15, 15, 15, 15, 0]
    assert all(f"**{name}**" in app.markdown[-3].value for name in (*METHODS, "Ground truth"))
    (followed,) = told(app, "hovered_match")
    assert followed["pictures"] == "depth.inspection"
    assert verdict(part_of_page(show_inspection, state={pixel_key(): (0, 0)}))
    surface = charts(app)[0]
    app.button_group(key="depth.inspection.shape").set_value("From above").run()
    assert [chart["data"][0]["type"] for chart in (surface, charts(app)[0])] == ["surface", "heatmap"]


def test_the_buttons_show_what_they_promise() -> None:
    promised = {"clear": "One clear peak", "repeats": "the pattern repeats", "bare": "bare wall", "hidden": "**wrong**"}
    app, pixels = part_of_page(show_inspection), set()
    for kind, says in promised.items():
        app.button(key=f"depth.inspection.{kind}").click().run()
        assert says in verdict(app)
        pixels.add(app.session_state[pixel_key()])
    assert len(pixels | {(80, 140)}) == len(promised) + 1


def test_scores_that_take_too_long_in_the_browser_do_not_follow_the_pointer() -> None:
    view = small_view()
    result = CorrelationMatcher(window_size=16, overlap=0.5, score="phase").compute(view.pair.left, view.pair.right)
    app = part_of_page(show_inspection, replace(view, results={"Convolution": result}))
    assert any("Click a pixel instead" in caption.value for caption in app.caption)


def test_the_figure_of_overlapping_windows_follows_the_settings() -> None:
    steps = []
    for overlap, says in ((0.9, "one every 2 px, so 289 values"), (0.0, "one every 20 px, so 9 values")):
        matcher = CorrelationMatcher(window_size=20, overlap=overlap)
        pair = small_view().pair
        match = explain_match(matcher, pair.left, pair.right, 80, 140)
        app = part_of_page(partial(show_overlap, matcher=matcher, match=match))
        assert typeset(says) in app.markdown[-1].value
        shapes = charts(app)[0]["layout"]["shapes"]
        assert len(shapes) == 9
        first, second, *_ = sorted({shape["x0"] for shape in shapes})
        steps.append(second - first)
    assert steps == [2, 20]


# Why blank?


def test_every_method_says_where_and_why_it_is_blank() -> None:
    app = part_of_page(show_blanks)
    words = viewers(app)[0]["legends"][0]["words"]
    assert titles(app) == METHODS
    assert {"out of frame", "ambiguous"} <= set(words)
    assert all(f"**{word.capitalize()}**" in app.markdown[-1].value for word in words)
    assert [bar["name"] for bar in charts(app)[0]["data"]] == words


# Scoreboard


def test_the_table_holds_the_figures_of_the_evaluation_and_marks_the_best() -> None:
    app, view = part_of_page(show_scoreboard), small_view()
    figures = app.dataframe[0].value
    assert list(figures.index) == list(view.results)
    for name, result in view.results.items():
        judged = evaluate(result.disparity, view.pair.truth)
        expected = (100 * judged.density, judged.epe, judged.bad[0.5], judged.d1_all)
        assert tuple(figures.loc[name, ["Density", "EPE", "Bad-0.5", "D1-all"]]) == pytest.approx(expected)
    best = [figures["Density"].argmax(), *(figures[name].argmin() for name in figures.columns[1:])]
    styles = app.dataframe[0].proto.arrow_data.styler.styles
    assert all(f"row{row}_col{col}" in styles for col, row in enumerate(best))
    assert len(app.get("imgs") or app.get("image")) == len(view.results)
    # The curve is a line with a score and a dot without.
    assert [trace["mode"] for trace in charts(app)[-1]["data"]] == ["lines", "markers", "markers"]
    left_out = app.segmented_control[0].set_value("are left out").run().dataframe[0].value
    assert "D1-all" not in left_out
    assert (left_out["Bad-1"] < figures["Bad-1"]).all()


def test_visible_pixels_are_judged_apart() -> None:
    view = small_view()
    visible = np.arange(view.pair.left.shape[1])[None].repeat(view.pair.left.shape[0], axis=0) > 100
    app = part_of_page(show_scoreboard, replace(view, pair=replace(view.pair, visible=visible, id=PairId("masked"))))
    everything, seen_by_both = (figures.value for figures in app.dataframe)
    assert (seen_by_both["Density"] > everything["Density"]).all()
    assert any("Seen by both cameras" in one.value for one in app.markdown)


def test_without_truth_the_figures_are_estimates_and_say_by_what() -> None:
    view = small_view(truth=False)
    judge = preset("accurate").compute(view.pair.left, view.pair.right)
    app = part_of_page(show_scoreboard, replace(view, results={**view.results, "Semi-global": judge}))
    reference = measured_reference(view.pair.left, view.pair.right, search_range=(0, 64))
    measured = f"{100 * np.isfinite(reference).mean():.0f} % of the pixels that it measured"
    assert "**estimates**" in app.markdown[0].value
    assert typeset(measured) in app.markdown[0].value
    figures = app.dataframe[0].value
    for name, result in view.results.items():
        judged = evaluate(result.disparity, reference, thresholds=(2.0,))
        assert figures.loc[name, "Estimated bad-2"] == pytest.approx(judged.bad[2.0])
    assert figures["Estimated bad-2"].is_monotonic_increasing
    assert "Semi-global" not in figures.index
    assert "would judge itself" in app.caption[0].value
    assert len(app.get("imgs") or app.get("image")) == len(view.results)


def test_unrelated_images_are_not_judged() -> None:
    view = small_view(truth=False)
    noise = np.random.default_rng(0).integers(0, 256, view.pair.right.shape, dtype=np.uint8)
    app = part_of_page(show_scoreboard, replace(view, pair=replace(view.pair, right=noise, id=PairId("unrelated"))))
    assert "nothing to judge by" in app.info[0].value
    assert not app.dataframe


def test_the_map_of_errors_has_a_colour_for_everything() -> None:
    truth = np.array([[10, 10, 10, 10, np.nan]], dtype=np.float32)
    disparity = np.array([[10, 14, 99, np.nan, 10]], dtype=np.float32)
    right, worst = ERROR_COLOURS[0].tolist(), ERROR_COLOURS[-1].tolist()
    picture = read_image(error_png(disparity, truth))[0].tolist()
    assert picture == [right, worst, worst, list(NO_ANSWER), list(NO_TRUTH)]


def test_a_sparse_truth_is_drawn_thicker_and_a_wide_map_thinned_without_mixing_colours() -> None:
    truth = np.full((6, 7), np.nan, dtype=np.float32)
    truth[2, 3] = truth[5, 0] = 10
    picture = read_image(error_png(np.full((6, 7), 10, dtype=np.float32), truth))
    expected = np.zeros((6, 7), dtype=bool)
    expected[1:4, 2:5] = expected[4:, :2] = True
    np.testing.assert_array_equal((picture == ERROR_COLOURS[0]).all(axis=2), expected)
    flat = np.zeros((30, 4_000), dtype=np.float32)
    wide = read_image(error_png(np.where(np.arange(4_000) % 7 < 3, np.float32(0), np.float32(10)) + flat, flat))
    assert wide.shape == (10, 1_334, 3)
    two = {tuple(ERROR_COLOURS[end].tolist()) for end in (0, -1)}
    assert {tuple(pixel) for pixel in wide.reshape(-1, 3).tolist()} == two


# In 3-D

RNG = np.random.default_rng(0)
POINTS = (RNG.random((500, 3)) * [2, 1, 4] + [-1, -0.5, 3]).astype(np.float32)
COLOURS = RNG.integers(0, 256, (500, 3), dtype=np.uint8)


def test_both_views_are_shown_in_metres_from_all_sides_and_fewer_points_bring_them_closer() -> None:
    app = part_of_page(show_space)
    assert not app.info
    cloud, above = charts(app)
    assert cloud["data"][0]["type"] == "scatter3d"
    assert cloud["layout"]["scene"]["yaxis"]["title"]["text"] == "distance, m"
    assert above["layout"]["yaxis"]["title"]["text"] == "distance, m"
    before = app.caption[0].value
    assert "flying pixels" in before
    eyes = set()
    for name in VIEWS:
        app.button_group(key="depth.space.seen_from").set_value(name).run()
        eyes.add(tuple(charts(app)[0]["layout"]["scene"]["camera"]["eye"].values()))
    assert len(eyes) == len(VIEWS)
    assert app.slider[0].set_value(50).run().caption[0].value != before


def test_without_calibration_it_says_what_is_assumed_and_without_points_that_there_are_none() -> None:
    view = small_view(calibrated=False)
    app = part_of_page(show_space, view)
    assert "relative" in app.info[0].value
    assert typeset("280 px") in app.info[0].value
    assert "baselines away" in app.caption[0].value
    result = view.results["StereoBM"]
    nothing = replace(result, disparity=np.full_like(result.disparity, -1.0))
    app.session_state["view"] = replace(view, results={"StereoBM": nothing})
    assert "no point" in app.run().info[-1].value


def test_the_cloud_stands_upright_in_its_colours_and_is_seen_from_any_side_as_far() -> None:
    def of(place: Any) -> np.ndarray:
        return np.array([place[axis] for axis in "xyz"])

    few = np.repeat(COLOURS[:100], 5, axis=0)
    figure = point_cloud(POINTS, few, "m")
    trace, scene = figure.data[0], figure.layout.scene
    np.testing.assert_array_equal(trace.y, POINTS[:, 2])
    np.testing.assert_array_equal(trace.z, -POINTS[:, 1])
    shown = np.array([[int(band) for band in colour[4:-1].split(",")] for _, colour in trace.marker.colorscale])
    np.testing.assert_array_equal(shown[np.asarray(trace.marker.color)], few)
    low, high = (np.array([axis.range[end] for axis in (scene.xaxis, scene.yaxis, scene.zaxis)]) for end in (0, 1))
    ratio, centre, eye = of(scene.aspectratio), of(scene.camera.center), of(scene.camera.eye)
    np.testing.assert_allclose(ratio / (high - low), 2 / (high - low).max())
    np.testing.assert_allclose(eye * (high - low) / ratio + (low + high) / 2, 0, atol=1e-9)  # at the left camera
    for turned, raised, side in ((0, 0, [0, -1, 0]), (0, 90, [0, 0, 1]), (90, 0, [1, 0, 0])):
        camera = point_cloud(POINTS, few, "m", turned=turned, raised=raised).layout.scene.camera
        np.testing.assert_array_equal(of(camera.center), centre)
        np.testing.assert_allclose((of(camera.eye) - centre) / np.linalg.norm(eye - centre), side, atol=1e-9)
    many = point_cloud(POINTS.repeat(200, axis=0), COLOURS.repeat(200, axis=0), "m")
    assert len(plotly.io.to_json(many)) < 2_000_000


def test_the_birds_eye_view_has_the_camera_at_the_bottom() -> None:
    figure = birds_eye(birds_eye_view(POINTS, COLOURS, cells=50), "m")
    assert figure.layout.yaxis.range[0] == 0
    assert figure.layout.yaxis.scaleanchor == "x"
    assert figure.data[0].y0 >= POINTS[:, 2].min()
    assert (figure.data[1].x[0], figure.data[1].y[0]) == (0, 0)
