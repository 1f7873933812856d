"""The pictures under one crosshair and the match under the pointer alone, used with mouse and keys."""

import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import pairwise

import pytest
from playwright.sync_api import Locator, Page, Position, expect

from stereolag import CorrelationMatcher, StereoBM, samples
from stereolag.figures.legends import Colours
from stereolag.figures.pictures import edge_path
from stereolag.pair_sources import example_pair
from stereolag.ui.depth.comparing import show_comparison
from stereolag.ui.depth.distances import show_readout
from stereolag.ui.depth.explaining import show_blanks, show_inspection
from stereolag.ui.depth.view import DepthView
from tests.app.depth_view import small_view
from tests.browser.axe import check
from tests.browser.parts import Parts, ShowParts, box_of, redrawn, sent
from tests.browser.visits import expect_fitting, resized, screenshot, turned_dark

OpenPart = Callable[[str], Parts]


SHOWN: dict[str, Callable[[DepthView], None]] = {
    "comparison": show_comparison,
    "readout": show_readout,
    "inspection": show_inspection,
    "blanks": show_blanks,
}


@pytest.fixture(scope="module")
def open_part(show_parts: ShowParts) -> Callable[[str], Parts]:
    """Return a function that gives a part of the depth page on a small pair, opened on first use."""
    view = small_view()

    @cache
    def opened(part: str) -> Parts:
        parts = show_parts(lambda: SHOWN[part](view))
        parts.page.locator("figure").first.wait_for()
        return parts

    return opened


def point(picture: Locator, across: float, down: float) -> Position:
    box = box_of(picture)
    return {"x": box["width"] * across, "y": box["height"] * down}


def hover(picture: Locator, across: float, down: float) -> None:
    picture.hover(position=point(picture, across, down))


def reading(page: Page, title: str) -> Locator:
    return page.locator("figure", has=page.get_by_text(title, exact=True)).locator(".reading")


@pytest.mark.parametrize("part", ["readout", "blanks"])  # the others: on their page, and below
def test_every_part_is_whole_in_the_dark_and_on_a_phone(open_part: OpenPart, part: str) -> None:
    page = open_part(part).page
    check(page, part, only="main")
    turned_dark(page, width=390)
    resized(page, 1280)
    screenshot(page)
    page.emulate_media(color_scheme="light")


def test_a_readout_follows_the_cursor_under_every_map_and_two_clicks_measure(open_part: OpenPart) -> None:
    parts = open_part("readout")
    page = parts.page
    left = page.locator(".viewport").first
    hover(left, 0.503, 0.503)
    expect(page.locator(".where")).to_have_text("row 80, column 140")
    expect(reading(page, "Ground truth")).to_have_text(re.compile(r"^\d+\.\d\d\spx · 0\.\d+\sm$"))
    expect(reading(page, "StereoSGBM")).to_have_text(re.compile(r"^\d+\.\d\d\spx · 0\.\d+ ±\s0\.\d+\sm$"))
    assert page.locator("svg .cross").count() == page.locator(".viewport").count()
    hover(left, 0.01, 0.5)
    expect(reading(page, "StereoBM")).to_have_text("no disparity: out of frame")
    assert parts.sent() == []

    left.click(position=point(left, 0.5, 0.6))
    parts.answer()
    assert "A: depth" in parts.said()
    left.click(position=point(left, 0.7, 0.2))
    parts.answer()
    assert "A to B" in parts.said()
    expect(page.locator(".viewport").first.locator("svg text")).to_have_text(["A", "B"])
    screenshot(page)


def test_all_pictures_zoom_and_move_together(open_part: OpenPart) -> None:
    page = open_part("comparison").page
    views = page.locator(".viewport svg")
    whole = "0 0 280 160"
    expect(views.first).to_have_attribute("viewBox", whole)
    page.get_by_role("button", name="Zoom in").click()
    zoomed = views.first.get_attribute("viewBox")
    assert zoomed != whole
    assert {view.get_attribute("viewBox") for view in views.all()} == {zoomed}
    picture = page.locator(".viewport").nth(1)
    hover(picture, 0.5, 0.5)
    page.mouse.down()
    hover(picture, 0.3, 0.4)
    page.mouse.up()
    moved = views.first.get_attribute("viewBox")
    assert moved not in (zoomed, whole)
    assert {view.get_attribute("viewBox") for view in views.all()} == {moved}
    picture.dblclick(position=point(picture, 0.5, 0.5))
    expect(views.first).to_have_attribute("viewBox", whole)
    resized(page, 980)  # two legends in a row, which they fill
    ticks = [box_of(one) for one in page.locator(".ticks.two span").all()]
    assert all(one["x"] + one["width"] < following["x"] for one, following in pairwise(ticks)), ticks
    resized(page, 1280)
    screenshot(page)


def test_before_and_after_needs_no_rerun(open_part: OpenPart) -> None:
    page = open_part("comparison").page
    page.emulate_media(color_scheme="dark")
    page.get_by_role("button", name="Before / after").click()
    page.get_by_label("Image on the left", exact=True).select_option("StereoBM")
    page.get_by_label("Image on the right").select_option("Ground truth")
    expect(page.locator("figcaption")).to_have_text("StereoBMGround truth")
    split = page.get_by_role("slider", name="Share of the image on the left")
    split.fill("25")
    expect(page.locator(".layer").nth(1)).to_have_css("clip-path", "inset(0px 0px 0px 25%)")
    hover(page.locator(".viewport"), 0.5, 0.5)
    expect(page.locator(".reading").last).to_have_text(re.compile(r"px · 0\.\d+\sm$"))
    assert sent(page) == []
    screenshot(page)
    page.get_by_role("button", name="Side by side").click()


