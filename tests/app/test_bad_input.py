"""A bad file is answered with one clear sentence, and the page keeps its previous contents.

Which files are bad, and the sentence about each, is tested in ``tests/core``.
"""

from __future__ import annotations

import numpy as np
import pytest
from streamlit.testing.v1 import AppTest

from stereolag.core.typography import typeset
from tests.app import keys, uploads
from tests.app.conftest import viewers
from tests.app.pages import DEPTH, FIND, LAG, OpenPage, Shown

pytestmark = pytest.mark.usefixtures("small_pairs", "small_mazes")

PAGES = {"recordings": LAG, "pictures": FIND, "pairs": DEPTH}

SCENE = uploads.texture(60, 90)
SOUND = uploads.noise(2_000)

GOOD = {
    "recordings": {name: ("a.wav", uploads.wav(SOUND)) for name in ("file_1", "file_2")},
    "pairs": {name: ("a.png", uploads.png(SCENE)) for name in ("right", "left")},
    "pictures": {"template": ("t.png", uploads.png(SCENE[:20, :20])), "picture": ("p.png", uploads.png(SCENE))},
}
NO_PICTURE = "b.png", b"not a picture at all\n" * 20
BAD = {
    "recordings": [
        (("a.wav", uploads.wav_without_channels()), "0 channels"),
        (("a.wav", uploads.wav(np.array([0.5]))), "at least 2 are needed"),
        # Must be last: the file is readable, so it stays in use.
        (("a.wav", uploads.wav(np.full(500, 0.25))), "constant"),
    ],
    "pictures": [(NO_PICTURE, "accepted are")],
    "pairs": [(NO_PICTURE, "accepted are")],
}


def put(app: AppTest, key: str, name: str, data: bytes) -> AppTest:
    app.file_uploader(key=key).upload(name, data, "application/octet-stream")
    return app.run()


def own(open_page: OpenPage, inputs: str) -> AppTest:
    """Return the page with good files uploaded."""
    app = open_page(PAGES[inputs], {inputs: "own"})
    for name, (file_name, data) in GOOD[inputs].items():
        app.file_uploader(key=f"{inputs}.{name}").upload(file_name, data, "application/octet-stream")
    app.run()
    assert not app.error
    assert not app.info
    return app


def assert_one_sentence(app: AppTest, fragment: str) -> None:
    assert not app.exception
    (error,) = app.error
    assert typeset(fragment) in error.value
    assert error.value.endswith(".")
    assert "Traceback" not in error.value
    assert "\n" not in error.value


@pytest.mark.parametrize("inputs", GOOD)
def test_a_bad_file_leaves_the_page_as_it_was(open_page: OpenPage, shown: Shown, inputs: str) -> None:
    app = own(open_page, inputs)
    if inputs == "recordings":
        next(box for box in app.number_input if box.label.startswith("Sampling rate")).set_value(12_345.0).run()
    before = shown(app)
    for number, (name, good) in enumerate(GOOD[inputs].items()):
        for bad, fragment in BAD[inputs][: 1 if number else None]:
            put(app, f"{inputs}.{name}", *bad)
            assert_one_sentence(app, fragment)
            assert shown(app) == before
        put(app, f"{inputs}.{name}", *good)
        assert not app.error
        assert shown(app) == before


def test_files_refused_at_first_leave_no_answer_of_the_example(open_page: OpenPage) -> None:
    app = open_page(LAG, {"recordings": "own"})
    put(app, "recordings.file_1", "bro*ken*.wav", b"nothing")
    assert app.error[0].value.startswith("“bro?ken?.wav”: ")
    assert app.error[0].icon == ":material/block:"
    put(app, "recordings.file_2", *GOOD["recordings"]["file_2"])
    for bad, fragment in BAD["recordings"]:
        put(app, "recordings.file_1", *bad)
        assert_one_sentence(app, fragment)
        assert not app.header
        assert not app.metric
    put(app, "recordings.file_1", *GOOD["recordings"]["file_1"])
    assert not app.error
    assert "at the same time" in app.header[0].value

    app = open_page(DEPTH)
    app.button_group(key="pairs").set_value("own").run()
    assert viewers(app)
    put(app, "pairs.left", *NO_PICTURE)
    assert_one_sentence(app, "accepted are")
    assert not viewers(app)
    put(app, "pairs.left", "left.png", uploads.png(SCENE))
    put(app, "pairs.right", "right.png", uploads.png(SCENE[:30]))
    assert_one_sentence(app, "give or take 3 %")
    assert not viewers(app)

    app = open_page(FIND, {"pictures": "own"})
    put(app, "pictures.picture", "p.png", uploads.png(SCENE))
    put(app, "pictures.template", "t.png", uploads.png(uploads.texture(70, 100)))
    assert_one_sentence(app, "change them over")
    assert "stay in use" not in app.error[0].value


@pytest.mark.parametrize(
    ("inputs", "name", "bad", "fragment"),
    [
        ("pairs", "left", uploads.png(SCENE[:-10]), "both images must have the same size"),
        ("pairs", "truth", uploads.png(np.full((10, 10), 256, dtype=np.uint16)), "must have the same size"),
        ("pictures", "template", uploads.png(uploads.texture(70, 20)), "must fit into the image. The previous files"),
        ("pictures", "mask", uploads.png(np.zeros((20, 20), np.uint8)), "black all over"),
    ],
)
def test_a_good_file_that_does_not_fit_the_others_leaves_the_page_as_it_was(
    open_page: OpenPage, shown: Shown, inputs: str, name: str, bad: bytes, fragment: str
) -> None:
    app = own(open_page, inputs)
    before = shown(app)
    put(app, f"{inputs}.{name}", "other.png", bad)
    assert_one_sentence(app, fragment)
    assert shown(app) == before


def test_pictures_too_small_for_a_window_are_refused_and_every_part_goes_on(open_page: OpenPage) -> None:
    app = open_page(DEPTH, {"pairs": "own"})
    for seed, side in enumerate(("left", "right")):
        data = uploads.png(uploads.texture(1, 1, seed))
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
    app = open_page(DEPTH, {"pairs": "own", "pairs.arrangement": "beside"})
    put(app, "pairs.beside", "both.png", uploads.png(SCENE[:, :1]))
    assert_one_sentence(app, "at least 2 are needed")
