"""Downloads of a lag and of a template search as a browser gets them; ``tests/app`` reads all their contents."""

from __future__ import annotations

import csv
import io
import json
import zipfile
from pathlib import Path

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


def test_every_file_of_a_lag_is_downloaded_and_both_recordings_are_heard(open_page: OpenPage) -> None:
    page = open_page("Sensor_lag?max_lag=60000")
    open_fold(page, "Take it away")
    result = json.loads(downloaded(page, "Result JSON"))
    assert (result["lag_samples"], result["settings"]["max_lag"]) == (50_082, 60_000)
    assert len([*csv.DictReader(io.StringIO(downloaded(page, "Curve CSV").decode()))]) == 120_001
    aligned = sl.read_signal(downloaded(page, "Aligned WAV"))
    assert sl.signal_lag(*aligned.channels).lag == 0
    assert b"max_lag=60000," in downloaded(page, "Python script")
    with zipfile.ZipFile(io.BytesIO(downloaded(page, "All in one ZIP"))) as whole:
        assert json.loads(whole.read("lag.json")) == result
    screenshot(page, "sensor-lag-files-light")
    players = page.locator("audio")
    before = players.count()
    open_fold(page, "Hear both together")
    expect(players).to_have_count(before + 2)
    for place, samples in ((before, 176_401), (before + 1, 176_401 + 50_082)):
        loaded = "([player, seconds]) => player.readyState > 0 && Math.abs(player.duration - seconds) < 0.01"
        page.wait_for_function(loaded, arg=[players.nth(place).element_handle(), samples / 44_100])


def test_every_file_of_a_search_is_downloaded(open_page: OpenPage) -> None:
    page = open_page("Rocketman_search")
    open_fold(page, "Take it away")
    (match,) = json.loads(downloaded(page, "Matches JSON"))["matches"]
    assert (match["row"], match["col"]) == (528, 982)
    (line,) = csv.DictReader(io.StringIO(downloaded(page, "Matches CSV").decode()))
    assert {name: float(text) for name, text in line.items()} == match | {"clear": 1}
    framed = sl.read_image(downloaded(page, "Framed PNG"))
    with zipfile.ZipFile(io.BytesIO(downloaded(page, "All in one ZIP"))) as whole:
        assert sl.read_image(whole.read("image.png")).shape == framed.shape
        assert sl.read_image(whole.read("template.png")).shape[:2] == (match["height"], match["width"])
    assert b"sl.match_template(" in downloaded(page, "Python script")
    screenshot(page, "rocketman-files-light")
