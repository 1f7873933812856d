"""Arrows turned back by hand: the browser's sums, and the curve drawn at the visited lags."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, expect

from stereolag import samples
from stereolag.io.recordings import read_signal
from stereolag.signals import phasors
from stereolag.ui.lag.phasors import described, show_phasors
from stereolag.ui.recordings import example_recordings
from tests.browser.parts import ShowParts, sent
from tests.browser.visits import expect_fitting, screenshot, turned_dark

CHAIN = Path(__file__).resolve().parents[2] / "stereolag" / "ui" / "lag" / "phasors" / "chain.js"


def coast() -> phasors.Phasors:
    example = samples.recordings()["coast"]
    first, second = (read_signal(path).channels[0] for path in (example.signal_1, example.signal_2))
    found = phasors.common_stretch("coast", first, second, example.lag)
    assert found is not None
    return found


EXAMPLES = {"knock": phasors.knock, "coast": coast, "tone": phasors.tone, "noise": phasors.noise}


@pytest.fixture(scope="module")
def blank_page(browser: Browser) -> Iterator[Page]:
    page = browser.new_page()
    page.add_script_tag(path=CHAIN)
    yield page
    page.close()


@pytest.mark.parametrize("name", EXAMPLES)
@pytest.mark.parametrize("whiten", [False, True])
def test_the_chain_of_the_browser_ends_where_numpy_correlates(blank_page: Page, name: str, whiten: bool) -> None:
    found, page = EXAMPLES[name](), blank_page
    example = described(found, **{"try": ""})
    # As JSON, because Playwright inspects every number separately.
    all_of_it = "([example, whiten]) => JSON.stringify(measuredChains(example, whiten))"
    told = json.loads(page.evaluate(all_of_it, [example, whiten]))
    places = page.evaluate(
        "(example) => Array.from({length: placesOf(example)}, (_, at) => lagAt(at, example))", example
    )
    highest = "([reaches, example]) => lagAt(highestReaches({ reaches }, example)[0], example)"
    best = page.evaluate(highest, [told["reaches"], example])
    lags, heights = phasors.correlation(found, whiten=whiten)
    np.testing.assert_array_equal(places, lags)
    np.testing.assert_allclose(told["reaches"], heights, atol=2e-5)
    assert best == {"knock": 4, "coast": 4, "tone": -1}.get(name, lags[heights.argmax()])
    arrows = np.diff(told["chains"], axis=1)
    np.testing.assert_allclose(np.hypot(*arrows.T), np.tile(told["lengths"], (97, 1)).T, atol=1e-9)
    if whiten:
        heard = np.array(told["lengths"]) > 0
        np.testing.assert_allclose(np.array(told["lengths"])[heard], 1 / heard.sum())


def painted(page: Page) -> int:
    """Return the number of lags at which the curve is drawn."""
    drawn = page.locator(".phasors .curve").get_attribute("d") or ""
    return len(re.findall("[ML]", drawn))


def drag(page: Page, drawing: str, *points: tuple[float, float]) -> None:
    """Press at the first of these points, in fractions of the drawing's size, and release at the last."""
    found = page.locator(f".phasors .{drawing}")
    found.evaluate("drawing => drawing.scrollIntoView({ block: 'center' })")
    box = found.bounding_box()
    assert box is not None
    for number, (x, y) in enumerate(points):
        page.mouse.move(box["x"] + x * box["width"], box["y"] + y * box["height"], steps=4)
        if not number:
            page.mouse.down()
    page.mouse.up()


@pytest.fixture(scope="module")
def arrows_page(show_parts: ShowParts) -> Page:
    pair = example_recordings("coast")
    return show_parts(lambda: show_phasors(pair, None, key="lag.phasors"), moving=True).page


def test_the_arrows_line_up_at_the_true_lag_with_keyboard_and_mouse(arrows_page: Page) -> None:
    page = arrows_page
    root = page.locator(".phasors")
    slider, where, said = (root.locator(f".{name}") for name in ("lag", "where", "said"))
    slider.scroll_into_view_if_needed()
    expect(where).to_have_text(re.compile(r"^Lag 0 · correlation "))
    assert painted(page) == 1
    slider.focus()
    for _ in range(16):
        page.keyboard.press("ArrowRight")
    expect(where).to_have_text("Lag 4 · correlation 1.00")
    expect(slider).to_have_attribute("aria-valuetext", "Lag 4 · correlation 1.00")
    assert painted(page) == 17
    assert root.locator(".arrow").count() > 50  # of 62; the others are shorter than a pixel
    edges = root.locator(".arrow").evaluate_all(
        "all => all.map(one => one.getBoundingClientRect()).flatMap(({ top, bottom }) => [top, bottom])"
    )
    assert max(edges) - min(edges) < 8  # straight
    page.keyboard.press("End")
    expect(where).to_contain_text("Lag 12 ·")
    assert painted(page) == 18  # the jump skipped the others
    page.keyboard.press(" ")
    expect(said).to_contain_text("the chain is straight")
    expect(where).to_contain_text("Lag 4 ·")
    assert painted(page) == 97
    expect(root.locator(".peak")).to_have_count(1)

    page.emulate_media(reduced_motion="reduce")  # playing it once is enough
    root.get_by_role("button", name="Coast, up close").click()
    expect(where).to_contain_text("Lag 0 (50,070 in the recordings)")
    assert painted(page) == 1
    drag(page, "lags", (0.01, 0.5), (0.99, 0.5))
    expect(slider).to_have_value("12")
    assert painted(page) == 97
    drag(page, "phases", (0.4, 0.6), (0.5, 0.2), (0.97, 0.15))  # two turns at half a turn per sample
    expect(slider).to_have_value(re.compile(r"3\.5|3\.75|4|4\.25|4\.5"))
    root.locator(".play").click()
    expect(where).to_have_text("Lag 4 (50,082 in the recordings) · correlation 0.99")
    expect(said).to_contain_text("The peak is broad")
    root.locator(".whiten").check()
    expect(where).to_have_text("Lag 4 (50,082 in the recordings) · whitened correlation 0.88")
    expect(said).to_contain_text("needle")
    root.locator(".clear").click()
    expect(said).to_have_text("")
    assert sent(page) == []


def test_it_reads_in_dark_and_on_a_phone_without_motion(arrows_page: Page) -> None:
    page = arrows_page
    page.emulate_media(reduced_motion="reduce")
    turned_dark(page, width=420)
    root = page.locator(".phasors")
    root.get_by_role("button", name="One tone").click()
    root.locator(".play").click()
    expect(root.locator(".where")).to_have_text("Lag −1 · correlation 1.00", timeout=2500)  # animated, it takes 3 s
    expect(root.locator(".peak")).to_have_count(5)
    expect_fitting(page, 420)
    screenshot(page, "sensor-lag-phasors-phone")
