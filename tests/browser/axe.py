"""axe-core on an open page: its findings in the light and in the dark, and elements without alternative text."""

from collections.abc import Sequence
from typing import Any

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page, expect

from tests.browser.visits import read_script, screenshot, settled

FAULTS = ("moderate", "serious", "critical")


OPTIONS = {"resultTypes": ["violations"], "preload": {"assets": ["media"]}}
COLOURS_ALONE = {"runOnly": {"type": "rule", "values": ["color-contrast"]}}

WITHOUT_SOURCES = "axe.configure({ noHtml: true })"
"""Not storing the source of each passing element saves a third of the time on a page with drawings."""


def check(page: Page, state: str, *, only: str = "html", but: Sequence[str] = ()) -> None:
    """Expect no fault in a part of a page outside the parts in `but`, in the light and in the dark.

    All rules are checked in the page's own theme; then it is switched to the other theme, checked for its colours, and
    left there.
    """
    screenshot(page)
    page.mouse.move(0, 0)  # Streamlit's tooltips lie outside every landmark
    app = page.get_by_test_id("stApp")
    theme = app.evaluate("(app) => getComputedStyle(app).colorScheme")
    other = "light" if theme == "dark" else "dark"
    faults, without_text = _lasting_faults(page, only=only, but=but), nameless(page)
    page.emulate_media(color_scheme=other)  # type: ignore[arg-type]
    expect(app).to_have_css("color-scheme", other)
    faults += _lasting_faults(page, COLOURS_ALONE, only=only, but=but)
    expect(page.get_by_test_id("stException")).to_have_count(0)
    assert not faults, f"{state}: {faults}"
    assert not without_text, f"{state}: no alternative text: {without_text}"


def _lasting_faults(
    page: Page, options: dict[str, Any] | None = None, *, only: str, but: Sequence[str]
) -> list[dict[str, Any]]:
    """Return the faults that are there twice: right after a change of theme, colours are still on their way."""
    for pause_ms in (0, 1000):
        page.wait_for_timeout(pause_ms)
        settled(page)
        faults = [one for one in findings(page, options, only=only, but=but) if one["impact"] in FAULTS]
        if not faults:
            break
    return faults


def findings(
    page: Page, options: dict[str, Any] | None = None, *, only: str = "html", but: Sequence[str] = ()
) -> list[dict[str, Any]]:
    """Return axe-core's findings, including minor ones: violated rules, as scripts/violations.js tells them."""
    if not page.evaluate("'axe' in window"):
        page.evaluate(Axe().axe_script)
        page.evaluate(WITHOUT_SOURCES)
    within = [[[only]], [[one] for one in but], OPTIONS | (options or {})]
    found: list[dict[str, Any]] = page.evaluate(read_script("violations"), within)
    return found


def nameless(page: Page) -> list[str]:
    """Return the first characters of each picture, drawing and chart that has no alternative text."""
    found: list[str] = page.evaluate(read_script("nameless"))
    return found
