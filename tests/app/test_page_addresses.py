"""A page opens from an address with its settings in it, and keeps it; presets and reset set what stands in it."""

from __future__ import annotations

from typing import Any

import pytest
from streamlit.testing.v1 import AppTest

from stereolag.core.searches import LagSearch, TemplateQuery
from tests.app import keys, uploads
from tests.app.pages import DEPTH, FIND, LAG, linked, moved, open_page, open_unfolded
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
    (DEPTH, {"maps": "sgm", "sgm.window_size": "15"}, {keys.setting("sgm", "window_size"): 15}),
]


@pytest.mark.parametrize(("page", "link", "values"), LINKS)
def test_a_link_opens_the_page_as_it_was(page: str, link: dict[str, str], values: dict[str, Any]) -> None:
    app = linked(page, **link)
    assert {key: controls(app)[key].value for key in values} == values
    assert not ignored(app)
    assert address(app) == link


def test_what_a_link_asks_for_is_measured() -> None:
    assert lag_found(linked(LAG, **HARBOUR_LINK)) == -31_234


@pytest.mark.parametrize(("page", "inputs", "kind"), [(LAG, "recordings", LagSearch), (FIND, "picture", TemplateQuery)])
def test_every_setting_of_a_search_is_in_a_link_above(page: str, inputs: str, kind: type[Any]) -> None:
    assert {name for one, link, _ in LINKS if one == page for name in link} == {inputs, *kind.model_fields}


BAD: list[tuple[str, dict[str, str], list[str]]] = [
    (LAG, {"recordings": "mine"}, ["recordings = “mine” in the address is ignored"]),
    (
        LAG,
        {"sampling_rate": "1e-12", "speed": "1e-300", "max_lag": "99999999"},
        [
            "max_lag is 99999999; allowed are whole numbers from 0 to 176400 or None.",
            "sampling_rate is 1e-12; on this page allowed are numbers from 1e-09 to",
            "speed is 1e-300; on this page allowed are numbers from 1e-09 to",
        ],
    ),
    (LAG, {"max_lag": "9" * 400}, []),
    (FIND, {"picture": "mine"}, ["picture = “mine” in the address is ignored: "]),
    (DEPTH, {"pair": "nowhere", "window_size": "1", "bm.block_size": "20"}, ["“nowhere”", "“1”", "“20”"]),
    (DEPTH, {"size": "3", "maps": "bm,x", "x": "1"}, ["“3”", "“bm,x”", "“1”"]),
]


@pytest.mark.parametrize(("page", "link", "fragments"), BAD)
def test_what_is_bad_in_a_link_is_answered_with_a_sentence_each_and_opens_the_page(
    page: str, link: dict[str, str], fragments: list[str]
) -> None:
    app = linked(page, **link)
    said = ignored(app)
    assert len(said) == len(link)
    assert all(any(fragment in sentence for sentence in said) for fragment in fragments)
    assert not app.error
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


# Settings and maps of the depth page


def tab(app: AppTest, method: str) -> AppTest:
    """Open the controls of a method."""
    return moved(app, {keys.TAB: method})


def preset(app: AppTest, name: str) -> AppTest:
    """Press the button of a preset, or of the reset."""
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


def test_the_maps_shown_stand_in_the_address() -> None:
    app = linked(DEPTH, maps="sgm,sgbm")
    assert list(figures(app)) == ["StereoSGBM", "Semi-global"]
    assert address(app) == {"maps": "sgbm,sgm"}
    moved(app, {keys.SHOWN: ["bm"]})
    assert list(figures(app)) == ["StereoBM"]
    assert address(app) == {"maps": "bm"}
    tab(app, "correlation")
    assert list(figures(app)) == ["Convolution", "StereoBM"]


def test_without_a_map_chosen_none_is_shown_and_one_is_asked_for() -> None:
    app = moved(open_page(DEPTH), {keys.SHOWN: []})
    assert not app.error
    assert "depth.bench" not in {viewer["name"] for viewer in viewers(app)}
    assert [info.value for info in app.info] == ["No map is chosen. Choose one above."]
    assert address(app) == {}
    moved(app, {keys.PART: "Compare"})
    assert [(viewer["colours"]["low"], viewer["colours"]["high"]) for viewer in viewers(app)] == [(0, 64)]
    moved(app, {keys.SHOWN: ["sgbm"]})
    assert list(figures(app)) == ["StereoSGBM"]
    moved(app, {keys.SHOWN: []})
    tab(app, "bm")
    assert app.button_group(key=keys.SHOWN).value == ["bm"]
    assert list(figures(app)) == ["StereoBM"]
    assert not app.info


def test_settings_within_settings_that_do_not_fit_together_are_refused_with_a_sentence() -> None:
    app = moved(linked(DEPTH, maps="sgm"), {keys.setting("sgm", "optimisation.penalty_small"): 200})
    assert [error.value for error in app.error] == [
        "penalty_small is 200, penalty_at_edges 80 and penalty_large 400; each must be at least as large as the one "
        "before."
    ]
