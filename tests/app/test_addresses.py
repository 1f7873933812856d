"""Settings survive the round trip through an address, and no address can do harm."""

from urllib.parse import parse_qsl, urlencode

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereolag import CorrelationMatcher, SearchArea, StereoBM, StereoSGBM, preset, samples
from stereolag.core.searches import LagSearch
from stereolag.core.settings import Settings
from stereolag.stereo.finishing.stages import SpeckleFilter
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS
from stereolag.ui.addresses import parameters_of, recalled_settings
from stereolag.ui.lag.inputs import LAG_ADDRESS
from stereolag.ui.search.inputs import TEMPLATE_ADDRESS
from stereolag.ui.uploads import LIVE, OWN

FIRST = CorrelationMatcher(search=SearchArea.rectified(64))


class Ranged(Settings):
    reach: tuple[float, float] | None = (1.0, 2.0)


SETTINGS: list[Settings] = [
    FIRST,
    CorrelationMatcher(window_size=31, overlap=0.5, search=SearchArea.centred(120, vertical=3), score="phase"),
    preset("fast", 48, min_disparity=-5),
    preset("accurate", 96),
    preset("fast", 64).model_copy(update={"speckle": SpeckleFilter(size=7)}),
    StereoBM(block_size=9, min_disparity=-16, speckle_window_size=50),
    *(Ranged(reach=reach) for reach in (None, (0.7, 1.4), (-30.0, 30.0))),
]


@pytest.mark.parametrize("settings", SETTINGS, ids=str)
def test_settings_come_back(settings: Settings) -> None:
    first = type(settings)()
    address = urlencode(parameters_of(settings, first))
    assert recalled_settings(dict(parse_qsl(address)), first) == (settings, [])


def test_what_is_as_at_first_is_left_out() -> None:
    stages = {"texture": "on", "left_right": "on", "speckle": "on", "filling": "true", "median": "on"}
    assert parameters_of(preset("fast", 64), FIRST) == {"window_size": "11"} | stages


@pytest.mark.parametrize(
    ("first", "name", "value", "said"),
    [
        (FIRST, "window_size", "<b>*", "“?b??” is ignored: window_size is '?b>?'; allowed are whole numbers"),
        (
            FIRST,
            "nonsense",
            "1",
            "“nonsense” = “1” is ignored: Convolution has no setting 'nonsense'; it has window_size, ",
        ),
        (FIRST, "search.num_disparities", "9999", "“search.num_disparities” = “9999” is ignored"),
        (FIRST, "numDisparities", "9", "has no setting 'numDisparities'; did you mean "),
        (FIRST, "window_size.a.b", "1", "“window_size.a.b” = “1” is ignored"),
        (CorrelationMatcher(), "overlap", "1", "overlap is '1'; allowed are numbers from 0 below 1."),
        (LagSearch(), "sampling_rate", "inf", "sampling_rate is 'inf'; allowed are numbers above 0."),
        (LagSearch(), "sampling_rate", "1,2", "sampling_rate is a list of 2; allowed are numbers above 0."),
    ],
)
def test_a_bad_value_is_ignored_with_a_sentence_and_the_others_hold(first, name, value, said):
    good = {"overlap": 0.5} if first is FIRST else {}
    settings, ignored = recalled_settings({name: value} | {other: str(one) for other, one in good.items()}, first)
    assert settings == first.model_copy(update=good)
    (sentence,) = ignored
    assert said in sentence


def test_settings_that_do_not_go_together_are_ignored_together_and_named_as_in_the_address() -> None:
    settings, (sentence,) = recalled_settings({"p1": "900", "p2": "100"}, StereoSGBM(), prefix="sgbm.")
    assert settings == StereoSGBM()
    assert sentence.startswith("“sgbm.p1” = “900” and “sgbm.p2” = “100” are ignored: ")
    assert "OpenCV needs p2 > p1" in sentence


names = st.sampled_from(["window_size", "search", "search.kind", "optimisation", "cost.census", "score", ".", "a.b"])


values = st.text(max_size=9) | st.sampled_from(["none", "5", "true", "on"])


@given(st.sampled_from(METHODS), st.dictionaries(names | st.text(max_size=9), values))
def test_no_address_does_harm(kind: type[StereoMatcher], parameters: dict[str, str]) -> None:
    settings, ignored = recalled_settings(parameters, kind())
    assert isinstance(settings, kind)
    assert len(ignored) <= len(parameters)


def test_an_address_names_every_example() -> None:
    assert LAG_ADDRESS.choices()["recordings"].allowed == [*samples.recordings(), OWN, LIVE]
    assert TEMPLATE_ADDRESS.choices()["picture"].allowed == [*samples.mazes(), OWN, LIVE]
