"""Depth in 3-D: a cloud in true colour and from above, in metres or marked as relative."""

from __future__ import annotations

import json

import numpy as np
import plotly.io
from streamlit.testing.v1 import AppTest

from stereolag.core.typography import typeset
from stereolag.figures.clouds import birds_eye, point_cloud
from stereolag.geometry.scene import seen_from_above
from stereolag.ui.depth.space import VIEWS

RNG = np.random.default_rng(0)
POINTS = (RNG.random((500, 3)) * [2, 1, 4] + [-1, -0.5, 3]).astype(np.float32)
COLOURS = RNG.integers(0, 256, (500, 3), dtype=np.uint8)


def space() -> None:
    from stereolag.ui.depth.space import show_space
    from tests.app.depth_view import small_view

    show_space(small_view())


def uncalibrated_space() -> None:
    from stereolag.ui.depth.space import show_space
    from tests.app.depth_view import small_view

    show_space(small_view(calibrated=False))


def empty_space() -> None:
    from dataclasses import replace

    import numpy as np

    from stereolag.ui.depth.space import show_space
    from tests.app.depth_view import small_view

    view = small_view()
    result = view.results["StereoBM"]
    nothing = replace(result, disparity=np.full_like(result.disparity, -1.0))
    show_space(replace(view, results={"StereoBM": nothing}))


def test_both_views_are_shown_in_metres() -> None:
    app = AppTest.from_function(space, default_timeout=60).run()
    assert not app.exception
    assert not app.info
    cloud, above = (json.loads(chart.proto.spec) for chart in app.get("plotly_chart"))
    assert cloud["data"][0]["type"] == "scatter3d"
    assert cloud["layout"]["scene"]["yaxis"]["title"]["text"] == "distance, m"
    assert above["layout"]["yaxis"]["title"]["text"] == "distance, m"
    assert "flying pixels" in app.caption[0].value


def test_fewer_points_bring_the_farthest_closer() -> None:
    app = AppTest.from_function(space, default_timeout=60).run()
    before = app.caption[0].value
    app.slider[0].set_value(50).run()
    assert not app.exception
    assert app.caption[0].value != before


def test_the_cloud_is_seen_from_elsewhere_without_a_mouse() -> None:
    app = AppTest.from_function(space, default_timeout=60).run()
    eyes = set()
    for name in VIEWS:
        app.button_group(key="depth.space.seen_from").set_value(name).run()
        assert not app.exception
        camera = json.loads(app.get("plotly_chart")[0].proto.spec)["layout"]["scene"]["camera"]
        eyes.add(tuple(camera["eye"].values()))
    assert len(eyes) == len(VIEWS)


def test_a_turned_view_looks_at_the_same_point_from_as_far() -> None:
    ahead, above, right = (
        point_cloud(POINTS, COLOURS, "m", **angles).layout.scene.camera
        for angles in ({}, {"raised": 90}, {"turned": 90})
    )
    centre = np.array([ahead.center[axis] for axis in "xyz"])
    away = [np.array([camera.eye[axis] for axis in "xyz"]) - centre for camera in (ahead, above, right)]
    assert {tuple(camera.center[axis] for axis in "xyz") for camera in (above, right)} == {tuple(centre)}
    far = np.linalg.norm(away[0])
    np.testing.assert_allclose(np.array(away) / far, [[0, -1, 0], [0, 0, 1], [1, 0, 0]], atol=1e-9)


def test_without_calibration_it_says_what_is_assumed() -> None:
    app = AppTest.from_function(uncalibrated_space, default_timeout=60).run()
    assert not app.exception
    assert "relative" in app.info[0].value
    assert typeset("280 px") in app.info[0].value
    assert "baselines away" in app.caption[0].value


def test_a_map_without_points_says_so() -> None:
    app = AppTest.from_function(empty_space, default_timeout=60).run()
    assert not app.exception
    assert "no point" in app.info[0].value


def test_the_cloud_stands_upright_and_is_seen_from_the_left_camera() -> None:
    figure = point_cloud(POINTS, COLOURS, "m")
    trace, scene = figure.data[0], figure.layout.scene
    np.testing.assert_array_equal(trace.y, POINTS[:, 2])
    np.testing.assert_array_equal(trace.z, -POINTS[:, 1])
    low, high = (np.array([axis.range[end] for axis in (scene.xaxis, scene.yaxis, scene.zaxis)]) for end in (0, 1))
    ratio = np.array([scene.aspectratio[axis] for axis in "xyz"])
    np.testing.assert_allclose(ratio / (high - low), 2 / (high - low).max())
    eye = np.array([scene.camera.eye[axis] for axis in "xyz"])
    np.testing.assert_allclose(eye * (high - low) / ratio + (low + high) / 2, 0, atol=1e-9)
    centre = np.array([scene.camera.center[axis] for axis in "xyz"])
    np.testing.assert_allclose(((centre - eye) / np.linalg.norm(centre - eye)), [0, 1, 0], atol=1e-9)


def test_the_colours_stay_true_and_the_figure_small() -> None:
    few = np.repeat(COLOURS[:100], 5, axis=0)
    marker = point_cloud(POINTS, few, "m").data[0].marker
    shown = np.array([[int(band) for band in colour[4:-1].split(",")] for _, colour in marker.colorscale])
    np.testing.assert_array_equal(shown[np.asarray(marker.color)], few)
    many = POINTS.repeat(200, axis=0)
    text = plotly.io.to_json(point_cloud(many, COLOURS.repeat(200, axis=0), "m"))
    assert len(text) < 2_000_000


def test_the_birds_eye_view_has_the_camera_at_the_bottom() -> None:
    figure = birds_eye(seen_from_above(POINTS, COLOURS, cells=50), "m")
    assert figure.layout.yaxis.range[0] == 0
    assert figure.layout.yaxis.scaleanchor == "x"
    assert figure.data[0].y0 >= POINTS[:, 2].min()
    assert (figure.data[1].x[0], figure.data[1].y[0]) == (0, 0)
