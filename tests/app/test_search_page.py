"""The search page: the answer, templates cut and masks painted, damage, OpenCV beside ours, the search by hand."""

import base64
import io
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from streamlit.testing.v1 import AppTest

from stereolag import read_image, samples
from stereolag.core.arrays import Box
from stereolag.ui.search.inputs import packed_mask, read_box, read_packed_mask
from stereolag.ui.uploads import Upload
from tests.app import uploads
from tests.app.pages import FIND, moved, open_page, uploaded
from tests.app.reading import labelled, numbers
from tests.app.uploads import pngs
from tests.packed import told

SCENE = np.random.default_rng(5).integers(0, 256, (90, 120, 3), dtype=np.uint8)
OTHER = np.random.default_rng(6).integers(0, 256, (20, 20, 3), dtype=np.uint8)


def with_files(files: dict[str, np.ndarray], **state: object) -> AppTest:
    """Return the page with an image, and perhaps a template, of one's own."""
    app = open_page(FIND, {"pictures": "own"} | {name.replace("__", "."): value for name, value in state.items()})
    uploaded(app, "pictures", **pngs(**files))
    assert not app.error
    return app


def pictures(app: AppTest) -> list[tuple[str, str, str]]:
    """Return the address, the caption and the alternative of every image."""
    return [(one.url, one.caption, one.alt) for element in app.get("image") for one in element.proto.imgs]


def test_a_frame_of_an_animation_is_chosen() -> None:
    stream = io.BytesIO()
    first, second = Image.fromarray(SCENE[::-1].copy()), Image.fromarray(SCENE)
    first.save(stream, "TIFF", save_all=True, append_images=[second])
    app = with_files({"template": SCENE[10:30, 20:50]})
    uploaded(app, "pictures", picture=("scenes.tif", stream.getvalue()))
    frame = labelled(app.selectbox, "Frame")
    assert frame.options == ["1 of 2", "2 of 2"]
    assert app.header[0].value != "Found at row 10, column 20"
    frame.set_value(2).run()
    assert not app.error
    assert app.header[0].value == "Found at row 10, column 20"


# The answer


def test_a_look_alike_is_framed_in_dashes_beside_the_template() -> None:
    app = open_page(FIND, {"pictures": "maze_dulled", "template.part": "Places"})
    assert app.header[0].value == "Found at row 200, column 200, partly covered"
    found, *_ = [url for url, _, alt in pictures(app) if alt.startswith("The image: ")]
    moved(app, {"template.min_score": 1.0})
    assert app.header[0].value == "Not found"
    assert "The best place scores" in app.warning[0].value
    assert found not in {url for url, *_ in pictures(app)}
    captions = [caption for _, caption, _ in pictures(app)]
    assert "the template" in captions
    assert any(caption.startswith("row 200, column 200, score 0.7") for caption in captions)


# Cut and painted


def test_a_template_can_be_cut_from_the_example() -> None:
    app = moved(open_page(FIND), {"pictures.from": "cut"})
    (box,) = told(app, "box")
    assert (box["rows"], box["cols"]) == (400, 600)
    assert box["box"] == {"row": 167, "col": 262, "height": 66, "width": 75}
    assert app.header[0].value == "Found at row 167, column 262"
    moved(app, {"pictures.from": "given"})
    assert app.header[0].value == "Found at row 200, column 200"


def of_the_address(app: AppTest) -> str:
    """Return the sentence about the page's address."""
    (said,) = [caption.value for caption in app.caption if caption.value.startswith("The address of this page")]
    return said


