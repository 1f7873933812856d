"""The search page: the answer, templates cut and masks painted, damage, OpenCV beside ours, the search by hand."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image
from streamlit.testing.v1 import AppTest

from stereolag import samples
from stereolag.io.images import read_image
from stereolag.templates import match_template
from stereolag.templates.trials import opencv_search
from stereolag.ui.search.sentences import differences
from stereolag.ui.uploads import Upload
from tests.app import uploads
from tests.app.pages import FIND, OpenPage, numbers
from tests.packed import told

SCENE = np.random.default_rng(5).integers(0, 256, (90, 120, 3), dtype=np.uint8)
OTHER = np.random.default_rng(6).integers(0, 256, (20, 20, 3), dtype=np.uint8)

pytestmark = pytest.mark.usefixtures("small_mazes")


def with_files(
    open_page: OpenPage, picture: np.ndarray, template: np.ndarray | None = None, **state: object
) -> AppTest:
    """Return the page with an image, and perhaps a template, of one's own."""
    app = open_page(FIND, {"pictures": "own"} | {name.replace("__", "."): value for name, value in state.items()})
    app.file_uploader(key="pictures.picture").upload("scene.png", uploads.png(picture), "image/png")
    app.run()
    if template is not None:
        app.file_uploader(key="pictures.template").upload("part.png", uploads.png(template), "image/png").run()
    assert not app.exception and not app.error
    return app


def pictures(app: AppTest) -> list[tuple[str, str, str]]:
    """Return the address, the caption and the alternative of every image."""
    return [(one.url, one.caption, one.alt) for element in app.get("image") for one in element.proto.imgs]


def test_a_frame_of_an_animation_is_chosen(open_page: OpenPage) -> None:
    app = open_page(FIND, {"pictures": "own"})
    stream = io.BytesIO()
    scene = np.random.default_rng(3).integers(0, 256, (60, 80, 3), dtype=np.uint8)
    first, second = Image.fromarray(scene[::-1].copy()), Image.fromarray(scene)
    first.save(stream, "TIFF", save_all=True, append_images=[second])
    app.file_uploader(key="pictures.picture").upload("scenes.tif", stream.getvalue(), "image/tiff")
    app.file_uploader(key="pictures.template").upload("part.png", uploads.png(scene[10:30, 20:50]), "image/png").run()
    (frame,) = [one for one in app.selectbox if one.label == "Frame"]
    assert frame.options == ["1 of 2", "2 of 2"]
    assert app.header[0].value != "Found at row 10, column 20"
    frame.set_value(2).run()
    assert not app.exception and not app.error
    assert app.header[0].value == "Found at row 10, column 20"


# The answer


def test_a_look_alike_is_framed_in_dashes_beside_the_template(open_page: OpenPage) -> None:
    app = open_page(FIND, {"pictures": "maze_dulled", "template.part": "Places"})
    assert app.header[0].value == "Found at row 200, column 200, partly covered"
    found, *_ = [url for url, _, alt in pictures(app) if alt.startswith("The image: ")]
    app.slider(key="template.min_score").set_value(1.0).run()
    assert app.header[0].value == "Not found"
    assert found not in {url for url, *_ in pictures(app)}
    captions = [caption for _, caption, _ in pictures(app)]
    assert "the template" in captions
    assert any(caption.startswith("row 200, column 200, score 0.7") for caption in captions)


def test_he_is_found_among_other_sizes_and_angles(open_page: OpenPage) -> None:
    app = open_page(FIND)
    app.slider(key="template.max_rotation").set_value(2.0).run()
    assert app.header[0].value == "Found at row 200, column 200"
    assert any("no score map" in caption.value for caption in app.caption)
    app.button_group(key="template.method").set_value("sampled").run()
    assert not app.exception
    assert app.header[0].value == "Found at row 200, column 200"
    assert app.slider(key="template.max_rotation").disabled


# Cut and painted


def test_a_template_can_be_cut_from_the_example(open_page: OpenPage) -> None:
    app = open_page(FIND)
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


def test_the_address_is_said_to_lack_what_was_cut_painted_and_uploaded(open_page: OpenPage) -> None:
    app = open_page(FIND, {"template.part": "Take away"})
    held = "The address of this page holds its settings and the example: send it, or keep it as a bookmark."
    given = "not in it: it opens the example’s template as it is."
    assert of_the_address(app) == held
    rows, cols = read_image(samples.mazes()["maze"].template).shape[:2]
    mask = np.ones((rows, cols), np.uint8)
    mask[:9] = 0
    app.session_state["pictures.painted.kept"] = "maze maze", Upload("mask", mask)
    app.run()
    assert of_the_address(app) == f"{held} The mask you painted is {given}"
    app.button_group(key="pictures.from").set_value("cut").run()
    assert of_the_address(app) == f"{held} The template you cut out is {given}"
    box = "maze maze cut 167 262 66 75"
    app.session_state["pictures.painted.kept"] = box, Upload("mask", np.eye(66, 75, dtype=np.uint8))
    app.run()
    assert of_the_address(app) == f"{held} The template you cut out and the mask you painted are {given}"
    app = with_files(open_page, SCENE, pictures__from="cut", template__part="Take away")
    assert of_the_address(app) == "The address of this page holds its settings, but not your own files."


