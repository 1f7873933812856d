"""What belongs to one visitor has an address that nothing of another visitor's leads to."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, FilePayload, Page

from tests.browser.serving import served_app
from tests.browser.sounds import wav_file
from tests.browser.visits import TIMEOUT_MS, WATCH_ANSWERS, expect_visible, settled

RATE = 8_000
SECONDS = 26
SAMPLE = 64 * 1024

DIGEST = """
async (address) => {
  const content = await (await fetch(address)).arrayBuffer();
  const digest = new Uint8Array(await crypto.subtle.digest("SHA-256", content));
  return [...digest].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}
"""


def alike_but_for_a_burst(seed: int) -> np.ndarray:
    """Return silence with a burst where Streamlit does not look when it names a file: it looks at the ends and the
    middle. The loudest sample is the same in all."""
    sound = np.zeros(SECONDS * RATE)
    sound[100] = 0.9
    start = sound.size // 4
    sound[start : start + RATE // 2] = np.random.default_rng(seed).uniform(-0.5, 0.5, RATE // 2)
    assert start * 2 > SAMPLE
    return sound


@contextmanager
def visitor(browser: Browser, address: str) -> Iterator[Page]:
    """Give a page of somebody who shares nothing with the others, on their own files."""
    page = browser.new_context(reduced_motion="reduce").new_page()
    page.set_default_timeout(TIMEOUT_MS)
    page.add_init_script(WATCH_ANSWERS)
    page.goto(address)
    settled(page)
    page.get_by_text("Your own files", exact=True).click()
    settled(page)
    yield page
    page.context.close()


def choose_files(page: Page, *files: FilePayload) -> None:
    for number, file in enumerate(files):
        page.locator("input[type=file]").nth(number).set_input_files(file)
        settled(page)
    expect_visible(page.get_by_text("Your own recordings."))
    settled(page)


@pytest.fixture(scope="module")
def watched_address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, Path]]:
    """Serve the app in a process that notes every temporary file that an upload would be put down in."""
    folder = tmp_path_factory.mktemp("watch")
    notes = folder / "notes.txt"
    (folder / "sitecustomize.py").write_text(
        "import tempfile\n"
        "rollover = tempfile.SpooledTemporaryFile.rollover\n"
        "def noted(self):\n"
        f"    open({str(notes)!r}, 'a').write('an upload went to disk\\n')\n"
        "    return rollover(self)\n"
        "tempfile.SpooledTemporaryFile.rollover = noted\n"
        f"open({str(notes)!r}, 'a').write('watching\\n')\n"
    )
    project = Path(__file__).resolve().parents[2]
    with served_app(environment={"PYTHONPATH": f"{folder}:{project}"}) as url:
        yield url, notes


def test_nobody_hears_the_recording_of_another(browser: Browser, watched_address: tuple[str, Path]) -> None:
    """Not where the files differ only where Streamlit does not look, and not where they are the same; and no upload is
    written to disk."""
    address, notes = watched_address
    heard: dict[str, str] = {}
    for number, seed in enumerate((0, 2, 2)):
        with visitor(browser, f"{address}/Sensor_lag") as page:
            names = [f"visitor_{number}_{sensor}.wav" for sensor in (1, 2)]
            sounds = [alike_but_for_a_burst(seed + sensor) for sensor in (0, 1)]
            choose_files(page, *(wav_file(name, sound, RATE) for name, sound in zip(names, sounds, strict=True)))
            players = page.locator("audio")
            assert players.count() == 2
            for name, player in zip(names, players.all(), strict=True):
                source = player.get_attribute("src")
                assert source is not None
                assert source not in heard.values()
                heard[name] = source
                assert page.evaluate("(player) => player.error", player.element_handle()) is None
                loaded = "([player, seconds]) => player.readyState > 0 && Math.abs(player.duration - seconds) < 0.01"
                page.wait_for_function(loaded, arg=[player.element_handle(), SECONDS])
            digests = [page.evaluate(DIGEST, heard[name]) for name in names]
            assert len(set(digests)) == 2
    assert set(notes.read_text().splitlines()) == {"watching"}


def test_downloads_have_addresses_of_their_own(browser: Browser, watched_address: tuple[str, Path]) -> None:
    """The same result, made twice by two visitors: the same bytes and yet two addresses."""
    address, _ = watched_address
    seen: dict[str, str] = {}
    for number in range(2):
        context = browser.new_context(accept_downloads=True, reduced_motion="reduce")
        page = context.new_page()
        page.set_default_timeout(TIMEOUT_MS)
        page.add_init_script(WATCH_ANSWERS)
        page.goto(f"{address}/Depth_maps")
        settled(page)
        page.get_by_text("Take it away").click()
        settled(page)
        with page.expect_download() as download:
            page.get_by_role("button", name="NPY", exact=True).click()
        content = Path(download.value.path()).read_bytes()
        assert len(content) > 2**20
        seen[download.value.url] = hashlib.sha256(content).hexdigest()
        assert len(seen) == number + 1
        context.close()
    assert len(set(seen.values())) == 1
