"""The match under the pointer: the browser's result equals the library's explanation and needs no round trip."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, expect

from stereolag.assess.explaining import explain_match
from stereolag.core.inputs import as_grey
from stereolag.pair import example_pair
from stereolag.samples import stereo_pairs
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.stereo.windows.search import SearchArea
from stereolag.ui.depth.explaining import show_inspection
from stereolag.ui.depth.maps import DepthView
from stereolag.ui.hovered_match import browser_settings
from tests.browser.parts import Parts, ShowParts
from tests.browser.visits import expect_fitting, screenshot, turned_dark

SCORING = Path(__file__).resolve().parents[2] / "stereolag" / "ui" / "hovered_match" / "scoring.js"

EXPLAIN = """
(asked) => {
  const { settings, rows, cols, left, right, deviation, pixels } = JSON.parse(asked);
  const pair = { rows, cols, left: Uint8Array.from(left), right: Uint8Array.from(right), deviation };
  return JSON.stringify(pixels.map(([row, col]) => {
    const seen = explained(pair, settings, row, col);
    return { ...seen, scores: [...seen.scores].map((score) => (Number.isNaN(score) ? null : score)) };
  }));
}
"""

ROWS, COLS = slice(240, 370), slice(180, 430)
PIXELS = [[65, 120], [60, 200], [90, 150], [5, 3], [100, 230], [30, 100]]


@pytest.fixture(scope="module")
def blank_page(browser: Browser) -> Iterator[Page]:
    page = browser.new_page()
    page.add_script_tag(path=SCORING)
    yield page
    page.close()


@pytest.mark.parametrize(
    "settings",
    [
        {"window_size": 15, "search": SearchArea.rectified(64)},
        {"window_size": 16, "overlap": 0.5, "search": SearchArea.rectified(48, 4, vertical=2)},
        {"window_size": 15, "search": SearchArea.centred(61)},
        {"window_size": 20, "search": SearchArea.centred(20)},
        {"window_size": 11, "search": SearchArea.rectified(64), "score": "ncc"},
        {"window_size": 11, "search": SearchArea.rectified(40), "score": "cross"},
    ],
    ids=str,
)
def test_the_browser_finds_what_the_library_explains(blank_page: Page, settings: dict[str, Any]) -> None:
    matcher = CorrelationMatcher(**settings)
    left, right = (np.ascontiguousarray(as_grey(image)[ROWS, COLS]) for image in both("fence"))
    asked = {
        "settings": browser_settings(matcher, left, right),
        "rows": left.shape[0],
        "cols": left.shape[1],
        "left": left.ravel().tolist(),
        "right": right.ravel().tolist(),
        "deviation": float(left.std()),
        "pixels": PIXELS,
    }
    # As JSON, because Playwright inspects every number separately.
    found = json.loads(blank_page.evaluate(EXPLAIN, json.dumps(asked)))
    for (row, col), seen in zip(PIXELS, found, strict=True):
        expected = explain_match(matcher, left, right, row, col)
        scale = max(1.0, abs(expected.peak_score))
        scores = np.array(seen["scores"], dtype=float).reshape(expected.surface.shape)
        np.testing.assert_allclose(scores / scale, expected.surface / scale, atol=1e-4)
        assert seen["kind"] == expected.kind
        assert lag(seen["peak"]) == expected.peak
        assert lag(seen["runnerUp"]) == expected.runner_up
        assert seen["contrast"] == pytest.approx(expected.contrast)


def both(name: str) -> tuple[np.ndarray, np.ndarray]:
    pair = example_pair(stereo_pairs()[name])
    return pair.left, pair.right


def lag(found: dict[str, int] | None) -> tuple[int, int] | None:
    return (found["dy"], found["dx"]) if found else None


@pytest.fixture(scope="module")
def fence(show_parts: ShowParts) -> Parts:
    pair, matcher = example_pair(stereo_pairs()["fence"]), CorrelationMatcher(window_size=15)
    view = DepthView(pair, {"Convolution": matcher.compute(pair.left, pair.right)}, 0, 64)
    parts = show_parts(lambda: show_inspection(view))
    parts.page.locator(".curve .scores").wait_for()
    return parts


def test_the_search_follows_the_pointer_the_keys_and_leaves_again(fence: Parts) -> None:
    page = fence.page
    reading, frames = page.locator(".hovered .reading"), page.locator(".viewport").nth(1).locator("svg path[stroke]")
    expect(frames).not_to_have_count(0)
    chosen = reading.text_content()
    framed = [frame.get_attribute("d") for frame in frames.all()]
    picture = page.locator(".viewport").first
    box = picture.bounding_box()
    assert box is not None
    picture.hover(position={"x": box["width"] * 303.5 / 640, "y": box["height"] * 332.5 / 480})
    expect(reading).to_have_text(re.compile(r"^Row 33\d, column 30\d: two peaks as good as each other"))
    expect(reading).to_contain_text("true place 26.50 px")
    places = [int(found) for found in re.findall(r"(?:best|runner-up) (\d+)\spx", reading.text_content() or "")]
    assert abs(abs(places[0] - places[1]) / 14.5 % 1 - 0.5) > 0.4  # a whole number of pickets apart
    expect(page.locator(".strip .frame")).to_have_count(3)
    assert [frame.get_attribute("d") for frame in frames.all()] != framed
    screenshot(page, "depth-hovered-fence-light")

    page.get_by_role("application").focus()
    page.keyboard.press("ArrowRight")
    expect(reading).to_have_text(re.compile(r"^Row 33\d, column 30\d"))
    page.mouse.move(2, 2)
    page.get_by_role("application").blur()
    expect(reading).to_have_text(str(chosen))
    assert [frame.get_attribute("d") for frame in frames.all()] == framed
    assert fence.sent() == []


def test_a_click_still_asks_for_the_whole_explanation(fence: Parts) -> None:
    page = fence.page
    turned_dark(page, width=420)
    assert "Two places fit almost equally well" not in fence.said()
    picture = page.locator(".viewport").first
    box = picture.bounding_box()
    assert box is not None
    picture.click(position={"x": box["width"] * 303.5 / 640, "y": box["height"] * 332.5 / 480})
    fence.answer()
    assert "Two places fit almost equally well" in fence.said()
    page.mouse.move(2, 2)
    page.get_by_role("application").blur()
    expect(page.locator(".hovered .reading")).to_have_text(re.compile(r"^Row 33\d, column 30\d: two peaks"))
    screenshot(page, "depth-hovered-fence-phone")
    expect_fitting(page, 420)
