"""Every page worked by the keyboard alone, with the focus in sight; nothing of it cut, nothing that jumps or moves."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from tests.browser.layout import cut, jumps
from tests.browser.test_pages import PAGES
from tests.browser.visits import OpenPage, settled
from tests.browser.walking import walked

LINKS = ["Home", "Sensor lag", "Rocketman search", "Depth maps", "Calibrate", "Driving"]

NARROW, USUAL, WIDE = 420, 1280, 2560

MOVED = {"sensor-lag": "From sample", "rocketman": "Minimum score", "depth-maps": "Window"}
"""A slider of each page that has one."""

RUNNING = "() => document.getAnimations().map(({ effect }) => effect.getTiming()).filter(({ duration, iterations }) =>\
 duration * iterations > 10).length"


@pytest.fixture(scope="module", params=PAGES)
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def page(name: str, keep_page: OpenPage) -> Iterator[Page]:
    """Return a page that computes nothing any more, the same for all tests of it."""
    page = keep_page(PAGES[name])
    page.emulate_media(reduced_motion="reduce")
    cancel = page.get_by_role("button", name="Cancel")
    if name == "driving" and cancel.count():
        cancel.press("Enter")
    expect(cancel).to_have_count(0)
    settled(page)
    yield page
    page.close()


def test_tab_reaches_every_control_in_order_and_shows_where_it_is(page: Page) -> None:
    there = walked(page)
    assert there.missed == []
    assert there.unframed == []
    assert there.stops[0] == "a Skip to main content"
    links = [stop for stop in there.stops if stop.startswith("a ")][1:]
    assert all(link.endswith(name) for link, name in zip(links, LINKS, strict=False)), links
    assert walked(page, backwards=True).stops == there.stops[::-1]


def test_results_keep_their_place_and_the_slider_the_focus_while_an_answer_is_computed(name: str, page: Page) -> None:
    if name not in MOVED:
        pytest.skip("no slider")
    slider = page.get_by_role("slider", name=MOVED[name]).first
    page.set_viewport_size({"width": USUAL, "height": 2_500})
    settled(page)
    before = slider.input_value()

    def move() -> None:
        slider.press("ArrowLeft")
        page.wait_for_function("(before) => document.activeElement.value !== before", arg=before)
        settled(page)

    assert jumps(page, move) == []
    expect(slider).to_be_focused()


def test_nothing_is_cut_from_a_phone_to_a_wide_screen(page: Page) -> None:
    for width in (NARROW, WIDE):
        assert cut(page, width) == []
    page.set_viewport_size({"width": USUAL, "height": 900})


def test_nothing_moves_by_itself_for_whoever_asks_for_that(page: Page) -> None:
    assert page.evaluate(RUNNING) == 0
