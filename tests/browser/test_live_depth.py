"""Depth maps of a live camera, played by the test: maps, controls, a frozen frame, and what goes wrong."""

import re
import time

import numpy as np
import pytest
from playwright.sync_api import Page, WebSocket, expect

from tests.browser import axe, fake_media
from tests.browser.parts import box_of
from tests.browser.visits import OpenPage, settled
from tests.packed import unpacked, values_of

NEAR, FAR = 30, 9
PATIENCE = 100
LEFT, RIGHT, TRUTH = fake_media.stereo_scene(7, near=NEAR, far=FAR)


@pytest.fixture(scope="module")
def camera_page(keep_page: OpenPage) -> Page:
    """Open the depth page with four cameras: both views in one picture, or one view each."""
    cameras = fake_media.played_cameras(both=[np.hstack([LEFT, RIGHT])], one=[LEFT], two=[RIGHT], hand=[LEFT, RIGHT])
    return keep_page("Depth_maps?pair=own", choose="Live camera", script=cameras)


def start(page: Page) -> None:
    running = page.get_by_role("button", name="Stop")
    if running.count():  # the test before has failed
        running.click()
    page.get_by_role("button", name="Start").click()
    expect(page.locator(".live .state")).to_have_text("Live")


def values_at(page: Page, share: tuple[float, float]) -> list[float]:
    """Return the disparities of all maps under a point, given as shares of their height and width."""
    viewport = page.locator(".viewport").first
    box = box_of(viewport)
    viewport.hover(position={"x": share[1] * box["width"], "y": share[0] * box["height"]})
    expect(page.locator(".reading").first).to_contain_text("px")
    texts = page.locator(".reading").all_inner_texts()
    return [float(found[1]) for text in texts if (found := re.search(r"([\d.]+)\s*px", text))]


def stop(page: Page) -> None:
    page.get_by_role("button", name="Stop").click()
    fake_media.expect_cameras_off(page)


def assert_maps_are_right(page: Page) -> None:
    expect(page.locator(".viewport")).to_have_count(2)
    for share, disparity in (((0.5, 0.5), NEAR), ((0.1, 0.8), FAR)):
        for _ in range(PATIENCE):  # frames are on their way
            values = values_at(page, share)
            if len(values) == 2 and all(abs(value - disparity) < 1 for value in values):
                break
            page.wait_for_timeout(100)
        else:
            raise AssertionError(f"{values} px in place of {disparity}")


HIDE_TAB = """hidden => {
  Object.defineProperty(document, "hidden", { configurable: true, get: () => hidden });
  document.dispatchEvent(new Event("visibilitychange"));
}"""


def test_every_failure_of_a_camera_has_its_own_sentence(camera_page: Page) -> None:
    page = camera_page
    state = page.locator(".live .state")
    for error, sentence in {
        "NotAllowedError": "The browser does not allow it",
        "NotFoundError": "No such device is connected",
        "NotReadableError": "in use by another program",
        "OverconstrainedError": "is no longer connected",
        "AbortError": "The device cannot be used",
    }.items():
        fake_media.refuse_cameras(page, error)
        page.get_by_role("button", name="Start").click()
        expect(state).to_contain_text(sentence)
        expect(page.locator(".live.on")).to_have_count(0)
    fake_media.refuse_cameras(page, "")
    start(page)
    fake_media.unplug_cameras(page)
    expect(state).to_contain_text("was unplugged")
    start(page)
    stop(page)


