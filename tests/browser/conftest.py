"""Fixtures for the real app in a real browser."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, expect

from tests.browser.parts import ShowParts, parts_alone
from tests.browser.serving import CHROMIUM, Server, chromium, chromium_path
from tests.browser.visits import TIMEOUT_MS, OpenPage, faultless_pages

expect.set_options(timeout=TIMEOUT_MS)


@pytest.fixture(scope="session")
def server() -> Iterator[Server]:
    running = Server()
    yield running
    running.stop()


@pytest.fixture(scope="session")
def address(server: Server) -> str:
    return server.address


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    path = chromium_path()
    if path is None:
        pytest.skip(f"no Chromium at $CHROMIUM nor at {CHROMIUM[-1]}")
    with chromium(path) as running:
        yield running


@pytest.fixture
def open_page(browser: Browser, address: str) -> Iterator[OpenPage]:
    """Return a function that opens a page of the app; an error on its console fails the test."""
    with faultless_pages(browser, address) as opened:
        yield opened


@pytest.fixture(scope="module")
def keep_page(browser: Browser, address: str) -> Iterator[OpenPage]:
    """Return a function that opens a page shared by all tests of a module."""
    with faultless_pages(browser, address) as opened:
        yield opened


@pytest.fixture(scope="module")
def show_parts(browser: Browser) -> Iterator[ShowParts]:
    """Return a function that shows the components drawn by a given function, without the app."""
    with parts_alone(browser) as shown:
        yield shown


ON_REAL_SOCKETS = ("tests/browser/", "tests/package/", "tests/app/test_streams.py")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Run a test of a browser or a server that fails once more: on a busy machine, about one run of all in ten meets a
    moment of Streamlit, Chromium or a socket that no second one meets. The summary counts those tests as rerun."""
    for item in items:
        if item.nodeid.startswith(ON_REAL_SOCKETS):
            item.add_marker(pytest.mark.flaky(reruns=1))
