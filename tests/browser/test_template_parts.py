"""A template cut and painted on by hand, OpenCV beside, and damage, in the browser."""

from __future__ import annotations

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, expect

from stereolag.reading.hand_marks import packed_mask, read_packed_mask
from stereolag.ui.search.painting import HERE
from tests.browser.visits import OpenPage, expect_fitting, expect_visible, screenshot, settled, turned_dark

COLS = 2446


@pytest.fixture(scope="module")
def search_page(keep_page: OpenPage) -> Page:
    """Return the page that all tests share; those that cut come first, for the box stays where it was left."""
    return keep_page("Rocketman_search")


def cut_from_the_image(page: Page) -> None:
    cut = page.get_by_role("radio", name="Cut from the image")
    if not cut.is_checked():
        cut.click()
        settled(page)
    page.locator(".cutting .stage").scroll_into_view_if_needed()


def box(page: Page) -> list[int]:
    """Return row, column, width and height, as the numbers below the image say."""
    return [int(one.input_value()) for one in page.locator(".cutting input").all()]


def origin(page: Page) -> tuple[float, float, float]:
    """Return where the image begins on the screen, and how large one of its pixels is there."""
    place = page.locator(".cutting .stage").bounding_box()
    assert place is not None
    return place["x"], place["y"], place["width"] / COLS


def drag(page: Page, start: tuple[float, float], end: tuple[float, float]) -> None:
    """Drag from one (row, col) of the image to another."""
    left, top, scale = origin(page)
    for way, (row, col) in (("down", start), ("up", end)):
        page.mouse.move(left + col * scale, top + row * scale, steps=4)
        getattr(page.mouse, way)()


def found_at(page: Page, row: int, col: int) -> None:
    expect_visible(page.get_by_role("heading", name=f"Found at row {row}, column {col}", exact=True))


def test_a_finger_moves_the_box(search_page: Page) -> None:
    page = search_page
    cut_from_the_image(page)
    turned_dark(page, width=420)
    page.locator(".cutting .stage").scroll_into_view_if_needed()
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
    assert np.allclose([row, col], [936, 1570], atol=25)  # a pixel of this screen is six of the image
    found_at(page, row, col)
    expect_fitting(page, 420)
    touch.send("Emulation.setTouchEmulationEnabled", {"enabled": False})
    touch.detach()
    page.emulate_media(color_scheme="light")
    page.set_viewport_size({"width": 1280, "height": 900})
    settled(page)


def test_a_box_is_dragged_typed_and_moved_with_keys(search_page: Page) -> None:
    page = search_page
    cut_from_the_image(page)
    drag(page, (400, 700), (560, 940))  # a new one
    row, col, width, height = box(page)
    assert np.allclose([row, col, width, height], [400, 700, 240, 160], atol=4)
    found_at(page, row, col)
    drag(page, (480, 820), (580, 1020))  # moved
    assert np.allclose(box(page), [row + 100, col + 200, width, height], atol=4)
    found_at(page, *box(page)[:2])
    row, col, width, height = box(page)
    drag(page, (row + height, col + width), (row + height - 60, col + width - 90))  # by a corner
    assert np.allclose(box(page), [row, col, width - 90, height - 60], atol=4)
    settled(page)
    drag(page, (row + 10, col + 10), (-300, -300))  # no further than the rim
    assert box(page)[:2] == [0, 0]
    settled(page)
    stage = page.locator(".cutting .stage")
    for key in ("ArrowRight", "Shift+ArrowDown", "ArrowRight", "ArrowUp", "+"):
        stage.press(key)
    assert box(page)[:2] == [8, 1]
    found_at(page, 8, 1)
    for name, value in (("row", 528), ("col", 982), ("width", 111), ("height", 99_999)):
        number = page.locator(f".cutting input[name={name}]")
        number.fill(str(value))
        number.press("Tab")
        settled(page)
    assert box(page) == [0, 982, 111, 1526]  # as high as the image allows
    number = page.locator(".cutting input[name=height]")
    number.fill("2")
    number.press("Tab")
    assert box(page) == [0, 982, 111, 4]
    settled(page)
    page.get_by_text("The example’s").click()
    found_at(page, 528, 982)
    page.get_by_text("Cut from the image").click()
    settled(page)
    assert box(page) == [0, 982, 111, 4]  # kept
    page.get_by_text("The example’s").click()
    found_at(page, 528, 982)


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


def test_a_painted_mask_is_used_when_it_is_asked_for(search_page: Page) -> None:
    page = search_page
    page.get_by_text("Paint a mask").click()
    use, counts = page.get_by_role("button", name="Use this mask"), page.locator(".painting .counts")
    stage = page.locator(".painting .stage")
    expect(counts).to_have_text("7,913 of 13,653 pixels count")  # where Rocketman is opaque
    expect(use).to_be_disabled()
    stage.scroll_into_view_if_needed()
    place = stage.bounding_box()
    assert place is not None
    page.mouse.move(place["x"] + 0.3 * place["width"], place["y"] + 0.3 * place["height"])
    page.mouse.down()
    page.mouse.move(place["x"] + 0.7 * place["width"], place["y"] + 0.6 * place["height"], steps=5)
    page.mouse.up()
    expect(counts).not_to_have_text("7,913 of 13,653 pixels count")
    painted = counts.inner_text()
    use.click()
    settled(page)
    found_at(page, 528, 982)
    expect(counts).to_have_text(painted)
    expect(use).to_be_disabled()
    page.get_by_role("button", name="Erase").click()
    for key in ("Shift+ArrowUp", " "):
        stage.press(key)
    expect(counts).not_to_have_text(painted)
    page.get_by_role("button", name="Start over").click()
    expect(counts).to_have_text("7,913 of 13,653 pixels count")
    use.click()
    settled(page)
    expect(counts).to_have_text("7,913 of 13,653 pixels count")
    expect(use).to_be_disabled()


def test_opencv_answers_beside_and_damage_is_seen(search_page: Page) -> None:
    page = search_page
    page.get_by_role("button", name="Search with OpenCV too").click()
    expect_visible(page.get_by_text("The same place; the scores differ by less than"))
    page.get_by_role("tab", name="Damage it").click()
    settled(page)
    expect(page.get_by_text("not found")).to_have_count(0)
    slider = page.get_by_role("slider", name="Noise").first
    slider.focus()
    slider.press("PageUp")
    expect(page.get_by_text("not found")).to_have_count(1)
    expect_visible(page.get_by_text("Sampled looks for exact pixel values"))
    screenshot(page, "rocketman-damaged")
    page.get_by_role("button", name="Undo all damage").click()
    expect_visible(page.get_by_text("Nothing is damaged yet"))
