"""A visitor's files and settings on the depth page: uploads, the doctor's remedies, searches, presets, links."""

from __future__ import annotations

import re

import numpy as np
import pytest
from ailing_pairs import ILLS
from playwright.sync_api import expect

from stereolag.assess.diagnosis import FindingCode
from stereolag.io.images import read_image
from tests.browser.depth_page import DEPTH_MAPS, DepthPage, OwnPair, example_files, number_in, picture_file
from tests.browser.visits import OpenPage, expect_visible


@pytest.fixture(scope="module")
def files_page(keep_page: OpenPage) -> DepthPage:
    """Return the page that waits for own files; its tests upload a ground truth last, because it stays."""
    visit = DepthPage(keep_page(DEPTH_MAPS + "square"))
    visit.open_head()
    visit.choose("Your own files")
    return visit


@pytest.fixture(scope="module")
def square_page(keep_page: OpenPage) -> DepthPage:
    return DepthPage.with_example(keep_page, "square")


def choose_side_by_side(visit: DepthPage) -> None:
    visit.open_head()
    if not visit.page.get_by_role("radio", name="One side-by-side image").is_checked():
        visit.choose("One side-by-side image")


# Files


def test_sizes_that_differ_by_a_few_pixels_are_cropped_and_said(files_page: DepthPage) -> None:
    files = example_files("square")
    visit = files_page
    visit.give("Left image", picture_file("left.png", read_image(files.left.data)[:200, :301]))
    visit.give("Right image", picture_file("right.png", read_image(files.right.data)[:202, :300]))
    expect_visible(visit.said("The images differ by a few pixels and were cropped to 300 × 200."))
    visit.give("Right image", picture_file("other.png", read_image(files.right.data)[:400, :300]))
    expect(visit.page.get_by_test_id("stAlertContentError")).to_contain_text("200")
    expect_visible(visit.said("cropped to 300 × 200"))
    visit.screenshot("cropped-light")


# Input doctor

REMEDIES = {
    "cube": {
        FindingCode.SWAPPED: ("look swapped", "Swap left and right"),
        FindingCode.EXPOSURE: ("ZNCC is unaffected", "Match the brightness"),
    },
    "motorcycle": {
        FindingCode.ROWS: ("in a rectified pair, rows match", "Align the rows"),
        FindingCode.ROTATION: ("the pair is not rectified", "Rectify"),
    },
}
"""The doctor's sentence about each faulty pair, and the button of its remedy."""


@pytest.mark.parametrize("source", REMEDIES)
def test_the_doctor_catches_mends_and_takes_back(
    files_page: DepthPage, source: str, request: pytest.FixtureRequest
) -> None:
    pair: OwnPair = example_files("cube") if source == "cube" else request.getfixturevalue("motorcycle")
    left, right = read_image(pair.left.data), read_image(pair.right.data)
    visit = files_page
    choose_side_by_side(visit)
    for ailment, (symptom, remedy) in REMEDIES[source].items():
        visit.give("Both images side by side", picture_file(f"{ailment}.png", np.hstack(ILLS[ailment](left, right))))
        found = visit.said(symptom)
        expect_visible(found)
        expect_visible(visit.said("Input doctor:"))
        ill = visit.number("Coverage", method=1)
        if source == "motorcycle":
            visit.screenshot(f"doctor-{source}-{ailment}-light")
        visit.page.get_by_role("button", name=remedy).click()
        undo = visit.page.get_by_role("button", name="Undo", exact=True)
        expect_visible(undo)
        visit.settle()
        expect(visit.page.get_by_text(symptom)).to_have_count(0)
        assert visit.number("Coverage", method=1) > ill
        undo.click()
        expect_visible(found)
        visit.settle()
        assert visit.number("Coverage", method=1) == ill


# Both views in one file


