"""A template dragged by hand over a picture: the browser's products, and the scores painted at the visited places."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, expect

from stereolag.templates import match_template
from stereolag.templates.by_hand import ReducedSearch, reduced_search
from stereolag.ui.pictures import example_pictures
from stereolag.ui.search.by_hand import search_by_hand
from stereolag.ui.search.score_map import packed, show_score_map
from tests.browser.parts import Parts, Show, ShowParts, redrawn, sent
from tests.browser.visits import expect_fitting, screenshot, turned_dark

SCORING = Path(__file__).resolve().parents[2] / "stereolag" / "ui" / "search" / "by_hand" / "scoring.js"

COMPARE = """
(asked) => {
  const { picture, template, counts, places } = JSON.parse(asked);
  const sought = prepared({ ...template, data: Uint8ClampedArray.from(template.data) }, Uint8Array.from(counts));
  const scene = { ...picture, data: Uint8ClampedArray.from(picture.data) };
  return JSON.stringify(places.map(([row, col]) => {
    const { score, products } = compared(scene, sought, row, col);
    return { score: Number.isNaN(score) ? null : score, products: [...products] };
  }));
}
"""

MAZE = (1526, 2446)
ROCKETMAN = (123, 111)


@pytest.fixture(scope="module")
def blank_page(browser: Browser) -> Iterator[Page]:
    page = browser.new_page()
    page.add_script_tag(path=SCORING)
    yield page
    page.close()


def compared(page: Page, search: ReducedSearch, places: list[tuple[int, int]]) -> list[dict[str, object]]:
    def told(pixels: np.ndarray) -> dict[str, object]:
        data = np.dstack([pixels, np.full(pixels.shape[:2], 255, dtype=np.uint8)])
        return {"rows": pixels.shape[0], "cols": pixels.shape[1], "data": data.ravel().tolist()}

    counts = search.opaque.ravel().astype(int).tolist()
    asked = {"picture": told(search.picture), "template": told(search.template), "counts": counts, "places": places}
    # As JSON, because Playwright inspects every number separately.
    return json.loads(page.evaluate(COMPARE, json.dumps(asked)))  # type: ignore[no-any-return]


@pytest.mark.parametrize("name", ["maze", "maze_dulled"])
def test_the_browser_scores_as_the_library_does(blank_page: Page, name: str) -> None:
    inputs = example_pictures(name)
    search = reduced_search(inputs.picture, inputs.template, inputs.mask, pixels=40_000)
    rows, cols = search.score_map.shape
    random = np.random.default_rng(0)
    chosen = [(int(random.integers(rows)), int(random.integers(cols))) for _ in range(200)]
    places = [(0, 0), (rows - 1, cols - 1), search.leaders()[0][:2], *chosen]
    found = compared(blank_page, search, places)
    expected = [search.score_map[place] for place in places]
    np.testing.assert_allclose([one["score"] for one in found], expected, atol=2e-6)
    np.testing.assert_allclose([np.mean(one["products"]) for one in found], expected, atol=2e-6)
    assert len(found[0]["products"]) == np.count_nonzero(search.opaque)


def test_a_flat_window_has_no_score(blank_page: Page) -> None:
    picture = np.full((30, 40, 3), 77, dtype=np.uint8)
    picture[10:, 20:] = np.random.default_rng(0).integers(0, 256, (20, 20, 3))
    search = reduced_search(picture, picture[12:20, 22:32], None)
    flat, found = compared(blank_page, search, [(0, 0), (12, 22)])
    assert np.isnan(search.score_map[0, 0]) and flat["score"] is None
    assert found["score"] == pytest.approx(1)


def painted(page: Page) -> float:
    """Return the fraction of the score map that is drawn."""
    share = page.locator(".by-hand .map canvas").evaluate("""canvas => {
      const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
      return data.filter((value, at) => at % 4 === 3 && value).length / (data.length / 4);
    }""")
    return float(share)


def drag_to(page: Page, row: float, col: float) -> None:
    """Drag the template until its top-left pixel is near a place in the image."""
    picture, held = (page.locator(f".by-hand .{name}").bounding_box() for name in ("stage", "held"))
    assert picture is not None and held is not None
    scale = picture["width"] / MAZE[1]
    centre = held["x"] + held["width"] / 2, held["y"] + held["height"] / 2
    page.mouse.move(*centre)
    page.mouse.down()
    end = picture["x"] + col * scale + held["width"] / 2, picture["y"] + row * scale + held["height"] / 2
    page.mouse.move(*end, steps=6)
    page.mouse.up()


def touch_to(page: Page, row: float, col: float) -> None:
    """Drag the template with a finger until its top-left pixel is near a place in the image."""
    picture, held = (page.locator(f".by-hand .{name}").bounding_box() for name in ("stage", "held"))
    assert picture is not None and held is not None
    scale = picture["width"] / MAZE[1]
    start = held["x"] + held["width"] / 2, held["y"] + held["height"] / 2
    end = picture["x"] + col * scale + held["width"] / 2, picture["y"] + row * scale + held["height"] / 2
    finger = page.context.new_cdp_session(page)
    path = [
        (start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1])) for share in (0, 0.3, 0.7, 1)
    ]
    for number, (x, y) in enumerate(path):
        kind = "touchMove" if number else "touchStart"
        finger.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [{"x": x, "y": y}]})
    finger.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    finger.detach()


def searched(name: str) -> Show:
    """Return a function that draws the score map of an example with the search by hand below it, as the page does."""
    inputs = example_pictures(name)
    result = match_template(inputs.picture, inputs.template, mask=inputs.mask)
    assert result.score_map is not None
    scores = packed(result.score_map, result.matches)

    def show() -> None:
        show_score_map(scores)
        search_by_hand(inputs, result.matches)

    return show


@pytest.fixture(scope="module")
def search(show_parts: ShowParts) -> Parts:
    return show_parts(searched("maze"))


def test_he_is_found_by_hand_with_the_mouse_and_the_keys(search: Parts) -> None:
    page = search.page
    stage, where = page.locator(".by-hand .stage"), page.locator(".by-hand .where")
    expect(where).to_contain_text("Row")
    stage.scroll_into_view_if_needed()
    assert painted(page) < 0.001
    drag_to(page, 528, 982)
    expect(where).to_have_text(re.compile(r"^Row 5[23]\d, column 9[789]\d: "))
    assert 0.002 < painted(page) < 0.05
    found = re.match(r"Row (\d+), column (\d+)", where.text_content() or "")
    assert found is not None
    for there, here, keys in (
        (528, int(found[1]), ("ArrowUp", "ArrowDown")),
        (982, int(found[2]), ("ArrowLeft", "ArrowRight")),
    ):
        for _ in range(abs(there - here) // 4):
            stage.press(keys[here < there])
    expect(where).to_have_text("Row 528, column 982: 1.000")
    expect(page.locator(".by-hand .score")).to_have_text("1.000")
    stage.press("Shift+ArrowDown")
    expect(where).to_contain_text("Row 568, column 982")
    assert page.locator(".by-hand .leaders button").count() == 0

    page.locator(".by-hand .reveal").press("Enter")
    expect(page.locator(".by-hand .said")).to_have_text(
        "The peak is at row 528, column 982: 1.000. At this scale the best rival reaches 0.563."
    )
    assert painted(page) == 1
    leaders = page.locator(".by-hand .leaders button")
    expect(leaders).to_have_text(
        [re.compile(f"{said}.$") for said in ("Peak 1.00", "Rival 0.5[56]", "Rival 0.4[23]", "Rival 0.3[56]")]
    )
    leaders.nth(1).click()
    expect(page.locator(".by-hand .score")).to_have_text(re.compile(r"^0\.5[56]\d$"))
    drawn = "canvas => new Set(canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data).size"
    assert leaders.first.locator("canvas").evaluate(drawn) > 50
    screenshot(page, "rocketman-by-hand")
    page.locator(".by-hand .clear").click()
    expect(leaders).to_have_count(0)
    expect(page.locator(".by-hand .said")).to_be_empty()  # cleared in the frame that redraws the score map
    assert painted(page) < 0.001

    score_map = page.locator(".by-hand .map")
    box = score_map.bounding_box()
    assert box is not None
    scale = box["width"] / (MAZE[1] - ROCKETMAN[1])
    score_map.click(position={"x": 300 * scale, "y": 200 * scale})
    expect(where).to_have_text(re.compile(r"^Row (19|20)\d, column (29|30)\d: "))
    assert sent(page) == []


def test_the_score_map_is_read_under_the_pointer_and_compared_on_a_click(search: Parts) -> None:
    page = search.page
    stage, reading = page.locator(".score-map .stage"), page.locator(".score-map .reading")
    where = page.locator(".by-hand .where")
    expect(where).to_contain_text("Row")
    expect(reading).to_have_text("Hover to read a score; click to compare that place below.")
    stage.scroll_into_view_if_needed()
    box = stage.bounding_box()
    assert box is not None
    scale = box["width"] / (MAZE[1] - ROCKETMAN[1] + 1)
    him = {"x": 982.5 * scale, "y": 528.5 * scale}
    stage.hover(position=him)
    expect(reading).to_have_text("Row 528, column 982: score 1.000")
    stage.hover(position={"x": 642.5 * scale, "y": 1376.5 * scale})
    expect(reading).to_have_text(re.compile(r"^Row 137\d, column 64\d: score 0"))
    stage.click(position=him)
    expect(where).to_have_text("Row 528, column 982: 1.000")
    stage.press("ArrowDown")
    expect(reading).to_have_text(re.compile(r"^Row 53\d, column 98\d: score \d"))
    stage.press("Enter")
    expect(where).to_have_text(re.compile(r"^Row 53\d, column 98\d: \d"))
    page.mouse.move(2, 2)
    expect(reading).to_have_text(re.compile(r"^Row 53\d"))
    assert sent(page) == []


def test_it_can_be_done_in_dark_and_on_a_phone_by_touch(search: Parts) -> None:
    page = search.page
    turned_dark(page, width=420)
    with redrawn(page.locator(".score-map canvas")), redrawn(page.locator(".by-hand .window canvas")):
        search.hand_over(searched("maze_dulled"))
    page.locator(".by-hand .stage").scroll_into_view_if_needed()
    touch_to(page, 1048, 1707)
    expect(page.locator(".by-hand .where")).to_contain_text(re.compile(r"Row 10[3456]\d, column 1[67]\d\d"))
    assert painted(page) > 0.01  # the template slid and the page did not scroll
    assert page.locator(".by-hand .stage").evaluate("stage => getComputedStyle(stage).touchAction") == "pan-y"
    page.locator(".by-hand .reveal").click()
    expect(page.locator(".by-hand .said")).to_contain_text(re.compile(r"row 1048, column 1707: 0\.8[01]\d"))
    expect_fitting(page, 420)
    screenshot(page, "rocketman-by-hand-phone")
