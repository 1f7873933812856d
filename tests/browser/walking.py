"""The Tab key through a whole page: its stops, and the controls that it misses."""

from typing import NamedTuple

from playwright.sync_api import Page

from tests.browser.visits import read_script

MOST_STOPS, AT_ONCE = 256, 8


class Walk(NamedTuple):
    """The stops of the Tab key.

    Attributes
    ----------
    stops
        The role and name of each stop.
    unframed
        Stops that look the same with and without the focus.
    missed
        Visible controls that neither Tab nor an arrow key reaches.
    """

    stops: list[str]
    unframed: list[str]
    missed: list[str]


def walked(page: Page, *, backwards: bool = False) -> Walk:
    """Press Tab until the focus has left the page, and raise an error if it never does."""
    page.evaluate(read_script("walking"))
    key = "Shift+Tab" if backwards else "Tab"
    for _ in range(MOST_STOPS // AT_ONCE):
        for _ in range(AT_ONCE):
            page.keyboard.press(key)
        if page.evaluate("walk.ended()"):
            break
    else:
        raise AssertionError(f"{MOST_STOPS} stops, and no end: {page.evaluate('walk.told()')[-5:]}")
    page.evaluate("walk.leave()")
    stops = page.evaluate("walk.told()")
    return Walk(
        [stop["name"] for stop in stops],
        [stop["name"] for stop in stops if not stop["framed"]],
        page.evaluate("walk.missed()"),
    )
