"""Latency from moving a slider to the new picture, in a real Chromium."""

from __future__ import annotations

import statistics

from playwright.sync_api import Locator, Page

from tests.browser.serving import chromium, chromium_path, served_app
from tests.browser.visits import read_script, settled

MOVES = 15

STAGE = """() => {
  const hosts = [...document.querySelectorAll('*')].filter((one) => one.shadowRoot);
  window.stage = hosts.map((one) => one.shadowRoot.querySelector('.stage')).find((one) => one);
}"""
"""Script that finds the stage inside a component in which the maps are drawn."""

WATCH = """(index) => new Promise((resolve) => {
  const shown = () => window.stage.children[index]?.querySelector('canvas')?.seen;
  const before = shown();
  let start = Infinity;
  document.addEventListener('keydown', ({ timeStamp }) => { start = timeStamp; }, { capture: true, once: true });
  const look = () => {
    if (shown() && shown() !== before) resolve(performance.now() - start);
    else requestAnimationFrame(look);
  };
  requestAnimationFrame(look);
})"""


def moved(page: Page, slider: Locator, key: str, image: int) -> float:
    """Move a focused slider by one step and return the milliseconds from the key until its new map is drawn."""
    slider.focus()
    # Does not return the promise, because Playwright would await it before the key is pressed.
    page.evaluate(f"() => {{ window.waiting = ({WATCH})({image}) }}")
    page.keyboard.press(key)
    return float(page.evaluate("window.waiting"))


def latency_table() -> tuple[str, dict[str, float]] | None:
    """Return the latencies as Markdown and as figures; None without Chromium."""
    path = chromium_path()
    if path is None:
        return None
    figures: dict[str, float] = {}
    with served_app() as url, chromium(path) as browser:
        page = browser.new_page(viewport={"width": 1400, "height": 900})
        page.add_init_script(read_script("answers"))
        page.goto(f"{url}/Depth_maps?pair=road")
        settled(page)
        settled(page)
        page.evaluate(STAGE)
        for name, tab, label, image in (
            ("Convolution, window", "Convolution", "Window", 0),
            ("StereoBM, block", "StereoBM", "Block", 1),
        ):
            page.get_by_role("radio", name=tab, exact=True).click()
            settled(page)
            slider = page.get_by_role("slider", name=label)
            times = []
            for _ in range(MOVES):
                times.append(moved(page, slider, "ArrowRight", image))
                settled(page)
            figures[f"{name}: median ms"] = round(statistics.median(times), 1)
            figures[f"{name}: slowest ms"] = round(max(times), 1)
    lines = ["| from slider to picture, 881 × 400 | ms | must (median) | aim |", "|---|---|---|---|"]
    lines += [f"| {name} | {value:g} | ≤ 100 | ≤ 70 |" for name, value in figures.items()]
    return "\n".join(lines), figures
