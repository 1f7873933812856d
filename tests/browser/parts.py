"""Components of the pages alone in a browser: what Python hands to each is mounted as Streamlit mounts it.

A page of the app costs seconds to open, a component by itself a tenth of one. That it stands on its page, and that the
page hears it, ``in_place.py`` asks of the app itself.
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
from playwright.sync_api import Browser, Locator, Page
from streamlit.components.v2 import manifest_scanner
from streamlit.proto.BidiComponent_pb2 import BidiComponent
from streamlit.proto.WidgetStates_pb2 import WidgetState, WidgetStates
from streamlit.testing.v1 import AppTest

from tests.browser.serving import PROJECT
from tests.browser.visits import faultless_pages

Show = Callable[[], object]
"""Draws parts of a page, as a run of it does."""

RUN = "import streamlit as st\nst.session_state.show()"

TRIGGER = "$$STREAMLIT_INTERNAL_KEY_{}__events"
"""The name by which Streamlit's page sends what a component triggers."""

HERE = Path(__file__).resolve().parent

SCRIPT_TIMEOUT_S = 120

OF_STREAMLIT = {
    "font": '"Source Sans",sans-serif,"Source Sans",sans-serif',
    "orange-text-color": {"light": "#9B4519", "dark": "#F2A56D"},
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


class Parts:
    """Some components on a page of their own, and the run of Python behind them.

    Attributes
    ----------
    page
        Where they are mounted.
    """

    def __init__(self, page: Page, show: Show) -> None:
        self.page = page
        self._app = AppTest.from_string(RUN, default_timeout=SCRIPT_TIMEOUT_S)
        self._answered = 0
        self.hand_over(show)

    def hand_over(self, show: Show) -> None:
        """Show what a run hands over; the parts that were shown before are told what has changed, or leave."""
        self._app.session_state.show = show
        self._run(WidgetStates())

    def sent(self) -> list[dict[str, Any]]:
        """Return what the parts have sent to the server, oldest first."""
        return sent(self.page)

    def answer(self) -> None:
        """Let Python hear what was sent since the last time, one after the other, and show what it answers."""
        for one in self.sent()[self._answered :]:
            assert one["kind"] == "trigger"
            value = json.dumps([{"event": one["event"], "value": one["value"]}])
            self._run(WidgetStates(widgets=[WidgetState(id=TRIGGER.format(one["id"]), json_trigger_value=value)]))
            self._answered += 1

    def said(self) -> str:
        """Return what the run says in words, in the order of its kinds."""
        texts = (*self._app.markdown, *self._app.success, *self._app.warning, *self._app.caption)
        return "\n".join(one.value for one in texts)

    def _run(self, told: WidgetStates) -> None:
        self._app._run(told)  # what AppTest has no public name for: components that have a say
        assert not self._app.exception, self._app.exception
        parts = [_described(element.proto) for element in self._app.get("bidi_component")]
        self.page.evaluate("(text) => handOver(text)", json.dumps({"themes": themes(), "parts": parts}))


@contextmanager
def redrawn(canvas: Locator) -> Iterator[None]:
    """Wait until something else is drawn on a canvas: pictures are unpacked beside the page, and for long."""
    before = canvas.evaluate("(canvas) => canvas.toDataURL()")
    yield
    drawn_anew = "([canvas, before]) => canvas.toDataURL() !== before"
    canvas.page.wait_for_function(drawn_anew, arg=[canvas.element_handle(), before])


def sent(page: Page) -> list[dict[str, Any]]:
    """Return what the parts of a page have sent to the server, oldest first."""
    found: list[dict[str, Any]] = page.evaluate("sent")
    return found


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


ShowParts = Callable[..., Parts]


@contextmanager
def parts_alone(browser: Browser) -> Iterator[ShowParts]:
    """Give what opens pages of the parts that functions draw; they must not have met an error in the end."""
    with pytest.MonkeyPatch.context() as patch, faultless_pages(browser, HERE.as_uri()) as opened:
        # Streamlit looks through all installed packages for components at every run.
        patch.setattr(manifest_scanner, "scan_component_manifests", cache(manifest_scanner.scan_component_manifests))

        def shown(show: Show, **options: Any) -> Parts:
            return Parts(opened("parts.html", **options), show)

        yield shown
