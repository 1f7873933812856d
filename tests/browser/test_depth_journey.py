"""A slider of the depth page while it is dragged, links to the page, and the addresses of its files."""

import re
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from tests.browser.journeys import unfold
from tests.browser.parts import box_of
from tests.browser.visits import OpenPage, expect_visible, settled

ADDRESS = "Depth_maps?pair=square&size=1/2&maps=bm,sgbm&bm.block_size=13&sgbm.mode=hh"
OTHER_ADDRESS = "Depth_maps?pair=square&window_size=31&bm.block_size=9"


def taken(page: Page) -> tuple[str, bytes]:
    """Return the address and the contents of the map in a file."""
    expect(page.get_by_role("slider", name="Block")).to_have_value("13")
    unfold(page, "Take it away")
    expect_visible(page.get_by_text("All files are for the images at full size, 480 × 480 pixels."))
    page.get_by_role("button", name="More files").click()
    settled(page)
    with page.expect_download() as started:
        page.get_by_role("button", name="NPY", exact=True).click()
    return started.value.url, Path(started.value.path()).read_bytes()


@pytest.fixture(scope="module")
def page(keep_page: OpenPage) -> Page:
    return keep_page(OTHER_ADDRESS)


def test_a_map_follows_a_slider_while_it_is_dragged_and_is_whole_once_it_is_released(page: Page) -> None:
    canvas, slider = page.locator(".linked .layer canvas").first, page.get_by_role("slider", name="Window")
    expect(slider).to_have_value("31")  # as the address says
    box, start = box_of(slider.locator("..")), slider.input_value()
    y, xs = box["y"] + box["height"] / 2, [box["x"] + box["width"] / 2 + by for by in (0, 30, 60)]

    def drag_to(x: float, width: int) -> None:
        page.mouse.move(x, y)
        expect(canvas).to_have_js_property("width", width)

    page.mouse.move(xs[0], y)
    page.mouse.down()
    drag_to(xs[1], 240)
    numbers = page.locator(".linked .figures").first
    expect(numbers).to_contain_text(re.compile("Preview1/2 size.*Coverage.*EPE", re.DOTALL))
    expect(page).to_have_url(re.compile("window_size=31&"))
    drag_to(xs[0], 240)
    page.mouse.up()
    expect(slider).to_have_value(start)
    expect(canvas).to_have_js_property("width", 480)  # as before: nothing was asked of the server
    expect(numbers).to_contain_text("Computed in")
    page.mouse.down()
    drag_to(xs[2], 240)
    page.mouse.up()
    expect(canvas).to_have_js_property("width", 480)
    expect(numbers).to_contain_text("Computed in")
    expect(page).to_have_url(re.compile(f"window_size={slider.input_value()}"))
    settled(page)
    page.evaluate("""() => addEventListener("stereolag-preview", ({ detail }) => { window.early = detail; })""")
    page.keyboard.press("ArrowRight")
    page.wait_for_function("window.early?.whole")  # over its own socket
    expect(page).to_have_url(re.compile(f"window_size={slider.input_value()}"))
    settled(page)
    shown = canvas.evaluate("(canvas) => canvas.seen")
    assert shown.startswith(page.evaluate("window.early.digest"))


def test_a_link_opens_the_page_as_it_was_and_its_files_have_addresses_nobody_else_can_guess(open_page, page, address):
    own_address, own_map = taken(open_page(ADDRESS))
    window = page.get_by_role("slider", name="Window")
    size = window.input_value()
    page.get_by_role("button", name="Fast").click()
    expect(window).to_have_value("11")
    expect(page).to_have_url(re.compile("pair=square&window_size=11.*left_right=on.*bm.block_size=9"))
    settled(page)
    page.go_back()
    expect(window).to_have_value(size)
    settled(page)
    page.goto(f"{address}/{ADDRESS}")
    settled(page)
    # The same result for two visitors has the same bytes, but an address that the other visitor's does not reveal.
    other_address, same_map = taken(page)
    assert same_map == own_map
    assert other_address != own_address
