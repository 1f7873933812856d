"""Every page in both themes and on a phone, and worked by the keyboard alone, with the focus in sight; nothing of it
cut, nothing that jumps or moves."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise

import numpy as np
import pytest
from playwright.sync_api import Locator, Page, expect

from tests.browser.layout import cut, jumps
from tests.browser.sounds import wav_file
from tests.browser.test_pages import ADDRESSES, no_exception
from tests.browser.visits import OpenPage, expect_visible, screenshot, settled, turned_dark
from tests.browser.walking import walked

NARROW, USUAL, WIDE = 420, 1280, 2560

MOST_IN_A_ROW = 10

MOVED = {"Sensor lag": "From sample", "Rocketman search": "Minimum score", "Depth maps": "Window"}
"""A slider of each page that has one."""

RUNNING = "() => document.getAnimations().map(({ effect }) => effect.getTiming()).filter(({ duration, iterations }) =>\
 duration * iterations > 10).length"


@pytest.fixture(scope="module", params=ADDRESSES)
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def page(name: str, keep_page: OpenPage) -> Iterator[Page]:
    """Return a page that computes nothing any more, the same for all tests of it."""
    page = keep_page(ADDRESSES[name])
    page.emulate_media(reduced_motion="reduce")
    cancel = page.get_by_role("button", name="Cancel")
    if name == "Driving" and cancel.count():
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
    assert all(link.endswith(name) for link, name in zip(links, ADDRESSES, strict=False)), links
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


def test_it_opens_in_both_themes_and_on_a_phone(name: str, page: Page) -> None:
    file = name.lower().replace(" ", "-")
    no_exception(page)
    screenshot(page, f"{file}-light")
    turned_dark(page, width=390)
    no_exception(page)
    screenshot(page, f"{file}-phone")
    page.set_viewport_size({"width": USUAL, "height": 900})
    screenshot(page, f"{file}-dark")
    page.emulate_media(color_scheme="light")
    expect(page.get_by_test_id("stApp")).to_have_css("color-scheme", "light")
    settled(page)


def test_nothing_is_cut_from_a_phone_to_a_wide_screen(page: Page) -> None:
    for width in (NARROW, WIDE):
        assert cut(page, width) == []
    page.set_viewport_size({"width": USUAL, "height": 900})


def test_nothing_moves_by_itself_for_whoever_asks_for_that(page: Page) -> None:
    assert page.evaluate(RUNNING) == 0


def choose(page: Page, wanted: str, *, begin: str) -> None:
    """Go along a row of buttons with the arrow keys, from one of them, and choose another."""
    page.get_by_role("radio", name=begin, exact=True).first.focus()
    button = page.get_by_role("radio", name=wanted, exact=True).first
    for _ in range(MOST_IN_A_ROW):
        if button.evaluate("button => button === document.activeElement"):
            break
        page.keyboard.press("ArrowRight")
    page.keyboard.press("Enter")
    expect(button).to_be_checked()
    settled(page)
    expect(button).to_be_focused()


def turn_through(page: Page, *tabs: str) -> None:
    """Go along the tabs with the arrow keys."""
    for here, name in pairwise(tabs):
        page.get_by_role("tab", name=here).press("ArrowRight")
        tab = page.get_by_role("tab", name=name)
        expect(tab).to_be_focused()
        expect(tab).to_have_attribute("aria-selected", "true")
        settled(page)


def work_home(page: Page) -> None:
    page.get_by_role("link", name="Open Sensor lag").press("Enter")
    expect_visible(page.get_by_role("heading", name="Sensor lag"))
    settled(page)


def work_sensor_lag(page: Page) -> None:
    choose(page, "Harbour in the wind", begin="Coast")
    expect_visible(page.get_by_role("heading", name="Sensor 1 hears it 0.7083 s after sensor 2"))
    turn_through(page, "Slide it yourself", "Fool it", "Arrows that line up", "From lag to metres")
    expect_visible(page.locator(".plan .stage"))
    page.locator("summary").filter(has_text="Take it away").press("Enter")
    with page.expect_download():
        page.get_by_test_id("stDownloadButton").get_by_role("button").first.press("Enter")

    choose(page, "Your own files", begin="Harbour in the wind")
    box = page.get_by_test_id("stFileUploader").first
    with page.expect_file_chooser() as asked:
        box.get_by_test_id("stBaseButton-secondary").press("Enter")
    asked.value.set_files(wav_file("first.wav", np.random.default_rng(0).uniform(-0.5, 0.5, 4_410)))
    expect_visible(box.get_by_text("first.wav"))
    settled(page)
    box.get_by_role("button", name="Remove first.wav").press("Enter")
    expect(box.get_by_text("first.wav")).to_have_count(0)
    settled(page)


def work_rocketman(page: Page) -> None:
    choose(page, "Rocketman in the dust of the moon", begin="Rocketman in the garden maze")
    expect_visible(page.get_by_role("heading", name="Found at row 1048, column 1707"))
    turn_through(page, "Search by hand", "Step by step", "Damage it")
    expect_visible(page.get_by_role("button", name="Undo all damage"))


def work_depth_maps(page: Page) -> None:
    stage = page.get_by_role("application")
    stage.press("ArrowRight")
    expect(page.locator(".linked .where")).to_have_text("row 240, column 321")
    for _ in range(4):
        page.keyboard.press("+")
    expect(page.get_by_role("button", name="Whole image")).to_have_text("5.1×")
    for _ in range(12):
        page.keyboard.press("Shift+ArrowRight")
    expect(page.locator(".linked .where")).to_have_text("row 240, column 441")
    left, _, width, _ = map(float, (page.locator(".viewport svg").first.get_attribute("viewBox") or "").split())
    assert left <= 441 < left + width  # the view follows the crosshair
    page.keyboard.press("0")
    expect(page.get_by_role("button", name="Whole image")).to_have_text("1×")
    figures, small = page.locator(".linked figure"), page.get_by_role("button", name="Ground truth")
    for count in (3, 2):
        small.press("Enter")
        expect(figures).to_have_count(count)
        expect(small).to_be_focused()
    page.get_by_role("button", name="Before / after").press("Enter")
    page.get_by_role("slider", name="How much of the image on the left").press("Home")
    expect(page.locator(".layer").nth(1)).to_have_css("clip-path", "inset(0px 0px 0px 0%)")
    page.get_by_role("button", name="Side by side").press("Enter")

    choose(page, "Compare", begin="Compare")
    choose(page, "Values", begin="Compare")


def work_calibrate(page: Page) -> None:
    count = page.get_by_test_id("stMetric").filter(has_text="Pairs that count")
    expect(count).to_contain_text("10 of 11")
    page.get_by_role("button", name="1", exact=True).focus()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Enter")
    expect(count).to_contain_text("9 of 11")
    settled(page)
    shown: Locator = page.get_by_role("combobox", name="Pair shown")
    before = shown.input_value()
    for key in ("ArrowDown", "ArrowDown", "Enter"):
        shown.press(key)
    expect(shown).not_to_have_value(before)
    settled(page)


WORKED: dict[str, Callable[[Page], None]] = {
    "Home": work_home,
    "Sensor lag": work_sensor_lag,
    "Rocketman search": work_rocketman,
    "Depth maps": work_depth_maps,
    "Calibrate": work_calibrate,
}


def test_it_is_worked_by_keys_alone(name: str, page: Page) -> None:
    if name not in WORKED:
        pytest.skip("its player has its own tests by keys, and its job was cancelled by one")
    WORKED[name](page)
    expect(page.get_by_test_id("stException")).to_have_count(0)
