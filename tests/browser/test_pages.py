from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from stereolag.ui.navigation import PAGES
from tests.app import uploads
from tests.browser.visits import OpenPage, expect_visible, screenshot, settled

ADDRESSES = {label: "" if path == "app.py" else Path(path).stem.partition("_")[2] for path, (label, _) in PAGES.items()}


def no_exception(page: Page) -> None:
    expect(page.get_by_test_id("stException")).to_have_count(0)
    expect(page.get_by_test_id("stAlertContentError")).to_have_count(0)


@pytest.mark.parametrize("label", ADDRESSES)
def test_every_page_opens_in_both_themes_and_on_a_phone(open_page: OpenPage, label: str) -> None:
    page = open_page(ADDRESSES[label])
    name = label.lower().replace(" ", "-")
    no_exception(page)
    screenshot(page, f"{name}-light")

    page.emulate_media(color_scheme="dark")
    expect(page.get_by_test_id("stApp")).to_have_css("color-scheme", "dark")
    screenshot(page, f"{name}-dark")

    page.set_viewport_size({"width": 390, "height": 900})
    settled(page)
    no_exception(page)
    assert page.evaluate("document.querySelector('[data-testid=stMain]').scrollWidth") <= 390
    screenshot(page, f"{name}-phone")


def test_the_links_lead_from_page_to_page(open_page: OpenPage) -> None:
    page = open_page()
    for label in [label for label in ADDRESSES if label != "Home"]:
        page.get_by_test_id("stPageLink").get_by_text(label, exact=True).click()
        expect(page.get_by_role("heading", level=1)).to_have_text(label)
        settled(page)
        no_exception(page)


def test_a_slider_moves_the_depth_map(open_page: OpenPage) -> None:
    page = open_page("Depth_maps")
    coverage = page.locator(".figures").first
    before = coverage.inner_text()
    slider = page.get_by_role("slider", name="Window")
    slider.focus()
    slider.press("ArrowRight")
    expect(coverage).not_to_have_text(before)
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


def test_a_broken_picture_is_answered_with_a_sentence(open_page: OpenPage) -> None:
    page = open_page("Rocketman_search")
    page.get_by_text("Your own files").click()
    settled(page)
    broken = {"name": "broken.png", "mimeType": "image/png", "buffer": b"this is no picture"}
    page.get_by_test_id("stFileUploader").locator("input[type=file]").first.set_input_files(broken)
    expect(page.get_by_test_id("stAlertContentError")).to_contain_text("accepted are")
    settled(page)
    expect(page.get_by_role("heading", name="Found at row 528, column 982")).to_have_count(0)
    screenshot(page, "rocketman-broken-file")
