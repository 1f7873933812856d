"""The depth page as a visitor uses it: buttons, files, pictures and numbers found by their labels."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

from playwright.sync_api import Locator, Page, expect

from tests.browser.visits import OpenPage, expect_visible, file_of, screenshot, settled

DEPTH_MAPS = "Depth_maps?pair="


class Given(NamedTuple):
    """A file to upload: its name and its bytes."""

    name: str
    data: bytes

    @classmethod
    def of(cls, path: Path) -> Given:
        return cls(path.name, path.read_bytes())


class OwnPair(NamedTuple):
    """The files of a pair."""

    left: Given
    right: Given
    truth: Given
    calibration: Given


class DepthPage:
    """The depth page, open in a browser."""

    def __init__(self, page: Page, name: str = "own") -> None:
        self.page, self.name = page, name

    @classmethod
    def with_example(cls, open_page: OpenPage, name: str, *, scheme: str = "light") -> DepthPage:
        return cls(open_page(DEPTH_MAPS + name, scheme=scheme), name)

    @classmethod
    def with_files(cls, open_page: OpenPage, pair: OwnPair, *, scheme: str = "light") -> DepthPage:
        """Open the page and upload a pair, its ground truth and its calibration."""
        visit = cls(open_page(DEPTH_MAPS + "square", scheme=scheme))
        visit.open_head()
        visit.choose("Your own files")
        visit.unfold("Calibration (optional)")
        visit.give("Left image", pair.left)
        visit.give("Right image", pair.right)
        visit.open_head()  # it folded when the pair was uploaded
        visit.give("Ground truth (optional)", pair.truth)
        visit.give("Calibration files", pair.calibration)
        expect_visible(visit.page.get_by_text("Your own pair").first)
        return visit

    def open_head(self) -> None:
        """Unfold the choice of the pair if it is folded."""
        head = self.page.locator("details", has=self.page.get_by_text("choose a pair or bring your own"))
        if head.get_attribute("open") is None:
            head.locator("summary").first.click()
            self.settle()

    def settle(self) -> None:
        """Wait until the page has answered without an exception."""
        settled(self.page)
        expect(self.page.get_by_test_id("stException")).to_have_count(0)

    def screenshot(self, name: str) -> None:
        screenshot(self.page, f"journey-{name}")

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

    def give(self, label: str, file: Given) -> None:
        """Upload a file to the box with this label."""
        box = self.page.get_by_test_id("stFileUploader").filter(has_text=label).locator("input[type=file]")
        box.set_input_files(file_of(*file))
        self.settle()

    def download(self, label: str) -> bytes:
        return self.download_from(label)[1]

    def download_from(self, label: str, *, exact: bool = False) -> tuple[str, bytes]:
        """Return the address and the contents of a download."""
        with self.page.expect_download() as started:
            self.page.get_by_role("button", name=label, exact=exact).click()
        return started.value.url, Path(started.value.path()).read_bytes()

    def slider(self, name: str) -> Locator:
        return self.page.get_by_role("slider", name=name)

    def value(self, name: str) -> float:
        """Return the value of a slider."""
        return float(self.slider(name).first.input_value())

    def number(self, name: str, *, method: int = 0) -> float:
        """Return a number below a map, by default the first map."""
        figure = self.page.locator(".linked").first.locator("figure").nth(method)
        return number_in(figure.locator(".figures div").filter(has_text=name).locator("dd").inner_text())

    def said(self, text: str | re.Pattern[str]) -> Locator:
        return self.page.get_by_text(text).first

    def paragraph(self, text: str) -> Locator:
        """Return the paragraph that contains a text."""
        return self.page.locator("p").filter(has_text=text).first


def number_in(text: str) -> float:
    """Return the first number in a text."""
    found = re.search(r"[-−]?\d[\d,]*\.?\d*", text)
    assert found, text
    return float(found[0].replace(",", "").replace("−", "-"))


def choose_cell(chart: Locator, row: int, col: int) -> None:
    """Click a cell of a Plotly grid."""
    place = chart.locator(".js-plotly-plot").evaluate(
        "(plot, [row, col]) => { const { xaxis, yaxis } = plot._fullLayout;"
        " return [xaxis._offset + xaxis.l2p(col), yaxis._offset + yaxis.l2p(row)]; }",
        [row, col],
    )
    chart.click(position={"x": place[0], "y": place[1]})
