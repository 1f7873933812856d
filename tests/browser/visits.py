"""Helpers for tests that work on an open page."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from itertools import count
from pathlib import Path

from playwright.sync_api import Browser, ConsoleMessage, FilePayload, Locator, Page, TimeoutError, expect

SCREENSHOTS = Path(__file__).resolve().parents[2] / "screenshots"

NUMBERS = count(1)
"""Numbers of the screenshots, in the order in which they are taken."""

SCRIPTS = Path(__file__).with_name("scripts")

OpenPage = Callable[..., Page]

TIMEOUT_MS = 60_000
"""Only a failure waits this long: a busy machine takes ten times as long as an idle one."""


@cache
def read_script(name: str) -> str:
    """Return a script of the folder `scripts`, for a page to run or, if it is one function, to call."""
    return (SCRIPTS / f"{name}.js").read_text(encoding="utf-8")


@contextmanager
def faultless_pages(browser: Browser, address: str) -> Iterator[OpenPage]:
    """Yield a function that opens pages of the app; at the end, close them and fail if any met an error."""
    errors: list[str] = []
    pages: list[Page] = []

    def note(message: ConsoleMessage) -> None:
        # Opened below the root, Streamlit first looks for itself at the page's own address; the 404 is expected.
        if message.type == "error" and "/_stcore/" not in message.location["url"]:
            errors.append(f"{message.text} ({message.location['url']})")

    def opened(
        path: str = "",
        *,
        scheme: str = "light",
        width: int = 1280,
        choose: str = "",
        call_off: bool = False,
        moving: bool = False,
        loses_server: bool = False,
        script: str = "",
    ) -> Page:
        page = new_window(browser)
        pages.append(page)
        page.set_viewport_size({"width": width, "height": 900})
        page.emulate_media(
            color_scheme=scheme,  # type: ignore[arg-type]
            # Without a graphics card, drawing animations while a page waits takes a third of all time.
            reduced_motion="no-preference" if moving else "reduce",
        )
        page.set_default_timeout(TIMEOUT_MS)
        page.add_init_script(read_script("answers") + script)
        if not loses_server:  # the console reports that as often as the page retries
            page.on("console", note)
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto(f"{address}/{path}")
        if choose:  # as soon as it is there, which spares the server the example
            page.get_by_role("radio", name=choose).click()
        if call_off:  # the example, of which the server would go on with every frame beside what is tested
            page.get_by_role("button", name="Cancel").click()
        settled(page)
        return page

    yield opened
    for page in pages:
        page.close()
    assert errors == [], errors


def new_window(browser: Browser) -> Page:
    """Return an empty page in its own window: Chromium draws little of a tab that is behind another.

    All windows are opened by one page and so share a process, which compiles Streamlit's and Plotly's scripts once.
    """
    (context, *_) = browser.contexts
    with context.expect_page() as opened:
        context.pages[0].evaluate("void open('about:blank', '_blank', 'popup')")
    return opened.value


def turned_dark(page: Page, *, width: int) -> None:
    """Switch an open page to dark and to a width, such as a phone's, and expect it to fit: opening another page takes
    ten times as long."""
    screenshot(page)
    page.emulate_media(color_scheme="dark")
    expect(page.get_by_test_id("stApp")).to_have_css("color-scheme", "dark")
    resized(page, width)
    expect_fitting(page, width)
    screenshot(page)


def resized(page: Page, width: int, height: int = 900) -> None:
    """Resize a page, and wait until its layout has settled."""
    page.set_viewport_size({"width": width, "height": height})
    settled(page)


def expect_fitting(page: Page, width: int) -> None:
    """Expect nothing on a page to be wider than its window."""
    fits = "(width) => document.querySelector('[data-testid=stMain]').scrollWidth <= width"
    page.wait_for_function(fits, arg=width)  # charts are resized a moment later


def settled(page: Page) -> None:
    """Wait until the server has answered, the script has run, heavy work is done and every chart is drawn."""
    page.evaluate(read_script("rest"), TIMEOUT_MS)


def expect_visible(wanted: Locator) -> None:
    """Expect a single visible element: a page may briefly show the previous run's element too, and Playwright does not
    wait out finding two."""
    expect(wanted).to_have_count(1)
    expect(wanted).to_be_visible()


def file_of(name: str, data: bytes) -> FilePayload:
    """Return a file as a visitor would upload it."""
    return {"name": name, "mimeType": "application/octet-stream", "buffer": data}


def give(page: Page, *given: FilePayload | list[FilePayload], first: int = 0) -> None:
    """Upload a file, or several, to each of the boxes on the page from one on."""
    for number, some in enumerate(given, first):
        page.locator("input[type=file]").nth(number).set_input_files(some)
        settled(page)


def screenshot(page: Page) -> None:
    """Save a picture of the whole page in screenshots/, which git ignores, if $STEREOLAG_SCREENSHOTS is set."""
    if not os.environ.get("STEREOLAG_SCREENSHOTS"):
        return
    settled(page)
    SCREENSHOTS.mkdir(exist_ok=True)
    before = page.viewport_size
    assert before is not None
    height = page.evaluate("document.querySelector('[data-testid=stMain]').scrollHeight")
    resized(page, before["width"], height)
    test = os.environ["PYTEST_CURRENT_TEST"].rpartition("/")[2].partition(" ")[0]
    path = SCREENSHOTS / f"{test.replace('::', '.')}.{next(NUMBERS)}.png"
    try:
        page.screenshot(path=path, timeout=TIMEOUT_MS / 3)
    except TimeoutError:  # about once in several hundred times Chromium on a busy machine draws nothing at first
        page.screenshot(path=path)
    resized(page, before["width"], before["height"])
