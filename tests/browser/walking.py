"""The Tab key through a whole page: where it stops, and what it leaves out."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from playwright.sync_api import Page

SCRIPT = Path(__file__).with_name("walking.js").read_text(encoding="utf-8")

MOST_STOPS = 250


class Walk(NamedTuple):
    """The stops of the Tab key.

    Attributes
    ----------
    stops
        Each by its role and name.
    unframed
        Those that look the same with and without the focus.
    missed
        Controls that are in view and that neither Tab nor an arrow key leads to.
    """

    stops: list[str]
    unframed: list[str]
    missed: list[str]


def walked(page: Page, *, backwards: bool = False) -> Walk:
    """Press Tab until the focus has left the page; where it never does, that is an error."""
    page.evaluate(SCRIPT)
    key = "Shift+Tab" if backwards else "Tab"
    for _ in range(MOST_STOPS):
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