def test_the_keyboard_moves_the_crosshair_and_picks(open_part: OpenPart) -> None:
    parts = open_part("inspection")
    page = parts.page
    page.get_by_role("application").focus()
    for key in ("Shift+ArrowRight", "ArrowRight", "ArrowUp"):
        page.keyboard.press(key)
    expect(page.locator(".where")).to_have_text("row 79, column 151")
    page.keyboard.press("Enter")
    assert [one["value"] for one in parts.sent()] == [{"row": 79, "col": 151}]
    parts.answer()
    window = {"row": 72, "col": 144, "height": 15, "width": 15}
    framed = page.evaluate("[...stereolagItems.values()].flatMap(({ item }) => item.marks ?? [])")
    assert window in [{name: mark[name] for name in window} for mark in framed]
    page.get_by_role("application").blur()
    expect(page.locator(".viewport").first.locator("svg path[d='M144 72h15v15h-15z']")).not_to_have_count(0)
    screenshot(page)


# Outlines


def test_outlines_lie_over_the_maps_follow_the_zoom_and_go(show_parts: ShowParts) -> None:
    plain = small_view()
    outlined = replace(plain, colours=replace(plain.colours, outlines=edge_path(plain.pair.left)))
    parts = show_parts(lambda: show_comparison(plain))
    page = parts.page
    over = {
        title: page.locator("figure", has=page.get_by_text(title, exact=True)).locator(".outlines")
        for title in ("Left image", "Convolution", "StereoBM", "StereoSGBM", "Ground truth", "Agreement")
    }
    expect(page.locator("figure")).to_have_count(7)
    expect(page.locator(".outlines")).to_have_count(0)
    parts.hand_over(lambda: show_comparison(outlined))
    for title, outlines in over.items():
        expect(outlines).to_have_count(int(title not in {"Left image", "Agreement"}))  # a photograph gets none
    expect(page.locator(".outlines")).to_have_count(4)
    path = over["StereoBM"].locator("path.outline")
    expect(path).to_have_attribute("d", outlined.colours.outlines)
    path.evaluate("(path) => { path.kept = true; }")
    pair = plain.pair
    map_shown = page.locator("figure", has=page.get_by_text("StereoBM", exact=True)).locator("canvas")
    other = StereoBM(num_disparities=64, block_size=31).compute(pair.left, pair.right)
    changed = replace(outlined, results={**plain.results, "StereoBM": other})
    with redrawn(map_shown):
        parts.hand_over(lambda: show_comparison(changed))
    assert path.evaluate("(path) => path.kept")  # not redrawn with the map

    page.get_by_role("button", name="Zoom in").click()
    zoomed = page.locator(".viewport > svg").first.get_attribute("viewBox")
    assert zoomed != "0 0 280 160"
    expect(over["Convolution"]).to_have_attribute("viewBox", str(zoomed))
    turned_dark(page, width=420)
    expect(page.locator(".outlines")).to_have_count(4)
    parts.hand_over(lambda: show_comparison(plain))
    expect(page.locator(".outlines")).to_have_count(0)


# The match under the pointer


def test_the_search_follows_the_pointer_and_the_keys_leaves_again_and_a_click_explains_all(show_parts):
    pair, matcher = example_pair(samples.stereo_pairs()["fence"]), CorrelationMatcher(window_size=15)
    view = DepthView(pair, {"Convolution": matcher.compute(pair.left, pair.right)}, Colours(0, 64))
    fence = show_parts(lambda: show_inspection(view))
    page = fence.page
    page.locator(".curve .scores").wait_for()
    reading, frames = page.locator(".hovered .reading"), page.locator(".viewport").nth(1).locator("svg path[stroke]")
    expect(frames).not_to_have_count(0)
    chosen = reading.text_content()
    framed = [frame.get_attribute("d") for frame in frames.all()]
    picture = page.locator(".viewport").first
    picture.hover(position=point(picture, 303.5 / 640, 332.5 / 480))
    expect(reading).to_have_text(re.compile(r"^Row 33\d, column 30\d: two peaks as good as each other"))
    expect(reading).to_contain_text("true place 26.50 px")
    places = [int(found) for found in re.findall(r"(?:best|runner-up) (\d+)\spx", reading.text_content() or "")]
    assert abs(abs(places[0] - places[1]) / 14.5 % 1 - 0.5) > 0.4  # a whole number of pickets apart
    expect(page.locator(".strip .frame")).to_have_count(3)
    assert [frame.get_attribute("d") for frame in frames.all()] != framed
    screenshot(page)

    page.get_by_role("application").focus()
    page.keyboard.press("ArrowRight")
    expect(reading).to_have_text(re.compile(r"^Row 33\d, column 30\d"))
    page.mouse.move(2, 2)
    page.get_by_role("application").blur()
    expect(reading).to_have_text(str(chosen))
    assert [frame.get_attribute("d") for frame in frames.all()] == framed
    assert fence.sent() == []

    turned_dark(page, width=420)
    assert "Two places fit almost equally well" not in fence.said()
    picture.click(position=point(picture, 303.5 / 640, 332.5 / 480))
    fence.answer()
    assert "Two places fit almost equally well" in fence.said()
    page.mouse.move(2, 2)
    page.get_by_role("application").blur()
    expect(reading).to_have_text(re.compile(r"^Row 33\d, column 30\d: two peaks"))
    expect_fitting(page, 420)