def test_the_address_is_said_to_lack_what_was_cut_painted_and_uploaded() -> None:
    app = open_page(FIND, {"template.part": "Take away"})
    held = "The address of this page holds its settings and the example: share or bookmark it."
    given = "not in it: it opens the example’s own template."
    assert of_the_address(app) == held
    rows, cols = read_image(samples.mazes()["maze"].template).shape[:2]
    mask = np.ones((rows, cols), np.uint8)
    mask[:9] = 0
    app.session_state["pictures.painted.kept"] = "maze maze", Upload("mask", mask)
    app.run()
    assert of_the_address(app) == f"{held} The mask you painted is {given}"
    moved(app, {"pictures.from": "cut"})
    assert of_the_address(app) == f"{held} The template you cut out is {given}"
    box = "maze maze cut 167 262 66 75"
    app.session_state["pictures.painted.kept"] = box, Upload("mask", np.eye(66, 75, dtype=np.uint8))
    app.run()
    assert of_the_address(app) == f"{held} The template you cut out and the mask you painted are {given}"
    app = with_files({"picture": SCENE}, pictures__from="cut", template__part="Take away")
    assert of_the_address(app) == "The address of this page holds its settings, but not your own files."


def test_to_cut_from_an_image_of_ones_own_no_template_is_needed() -> None:
    app = moved(open_page(FIND, {"pictures.from": "cut"}), {"pictures": "own"})
    assert len(app.info) == 1
    app = with_files({"picture": SCENE}, pictures__from="cut", template__part="Beside OpenCV")
    assert not app.info
    assert told(app, "box")[0]["box"] == {"row": 37, "col": 52, "height": 15, "width": 15}
    assert app.header[0].value == "Found at row 37, column 52"
    said = [one.value for one in (*app.markdown, *app.caption, *app.success)]
    assert any("The same place; the scores differ by less than" in one for one in said), said


# Damage and OpenCV


def cards(app: AppTest) -> list[str]:
    return [one.value for one in app.markdown if one.value.startswith(("**FFT", "**Sampled", "**OpenCV"))]


def test_damage_ends_one_method_after_the_other_and_can_be_undone() -> None:
    app = open_page(FIND, {"template.part": "Damage it"})
    assert [text.split()[-1] for text in cards(app)] == ["found]"] * 3
    moved(app, {"degrade.noise": 20})
    assert ["not found" in text for text in cards(app)] == [False, True, False]
    moved(app, {"degrade.turn": 20.0})
    assert ["not found" in text for text in cards(app)] == [True, True, True]
    app.button(key="degrade.undo").click().run()
    assert ["not found" in text for text in cards(app)] == [False, False, False]
    assert app.slider(key="degrade.turn").value == 0


def test_images_of_two_types_are_damaged_too_and_none_without_a_place() -> None:
    deep = SCENE[30:50, 40:64, 0].astype(np.uint16)
    app = with_files({"picture": SCENE[:, :, 0], "template": deep}, template__part="Damage it")
    assert ["cannot search" in text for text in cards(app)] == [False, True, False]
    app = with_files({"picture": SCENE, "template": OTHER}, template__part="Damage it")
    assert not [slider for slider in app.slider if slider.key and slider.key.startswith("degrade.")]
    assert "none to damage" in app.caption[-1].value


# By hand


def part(app: AppTest, name: str) -> AppTest:
    app.session_state["template.part"] = name
    return app.run()


def test_he_can_be_searched_by_hand() -> None:
    app = open_page(FIND)
    (search,), (score_map,) = (told(app, name) for name in ("template_by_hand", "score_map"))
    best, rival = search["leaders"][:2]
    assert (search["factor"], search["row"] + best["row"], search["col"] + best["col"]) == (1, 200, 200)
    assert f"{rival['score']:.3f}" == numbers(app)["Best rival"]
    (place,) = search["places"]
    assert place["kind"] == "found" and place["corners"][0] == [199, 199]
    assert "Shown at full resolution." in search["words"]["texts"][".hint"]
    assert score_map["name"] == search["name"]
    moved(app, {"template.method": "sampled"})
    assert told(app, "score_map") == []
    (funnel,) = told(part(app, "Step by step"), "funnel")
    counts = funnel["anchors"][0]["counts"]
    assert counts[0] == 400 * 600 and counts == sorted(counts, reverse=True)
    assert funnel["anchors"][0]["best"][:2] == [200, 200]


