from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from playwright.sync_api import Page, expect

from stereolag.ui.navigation import PAGES
from tests.app import uploads
from tests.browser.visits import OpenPage, expect_visible, screenshot, settled

ADDRESSES = {label: "" if path == "app.py" else Path(path).stem.partition("_")[2] for path, (label, _) in PAGES.items()}


def no_exception(page: Page) -> None:
    expect(page.get_by_test_id("stException")).to_have_count(0)
    expect(page.get_by_test_id("stAlertContentError")).to_have_count(0)


def test_the_links_lead_from_page_to_page(open_page: OpenPage) -> None:
    page = open_page()
    for label in [label for label in ADDRESSES if label != "Home"]:
        page.get_by_test_id("stPageLink").get_by_text(label, exact=True).click()
        expect(page.get_by_role("heading", level=1)).to_have_text(label)
        settled(page)
        no_exception(page)


def test_an_own_pair_is_uploaded_and_matched(open_page: OpenPage) -> None:
    scene = uploads.texture(120, 165)
    files = {"left.png": scene[:, :-5], "right.png": scene[:, 5:]}
    truth = np.full((120, 160), 5 * 256, dtype=np.uint16)
    page = open_page("Depth_maps")
    page.get_by_text("choose a pair or bring your own").click()
    settled(page)
    page.get_by_text("Your own files").click()
    settled(page)
    inputs = page.get_by_test_id("stFileUploader").locator("input[type=file]")
    expect(inputs).to_have_count(4)  # the fourth is for a calibration
    for place, (name, picture) in enumerate((files | {"truth.png": truth}).items()):
        if name == "truth.png":  # the pair is there, and the choice of it folded
            page.get_by_text("choose a pair or bring your own").click()
            settled(page)
        inputs.nth(place).set_input_files({"name": name, "mimeType": "image/png", "buffer": uploads.png(picture)})
        settled(page)  # a file that is given to a box about to be drawn anew is lost
    expect_visible(page.get_by_text("Your own pair").first)
    expect_visible(page.locator(".figures dd").filter(has_text=re.compile(r"^0\.0\d\spx$")).first)
    no_exception(page)
    screenshot(page, "depth-maps-own-files")
