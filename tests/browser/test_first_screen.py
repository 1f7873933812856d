"""The first screen of each page, with its example and with own files: the result, and the first thing to change it."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

import numpy as np
import pytest
from playwright.sync_api import FilePayload, Locator, Page, expect

from tests.app import uploads
from tests.app.test_calibrate_page import SQUARE_MM, files
from tests.app.test_driving_page import drive
from tests.browser.parts import box_of
from tests.browser.test_pages import ADDRESSES
from tests.browser.visits import OpenPage, file_of, resized, settled

USUAL, LARGE, PHONE = (1400, 900), (1920, 1080), (390, 844)
PART_SEEN = {USUAL: 0.99, LARGE: 0.99, PHONE: 1 / 3}
"""Least part of the result on the first screen, by the size of the window."""

RESULTS = {
    "Home": ".sliding .stage",
    "Sensor lag": ".sliding .stage",
    "Rocketman search": ".by-hand .stage",
    "Calibrate": ".stPlotlyChart",
    "Driving": ".player figure",
    "Depth maps": ".linked figure",
}
"""The figure in which each page shows its result; the depth page is the last that a window is taken to."""

CONTROL = ".st-key-bench-controls :is(input, button):visible"


def _recordings() -> list[FilePayload]:
    sound = uploads.noise(9_000)
    return [file_of("first.wav", uploads.wav(sound[300:])), file_of("second.wav", uploads.wav(sound[:-300]))]


def _pictures() -> list[FilePayload]:
    picture = uploads.texture(400, 300)
    template = picture[100:160, 200:260]
    return [file_of("picture.png", uploads.png(picture)), file_of("template.png", uploads.png(template))]


def _pair() -> list[FilePayload]:
    scene = np.kron(uploads.texture(60, 90), np.ones((4, 4, 1), np.uint8))
    left, right = scene[:, :320], scene[:, 12:332]
    return [file_of("left.png", uploads.png(left)), file_of("right.png", uploads.png(right))]


OWN: Mapping[str, tuple[str, Callable[[], list[FilePayload]]]] = {
    "Sensor lag": ("Your own files", _recordings),
    "Rocketman search": ("Your own files", _pictures),
    "Calibrate": ("Your own files", lambda: [file_of(*file) for file in files().items()]),
    "Driving": ("Your ZIP, or side-by-side video", lambda: [file_of("drive.zip", drive(count=3))]),
    "Depth maps": ("Your own files", _pair),
}
"""The choice on each page that asks for own files, and files to give: one for each box, or all for the first."""


@pytest.fixture(scope="module")
def window(keep_page: OpenPage) -> Page:
    """Return a window that goes from page to page by their links."""
    return keep_page()


def _give(page: Page, name: str) -> None:
    choice, make = OWN[name]
    if name == "Depth maps":
        page.locator("summary").first.click()
        settled(page)
    page.get_by_role("radio", name=choice, exact=True).click()
    settled(page)
    given, boxes = make(), page.locator("input[type=file]")
    each = [[one] for one in given] if name not in ("Calibrate", "Driving") else [given]
    for number, some in enumerate(each):
        boxes.nth(number).set_input_files(some)
        settled(page)
    if name == "Calibrate":
        side = page.get_by_role("spinbutton", name="Side of a square")
        side.fill(f"{SQUARE_MM}")
        side.press("Enter")
        settled(page)
    expect(page.get_by_text("the page shows the example")).to_have_count(0)


def _part_seen(page: Page, one: Locator) -> float:
    """Return the part of an element's height that is within the window."""
    box, size = box_of(one), page.viewport_size
    assert size is not None
    return float(np.clip(size["height"] - box["y"], 0, box["height"]) / box["height"])


@pytest.mark.parametrize("name", RESULTS)
def test_the_result_and_the_first_control_are_on_the_first_screen(name: str, window: Page) -> None:
    resized(window, *USUAL)
    window.get_by_test_id("stPageLink").get_by_text(name, exact=True).click()
    expect(window).to_have_url(re.compile(rf"/{ADDRESSES[name]}(\?.*)?$"))
    settled(window)
    result = window.locator(RESULTS[name]).first
    control = window.locator(CONTROL if name != "Home" else RESULTS[name]).first
    for own in (False, True) if name in OWN else (False,):
        if own:
            _give(window, name)
        for screen, part in PART_SEEN.items():
            resized(window, *screen)
            assert _part_seen(window, result) >= part, (screen, own)
            assert screen == PHONE or _part_seen(window, control) == 1, (screen, own)
        resized(window, *USUAL)
