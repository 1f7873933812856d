"""What one visitor downloads has an address that nothing of another visitor's leads to."""

from __future__ import annotations

import hashlib
from pathlib import Path

from tests.browser.visits import OpenPage, settled


def test_downloads_have_addresses_of_their_own(open_page: OpenPage) -> None:
    """The same result, made twice by two visitors: the same bytes and yet two addresses."""
    seen: dict[str, str] = {}
    for number in range(2):
        page = open_page("Depth_maps")
        page.get_by_text("Take it away").click()
        settled(page)
        with page.expect_download() as download:
            page.get_by_role("button", name="NPY", exact=True).click()
        content = Path(download.value.path()).read_bytes()
        assert len(content) > 2**20
        seen[download.value.url] = hashlib.sha256(content).hexdigest()
        assert len(seen) == number + 1
        page.close()
    assert len(set(seen.values())) == 1
