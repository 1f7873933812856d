"""Parts of the search page: a template cut from the image, a painted mask, OpenCV beside it, and damage."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from streamlit.testing.v1 import AppTest

from stereolag import samples
from stereolag.io.images import read_image
from stereolag.templates import match_template
from stereolag.templates.trials import opencv_search
from stereolag.ui.search.hand_marks import PaintedMask
from stereolag.ui.search.sentences import differences
from tests.app import uploads
from tests.packed import told

pytestmark = pytest.mark.usefixtures("small_mazes")

OpenPage = Callable[..., AppTest]

SEARCH = "pages/2_Rocketman_search.py"
SCENE = np.random.default_rng(5).integers(0, 256, (90, 120, 3), dtype=np.uint8)


def test_a_template_can_be_cut_from_the_example(open_page: OpenPage) -> None:
    app = open_page(SEARCH)
    app.button_group(key="pictures.from").set_value("cut").run()
    (box,) = told(app, "box")
    assert (box["rows"], box["cols"]) == (400, 600)
    assert box["box"] == {"row": 167, "col": 262, "height": 66, "width": 75}
    assert app.header[0].value == "Found at row 167, column 262"
    app.button_group(key="pictures.from").set_value("given").run()
    assert app.header[0].value == "Found at row 200, column 200"


def of_the_address(app: AppTest) -> str:
    """Return the sentence about the page's address."""
    (said,) = [caption.value for caption in app.caption if caption.value.startswith("The address of this page")]
    return said


def test_the_address_is_said_to_lack_what_was_cut_and_painted(open_page: OpenPage) -> None:
    app = open_page(SEARCH, {"template.take.opened": True})
    held = "The address of this page holds its settings and the example: send it, or keep it as a bookmark."
    assert of_the_address(app) == held
    rows, cols = read_image(samples.mazes()["maze"].template).shape[:2]
    mask = np.ones((rows, cols), np.uint8)
    mask[:9] = 0
    app.session_state["pictures.painted.mask"] = "maze maze", PaintedMask(mask, "mask")
    app.run()
    assert of_the_address(app) == f"{held} The mask you painted is not in it: it opens the example’s template as it is."
    app.button_group(key="pictures.from").set_value("cut").run()
    cut = f"{held} The template you cut out is not in it: it opens the example’s template as it is."
    assert of_the_address(app) == cut
    box = "maze maze cut 167 262 66 75"
    app.session_state["pictures.painted.mask"] = box, PaintedMask(np.eye(66, 75, dtype=np.uint8), "mask")
    app.run()
    both = "The template you cut out and the mask you painted are not in it: it opens the example’s template as it is."
    assert of_the_address(app) == f"{held} {both}"


def test_the_address_is_said_to_lack_files_of_ones_own(open_page: OpenPage) -> None:
    app = open_page(SEARCH, {"pictures": "own", "pictures.from": "cut", "template.take.opened": True})
    app.file_uploader(key="pictures.picture").upload("scene.png", uploads.png(SCENE), "image/png").run()
    assert of_the_address(app) == "The address of this page holds its settings, but not your own files."


def test_to_cut_from_an_image_of_ones_own_no_template_is_needed(open_page: OpenPage) -> None:
    app = open_page(SEARCH, {"pictures": "own"})
    app.button_group(key="pictures.from").set_value("cut").run()
    assert len(app.info) == 1
    app.file_uploader(key="pictures.picture").upload("scene.png", uploads.png(SCENE), "image/png").run()
    assert not app.info
    assert told(app, "box")[0]["box"] == {"row": 37, "col": 52, "height": 15, "width": 15}
    assert app.header[0].value == "Found at row 37, column 52"


def test_a_template_that_lacks_a_place_is_offered_no_damage(open_page: OpenPage) -> None:
    app = open_page(SEARCH, {"pictures": "own", "template.see_why": "Damage it"})
    app.file_uploader(key="pictures.picture").upload("scene.png", uploads.png(SCENE), "image/png").run()
    other = np.random.default_rng(6).integers(0, 256, (20, 20, 3), dtype=np.uint8)
    app.file_uploader(key="pictures.template").upload("other.png", uploads.png(other), "image/png").run()
    assert not [slider for slider in app.slider if slider.key.startswith("degrade.")]
    assert "no place to damage" in app.caption[-1].value


def test_damage_ends_one_method_after_the_other_and_can_be_undone(open_page: OpenPage) -> None:
    app = open_page(SEARCH, {"template.see_why": "Damage it"})
    assert [text.split()[-1] for text in cards(app)] == ["found]"] * 3
    app.slider(key="degrade.noise").set_value(20).run()
    assert ["not found" in text for text in cards(app)] == [False, True, False]
    app.slider(key="degrade.turn").set_value(20.0).run()
    assert ["not found" in text for text in cards(app)] == [True, True, True]
    app.button(key="degrade.undo").click().run()
    assert ["not found" in text for text in cards(app)] == [False, False, False]
    assert app.slider(key="degrade.turn").value == 0


def cards(app: AppTest) -> list[str]:
    return [one.value for one in app.markdown if one.value.startswith(("**FFT", "**Sampled", "**OpenCV"))]


def test_large_offsets_lead_opencv_astray() -> None:
    image = (SCENE / np.float32(255)).astype(np.float32) + np.float32(1e4)
    template = image[30:50, 40:64]
    ours, theirs = match_template(image, template), opencv_search(image, template)
    assert (ours.matches[0].row, ours.matches[0].col) == (30, 40)
    assert (theirs.row, theirs.col) != (30, 40)
    assert "single precision" in differences(ours, theirs, "fft")[-1]


def test_images_of_two_types_are_damaged_too(open_page: OpenPage) -> None:
    app = open_page(SEARCH, {"pictures": "own", "template.see_why": "Damage it"})
    app.file_uploader(key="pictures.picture").upload("scene.png", uploads.png(SCENE[:, :, 0]), "image/png").run()
    deep = uploads.png(SCENE[30:50, 40:64, 0].astype(np.uint16))
    app.file_uploader(key="pictures.template").upload("deep.png", deep, "image/png").run()
    assert not app.error
    assert ["cannot search" in text for text in cards(app)] == [False, True, False]
