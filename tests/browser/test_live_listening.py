"""Live microphones in Chromium, their media made on the page from a seed; what is said of it: ``tests/app``."""

import re

import pytest
from playwright.sync_api import Page, expect

from tests.browser.axe import check
from tests.browser.visits import OpenPage, expect_visible, read_script, settled, turned_dark


@pytest.fixture(scope="module")
def page(keep_page: OpenPage) -> Page:
    """Return the page with the live microphones, which are not switched on yet."""
    page = keep_page("Sensor_lag?recordings=live")
    expect(page.locator(".listening .live-bar .state")).to_contain_text("nothing is recorded or sent")
    page.evaluate(read_script("microphones"))
    return page


def test_one_channel_alone_is_told_and_a_second_device_is_heard_beside_the_first(page: Page) -> None:
    said = page.locator(".listening .said")
    page.evaluate("fake.channels = 1")
    page.get_by_role("button", name="Listen", exact=True).click()
    expect(said).to_contain_text("One channel only")
    off = {"echoCancellation": False, "noiseSuppression": False, "autoGainControl": False}
    assert page.evaluate("fake.asked.at(-1)") == off | {"channelCount": {"ideal": 2}}

    page.evaluate("fake.channels = 2")
    page.get_by_label("Sensor 2").select_option("two")
    expect(said).to_contain_text("Two devices")
    expect(page.locator(".listening .place svg")).to_be_hidden()
    assert [one["deviceId"]["exact"] for one in page.evaluate("fake.asked.slice(-2)")] == ["one", "two"]
    check(page, "sensor-lag-live", only="[data-testid=stMain]")
    page.get_by_label("Sensor 2").select_option(index=0)  # one device again
    expect(page.locator(".listening .place svg")).to_be_visible()
    page.locator(".listening").get_by_role("button", name="Stop").click()


def test_a_lag_is_found_and_frozen(page: Page) -> None:
    page.evaluate(read_script("microphones"))
    lag, said = page.locator(".listening .lag"), page.locator(".listening .said")
    freeze = page.get_by_role("button", name="Freeze")
    expect(freeze).to_be_hidden()
    expect(page.locator("h2")).to_have_count(0)
    page.get_by_role("button", name="Listen", exact=True).click()
    expect(lag).to_have_text("37 samples")
    expect(said).to_contain_text("after sensor 1: its path is")
    expect(page.locator(".listening")).to_have_class(re.compile(r"\bon\b"))
    expect(page.locator(".listening .needle")).not_to_have_attribute("transform", re.compile(r"^rotate\(0 "))

    page.get_by_role("spinbutton", name="Speed of the wave").fill("666")
    page.keyboard.press("Enter")
    expect(said).to_contain_text(re.compile(r"path is 0\.(56|51)\sm longer"))  # at 44.1 or 48 kHz
    assert len(page.evaluate("fake.asked")) == 1

    freeze.click()
    expect_visible(page.get_by_role("heading", name=re.compile(r"37\.00 ± 0\.01 samples\) after sensor 1")))
    expect_visible(page.get_by_role("tab", name="Take away"))
    expect(page.get_by_text("channel 2 of 2")).to_have_count(1)
    expect(page.locator(".listening")).to_have_class(re.compile(r"\bon\b"))  # still listening
    page.locator(".listening").get_by_role("button", name="Stop").click()
    expect(page.locator(".listening")).not_to_have_class(re.compile(r"\bon\b"))
    assert page.evaluate(
        "fake.streams.every(({ destination }) => destination.stream.getTracks()[0].readyState === 'ended')"
    )
    settled(page)
    turned_dark(page, width=390)
