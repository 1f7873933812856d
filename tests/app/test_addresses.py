"""Settings survive the round trip through an address, and no address can do harm."""

from __future__ import annotations

from urllib.parse import parse_qsl, urlencode

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereolag import CorrelationMatcher, SearchArea, StereoBM, StereoSGBM, preset
from stereolag.stereo.finishing.stages import SpeckleFilter
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS
from stereolag.ui.addresses import parameters_of, recalled_settings

pytestmark = pytest.mark.usefixtures("small_pairs", "small_mazes")

FIRST = CorrelationMatcher(search=SearchArea.rectified(64))
FIRST_OF = {method: method() for method in METHODS}

SETTINGS: list[StereoMatcher] = [
    FIRST,
    CorrelationMatcher(window_size=31, overlap=0.5, search=SearchArea.centred(120, vertical=3), score="phase"),
    CorrelationMatcher(search=SearchArea.centred(60)),
    preset("report"),
    preset("fast", 48, min_disparity=-5),
    preset("accurate", 96),
    preset("fast", 64).model_copy(update={"speckle": SpeckleFilter(size=7)}),
    StereoBM(block_size=9, min_disparity=-16, speckle_window_size=50),
    StereoSGBM(p1=100, p2=20_000),
]


@pytest.mark.parametrize("settings", SETTINGS, ids=str)
def test_settings_come_back(settings: StereoMatcher) -> None:
    first = FIRST_OF[type(settings)]
    address = urlencode(parameters_of(settings, first))
    assert recalled_settings(dict(parse_qsl(address)), first) == (settings, [])


def test_what_is_as_at_first_is_left_out() -> None:
    assert parameters_of(FIRST, FIRST) == {}
    assert parameters_of(FIRST.model_copy(update={"window_size": 31}), FIRST) == {"window_size": "31"}
    dense = preset("fast", 64)
    stages = {"texture": "on", "left_right": "on", "speckle": "on", "filling": "true", "median": "on"}
    assert parameters_of(dense, FIRST) == {"window_size": "11"} | stages
    assert parameters_of(StereoBM(block_size=9), StereoBM()) == {"block_size": "9"}


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        (
            {"window_size": "2"},
            "“window_size” = “2” is ignored: window_size is '2'; allowed are whole numbers from 3 to 255.",
        ),
        (
            {"window_size": "<b>*"},
            "“window_size” = “?b??” is ignored: window_size is '?b>?'; allowed are whole numbers",
        ),
        ({"nonsense": "1"}, "“nonsense” = “1” is ignored: CorrelationMatcher has no setting 'nonsense'."),
        ({"search.num_disparities": "9999"}, "“search.num_disparities” = “9999” is ignored"),
        (
            {"search.kind": "round"},
            "“search.kind” = “round” is ignored: search.kind is 'round'; allowed are 'centred', 'rectified'.",
        ),
        ({"left_right.tolerance": "-9"}, "“left_right.tolerance” = “-9” is ignored"),
        (
            {"numDisparities": "9"},
            "“numDisparities” = “9” is ignored: CorrelationMatcher has no setting 'numDisparities'; did you mean ",
        ),
        ({"window_size.a.b": "1"}, "“window_size.a.b” = “1” is ignored"),
    ],
)
def test_a_bad_value_is_ignored_with_a_sentence_and_the_others_hold(parameters: dict[str, str], said: str) -> None:
    settings, ignored = recalled_settings(parameters | {"overlap": "0.5"}, FIRST)
    assert settings == FIRST.model_copy(update={"overlap": 0.5})
    assert len(ignored) == 1
    assert ignored[0].startswith(said)


def test_settings_that_do_not_go_together_are_ignored_together() -> None:
    settings, ignored = recalled_settings({"p1": "900", "p2": "100"}, StereoSGBM())
    assert settings == StereoSGBM()
    assert len(ignored) == 1
    assert ignored[0].startswith("“p1” = “900” and “p2” = “100” are ignored: ")
    assert "OpenCV needs p2 > p1" in ignored[0]


names = st.sampled_from(["window_size", "search", "search.kind", "optimisation", "cost.census", "score", ".", "a.b"])


@given(st.dictionaries(names | st.text(max_size=9), st.text(max_size=9) | st.sampled_from(["none", "5", "true", "on"])))
def test_no_address_does_harm(parameters: dict[str, str]) -> None:
    for kind in METHODS:
        settings, ignored = recalled_settings(parameters, FIRST_OF[kind])
        assert isinstance(settings, kind)
        assert len(ignored) <= len(parameters)


def test_what_is_ignored_is_named_as_it_stands_in_the_address() -> None:
    recalled = recalled_settings({"num_disparities": "17"}, StereoBM(), prefix="bm.")
    assert recalled.settings == StereoBM()
    assert recalled.ignored[0].startswith("“bm.num_disparities” = “17” is ignored")
