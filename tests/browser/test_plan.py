"""The plan of two sensors and a source: the path difference is what a lag tells, not the distance."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.visits import OpenPage, expect_fitting, screenshot, turned_dark

GEOMETRY = Path(__file__).resolve().parents[2] / "stereolag" / "ui" / "lag" / "plan" / "geometry.js"


@pytest.mark.parametrize("difference", [-378.0, -40.0, 0.0, 120.0, 399.0])
def test_every_place_on_the_curve_has_the_same_path_difference(browser: Browser, difference: float) -> None:
    page = browser.new_page()
    page.add_script_tag(path=GEOMETRY)
    places = np.array(page.evaluate(f"() => branch({difference}, 400, 800)"))
    page.close()
    differences = np.hypot(places[:, 0] - 200, places[:, 1]) - np.hypot(places[:, 0] + 200, places[:, 1])
    np.testing.assert_allclose(differences, difference, atol=1e-6)
    assert np.hypot(*places.T).max() > 800


@pytest.fixture(scope="module")
def plan_page(keep_page: OpenPage) -> Page:
    page = keep_page("Sensor_lag")
    page.get_by_role("tab", name="From lag to metres").click()
    return page


def test_the_source_is_moved_by_mouse_and_keys_and_the_sensors_set_apart(plan_page: Page) -> None:
    page = plan_page
    plan = page.locator(".plan")
    said, stage = plan.locator(".said"), plan.locator(".stage")
    stage.scroll_into_view_if_needed()
    expect(said).to_contain_text("sensor 2 is")
    expect(said).to_contain_text("apart")
    expect(plan.locator("output")).to_have_text("567.3 m")
    plan.get_by_role("button", name="In line").click()
    expect(said).to_contain_text("567.3 m longer")
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
    expect(said).to_contain_text("567")
    plan.locator("input").focus()
    page.keyboard.press("Home")
    expect(plan.locator("output")).to_have_text("378.2 m")
    plan.get_by_role("button", name="In line").click()
    expect(said).to_contain_text(re.compile(r"378\.2\sm longer.*This is your lag\."))


def test_the_plan_fits_a_phone_in_the_dark(plan_page: Page) -> None:
    page = plan_page
    turned_dark(page, width=390)
    page.locator(".plan .stage").scroll_into_view_if_needed()
    page.locator(".plan").get_by_role("button", name="As far from both").click()
    expect(page.locator(".plan .said")).to_contain_text("the lag is 0")
    expect_fitting(page, 390)
    screenshot(page, "sensor-lag-plan-phone")
