from __future__ import annotations

from typing import Any

from streamlit.testing.v1 import AppTest

from stereolag.core.typography import typeset
from tests.app.conftest import viewers


def comparison() -> None:
    from stereolag.ui.depth.comparing import show_comparison
    from tests.app.depth_view import small_view

    show_comparison(small_view())


def comparison_without_truth() -> None:
    from stereolag.ui.depth.comparing import show_comparison
    from tests.app.depth_view import small_view

    show_comparison(small_view(truth=False))


def header(app: AppTest) -> dict[str, Any]:
    return viewers(app)[0]


def titles(app: AppTest) -> list[str]:
    return [picture["title"] for picture in header(app)["pictures"]]


def test_every_method_stands_beside_the_truth_in_one_range() -> None:
    app = AppTest.from_function(comparison, default_timeout=60).run()
    assert not app.exception
    assert titles(app) == [
        "Left image",
        "Convolution",
        "StereoBM",
        "StereoSGBM",
        "Ground truth",
        "Convolution − Ground truth",
        "Agreement",
    ]
    assert [legend["title"] for legend in header(app)["legends"]] == [
        "disparity, px, and distance",
        "",
        "difference, px",
        "agreement",
    ]
    assert typeset("All 3 methods agree to 1 px") in app.markdown[-1].value
    assert typeset("are wrong by more than 1 px") in app.markdown[-1].value


def test_any_two_maps_can_be_subtracted() -> None:
    app = AppTest.from_function(comparison, default_timeout=60).run()
    before = header(app)
    app.selectbox(key="depth.comparison.first").set_value("Ground truth").run()
    app.selectbox(key="depth.comparison.second").set_value("StereoBM").run()
    assert "Ground truth − StereoBM" in titles(app)
    assert header(app) != before


def test_without_truth_the_methods_are_held_against_each_other() -> None:
    app = AppTest.from_function(comparison_without_truth, default_timeout=60).run()
    assert not app.exception
    assert titles(app)[-2:] == ["Convolution − StereoSGBM", "Agreement"]
    assert "wrong" not in app.markdown[-1].value
