"""The pictures of the README, taken from the app with its bundled examples: ``python -m tools.screenshots [name ...]``.

Each shows the relevant part of a page, in light and in dark, in a browser of fixed size.
"""

from __future__ import annotations

import io
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image
from playwright.sync_api import Locator, Page, expect

from stereolag.samples import drives
from stereolag.sequences import example_sequence
from tests.browser.fake_media import played_cameras
from tests.browser.serving import CHROMIUM, chromium, chromium_path, served_app
from tests.browser.visits import TIMEOUT_MS, OpenPage, faultless_pages, settled

FOLDER = Path(__file__).resolve().parents[1] / "docs" / "screens"
SCHEMES = ("light", "dark")

WIDTH = 1660
"""Width of a picture, px: GitHub shows it at half that size, and on dense screens at full resolution."""

SCALE = 2
"""Device pixels per CSS pixel; the picture is then reduced to `WIDTH`."""

MARGIN = 14
"""Margin around the shown part of the page, CSS px."""

FADING_MS = 500
"""Time for which elements of the previous run stay dim once they are current again, ms."""

MAX_BYTES = 140_000
"""Largest size of a picture's file, bytes."""

QUALITIES = range(82, 30, -6)
"""Qualities of WebP from best to worst; the first with a small enough file is used."""


@dataclass(frozen=True)
class Shot:
    """A picture to take.

    Attributes
    ----------
    path
        The page with its settings, below the app's address.
    width, height
        Size of the window, CSS px: everything shown must fit without scrolling.
    prepare
        Brings the open page into the desired state, and returns the elements that the picture spans.
    picture_width
        Width of the picture, px; smaller for one full of detail, to limit its file.
    """

    path: str
    width: int
    height: int
    prepare: Callable[[Page], Sequence[Locator]]
    picture_width: int = WIDTH


def bench(page: Page) -> Sequence[Locator]:
    """Show four maps of one pair, all read at one crosshair."""
    for preset in ("Fast", "Accurate"):
        page.get_by_role("button", name=preset).first.click()
        settled(page)
    figure = page.locator("figure", has=page.locator("figcaption").get_by_text("Convolution", exact=True))
    viewport = figure.locator(".viewport")
    shape, box = viewport.locator("svg").first.get_attribute("viewBox"), viewport.bounding_box()
    assert shape is not None
    assert box is not None
    cols, rows = map(float, shape.split()[2:])
    row, col = 237, 682
    viewport.hover(position={"x": (col + 0.5) / cols * box["width"], "y": (row + 0.5) / rows * box["height"]})
    expect(page.locator(".where")).to_have_text(f"row {row}, column {col}")
    return page.locator(".st-key-bench-controls"), page.locator(".st-key-bench-result")


def lag(page: Page) -> Sequence[Locator]:
    """Show the verdict on two recordings, an excerpt slid to where it fits, and the curve beside it."""
    stage = page.locator(".sliding .stage")
    for _ in range(9):
        stage.press("Shift+ArrowRight")
    stage.blur()
    return page.locator(".st-key-bench-controls"), page.locator(".st-key-bench-result")


def search(page: Page) -> Sequence[Locator]:
    """Show Rocketman framed in the maze, and the template dragged half way to him."""
    stage = page.locator(".by-hand .stage")
    for _ in range(6):
        stage.press("Shift+ArrowRight")
        stage.press("Shift+ArrowDown")
    stage.blur()
    return page.locator(".st-key-bench-controls"), page.locator(".by-hand .bar")


def match(page: Page) -> Sequence[Locator]:
    """Show why a window was matched at its place."""
    page.get_by_role("radio", name="Why this match?", exact=True).click()
    settled(page)
    page.get_by_role("button", name="A pattern that repeats").click()
    settled(page)
    return page.get_by_role("heading", name="Look closer"), page.locator(".linked").last.locator(".hint")


def driving(page: Page) -> Sequence[Locator]:
    """Show maps of a drive by two methods beside the ground truth, in the middle of the drive."""
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
    """Show the error of every pair, and the corners found in one."""
    return page.locator(".st-key-bench-controls"), page.locator(".st-key-bench-result")


