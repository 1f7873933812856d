"""The pictures of the README, taken of the app on its bundled examples: ``python -m tools.screenshots [name ...]``.

Each is the part of a page that matters, once light and once dark, in a browser of fixed size.
"""

from __future__ import annotations

import io
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from PIL import Image
from playwright.sync_api import Locator, Page, expect

from tests.browser.depth_page import DepthPage
from tests.browser.serving import CHROMIUM, chromium, chromium_path, served_app
from tests.browser.visits import TIMEOUT_MS, OpenPage, expect_visible, faultless_pages, settled

FOLDER = Path(__file__).resolve().parents[1] / "docs" / "screens"
SCHEMES = ("light", "dark")

WIDTH = 1660
"""Px of a picture: GitHub shows it half as wide, to dense screens in full."""

SCALE = 2
"""Of the browser's px; then reduced to `WIDTH`."""

MARGIN = 14
"""CSS px of the page around what is shown."""

FADING_MS = 500
"""What was of the run before is dim for as long after it is there again."""

LARGEST = 140_000
"""Bytes of a file."""

QUALITIES = range(82, 30, -6)
"""From the best: the first that is small enough is taken."""


@dataclass(frozen=True)
class Shot:
    """What a picture shows.

    Attributes
    ----------
    path
        The page with its settings, below the app's address.
    width, height
        Of the window, CSS px: nothing that is shown may have to be scrolled to.
    shown
        Brings the open page to what is to be seen, and returns it: all that lies between these elements.
    kept
        Px of the picture in width; fewer where it is full of detail.
    """

    path: str
    width: int
    height: int
    shown: Callable[[Page], Sequence[Locator]]
    kept: int = WIDTH


def bench(page: Page) -> Sequence[Locator]:
    """Four maps of one pair, each read under the one crosshair."""
    visit = DepthPage(page)
    for preset in ("Fast", "Accurate"):
        visit.press(preset)
    visit.hover("Convolution", 237, 682)
    return page.locator(".st-key-depth-bench-controls"), page.locator(".st-key-depth-bench-maps")


def lag(page: Page) -> Sequence[Locator]:
    """The verdict on two recordings, its numbers, the curve, and the recordings shifted to line up."""
    charts = page.get_by_test_id("stPlotlyChart")
    return page.get_by_role("heading", name="hears it"), charts.nth(0), charts.nth(1)


def search(page: Page) -> Sequence[Locator]:
    """Rocketman framed in the maze and enlarged beside it."""
    found = page.get_by_role("heading", name="Found at")
    return found, page.get_by_test_id("stImage").nth(1), page.get_by_test_id("stImage").nth(2)


def match(page: Page) -> Sequence[Locator]:
    """Why a window was matched where it was."""
    visit = DepthPage(page)
    visit.choose("Why this match?")
    visit.press("A pattern that repeats")
    return page.get_by_role("heading", name="Look closer"), visit.pictures.locator(".hint")


def driving(page: Page) -> Sequence[Locator]:
    """Maps of a drive by two methods beside the truth, in the middle of it."""
    page.get_by_text("True disparity", exact=True).first.click()
    settled(page)
    expect(page.get_by_text("decoded, matched, coloured")).to_be_visible()
    settled(page)
    player = page.locator(".player")
    player.focus()
    for _ in range(24):
        page.keyboard.press("ArrowRight")
    player.blur()
    return (player,)


def calibrating(page: Page) -> Sequence[Locator]:
    """The error of every pair, the corners found in one, and where the board has been."""
    pairs = page.get_by_role("heading", name="Pair by pair")
    expect_visible(pairs)
    settled(page)
    pictures = page.get_by_test_id("stImage")
    return pairs, pictures.nth(0), pictures.last


SHOTS = {
    "bench": Shot("Depth_maps?pair=road&maps=correlation,bm,sgbm,sgm", 1320, 1200, bench),
    "lag": Shot("Sensor_lag", 1060, 1500, lag),
    "search": Shot("Rocketman_search", 1060, 1500, search, kept=1245),
    "match": Shot("Depth_maps?pair=fence", 1060, 3000, match),
    "driving": Shot("Driving", 1320, 1800, driving),
    "calibrate": Shot("Calibrate", 1060, 2600, calibrating),
}


def taken(open_page: OpenPage, shot: Shot, scheme: str) -> Image.Image:
    """Return the picture of a page."""
    page = open_page(shot.path, scheme=scheme, width=shot.width)
    page.emulate_media(reduced_motion="reduce")
    page.set_viewport_size({"width": shot.width, "height": shot.height})
    settled(page)
    elements = shot.shown(page)
    settled(page)
    expect(page.locator("[data-testid=stTooltipContent], [data-stale=true]")).to_have_count(0)
    page.wait_for_timeout(FADING_MS)
    boxes = [one.bounding_box() for one in elements]
    left, top = (min(box[side] for box in boxes if box) for side in ("x", "y"))
    right = max(box["x"] + box["width"] for box in boxes if box)
    bottom = max(box["y"] + box["height"] for box in boxes if box)
    x, y = max(0, left - MARGIN), max(0, top - MARGIN)
    clip = {"x": x, "y": y, "width": right + MARGIN - x, "height": bottom + MARGIN - y}
    picture = Image.open(io.BytesIO(page.screenshot(clip=clip))).convert("RGB")  # type: ignore[arg-type]
    page.close()
    return picture.resize((shot.kept, math.ceil(picture.height * shot.kept / picture.width)), Image.Resampling.LANCZOS)


def encoded(picture: Image.Image) -> bytes:
    """Return a picture as WEBP of the best quality that is small enough."""
    for quality in QUALITIES:
        file = io.BytesIO()
        picture.save(file, "WEBP", quality=quality, method=6)
        if file.tell() <= LARGEST:
            break
    return file.getvalue()


def main(names: Sequence[str]) -> None:
    """Take the pictures of these names, or all."""
    path = chromium_path()
    if path is None:
        raise SystemExit(f"There is no Chromium at $CHROMIUM nor at {CHROMIUM[-1]}.")
    FOLDER.mkdir(exist_ok=True)
    expect.set_options(timeout=4 * TIMEOUT_MS)  # as long as computing a whole drive may take
    with (
        served_app() as address,
        chromium(path, scale=SCALE) as browser,
        faultless_pages(browser, address) as open_page,
    ):
        for name in names or SHOTS:
            for scheme in SCHEMES:
                picture = taken(open_page, SHOTS[name], scheme)
                file = FOLDER / f"{name}-{scheme}.webp"
                file.write_bytes(encoded(picture))
                print(f"{file.name}: {picture.width} × {picture.height} px, {file.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main(sys.argv[1:])
