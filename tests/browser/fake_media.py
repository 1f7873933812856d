"""Cameras that a test plays in the browser, in place of those of the machine."""

import json
from collections.abc import Sequence

import numpy as np
from playwright.sync_api import Page

from stereolag.core.arrays import Array, Rgb
from stereolag.figures.pictures import data_url, png
from tests.browser.visits import read_script, settled


def played_cameras(**cameras: Sequence[Rgb]) -> str:
    """Return a script that gives a page cameras: by name, the frames of each, of which it shows ``fakeMedia.frame``."""
    frames = {name: [data_url(png(one)) for one in shown] for name, shown in cameras.items()}
    return f"({read_script('cameras')})({json.dumps(frames)});"


def refuse_cameras(page: Page, error: str) -> None:
    """Have the browser refuse cameras with an error of this name from now on; "" allows them again."""
    page.evaluate("(error) => (window.fakeMedia.refuse = error)", error)


def unplug_cameras(page: Page) -> None:
    """End all running cameras, as when they are unplugged."""
    page.evaluate("window.fakeMedia.open.forEach(({ track }) => track.stop())")


def expect_cameras_off(page: Page) -> None:
    assert page.evaluate("fakeMedia.open.every(({ track }) => track.readyState === 'ended')")


def choose_arrangement(page: Page, name: str) -> None:
    page.locator("[class*=-camera-arrangement]").get_by_role("combobox").click()
    page.get_by_role("option", name=name).click()
    settled(page)


def choose_device(page: Page, label: str, device: str) -> None:
    page.locator(".live").get_by_role("combobox", name=label, exact=True).select_option(label=device)


def stereo_scene(seed: int, *, near: int, far: int, shape: tuple[int, int] = (240, 320)) -> tuple[Rgb, Rgb, Array]:
    """Return both views of a near square before a far wall, and the disparities of the left one, px."""
    rows, cols = shape
    generator = np.random.default_rng(seed)
    wall, square = (generator.integers(0, 256, (rows, cols + 128, 3), dtype=np.uint8).repeat(1, 1) for _ in range(2))
    truth = np.full(shape, far)
    inside = slice(rows // 4, 3 * rows // 4), slice(cols // 3, 2 * cols // 3)
    truth[inside] = near
    left, right = wall[:, :cols].copy(), wall[:, far : far + cols].copy()
    left[inside] = square[inside]
    right[inside[0], inside[1].start - near : inside[1].stop - near] = square[inside]
    return left, right, truth
