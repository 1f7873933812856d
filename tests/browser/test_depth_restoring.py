"""A link restores the page, and a downloaded session continues where it stopped, for any visitor."""

from __future__ import annotations

import re

from playwright.sync_api import expect

from tests.browser.depth_page import DepthPage
from tests.browser.visits import OpenPage, expect_visible, screenshot, settled

ADDRESS = "Depth_maps?pair=square&size=1/2&maps=bm,sgbm&bm.block_size=13&sgbm.mode=hh"
OTHER_ADDRESS = "Depth_maps?pair=square&window_size=31&bm.block_size=9"


def test_a_link_opens_the_page_as_it_was_and_one_zip_whatever_the_page_shows(open_page: OpenPage) -> None:
    before = DepthPage(open_page(ADDRESS))
    before.press("Colours")
    before.choose("Turbo")
    before.page.keyboard.press("Escape")
    before.settle()
    bad = [before.number("Bad-2", method=method) for method in range(2)]
    before.unfold("Take it away")
    expect_visible(before.said("All files are for the images at full size, 480 × 480 pixels."))
    data = before.download("Session ZIP")
    assert before.download("Settings JSON").count(b'"block_size": 25') == 1  # for the full-size images
    address, own_map = before.download_from("NPY", exact=True)

    after = DepthPage(open_page(OTHER_ADDRESS))
    lead_there_and_back(after)
    after.open_head()
    after.choose("Your own files")
    box = after.page.get_by_test_id("stFileUploader").filter(has_text="Left image").locator("input[type=file]")
    box.set_input_files({"name": "stereolag-session.zip", "mimeType": "application/zip", "buffer": data})
    expect(after.slider("Block")).to_have_value("13")
    after.settle()
    after.open_head()
    expect_visible(after.said("240 × 240 of 480 × 480 pixels"))
    assert [after.number("Bad-2", method=method) for method in range(2)] == bad
    after.turn_to("StereoSGBM")
    after.unfold("More settings")
    expect(after.page.get_by_role("radio", name="8", exact=True)).to_be_checked()
    after.press("Colours")
    expect(after.page.get_by_role("radio", name="Turbo", exact=True)).to_be_checked()
    screenshot(after.page, "restored")
    after.page.keyboard.press("Escape")
    after.unfold("Take it away")
    # The same result for two visitors has the same bytes, but an address that the other visitor's does not reveal.
    other_address, same_map = after.download_from("NPY", exact=True)
    assert same_map == own_map
    assert other_address != address


def lead_there_and_back(visit: DepthPage) -> None:
    """Change the settings of a link, go back to them, and reset them."""
    page = visit.page
    window, block = page.get_by_role("slider", name="Window"), page.get_by_role("slider", name="Block")
    expect(window).to_have_value("31")
    page.get_by_role("radio", name="StereoBM").click()
    expect(block).to_have_value("9")
    page.get_by_role("radio", name="Convolution").click()
    page.get_by_role("button", name="Fast").click()
    expect(window).to_have_value("11")
    expect(page).to_have_url(re.compile("pair=square&window_size=11.*left_right=on.*bm.block_size=9"))
    settled(page)
    page.go_back()
    expect(window).to_have_value("31")
    settled(page)
    page.get_by_role("button", name="Reset").click()
    expect(window).to_have_value("20")
    expect(page).to_have_url(re.compile(r"Depth_maps\?pair=square$"))
    settled(page)
