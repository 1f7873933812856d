"""The plan of two sensors and a source: a lag gives the path difference, not the distance."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, expect

from stereolag import signal_lag
from stereolag.signals import SignalLag
from stereolag.ui.lag.plan import show_plan
from tests.browser.parts import ShowParts, sent
from tests.browser.visits import expect_fitting, screenshot, turned_dark

GEOMETRY = Path(__file__).resolve().parents[2] / "stereolag" / "ui" / "lag" / "plan" / "geometry.js"


@pytest.fixture(scope="module")
def blank_page(browser: Browser) -> Iterator[Page]:
    page = browser.new_page()
    page.add_script_tag(path=GEOMETRY)
    yield page
    page.close()


@pytest.mark.parametrize("difference", [-378.0, -40.0, 0.0, 120.0, 399.0])
def test_every_place_on_the_curve_has_the_same_path_difference(blank_page: Page, difference: float) -> None:
    places = np.array(blank_page.evaluate(f"() => branch({difference}, 400, 800)"))
    differences = np.hypot(places[:, 0] - 200, places[:, 1]) - np.hypot(places[:, 0] + 200, places[:, 1])
    np.testing.assert_allclose(differences, difference, atol=1e-6)
    assert np.hypot(*places.T).max() > 800


def heard() -> SignalLag:
    """Return a sure lag of one second."""
    noise = np.random.default_rng(0).normal(size=3000)
    return signal_lag(noise[1000:], noise[:-1000], sampling_rate=1000)


@pytest.fixture(scope="module")
def plan_page(show_parts: ShowParts) -> Page:
    result = heard()
    return show_parts(lambda: show_plan(result, 300.0, key="lag.plan")).page


def test_the_source_is_moved_by_mouse_and_keys_and_the_sensors_set_apart(plan_page: Page) -> None:
    page = plan_page
    plan = page.locator(".plan")
    said, stage = plan.locator(".said"), plan.locator(".stage")
    expect(said).to_contain_text("sensor 2 is")
    expect(said).to_contain_text("apart")
    expect(plan.locator("output")).to_have_text("450 m")
    plan.get_by_role("button", name="In line").click()
    expect(said).to_contain_text("450 m longer")
    expect(said).to_contain_text("the path difference is their distance")
    plan.get_by_role("button", name="As far from both").click()
    expect(said).to_contain_text("the lag is 0")
    stage.press("Shift+ArrowRight")
    expect(said).to_contain_text("The path to sensor 1 is")
    box = stage.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + 50)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] * 0.1, box["y"] + box["height"] / 2, steps=4)
    page.mouse.up()
    expect(said).to_contain_text("450")
    plan.locator("input").focus()
    page.keyboard.press("Home")
    expect(plan.locator("output")).to_have_text("300 m")
    plan.get_by_role("button", name="In line").click()
    expect(said).to_contain_text(re.compile(r"300\sm longer.*This is your lag\."))
    assert sent(page) == []


def test_the_plan_fits_a_phone_in_the_dark(plan_page: Page) -> None:
    page = plan_page
    turned_dark(page, width=390)
    page.locator(".plan .stage").scroll_into_view_if_needed()
    page.locator(".plan").get_by_role("button", name="As far from both").click()
    expect(page.locator(".plan .said")).to_contain_text("the lag is 0")
    expect_fitting(page, 390)
    screenshot(page, "sensor-lag-plan-phone")
