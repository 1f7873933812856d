"""The page Rocketman search with a camera that films a moving sign: followed and frozen."""

import math

import pytest
from playwright.sync_api import Page, expect

from tests.browser.axe import check
from tests.browser.parts import box_of
from tests.browser.visits import OpenPage, read_script, screenshot, settled, turned_dark


@pytest.fixture(scope="module")
def page(keep_page: OpenPage) -> Page:
    """Open the page with a camera in its browser."""
    page = keep_page("Rocketman_search?picture=live")
    page.evaluate(read_script("moving_scene"))
    return page


def test_it_is_cut_with_keys_and_the_method_acts_at_once(page: Page) -> None:
    expect(page.locator(".following .state")).to_contain_text("Nothing is recorded")
    panel = page.locator(".following")
    panel.get_by_role("button", name="Start").click()
    expect(panel.get_by_role("button", name="Follow the box")).to_be_visible()
    stage = panel.locator(".stage")
    for key in ("ArrowLeft", "Shift+ArrowDown", "+", "Enter"):
        stage.press(key)
    expect(panel.locator(".figures")).to_contain_text("Score")
    page.get_by_role("radio", name="Sampled").click()  # acts on the running picture, whose pixels change with the light
    expect(panel.locator("strong")).to_have_text("Lost")
    panel.get_by_role("button", name="Stop").click()
    page.get_by_role("radio", name="FFT").click()
    settled(page)


def test_a_sign_is_followed_until_it_is_covered_or_gone_found_again_and_a_frame_is_frozen(page: Page) -> None:
    panel = page.locator(".following")
    panel.get_by_role("button", name="Start").click()
    expect(panel.get_by_role("button", name="Follow the box")).to_be_visible()
    expect(panel.get_by_role("button", name="Freeze")).to_be_disabled()
    screenshot(page)
    canvas = panel.locator("canvas")
    canvas.scroll_into_view_if_needed()
    box = box_of(canvas)
    first, side, cols = page.evaluate("[scene.placeAt(0), scene.SIDE, scene.COLS]")
    scale = box["width"] / cols
    corners = [
        (box["x"] + (first["col"] + away) * scale, box["y"] + (first["row"] + away) * scale)
        for away in (-side / 2, side / 2)
    ]
    page.mouse.move(*corners[0])
    page.mouse.down()
    page.mouse.move(*corners[1], steps=4)
    page.mouse.up()
    expect(panel.get_by_role("status").nth(1)).to_have_text("Found")
    page.wait_for_function("scene.number === scene.LAST", polling=200)  # at every frame, it would have each drawn
    told, last, (leaving, back) = page.evaluate("[scene.told, scene.LAST, scene.AWAY]")
    assert {one["number"] for one in told} >= set(range(last))
    assert not [one for one in told if one["error"]]
    for one in told:
        if one["place"] is not None:
            away = math.dist(*([at["row"], at["col"]] for at in (one["place"], one["truth"])))
            assert away < 2.5 and not one["unseen"], one
    assert all(one["state"] == "lost" for one in told if one["unseen"])
    whole = [one for one in told if not one["unseen"] and not leaving - 5 <= one["number"] < back + 5]
    states = [one["state"] for one in whole]
    assert states.count("found") > 0.9 * len(states)
    check(page, "Rocketman search: a sign is followed")
    turned_dark(page, width=390)

    panel.get_by_role("button", name="Freeze").click()
    settled(page)
    for said in ("The frame you froze is in use.", "Your cut-out from the camera’s picture is in use."):
        expect(page.get_by_text(said)).to_be_attached()
    expect(page.get_by_role("heading", name="Found at row")).to_be_visible()
    screenshot(page)
