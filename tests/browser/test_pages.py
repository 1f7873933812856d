"""Every page in both themes, on a phone and by keyboard alone, with visible focus and no axe-core fault; nothing is cut
off, jumps or moves by itself."""

import re
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from stereolag.ui.navigation import PAGES
from tests.browser.axe import findings, nameless
from tests.browser.journeys import JOURNEYS
from tests.browser.layout import cut, expect_on_first_screen, jumps
from tests.browser.visits import OpenPage, resized, screenshot, settled, turned_dark
from tests.browser.walking import walked

ADDRESSES = {label: "" if path == "app.py" else Path(path).stem.partition("_")[2] for path, (label, _) in PAGES.items()}

PHONE, NARROW, USUAL, WIDE = 390, 420, 1280, 2560

MOVED = {"Sensor lag": "From sample", "Rocketman search": "Minimum score", "Depth maps": "Window"}
"""A slider on each page that has one."""

RUNNING = "() => document.getAnimations().map(({ effect }) => effect.getTiming()).filter(({ duration, iterations }) =>\
 duration * iterations > 10).length"

DISABLE = "(one) => { one.setAttribute('aria-disabled', 'true'); one.removeAttribute('tabindex'); }"
"""As Streamlit does to a tab while a run draws its panel anew."""

COUNT_TRANSITIONS = """
() => { window.transitions = 0; addEventListener("transitionrun", () => { window.transitions += 1; }, true); }
"""


@pytest.fixture(scope="module", params=ADDRESSES)
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def window(keep_page: OpenPage) -> Page:
    """Return a window that goes from page to page by their links: opening one anew takes three times as long."""
    return keep_page()


@pytest.fixture(scope="module")
def page(name: str, window: Page) -> Page:
    """Return a page that has stopped computing, shared by all tests of it."""
    window.emulate_media(color_scheme="light")
    resized(window, USUAL)
    window.get_by_test_id("stPageLink").get_by_text(name, exact=True).click()
    expect(window).to_have_url(re.compile(rf"/{ADDRESSES[name]}(\?.*)?$"))
    settled(window)
    cancel = window.get_by_role("button", name=re.compile("Cancel|Ending"))
    if name == "Driving":
        cancel.evaluate_all("(found) => found.forEach((one) => one.click())")  # at once: it may be gone soon
    expect(cancel).to_have_count(0)
    settled(window)
    return window


def no_exception(page: Page) -> None:
    expect(page.get_by_test_id("stException")).to_have_count(0)
    expect(page.get_by_test_id("stAlertContentError")).to_have_count(0)


def test_tab_reaches_every_control_in_order_and_shows_where_it_is(name: str, page: Page) -> None:
    there = walked(page)
    assert there.missed == []
    assert there.unframed == []
    assert there.stops[0] == "a Skip to main content"
    links = [stop for stop in there.stops if stop.startswith("a ")][1:]
    assert all(link.endswith(title) for link, title in zip(links, ADDRESSES, strict=False)), links
    if name == "Sensor lag":  # one page is enough for the way back
        assert walked(page, backwards=True).stops == there.stops[::-1]


def test_the_result_and_the_first_control_are_on_the_first_screen(name: str, page: Page) -> None:
    expect_on_first_screen(page, name)


@pytest.mark.parametrize("name", ["Sensor lag"], indirect=True)
def test_a_control_that_a_run_disables_or_replaces_has_the_focus_again(page: Page) -> None:
    tab, choice = page.get_by_role("tab").first, page.get_by_role("radio", name="Coast", exact=True)
    tab.focus()
    tab.evaluate(DISABLE)
    expect(page.locator("body")).to_be_focused()
    tab.evaluate("(one) => { one.setAttribute('aria-disabled', 'false'); one.tabIndex = 0; }")
    expect(tab).to_be_focused()
    choice.focus()
    choice.evaluate("(one) => one.replaceWith(one.cloneNode(true))")
    expect(choice).to_be_focused()
    page.get_by_role("tab").last.focus()  # it is left by hand, and stays so
    choice.evaluate(DISABLE)
    choice.evaluate("(one) => new Promise((done) => setTimeout(done, 200))")
    expect(page.get_by_role("tab").last).to_be_focused()
    page.reload()
    settled(page)


@pytest.mark.parametrize("name", MOVED, indirect=True)
def test_results_keep_their_place_and_the_slider_the_focus_while_an_answer_is_computed(name: str, page: Page) -> None:
    if name == "Sensor lag":
        page.get_by_role("tab", name="Lined up").click()
        settled(page)
    slider = page.get_by_role("slider", name=MOVED[name]).first
    resized(page, USUAL, 2_500)
    before = slider.input_value()

    def move(key: str, start: str) -> None:
        slider.press(key)
        page.wait_for_function("(start) => document.activeElement.value !== start", arg=start)
        settled(page)

    moved = jumps(page, lambda: move("ArrowLeft", before))
    assert moved == [], moved
    expect(slider).to_be_focused()
    move("ArrowRight", slider.input_value())
    expect(slider).to_have_value(before)
    resized(page, USUAL)
    if name == "Sensor lag":
        page.get_by_role("tab").first.click()
        settled(page)


def test_nothing_moves_by_itself_in_either_theme_nor_is_cut_from_a_phone_to_a_wide_screen(page: Page) -> None:
    no_exception(page)
    assert page.evaluate(RUNNING) == 0
    page.evaluate(COUNT_TRANSITIONS)
    turned_dark(page, width=PHONE)
    assert page.evaluate("transitions") == 0  # inherited colours start thousands of 1 ms transitions: half of all time
    no_exception(page)
    for width in (NARROW, WIDE):
        assert cut(page, width) == []
    resized(page, USUAL)
    screenshot(page)
    page.emulate_media(color_scheme="light")
    expect(page.get_by_test_id("stApp")).to_have_css("color-scheme", "light")


def test_it_is_worked_by_keys_alone_and_axe_finds_no_fault(name, page, address, request):
    if getattr(request.node, "execution_count", 1) > 1:  # the first journey ended anywhere
        page.goto(f"{address}/{ADDRESSES[name]}")
        settled(page)
    JOURNEYS[name](page)
    expect(page.get_by_test_id("stException")).to_have_count(0)


@pytest.mark.parametrize("name", ["Depth maps"], indirect=True)
def test_axe_looks_into_components(page: Page) -> None:
    zoom = page.locator(".linked button[data-zoom=in]").first
    zoom.evaluate("(one) => { one.textContent = ''; one.title = ''; one.removeAttribute('aria-label'); }")
    page.locator(".linked .layer canvas").first.evaluate("(one) => one.removeAttribute('aria-label')")
    assert "button-name" in {one["rule"] for one in findings(page)}
    assert len(nameless(page)) == 1
