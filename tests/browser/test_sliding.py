"""A cut slid by hand over a recording: the browser's products, and the curve painted at the visited lags."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.lib.stride_tricks import sliding_window_view
from playwright.sync_api import Browser, Page, expect

from stereolag.signals import by_hand
from stereolag.ui.lag.sliding import slide_it_yourself
from tests.browser.parts import ShowParts, sent
from tests.browser.visits import expect_fitting, screenshot, turned_dark

PRODUCTS = Path(__file__).resolve().parents[2] / "stereolag" / "ui" / "lag" / "sliding" / "products.js"

EXAMPLES = {
    "Seven numbers": by_hand.seven_numbers,
    "Pure tone": by_hand.tone,
    "Unrelated noise": by_hand.noise,
    "Loud stretch": by_hand.loud_stretch,
}


@pytest.fixture(scope="module")
def blank_page(browser: Browser) -> Iterator[Page]:
    page = browser.new_page()
    page.add_script_tag(path=PRODUCTS)
    yield page
    page.close()


@pytest.mark.parametrize("name", EXAMPLES)
@pytest.mark.parametrize("normalise", [False, True])
def test_the_browser_multiplies_as_numpy_does(blank_page: Page, name: str, normalise: bool) -> None:
    slide = EXAMPLES[name]()
    example = {"cut": slide.cut.tolist(), "recording": slide.recording.tolist()}
    # As JSON, because Playwright inspects every number separately.
    all_of_it = "([example, normalise]) => JSON.stringify(measured(example, normalise))"
    found = json.loads(blank_page.evaluate(all_of_it, [example, normalise]))
    windows = sliding_window_view(slide.recording, slide.cut.size)
    expected = [np.corrcoef(window, slide.cut)[0, 1] for window in windows] if normalise else windows @ slide.cut
    np.testing.assert_allclose(found["sums"], expected, atol=1e-9)
    np.testing.assert_allclose(np.sum(found["products"], axis=1), expected, atol=1e-9)


def test_silence_has_no_correlation(blank_page: Page) -> None:
    found = blank_page.evaluate("() => measured({ cut: [1, -1], recording: [0.1, 0.1, 0.1, 2] }, true).sums")
    assert found == pytest.approx([0.0, 0.0, -1.0])


def painted(page: Page) -> int:
    """Return the number of lags at which the curve is drawn."""
    drawn = page.locator(".sliding .curve").get_attribute("d") or ""
    return len(re.findall("[ML]", drawn))


def drag_to(page: Page, sample: float, *, of: int, start: float) -> None:
    """Drag the cut from one sample of recording 2 to another."""
    box = page.locator(".sliding svg").bounding_box()
    assert box is not None
    pitch = (box["width"] - 64) / of
    for way, place in (("down", start), ("up", sample)):
        page.mouse.move(box["x"] + 6 + (place + 0.5) * pitch, box["y"] + 60, steps=4)
        getattr(page.mouse, way)()


@pytest.fixture(scope="module")
def slides_page(show_parts: ShowParts) -> Page:
    return show_parts(lambda: slide_it_yourself(key="lag.sliding"), moving=True).page


def test_the_curve_grows_where_one_has_been_and_play_paints_the_rest(slides_page: Page) -> None:
    page = slides_page
    stage, where = page.locator(".sliding .stage"), page.locator(".sliding .where")
    said = page.locator(".sliding .said")
    expect(where).to_have_text("Lag 0 · sum 10")
    stage.scroll_into_view_if_needed()
    drag_to(page, 11, of=20, start=3)
    expect(where).to_have_text("Lag 8 · sum 72")
    assert painted(page) == 9
    assert page.locator(".sliding .peak").count() == 0
    stage.press("ArrowRight")
    expect(where).to_have_text("Lag 9 · sum −18")
    stage.press("End")
    expect(where).to_have_text("Lag 13 · sum 27")
    assert painted(page) == 11  # the jump skipped three
    expect(said).to_have_text("")
    stage.press(" ")
    expect(where).to_have_text("Lag 8 · sum 72")
    expect(said).to_contain_text("peak is at lag 8")
    assert painted(page) == 14
    expect(page.locator(".sliding .peak")).to_have_count(1)
    expect(stage).to_have_attribute("aria-valuenow", "8")

    page.emulate_media(reduced_motion="reduce")  # playing it once is enough
    page.get_by_role("button", name="Loud stretch").click()
    expect(where).to_contain_text("Lag 0 ·")
    assert painted(page) == 1
    page.locator(".sliding .play").click()
    expect(said).to_contain_text("loud stretch wins")
    page.locator(".sliding .normalise").check()
    expect(said).to_contain_text("lag 90, reaches 1")
    stage.press("Home")
    stage.press("Shift+ArrowRight")
    expect(where).to_contain_text(re.compile(r"^Lag 10 · correlation "))
    page.locator(".sliding .clear").click()
    expect(said).to_have_text("")
    assert sent(page) == []


def test_it_reads_in_dark_and_on_a_phone(slides_page: Page) -> None:
    page = slides_page
    turned_dark(page, width=390)
    page.get_by_role("button", name="Pure tone").click()
    page.locator(".sliding .play").click()
    expect(page.locator(".sliding .peak")).to_have_count(10)
    expect_fitting(page, 390)
    screenshot(page, "sensor-lag-sliding-phone")
