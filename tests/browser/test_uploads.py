"""Files that arrive, are refused, are removed or are gone: behaviour that only a real browser shows."""

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from tests.app.uploads import wav
from tests.browser.journeys import unfold
from tests.browser.serving import Server
from tests.browser.visits import OpenPage, expect_visible, file_of, give, settled

SOUND = 0.1 * np.random.default_rng(3).normal(size=9_000)
EXAMPLE = "378.17 m"
OWN = "Sensor 2 hears it 0.0375 s"
BROKEN = file_of("broken.wav", b"RIFF and nothing more")
REFUSAL = "cut short before the layout of its samples"


@pytest.fixture(scope="module")
def own_page(keep_page: OpenPage) -> Page:
    return keep_page("Sensor_lag", choose="Your own files", loses_server=True)


def test_a_broken_file_dropped_over_a_good_one_changes_nothing(own_page: Page) -> None:
    page = own_page
    give(page, file_of("first.wav", wav(SOUND[300:][:8_000])), file_of("second.wav", wav(SOUND[:8_000])))
    expect_visible(page.get_by_role("heading", name=OWN))
    settled(page)  # the uploaders are folded away now
    unfold(page, "Your own files")
    expect(page.get_by_text(REFUSAL)).to_have_count(0)
    page.evaluate(
        """() => {
          window.thrownBack = false;
          const look = () => { window.thrownBack ||= document.body.innerText.includes("the page shows the example"); };
          window.watch = new MutationObserver(look);
          window.watch.observe(document.body, { childList: true, subtree: true, characterData: true });
        }"""
    )
    give(page, BROKEN, first=1)
    expect_visible(page.get_by_text(REFUSAL))
    expect_visible(page.get_by_text("The previous file stays in use."))
    expect_visible(page.get_by_role("heading", name=OWN))
    assert not page.evaluate("window.thrownBack")
    page.evaluate("window.watch.disconnect()")  # reading all of the text at every change takes the processor


def test_after_a_restart_the_page_says_that_the_files_are_gone(own_page: Page, server: Server) -> None:
    page = own_page
    server.stop()
    server.start()
    # Nobody touches the page: it notices by itself.
    expect_visible(page.get_by_text("The files of this page are gone"))
    settled(page)
    expect(page.get_by_role("heading", name=OWN)).to_have_count(0)
    expect(page.get_by_text("Your own recordings.")).to_have_count(0)
    expect(page.get_by_role("heading", name=EXAMPLE)).to_have_count(0)  # nobody must take that for an answer


DROP = """(zone, given) => {
  const dataTransfer = new DataTransfer();
  for (const [name, bytes] of given) dataTransfer.items.add(new File([Uint8Array.from(bytes)], name));
  zone.dispatchEvent(new DragEvent("drop", { bubbles: true, cancelable: true, dataTransfer }));
}"""


def test_files_dropped_together_on_a_box_are_shared_out_by_name_and_the_page_says_how(own_page: Page) -> None:
    page = own_page
    given = {"c.txt": b"1", "b.wav": wav(SOUND[:8_000]), "a.wav": wav(SOUND[300:][:8_000])}
    second = page.get_by_test_id("stFileUploaderDropzone").last
    second.evaluate(DROP, [[name, [*data]] for name, data in given.items()])
    said = "Dropped together: “a.wav” went to Sensor 1, “b.wav” went to Sensor 2, “c.txt” was not taken."
    expect_visible(page.get_by_text(said))
    expect_visible(page.get_by_role("heading", name=OWN))
    settled(page)
