"""Alternative texts of pictures and charts for people who cannot see them."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest

from stereolag.assess.explaining.match import explain_match
from stereolag.core.typography import typeset
from stereolag.signals import signal_lag
from stereolag.stereo.evaluation import CoverageCurve
from stereolag.stereo.reasons import Reason
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.ui.depth import alternatives as depth
from stereolag.ui.lag import alternatives as lag
from tests.app import uploads

PROJECT = Path(__file__).resolve().parents[2]
DRAWING = {"plotly_chart", "image", "dataframe", "audio"}


def drawings(file: Path) -> list[ast.Call]:
    """Return the calls in a file that draw an element that needs an alternative text."""
    calls = (one for one in ast.walk(ast.parse(file.read_text(encoding="utf-8"))) if isinstance(one, ast.Call))
    return [call for call in calls if isinstance(call.func, ast.Attribute) and call.func.attr in DRAWING]


def test_every_picture_chart_and_table_has_one() -> None:
    files = [PROJECT / "app.py", *(PROJECT / "pages").glob("*.py"), *(PROJECT / "stereolag" / "ui").rglob("*.py")]
    found = [(file.name, call) for file in files for call in drawings(file)]
    assert len(found) > 20
    assert [(name, call.lineno) for name, call in found if "alt" not in {one.arg for one in call.keywords}] == []


def test_a_map_tells_how_much_was_measured_and_its_range() -> None:
    disparity = np.tile(np.linspace(10, 50, 200, dtype=np.float32), (100, 1))
    disparity[:, :50] = np.nan
    disparity[0, 199] = 900  # an outlier does not widen the range
    assert depth.map_in_words(disparity) == typeset("disparity map, 75 % measured, 20 to 49 px")
    assert depth.map_in_words(np.full((8, 8), np.nan, np.float32)) == "disparity map, no pixel measured"


def test_blanks_are_told_by_reason_the_most_frequent_first() -> None:
    reason = np.full((10, 10), Reason.MEASURED, np.uint8)
    reason[0] = Reason.AMBIGUOUS
    reason[1, :4] = Reason.SPECKLE
    assert depth.blanks_in_words(reason) == typeset("14.0 % without a measurement: ambiguous 10.0 %, speckle 4.0 %")
    assert depth.blanks_in_words(np.full((2, 2), Reason.MEASURED, np.uint8)) == "every pixel is measured"


def test_errors_count_what_is_wrong_apart_from_what_is_missing() -> None:
    truth = np.zeros((1, 5), np.float32)
    disparity = np.array([[0, 1, 3, np.nan, 0]], np.float32)
    said = depth.errors_in_words(disparity, truth, "the ground truth")
    assert said == typeset(
        "Error map against the ground truth: 20.0 % off by more than 2 px, 20.0 % without a disparity."
    )


def test_differences_are_told_in_shares() -> None:
    said = depth.difference_in_words(np.array([0.5, 2, -2, np.nan, 0], np.float32))
    assert said.startswith(typeset("50 % of the pixels that both measured differ by 1 px at most, 25 % are larger"))
    assert depth.difference_in_words(np.array([np.nan], np.float32)) == "no pixel that both measured"


def test_curves_are_told_by_their_ends() -> None:
    curve = CoverageCurve(np.array([0.25, 0.5, 1.0]), np.array([1.0, 2.0, 8.0]))
    point = CoverageCurve(np.array([0.8]), np.array([9.0]))
    said = depth.coverage_curves_in_words({"One": curve, "Other": point})
    assert said == typeset(
        "Error against coverage. One: 8.0 % wrong at 100 % kept, 2.0 % at 50 %; Other: 9.0 % wrong at 80 % kept."
    )


def test_scores_are_told_by_their_peak() -> None:
    scene = uploads.texture(60, 90)
    seen = explain_match(CorrelationMatcher(window_size=11), scene[:, :-5], scene[:, 5:], 30, 40)
    assert depth.scores_in_words(seen, "Scores").startswith(
        typeset("Scores: the peak, 1.000, is at a disparity of 5 px")
    )
    assert depth.fit_in_words(seen).endswith(typeset(f"its top is at {seen.disparity:.2f} px."))


@pytest.mark.parametrize(
    ("same", "said"), [(True, "one clear peak at 40, score 1.000"), (False, "nothing rises above chance level")]
)
def test_a_curve_tells_whether_its_peak_stands_out(same: bool, said: str) -> None:
    random = np.random.default_rng(3)
    one, other = random.normal(size=(2, 4000))
    second = np.concatenate((random.normal(size=40), one)) if same else other
    assert said in lag.curve_in_words(signal_lag(one, second, sampling_rate=1000))


def test_votes_are_told_where_there_is_no_curve() -> None:
    one = np.random.default_rng(4).normal(size=4000)
    result = signal_lag(one, np.concatenate((np.zeros(25), one)), sampling_rate=1000, method="sampled", seed=0)
    assert "are for lag 25 samples" in lag.curve_in_words(result)
