"""The lag page and the template search open from an address with the settings in it."""

from __future__ import annotations

import pytest
from streamlit.testing.v1 import AppTest

from stereolag import samples
from stereolag.core.searches import LagSearch, TemplateQuery
from stereolag.core.settings import Settings
from stereolag.core.typography import typeset
from stereolag.ui.addresses import parameters_of, recalled_settings
from stereolag.ui.inputs import LAG_ADDRESS, TEMPLATE_ADDRESS
from tests.app.conftest import PROJECT
from tests.app.uploads import noise, wav

LAG, FIND = "pages/1_Sensor_lag.py", "pages/2_Rocketman_search.py"
COAST, HARBOUR = "recordings coast", "recordings harbour"

pytestmark = pytest.mark.usefixtures("small_mazes")


def linked(path: str, **parameters: str) -> AppTest:
    app = AppTest.from_file(PROJECT / "app.py", default_timeout=60).switch_page(path)
    for name, value in parameters.items():
        app.query_params[name] = value
    app.run()
    assert not app.exception
    return app


def address(app: AppTest) -> dict[str, str]:
    return {name: value if isinstance(value, str) else value[0] for name, value in app.query_params.items()}


def ignored(app: AppTest) -> list[str]:
    return [warning.value for warning in app.warning if "ignored" in warning.value]


def test_the_address_says_what_is_not_as_at_first() -> None:
    app = linked(LAG)
    assert address(app) == {}
    app.button_group(key="recordings").set_value("harbour").run()
    assert address(app) == {"recordings": "harbour"}
    app.number_input(key=f"lag.max.{HARBOUR}").set_value(40_000)
    app.number_input(key=f"lag.speed.{HARBOUR}").set_value(1500.0)
    app.button_group(key="lag.method").set_value("phat").run()
    assert address(app) == {"recordings": "harbour", "method": "phat", "speed": "1500.0", "max_lag": "40000"}
    app.number_input(key=f"lag.max.{HARBOUR}").set_value(None)
    app.button_group(key="lag.method").set_value("fft").run()
    assert address(app) == {"recordings": "harbour", "speed": "1500.0"}

    app = linked(FIND)
    app.button_group(key="pictures").set_value("maze_dulled").run()
    app.slider(key="template.max_matches").set_value(3).run()
    assert address(app) == {"picture": "maze_dulled", "max_matches": "3"}


def test_a_link_opens_the_page_as_it_was() -> None:
    link = {
        "recordings": "harbour",
        "method": "phat",
        "sampling_rate": "8000.5",
        "speed": "1497.25",
        "max_lag": "40000",
    }
    assert link.keys() == {"recordings", *LagSearch.model_fields}
    app = linked(LAG, **link)
    assert app.button_group(key="recordings").value == "harbour"
    assert app.button_group(key="lag.method").value == "phat"
    assert app.number_input(key=f"lag.rate.{HARBOUR}").value == 8000.5
    assert app.number_input(key=f"lag.max.{HARBOUR}").value == 40_000
    assert not app.warning
    assert address(app) == link
    lag = next(metric for metric in app.metric if metric.label == "Lag, samples")
    assert lag.value == typeset("-31,234")

    link = {"picture": "maze_dulled", "method": "sampled", "min_score": "0.513", "max_matches": "2"}
    sizes_and_angles = {"min_scale": "0.95", "max_scale": "1.05", "max_rotation": "2.0"}
    assert link.keys() | sizes_and_angles.keys() == {"picture", *TemplateQuery.model_fields}
    app = linked(FIND, **link)
    assert app.button_group(key="pictures").value == "maze_dulled"
    assert app.slider(key="template.min_score").value == 0.513
    assert not ignored(app)
    assert address(app) == link
    app = linked(FIND, **sizes_and_angles)
    assert app.slider(key="template.min_scale").value == 0.95
    assert app.slider(key="template.max_rotation").value == 2.0
    assert address(app) == sizes_and_angles


@pytest.mark.parametrize(
    ("path", "name", "value", "said"),
    [
        (LAG, "recordings", "own", "recordings = “own” in the address is ignored"),
        (LAG, "recordings", "../x", "in the address is ignored"),
        (LAG, "method", "guess", "“method” = “guess” is ignored: method is 'guess'; allowed are 'fft'"),
        (LAG, "max_lag", "99999999", "max_lag is 99999999; allowed are whole numbers from 0 to 176400 or None."),
        (LAG, "max_lag", "-1", "max_lag is '-1'; allowed are whole numbers from 0"),
        (LAG, "max_lag", "9" * 400, "is ignored"),
        (LAG, "sampling_rate", "inf", "sampling_rate is 'inf'; allowed are numbers above 0."),
        (LAG, "sampling_rate", "0.5", "sampling_rate is 0.5; on this page allowed are numbers from 1 to 1,0"),
        (LAG, "sampling_rate", "1e300", "sampling_rate is 1e+300; on this page allowed are numbers from 1 to"),
        (LAG, "speed", "1e-300", "speed is 1e-300; on this page allowed are numbers from 1 to"),
        (LAG, "sampling_rate", "1,2", "sampling_rate is a list of 2; allowed are numbers above 0."),
        (LAG, "speed", "nan", "speed is 'nan'; allowed are numbers above 0."),
        (LAG, "<b>", "1", "LagSearch has no setting"),
        (FIND, "picture", "own", "picture = “own” in the address is ignored"),
        (FIND, "min_score", "2", "min_score is '2'; allowed are numbers from 0 to 1."),
        (FIND, "max_matches", "0.5", "max_matches is '0.5'; allowed are whole numbers from 1 to 20."),
    ],
)
def test_a_bad_link_is_answered_with_a_sentence_and_opens_the_page(path: str, name: str, value: str, said: str) -> None:
    app = linked(path, **{name: value})
    (sentence,) = ignored(app)
    assert said in sentence
    assert not app.error
    assert address(app) == {}


def test_an_extreme_link_does_no_harm() -> None:
    app = linked(LAG, sampling_rate="1e12", speed="1e12", max_lag="0")
    assert app.number_input(key=f"lag.rate.{COAST}").value == 1e12
    assert not ignored(app)
    assert not app.error


def test_files_of_the_visitors_own_are_not_in_the_address() -> None:
    app = linked(LAG)
    app.button_group(key="recordings").set_value("own").run()
    sound = noise(4100)
    app.file_uploader[0].upload("1.wav", wav(sound[100:]), "audio/wav")
    app.file_uploader[1].upload("2.wav", wav(sound[:4000]), "audio/wav").run()
    app.button_group(key="lag.method").set_value("phat").run()
    assert any(one.value.startswith("Your own recordings.") for one in app.caption)
    assert address(app) == {"method": "phat"}


class Ranged(Settings):
    reach: tuple[float, float] | None = None


@pytest.mark.parametrize("reach", [None, (0.7, 1.4), (-30.0, 30.0)])
def test_several_values_come_back(reach: tuple[float, float] | None) -> None:
    first, settings = Ranged(reach=(1.0, 2.0)), Ranged(reach=reach)
    assert recalled_settings(parameters_of(settings, first), first) == (settings, [])


def test_an_address_names_every_example() -> None:
    assert LAG_ADDRESS.choices()["recordings"].allowed == [*samples.recordings()]
    assert TEMPLATE_ADDRESS.choices()["picture"].allowed == [*samples.mazes()]
