"""Every task of the depth page, done as a visitor would, on an example or on an own pair."""

from __future__ import annotations

import io
import re
import zipfile
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import expect
from ply_reader import read_ply

from stereolag.geometry.scene import SeenPoint, distance_between
from stereolag.io.calibrations import read_calibration
from stereolag.io.disparities import read_disparity
from stereolag.io.images import read_image
from stereolag.stereo.evaluation import evaluate
from stereolag.stereo.methods import METHODS
from stereolag.stereo.opencv import StereoBM
from tests.browser.depth_page import DepthPage, Given, OwnPair, choose_cell, example_files, number_in
from tests.browser.visits import OpenPage, expect_fitting, expect_visible, resized
from tests.programs import run_program_alone

EXAMPLE, OWN = "cube", "motorcycle"


@pytest.fixture(scope="module")
def example_page(keep_page: OpenPage) -> DepthPage:
    return DepthPage.with_example(keep_page, EXAMPLE)


@pytest.fixture(scope="module")
def own_page(keep_page: OpenPage, motorcycle: OwnPair) -> DepthPage:
    return DepthPage.with_files(keep_page, motorcycle)


@pytest.fixture
def visit(request: pytest.FixtureRequest) -> DepthPage:
    """Return the page with the pair that a test names: an example, or an own pair if its files are present."""
    page: DepthPage = request.getfixturevalue("example_page" if request.param == EXAMPLE else "own_page")
    page.press("Reset")
    return page


@pytest.fixture
def pair(request: pytest.FixtureRequest) -> OwnPair:
    """Return the files of the pair that `visit` shows."""
    shown = request.node.callspec.params["visit"]
    files: OwnPair = example_files(EXAMPLE) if shown == EXAMPLE else request.getfixturevalue("motorcycle")
    return files


# Inputs


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


# Compare


@pytest.mark.parametrize("visit", [OWN], indirect=True)
def test_maps_are_compared_in_one_locked_range_under_one_crosshair(visit: DepthPage, pair: OwnPair) -> None:
    truth = read_disparity(pair.truth.data)
    row, col = 240, 420
    visit.choose("Compare")
    visit.hover("Left image", row, col)
    legend = visit.pictures.locator(".legends")
    colours = legend.inner_text()
    assert re.search(r"FAR\s+\d+\s", colours)
    found, true = number_in(visit.reading("Convolution")), number_in(visit.reading("Ground truth"))
    assert true == pytest.approx(truth[row, col], abs=0.01)
    assert number_in(visit.reading("Convolution − Ground truth")) == pytest.approx(found - true, abs=0.02)
    crosses = visit.pictures.locator("svg .cross")
    assert crosses.count() == visit.pictures.locator(".viewport").count() == 8
    expect_visible(visit.page.get_by_text("All 4 methods agree to 1 px on"))
    visit.screenshot(f"compare-{visit.name}-light")

    visit.move("Window", "End")
    assert visit.value("Window") == 101
    assert legend.inner_text() == colours
    visit.pick("Minus", "StereoSGBM")
    expect_visible(visit.figure("Convolution − StereoSGBM"))

    visit.pictures.get_by_role("button", name="Before / after").click()
    visit.pictures.get_by_label("Image on the right").select_option("Ground truth")
    visit.pictures.get_by_role("slider", name="How much of the image on the left").fill("30")
    expect(visit.pictures.locator(".layer").nth(1)).to_have_css("clip-path", "inset(0px 0px 0px 30%)")
    visit.screenshot(f"before-after-{visit.name}-light")


# Value under the cursor