def test_pictures_of_ones_own_can_be_searched_by_hand_too() -> None:
    scene = uploads.texture(120, 180)
    app = with_files({"picture": scene, "template": scene[30:60, 70:110]})
    (search,) = told(app, "template_by_hand")
    assert (search["factor"], search["leaders"][0]["row"], search["leaders"][0]["col"]) == (1, 30, 70)
    assert told(part(app, "Step by step"), "funnel")[0]["rows"] == 120
    deep = scene[:, :, 0].astype(np.uint16) * 256  # types that cannot be compared exactly
    files = {"picture": deep, "template": scene[30:60, 70:110, 0]}
    app = with_files(files, template__part="Step by step")
    assert told(app, "funnel") == []
    assert any("cannot search here" in caption.value for caption in app.caption)
    assert told(part(app, "Drag it"), "template_by_hand")


# A box and a mask come from the browser, which is not trusted

SHAPE = (60, 80, 3)
GOOD = {"row": 10, "col": 20, "height": 30, "width": 40}


def test_a_box_is_read() -> None:
    box = read_box(GOOD, SHAPE)
    assert box == Box(10, 20, 30, 40)
    assert np.zeros(SHAPE)[box.slices].shape == (30, 40, 3)
    assert read_box({name: float(value) for name, value in GOOD.items()}, SHAPE) == box


NO_BOXES = None, "box", [1, 2, 3, 4], {}, {"row": 1}, GOOD | {"more": 1}
BAD_ROWS = None, "1", 1.5, float("nan"), float("inf"), [1], -1, 31, 10**400
BAD_WIDTHS = 0, 3, -40, 61, 1e300


@pytest.mark.parametrize(
    "value", [*NO_BOXES, *(GOOD | {"row": bad} for bad in BAD_ROWS), *(GOOD | {"width": bad} for bad in BAD_WIDTHS)]
)
def test_anything_else_is_refused_in_one_short_sentence(value: Any) -> None:
    with pytest.raises(ValueError, match=r"\.$") as refused:
        read_box(value, SHAPE)
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 200


@given(
    value=st.fixed_dictionaries({name: st.integers(-100, 200) | st.floats() for name in GOOD}),
    shape=st.tuples(st.integers(1, 100), st.integers(1, 100)),
)
def test_a_box_that_is_taken_lies_in_its_image(value: dict[str, Any], shape: tuple[int, int]) -> None:
    try:
        box = read_box(value, shape)
    except ValueError:
        return
    assert np.zeros(shape)[box.slices].shape == (box.height, box.width)
    assert min(box.height, box.width) >= 4


@given(st.integers(1, 40), st.integers(1, 40), st.integers(0, 2**32 - 1))
def test_a_mask_comes_back_as_it_was(height: int, width: int, seed: int) -> None:
    mask = np.random.default_rng(seed).random((height, width)) < 0.5
    text = packed_mask(mask)
    if mask.sum() < 2:
        with pytest.raises(ValueError, match="at least 2 pixels"):
            read_packed_mask(text, (height, width))
        return
    again = read_packed_mask(text, (height, width))
    assert again.dtype == np.uint8
    np.testing.assert_array_equal(again, mask * 255)


NO_TEXTS = None, 7, b"////", ""
WRONG_TEXTS = "////", "*" * 28, "é" * 28, "/" * 27 + "\n", "/" * 10_000_000
WRONG_BYTES = base64.b64encode(bytes([255]) * 21).decode(), base64.b64encode(bytes([255]) * 19).decode() + "===="


@pytest.mark.parametrize("value", [*NO_TEXTS, *WRONG_TEXTS, *WRONG_BYTES])
def test_another_text_is_refused(value: Any) -> None:
    with pytest.raises(ValueError, match="does not have 16 × 10 pixels"):
        read_packed_mask(value, (10, 16))  # 20 bytes, 28 characters
