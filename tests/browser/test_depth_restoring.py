"""Take a session away, and come back with it: a reload, or a colleague, continues where one stopped."""

from __future__ import annotations

from playwright.sync_api import expect

from tests.browser.depth_page import DepthPage
from tests.browser.visits import OpenPage, expect_visible, screenshot

ADDRESS = "Depth_maps?pair=square&size=1/2&maps=bm,sgbm&bm.block_size=13&sgbm.mode=hh"


def test_one_zip_opens_the_page_as_it_was(open_page: OpenPage) -> None:
    before = DepthPage(open_page(ADDRESS))
    before.press("Colours")
    before.choose("Turbo")
    before.page.keyboard.press("Escape")
    before.settle()
    bad = [before.number("Bad-2", method=method) for method in range(2)]
    before.unfold("Take it away")
    expect_visible(before.said("All files are for the images in their own size, 480 × 480 pixels."))
    data = before.download("Session ZIP")
    assert before.download("Settings JSON").count(b'"block_size": 25') == 1  # for the images in their own size

    after = DepthPage(open_page("Depth_maps"))
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
