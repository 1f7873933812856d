"""The outlines of the left image over the maps, and the windows drawn with their overlap, in a browser."""

from __future__ import annotations

from typing import Literal

import pytest
from playwright.sync_api import Locator, expect

from tests.browser.depth_page import DepthPage
from tests.browser.visits import OpenPage, expect_visible, screenshot, turned_dark


def switch_outlines(visit: DepthPage) -> None:
    visit.press("Colours")
    visit.page.get_by_text("Outlines of the left image").click()
    visit.settle()
    visit.page.keyboard.press("Escape")
    visit.settle()


def over(visit: DepthPage, title: str) -> Locator:
    return (
        visit.page.locator(".linked")
        .first.locator("figure", has=visit.page.get_by_text(title, exact=True))
        .locator(".outlines")
    )


@pytest.fixture(scope="module")
def cube_page(keep_page: OpenPage) -> DepthPage:
    return DepthPage(keep_page("Depth_maps?pair=cube&overlap=0.9"))


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_outlines_lie_over_the_maps_follow_the_zoom_and_go(
    cube_page: DepthPage, scheme: Literal["light", "dark"]
) -> None:
    visit = cube_page
    visit.page.emulate_media(color_scheme=scheme)
    expect(visit.page.get_by_test_id("stApp")).to_have_css("color-scheme", scheme)
    visit.settle()
    expect(visit.page.locator(".outlines")).to_have_count(0)
    switch_outlines(visit)
    expect(over(visit, "Convolution")).to_have_count(1)
    expect(over(visit, "StereoBM")).to_have_count(1)
    path = over(visit, "Convolution").locator("path.outline")
    assert len(path.get_attribute("d") or "") > 5_000
    path.evaluate("(path) => { path.kept = true; }")
    visit.move("Window", "ArrowRight", "ArrowRight")
    assert path.evaluate("(path) => path.kept")  # not drawn anew with the map

    visit.page.get_by_role("button", name="Zoom in").first.click()
    marks = visit.page.locator(".linked").first.locator(".viewport > svg").first
    zoomed = marks.get_attribute("viewBox")
    assert zoomed != "0 0 640 480"
    expect(over(visit, "Convolution")).to_have_attribute("viewBox", str(zoomed))
    screenshot(visit.page, f"depth-outlines-{scheme}")

    # A photograph has none.
    visit.page.get_by_role("button", name="Left image").first.click()
    expect(visit.page.locator(".linked").first.locator("figure")).to_have_count(3)
    expect(visit.page.locator(".linked").first.locator(".outlines")).to_have_count(2)
    switch_outlines(visit)
    expect(visit.page.locator(".outlines")).to_have_count(0)

    # As it was, for the next.
    visit.page.get_by_role("button", name="Left image").first.click()
    expect(visit.page.locator(".linked").first.locator("figure")).to_have_count(2)
    visit.page.get_by_role("button", name="Whole image").first.click()
    expect(marks).to_have_attribute("viewBox", "0 0 640 480")
    visit.move("Window", "ArrowLeft", "ArrowLeft")


def test_the_windows_and_their_overlap_are_drawn_on_a_phone_too(cube_page: DepthPage) -> None:
    visit, page = cube_page, cube_page.page
    turned_dark(page, width=420)
    visit.choose("Why this match?")
    expect_visible(visit.said("20 px windows, 90 % overlap: one every 2 px, so 289 values in this cut."))
    chart = page.get_by_test_id("stPlotlyChart").last
    expect(chart.locator(".shapelayer path, .layer-between path")).to_have_count(9)
    box = chart.bounding_box()
    assert box is not None
    assert box["x"] + box["width"] <= 420
    screenshot(page, "depth-overlap-phone")
