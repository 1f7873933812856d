"""The depth page as a visitor's: a cell of a sweep clicked on, files taken away, links and sessions.

What each part says of a pair is tested without a browser, in ``tests/app``.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Locator, Page, expect

from tests.browser.parts import box_of
from tests.browser.visits import OpenPage, expect_visible, screenshot, settled


class DepthPage:
    """The depth page, open in a browser."""

    def __init__(self, page: Page) -> None:
        self.page = page

    def settle(self) -> None:
        """Wait until the page has answered without an exception."""
        settled(self.page)
        expect(self.page.get_by_test_id("stException")).to_have_count(0)

    def choose(self, name: str) -> None:
        """Choose one button of a row, unless it is chosen already: another click would undo that."""
        button = self.page.get_by_role("radio", name=name, exact=True).first
        if not button.is_checked():
            button.click()
        self.settle()

    def press(self, name: str) -> None:
        self.page.get_by_role("button", name=name).first.click()
        self.settle()

    def unfold(self, title: str) -> None:
        self.page.locator("summary:visible").filter(has_text=title).first.click()
        self.settle()

    def download(self, label: str) -> tuple[str, bytes]:
        """Return the address and the contents of a download."""
        with self.page.expect_download() as started:
            self.page.get_by_role("button", name=label, exact=True).click()
        return started.value.url, Path(started.value.path()).read_bytes()

    def number(self, name: str, *, method: int) -> float:
        """Return a number below a map."""
        figure = self.page.locator(".linked").first.locator("figure").nth(method)
        text = figure.locator(".figures div").filter(has_text=name).locator("dd").inner_text()
        found = re.search(r"[-−]?\d[\d,]*\.?\d*", text)
        assert found, text
        return float(found[0].replace(",", "").replace("−", "-"))

    def said(self, text: str | re.Pattern[str]) -> Locator:
        return self.page.get_by_text(text).first


def test_a_click_on_a_cell_of_the_sweep_takes_its_settings_over(open_page: OpenPage) -> None:
    visit = DepthPage(open_page("Depth_maps?pair=cube&size=1/4"))
    visit.choose("Sweep")
    visit.page.get_by_role("radio", name="StereoBM").last.click()
    visit.settle()
    for name, values in (("Block: values", "9, 15, 21"), ("Disparities searched: values", "32, 64")):
        box = visit.page.get_by_label(name)
        box.fill(values)
        box.press("Enter")
        visit.settle()
    visit.press("Sweep 6 combinations")
    expect_visible(visit.said("Right: bad-2, %, lower is better."))
    chart = visit.page.get_by_test_id("stPlotlyChart").last
    bad = chart.locator(".js-plotly-plot").evaluate("plot => [...plot._fullData[0].z].map(row => [...row])")
    assert np.shape(bad) in {(2, 3), (3, 2)}
    screenshot(visit.page, "journey-sweep-cube-light")
    cell = [int(place) for place in np.unravel_index(np.argmin(bad), np.shape(bad))]
    x, y = chart.locator(".js-plotly-plot").evaluate(
        "(plot, [row, col]) => { const { xaxis, yaxis } = plot._fullLayout;"
        " return [xaxis._offset + xaxis.l2p(col), yaxis._offset + yaxis.l2p(row)]; }",
        cell,
    )
    chart.click(position={"x": x, "y": y})
    visit.settle()
    assert visit.number("Bad-2", method=1) == pytest.approx(np.min(bad), abs=0.06)


def test_a_map_follows_a_slider_while_it_is_dragged_and_is_whole_once_it_is_released(open_page: OpenPage) -> None:
    page = open_page("Depth_maps?pair=cube")
    canvas, slider = page.locator(".linked .layer canvas").first, page.get_by_role("slider", name="Window")
    box, start = box_of(slider.locator("..")), slider.input_value()
    y, xs = box["y"] + box["height"] / 2, [box["x"] + box["width"] / 2 + by for by in (0, 30, 60)]

    def drag_to(x: float, width: int) -> None:
        page.mouse.move(x, y)
        expect(canvas).to_have_js_property("width", width)

    page.mouse.move(xs[0], y)
    page.mouse.down()
    drag_to(xs[1], 320)
    expect(page).to_have_url(re.compile("pair=cube$|Depth_maps$"))
    drag_to(xs[0], 320)
    page.mouse.up()
    expect(slider).to_have_value(start)
    expect(canvas).to_have_js_property("width", 640)  # as before: nothing was asked of the server
    page.mouse.down()
    drag_to(xs[2], 320)
    page.mouse.up()
    expect(canvas).to_have_js_property("width", 640)
    expect(page).to_have_url(re.compile(f"window_size={slider.input_value()}"))


# Links and sessions

ADDRESS = "Depth_maps?pair=square&size=1/2&maps=bm,sgbm&bm.block_size=13&sgbm.mode=hh"
OTHER_ADDRESS = "Depth_maps?pair=square&window_size=31&bm.block_size=9"


def test_a_link_opens_the_page_as_it_was_and_its_files_have_addresses_nobody_else_can_guess(
    open_page: OpenPage, address: str
) -> None:
    def taken(visit: DepthPage) -> tuple[str, bytes]:
        expect(visit.page.get_by_role("slider", name="Block")).to_have_value("13")
        visit.unfold("Take it away")
        expect_visible(visit.said("All files are for the images at full size, 480 × 480 pixels."))
        visit.press("More files")
        return visit.download("NPY")

    before = DepthPage(open_page(ADDRESS))
    own_address, own_map = taken(before)

    after = DepthPage(open_page(OTHER_ADDRESS))
    page, window = after.page, after.page.get_by_role("slider", name="Window")
    expect(window).to_have_value("31")
    page.get_by_role("button", name="Fast").click()
    expect(window).to_have_value("11")
    expect(page).to_have_url(re.compile("pair=square&window_size=11.*left_right=on.*bm.block_size=9"))
    settled(page)
    page.go_back()
    expect(window).to_have_value("31")
    settled(page)
    page.goto(f"{address}/{ADDRESS}")
    after.settle()
    # The same result for two visitors has the same bytes, but an address that the other visitor's does not reveal.
    other_address, same_map = taken(after)
    assert same_map == own_map
    assert other_address != own_address
