"""The outlines of the left image over the maps, in a browser."""

from __future__ import annotations

from dataclasses import replace

from playwright.sync_api import expect

from stereolag.figures.pictures import edge_path
from stereolag.stereo.opencv import StereoBM
from stereolag.ui.depth.comparing import show_comparison
from tests.app.depth_view import small_view
from tests.browser.parts import ShowParts, redrawn
from tests.browser.visits import screenshot, turned_dark


def test_outlines_lie_over_the_maps_follow_the_zoom_and_go(show_parts: ShowParts) -> None:
    plain = small_view()
    outlined = replace(plain, outlines=edge_path(plain.pair.left))
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
    expect(path).to_have_attribute("d", outlined.outlines)
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
    screenshot(page, "depth-outlines-light")
    turned_dark(page, width=420)
    expect(page.locator(".outlines")).to_have_count(4)
    screenshot(page, "depth-outlines-dark")
    parts.hand_over(lambda: show_comparison(plain))
    expect(page.locator(".outlines")).to_have_count(0)
