"""Components tested alone elsewhere, here on their pages; ``test_pages`` covers Sensor lag on its own open page."""

from __future__ import annotations

from tests.browser import in_place
from tests.browser.visits import OpenPage


def test_rocketman(open_page: OpenPage) -> None:
    in_place.rocketman(open_page("Rocketman_search"))


def test_depth_maps(open_page: OpenPage) -> None:
    in_place.depth_maps(open_page("Depth_maps?pair=cube&overlap=0.9", scheme="dark", width=420))
