"""The downloads of a lag and of a template search, read back."""

from __future__ import annotations

import csv
import io
import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, expect

import stereolag as sl
from tests.browser.visits import OpenPage, screenshot, settled


def open_fold(page: Page, name: str) -> None:
    page.get_by_text(name, exact=True).click()
    settled(page)


def downloaded(page: Page, button: str) -> bytes:
    with page.expect_download() as download:
        page.get_by_role("button", name=button, exact=True).click()
    return Path(download.value.path()).read_bytes()


def lines(content: bytes) -> list[dict[str, str]]:
    return [*csv.DictReader(io.StringIO(content.decode()))]


@pytest.fixture(scope="module")
def lag_page(keep_page: OpenPage) -> Page:
    return keep_page("Sensor_lag?max_lag=60000")


def test_every_file_of_a_lag_is_downloaded_and_read_back(lag_page: Page) -> None:
    page = lag_page
    open_fold(page, "Take it away")
    result = json.loads(downloaded(page, "Result JSON"))
    assert (result["lag_samples"], result["settings"]["max_lag"]) == (50_082, 60_000)
    curve = lines(downloaded(page, "Curve CSV"))
    best = max(curve, key=lambda line: float(line["correlation"]))
    assert (len(curve), int(best["lag_samples"])) == (120_001, 50_082)
    aligned = sl.read_signal(downloaded(page, "Aligned WAV"))
    assert len(aligned.channels[0]) == 176_401 + 50_082
    assert sl.signal_lag(*aligned.channels).lag == 0
    assert b"max_lag=60000," in downloaded(page, "Python script")
    with zipfile.ZipFile(io.BytesIO(downloaded(page, "All in one ZIP"))) as whole:
        assert json.loads(whole.read("lag.json")) == result
        signals = [sl.read_signal(whole.read(name)).channels[0] for name in ("recording_1.npy", "recording_2.npy")]
        assert "--max-lag 60000" in whole.read("README.txt").decode()
    np.testing.assert_allclose(aligned.channels[0][50_082:], signals[0], atol=1e-7)
    screenshot(page, "sensor-lag-files-light")


def test_both_recordings_are_heard_together(lag_page: Page) -> None:
    page = lag_page
    before = page.locator("audio").count()
    open_fold(page, "Hear both together")
    players = page.locator("audio")
    expect(players).to_have_count(before + 2)
    for place, samples in ((before, 176_401), (before + 1, 176_401 + 50_082)):
        player = players.nth(place).element_handle()
        loaded = "([player, seconds]) => player.readyState > 0 && Math.abs(player.duration - seconds) < 0.01"
        page.wait_for_function(loaded, arg=[player, samples / 44_100])


def test_every_file_of_a_search_is_downloaded_and_read_back(open_page: OpenPage) -> None:
    page = open_page("Rocketman_search")
    open_fold(page, "Take it away")
    found = json.loads(downloaded(page, "Matches JSON"))
    (match,) = found["matches"]
    assert (match["row"], match["col"]) == (528, 982)
    (line,) = lines(downloaded(page, "Matches CSV"))
    assert {name: float(text) for name, text in line.items()} == match | {"clear": 1}
    framed = sl.read_image(downloaded(page, "Framed PNG"))
    with zipfile.ZipFile(io.BytesIO(downloaded(page, "All in one ZIP"))) as whole:
        image = sl.read_image(whole.read("image.png"))
        template = sl.read_image(whole.read("template.png"))
    changed = np.argwhere((framed != image).any(axis=2))
    top, left = changed.min(axis=0)
    bottom, right = changed.max(axis=0)
    assert top < 528 < 528 + match["height"] <= bottom
    assert left < 982 < 982 + match["width"] <= right
    within = np.s_[528 + 3 : 528 + match["height"] - 3, 982 + 3 : 982 + match["width"] - 3]
    np.testing.assert_array_equal(framed[within], image[within])
    assert template.shape[:2] == (match["height"], match["width"])
    assert b"sl.match_template(" in downloaded(page, "Python script")
    screenshot(page, "rocketman-files-light")
