"""That what is tested alone, beside this file, stands on its page, is dressed by it, and is heard there."""

from __future__ import annotations

import re

from playwright.sync_api import Locator, Page, expect

from tests.browser.depth_page import DepthPage
from tests.browser.parts import themes
from tests.browser.visits import OpenPage, expect_fitting, expect_visible, screenshot, settled

WATCH_RUNS = """
() => new MutationObserver(() => document.body.dataset.reran = "yes").observe(
  document.querySelector("[data-testid=stApp]"), { attributeFilter: ["data-test-script-state"] })
"""

WORN = """
(one, names) => Object.fromEntries(names.map((name) => [name, getComputedStyle(one).getPropertyValue(name)]))
"""


SCORED_COLS = 2446 - 111 + 1
"""Of the score map of the maze."""


def has_run(page: Page) -> bool:
    """Tell whether the page was run since its runs are watched."""
    return page.evaluate("document.body.dataset.reran") is not None


def dressed(part: Locator, scheme: str) -> bool:
    """Tell whether a part of a page wears what it wears alone."""
    names = themes()[scheme]
    worn: dict[str, str] = part.evaluate(WORN, list(names))
    assert worn == names
    return part.evaluate("(one) => one.getRootNode().host.dataset.testid") == "stBidiComponentIsolated"


def test_sensor_lag(open_page: OpenPage) -> None:
    page = open_page("Sensor_lag", scheme="dark", width=390)
    page.evaluate(WATCH_RUNS)
    page.locator(".sliding .stage").press("End")
    expect(page.locator(".sliding .where")).to_have_text("Lag 13 · sum 27")
    assert dressed(page.locator(".sliding"), "dark")
    expect_fitting(page, 390)
    page.get_by_role("tab", name="Fool it").click()
    page.locator(".disturbances input[name=noise]").press("End")
    expect(page.locator(".disturbances .verdict")).to_have_text(re.compile("^Nothing in common found"))
    expect_fitting(page, 390)
    page.get_by_role("tab", name="Arrows that line up").click()
    page.locator(".phasors .lag").press("End")
    expect(page.locator(".phasors .where")).to_contain_text("Lag 12 ·")
    expect_fitting(page, 390)
    page.get_by_role("tab", name="From lag to metres").click()
    plan = page.locator(".plan")
    expect(plan.locator("output")).to_have_text("567.3 m")
    plan.get_by_role("button", name="In line").click()
    expect(plan.locator(".said")).to_contain_text("567.3 m longer")
    plan.locator("input").press("Home")
    plan.get_by_role("button", name="In line").click()
    expect(plan.locator(".said")).to_contain_text(re.compile(r"378\.2\sm longer.*This is your lag\."))
    assert not has_run(page)  # all of it happens in the browser
    expect_fitting(page, 390)
    screenshot(page, "sensor-lag-parts-phone")


def found_at(page: Page, row: int, col: int) -> None:
    expect_visible(page.get_by_role("heading", name=f"Found at row {row}, column {col}", exact=True))


def test_rocketman(open_page: OpenPage) -> None:
    page = open_page("Rocketman_search")
    where, stage = page.locator(".by-hand .where"), page.locator(".score-map .stage")
    expect(where).to_contain_text("Row")
    page.evaluate(WATCH_RUNS)
    box = stage.bounding_box()
    assert box is not None
    scale = box["width"] / SCORED_COLS
    stage.click(position={"x": 982.5 * scale, "y": 528.5 * scale})
    expect(where).to_have_text("Row 528, column 982: 1.000")
    page.locator(".by-hand .reveal").click()
    expect(page.locator(".by-hand .said")).to_contain_text("The peak is at row 528, column 982: 1.000.")
    assert dressed(page.locator(".by-hand"), "light")
    assert not has_run(page)
    page.get_by_role("tab", name="Step by step").click()
    page.locator(".funnel .steps button").nth(3).click()
    expect(page.locator(".funnel .said")).to_contain_text("Best: row 528, column 982, score 1.000.")
    page.get_by_role("button", name="Search with OpenCV too").click()
    expect_visible(page.get_by_text("The same place; the scores differ by less than"))

    page.get_by_text("Paint a mask").click()
    use, counts = page.get_by_role("button", name="Use this mask"), page.locator(".painting .counts")
    page.locator(".painting .stage").press(" ")
    expect(counts).not_to_have_text("7,913 of 13,653 pixels count")
    painted = counts.inner_text()
    use.click()
    settled(page)
    found_at(page, 528, 982)
    expect(counts).to_have_text(painted)
    expect(use).to_be_disabled()
    page.get_by_text("Cut from the image").click()
    found_at(page, 636, 1070)
    settled(page)
    page.locator(".cutting .stage").press("Shift+ArrowDown")
    found_at(page, 646, 1070)
    screenshot(page, "rocketman-cut")


def test_depth_maps(open_page: OpenPage) -> None:
    visit = DepthPage(open_page("Depth_maps?pair=cube&overlap=0.9", scheme="dark", width=420))
    page = visit.page
    outlines = page.locator(".linked .outlines")
    for count in (2, 0):
        visit.press("Colours")
        page.get_by_text("Outlines of the left image").click()
        visit.settle()
        page.keyboard.press("Escape")
        expect(outlines).to_have_count(count)
    visit.settle()
    for part in ("Compare", "Values", "Why blank?", "Why this match?"):
        visit.choose(part)
        expect_fitting(page, 420)
        screenshot(page, f"depth-{part.split()[1 if 'Why' in part else 0].strip('?').lower()}-phone")
    reading = page.locator(".hovered .reading")
    before = str(reading.text_content())
    page.evaluate(WATCH_RUNS)
    visit.hover("Left image: point at it, or click", 200, 300)
    expect(reading).not_to_have_text(before)
    assert not has_run(page)
    expect_visible(visit.said("20 px windows, 90 % overlap: one every 2 px, so 289 values in this cut."))
    chart = page.get_by_test_id("stPlotlyChart").last
    expect(chart.locator(".shapelayer path, .layer-between path")).to_have_count(9)
    box = chart.bounding_box()
    assert box is not None
    assert box["x"] + box["width"] <= 420
