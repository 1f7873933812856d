"""The pages for a new visitor, for one with half of the files, and for one with an unreadable file."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from streamlit.testing.v1 import AppTest

from stereolag.ui.navigation import ICONS, PAGES
from tests.app import uploads

OpenPage = Callable[..., AppTest]

LAG, SEARCH, DEPTH = "pages/1_Sensor_lag.py", "pages/2_Rocketman_search.py", "pages/3_Depth_maps.py"
SCENE = uploads.png(uploads.texture(60, 90))


def test_every_page_but_the_home_page_has_an_icon_of_its_own() -> None:
    drawn = {icon.stem for icon in ICONS.glob("*.svg")}
    assert drawn == {label.lower().replace(" ", "_") for label, _ in PAGES.values()} - {"home"}


@pytest.mark.parametrize(
    ("path", "inputs", "given", "missing"),
    [
        (LAG, "recordings", ("file_1", "a.wav", uploads.wav(uploads.noise(500))), "Sensor 2"),
        (SEARCH, "pictures", ("template", "a.png", SCENE), "Image"),
        (DEPTH, "pairs", ("left", "a.png", SCENE), "Right image"),
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
    app = open_page(LAG, {"recordings": "own"})
    app.file_uploader(key="recordings.file_1").upload("bro*ken*.wav", b"nothing", "application/octet-stream")
    app.run()
    (refused,) = app.error
    assert refused.value.startswith("“bro?ken?.wav”: ")
    assert refused.icon == ":material/block:"
