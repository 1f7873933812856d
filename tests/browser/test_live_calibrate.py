"""A calibration that a live camera takes by itself, from a sequence played by the test, and what goes wrong."""

import re

import numpy as np
from playwright.sync_api import Page, expect

from tests.browser import fake_media
from tests.browser.axe import check
from tests.browser.visits import expect_visible, settled, turned_dark
from tests.held_boards import SQUARE_M, obeying, taken


def start(page: Page) -> None:
    page.get_by_role("button", name="Start the camera").click()
    expect(page.locator(".live .state")).to_have_text("Live")


def test_pairs_outlive_a_lost_camera_are_used_on_demand_and_without_a_click_once_there_are_enough(open_page):
    pairs = [taken(poses) for _, poses in obeying(4)]
    camera = fake_media.played_cameras(both=[np.hstack(pair) for pair in pairs])
    page = open_page("Calibrate", choose="Live camera", script=camera)
    count = page.locator(".boards .count")

    def show(number: int) -> None:
        page.evaluate("(number) => (window.fakeMedia.frame = number)", number)

    start(page)
    expect(count).to_have_text("1 pair taken")
    expect(page.get_by_text("A chessboard of 10 × 7 squares.")).to_be_attached()
    fake_media.unplug_cameras(page)
    expect(page.locator(".live .state")).to_contain_text("was unplugged")
    finish = page.get_by_role("button", name="Calibrate with these")
    expect(finish).to_be_disabled()
    start(page)
    show(1)
    expect(count).to_have_text("2 pairs taken")
    check(page, "Calibrate, live")
    turned_dark(page, width=390)
    page.get_by_role("button", name="Start over").click()
    expect(count).to_have_text("1 pair taken")  # of the board as it is held now
    for number in (0, 2):
        show(number)
        expect(count).to_have_text(f"{2 + number // 2} pairs taken")
    finish.click()
    expect(page.get_by_text("The 3 pairs that the camera took are in use.")).to_be_attached()
    settled(page)

    page.get_by_role("radio", name="Live camera").click()
    start(page)
    for number in range(3, len(pairs)):
        expect(count).to_have_text(f"{number} pairs taken")
        show(number)
    expect(page.get_by_text(f"The {len(pairs)} pairs that the camera took are in use.")).to_be_attached()
    settled(page)
    fake_media.expect_cameras_off(page)
    page.get_by_role("spinbutton", name="Side of a square").fill(str(1000 * SQUARE_M))
    page.keyboard.press("Enter")
    heading = page.get_by_role("heading", name=f"Calibrated from {len(pairs)} of {len(pairs)} pairs")
    expect_visible(heading)
    settled(page)
    found = re.search(r"([\d.]+)\spx\sreprojection", heading.inner_text())
    assert found is not None
    assert float(found[1]) < 0.15  # as from files: tests/app/test_calibrate_live.py
