"""The panels of the page Rocketman search alone, used with mouse, keys and fingers; their formulas: ``tests/web``."""

import re
from functools import partial

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from stereolag.core.arrays import Box
from stereolag.core.inputs import Image
from stereolag.core.searches import TemplateQuery
from stereolag.templates import match_template
from stereolag.ui.search.inputs import box_in, example_pictures, painted_mask
from stereolag.ui.search.parts import drag_it, show_funnel
from stereolag.ui.uploads import Upload
from tests.browser.axe import check
from tests.browser.parts import Parts, Show, ShowParts, box_of, drag, redrawn, sent
from tests.browser.visits import expect_fitting, resized, screenshot, turned_dark

MAZE = (1526, 2446)
ROCKETMAN = (123, 111)

# The template dragged over the image


def painted(page: Page) -> float:
    """Return the fraction of the score map that is drawn."""
    share = page.locator(".by-hand .map canvas").evaluate("""canvas => {
      const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
      return data.filter((value, at) => at % 4 === 3 && value).length / (data.length / 4);
    }""")
    return float(share)


def drag_to(page: Page, row: float, col: float, *, finger: bool = False) -> None:
    """Drag the template until its top-left pixel is near a place in the image."""
    picture, held = (box_of(page.locator(f".by-hand .{name}")) for name in ("stage", "held"))
    scale = picture["width"] / MAZE[1]
    (x, y), half = (held["x"], held["y"]), (held["width"] / 2, held["height"] / 2)
    end = picture["x"] + col * scale, picture["y"] + row * scale
    path = [(x + share * (end[0] - x), y + share * (end[1] - y)) for share in (0, 0.3, 0.7, 1)]
    drag(page, *((x + half[0], y + half[1]) for x, y in path), finger=finger)


def searched(name: str) -> Show:
    """Return a function that draws the search by hand of an example with the score map below it, as the page does."""
    inputs = example_pictures(name)
    result = match_template(inputs.picture, inputs.template, mask=inputs.mask)
    return partial(drag_it, inputs, result, TemplateQuery())


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

    stage, reveal = (box_of(page.locator(f".by-hand .{name}")) for name in ("stage", "reveal"))
    assert reveal["y"] + reveal["height"] <= stage["y"] + stage["height"]  # beside the picture, not below the fold
    page.locator(".by-hand .reveal").press("Enter")
    expect(page.locator(".by-hand .said")).to_have_text(
        "The peak is at row 528, column 982: 1.000. The best rival reaches 0.384."
    )
    assert painted(page) == 1
    leaders = page.locator(".by-hand .leaders button")
    expect(leaders).to_have_text(
        [re.compile(f"{said}.$") for said in ("Peak 1.00", "Rival 0.38", "Rival 0.2[0-9]", "Rival 0.2[0-9]")]
    )
    leaders.nth(1).click()
    expect(page.locator(".by-hand .score")).to_have_text("0.384")
    assert leaders.first.locator("img").evaluate("image => image.naturalWidth") > 50
    screenshot(page)
    page.locator(".by-hand .clear").click()
    expect(leaders).to_have_count(0)
    expect(page.locator(".by-hand .said")).to_be_empty()  # cleared in the frame that redraws the score map
    assert painted(page) < 0.001

    assert sent(page) == []


def test_the_score_map_is_read_under_the_pointer_and_compared_on_a_click(search: Parts) -> None:
    page = search.page
    stage, reading = page.locator(".score-map .stage"), page.locator(".score-map .reading")
    where = page.locator(".by-hand .where")
    expect(where).to_contain_text("Row")
    expect(reading).to_have_text("Hover to read a score; click to compare that place above.")
    stage.scroll_into_view_if_needed()
    box = box_of(stage)
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


def test_the_search_by_hand_can_be_done_in_dark_and_on_a_phone_by_touch(search: Parts) -> None:
    page = search.page
    turned_dark(page, width=420)
    with redrawn(page.locator(".score-map canvas")), redrawn(page.locator(".by-hand .window canvas")):
        search.hand_over(searched("maze_dulled"))
    page.locator(".by-hand .stage").scroll_into_view_if_needed()
    drag_to(page, 1048, 1707, finger=True)
    expect(page.locator(".by-hand .where")).to_contain_text(re.compile(r"Row 10[3456]\d, column 1[67]\d\d"))
    assert painted(page) > 0.01  # the template slid and the page did not scroll
    assert page.locator(".by-hand .stage").evaluate("stage => getComputedStyle(stage).touchAction") == "pan-y"
    page.locator(".by-hand .reveal").click()
    expect(page.locator(".by-hand .said")).to_contain_text(re.compile(r"row 1048, column 1707: 0\.7[56]\d"))
    expect_fitting(page, 420)


