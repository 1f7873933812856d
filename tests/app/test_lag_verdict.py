"""The lag page states its verdict before the lag, and gives metres only for a sure lag."""

from __future__ import annotations

import io
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import plotly.io
import pytest
import soundfile
from streamlit.testing.v1 import AppTest

from benchmarks.verdict import drifting, tones, unrelated
from stereolag.core.typography import typeset
from stereolag.figures.recordings import correlation_curve, lag_over_time
from stereolag.signals import signal_lag

OpenPage = Callable[..., AppTest]
Sound = npt.NDArray[np.float64]


def measured(open_page: OpenPage, first: Sound, second: Sound) -> AppTest:
    """Return the page after uploading both recordings."""
    app = open_page("pages/1_Sensor_lag.py", {"recordings": "own"})
    for number, sound in ((1, first), (2, second)):
        file = io.BytesIO()
        soundfile.write(file, sound / np.abs(sound).max() * 0.9, 44_100, format="WAV", subtype="FLOAT")
        app.file_uploader(key=f"recordings.file_{number}").set_value((f"{number}.wav", file.getvalue(), "audio/wav"))
    return app.run()


def numbers(app: AppTest) -> dict[str, str]:
    return {metric.label: metric.value for metric in app.metric}


@pytest.mark.parametrize(
    ("pair", "said"),
    [
        (unrelated("noise and noise", 20_000, 0), "Nothing in common found: the highest point is at chance level."),
        (tones(6_000, 0.01, 0.0, 0), "Cannot tell: it repeats every **100 samples**."),
    ],
)
def test_no_metres_and_no_lag_where_it_is_not_sure(open_page: OpenPage, pair: tuple[Sound, Sound], said: str) -> None:
    app = measured(open_page, *pair)
    assert app.header[0].value == said
    assert {"Lag, samples", "Time", "Path difference"}.isdisjoint(numbers(app))
    assert "Highest point, samples" in numbers(app)


def test_a_sure_lag_has_its_path_difference_and_how_far_it_can_be_off(open_page: OpenPage) -> None:
    app = open_page("pages/1_Sensor_lag.py")
    assert numbers(app)["Path difference"] == typeset("378.17 m")
    assert any(typeset("varies by less than ± 0.01 samples, ± 0.076 mm of") in one.value for one in app.markdown)


def test_plain_pearson_is_another_curve_of_the_same_peak(open_page: OpenPage) -> None:
    app = open_page("pages/1_Sensor_lag.py")
    fair = drawn(app)
    app.button_group(key="lag.curve").set_value("Plain Pearson").run()
    plain = drawn(app)
    assert fair[-1]["x"] == plain[-1]["x"] == [50_082]
    assert fair[-1]["y"][0] == pytest.approx(plain[-1]["y"][0] * np.sqrt(1 - 50_082 / 176_401), abs=1e-3)
    assert float(numbers(app)["Score"]) == pytest.approx(plain[-1]["y"][0], abs=1e-3)


def drawn(app: AppTest) -> list[dict[str, list[float]]]:
    """Return the traces of the correlation curve."""
    specs = [plotly.io.from_json(one.proto.spec, skip_invalid=True).to_dict() for one in app.get("plotly_chart")]
    (curve,) = [spec for spec in specs if "lag, samples" in str(spec["layout"]["xaxis"].get("title"))]
    return list(curve["data"])


def test_the_ribbon_holds_what_chance_gives_and_widens_for_plain_pearson() -> None:
    pair = unrelated("noise and noise", 20_000, 3)
    result = signal_lag(*pair)
    assert result.lags is not None and result.correlation is not None
    ribbon = correlation_curve(result, "").data[0]
    assert max(ribbon.y) - min(ribbon.y) == pytest.approx(2 * max(ribbon.y), rel=0.05)
    inside = (result.correlation < max(ribbon.y)) & (result.correlation > min(ribbon.y))
    assert inside.mean() > 0.99
    sizes = pair[0].size, pair[1].size
    plain = np.array(correlation_curve(result, "", sizes=sizes).data[0].y)
    assert plain[0] == 1.0 and plain[plain.size // 4] == pytest.approx(max(ribbon.y), rel=0.05)


def test_rivals_are_marked_where_they_are() -> None:
    result = signal_lag(*tones(6_000, 0.01, 0.0, 0))
    marked = [trace for trace in correlation_curve(result, "").data if trace.name == "fits as well"]
    assert tuple(marked[0].x) == result.rivals


def test_the_lag_of_blocks_is_drawn_over_time() -> None:
    result = signal_lag(*drifting(150_000, 400, 50.0, 0.0, 1), max_lag=2000)
    assert result.judgement is not None and result.judgement.drift is not None
    line, blocks = lag_over_time(result.judgement.drift, 44_100.0).data
    assert len(blocks.x) == result.judgement.drift.blocks
    slope = (line.y[1] - line.y[0]) / (line.x[1] - line.x[0]) / 44_100
    assert 1e6 * slope == pytest.approx(50.0, abs=5)
