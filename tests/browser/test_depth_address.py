from __future__ import annotations

import re

from playwright.sync_api import expect

from tests.browser.visits import OpenPage, settled


def test_a_link_opens_the_depth_page_as_it_was_and_the_way_back_leads_there(open_page: OpenPage) -> None:
    page = open_page("Depth_maps?pair=square&window_size=31&bm.block_size=9")
    window, block = page.get_by_role("slider", name="Window"), page.get_by_role("slider", name="Block")
    expect(window).to_have_value("31")
    page.get_by_role("radio", name="StereoBM").click()
    expect(block).to_have_value("9")
    page.get_by_role("radio", name="Convolution").click()
    page.get_by_role("button", name="Fast").click()
    expect(window).to_have_value("11")
    expect(page).to_have_url(re.compile("pair=square&window_size=11.*left_right=on.*bm.block_size=9"))
    settled(page)
    page.go_back()
    expect(window).to_have_value("31")
    settled(page)
    page.get_by_role("button", name="Reset").click()
    expect(window).to_have_value("20")
    expect(page).to_have_url(re.compile(r"Depth_maps\?pair=square$"))
