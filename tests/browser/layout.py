"""The layout of a page: parts that are cut off, and parts that jump while an answer is computed."""

from __future__ import annotations

from collections.abc import Callable

from playwright.sync_api import Page

from tests.browser.visits import resized

PATIENCE = 100

CUT = """
() => {
  const main = document.querySelector("[data-testid=stMainBlockContainer]");
  const edge = main.getBoundingClientRect().right + 1;
  const inside = (one) => (one.shadowRoot ? [one, ...all(one.shadowRoot)] : [one]);
  const all = (root) => [...root.querySelectorAll("*")].flatMap(inside);
  const named = (one) => `${one.localName} ${one.textContent.trim().slice(0, 40)}`;
  const handle = (one) => one.matches("input[type=range], input[type=file]"); // drawn by what is around it
  return all(main).filter((one) => {
    if (!one.checkVisibility({ visibilityProperty: true }) || handle(one)) return false;
    const { width, right } = one.getBoundingClientRect();
    const { overflowX, textOverflow } = getComputedStyle(one);
    const clips = ["hidden", "clip"].includes(overflowX) && textOverflow !== "ellipsis" && one.innerText?.trim();
    return width > 1 && (right > edge || (clips && one.scrollWidth > one.clientWidth + 1));
  }).map(named);
}
"""

WATCH_JUMPS = """
() => {
  window.jumps = [];
  const said = (node) => (node?.textContent ?? "").trim().slice(0, 40) || node?.localName;
  // The handle of a slider, with its number, moves by itself.
  const PASSING = "[class*=st-key-working-], [data-testid=stSpinner], [data-testid=stSlider]";
  const passing = (node) => (node?.parentElement ?? node)?.closest?.(PASSING);
  window.jumping = new PerformanceObserver((list) => {
    const moved = list.getEntries().flatMap(({ sources }) => sources);
    for (const { node, previousRect: before, currentRect: now } of moved) {
      if (!before.height || !now.height || passing(node)) continue;
      jumps.push([Math.round(Math.abs(now.y - before.y)), said(node)]);
    }
  });
  jumping.observe({ type: "layout-shift" });
}
"""


def cut(page: Page, width: int) -> list[str]:
    """Return the parts that stick out of the page at a window width, or are cut off without an ellipsis."""
    resized(page, width)
    # A scroll bar for the whole page would be just as bad.
    page.wait_for_function("document.documentElement.scrollWidth <= innerWidth")
    found: list[str] = page.evaluate(CUT)
    for _ in range(PATIENCE):  # charts follow a moment later
        if not found:
            break
        page.wait_for_timeout(100)
        found = page.evaluate(CUT)
    return found


def jumps(page: Page, act: Callable[[], None]) -> list[tuple[int, str]]:
    """Return how far (px, vertically) each visible part of the page moved during an action, and its text."""

    def watched(act: Callable[[], None]) -> list[tuple[int, str]]:
        page.evaluate(WATCH_JUMPS)
        act()
        found: list[tuple[int, str]] = page.evaluate("jumping.disconnect(), jumps")
        return found

    for _ in range(PATIENCE):  # the page may still be settling after it opened
        if not watched(lambda: page.wait_for_timeout(300)):
            break
    found = watched(act)
    return [(far, said) for far, said in found if far]
