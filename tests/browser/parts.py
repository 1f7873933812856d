"""Components of the pages alone in a browser: what Python hands to each is mounted as Streamlit mounts it.

A page of the app costs seconds to open, a component by itself a tenth of one. That it stands on its page, and that the
page hears it, ``test_parts_in_place.py`` asks of the app itself.
"""

from __future__ import annotations

import base64
import json
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Page
from streamlit.components.v2 import manifest_scanner
from streamlit.proto.BidiComponent_pb2 import BidiComponent
from streamlit.testing.v1 import AppTest

from tests.browser.serving import PROJECT
from tests.browser.visits import OpenPage, faultless_pages

Show = Callable[[], object]
"""Draws parts of a page, as a run of it does."""

HERE = Path(__file__).resolve().parent

SCRIPT_TIMEOUT_S = 120

OF_STREAMLIT = {
    "font": '"Source Sans", sans-serif',
    "orange-text-color": {"light": "#e2660c", "dark": "#ffbd45"},
}
"""What components heed of a theme, by Streamlit and not by ``config.toml``."""


@cache
def themes() -> dict[str, dict[str, str]]:
    """Return the custom properties that Streamlit gives to components, those of them that ours heed, of both themes."""
    theme = tomllib.loads((PROJECT / ".streamlit" / "config.toml").read_text(encoding="utf-8"))["theme"]
    found: dict[str, dict[str, str]] = {}
    for scheme in ("light", "dark"):
        colours = {
            f"--st-{name}-color": theme[scheme][key]
            for name, key in {
                "background": "backgroundColor",
                "secondary-background": "secondaryBackgroundColor",
                "text": "textColor",
                "primary": "primaryColor",
                "border": "borderColor",
            }.items()
        }
        others = {f"--st-{name}": one if isinstance(one, str) else one[scheme] for name, one in OF_STREAMLIT.items()}
        found[scheme] = colours | others | {"--st-base-radius": theme["baseRadius"]}
    return found


def handed_over(show: Show) -> list[BidiComponent]:
    """Return what a run that draws some parts hands to the browser for each."""
    app = AppTest.from_string("import streamlit as st\nst.session_state.show()", default_timeout=SCRIPT_TIMEOUT_S)
    app.session_state.show = show
    app.run()
    assert not app.exception, app.exception
    return [element.proto for element in app.get("bidi_component")]


def hand_over(page: Page, show: Show) -> None:
    """Let a page of parts show what a run hands over; those that it showed before change or leave."""
    parts = [_described(part) for part in handed_over(show)]
    page.evaluate("(text) => handOver(text)", json.dumps({"themes": themes(), "parts": parts}))


def _described(part: BidiComponent) -> dict[str, Any]:
    kind = part.WhichOneof("data")
    assert kind in {"json", "bytes"}, f"{part.component_name} is handed {kind}"
    assert part.isolate_styles
    return {
        "id": part.id,
        "name": part.component_name,
        "html": part.html_content,
        "css": part.css_content,
        "js": part.js_content,
        "json": part.json if kind == "json" else None,
        "bytes": base64.b64encode(part.bytes).decode("ascii"),
    }


def sent(page: Page) -> list[dict[str, Any]]:
    """Return what the parts of a page have sent to the server, oldest first."""
    found: list[dict[str, Any]] = page.evaluate("sent")
    return found


@contextmanager
def parts_alone(browser: Browser) -> Iterator[OpenPage]:
    """Give what opens a page of what a function draws; in the end they are closed, and must not have met an error."""
    with pytest.MonkeyPatch.context() as patch, faultless_pages(browser, HERE.as_uri()) as opened:
        # Streamlit looks through all installed packages for components at every run.
        patch.setattr(manifest_scanner, "scan_component_manifests", cache(manifest_scanner.scan_component_manifests))

        def shown(show: Show, **options: Any) -> Page:
            page = opened("parts.html", **options)
            hand_over(page, show)
            return page

        yield shown
