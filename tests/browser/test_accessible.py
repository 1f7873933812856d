"""Every page and part of it before axe-core, and what is read aloud of a result that changes."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.browser.axe import COLOURS_ALONE, Audit, nameless
from tests.browser.visits import OpenPage, expect_visible, settled

BENCH = (".st-key-depth-bench", ".st-key-depth-head", ".st-key-page-links")
"""Of the depth page: what stays while its parts change."""

PARTS = (
    "Compare",
    "Values",
    "Why this match?",
    "Why blank?",
    "Scoreboard",
    "All pairs",
    "Sweep",
    "Suggest",
    "In 3-D",
)


@pytest.fixture(scope="module")
def audit() -> Iterator[Audit]:
    audit = Audit()
    yield audit
    audit.keep()


def press(page: Page, role: str, name: str) -> None:
    page.get_by_role(role, name=name, exact=True).first.click()  # type: ignore[arg-type]
    settled(page)


def unfold(page: Page, *titles: str) -> None:
    for title in titles:
        page.locator("summary:visible").filter(has_text=title).first.click()
        settled(page)


def announced(page: Page) -> Locator:
    """Return the live region, marked: what takes its place later is not read aloud."""
    region = page.locator("#stereolag-announced")
    region.evaluate("(one) => { one.dataset.met = 'before'; }")
    return page.locator("#stereolag-announced[data-met=before][role=status][aria-live=polite]")


def test_home(open_page: OpenPage, audit: Audit) -> None:
    page = open_page()
    numbers = page.locator(".stPlotlyChart .xtick text").first
    expect(numbers).to_have_css("fill", "rgb(91, 89, 100)")  # axe-core does not judge text in drawings
    audit.check(page, "Home")
    expect(numbers).to_have_css("fill", "rgb(180, 178, 189)")


def test_sensor_lag(open_page: OpenPage, audit: Audit) -> None:
    page = open_page("Sensor_lag")
    region = announced(page)
    expect(region).to_have_text("Sensor 2 hears it 1.136 s after sensor 1: its path is 378.17 m longer.")
    press(page, "radio", "Harbour in the wind")
    expect(region).to_contain_text("Sensor 1 hears it 0.7083 s after sensor 2")
    unfold(page, "All four methods", "Hear both together", "Take it away", "The source report")
    press(page, "button", "Compare the methods")
    audit.check(page, "Sensor lag")
    for tab in ("Fool it", "Arrows that line up", "From lag to metres"):
        press(page, "tab", tab)
        audit.check(page, f"Sensor lag: {tab}")
    press(page, "radio", "Your own files")
    audit.check(page, "Sensor lag: own files")
    page.get_by_test_id("stPageLink").get_by_text("Home", exact=True).click()
    expect(region).to_have_text("")


def test_rocketman_search(open_page: OpenPage, audit: Audit) -> None:
    page = open_page("Rocketman_search")
    page.get_by_role("button", name="Reveal").click()
    unfold(page, "Paint a mask", "Take it away")
    audit.check(page, "Rocketman search")
    main = page.get_by_role("button", name="All in one ZIP")
    main.hover()
    expect(main).to_have_css("background-color", "rgb(185, 173, 245)")  # now in the dark
    assert audit.findings(page, COLOURS_ALONE) == []
    for tab in ("Step by step", "Damage it"):
        press(page, "tab", tab)
        audit.check(page, f"Rocketman search: {tab}")
    press(page, "radio", "Cut from the image")
    audit.check(page, "Rocketman search: a template cut out")
    press(page, "radio", "Your own files")
    broken = {"name": "broken.png", "mimeType": "image/png", "buffer": b"this is no picture"}
    page.get_by_test_id("stFileUploader").locator("input[type=file]").first.set_input_files(broken)
    expect(page.get_by_test_id("stAlertContentError")).to_contain_text("accepted are")
    settled(page)
    expect(page.get_by_role("heading", name="Found at row 528, column 982")).to_have_count(0)
    audit.check(page, "Rocketman search: a refused file")


@pytest.fixture(scope="module")
def depth_page(keep_page: OpenPage) -> Page:
    return keep_page("Depth_maps?pair=giraffes&size=1/2")


def test_depth_maps(depth_page: Page, audit: Audit) -> None:
    page = depth_page
    region = announced(page)
    expect(region).to_contain_text("Coverage")
    figures = page.locator(".figures").first
    before, shown = region.inner_text(), figures.inner_text()
    page.get_by_role("slider", name="Window").press("ArrowRight")
    expect(region).not_to_have_text(before)
    expect(figures).not_to_have_text(shown)
    expect(region).to_contain_text("Bad-2")
    audit.check(page, "Depth maps")


@pytest.mark.parametrize("part", PARTS)
def test_part_of_depth_maps(depth_page: Page, audit: Audit, part: str) -> None:
    press(depth_page, "radio", part)
    audit.check(depth_page, f"Depth maps: {part}", but=BENCH)
    press(depth_page, "radio", part)  # folded again


def test_depth_maps_unfolded(depth_page: Page, audit: Audit) -> None:
    page = depth_page
    unfold(page, "choose a pair or bring your own")
    press(page, "radio", "Your own files")
    unfold(page, "More settings", "Input doctor", "Take it away")
    press(page, "button", "Before / after")
    page.get_by_role("button", name="Colours").click()
    settled(page)
    audit.check(page, "Depth maps: all unfolded")


def test_calibrate(open_page: OpenPage, audit: Audit) -> None:
    audit.check(open_page("Calibrate"), "Calibrate")


def test_driving(open_page: OpenPage, audit: Audit) -> None:
    page = open_page("Driving")
    expect_visible(page.locator(".player"))
    audit.check(page, "Driving")


def test_it_looks_into_components(depth_page: Page, audit: Audit) -> None:
    page = depth_page
    zoom = page.locator(".linked button[data-zoom=in]").first
    zoom.evaluate("(one) => { one.textContent = ''; one.title = ''; one.removeAttribute('aria-label'); }")
    page.locator(".linked .layer canvas").first.evaluate("(one) => one.removeAttribute('aria-label')")
    assert "button-name" in {one.rule for one in audit.findings(page)}
    assert len(nameless(page)) == 1
