from __future__ import annotations

import json

import pytest
from streamlit.testing.v1 import AppTest

from tests.app.depth_view import small_view
from tests.packed import delivered, told


def inspection() -> None:
    from stereolag.ui.depth.explaining import show_inspection
    from tests.app.depth_view import small_view

    show_inspection(small_view())


PIXEL_KEY = f"depth.inspection.pixel.{small_view().pair.digest}"


def opened(*pixel: int) -> AppTest:
    app = AppTest.from_function(inspection, default_timeout=60)
    if pixel:
        app.session_state[PIXEL_KEY] = pixel
    return app.run()


def verdict(app: AppTest) -> str:
    return str([*app.success, *app.warning][0].value)


def marks(app: AppTest) -> list[dict[str, int]]:
    found: list[dict[str, int]] = next(item["marks"] for item in delivered(app, "marks") if item["marks"])
    return found


def test_a_pixel_has_its_window_its_scores_its_row_and_the_disparity_by_each_method() -> None:
    app = opened()
    assert not app.exception
    assert len(app.get("plotly_chart")) == 4
    assert len(app.get("image")) == 4
    assert [mark["width"] for mark in marks(app)] == [78, 15, 15, 15, 15, 0]
    said = app.markdown[-3].value
    assert all(f"**{name}**" in said for name in ("Convolution", "StereoBM", "StereoSGBM", "Ground truth"))


@pytest.mark.parametrize(
    ("kind", "says"),
    [
        ("clear", "One clear peak"),
        ("repeats", "the pattern repeats"),
        ("bare", "bare wall"),
        ("hidden", "**wrong**"),
    ],
)
def test_the_buttons_show_what_they_promise(kind: str, says: str) -> None:
    app = opened()
    app.button(key=f"depth.inspection.{kind}").click().run()
    assert not app.exception
    assert says in verdict(app)
    assert app.session_state[PIXEL_KEY] != (80, 140)


def test_the_scores_can_be_seen_from_above() -> None:
    app = opened()
    surface = app.get("plotly_chart")[0].proto.spec
    app.button_group(key="depth.inspection.shape").set_value("From above").run()
    assert not app.exception
    assert json.loads(app.get("plotly_chart")[0].proto.spec)["data"][0]["type"] == "heatmap"
    assert json.loads(surface)["data"][0]["type"] == "surface"


def test_a_pixel_at_the_corner_is_explained_too() -> None:
    app = opened(0, 0)
    assert not app.exception
    assert verdict(app)


def by_phase() -> None:
    from dataclasses import replace

    from stereolag.stereo.windows.matcher import CorrelationMatcher
    from stereolag.ui.depth.explaining import show_inspection
    from tests.app.depth_view import small_view

    view = small_view()
    result = CorrelationMatcher(window_size=16, overlap=0.5, score="phase").compute(view.pair.left, view.pair.right)
    show_inspection(replace(view, results={"Convolution": result}))


def test_the_browser_follows_the_pointer_where_it_can() -> None:
    (followed,) = told(opened(), "hovered_match")
    assert followed["pictures"] == "depth.inspection"
    app = AppTest.from_function(by_phase, default_timeout=60).run()
    assert not app.exception
    assert any("Click a pixel instead" in caption.value for caption in app.caption)