# The steps of "sampled"


def dots(page: Page) -> int:
    """Return the number of marked pixels in the picture."""
    marked = page.locator(".funnel .picture .dots")
    return len(re.findall("M", marked.get_attribute("d") or "")) if marked.count() else 0


def test_the_steps_lead_from_all_pixels_to_him_and_another_pixel_can_be_picked(show_parts: ShowParts) -> None:
    inputs = {name: example_pictures(name) for name in ("maze", "maze_dulled")}
    query = TemplateQuery(method="sampled")
    result = match_template(inputs["maze"].picture, inputs["maze"].template, method="sampled", seed=0)
    steps = show_parts(lambda: show_funnel(inputs["maze"], result, query))
    page = steps.page
    buttons, said = page.locator(".funnel .steps button"), page.locator(".funnel .said")
    bars, colour = page.locator(".funnel .bars"), page.locator(".funnel .colour")
    expect(buttons).to_have_text(["All pixels3,732,596", "This colour24", "Both ends agree1", "Best1"])
    bars.scroll_into_view_if_needed()
    assert dots(page) == 0
    for step, count in ((1, 24), (2, 1), (3, 9)):
        buttons.nth(step).press("Enter")
        expect(buttons.nth(step)).to_have_attribute("aria-pressed", "true")
        assert dots(page) == count
    expect(said).to_contain_text("scored: 9 places. Best: row 528, column 982, score 1.000.")
    expect(page.locator(".funnel .picture .place")).to_have_count(1)

    bars.press("ArrowRight")
    expect(colour).to_contain_text("85 pixels of its colour")
    expect(buttons.nth(3)).to_have_text("Best1")
    assert dots(page) == 27
    bars.press("End")
    expect(bars).to_have_attribute("aria-valuenow", "24")
    expect(buttons.nth(1)).to_have_text("This colour390,413")
    expect(said).to_contain_text("Too many to draw")
    buttons.nth(1).click()
    expect(said).to_contain_text("600 of them are drawn")
    screenshot(page)

    box = box_of(bars)
    bars.click(position={"x": box["width"] * 2.5 / 24, "y": 60})
    expect(bars).to_have_attribute("aria-valuenow", "3")
    template = page.locator(".funnel .template")
    box = box_of(template)
    template.click(position={"x": box["width"] * 67.5 / 111, "y": box["height"] * 55.5 / 123})
    expect(colour).to_have_text("Row 55, column 67 of the template: 24 pixels of its colour")
    assert sent(page) == []

    turned_dark(page, width=420)
    steps.hand_over(lambda: show_funnel(inputs["maze_dulled"], result, query))
    expect(buttons.nth(2)).not_to_have_text("Both ends agree1")
    buttons.nth(3).click()
    expect(said).not_to_contain_text("score 1.00")
    expect_fitting(page, 420)
    check(page, "funnel", only="main")


# A box and a brush


class Cut:
    """The box over the maze, and the boxes that Python received from it, the latest last."""

    def __init__(self, show_parts: ShowParts) -> None:
        self.taken: list[Box] = []
        self._picture = example_pictures("maze").picture
        self.parts: Parts = show_parts(self.show)

    def show(self) -> None:
        self.taken.append(box_in(self._picture, digest="maze", shared=True, key="cut"))

    def found(self) -> list[int]:
        """Return the box in Python once it has received the change; the box on the page must not move."""
        before = box(self.parts.page)
        self.parts.answer()
        assert box(self.parts.page) == before
        last = self.taken[-1]
        return [last.row, last.col, last.width, last.height]


@pytest.fixture(scope="module")
def cut(show_parts: ShowParts) -> Cut:
    return Cut(show_parts)


def box(page: Page) -> list[int]:
    """Return row, column, width and height as shown below the image."""
    return [int(one.input_value()) for one in page.locator(".cutting input").all()]


def drag_on(page: Page, *places: tuple[float, float], finger: bool = False) -> None:
    """Drag from one (row, col) in the image to another."""
    stage = box_of(page.locator(".cutting .stage"))
    scale = stage["width"] / MAZE[1]
    drag(page, *((stage["x"] + col * scale, stage["y"] + row * scale) for row, col in places), finger=finger)


def test_a_finger_moves_the_box(cut: Cut) -> None:
    page = cut.parts.page
    turned_dark(page, width=420)
    assert box(page) == [636, 1070, 305, 254]
    touch = page.context.new_cdp_session(page)
    touch.send("Emulation.setTouchEmulationEnabled", {"enabled": True})
    drag_on(page, (760, 1220), (850, 1370), (940, 1520), (1060, 1720), finger=True)
    row, col, width, height = box(page)
    assert (width, height) == (305, 254)
    assert np.allclose([row, col], [936, 1570], atol=25)  # a pixel of this screen covers six of the image
    assert cut.found() == box(page)
    expect_fitting(page, 420)
    touch.send("Emulation.setTouchEmulationEnabled", {"enabled": False})
    touch.detach()
    page.emulate_media(color_scheme="light")
    resized(page, 1280)


