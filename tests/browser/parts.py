"""Components of the pages alone in a browser, mounted with their data from Python as Streamlit does it.

A page of the app takes seconds to open, a component by itself a tenth of one. ``journeys.py`` checks on the
real pages that the component is there and that the page hears it.
"""

import json
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from google.protobuf.json_format import MessageToDict
from playwright.sync_api import Browser, FloatRect, Locator, Page
from streamlit.components.v2 import manifest_scanner
from streamlit.proto.BidiComponent_pb2 import BidiComponent
from streamlit.proto.WidgetStates_pb2 import WidgetState, WidgetStates
from streamlit.testing.v1 import AppTest

from tests.browser.serving import PROJECT
from tests.browser.visits import faultless_pages

Show = Callable[[], object]
"""A function that draws parts of a page, as a run of it does."""

RUN = "import streamlit as st\nst.session_state.show()"

TRIGGER = "$$STREAMLIT_INTERNAL_KEY_{}__events"
"""Name under which Streamlit's page sends a component's triggers."""

HERE = Path(__file__).resolve().parent

SCRIPT_TIMEOUT_S = 120

OF_STREAMLIT = {
    "font": '"Source Sans",sans-serif,"Source Sans",sans-serif',
    "orange-text-color": {"light": "#9B4519", "dark": "#F2A56D"},
}
"""Theme properties that components use and that come from Streamlit, not from ``config.toml``."""


@cache
def themes() -> dict[str, dict[str, str]]:
    """Return the custom properties that Streamlit sets and our components use, for both themes."""
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
    """Components on a page of their own, and the Python run behind them.

    Attributes
    ----------
    page
        The page on which they are mounted.
    """

    def __init__(self, page: Page, show: Show) -> None:
        self.page = page
        self._app = AppTest.from_string(RUN, default_timeout=SCRIPT_TIMEOUT_S)
        self._answered = 0
        self.hand_over(show)

    def hand_over(self, show: Show) -> None:
        """Show the components of a run; those already shown receive the changes or are removed."""
        self._app.session_state.show = show
        self._run(WidgetStates())

    def sent(self) -> list[dict[str, Any]]:
        """Return everything that the components have sent to the server, oldest first."""
        return sent(self.page)

    def answer(self) -> None:
        """Pass the new messages to Python one at a time, and show its answers."""
        for one in self.sent()[self._answered :]:
            if one["kind"] == "state":
                told = WidgetState(id=one["id"], json_value=json.dumps({one["event"]: one["value"]}))
            else:
                value = json.dumps([{"event": one["event"], "value": one["value"]}])
                told = WidgetState(id=TRIGGER.format(one["id"]), json_trigger_value=value)
            self._run(WidgetStates(widgets=[told]))
            self._answered += 1

    def said(self) -> str:
        """Return the texts of the run, grouped by kind of element."""
        texts = (*self._app.markdown, *self._app.success, *self._app.warning, *self._app.caption)
        return "\n".join(one.value for one in texts)

    def _run(self, told: WidgetStates) -> None:
        self._app._run(told)  # AppTest has no public API for values from components
        assert not self._app.exception, self._app.exception
        parts = [_described(element.proto) for element in self._app.get("bidi_component")]
        self.page.evaluate("(text) => handOver(text)", json.dumps({"themes": themes(), "parts": parts}))


def box_of(found: Locator) -> FloatRect:
    """Return where an element lies on the screen, px."""
    box = found.bounding_box()
    assert box is not None
    return box


def drag(page: Page, *places: tuple[float, float], finger: bool = False) -> None:
    """Press the mouse or a finger at the first of some places on the screen, px, and release it at the last."""
    touch = page.context.new_cdp_session(page) if finger else None
    for number, (x, y) in enumerate(places):
        if touch is not None:
            kind = "touchMove" if number else "touchStart"
            touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [{"x": x, "y": y}]})
            continue
        page.mouse.move(x, y, steps=4)
        if not number:
            page.mouse.down()
    if touch is None:
        page.mouse.up()
    else:
        touch.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
        touch.detach()


@contextmanager
def redrawn(canvas: Locator) -> Iterator[None]:
    """Wait until a canvas is redrawn: pictures are decoded in the background, which can take long."""
    before = canvas.evaluate("(canvas) => canvas.toDataURL()")
    yield
    drawn_anew = "([canvas, before]) => canvas.toDataURL() !== before"
    canvas.page.wait_for_function(drawn_anew, arg=[canvas.element_handle(), before])


def sent(page: Page) -> list[dict[str, Any]]:
    """Return everything that the components of a page have sent to the server, oldest first."""
    found: list[dict[str, Any]] = page.evaluate("sent")
    return found


def _described(part: BidiComponent) -> dict[str, Any]:
    kind = part.WhichOneof("data")
    assert kind in {"json", "bytes"}, f"{part.component_name} is handed {kind}"
    assert part.isolate_styles
    return dict(MessageToDict(part, preserving_proto_field_name=True))


ShowParts = Callable[..., Parts]


@contextmanager
def parts_alone(browser: Browser) -> Iterator[ShowParts]:
    """Yield a function that opens pages with the components that functions draw; fail if a page met an error."""
    with pytest.MonkeyPatch.context() as patch, faultless_pages(browser, HERE.as_uri()) as opened:
        # Streamlit scans all installed packages for components in every run.
        patch.setattr(manifest_scanner, "scan_component_manifests", cache(manifest_scanner.scan_component_manifests))

        def shown(show: Show, **options: Any) -> Parts:
            return Parts(opened("parts.html", **options), show)

        yield shown
