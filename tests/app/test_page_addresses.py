"""A page opens from an address and keeps its settings in it, also through steps back; presets set what it holds."""

from collections.abc import Callable
from functools import partial
from typing import Any

import pytest
from streamlit.testing.v1 import AppTest, local_script_runner

from stereolag.core.searches import LagSearch, TemplateQuery
from tests.app import keys, uploads
from tests.app.pages import DEPTH, FIND, LAG, arrive, linked, moved, open_unfolded, uploaded
from tests.app.reading import address, controls, figures, ignored, lag_found, viewers

COAST, HARBOUR = "recordings coast", "recordings harbour"
MAX_LAG, SPEED, RATE = (f"lag.{name}.{HARBOUR}" for name in ("max_lag", "speed", "sampling_rate"))
SQUARE = {"pair": "square", "window_size": "31"}
STEPS: dict[str, list[tuple[dict[str, Any], dict[str, str]]]] = {
    LAG: [
        ({"recordings": "harbour"}, {"recordings": "harbour"}),
        ({MAX_LAG: 40_000, SPEED: 1500.0}, {"recordings": "harbour", "speed": "1500.0", "max_lag": "40000"}),
        ({MAX_LAG: None}, {"recordings": "harbour", "speed": "1500.0"}),
    ],
    FIND: [({"pictures": "maze_dulled", "template.max_matches": 3}, {"picture": "maze_dulled", "max_matches": "3"})],
    DEPTH: [
        ({keys.WINDOW: 31, "pairs": "square", keys.TAB: "bm"}, SQUARE),
        ({keys.BLOCK: 9, keys.TAB: "correlation"}, SQUARE | {"bm.block_size": "9"}),
        ({keys.WINDOW: 20}, {"pair": "square", "bm.block_size": "9"}),
    ],
}


@pytest.mark.parametrize("page", STEPS)
def test_the_address_says_what_is_not_as_at_first(page: str) -> None:
    app = linked(page)
    assert address(app) == {}
    for values, said in STEPS[page]:
        assert address(moved(app, values)) == said


HARBOUR_LINK = {"method": "phat", "sampling_rate": "8000.5", "speed": "1497.25", "max_lag": "40000"}
HARBOUR_LINK |= {"recordings": "harbour"}
EXTREME_LINK = {"sampling_rate": "1000000000000.0", "speed": "1000000000000.0", "max_lag": "0"}
DULLED_LINK = {"picture": "maze_dulled", "method": "sampled", "min_score": "0.513", "max_matches": "2"}
POSES_LINK = {"min_scale": "0.99", "max_scale": "1.01", "max_rotation": "0.5"}
SQUARE_LINK = {"pair": "square", "size": "1/2", "window_size": "31", "search.num_disparities": "40"}
CENTRED_LINK = {"overlap": "0.5", "search.kind": "centred", "search.search_size": "60"}
SQUARE_DISPARITIES = keys.setting("correlation", "search.rectified.num_disparities", "pair square 1/2")
LINKS: list[tuple[str, dict[str, str], dict[str, Any]]] = [
    (LAG, HARBOUR_LINK, {"recordings": "harbour", "lag.method": "phat", RATE: 8000.5, MAX_LAG: 40_000}),
    (LAG, EXTREME_LINK, {f"lag.{name}.{COAST}": float(EXTREME_LINK[name]) for name in EXTREME_LINK}),
    (FIND, DULLED_LINK, {"pictures": "maze_dulled", "template.min_score": 0.513}),
    (FIND, POSES_LINK, {"template.min_scale": 0.99, "template.max_rotation": 0.5}),
    (DEPTH, SQUARE_LINK, {"pairs": "square", keys.WINDOW: 31, SQUARE_DISPARITIES: 40}),
    (DEPTH, CENTRED_LINK, {keys.SEARCH: "centred", keys.SEARCH_SIZE: 60}),
    (DEPTH, {"maps": "bm", "bm.block_size": "9"}, {keys.BLOCK: 9}),
]


@pytest.mark.parametrize(("page", "link", "values"), LINKS)
def test_a_link_opens_the_page_as_it_was(page: str, link: dict[str, str], values: dict[str, Any]) -> None:
    app = linked(page, **link)
    assert {key: controls(app)[key].value for key in values} == values
    assert not ignored(app)
    assert address(app) == link


@pytest.mark.parametrize(("page", "inputs", "kind"), [(LAG, "recordings", LagSearch), (FIND, "picture", TemplateQuery)])
def test_every_setting_of_a_search_is_in_a_link_above(page: str, inputs: str, kind: type[Any]) -> None:
    assert {name for one, link, _ in LINKS if one == page for name in link} == {inputs, *kind.model_fields}


BAD: list[tuple[str, dict[str, str], list[str]]] = [
    (
        LAG,
        {"recordings": "mine", "sampling_rate": "1e-12", "speed": "1e-300", "max_lag": "99999999"},
        [
            "recordings = “mine” in the address is ignored",
            "max_lag is 99999999; allowed are whole numbers from 0 to 99999 or None.",
            "sampling_rate is 1e-12; on this page allowed are numbers from 1e-09 to",
            "speed is 1e-300; on this page allowed are numbers from 1e-09 to",
        ],
    ),
    (LAG, {"max_lag": "9" * 400}, []),
    (
        DEPTH,
        {"pair": "nowhere", "size": "3", "maps": "bm,x", "window_size": "1", "bm.block_size": "20", "x": "7"},
        ["“nowhere”", "“3”", "“bm,x”", "“1”", "“20”", "“7”"],
    ),
]


