"""The lag page and the template search open from an address with the settings in it."""

from __future__ import annotations

import pytest

from stereolag.core.searches import LagSearch, TemplateQuery
from tests.app import uploads
from tests.app.pages import FIND, LAG, address, ignored, lag_found, linked

COAST, HARBOUR = "recordings coast", "recordings harbour"

pytestmark = pytest.mark.usefixtures("small_mazes")


def test_the_address_says_what_is_not_as_at_first() -> None:
    app = linked(LAG)
    assert address(app) == {}
    app.button_group(key="recordings").set_value("harbour").run()
    assert address(app) == {"recordings": "harbour"}
    app.number_input(key=f"lag.max_lag.{HARBOUR}").set_value(40_000)
    app.number_input(key=f"lag.speed.{HARBOUR}").set_value(1500.0)
    app.button_group(key="lag.method").set_value("phat").run()
    assert address(app) == {"recordings": "harbour", "method": "phat", "speed": "1500.0", "max_lag": "40000"}
    app.number_input(key=f"lag.max_lag.{HARBOUR}").set_value(None)
    app.button_group(key="lag.method").set_value("fft").run()
    assert address(app) == {"recordings": "harbour", "speed": "1500.0"}

    app = linked(FIND)
    app.button_group(key="pictures").set_value("maze_dulled").run()
    app.number_input(key="template.max_matches").set_value(3).run()
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
    assert app.number_input(key=f"lag.sampling_rate.{HARBOUR}").value == 8000.5
    assert app.number_input(key=f"lag.max_lag.{HARBOUR}").value == 40_000
    assert not app.warning
    assert address(app) == link
    assert lag_found(app) == -31_234

    link = {"picture": "maze_dulled", "method": "sampled", "min_score": "0.513", "max_matches": "2"}
    sizes_and_angles = {"min_scale": "0.99", "max_scale": "1.01", "max_rotation": "0.5"}
    assert link.keys() | sizes_and_angles.keys() == {"picture", *TemplateQuery.model_fields}
    app = linked(FIND, **link)
    assert app.button_group(key="pictures").value == "maze_dulled"
    assert app.slider(key="template.min_score").value == 0.513
    assert not ignored(app)
    assert address(app) == link
    app = linked(FIND, **sizes_and_angles)
    assert app.slider(key="template.min_scale").value == 0.99
    assert app.slider(key="template.max_rotation").value == 0.5
    assert address(app) == sizes_and_angles


def test_what_is_bad_in_a_link_is_answered_with_a_sentence_each_and_opens_the_page() -> None:
    app = linked(LAG, recordings="mine", sampling_rate="0.5", speed="1e-300", max_lag="99999999")
    assert not app.error
    assert address(app) == {}
    said = " ".join(ignored(app))
    assert "recordings = “mine” in the address is ignored" in said
    assert "max_lag is 99999999; allowed are whole numbers from 0 to 176400 or None." in said
    for name, value in {"sampling_rate": "0.5", "speed": "1e-300"}.items():
        assert f"{name} is {value}; on this page allowed are numbers from 1 to" in said
    app = linked(FIND, picture="mine")
    assert [one.partition(": ")[0] for one in ignored(app)] == ["picture = “mine” in the address is ignored"]
    assert address(app) == {}


def test_the_address_of_own_files_shows_no_example_and_its_settings_wait_for_the_files() -> None:
    app = linked(LAG, recordings="own", method="phat", speed="1500")
    assert not app.error and not app.header
    assert app.warning[0].value.startswith("The files of this page are gone")
    sound = uploads.noise(4_000)
    for number, part in enumerate((sound[100:], sound[:-100]), start=1):
        wav = uploads.wav(part, 8_000)
        app.file_uploader(key=f"recordings.file_{number}").upload(f"{number}.wav", wav, "application/octet-stream")
    app.run()
    assert lag_found(app) == 100
    assert app.button_group(key="lag.method").value == "phat"
    assert address(app) == {"recordings": "own", "method": "phat", "speed": "1500.0"}


def test_an_extreme_link_does_no_harm() -> None:
    app = linked(LAG, sampling_rate="1e12", speed="1e12", max_lag="0")
    assert app.number_input(key=f"lag.sampling_rate.{COAST}").value == 1e12
    assert not ignored(app)
    assert not app.error
    app = linked(LAG, max_lag="9" * 400)
    assert len(ignored(app)) == 1
    assert not app.error
