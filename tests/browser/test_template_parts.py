"""A template cut and painted by hand in the browser, and the resulting template and mask in Python."""

from __future__ import annotations

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, expect

from stereolag.io.hand_marks import Box, packed_mask, read_packed_mask
from stereolag.ui.pictures import example_pictures
from stereolag.ui.search.cutting import box_in
from stereolag.ui.search.painting import HERE, PaintedMask, painted_mask
from tests.browser.parts import Parts, ShowParts, sent
from tests.browser.visits import expect_fitting, resized, turned_dark

COLS = 2446


class Cut:
    """The box over the maze, and the boxes that Python received from it, the latest last."""

    def __init__(self, show_parts: ShowParts) -> None:
        self.taken: list[Box] = []
        self._picture = example_pictures("maze").picture
        self.parts: Parts = show_parts(self.show)

    def show(self) -> None:
        self.taken.append(box_in(self._picture, digest="maze", shared=True, key="cut"))

    def found(self) -> list[int]:
        """Return the box in Python once it has received the change; the box on the page must not move."""
        before = box(self.parts.page)
        self.parts.answer()
        assert box(self.parts.page) == before
        last = self.taken[-1]
        return [last.row, last.col, last.width, last.height]


@pytest.fixture(scope="module")
def cut(show_parts: ShowParts) -> Cut:
    return Cut(show_parts)


def box(page: Page) -> list[int]:
    """Return row, column, width and height as shown below the image."""
    return [int(one.input_value()) for one in page.locator(".cutting input").all()]


def origin(page: Page) -> tuple[float, float, float]:
    """Return the screen position of the image's origin and the screen size of one image pixel."""
    place = page.locator(".cutting .stage").bounding_box()
    assert place is not None
    return place["x"], place["y"], place["width"] / COLS


def drag(page: Page, start: tuple[float, float], end: tuple[float, float]) -> None:
    """Drag from one (row, col) in the image to another."""
    left, top, scale = origin(page)
    for way, (row, col) in (("down", start), ("up", end)):
        page.mouse.move(left + col * scale, top + row * scale, steps=4)
        getattr(page.mouse, way)()


def test_a_finger_moves_the_box(cut: Cut) -> None:
    page = cut.parts.page
    turned_dark(page, width=420)
    assert box(page) == [636, 1070, 305, 254]
    left, top, scale = origin(page)
    touch = page.context.new_cdp_session(page)
    touch.send("Emulation.setTouchEmulationEnabled", {"enabled": True})

    def finger(kind: str, row: float, col: float) -> None:
        points = [] if kind == "touchEnd" else [{"x": left + col * scale, "y": top + row * scale}]
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    finger("touchStart", 760, 1220)
    for part in (0.3, 0.6, 1):
        finger("touchMove", 760 + 300 * part, 1220 + 500 * part)
    finger("touchEnd", 1060, 1720)
    row, col, width, height = box(page)
    assert (width, height) == (305, 254)
    assert np.allclose([row, col], [936, 1570], atol=25)  # a pixel of this screen covers six of the image
    assert cut.found() == box(page)
    expect_fitting(page, 420)
    touch.send("Emulation.setTouchEmulationEnabled", {"enabled": False})
    touch.detach()
    page.emulate_media(color_scheme="light")
    resized(page, 1280)