@pytest.mark.parametrize(("page", "link", "fragments"), BAD)
def test_what_is_bad_in_a_link_is_answered_with_a_sentence_each_and_opens_the_page(page, link, fragments):
    app = linked(page, **link)
    said = ignored(app)
    assert len(said) == len(link)
    assert all(any(fragment in sentence for sentence in said) for fragment in fragments)
    assert not app.error
    assert address(app) == {}


SOUND = uploads.noise(4100)
OWN_SOUNDS = {"file_1": ("1.wav", uploads.wav(SOUND[100:])), "file_2": ("2.wav", uploads.wav(SOUND[:4000]))}


def test_the_address_of_own_files_shows_no_example_and_its_settings_wait_for_the_files() -> None:
    app = linked(LAG, recordings="own", method="phat", speed="1500")
    assert not app.error and not app.header
    assert app.warning[0].value.startswith("The files of this page are gone")
    uploaded(app, "recordings", **OWN_SOUNDS)
    assert lag_found(app) == 100
    assert app.button_group(key="lag.method").value == "phat"
    assert address(app) == {"recordings": "own", "method": "phat", "speed": "1500.0"}


# Settings and maps of the depth page


def tab(app: AppTest, method: str) -> AppTest:
    return moved(app, {keys.TAB: method})


def preset(app: AppTest, name: str) -> AppTest:
    return app.button(key=keys.preset_key(name)).click().run()


def test_presets_set_the_controls_and_reset_takes_them_back() -> None:
    app = preset(open_unfolded(DEPTH), "report")
    assert app.button_group(key=keys.SEARCH).value == "centred"
    assert app.slider(key=keys.SEARCH_SIZE).value == 20
    preset(app, "fast")
    assert app.slider(key=keys.WINDOW).value == 11
    assert app.slider(key=keys.DISPARITIES).value == 64
    assert app.toggle(key=keys.LEFT_RIGHT).value
    tab(app, "bm").slider(key=keys.BLOCK).set_value(9).run()
    preset(app, "accurate")
    assert app.button_group(key=keys.TAB).value == "sgm"
    assert list(figures(app)) == ["StereoBM", "Semi-global"]
    assert address(app)["maps"] == "bm,sgm"
    preset(app, "reset")
    assert list(figures(app)) == ["Convolution", "StereoBM"]
    assert address(app) == {}
    assert tab(app, "bm").slider(key=keys.BLOCK).value == 21
    assert tab(app, "correlation").slider(key=keys.WINDOW).value == 20
    assert not app.toggle(key=keys.LEFT_RIGHT).value


def test_what_does_not_apply_is_disabled_and_counts_for_nothing() -> None:
    app = moved(open_unfolded(DEPTH), {keys.MEDIAN: True})
    moved(app, {keys.OVERLAP: 0.5, keys.SEARCH: "centred"})
    assert app.toggle(key=keys.MEDIAN).disabled
    assert not app.error
    moved(app, {keys.SEARCH: "rectified"})
    assert app.toggle(key=keys.MEDIAN).value


def test_the_maps_shown_stand_in_the_address_and_without_one_it_is_asked_for() -> None:
    app = linked(DEPTH, maps="sgm,sgbm")
    assert list(figures(app)) == ["StereoSGBM", "Semi-global"]
    assert address(app) == {"maps": "sgbm,sgm"}
    moved(app, {keys.SHOWN: ["bm"]})
    assert list(figures(app)) == ["StereoBM"]
    assert address(app) == {"maps": "bm"}
    moved(app, {keys.SHOWN: []})
    assert "depth.bench" not in {viewer["name"] for viewer in viewers(app)}
    assert [info.value for info in app.info] == ["No map is chosen. Choose one above."]
    assert address(app) == {}
    moved(app, {keys.PART: "Compare"})
    assert [(viewer["colours"]["low"], viewer["colours"]["high"]) for viewer in viewers(app)] == [(0, 64)]
    tab(app, "bm")
    assert app.button_group(key=keys.SHOWN).value == ["bm"]
    assert list(figures(app)) == ["StereoBM"]
    tab(app, "correlation")
    assert list(figures(app)) == ["Convolution", "StereoBM"]
    assert not app.info


def test_settings_within_settings_that_do_not_fit_together_are_refused_with_a_sentence() -> None:
    app = moved(linked(DEPTH, maps="sgm"), {keys.setting("sgm", "optimisation.penalty_small"): 200})
    assert [error.value for error in app.error] == [
        "penalty_small is 200, penalty_at_edges 80 and penalty_large 400; each must be at least as large as the one "
        "before."
    ]


# Steps through the history of the browser: the page is as it was there, with all files and settings

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


def test_a_step_through_the_history_takes_back_what_its_address_does_not_name(step: Step) -> None:
    app = moved(moved(linked(LAG), {"recordings": "harbour"}), {"lag.method": "phat"})
    for named in ({"recordings": "harbour"}, {}, {"recordings": "harbour", "method": "phat"}, {"method": "phat"}):
        step(app, **named)
        assert set_on_lag_page(app) == {"recordings": "coast", "method": "fft"} | named
        assert address(app) == named
    app = moved(linked(FIND), {"pictures": "maze_dulled", "template.min_score": 0.7})
    step(app)
    assert app.button_group(key="pictures").value == "maze"
    assert app.slider(key="template.min_score").value == 0.5
    assert address(app) == {}


def test_a_step_back_undoes_the_last_move() -> None:
    app = linked(LAG, recordings="harbour", method="phat", max_lag="4000")
    assert app.number_input(key=MAX_LAG).value == 4_000
    arrive(app, recordings="harbour")
    assert set_on_lag_page(app) == {"recordings": "harbour", "method": "fft"}
    assert app.number_input(key=MAX_LAG).value is None


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
    app = moved(linked(LAG), {"recordings": "own"})
    moved(uploaded(app, "recordings", **OWN_SOUNDS), {"lag.method": "phat"})
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