def test_one_picture_with_both_views_is_split_down_the_middle(files_page: DepthPage) -> None:
    files = example_files("square")
    both = np.hstack([read_image(files.left.data), read_image(files.right.data)])
    visit = files_page
    choose_side_by_side(visit)
    visit.give("Both images side by side", picture_file("both.png", both))
    expect_visible(visit.said("The image was split down the middle."))
    visit.give("Ground truth (optional)", files.truth)
    assert visit.number("Bad-2") < 20
    visit.screenshot("side-by-side-light")


# Suggest


def test_a_search_shows_its_progress_is_ended_and_taken_over(open_page: OpenPage) -> None:
    visit = DepthPage(open_page(DEPTH_MAPS + "cube&sgm.window_size=25"))
    visit.choose("Suggest")
    visit.page.get_by_role("radio", name="Semi-global", exact=True).last.click()
    visit.settle()
    visit.choose("60 s")
    visit.page.get_by_role("button", name="Suggest settings").click()
    expect(visit.page.get_by_test_id("stProgress")).to_contain_text(
        re.compile(r"[1-9][0-9]* tried. Yours: bad-2 [0-9.]+\s%")
    )
    visit.page.get_by_role("button", name="Cancel").click()
    said = visit.page.get_by_text("Bad-2 on the whole images")
    expect(said).to_contain_text("ended before it had tried everything")
    visit.settle()
    changes = {row[0]: row[2] for row in visit.frame(3)}
    visit.screenshot("suggest-light")
    visit.press("Use these settings")
    expect(visit.page.get_by_role("button", name="In use")).to_be_disabled()
    assert visit.value("Window") == float(changes.get("Window", 25))


# Presets, Reset, what does not apply, bounds


def test_presets_reset_controls_that_do_not_apply_and_settings_that_do_not_fit_together(square_page: DepthPage) -> None:
    visit = square_page
    first = visit.number("Bad-2")
    visit.page.locator("summary:visible").filter(has_text="More settings").first.click()
    check = visit.page.get_by_role("switch", name="Left-right check").or_(
        visit.page.get_by_role("checkbox", name="Left-right check")
    )
    expect(check.first).to_be_enabled()
    visit.press("The report’s")
    # A busy server may not have started to answer when the page looks idle.
    expect(visit.page.get_by_role("radio", name="Square", exact=True)).to_be_checked()
    visit.settle()
    assert (visit.value("Window"), visit.value("Search area")) == (20, 20)
    expect(check.first).to_be_disabled()
    visit.screenshot("report-light")
    before = visit.number("Bad-2")
    visit.move("Window", "End")
    expect(visit.page.get_by_test_id("stAlertContentError")).to_contain_text("101")
    assert visit.number("Bad-2") == before
    visit.screenshot("bounds-light")
    visit.press("Reset")
    assert visit.number("Bad-2") == first
    visit.press("Accurate")
    assert visit.number("Bad-2", method=1) < first
    visit.screenshot("accurate-light")


# Depth in 3-D


def test_the_room_is_shown_from_the_camera_and_from_above(square_page: DepthPage) -> None:
    visit = square_page
    visit.press("Reset")
    visit.open_head()
    visit.choose("1/4")
    visit.choose("In 3-D")
    said = visit.page.get_by_text("flying pixels, which hang")
    expect_visible(said)
    drawn, kept, farthest, flying = (
        float(one.replace(",", "")) for one in re.findall(r"[\d,]*\.?\d+", said.inner_text())
    )
    assert drawn == min(kept, 100_000)
    assert flying > 0
    cloud = visit.page.get_by_test_id("stPlotlyChart").nth(-2).locator(".js-plotly-plot")
    points = cloud.evaluate(
        "plot => { const points = plot._fullData[0]; return [points.x.length, ...['x', 'y', 'z'].map("
        "axis => points[axis].reduce((most, one) => Math.max(most, one), -1e9))]; }"
    )
    assert points[0] == drawn
    assert max(points[1:]) <= farthest * 1.01
    visit.screenshot(f"space-{visit.name}-light")
    visit.move("Nearest points shown", "PageDown")
    assert number_in(said.inner_text().split(" of ")[1]) < kept
