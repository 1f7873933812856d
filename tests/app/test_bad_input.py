"""Every bad file is answered with one clear sentence; the page keeps its previous contents."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from streamlit.testing.v1 import AppTest

from stereolag.core.typography import typeset
from tests.app import keys, uploads
from tests.app.conftest import viewers

pytestmark = pytest.mark.usefixtures("small_pairs", "small_mazes")

OpenPage = Callable[..., AppTest]
Shown = Callable[[AppTest], str]

LAG, FIND, DEPTH = "pages/1_Sensor_lag.py", "pages/2_Rocketman_search.py", "pages/3_Depth_maps.py"
PAGES = {"recordings": LAG, "pictures": FIND, "pairs": DEPTH}

SCENE = uploads.texture(60, 90)
SOUND = uploads.noise(2_000)

GOOD = {
    "recordings": {name: ("a.wav", uploads.wav(SOUND)) for name in ("file_1", "file_2")},
    "pairs": {name: ("a.png", uploads.png(SCENE)) for name in ("right", "left")},
    "pictures": {"template": ("t.png", uploads.png(SCENE[:20, :20])), "picture": ("p.png", uploads.png(SCENE))},
}
BAD_PICTURES = {
    "an empty file": (b"", "empty file"),
    "a text named .png": (b"not a picture at all\n" * 20, "accepted are"),
    "a truncated PNG": (uploads.png(SCENE)[:2_000], "cut short"),
    "a PNG of 30000 × 30000": (uploads.huge_png(), "at most 50 megapixels are accepted"),
}
BAD_RECORDINGS = {
    "an empty file": ("a.wav", b"", "empty file"),
    "one sample": ("a.csv", b"0.5\n", "at least 2 are needed"),
    "one sample in a wav": ("a.wav", uploads.wav(np.array([0.5])), "at least 2 are needed"),
    "a NUL byte": ("a.csv", uploads.csv(SOUND[:50]) + b"\n\x00\n0.5", "NUL byte"),
    "a word in the middle": ("a.csv", uploads.csv(SOUND[:50]) + b"\nhello\n0.5", "“hello”"),
    "nothing but words": ("a.csv", b"these\nare\nwords\n", "allowed are finite numbers"),
    "no channels": ("a.wav", uploads.wav_without_channels(), "without channels"),
    # Must be last: the file is readable, so it stays in use.
    "a constant signal": ("a.wav", uploads.wav(np.full(500, 0.25)), "constant"),
}


def put(app: AppTest, key: str, name: str, data: bytes) -> AppTest:
    app.file_uploader(key=key).upload(name, data, "application/octet-stream")
    return app.run()


def own(open_page: OpenPage, inputs: str, **files: Any) -> AppTest:
    """Return the page with good files uploaded."""
    app = open_page(PAGES[inputs], {inputs: "own"})
    for name, (file_name, data) in files.items():
        app.file_uploader(key=f"{inputs}.{name}").upload(file_name, data, "application/octet-stream")
    app.run()
    assert not app.error
    assert not app.info
    return app


def assert_one_sentence(app: AppTest, fragment: str) -> None:
    assert not app.exception
    assert len(app.error) == 1
    said = app.error[0].value
    assert typeset(fragment) in said
    assert said.endswith(".")
    assert "Traceback" not in said
    assert "\n" not in said


@pytest.mark.parametrize(
    ("inputs", "files"),
    [
        ("pictures", {"template": SCENE[20:40, 30:60], "picture": SCENE}),
        ("pairs", {"right": SCENE[:, 5:], "left": SCENE[:, :-5]}),
    ],
)
def test_a_bad_picture_leaves_the_page_as_it_was(
    open_page: OpenPage, shown: Shown, inputs: str, files: dict[str, Any]
) -> None:
    good = {name: (f"{name}.png", uploads.png(picture)) for name, picture in files.items()}
    app = own(open_page, inputs, **good)
    before = shown(app)
    for name in files:
        for bad, fragment in BAD_PICTURES.values():
            put(app, f"{inputs}.{name}", "bad.png", bad)
            assert_one_sentence(app, fragment)
            assert shown(app) == before
        put(app, f"{inputs}.{name}", *good[name])
        assert not app.error
        assert shown(app) == before


def test_a_bad_recording_leaves_the_page_as_it_was(open_page: OpenPage, shown: Shown) -> None:
    good = ("good.csv", uploads.csv(SOUND))
    app = own(open_page, "recordings", file_1=good, file_2=good)
    rate = next(box for box in app.number_input if box.label.startswith("Sampling rate"))
    rate.set_value(12_345.0).run()
    before = shown(app)
    for key in ("recordings.file_1", "recordings.file_2"):
        for name, bad, fragment in BAD_RECORDINGS.values():
            put(app, key, name, bad)
            assert_one_sentence(app, fragment)
            assert shown(app) == before
            assert next(box for box in app.number_input if box.label.startswith("Sampling rate")).value == 12_345
        put(app, key, *good)
        assert not app.error
        assert shown(app) == before


def test_a_bad_first_recording_leaves_no_answer_of_the_example(open_page: OpenPage) -> None:
    app = open_page(LAG, {"recordings": "own"})
    put(app, "recordings.file_2", "good.csv", uploads.csv(SOUND))
    for name, bad, fragment in BAD_RECORDINGS.values():
        put(app, "recordings.file_1", name, bad)
        assert_one_sentence(app, fragment)
        assert not app.header
        assert not app.metric
    put(app, "recordings.file_1", "good.csv", uploads.csv(SOUND))
    assert not app.error
    assert "at the same time" in app.header[0].value


def test_pictures_refused_at_first_leave_no_answer_of_the_example(open_page: OpenPage) -> None:
    app = open_page(DEPTH, {"pairs": "own"})
    assert viewers(app)
    put(app, "pairs.left", "left.png", b"no picture")
    assert_one_sentence(app, "accepted are")
    assert not viewers(app)
    put(app, "pairs.left", "left.png", uploads.png(SCENE))
    put(app, "pairs.right", "right.png", uploads.png(SCENE[:30]))
    assert_one_sentence(app, "give or take 3 %")
    assert not viewers(app)


@pytest.mark.parametrize(
    ("inputs", "name", "bad", "fragment"),
    [
        ("recordings", "file_2", uploads.wav(SOUND, 16_001), "their ratio is"),
        ("pairs", "left", uploads.png(SCENE[:-10]), "both images must have the same size"),
        ("pairs", "truth", uploads.png(np.full((10, 10), 256, dtype=np.uint16)), "must have the same size"),
        ("pictures", "template", uploads.png(uploads.texture(70, 20)), "must fit into the image. The previous files"),
        ("pictures", "mask", uploads.png(np.full((9, 20), 255, np.uint8)), "must have the same size"),
        ("pictures", "mask", uploads.png(np.zeros((20, 20), np.uint8)), "black all over"),
    ],
)
def test_a_good_file_that_does_not_fit_the_others_leaves_the_page_as_it_was(
    open_page: OpenPage, shown: Shown, inputs: str, name: str, bad: bytes, fragment: str
) -> None:
    app = own(open_page, inputs, **GOOD[inputs])
    before = shown(app)
    put(app, f"{inputs}.{name}", "other.wav" if inputs == "recordings" else "other.png", bad)
    assert_one_sentence(app, fragment)
    assert shown(app) == before


def test_files_that_never_fitted_leave_none_before_them_in_use(open_page: OpenPage) -> None:
    app = open_page(FIND, {"pictures": "own"})
    app.file_uploader(key="pictures.picture").upload("p.png", uploads.png(SCENE), "image/png")
    put(app, "pictures.template", "t.png", uploads.png(uploads.texture(70, 20)))
    assert_one_sentence(app, "must fit into the image")
    assert "stay in use" not in app.error[0].value


@pytest.mark.parametrize("size", [(1, 1), (4, 5), (6, 300), (300, 7)])
def test_pictures_too_small_for_a_window_are_refused_and_every_part_goes_on(
    open_page: OpenPage, size: tuple[int, int]
) -> None:
    app = open_page(DEPTH, {"pairs": "own"})
    for seed, side in enumerate(("left", "right")):
        data = uploads.png(uploads.texture(*size, seed))
        app.file_uploader(key=f"pairs.{side}").upload(f"{side}.png", data, "image/png")
    app.run()
    assert not app.exception
    for part in app.button_group(key=keys.PART).options:
        app.button_group(key=keys.PART).set_value(part).run()
        assert not app.exception
    app.button(key=keys.preset_key("report")).click().run()
    assert not app.exception
    assert any("px and the images are" in error.value for error in app.error)
    app.button_group(key="pairs").set_value("cube").run()
    app.button(key=keys.preset_key("reset")).click().run()
    assert not app.exception
    assert not app.error
    assert app.slider(key=keys.WINDOW).value == 20


def test_a_side_by_side_picture_of_one_column_is_refused(open_page: OpenPage) -> None:
    app = open_page(DEPTH, {"pairs": "own"})
    app.button_group(key="pairs.arrangement").set_value("beside").run()
    put(app, "pairs.beside", "both.png", uploads.png(SCENE[:, :1]))
    assert_one_sentence(app, "at least 2 are needed")
