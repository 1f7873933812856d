from __future__ import annotations

import time
from collections.abc import Callable

import pytest
from streamlit.testing.v1 import AppTest

from stereolag.core.typography import typeset
from stereolag.ui.navigation import PAGES
from tests.app import keys
from tests.app.conftest import PROJECT, figures, viewers

OpenPage = Callable[..., AppTest]

PATIENCE_S = 60.0


def numbers(app: AppTest) -> dict[str, str]:
    return {metric.label: metric.value for metric in app.metric}


def announced(app: AppTest) -> bool:
    """Return whether a page announces its headline; wait for the job that some pages start with."""
    end = time.monotonic() + PATIENCE_S
    while not any(one.proto.component_name == "stereolag.announcement" for one in app.get("bidi_component")):
        if time.monotonic() > end:
            return False
        time.sleep(0.1)
        app.run()
    return True


@pytest.mark.usefixtures("small_boards", "short_drive")  # otherwise their jobs run on during later tests
@pytest.mark.parametrize("path", PAGES)
def test_every_page_runs_and_links_to_every_other(open_page: OpenPage, path: str) -> None:
    app = open_page(path)
    assert not app.exception
    assert not app.error
    assert len(app.title) == 1
    assert len(app.get("page_link")) >= len(PAGES)
    # A picture stored as a separate file could be replaced before the browser fetches it.
    assert all(one.url.startswith("data:image/") for element in app.get("image") for one in element.proto.imgs)
    assert path == "app.py" or announced(app)


def test_every_page_is_described() -> None:
    described = (PROJECT / "docs" / "pages.md").read_text(encoding="utf-8")
    for name, _ in list(PAGES.values())[1:]:
        assert f"\n| {name} |" in described
        assert f"\n## {name}\n" in described


def test_every_file_of_the_pages_is_linked() -> None:
    assert sorted(PAGES) == ["app.py", *sorted(f"pages/{path.name}" for path in (PROJECT / "pages").glob("*.py"))]


def test_home_shows_the_three_measurements_as_computed(open_page: OpenPage) -> None:
    app = open_page("app.py")
    prose = " ".join(block.value for block in app.markdown)
    assert "50,082 samples" in prose
    assert typeset("378.17 m") in prose
    assert "row **528**, column **982**" in prose
    assert len(app.get("image")) == 2
    assert len(app.get("plotly_chart")) == 1


def test_lag_page_says_who_hears_it_later_and_how_far_apart_that_is(open_page: OpenPage) -> None:
    app = open_page("pages/1_Sensor_lag.py")
    assert app.header[0].value == typeset(
        "Sensor 2 hears it **1.136 s** after sensor 1: its path is **378.17 m** longer."
    )
    assert numbers(app)["Lag, samples"] == "50,082"
    assert len(app.get("plotly_chart")) == 5
    assert len(app.get("audio")) == 2


def test_lag_page_turns_the_sentence_round_for_a_negative_lag(open_page: OpenPage) -> None:
    app = open_page("pages/1_Sensor_lag.py")
    app.button_group(key="recordings").set_value("harbour").run()
    assert app.header[0].value.startswith(typeset("Sensor 1 hears it **0.7083 s** after sensor 2"))
    assert numbers(app)["Lag, samples"] == typeset("-31,234")


def test_search_page_finds_him_and_says_how_many_places_it_scored(open_page: OpenPage) -> None:
    app = open_page("pages/2_Rocketman_search.py")
    assert app.header[0].value == "Found at row 528, column 982"
    all_places = int(numbers(app)["Candidates scored"].replace(",", ""))
    app.button_group(key="template.method").set_value("sampled").run()
    assert app.header[0].value == "Found at row 528, column 982"
    assert int(numbers(app)["Candidates scored"].replace(",", "")) < all_places


def test_search_page_says_plainly_that_nothing_was_found_and_what_to_try(open_page: OpenPage) -> None:
    app = open_page("pages/2_Rocketman_search.py")
    app.button_group(key="pictures").set_value("maze_dulled").run()
    app.slider(key="template.min_score").set_value(1.0).run()
    assert app.header[0].value == "Not found"
    assert "The best place scores" in app.warning[0].value
    app.button_group(key="template.method").set_value("sampled").run()
    assert app.header[0].value == "Not found"
    assert "FFT" in app.warning[0].value


def test_depth_page_shows_both_methods_with_their_figures(open_page: OpenPage) -> None:
    app = open_page("pages/3_Depth_maps.py")
    assert {name: [*numbers] for name, numbers in figures(app).items()} == {
        "Convolution": ["Took", "Coverage", "Bad-2", "EPE"],
        "StereoBM": ["Took", "Coverage", "Bad-2", "EPE"],
    }
    (bench,) = viewers(app)
    assert [one["title"] for one in bench["pictures"] if one["thumbnail"]] == [
        "Left image",
        "Right image",
        "Ground truth",
    ]
    assert bench["legends"][0]["words"] == ["FAR", "NEAR"]


def test_settings_stay_when_another_page_is_visited(open_page: OpenPage) -> None:
    app = open_page("pages/3_Depth_maps.py")
    app.slider(key=keys.WINDOW).set_value(31).run()
    app.switch_page("app.py").run()
    app.switch_page("pages/3_Depth_maps.py").run()
    assert app.slider(key=keys.WINDOW).value == 31
