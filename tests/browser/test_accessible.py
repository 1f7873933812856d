"""Every page and part of it before axe-core, and what is read aloud of a result that changes."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from tests.browser.axe import Audit
from tests.browser.visits import OpenPage, settled


@pytest.fixture(scope="module")
def audit() -> Iterator[Audit]:
    audit = Audit()
    yield audit
    audit.keep()


def press(page: Page, role: str, name: str) -> None:
    page.get_by_role(role, name=name, exact=True).first.click()  # type: ignore[arg-type]
    settled(page)


def unfold(page: Page, title: str) -> None:
    page.locator("summary:visible").filter(has_text=title).first.click()
    settled(page)


def test_home(open_page: OpenPage, audit: Audit) -> None:
    audit.check(open_page(), "Home")


def test_sensor_lag(open_page: OpenPage, audit: Audit) -> None:
    page = open_page("Sensor_lag")
    unfold(page, "All four methods")
    press(page, "button", "Compare the methods")
    audit.check(page, "Sensor lag")
    for tab in ("Fool it", "Arrows that line up", "From lag to metres"):
        press(page, "tab", tab)
        audit.check(page, f"Sensor lag: {tab}")


def test_rocketman_search(open_page: OpenPage, audit: Audit) -> None:
    page = open_page("Rocketman_search")
    page.get_by_role("button", name="Reveal").click()
    audit.check(page, "Rocketman search")
    for tab in ("Step by step", "Damage it"):
        press(page, "tab", tab)
        audit.check(page, f"Rocketman search: {tab}")
    page.get_by_text("Your own files").click()
    settled(page)
    audit.check(page, "Rocketman search: own files")
    broken = {"name": "broken.png", "mimeType": "image/png", "buffer": b"this is no picture"}
    page.get_by_test_id("stFileUploader").locator("input[type=file]").first.set_input_files(broken)
    expect(page.get_by_test_id("stAlertContentError")).to_contain_text("accepted are")
    settled(page)
    audit.check(page, "Rocketman search: a refused file")


def test_depth_maps(open_page: OpenPage, audit: Audit) -> None:
    page = open_page("Depth_maps?pair=square")
    audit.check(page, "Depth maps")
    page.get_by_text("choose a pair or bring your own").click()
    settled(page)
    audit.check(page, "Depth maps: choice of the pair")
    page.get_by_text("choose a pair or bring your own").click()
    bench = (".st-key-depth-bench", ".st-key-depth-head", ".st-key-page-links")  # looked at already
    for part in (
        "Compare",
        "Values",
        "Why this match?",
        "Why blank?",
        "Scoreboard",
        "All pairs",
        "Sweep",
        "Suggest",
        "In 3-D",
    ):
        press(page, "radio", part)
        audit.check(page, f"Depth maps: {part}", but=bench)


def test_calibrate(open_page: OpenPage, audit: Audit) -> None:
    audit.check(open_page("Calibrate"), "Calibrate")


def test_driving(open_page: OpenPage, audit: Audit) -> None:
    audit.check(open_page("Driving"), "Driving")