@pytest.mark.parametrize("visit", [OWN], indirect=True)
def test_values_are_read_and_two_clicks_and_a_known_distance_give_metres(visit: DepthPage, pair: OwnPair) -> None:
    truth, known = read_disparity(pair.truth.data), read_calibration(pair.calibration.data)
    height, width = truth.shape
    a, b = (300, 330), (250, 420)
    visit.choose("Values")
    visit.hover("Ground truth", *a)
    disparity, metres = map(number_in, visit.reading("Ground truth").split(" · "))
    assert disparity == pytest.approx(truth[a], abs=0.01)
    assert metres == pytest.approx(known.depth(truth[a]), rel=0.01)
    expect(visit.figure("Convolution").locator(".reading")).to_have_text(
        re.compile(r"^\d+\.\d\d\spx · \d+\.\d+ ±\s\d+\.\d+\sm · score \d\.\d\d$")
    )

    visit.click("Left image", *a)
    visit.click("Left image", *b)
    expect_visible(visit.page.get_by_text("A to B"))
    apart = distance_between(
        known, SeenPoint(*a, float(truth[a])), SeenPoint(*b, float(truth[b])), width=width, height=height
    )
    assert number_in(visit.table()["Ground truth"][-1]) == pytest.approx(apart.metres, rel=0.01)
    visit.screenshot(f"values-{visit.name}-light")
    resized(visit.page, 390)
    expect_fitting(visit.page, 390)  # its table is wider
    resized(visit.page, 1280)

    found = number_in(visit.table()["StereoSGBM"][2])
    visit.page.get_by_label("Distance of B from the camera, m").fill("2.5")
    visit.page.keyboard.press("Enter")
    visit.settle()
    visit.pick("Disparity there by", "StereoSGBM")
    visit.press("Use this distance")
    product = visit.paragraph("Metric").inner_text().rpartition("=")[2]
    assert number_in(product) == pytest.approx(2.5 * (found + known.doffs_px), rel=0.002)
    assert number_in(visit.table()["StereoSGBM"][3]) == pytest.approx(2.5, abs=0.01)
    visit.screenshot(f"known-distance-{visit.name}-light")
    visit.press("Forget this distance")
    expect_visible(visit.said("from the pair’s calibration"))


# Why this match?


LESSONS = {
    "A clear match": "One clear peak",
    "A pattern that repeats": "the pattern repeats",
    "A bare wall": "A bare wall",
}


@pytest.mark.parametrize("visit", [EXAMPLE], indirect=True)
def test_a_click_explains_a_match_and_the_buttons_find_walls_and_fences(visit: DepthPage, pair: OwnPair) -> None:
    truth = read_disparity(pair.truth.data)
    row, col = 250, 420
    visit.choose("Why this match?")
    visit.choose("From above")  # without a graphics card, drawing the surface takes seconds
    visit.click("Left image: point at it, or click", row, col)
    expect(visit.pictures.locator(".where")).to_have_text(f"row {row}, column {col}")
    assert number_in(visit.table()["Ground truth"][0]) == pytest.approx(truth[row, col], abs=0.01)
    verdict = visit.page.get_by_text("the ground truth is")
    expect(verdict).to_contain_text(f"the ground truth is {truth[row, col]:.2f} px")
    visit.screenshot(f"why-{visit.name}-light")
    said = visit.page.get_by_test_id("stAlertContainer").last
    for lesson, finding in LESSONS.items():
        visit.press(lesson)
        expect(said).to_contain_text(finding)


# Why is it blank?


@pytest.mark.parametrize("visit", [OWN], indirect=True)
def test_blank_pixels_have_a_reason_and_the_shares_add_up(visit: DepthPage) -> None:
    coverage = [visit.number("Coverage", method=method) for method in (0, 1)]
    visit.choose("Why blank?")
    visit.hover("StereoBM", 240, 8)
    assert visit.reading("StereoBM") == "out of frame"
    chart = visit.page.get_by_test_id("stPlotlyChart").last.locator(".js-plotly-plot")
    shares = np.array(
        chart.evaluate("plot => plot._fullData.filter(one => !one.name.includes('filled')).map(one => [...one.x])")
    )
    assert 100 - shares.sum(axis=0)[:2] == pytest.approx(coverage, abs=0.51)
    visit.screenshot(f"blank-{visit.name}-light")


# Scoreboard


