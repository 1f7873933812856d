"""axe-core on an open page: what it finds, in the light and in the dark, and what has no alternative text."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from typing import Any, NamedTuple

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page, expect

from tests.browser.visits import SCREENSHOTS, settled

REPORT = SCREENSHOTS / "axe.json"
"""Of the last run: axe's version, and the findings of every state of every page by rule, those let pass too."""

FAULTS = ("moderate", "serious", "critical")

EXCEPTIONS: dict[str, tuple[str, ...]] = {}
"""Rules that Streamlit's own markup breaks where nothing here can mend it: parts of the selector axe gives."""

FIND = """
async ([exclude, options]) => (await axe.run({ include: [["html"]], exclude }, options)).violations
"""
COLOURS_ALONE = {"runOnly": {"type": "rule", "values": ["color-contrast"]}}

NAMELESS = """
() => {
  const nameless = [];
  const look = (root) => {
    for (const one of root.querySelectorAll("*")) {
      if (one.shadowRoot) look(one.shadowRoot);
      if (!one.matches("img, canvas, svg, [data-testid=stPlotlyChart]") || !one.checkVisibility()) continue;
      if (one.closest("[aria-hidden=true], [role=img] *, button, [role=button]")) continue;
      if (one.closest("[data-testid=stDataFrame], #js-plotly-tester")) continue; // a table for readers lies beside; no part of the page
      if (one.closest("[data-testid=stPlotlyChart]") && !one.matches("[data-testid=stPlotlyChart]")) continue;
      const named = one.matches("img") ? one.hasAttribute("alt") : one.getAttribute("aria-label");
      if (!named) nameless.push(one.outerHTML.slice(0, 120));
    }
  };
  look(document);
  return nameless;
}
"""
"""Pictures, drawings and charts that are seen and neither named nor decoration; in buttons the button has the name."""


class Finding(NamedTuple):
    """What a rule finds fault with: the rule, how grave it is, and the selectors of the elements."""

    rule: str
    impact: str
    targets: tuple[str, ...]


class Audit:
    """The findings of all pages looked at."""

    def __init__(self) -> None:
        self._script = Axe().axe_script
        self._report: dict[str, dict[str, int]] = {}
        self._version = ""

    def check(self, page: Page, state: str, *, but: Sequence[str] = ()) -> None:
        """Expect no fault in what a page shows, `but` in some of its parts, in the light and in the dark.

        All rules are held in the theme that it has; then it is turned to the other, for its colours, and stays so.
        """
        app = page.get_by_test_id("stApp")
        theme = app.evaluate("(app) => getComputedStyle(app).colorScheme")
        other = "light" if theme == "dark" else "dark"
        found = self._findings(page, but, {})
        nameless = page.evaluate(NAMELESS)
        page.emulate_media(color_scheme=other)  # type: ignore[arg-type]
        expect(app).to_have_css("color-scheme", other)
        settled(page)
        colours = self._findings(page, but, COLOURS_ALONE)
        for shown, findings in ((theme, found), (other, colours)):
            self._report[f"{state}, {shown}"] = Counter({one.rule: len(one.targets) for one in findings})
        faults = [one for one in map(_inexcusable, [*found, *colours]) if one.targets and one.impact in FAULTS]
        assert not faults, f"{state}: {faults}"
        assert not nameless, f"{state}: no alternative text: {nameless}"

    def keep(self) -> None:
        """Write the report."""
        SCREENSHOTS.mkdir(exist_ok=True)
        report = {"axe-core": self._version, "findings": self._report}
        REPORT.write_text(json.dumps(report, indent=1), encoding="utf-8")

    def _findings(self, page: Page, but: Sequence[str], options: dict[str, Any]) -> list[Finding]:
        if not page.evaluate("'axe' in window"):
            page.evaluate(self._script)
        self._version = page.evaluate("axe.version")
        violations = page.evaluate(FIND, [[[one] for one in but], options | {"resultTypes": ["violations"]}])
        return [
            Finding(one["id"], one["impact"], tuple(_selector(node["target"]) for node in one["nodes"]))
            for one in violations
        ]


def _selector(target: list[Any]) -> str:
    """Return the selector of an element; within a shadow root axe gives one for each root on the way."""
    return " >> ".join(one if isinstance(one, str) else " >> ".join(one) for one in target)


def _inexcusable(finding: Finding) -> Finding:
    """Return a finding without the elements that are excepted."""
    excepted = EXCEPTIONS.get(finding.rule, ())
    return finding._replace(
        targets=tuple(target for target in finding.targets if not any(part in target for part in excepted))
    )
