"""A drive recorded with a live camera."""

from __future__ import annotations

import numpy as np
from playwright.sync_api import expect

from tests.browser.fake_media import played_cameras, stereo_scene
from tests.browser.visits import OpenPage, settled


def test_a_recorded_drive_has_maps_and_a_video_like_an_uploaded_one(open_page: OpenPage) -> None:
    scenes = [stereo_scene(number, near=20 + number, far=8, shape=(120, 200)) for number in range(4)]
    page = open_page("Driving", script=played_cameras(both=[np.hstack([left, right]) for left, right, _ in scenes]))
    page.get_by_role("button", name="Cancel").click()  # the example, which takes longer than these frames
    page.get_by_role("radio", name="Your camera").click()
    page.get_by_role("button", name="Start", exact=True).click()
    page.get_by_role("button", name="Record", exact=True).click()
    for number in range(1, 4):
        expect(page.locator(".count")).to_contain_text(str(2 * number))
        page.evaluate("number => (fakeMedia.frame = number)", number)
    page.get_by_role("button", name="Finish", exact=True).click()
    expect(page.get_by_text("Until your frames are here")).to_have_count(0)
    settled(page)
    expect(page.locator(".player")).to_be_visible()
    assert page.evaluate("fakeMedia.open.every(({ track }) => track.readyState === 'ended')")
