from __future__ import annotations

import time
from collections.abc import Callable

import pytest
from streamlit.testing.v1 import AppTest

from stereolag.core.typography import typeset
from stereolag.ui.navigation import ICONS, PAGES
from tests.app import uploads
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


SCENE = uploads.png(uploads.texture(60, 90))


def test_every_page_but_the_home_page_has_an_icon_of_its_own() -> None:
    drawn = {icon.stem for icon in ICONS.glob("*.svg")}
    assert drawn == {label.lower().replace(" ", "_") for label, _ in PAGES.values()} - {"home"}


@pytest.mark.parametrize(
    ("path", "inputs", "given", "missing"),
    [
        ("pages/1_Sensor_lag.py", "recordings", ("file_1", "a.wav", uploads.wav(uploads.noise(500))), "Sensor 2"),
        ("pages/2_Rocketman_search.py", "pictures", ("template", "a.png", SCENE), "Image"),
        ("pages/3_Depth_maps.py", "pairs", ("left", "a.png", SCENE), "Right image"),
    ],
)
def test_a_page_opens_on_one_thing_to_try_and_says_which_file_is_missing(
    open_page: OpenPage, path: str, inputs: str, given: tuple[str, str, bytes], missing: str
) -> None:
    app = open_page(path)
    assert len([one for one in app.markdown if "Try first" in one.value]) == 1
    assert not (app.info or app.warning or app.error)
    app.button_group(key=inputs).set_value("own").run()
    assert "the page shows the example" in app.info[0].value
    assert any("stay in this session" in one.value for one in app.caption)
    name, file, data = given
    app.file_uploader(key=f"{inputs}.{name}").upload(file, data, "application/octet-stream")
    app.run()
    assert app.info[0].value.startswith(f"Still missing: {missing}. Until then the page shows the example")


def test_a_refused_file_is_named(open_page: OpenPage) -> None:
    app = open_page("pages/1_Sensor_lag.py", {"recordings": "own"})
    app.file_uploader(key="recordings.file_1").upload("bro*ken*.wav", b"nothing", "application/octet-stream")
    app.run()
    (refused,) = app.error
    assert refused.value.startswith("“bro?ken?.wav”: ")
    assert refused.icon == ":material/block:"