def test_a_live_camera_has_maps_whose_controls_act_within_two_frames_and_a_hidden_tab_sends_none(camera_page):
    page = camera_page
    sockets: list[WebSocket] = []
    page.on("websocket", lambda socket: sockets.append(socket))
    start(page)
    assert_maps_are_right(page)
    axe.check(page, "a live camera", only=".st-key-bench")
    live = next(one for one in sockets if one.url.endswith("/live"))
    sent, farthest = [], []
    live.on("framesent", lambda _: sent.append(time.monotonic()))
    live.on("framereceived", lambda data: farthest.append(largest_of(data)))
    searched = page.get_by_role("spinbutton", name="Disparities searched")
    wide = searched.input_value()
    with live.expect_event("framereceived"):  # one with the value before
        pass
    searched.fill("16")
    searched.press("Enter")
    settled(page)  # Python has drawn the page with the new value
    before = len(farthest)
    page.wait_for_timeout(1000)
    assert len(farthest) > before + 2
    assert np.nanmax(farthest[before + 2 :]) < 16 < NEAR - 1 < np.nanmax(farthest)
    page.evaluate(HIDE_TAB, True)
    expect(page.locator(".live .state")).to_have_text("Paused while this tab is hidden.")
    page.wait_for_timeout(500)  # the frame that was being taken has gone
    before = len(sent)
    page.wait_for_timeout(1000)
    assert len(sent) == before
    page.evaluate(HIDE_TAB, False)
    expect(page.locator(".live .state")).to_have_text("Live")
    page.wait_for_timeout(1000)
    assert len(sent) > before
    stop(page)
    searched.fill(wide)
    searched.press("Enter")
    settled(page)


def largest_of(answer: bytes | str) -> float:
    """Return the largest disparity of the first map of an answer; NaN without one."""
    header, parts = unpacked(answer) if isinstance(answer, bytes) else ({}, [])
    if "shape" not in header:
        return float("nan")
    described, arrays = unpacked(parts[0])
    return float(np.nanmax(values_of(described["readings"][0], arrays)))


NO_SOCKET = """() => {
  window.realSocket = WebSocket;
  window.WebSocket = new Proxy(WebSocket, {
    construct(target, [address, ...more]) {
      if (!address.endsWith("/live")) return new target(address, ...more);
      const closed = { close() {} };
      setTimeout(() => closed.onclose({ code: 1006 }));
      return closed;
    },
  });
}"""


def test_where_no_socket_opens_frames_go_over_the_own_connection_of_the_page(camera_page: Page) -> None:
    page = camera_page
    page.evaluate(NO_SOCKET)
    page.get_by_role("button", name="Start").click()
    expect(page.locator(".live .state")).to_contain_text("own connection")
    assert_maps_are_right(page)
    first = page.locator(".live .rates").inner_text()
    expect(page.locator(".live .rates")).not_to_have_text(first)  # they go on
    stop(page)
    page.evaluate("() => (window.WebSocket = window.realSocket)")


def test_two_webcams_are_one_stereo_camera_and_can_be_swapped(camera_page: Page) -> None:
    page = camera_page
    fake_media.choose_arrangement(page, "Two webcams")
    start(page)
    for label, device in (("Camera", "one"), ("Right camera", "two")):
        fake_media.choose_device(page, label, device)
    expect(page.locator(".skew")).to_contain_text("ms")
    expect(page.locator(".live .state")).to_have_text("Live")
    assert_maps_are_right(page)
    page.get_by_role("button", name="Swap left and right").click()
    expect(page.locator(".live .state")).to_have_text("Live")
    opened = page.evaluate("fakeMedia.open.filter(({ track }) => track.readyState === 'live').map(({ name }) => name)")
    assert opened == ["two", "one"]
    stop(page)


def test_one_webcam_moved_by_hand_makes_a_pair(camera_page: Page) -> None:
    page = camera_page
    fake_media.choose_arrangement(page, "One webcam, moved by hand")
    start(page)
    fake_media.choose_device(page, "Camera", "hand")
    expect(page.locator(".live .state")).to_have_text("Live")
    page.get_by_role("button", name="Take the left picture").click()
    page.evaluate("fakeMedia.frame = 1")
    assert_maps_are_right(page)
    page.get_by_role("button", name="Freeze").click()
    expect(page.get_by_text("In use: a frame of the camera")).to_be_attached()
    settled(page)
    expect(page.get_by_role("heading", name="Look closer")).to_be_attached()
    fake_media.expect_cameras_off(page)