SHOTS = {
    "bench": Shot("Depth_maps?pair=road&maps=correlation,bm,sgbm,sgm", 1320, 1200, bench),
    "lag": Shot("Sensor_lag", 1320, 1200, lag),
    "search": Shot("Rocketman_search", 1320, 1200, search, picture_width=1245),
    "match": Shot("Depth_maps?pair=fence", 1060, 3000, match),
    "driving": Shot("Driving", 1320, 1800, driving),
    "calibrate": Shot("Calibrate", 1320, 1200, calibrating),
}


def take(open_page: OpenPage, shot: Shot, scheme: str) -> Image.Image:
    """Return the picture of a page."""
    page = open_page(shot.path, scheme=scheme, width=shot.width)
    page.emulate_media(reduced_motion="reduce")
    page.set_viewport_size({"width": shot.width, "height": shot.height})
    settled(page)
    elements = shot.prepare(page)
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
    height = math.ceil(picture.height * shot.picture_width / picture.width)
    return picture.resize((shot.picture_width, height), Image.Resampling.LANCZOS)


FILM = "live"
"""Name of the film of a live camera."""

FILM_FRAMES = 14
FILM_STEP = 4
"""Frames of the drive from one frame of the film to the next."""

FILM_FRAME_MS = 200
FILM_WIDTH = 760
FILM_MAX_BYTES = 300_000


def film(open_page: OpenPage, scheme: str) -> list[Image.Image]:
    """Return the pictures of a film: the example drive as a live camera."""
    sequence = example_sequence(next(iter(drives().values())))
    frames = [sequence.frame(FILM_STEP * number) for number in range(FILM_FRAMES)]
    camera = played_cameras(drive=[np.hstack([one.left, one.right]) for one in frames])
    page = open_page("Depth_maps", scheme=scheme, width=1320, script=camera)
    page.locator("summary").filter(has_text="Choose a pair").click()
    settled(page)
    page.get_by_role("radio", name="Live camera").click()
    settled(page)
    page.get_by_role("button", name="Fast", exact=True).click()
    settled(page)
    page.get_by_role("button", name="Start", exact=True).click()
    result = page.locator(".st-key-bench-result")
    expect(result.locator(".viewport")).to_have_count(2)
    shown = []
    for number in range(FILM_FRAMES):
        page.evaluate("number => (fakeMedia.frame = number)", number)
        page.wait_for_timeout(2 * FADING_MS)
        picture = Image.open(io.BytesIO(result.screenshot())).convert("RGB")
        shown.append(
            picture.resize((FILM_WIDTH, picture.height * FILM_WIDTH // picture.width), Image.Resampling.LANCZOS)
        )
    page.close()
    return shown


def encoded(pictures: Sequence[Image.Image], max_bytes: int = MAX_BYTES) -> bytes:
    """Return a picture or a film as WebP at the best quality that is small enough."""
    for quality in QUALITIES:
        file = io.BytesIO()
        options = (
            {"save_all": True, "append_images": pictures[1:], "duration": FILM_FRAME_MS, "loop": 0}
            if pictures[1:]
            else {}
        )
        pictures[0].save(file, "WEBP", quality=quality, method=6, **options)
        if file.tell() <= max_bytes:
            break
    return file.getvalue()


def main(names: Sequence[str]) -> None:
    """Take the named pictures, or all pictures."""
    path = chromium_path()
    if path is None:
        raise SystemExit(f"There is no Chromium at $CHROMIUM nor at {CHROMIUM[-1]}.")
    FOLDER.mkdir(exist_ok=True)
    expect.set_options(timeout=4 * TIMEOUT_MS)  # enough for computing a whole drive
    with (
        served_app() as address,
        chromium(path, scale=SCALE) as browser,
        faultless_pages(browser, address) as open_page,
    ):
        for name in names or [*SHOTS, FILM]:
            for scheme in SCHEMES:
                pictures = film(open_page, scheme) if name == FILM else [take(open_page, SHOTS[name], scheme)]
                picture, file = pictures[0], FOLDER / f"{name}-{scheme}.webp"
                file.write_bytes(encoded(pictures, FILM_MAX_BYTES if name == FILM else MAX_BYTES))
                print(f"{file.name}: {picture.width} × {picture.height} px, {file.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main(sys.argv[1:])
