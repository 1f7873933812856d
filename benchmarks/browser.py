"""How fast it feels: from letting go of a slider to the new picture, in a real Chromium."""

from __future__ import annotations

import statistics

from playwright.sync_api import Locator, Page

from tests.browser.serving import chromium, chromium_path, served_app
from tests.browser.visits import settled

MOVES = 15

WATCH = """(index) => new Promise((resolve) => {
  const image = () => document.querySelectorAll('[data-testid=stImage] img')[index];
  const before = image().src;
  const start = performance.now();
  const look = () => {
    const now = image();
    if (now && now.src !== before && now.complete) resolve(performance.now() - start);
    else requestAnimationFrame(look);
  };
  requestAnimationFrame(look);
})"""


def moved(page: Page, slider: Locator, key: str, image: int) -> float:
    """Move a focused slider by one step and return the milliseconds until its new map is drawn."""
    slider.focus()
    # Not the promise itself: that would be waited for before the key is pressed.
    page.evaluate(f"() => {{ window.waiting = ({WATCH})({image}) }}")
    page.keyboard.press(key)
    return float(page.evaluate("window.waiting"))


def latency_table() -> tuple[str, dict[str, float]] | None:
    """Return the medians as Markdown and as figures; None where there is no Chromium."""
    path = chromium_path()
    if path is None:
        return None
    figures: dict[str, float] = {}
    with served_app() as url, chromium(path) as browser:
        page = browser.new_page(viewport={"width": 1280, "height": 1600})
        page.goto(f"{url}/Depth_maps")
        settled(page)
        page.get_by_text("Motorway", exact=True).first.click()
        settled(page)
        for name, label, image in (("Convolution, window", "Window", 1), ("StereoBM, block", "Block", 2)):
            slider = page.get_by_role("slider", name=label)
            times = [moved(page, slider, "ArrowRight", image) for _ in range(MOVES)]
            settled(page)
            figures[f"{name}: median ms"] = round(statistics.median(times), 1)
            figures[f"{name}: slowest ms"] = round(max(times), 1)
    lines = ["| from slider to picture, 881 × 400 | ms | must (median) | aim |", "|---|---|---|---|"]
    lines += [f"| {name} | {value:g} | ≤ 250 | ≤ 120 |" for name, value in figures.items()]
    return "\n".join(lines), figures
