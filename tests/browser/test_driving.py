"""The driving page: a drive recorded with a live camera, and the player, used with mouse and keyboard."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import cv2
import numpy as np
import pytest
from playwright.sync_api import Locator, Page, expect

from stereolag.io.images import read_image
from stereolag.samples import stereo_pairs
from tests.app.test_driving_page import drive
from tests.archives import zipped
from tests.browser.fake_media import expect_cameras_off, played_cameras, stereo_scene
from tests.browser.layout import USUAL
from tests.browser.parts import box_of
from tests.browser.visits import OpenPage, expect_visible, resized, screenshot, settled

OWN = "Your ZIP, or side-by-side video"
COUNT = 12
LONG = 150
"""Enough frames that no machine finishes them before a button can be pressed."""


def long_drive(count: int) -> bytes:
    """Return a ZIP of frames in which the same few repeat."""
    example, files = stereo_pairs()["road"], {}
    for side in ("left", "right"):
        picture = read_image(getattr(example, side))
        cuts = [picture[180:340, start : start + 260] for start in range(0, 80, 8)]
        frames = [cv2.imencode(".jpg", cut, (cv2.IMWRITE_JPEG_QUALITY, 60))[1].tobytes() for cut in cuts]
        files |= {f"{side}/{number:04d}.jpg": frames[number % len(frames)] for number in range(count)}
    return zipped(files)


class Drive:
    """The driving page with a sequence on it."""

    def __init__(self, page: Page, data: bytes, count: int) -> None:
        self.page = page
        self._cancel()
        fold, own = page.locator("summary").filter(has_text="Your own files"), page.get_by_role("radio", name=OWN)
        if fold.count():  # closed over the files of the test before, which are replaced: the example would be computed
            fold.click()
            settled(page)
        if not own.is_checked():
            own.click()
            expect_visible(page.get_by_text("Until your frames").first)
            self._cancel()
        settled(page)  # a redrawn box loses its file
        box = page.get_by_test_id("stFileUploader").locator("input[type=file]").first
        with TemporaryDirectory() as folder:
            # Uploaded by path: passed as bytes, 13 MB took the browser 20 s on a busy machine.
            file = Path(folder) / "drive.zip"
            file.write_bytes(data)
            box.set_input_files(file)
            expect(self.where).to_contain_text(f"of {count}")  # no longer those of the example or of the test before

    def _cancel(self) -> None:
        """Cancel the example, whose sixty frames take the server longer than those of these tests."""
        # At once if it is there: the last frame may be done, and the button gone, before a pointer has reached it.
        self.page.get_by_role("button", name="Cancel").evaluate_all("(found) => found.forEach((one) => one.click())")
        settled(self.page)

    def wait_until_done(self) -> None:
        expect_visible(self.page.get_by_text("decoded, matched, coloured"))
        settled(self.page)

    @property
    def where(self) -> Locator:
        return self.page.locator(".player .where")

    def video(self, what: str) -> Any:
        return self.page.locator(".player video").evaluate(f"(video) => video.{what}")

    def wait_for_video(self, what: str) -> None:
        roots = "[...document.querySelectorAll('*')].map((one) => one.shadowRoot?.querySelector('.player video'))"
        self.page.wait_for_function(f"() => {roots}.find((one) => one)?.{what}")

    def shown(self) -> list[float]:
        """Return the mean brightness of each canvas."""
        found: list[float] = self.page.locator(".player canvas").evaluate_all(
            """(all) => all.map((one) => {
              const { data } = one.getContext("2d").getImageData(0, 0, one.width, one.height);
              return data.reduce((sum, value) => sum + value, 0) / data.length;
            })"""
        )
        return found


@pytest.fixture(scope="module")
def page(keep_page: OpenPage) -> Page:
    """Return the page with a camera that films four frames."""
    scenes = [stereo_scene(number, near=20 + number, far=8, shape=(120, 200)) for number in range(4)]
    cameras = played_cameras(both=[np.hstack([left, right]) for left, right, _ in scenes])
    page = keep_page("Driving", call_off=True, script=cameras)
    page.get_by_role("radio", name="Your camera").click()
    settled(page)
    return page


def test_a_recorded_drive_has_maps_and_a_video_like_an_uploaded_one(page: Page) -> None:
    resized(page, *USUAL)
    assert box_of(page.locator(".player figure").first)["y"] <= USUAL[1] / 2  # the controls of the camera leave it room
    page.get_by_role("button", name="Start", exact=True).click()
    page.get_by_role("button", name="Record", exact=True).click()
    for number in range(1, 4):
        expect(page.locator(".count")).to_contain_text(str(2 * number))
        page.evaluate("number => (fakeMedia.frame = number)", number)
    page.get_by_role("button", name="Finish", exact=True).click()
    expect(page.get_by_text("Until your frames are here")).to_have_count(0)
    settled(page)
    expect(page.locator(".player")).to_be_visible()
    expect_cameras_off(page)


def test_it_is_watched_while_it_is_computed_and_called_off(page: Page) -> None:
    visit = Drive(page, long_drive(LONG), LONG)
    visit.wait_for_video("buffered.length")
    page.get_by_role("button", name="Cancel").click()
    expect(page.get_by_role("button", name="Resume")).to_be_visible()
    settled(page)
    ended = visit.video("buffered.end(0)")
    assert 0 < ended < LONG / 10
    page.get_by_role("button", name="Play").click()
    page.wait_for_timeout(700)
    assert visit.video("currentTime") > 0.2


@pytest.fixture(scope="module")
def drive_page(page: Page) -> Drive:
    visit = Drive(page, drive(count=COUNT), COUNT)
    visit.wait_until_done()
    return visit


@pytest.fixture
def visit(drive_page: Drive) -> Drive:
    """Return the drive shared by all tests, at its first frame."""
    drive_page.page.locator(".player").focus()
    drive_page.page.keyboard.press("Home")
    expect(drive_page.where).to_contain_text(f"frame 1 of {COUNT}")
    return drive_page


def test_it_plays_steps_and_scrubs(visit: Drive) -> None:
    assert len(visit.shown()) == 3
    assert min(visit.shown()) > 30
    expect(visit.where).to_contain_text(f"frame 1 of {COUNT}")
    visit.page.get_by_role("button", name="Play").click()
    visit.wait_for_video("currentTime > 0.5")
    expect(visit.where).to_contain_text(f"frame {COUNT} of {COUNT}")  # it has played to the end
    visit.page.get_by_role("button", name="One frame back").click()
    expect(visit.where).to_contain_text(f"frame {COUNT - 1} of {COUNT}")
    before = visit.shown()
    visit.page.locator(".player").focus()
    visit.page.keyboard.press("Home")
    expect(visit.where).to_contain_text(f"frame 1 of {COUNT}")
    for _ in range(3):
        visit.page.keyboard.press("ArrowRight")
    expect(visit.where).to_contain_text(f"frame 4 of {COUNT}")
    visit.page.wait_for_timeout(200)
    assert visit.shown() != before
    assert visit.video("currentTime") == pytest.approx(0.35, abs=0.06)
    visit.page.keyboard.press("Space")
    expect_visible(visit.page.get_by_role("button", name="Pause"))
    visit.page.keyboard.press("Space")
    chart = visit.page.locator(".player .chart svg").first
    box = box_of(chart)
    chart.click(position={"x": box["width"] - 1, "y": box["height"] / 2})
    expect(visit.where).to_contain_text(f"frame {COUNT} of {COUNT}")
    screenshot(visit.page)


def test_no_step_is_lost_however_quickly_keys_follow(visit: Drive) -> None:
    visit.page.locator(".player").focus()
    for round in range(5):
        visit.page.keyboard.press("Home")
        for _ in range(8):
            visit.page.keyboard.press("ArrowRight")
            visit.page.wait_for_timeout(8 * round)  # from no delay to longer than decoding a picture
        expect(visit.where).to_contain_text(f"frame 9 of {COUNT}", timeout=5_000)


def test_a_frame_is_opened_on_the_depth_page(visit: Drive) -> None:
    visit.page.get_by_role("button", name="One frame on").click()
    expect(visit.where).to_contain_text(f"frame 2 of {COUNT}")
    visit.page.get_by_role("button", name="Open on the depth page").click()
    expect_visible(visit.page.get_by_role("heading", name="Depth maps"))
    settled(visit.page)
    expect_visible(visit.page.get_by_text("Your own pair").first)
    expect(visit.page.locator(".linked").first.locator("figure")).to_have_count(2)