def test_a_box_is_dragged_typed_and_moved_with_keys(cut: Cut) -> None:
    page = cut.parts.page
    drag(page, (400, 700), (560, 940))  # a new one
    row, col, width, height = box(page)
    assert np.allclose([row, col, width, height], [400, 700, 240, 160], atol=4)
    assert cut.found() == [row, col, width, height]
    drag(page, (480, 820), (580, 1020))  # moved
    assert np.allclose(box(page), [row + 100, col + 200, width, height], atol=4)
    assert cut.found() == box(page)
    row, col, width, height = box(page)
    drag(page, (row + height, col + width), (row + height - 60, col + width - 90))  # by a corner
    assert np.allclose(box(page), [row, col, width - 90, height - 60], atol=4)
    assert cut.found() == box(page)
    drag(page, (row + 10, col + 10), (-300, -300))  # it stops at the edge
    assert box(page)[:2] == [0, 0]
    assert cut.found() == box(page)
    stage, heard = page.locator(".cutting .stage"), len(cut.parts.sent())
    for key in ("ArrowRight", "Shift+ArrowDown", "ArrowRight", "ArrowUp", "+"):
        stage.press(key)
    assert box(page)[:2] == [8, 1]
    page.wait_for_function("(heard) => sent.length > heard", arg=heard)
    assert cut.found() == box(page)
    assert len(cut.parts.sent()) == heard + 1  # once the keys are at rest
    for name, value in (("row", 528), ("col", 982), ("width", 111), ("height", 99_999)):
        number = page.locator(f".cutting input[name={name}]")
        number.fill(str(value))
        number.press("Tab")
    assert box(page) == [0, 982, 111, 1526]  # as high as the image allows
    number = page.locator(".cutting input[name=height]")
    number.fill("2")
    number.press("Tab")
    assert box(page) == cut.found() == [0, 982, 111, 4]
    cut.parts.hand_over(lambda: None)
    expect(page.locator(".cutting")).to_have_count(0)
    cut.parts.hand_over(cut.show)
    assert box(page) == [0, 982, 111, 4]  # kept


def test_python_and_the_browser_pack_masks_alike(browser: Browser) -> None:
    mask = np.random.default_rng(1).random((13, 7)) < 0.5
    page = browser.new_page()
    page.add_script_tag(path=HERE / "mask.js")
    found = page.evaluate("text => packed(unpacked(text, 91), 91)", packed_mask(mask))
    painted = page.evaluate("text => [...unpacked(text, 91)]", packed_mask(mask))
    page.close()
    assert found == packed_mask(mask)
    np.testing.assert_array_equal(np.reshape(painted, mask.shape), ~mask)
    np.testing.assert_array_equal(read_packed_mask(found, mask.shape) > 0, mask)


def test_a_painted_mask_is_used_when_it_is_asked_for(show_parts: ShowParts) -> None:
    inputs = example_pictures("maze")
    masks: list[PaintedMask | None] = []
    parts = show_parts(lambda: masks.append(painted_mask(inputs.template, inputs.mask, digest="maze", key="painted")))
    page = parts.page
    use, counts = page.get_by_role("button", name="Use this mask"), page.locator(".painting .counts")
    stage = page.locator(".painting .stage")
    expect(counts).to_have_text("7,913 of 13,653 pixels count")  # where Rocketman is opaque
    expect(use).to_be_disabled()
    place = stage.bounding_box()
    assert place is not None
    page.mouse.move(place["x"] + 0.3 * place["width"], place["y"] + 0.3 * place["height"])
    page.mouse.down()
    page.mouse.move(place["x"] + 0.7 * place["width"], place["y"] + 0.6 * place["height"], steps=5)
    page.mouse.up()
    expect(counts).not_to_have_text("7,913 of 13,653 pixels count")
    painted = counts.inner_text()
    assert sent(page) == []
    use.click()
    parts.answer()
    assert masks[-1] is not None
    assert painted == f"{np.count_nonzero(masks[-1].pixels):,} of 13,653 pixels count"
    expect(counts).to_have_text(painted)
    expect(use).to_be_disabled()
    page.get_by_role("button", name="Erase").click()
    for key in ("Shift+ArrowUp", " "):
        stage.press(key)
    expect(counts).not_to_have_text(painted)
    page.get_by_role("button", name="Start over").click()
    expect(counts).to_have_text("7,913 of 13,653 pixels count")
    use.click()
    parts.answer()
    assert masks[-1] is None  # the template's own mask again
    expect(counts).to_have_text("7,913 of 13,653 pixels count")
    expect(use).to_be_disabled()
