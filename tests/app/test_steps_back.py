"""A step back or forward in the browser restores the page as it was there, and keeps all files and settings."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import pytest
from streamlit.testing.v1 import AppTest, local_script_runner

from tests.app import keys
from tests.app.pages import DEPTH, FIND, LAG, arrive, linked, moved, uploaded
from tests.app.reading import address, figures
from tests.app.uploads import noise, wav

HARBOUR = "recordings harbour"

Step = Callable[..., None]


@pytest.fixture
def step() -> Step:
    """Return a function that steps through the browser's history to an address of the current or another page."""

    def stepped(app: AppTest, *, path: str | None = None, **parameters: str) -> None:
        with pytest.MonkeyPatch.context() as patch:
            flagged = partial(local_script_runner.RerunData, is_history_navigation=True)
            patch.setattr(local_script_runner, "RerunData", flagged)
            arrive(app, path, **parameters)

    return stepped


def set_on_lag_page(app: AppTest) -> dict[str, str]:
    """Return the recordings and the method chosen on the lag page."""
    return {"recordings": app.button_group(key="recordings").value, "method": app.button_group(key="lag.method").value}


def test_a_step_back_takes_back_what_its_address_does_not_name(step: Step) -> None:
    app = linked(LAG, recordings="harbour", method="phat")
    step(app, recordings="harbour")
    assert set_on_lag_page(app) == {"recordings": "harbour", "method": "fft"}
    assert address(app) == {"recordings": "harbour"}
    step(app, recordings="harbour", method="phat")
    assert set_on_lag_page(app) == {"recordings": "harbour", "method": "phat"}
    step(app, method="phat")
    assert set_on_lag_page(app) == {"recordings": "coast", "method": "phat"}
    assert address(app) == {"method": "phat"}


def test_a_step_back_undoes_the_last_move() -> None:
    app = linked(LAG, recordings="harbour", method="phat", max_lag="4000")
    assert app.number_input(key=f"lag.max_lag.{HARBOUR}").value == 4_000
    arrive(app, recordings="harbour")
    assert set_on_lag_page(app) == {"recordings": "harbour", "method": "fft"}
    assert app.number_input(key=f"lag.max_lag.{HARBOUR}").value is None


def test_a_step_back_to_the_first_address_of_a_page_takes_everything_back(step: Step) -> None:
    app = linked(LAG)
    moved(app, {"recordings": "harbour"})
    moved(app, {"lag.method": "phat"})
    step(app, recordings="harbour")
    assert set_on_lag_page(app) == {"recordings": "harbour", "method": "fft"}
    step(app)
    assert set_on_lag_page(app) == {"recordings": "coast", "method": "fft"}
    assert address(app) == {}
    step(app, recordings="harbour", method="phat")
    assert set_on_lag_page(app) == {"recordings": "harbour", "method": "phat"}

    app = moved(linked(FIND), {"pictures": "maze_dulled", "template.min_score": 0.7})
    step(app)
    assert app.button_group(key="pictures").value == "maze"
    assert app.slider(key="template.min_score").value == 0.5
    assert address(app) == {}


def test_the_browser_that_does_not_know_the_new_address_yet_takes_nothing_back() -> None:
    app = moved(linked(LAG, method="phat"), {"recordings": "harbour"})
    chosen = {"recordings": "harbour", "method": "phat"}
    arrive(app, method="phat")
    assert set_on_lag_page(app) == chosen
    arrive(app)
    assert set_on_lag_page(app) == chosen
    assert address(app) == chosen


def test_the_links_between_the_pages_keep_what_is_set_and_so_does_the_step_back_over_them(step: Step) -> None:
    app = linked(LAG, recordings="harbour", method="phat")
    chosen = set_on_lag_page(app)
    arrive(app, FIND)
    arrive(app, LAG)
    assert set_on_lag_page(app) == chosen
    step(app)  # to the link's own address, which the page replaced at once
    assert set_on_lag_page(app) == chosen
    assert address(app) == chosen
    step(app, path=FIND)
    step(app, path=LAG, **chosen)
    step(app)
    assert set_on_lag_page(app) == chosen
    step(app, recordings="harbour")
    assert set_on_lag_page(app) == {"recordings": "harbour", "method": "fft"}


def test_a_page_that_was_all_as_at_first_when_a_link_led_to_it_goes_back_to_that(step: Step) -> None:
    app = linked("app.py")
    moved(arrive(app, LAG), {"lag.method": "phat"})
    step(app)
    assert set_on_lag_page(app) == {"recordings": "coast", "method": "fft"}


def test_a_step_back_keeps_the_visitors_own_files(step: Step) -> None:
    app, sound = moved(linked(LAG), {"recordings": "own"}), noise(4100)
    files = {"file_1": ("1.wav", wav(sound[100:])), "file_2": ("2.wav", wav(sound[:4000]))}
    moved(uploaded(app, "recordings", **files), {"lag.method": "phat"})
    for settings in ({}, {"method": "phat"}, {"speed": "1500.0"}):
        parameters = {"recordings": "own", **settings}
        step(app, **parameters)
        assert app.button_group(key="recordings").value == "own"
        assert any(one.value.startswith("Your own recordings.") for one in app.caption)
        assert app.button_group(key="lag.method").value == settings.get("method", "fft")
        assert address(app) == parameters
    step(app, recordings="harbour")
    assert app.button_group(key="recordings").value == "harbour"
    moved(app, {"recordings": "own"})
    assert any(one.value.startswith("Your own recordings.") for one in app.caption)


def test_settings_wait_while_files_are_refused(step: Step) -> None:
    app = moved(linked(LAG), {"recordings": "own"})
    assert uploaded(app, "recordings", file_1=("1.wav", b"no sound")).error
    step(app, recordings="own", method="phat")
    assert app.error
    moved(app, {"recordings": "harbour"})
    assert set_on_lag_page(app) == {"recordings": "harbour", "method": "phat"}


def test_a_step_back_on_the_depth_page(step: Step) -> None:
    app = linked(DEPTH, pair="square", size="1/2", maps="bm", window_size="31", bm__block_size="9")
    step(app, pair="square", size="1/2", window_size="31")
    assert list(figures(app)) == ["Convolution", "StereoBM"]
    assert app.slider(key=keys.BLOCK).value == 21
    moved(app, {keys.TAB: "correlation"})
    assert app.slider(key=keys.WINDOW).value == 31
    step(app, pair="square")
    assert app.button_group(key="pairs.size").value == "Automatic"
    assert app.slider(key=keys.WINDOW).value == 20
    assert address(app) == {"pair": "square"}
    step(app)
    assert app.button_group(key="pairs").value != "square"
    assert address(app) == {}
    step(app, pair="square", maps="sgm")
    step(app)
    assert app.button_group(key=keys.TAB).value == "correlation"
    assert list(figures(app)) == ["Convolution", "StereoBM"]