def test_a_box_is_dragged_typed_and_moved_with_keys(cut: Cut) -> None:
    page = cut.parts.page
    drag_on(page, (400, 700), (560, 940))  # a new one
    row, col, width, height = box(page)
    assert np.allclose([row, col, width, height], [400, 700, 240, 160], atol=4)
    assert cut.found() == [row, col, width, height]
    drag_on(page, (480, 820), (580, 1020))  # moved
    assert np.allclose(box(page), [row + 100, col + 200, width, height], atol=4)
    assert cut.found() == box(page)
    row, col, width, height = box(page)
    drag_on(page, (row + height, col + width), (row + height - 60, col + width - 90))  # by a corner
    assert np.allclose(box(page), [row, col, width - 90, height - 60], atol=4)
    assert cut.found() == box(page)
    drag_on(page, (row + 10, col + 10), (-300, -300))  # it stops at the edge
    assert box(page)[:2] == [0, 0]
    assert cut.found() == box(page)
    stage, heard = page.locator(".cutting .stage"), len(cut.parts.sent())
    for key in ("ArrowRight", "Shift+ArrowDown", "ArrowRight", "ArrowUp", "+"):
        stage.press(key)
    assert box(page)[:2] == [8, 1]
    page.wait_for_function("(heard) => sent.length > heard", arg=heard)
    assert cut.found() == box(page)
    assert len(cut.parts.sent()) == heard + 1  # once the keys are at rest
    for name, value in (("row", 528), ("col", 982), ("width", 111), ("height", 99_999)):
        number = page.locator(f".cutting input[name={name}]")
        number.fill(str(value))
        number.press("Tab")
    assert box(page) == [0, 982, 111, 1526]  # as high as the image allows
    number = page.locator(".cutting input[name=height]")
    number.fill("2")
    number.press("Tab")
    assert box(page) == cut.found() == [0, 982, 111, 4]
    cut.parts.hand_over(lambda: None)
    expect(page.locator(".cutting")).to_have_count(0)
    cut.parts.hand_over(cut.show)
    assert box(page) == [0, 982, 111, 4]  # kept


def test_a_painted_mask_is_used_when_it_is_asked_for(show_parts: ShowParts) -> None:
    inputs = example_pictures("maze")
    masks: list[Upload[Image] | None] = []
    parts = show_parts(lambda: masks.append(painted_mask(inputs.template, inputs.mask, digest="maze", key="painted")))
    page = parts.page
    use, counts = page.get_by_role("button", name="Use this mask"), page.locator(".painting .counts")
    stage = page.locator(".painting .stage")
    expect(counts).to_have_text("7,913 of 13,653 pixels count")  # where Rocketman is opaque
    expect(use).to_be_disabled()
    place = box_of(stage)
    corners = ((0.3, 0.3), (0.5, 0.45), (0.7, 0.6))
    drag(page, *((place["x"] + x * place["width"], place["y"] + y * place["height"]) for x, y in corners))
    expect(counts).not_to_have_text("7,913 of 13,653 pixels count")
    painted = counts.inner_text()
    assert sent(page) == []
    use.click()
    parts.answer()
    assert masks[-1] is not None
    assert painted == f"{np.count_nonzero(masks[-1].content):,} of 13,653 pixels count"
    expect(counts).to_have_text(painted)
    expect(use).to_be_disabled()
    page.get_by_role("button", name="Erase").click()
    for key in ("Shift+ArrowUp", " "):
        stage.press(key)
    expect(counts).not_to_have_text(painted)
    assert int(counts.inner_text().split()[0].replace(",", "")) > np.count_nonzero(masks[-1].content)
    page.get_by_role("button", name="Start over").click()
    page.get_by_role("button", name="Paint", exact=True).click()
    page.get_by_label("Diameter of the brush, px").fill("1")
    stage.focus()
    between = place["x"] + place["width"] * 55 / 111, place["y"] + place["height"] * 60 / 123
    page.mouse.move(*between)  # four pixels
    page.keyboard.press(" ")
    expect(counts).to_have_text("7,912 of 13,653 pixels count")
    page.get_by_role("button", name="Start over").click()
    expect(counts).to_have_text("7,913 of 13,653 pixels count")
    use.click()
    parts.answer()
    assert masks[-1] is None  # the template's own mask again
    expect(counts).to_have_text("7,913 of 13,653 pixels count")
    expect(use).to_be_disabled()