def test_to_cut_from_an_image_of_ones_own_no_template_is_needed(open_page: OpenPage) -> None:
    app = open_page(FIND, {"pictures.from": "cut"})
    app.button_group(key="pictures").set_value("own").run()
    assert len(app.info) == 1
    app = with_files(open_page, SCENE, pictures__from="cut", template__part="Beside OpenCV")
    assert not app.info
    assert told(app, "box")[0]["box"] == {"row": 37, "col": 52, "height": 15, "width": 15}
    assert app.header[0].value == "Found at row 37, column 52"
    said = [one.value for one in (*app.markdown, *app.caption, *app.success, *app.info)]
    assert not app.exception
    assert any("The same place; the scores differ by less than" in one for one in said), said


# Damage and OpenCV


def cards(app: AppTest) -> list[str]:
    return [one.value for one in app.markdown if one.value.startswith(("**FFT", "**Sampled", "**OpenCV"))]


def test_damage_ends_one_method_after_the_other_and_can_be_undone(open_page: OpenPage) -> None:
    app = open_page(FIND, {"template.part": "Damage it"})
    assert [text.split()[-1] for text in cards(app)] == ["found]"] * 3
    app.slider(key="degrade.noise").set_value(20).run()
    assert ["not found" in text for text in cards(app)] == [False, True, False]
    app.slider(key="degrade.turn").set_value(20.0).run()
    assert ["not found" in text for text in cards(app)] == [True, True, True]
    app.button(key="degrade.undo").click().run()
    assert ["not found" in text for text in cards(app)] == [False, False, False]
    assert app.slider(key="degrade.turn").value == 0


def test_images_of_two_types_are_damaged_too_and_none_without_a_place(open_page: OpenPage) -> None:
    deep = SCENE[30:50, 40:64, 0].astype(np.uint16)
    app = with_files(open_page, SCENE[:, :, 0], deep, template__part="Damage it")
    assert ["cannot search" in text for text in cards(app)] == [False, True, False]
    app = with_files(open_page, SCENE, OTHER, template__part="Damage it")
    assert not [slider for slider in app.slider if slider.key and slider.key.startswith("degrade.")]
    assert "none to damage" in app.caption[-1].value


def test_large_offsets_lead_opencv_astray() -> None:
    image = (SCENE / np.float32(255)).astype(np.float32) + np.float32(1e4)
    ours, theirs = match_template(image, image[30:50, 40:64]), opencv_search(image, image[30:50, 40:64])
    assert (ours.matches[0].row, ours.matches[0].col) == (30, 40)
    assert (theirs.row, theirs.col) != (30, 40)
    assert "single precision" in differences(ours, theirs, "fft")[-1]


# By hand


def part(app: AppTest, name: str) -> AppTest:
    """Return the page with a part open."""
    app.session_state["template.part"] = name
    return app.run()


def test_he_can_be_searched_by_hand(open_page: OpenPage) -> None:
    app = open_page(FIND)
    (search,), (score_map,) = (told(app, name) for name in ("template_by_hand", "score_map"))
    best, rival = search["leaders"][:2]
    assert (search["factor"], search["row"] + best["row"], search["col"] + best["col"]) == (1, 200, 200)
    assert f"{rival['score']:.3f}" == numbers(app)["Best rival"]
    (place,) = search["places"]
    assert place["kind"] == "found" and place["corners"][0] == [199, 199]
    assert "Every pixel counts." in search["words"]["texts"][".hint"]
    assert score_map["name"] == search["name"]
    app.button_group(key="template.method").set_value("sampled").run()
    assert told(app, "score_map") == []
    (funnel,) = told(part(app, "Step by step"), "funnel")
    counts = funnel["anchors"][0]["counts"]
    assert counts[0] == 400 * 600 and counts == sorted(counts, reverse=True)
    assert funnel["anchors"][0]["best"][:2] == [200, 200]


def test_pictures_of_ones_own_can_be_searched_by_hand_too(open_page: OpenPage) -> None:
    scene = uploads.texture(120, 180)
    app = with_files(open_page, scene, scene[30:60, 70:110])
    (search,) = told(app, "template_by_hand")
    assert (search["factor"], search["leaders"][0]["row"], search["leaders"][0]["col"]) == (1, 30, 70)
    assert told(part(app, "Step by step"), "funnel")[0]["rows"] == 120
    deep = scene[:, :, 0].astype(np.uint16) * 256  # types that cannot be compared exactly
    app = with_files(open_page, deep, scene[30:60, 70:110, 0], template__part="Step by step")
    assert told(app, "funnel") == []
    assert any("cannot search here" in caption.value for caption in app.caption)
    assert told(part(app, "Drag it"), "template_by_hand")
