"""The layout of a page: its first screen, parts that are cut off, and parts that jump while an answer is computed."""

from collections.abc import Callable

import numpy as np
from playwright.sync_api import Locator, Page

from tests.browser.parts import box_of
from tests.browser.visits import read_script, resized

USUAL, LARGE, PHONE = (1400, 900), (1920, 1080), (390, 844)
PART_SEEN = {USUAL: 0.99, LARGE: 0.99, PHONE: 1 / 3}
"""Least part of the result on the first screen, by the size of the window."""

RESULTS = {
    "Home": ".sliding .stage",
    "Sensor lag": ".sliding .stage",
    "Rocketman search": ".by-hand .stage",
    "Depth maps": ".linked figure",
    "Calibrate": ".stPlotlyChart",
    "Driving": ".player figure",
}
"""The figure in which each page shows its result."""

CONTROL = ".st-key-bench-controls :is(input, button):visible"

PATIENCE = 100


def expect_on_first_screen(page: Page, name: str) -> None:
    """Expect the result of a page on its first screen, and unless that is a phone's the first thing to change it."""
    result = page.locator(RESULTS[name]).first
    control = page.locator(CONTROL if name != "Home" else RESULTS[name]).first
    for screen, part in PART_SEEN.items():
        resized(page, *screen)
        page.evaluate("document.querySelector('[data-testid=stMain]').scrollTo(0, 0)")
        assert _part_seen(page, result) >= part, (name, screen)
        assert screen == PHONE or _part_seen(page, control) == 1, (name, screen)
    resized(page, 1280)


def _part_seen(page: Page, one: Locator) -> float:
    """Return the part of an element's height that is within the window."""
    box, size = box_of(one), page.viewport_size
    assert size is not None
    return float(np.clip(size["height"] - box["y"], 0, box["height"]) / box["height"])


def cut(page: Page, width: int) -> list[str]:
    """Return the parts that stick out of the page at a window width, or are cut off without an ellipsis."""
    resized(page, width)
    # A scroll bar for the whole page would be just as bad.
    page.wait_for_function("document.documentElement.scrollWidth <= innerWidth")
    found: list[str] = page.evaluate(read_script("cut"))
    for _ in range(PATIENCE):  # charts follow a moment later
        if not found:
            break
        page.wait_for_timeout(100)
        found = page.evaluate(read_script("cut"))
    return found


def jumps(page: Page, act: Callable[[], None]) -> list[tuple[int, str]]:
    """Return how far (px, vertically) each visible part of the page moved during an action, and its text."""

    def watched(act: Callable[[], None]) -> list[tuple[int, str]]:
        page.evaluate(read_script("jumps"))
        act()
        found: list[tuple[int, str]] = page.evaluate("jumping.disconnect(), jumps")
        return found

    for _ in range(PATIENCE):  # the page may still be settling after it opened
        if not watched(lambda: page.wait_for_timeout(300)):
            break
    found = watched(act)
    return [(far, said) for far, said in found if far]
