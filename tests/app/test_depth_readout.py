from __future__ import annotations

import pytest
from streamlit.testing.v1 import AppTest

from stereolag.core.typography import typeset
from tests.app.conftest import viewers
from tests.app.depth_view import small_view


def readout() -> None:
    from stereolag.ui.depth.readout import show_readout
    from tests.app.depth_view import small_view

    show_readout(small_view())


def readout_without_calibration() -> None:
    from stereolag.ui.depth.readout import show_readout
    from tests.app.depth_view import small_view

    show_readout(small_view(calibrated=False, truth=False))


A, B = (105, 150), (30, 200)


def points_key(app: AppTest, points: list[tuple[int, int]], *, calibrated: bool = True, truth: bool = True) -> None:
    digest = small_view(calibrated=calibrated, truth=truth).pair.digest
    app.session_state[f"depth.readout.points.{digest}"] = points


def depths_sent(app: AppTest) -> list[dict[str, float] | None]:
    return [picture["depths"][0] for picture in viewers(app)[0]["pictures"] if picture["depths"]]


def table(app: AppTest) -> dict[str, list[str]]:
    rows = next(block.value for block in app.markdown if block.value.startswith("| ")).splitlines()[2:]
    cells = [[cell.strip() for cell in row.strip("|").split("|")] for row in rows]
    return {name.strip("*"): rest for name, *rest in cells}


def test_two_points_have_disparities_depths_and_a_distance() -> None:
    app = AppTest.from_function(readout, default_timeout=60)
    points_key(app, [A, B])
    app.run()
    assert not app.exception
    assert typeset("15.3 px·m") in app.markdown[0].value
    said = table(app)
    assert list(said) == ["Convolution", "StereoBM", "StereoSGBM", "Ground truth"]
    view = small_view()
    assert view.pair.truth is not None
    disparity = float(view.pair.truth[A])
    assert said["Ground truth"][:2] == [typeset(f"{disparity:.2f} px"), typeset(f"{15.3 / disparity:.4g} m")]
    assert "score" in said["Convolution"][0]
    assert all("±" in said["StereoSGBM"][cell] for cell in (1, 3, 4))
    assert "median error" in app.caption[0].value


def test_a_blank_pixel_says_why() -> None:
    app = AppTest.from_function(readout, default_timeout=60)
    points_key(app, [(80, 3)])
    app.run()
    assert table(app)["StereoBM"] == ["none: out of frame", "–"]


def test_one_known_distance_makes_it_metric_and_can_be_forgotten() -> None:
    app = AppTest.from_function(readout_without_calibration, default_timeout=60)
    points_key(app, [A], calibrated=False, truth=False)
    app.run()
    assert "Relative" in app.markdown[0].value
    assert set(map(str, depths_sent(app))) == {"None"}
    assert len(table(app)["Convolution"]) == 1
    app.number_input(key="depth.readout.metres").set_value(0.325).run()
    app.button(key="depth.readout.use").click().run()
    assert not app.exception
    assert "**0.325\N{NO-BREAK SPACE}m** that you entered" in app.markdown[0].value
    assert table(app)["Convolution"][1].startswith("0.325")
    assert all(depths_sent(app))
    app.button(key="depth.readout.forget").click().run()
    assert "Relative" in app.markdown[0].value


@pytest.mark.parametrize("points", [[], [A]])
def test_what_to_do_next_is_said(points: list[tuple[int, int]]) -> None:
    app = AppTest.from_function(readout, default_timeout=60)
    points_key(app, points)
    app.run()
    assert not app.exception
    assert any("First click" in caption.value for caption in app.caption) == (not points)