@pytest.mark.parametrize("visit", [EXAMPLE], indirect=True)
def test_the_scoreboard_says_what_the_evaluation_says(visit: DepthPage, pair: OwnPair) -> None:
    truth = read_disparity(pair.truth.data)
    visit.choose("Scoreboard")
    matcher = StereoBM(num_disparities=int(visit.value("Disparities searched")))
    judged = evaluate(matcher.compute(read_image(pair.left.data), read_image(pair.right.data)).disparity, truth)
    rows = {first: [float(one) for one in others] for first, *others in visit.frame(8)}
    expected = [100 * judged.density, judged.epe, *judged.bad.values(), judged.d1_all]
    assert rows["StereoBM"] == pytest.approx(expected, rel=1e-5)
    assert rows.keys() == {method.title for method in METHODS}
    visit.screenshot(f"scoreboard-{visit.name}-light")
    visit.choose("are left out")
    rows = {first: [float(one) for one in others] for first, *others in visit.frame(7)}
    assert rows["StereoBM"][2:] == pytest.approx(list(judged.bad_measured.values()), rel=1e-5)
    lines = visit.download("Figures as CSV").decode().splitlines()
    assert {line.split(",")[0] for line in lines[1:]} >= rows.keys()


# Sweep


@pytest.mark.parametrize("visit", [EXAMPLE], indirect=True)
def test_a_click_on_a_cell_of_the_sweep_takes_its_settings_over(visit: DepthPage) -> None:
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


# Take it away


@pytest.mark.parametrize("visit", [OWN], indirect=True)
def test_everything_is_taken_away_read_back_and_reproduced(visit: DepthPage, pair: OwnPair, tmp_path: Path) -> None:
    visit.move("Window", "ArrowLeft", "ArrowLeft", "ArrowLeft")
    window, covered = visit.value("Window"), visit.number("Coverage")
    visit.unfold("Take it away")
    with zipfile.ZipFile(io.BytesIO(visit.download("All in one ZIP"))) as whole:
        whole.extractall(tmp_path)
    disparity = np.load(tmp_path / "disparity.npy")
    assert 100 * np.isfinite(disparity).mean() == pytest.approx(covered, abs=0.51)
    kitti = cv2.imread(str(tmp_path / "disparity_kitti.png"), cv2.IMREAD_UNCHANGED)
    near = np.nan_to_num(disparity) > 0
    assert kitti.dtype == np.uint16
    np.testing.assert_allclose(kitti[near] / 256, disparity[near], atol=1 / 256)
    with Image.open(tmp_path / "disparity.pfm") as floats:
        np.testing.assert_array_equal(np.where(np.isfinite(floats), floats, np.nan), disparity)
    with Image.open(tmp_path / "valid.png") as mask:
        np.testing.assert_array_equal(np.asarray(mask) > 0, np.isfinite(disparity))
    with Image.open(tmp_path / "disparity_coloured.png") as coloured:
        assert coloured.size[0] >= disparity.shape[1]
        assert coloured.size[1] > disparity.shape[0]
    points = read_ply((tmp_path / "cloud.ply").read_bytes())
    depth = read_calibration(pair.calibration.data).depth(disparity)
    assert 0.8 * np.isfinite(depth).sum() < len(points["z"]) <= np.isfinite(depth).sum()
    assert max(points["z"]) <= np.nanmax(depth) * 1.0001
    np.testing.assert_array_equal(cv2.imread(str(tmp_path / "left.png"))[:, :, ::-1], read_image(pair.left.data))
    visit.screenshot(f"take-{visit.name}-light")

    (tmp_path / "disparity.npy").unlink()
    run_program_alone(tmp_path / "reproduce.py")
    np.testing.assert_array_equal(np.load(tmp_path / "disparity.npy"), disparity)

    visit.press("Reset")
    assert visit.value("Window") == 11
    visit.give("Load settings", Given.of(tmp_path / "settings.json"))
    expect(visit.slider("Window").first).to_have_value(f"{window:g}")
    assert visit.number("Coverage") == covered
