"""The depth page as a visitor's: own files, values in metres, a sweep, files taken away, links and sessions.

What each part says of a pair is tested without a browser, in ``tests/app``.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import expect

from stereolag.io.calibrations import read_calibration
from tests.browser.depth_page import DepthPage, Given, OwnPair, choose_cell
from tests.browser.visits import OpenPage, expect_visible, file_of, screenshot, settled


@pytest.fixture(scope="module")
def motorcycle(data_dir: Path) -> OwnPair:
    """Return a pair of real photographs with ground truth and calibration."""
    folder = data_dir / "stereo" / "motorcycle_q"
    return OwnPair(*(Given.of(folder / name) for name in ("left.png", "right.png", "gt.pfm", "calib.json")))


@pytest.fixture(scope="module")
def own_page(keep_page: OpenPage, motorcycle: OwnPair) -> DepthPage:
    return DepthPage.with_files(keep_page, motorcycle)


def test_own_files_are_measured_in_metres_and_resized_with_all_that_belongs_to_them(
    own_page: DepthPage, motorcycle: OwnPair
) -> None:
    visit = own_page
    expect(visit.page.get_by_text("Until both images are here")).to_have_count(0)
    known = read_calibration(motorcycle.calibration.data)
    disparities, error = visit.value("Disparities searched"), visit.number("EPE")
    assert visit.number("Bad-2") < 35
    visit.choose("Values")
    expect(visit.paragraph("Metric")).to_contain_text(f"{known.focal_px:.6g} px × {known.baseline_m:.4g} m")
    visit.screenshot("inputs-light")

    visit.open_head()
    visit.choose("1/2")
    expect_visible(visit.said("Shown at 1/2 of its size: 370 × 248 of 741 × 497 pixels."))
    assert visit.value("Disparities searched") == disparities / 2
    assert visit.number("EPE") < 0.75 * error
    expect(visit.paragraph("Metric")).to_contain_text(f"{known.focal_px / 2:.6g} px × {known.baseline_m:.4g} m")
    visit.choose("Automatic")
    assert visit.number("EPE") == pytest.approx(error, rel=0.1)  # a window of 11 px becomes 6 and then 12


def test_a_click_on_a_cell_of_the_sweep_takes_its_settings_over(open_page: OpenPage) -> None:
    visit = DepthPage.with_example(open_page, "cube")
    visit.choose("Sweep")
    visit.page.get_by_role("radio", name="StereoBM").last.click()
    visit.settle()
    for name, values in (("Block: values", "9, 15, 21"), ("Disparities searched: values", "32, 64")):
        box = visit.page.get_by_label(name)
        box.fill(values)
        box.press("Enter")
        visit.settle()
    visit.press("Sweep 6 combinations")
    expect_visible(visit.said("Right: bad-2, %, lower is better."))
    chart = visit.page.get_by_test_id("stPlotlyChart").last
    bad = chart.locator(".js-plotly-plot").evaluate("plot => [...plot._fullData[0].z].map(row => [...row])")
    assert np.shape(bad) in {(2, 3), (3, 2)}
    visit.screenshot(f"sweep-{visit.name}-light")
    for scheme in ("dark", "light"):  # its charts are drawn in dark too
        visit.page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
        expect(visit.page.get_by_test_id("stApp")).to_have_css("color-scheme", scheme)
        visit.settle()
    row, col = np.unravel_index(np.argmin(bad), np.shape(bad))
    choose_cell(chart, int(row), int(col))
    visit.settle()
    assert visit.number("Bad-2", method=1) == pytest.approx(np.min(bad), abs=0.06)


# Links and sessions

ADDRESS = "Depth_maps?pair=square&size=1/2&maps=bm,sgbm&bm.block_size=13&sgbm.mode=hh"
OTHER_ADDRESS = "Depth_maps?pair=square&window_size=31&bm.block_size=9"


def test_a_link_opens_the_page_as_it_was_and_one_zip_whatever_the_page_shows(open_page: OpenPage) -> None:
    before = DepthPage(open_page(ADDRESS))
    before.press("Colours")
    before.choose("Turbo")
    before.page.keyboard.press("Escape")
    before.settle()
    bad = [before.number("Bad-2", method=method) for method in range(2)]
    before.unfold("Take it away")
    expect_visible(before.said("All files are for the images at full size, 480 × 480 pixels."))
    data = before.download("Session ZIP")
    assert before.download("Settings JSON").count(b'"block_size": 25') == 1  # for the full-size images
    address, own_map = before.download_from("NPY", exact=True)

    after = DepthPage(open_page(OTHER_ADDRESS))
    lead_there_and_back(after)
    after.open_head()
    after.choose("Your own files")
    box = after.page.get_by_test_id("stFileUploader").filter(has_text="Left image").locator("input[type=file]")
    box.set_input_files(file_of("stereolag-session.zip", data))
    expect(after.slider("Block")).to_have_value("13")
    after.settle()
    after.open_head()
    expect_visible(after.said("240 × 240 of 480 × 480 pixels"))
    assert [after.number("Bad-2", method=method) for method in range(2)] == bad
    after.choose("StereoSGBM")
    after.unfold("More settings")
    expect(after.page.get_by_role("radio", name="8", exact=True)).to_be_checked()
    after.press("Colours")
    expect(after.page.get_by_role("radio", name="Turbo", exact=True)).to_be_checked()
    screenshot(after.page, "restored")
    after.page.keyboard.press("Escape")
    after.unfold("Take it away")
    # The same result for two visitors has the same bytes, but an address that the other visitor's does not reveal.
    other_address, same_map = after.download_from("NPY", exact=True)
    assert same_map == own_map
    assert other_address != address


def lead_there_and_back(visit: DepthPage) -> None:
    """Change the settings of a link, go back to them, and reset them."""
    page = visit.page
    window, block = page.get_by_role("slider", name="Window"), page.get_by_role("slider", name="Block")
    expect(window).to_have_value("31")
    page.get_by_role("radio", name="StereoBM").click()
    expect(block).to_have_value("9")
    page.get_by_role("radio", name="Convolution").click()
    page.get_by_role("button", name="Fast").click()
    expect(window).to_have_value("11")
    expect(page).to_have_url(re.compile("pair=square&window_size=11.*left_right=on.*bm.block_size=9"))
    settled(page)
    page.go_back()
    expect(window).to_have_value("31")
    settled(page)
    page.get_by_role("button", name="Reset").click()
    expect(window).to_have_value("20")
    expect(page).to_have_url(re.compile(r"Depth_maps\?pair=square$"))
    settled(page)
