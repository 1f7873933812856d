"""Parts of the search page: a template cut from the image, a painted mask, OpenCV beside it, and damage."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from streamlit.testing.v1 import AppTest

from stereolag import samples
from stereolag.core.inputs import Image
from stereolag.io.images import read_image
from stereolag.templates import TemplateSearch, match_template
from stereolag.templates.degradation import Degradation
from stereolag.templates.opencv import OpenCVSearch, opencv_search
from stereolag.templates.trials import Trial, try_methods
from stereolag.ui.search.degrading import lesson, numbers_of
from stereolag.ui.search.opencv_beside import differences, table
from stereolag.ui.search.painting import PaintedMask
from tests.app import uploads

pytestmark = pytest.mark.usefixtures("small_mazes")

OpenPage = Callable[..., AppTest]

SEARCH = "pages/2_Rocketman_search.py"
SCENE = np.random.default_rng(5).integers(0, 256, (90, 120, 3), dtype=np.uint8)
MASK = np.zeros((20, 24), dtype=np.uint8)
MASK[3:17, 5:20] = 1


def told(app: AppTest, component: str) -> dict[str, Any]:
    parts = [element.proto for element in app.get("bidi_component")]
    (one,) = [json.loads(part.json) for part in parts if part.component_name == component]
    assert isinstance(one, dict)
    return one


def test_a_template_can_be_cut_from_the_example(open_page: OpenPage) -> None:
    app = open_page(SEARCH)
    app.button_group(key="pictures.from").set_value("cut").run()
    box = told(app, "stereolag.box")
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
    assert told(app, "stereolag.box")["box"] == {"row": 37, "col": 52, "height": 15, "width": 15}
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


def searched(image: Image, template: Image, mask: Image | None = None) -> tuple[TemplateSearch, OpenCVSearch]:
    return match_template(image, template, mask=mask), opencv_search(image, template, mask=mask)


def test_where_both_agree_that_is_said() -> None:
    ours, theirs = searched(SCENE, SCENE[30:50, 40:64], MASK)
    assert differences(ours, theirs, "fft") == ["The same place; the scores differ by less than 0.0001."]
    rows = table(ours, theirs, "fft", True).splitlines()[2:]
    assert [row.count("row 30, column 40 | 1.0000") for row in rows] == [1, 1]
    assert "masked" in rows[1]


def test_flat_windows_under_a_mask_are_named() -> None:
    image = SCENE.copy()
    image[60:] = 90
    ours, theirs = searched(image, image[30:50, 40:64], MASK)
    assert ours.score_map is not None
    first, second = differences(ours, theirs, "fft")
    assert first.startswith(f"In {np.isnan(ours.score_map).sum():,} places")
    assert "minMaxLoc" in first
    assert second.startswith("The same place")


def test_without_our_answer_opencv_names_a_place_all_the_same() -> None:
    other = np.random.default_rng(6).integers(0, 256, (20, 20, 3), dtype=np.uint8)
    ours, theirs = searched(SCENE, other)
    assert "not found" in table(ours, theirs, "fft", False)
    (sentence,) = differences(ours, theirs, "fft")
    assert "always names a place" in sentence and "patterns" not in sentence
    assert "patterns" in differences(replace(ours, score_map=None), theirs, "sampled")[0]


def test_large_offsets_lead_opencv_astray() -> None:
    image = (SCENE / np.float32(255)).astype(np.float32) + np.float32(1e4)
    ours, theirs = searched(image, image[30:50, 40:64])
    assert (ours.matches[0].row, ours.matches[0].col) == (30, 40)
    assert (theirs.row, theirs.col) != (30, 40)
    assert "single precision" in differences(ours, theirs, "fft")[-1]


@pytest.mark.parametrize(
    ("here", "score", "fragment"),
    [(np.nan, 1.0, "flat"), (1.0, 1.0, "several copies"), (0.6, 0.9, "scores 0.600 at")],
)
def test_another_place_is_explained(here: float, score: float, fragment: str) -> None:
    ours = match_template(SCENE, SCENE[30:50, 40:64])
    assert ours.score_map is not None
    ours.score_map[3, 3] = here
    theirs = OpenCVSearch(3, 3, score, 0, ours.score_map, 0.1)
    (sentence,) = differences(ours, theirs, "fft")
    assert fragment in sentence
    without = replace(ours, score_map=None)
    assert "a few places only" in differences(without, theirs, "sampled")[0]
    assert "sizes and angles" in differences(without, theirs, "fft")[0]


def test_of_nothing_that_varies_there_is_no_answer() -> None:
    ours, theirs = searched(np.full_like(SCENE, 7), SCENE[30:50, 40:64], MASK)
    assert "none" in table(ours, theirs, "fft", True)
    assert len(differences(ours, theirs, "fft")) == 1


def test_the_lesson_follows_what_happened() -> None:
    template = SCENE[30:50, 40:64]
    found = try_methods(SCENE, template, (30, 40))
    assert lesson(found, Degradation(), 0.5).startswith("Nothing is damaged yet")
    assert "exactly as they were" in lesson(found, Degradation(cover=0.1), 0.5)
    away = try_methods(SCENE, template, (0, 0))
    assert "Another place" in lesson(away, Degradation(cover=1), 0.5)
    fft, sampled, opencv = found
    missed = replace(fft, outcome="missed", score=0.3)
    lost = replace(sampled, outcome="missed", row=None, col=None, score=float("nan"))
    assert "exact pixel values" in lesson((fft, lost, opencv), Degradation(noise=5), 0.5)
    turned = lesson((missed, lost, opencv), Degradation(turn=20), 0.5)
    assert "0.300, is below the minimum score of 0.50" in turned and "turned or resized" in turned
    assert "turned" not in lesson((missed, lost, opencv), Degradation(noise=90), 0.5)
    nothing = Trial("fft", "missed", None, None, float("nan"), 0.1)
    assert "Nothing is left" in lesson((nothing, lost, opencv), Degradation(cover=1), 0.5)
    refused = replace(lost, outcome="refused", refusal="It cannot.")
    assert "whole patterns" in lesson((fft, refused, opencv), Degradation(noise=5), 0.5)
    assert numbers_of(refused) == "It cannot."
    assert numbers_of(lost).startswith("no place")
    assert numbers_of(missed).startswith("best score 0.300")


def test_images_of_two_types_are_damaged_too(open_page: OpenPage) -> None:
    app = open_page(SEARCH, {"pictures": "own", "template.see_why": "Damage it"})
    app.file_uploader(key="pictures.picture").upload("scene.png", uploads.png(SCENE[:, :, 0]), "image/png").run()
    deep = uploads.png(SCENE[30:50, 40:64, 0].astype(np.uint16))
    app.file_uploader(key="pictures.template").upload("deep.png", deep, "image/png").run()
    assert not app.error
    assert ["cannot search" in text for text in cards(app)] == [False, True, False]
