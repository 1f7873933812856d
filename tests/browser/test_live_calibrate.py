"""A calibration that a live camera takes by itself, from a sequence played by the test, and what goes wrong."""

from __future__ import annotations

import re

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from stereolag.core.arrays import Rgb
from tests.browser import fake_media
from tests.browser.axe import check
from tests.browser.visits import OpenPage, expect_visible, screenshot, settled, turned_dark
from tests.held_boards import SQUARE_M, obeying, taken


@pytest.fixture(scope="module")
def pairs() -> list[tuple[Rgb, Rgb]]:
    return [taken(poses) for _, poses in obeying(4)]


def camera_page(open_page: OpenPage, pairs: list[tuple[Rgb, Rgb]]) -> Page:
    left, right = zip(*pairs, strict=True)
    cameras = fake_media.played_cameras(both=[np.hstack(pair) for pair in pairs], one=left, two=right)
    return open_page("Calibrate", choose="Live camera", script=cameras)


def start(page: Page) -> None:
    page.get_by_role("button", name="Start the camera").click()
    expect(page.locator(".live .state")).to_have_text("Live")


def show(page: Page, number: int) -> None:
    page.evaluate("(number) => (window.fakeMedia.frame = number)", number)


def test_a_board_that_is_held_as_told_is_calibrated_without_a_click(
    open_page: OpenPage, pairs: list[tuple[Rgb, Rgb]]
) -> None:
    page = camera_page(open_page, pairs)
    start(page)
    count, said = page.locator(".boards .count"), page.locator(".boards .said")
    for number in range(len(pairs) - 1):
        show(page, number)
        expect(count).to_contain_text(re.compile(rf"^{number + 1} pair"))
        expect(said).not_to_be_empty()
    expect(page.get_by_text("A chessboard of 10 × 7 squares.")).to_be_attached()
    screenshot(page)
    show(page, len(pairs) - 1)
    expect(page.get_by_text(f"The {len(pairs)} pairs that the camera has taken are in use.")).to_be_attached()
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


def test_few_pairs_are_kept_when_the_camera_is_lost_and_calibrated_on_demand(
    open_page: OpenPage, pairs: list[tuple[Rgb, Rgb]]
) -> None:
    page = camera_page(open_page, pairs)
    state, count = page.locator(".live .state"), page.locator(".boards .count")
    fake_media.refuse_cameras(page, "NotAllowedError")
    page.get_by_role("button", name="Start the camera").click()
    expect(state).to_contain_text("does not allow it")
    fake_media.refuse_cameras(page, "")
    start(page)
    expect(count).to_have_text("1 pair taken")
    fake_media.unplug_cameras(page)
    expect(state).to_contain_text("was unplugged")
    finish = page.get_by_role("button", name="Calibrate with these")
    expect(finish).to_be_disabled()
    fake_media.choose_arrangement(page, "Two webcams")
    start(page)
    for label, device in (("Right camera", "two"), ("Camera", "one")):
        fake_media.choose_device(page, label, device)
        expect(state).to_have_text("Live")
    expect(page.locator(".skew")).to_contain_text("ms")
    for number in (1, 2):
        show(page, number)
        expect(count).to_have_text(f"{number + 1} pairs taken")
    check(page, "Calibrate, live")
    turned_dark(page, width=390)
    page.get_by_role("button", name="Start over").click()
    expect(count).to_have_text("1 pair taken")  # of the board as it is held now
    for number in (3, 4):
        show(page, number)
        expect(count).to_have_text(f"{number - 1} pairs taken")
    finish.click()
    expect(page.get_by_text("The 3 pairs that the camera has taken are in use.")).to_be_attached()
    settled(page)
