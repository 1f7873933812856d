"""The steps of the "sampled" search in the browser."""

from __future__ import annotations

import re

import pytest
from playwright.sync_api import Page, expect

from stereolag.ui.pictures import example_pictures
from stereolag.ui.search.funnel import show_funnel
from tests.browser.parts import Parts, ShowParts, sent
from tests.browser.visits import expect_fitting, screenshot, turned_dark


def dots(page: Page) -> int:
    """Return the number of marked pixels in the picture."""
    marked = page.locator(".funnel .picture .dots")
    return len(re.findall("M", marked.get_attribute("d") or "")) if marked.count() else 0


@pytest.fixture(scope="module")
def steps(show_parts: ShowParts) -> Parts:
    inputs = example_pictures("maze")
    return show_parts(lambda: show_funnel(inputs))


def test_the_steps_lead_from_all_pixels_to_him_and_another_pixel_can_be_picked(steps: Parts) -> None:
    page = steps.page
    buttons, said = page.locator(".funnel .steps button"), page.locator(".funnel .said")
    bars, colour = page.locator(".funnel .bars"), page.locator(".funnel .colour")
    expect(buttons).to_have_text(["All pixels3,732,596", "This colour24", "Both ends agree1", "Scored9"])
    bars.scroll_into_view_if_needed()
    assert dots(page) == 0
    for step, count in ((1, 24), (2, 1), (3, 9)):
        buttons.nth(step).press("Enter")
        expect(buttons.nth(step)).to_have_attribute("aria-pressed", "true")
        assert dots(page) == count
    expect(said).to_contain_text("Best: row 528, column 982, score 1.000.")
    expect(page.locator(".funnel .picture .place")).to_have_count(1)

    bars.press("ArrowRight")
    expect(colour).to_contain_text("85 pixels of its colour")
    expect(buttons.nth(3)).to_have_text("Scored27")
    assert dots(page) == 27
    bars.press("End")
    expect(bars).to_have_attribute("aria-valuenow", "24")
    expect(buttons.nth(1)).to_have_text("This colour390,413")
    expect(said).to_contain_text("Too many: only their count is shown")
    buttons.nth(1).click()
    expect(said).to_contain_text("600 of them are drawn")
    screenshot(page, "rocketman-funnel")

    box = bars.bounding_box()
    assert box is not None
    bars.click(position={"x": box["width"] * 2.5 / 24, "y": 60})
    expect(bars).to_have_attribute("aria-valuenow", "3")
    template = page.locator(".funnel .template")
    box = template.bounding_box()
    assert box is not None
    template.click(position={"x": box["width"] * 67.5 / 111, "y": box["height"] * 55.5 / 123})
    expect(colour).to_have_text("Row 55, column 67 of the template: 24 pixels of its colour")
    assert sent(page) == []


def test_it_reads_in_dark_and_on_a_phone(steps: Parts) -> None:
    page = steps.page
    turned_dark(page, width=420)
    inputs = example_pictures("maze_dulled")
    steps.hand_over(lambda: show_funnel(inputs))
    buttons = page.locator(".funnel .steps button")
    expect(buttons.nth(2)).not_to_have_text("Both ends agree1")
    buttons.nth(3).click()
    expect(page.locator(".funnel .said")).not_to_contain_text("score 1.00")
    expect_fitting(page, 420)
    screenshot(page, "rocketman-funnel-phone")
