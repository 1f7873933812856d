"""Components that are tested alone elsewhere: here on their pages, where they must fit, be styled and be heard."""

from __future__ import annotations

import re
from collections.abc import Callable

from playwright.sync_api import Locator, Page, expect

from tests.browser.depth_page import DepthPage
from tests.browser.parts import themes
from tests.browser.visits import expect_fitting, expect_visible, screenshot, settled

WATCH_RUNS = """
() => new MutationObserver(() => document.body.dataset.reran = "yes").observe(
  document.querySelector("[data-testid=stApp]"), { attributeFilter: ["data-test-script-state"] })
"""

WORN = """
(one, names) => Object.fromEntries(names.map((name) => [name, getComputedStyle(one).getPropertyValue(name)]))
"""

SCORED_COLS = 2446 - 111 + 1
"""Width of the maze's score map."""


def watch_runs(page: Page) -> Callable[[], bool]:
    """Return a function that reports whether the page has been rerun since."""
    page.evaluate(WATCH_RUNS)
    return lambda: page.evaluate("document.body.dataset.reran") is not None


def expect_at_home(page: Page, part: Locator) -> None:
    """Expect a component to have the same style on its page as alone, and to fit."""
    scheme = page.get_by_test_id("stApp").evaluate("(app) => getComputedStyle(app).colorScheme")
    worn = part.evaluate(WORN, list(themes()[scheme]))
    assert worn == themes()[scheme]
    assert part.evaluate("(one) => one.getRootNode().host.dataset.testid") == "stBidiComponentIsolated"
    assert page.viewport_size is not None
    expect_fitting(page, page.viewport_size["width"])


def sensor_lag(page: Page) -> None:
    """Use the interactive components of the freshly opened page."""
    has_run = watch_runs(page)
    page.locator(".sliding .stage").press("End")
    expect(page.locator(".sliding .where")).to_have_text("Lag 13 · sum 27")
    expect_at_home(page, page.locator(".sliding"))
    page.get_by_role("tab", name="Fool it").click()
    page.locator(".disturbances input[name=noise]").press("End")
    expect(page.locator(".disturbances .verdict")).to_have_text(re.compile("^Nothing in common found"))
    expect_at_home(page, page.locator(".disturbances"))
    page.get_by_role("tab", name="Arrows that line up").click()
    page.locator(".phasors .lag").press("End")
    expect(page.locator(".phasors .where")).to_contain_text("Lag 12 ·")
    expect_at_home(page, page.locator(".phasors"))
    page.get_by_role("tab", name="From lag to metres").click()
    plan = page.locator(".plan")
    expect(plan.locator("output")).to_have_text("567.3 m")
    plan.get_by_role("button", name="In line").click()
    expect(plan.locator(".said")).to_contain_text("567.3 m longer")
    plan.locator("input").press("Home")
    plan.get_by_role("button", name="In line").click()
    expect(plan.locator(".said")).to_contain_text(re.compile(r"378\.2\sm longer.*This is your lag\."))
    expect_at_home(page, plan)
    assert not has_run()  # everything happens in the browser
    screenshot(page, "sensor-lag-parts")


def rocketman(page: Page) -> None:
    """Use the components for dragging, painting and cutting on the freshly opened page."""
    has_run = watch_runs(page)
    where, stage = page.locator(".by-hand .where"), page.locator(".score-map .stage")
    expect(where).to_contain_text("Row")
    box = stage.bounding_box()
    assert box is not None
    scale = box["width"] / SCORED_COLS
    stage.click(position={"x": 982.5 * scale, "y": 528.5 * scale})
    expect(where).to_have_text(re.compile(r"^Row 5[23]\d, column 9[789]\d: "))  # as precise as the screen allows
    expect_at_home(page, page.locator(".score-map"))
    page.locator(".by-hand .reveal").click()
    expect(page.locator(".by-hand .said")).to_contain_text("The peak is at row 528, column 982: 1.000.")
    expect_at_home(page, page.locator(".by-hand"))
    assert not has_run()
    page.get_by_role("tab", name="Step by step").click()
    page.locator(".funnel .steps button").nth(3).click()
    expect(page.locator(".funnel .said")).to_contain_text("Best: row 528, column 982, score 1.000.")
    expect_at_home(page, page.locator(".funnel"))
    page.get_by_role("tab", name="Search by hand").click()
    settled(page)

    page.get_by_text("Paint a mask").click()
    settled(page)
    use, counts = page.get_by_role("button", name="Use this mask"), page.locator(".painting .counts")
    page.locator(".painting .stage").press(" ")
    expect(counts).not_to_have_text("7,913 of 13,653 pixels count")
    painted = counts.inner_text()
    use.click()
    settled(page)
    found_at(page, 528, 982)
    expect(counts).to_have_text(painted)
    expect(use).to_be_disabled()
    expect_at_home(page, page.locator(".painting"))
    page.get_by_text("Cut from the image").click()
    found_at(page, 636, 1070)
    settled(page)
    page.locator(".cutting .stage").press("Shift+ArrowDown")
    found_at(page, 646, 1070)
    expect_at_home(page, page.locator(".cutting"))
    page.get_by_role("button", name="Search with OpenCV too").click()
    expect_visible(page.get_by_text("The same place; the scores differ by less than"))
    screenshot(page, "rocketman-parts")


def found_at(page: Page, row: int, col: int) -> None:
    expect_visible(page.get_by_role("heading", name=f"Found at row {row}, column {col}", exact=True))


def depth_maps(page: Page) -> None:
    """Switch the outlines on and off, open two parts with pictures, and follow the pointer in the second."""
    visit = DepthPage(page)
    assert page.viewport_size is not None
    width = page.viewport_size["width"]
    outlines = page.locator(".linked .outlines")
    for count in (2, 0):
        visit.press("Colours")
        page.get_by_text("Outlines of the left image").click()
        visit.settle()
        page.keyboard.press("Escape")
        expect(outlines).to_have_count(count)
    visit.settle()
    for part in ("Compare", "Why this match?"):
        visit.choose(part)
        expect_at_home(page, visit.pictures.first)
        screenshot(page, f"depth-parts-{part.strip('?').rpartition(' ')[-1].lower()}")
    reading = page.locator(".hovered .reading")
    before, has_run = str(reading.text_content()), watch_runs(page)
    visit.hover("Left image: point at it, or click", 100, 150)
    expect(reading).not_to_have_text(before)
    assert not has_run()
    expect_at_home(page, page.locator(".hovered"))
    expect_visible(visit.said(re.compile(r"px windows, \d+.% overlap: one every")))
    chart = page.get_by_test_id("stPlotlyChart").last
    expect(chart.locator(".shapelayer path, .layer-between path")).to_have_count(9)
    box = chart.bounding_box()
    assert box is not None
    assert box["x"] + box["width"] <= width
