"""The panels of the page Sensor lag alone, used with mouse and keyboard."""

import re
from functools import cache

import numpy as np
from playwright.sync_api import Locator, expect

from stereolag import SignalLag, signal_lag
from stereolag.core.searches import LagSearch
from stereolag.ui.lag.inputs import RecordingPair, example_recordings
from stereolag.ui.lag.panels import fool_it, show_phasors, show_plan, slide_by_hand
from tests.browser.axe import check
from tests.browser.parts import ShowParts, box_of, drag, sent
from tests.browser.visits import expect_fitting, turned_dark


def painted(panel: Locator) -> int:
    """Return the number of lags at which the curve of a panel is drawn."""
    return len(re.findall("[ML]", panel.locator(".curve").get_attribute("d") or ""))


@cache
def measured() -> tuple[RecordingPair, SignalLag, LagSearch]:
    """Return the first example, its lag and the settings."""
    pair = example_recordings("coast")
    return pair, signal_lag(pair.signal_1, pair.signal_2), LagSearch()


# A cut slid over a recording


def test_the_curve_grows_where_one_has_been_and_play_paints_the_rest(show_parts: ShowParts) -> None:
    page = show_parts(lambda: slide_by_hand(*measured()[:2]), moving=True).page
    stage, where = page.locator(".sliding .stage"), page.locator(".sliding .where")
    said = page.locator(".sliding .said")
    expect(page.locator(".sliding .try")).to_contain_text("40 points of sensor 1")
    page.get_by_role("button", name="Seven numbers").click()
    expect(where).to_have_text("Lag 0 · sum 10")
    stage.scroll_into_view_if_needed()
    box = box_of(page.locator(".sliding svg"))
    pitch = (box["width"] - 64) / 20
    drag(page, *((box["x"] + 6 + (sample + 0.5) * pitch, box["y"] + 60) for sample in (3, 11)))
    expect(where).to_have_text("Lag 8 · sum 72")
    assert painted(page.locator(".sliding")) == 9
    assert page.locator(".sliding .peak").count() == 0
    stage.press("ArrowRight")
    expect(where).to_have_text("Lag 9 · sum −18")
    stage.press("End")
    expect(where).to_have_text("Lag 13 · sum 27")
    assert painted(page.locator(".sliding")) == 11  # the jump skipped three
    expect(said).to_have_text("")
    stage.press(" ")
    expect(where).to_have_text("Lag 8 · sum 72")
    expect(said).to_contain_text("peak is at lag 8")
    assert painted(page.locator(".sliding")) == 14
    expect(page.locator(".sliding .peak")).to_have_count(1)
    expect(stage).to_have_attribute("aria-valuenow", "8")

    page.emulate_media(reduced_motion="reduce")  # playing it once is enough
    page.get_by_role("button", name="Loud stretch").click()
    expect(where).to_contain_text("Lag 0 ·")
    assert painted(page.locator(".sliding")) == 1
    page.locator(".sliding .play").click()
    expect(said).to_contain_text("loud stretch wins")
    page.get_by_role("checkbox", name="Normalise").check()
    expect(said).to_contain_text("lag 90, reaches 1")
    stage.press("Home")
    stage.press("Shift+ArrowRight")
    expect(where).to_contain_text(re.compile(r"^Lag 10 · correlation "))
    page.locator(".sliding .clear").click()
    expect(said).to_have_text("")
    assert sent(page) == []

    turned_dark(page, width=390)
    page.get_by_role("button", name="Pure tone").click()
    page.locator(".sliding .play").click()
    expect(page.locator(".sliding .peak")).to_have_count(10)
    expect_fitting(page, 390)
    check(page, "sliding", only="main")


# Arrows turned back; what is painted and played is shared with the cut above


def drag_in(drawing: Locator, *places: tuple[float, float]) -> None:
    """Drag through places of a drawing, in fractions of its size."""
    drawing.evaluate("drawing => drawing.scrollIntoView({ block: 'center' })")
    box = box_of(drawing)
    drag(drawing.page, *((box["x"] + x * box["width"], box["y"] + y * box["height"]) for x, y in places))


def test_the_arrows_line_up_at_the_true_lag_with_keyboard_and_mouse(show_parts: ShowParts) -> None:
    page = show_parts(lambda: show_phasors(*measured())).page
    root = page.locator(".phasors")
    slider, where, said = (root.locator(f".{name}") for name in ("lag", "where", "said"))
    controls, charts = (box_of(root.locator(f".{name}")) for name in ("controls", "charts"))
    assert controls["y"] + controls["height"] <= charts["y"]  # it lies over no figure
    slider.scroll_into_view_if_needed()
    expect(where).to_have_text(re.compile(r"^Lag 0 · correlation "))
    slider.focus()
    for _ in range(16):
        page.keyboard.press("ArrowRight")
    expect(where).to_have_text("Lag 4 · correlation 1.00")
    expect(root.locator(".curve")).to_have_css("fill", "none")  # the panel has the styles of the other drawings
    expect(slider).to_have_attribute("aria-valuetext", "Lag 4 · correlation 1.00")
    assert root.locator(".arrow").count() > 50  # of 62; the others are shorter than a pixel
    edges = root.locator(".arrow").evaluate_all(
        "all => all.map(one => one.getBoundingClientRect()).flatMap(({ top, bottom }) => [top, bottom])"
    )
    assert max(edges) - min(edges) < 8  # straight

    root.get_by_role("button", name="Coast, up close").click()
    expect(where).to_contain_text("Lag 0 (50,070 in the recordings)")
    drag_in(root.locator(".lags"), (0.01, 0.5), (0.99, 0.5))
    expect(slider).to_have_value("12")
    assert painted(root) == 97  # from one end to the other
    drag_in(root.locator(".phases"), (0.4, 0.6), (0.5, 0.2), (0.97, 0.15))  # two turns at half a turn per sample
    expect(slider).to_have_value(re.compile(r"3\.5|3\.75|4|4\.25|4\.5"))
    root.locator(".play").click()
    expect(where).to_have_text("Lag 4 (50,082 in the recordings) · correlation 0.99")
    expect(said).to_contain_text("The peak is broad")
    root.get_by_role("checkbox", name="Whiten").check()
    expect(where).to_have_text("Lag 4 (50,082 in the recordings) · correlation, all frequencies equal 0.88")
    expect(said).to_contain_text("needle")
    root.locator(".clear").click()
    expect(said).to_have_text("")
    assert sent(page) == []

    turned_dark(page, width=420)
    root.get_by_role("button", name="One tone").click()
    root.locator(".play").click()
    expect(root.locator(".where")).to_have_text("Lag −1 · correlation 1.00")
    expect(root.locator(".peak")).to_have_count(5)
    expect_fitting(page, 420)
    check(page, "phasors", only="main")


# Recordings disturbed


def test_a_drag_asks_now_and_then_and_its_last_position_is_answered(show_parts: ShowParts) -> None:
    parts = show_parts(lambda: fool_it(*measured()))
    page, root = parts.page, parts.page.locator(".disturbances")
    verdict, said = root.locator(".verdict"), root.locator(".said")

    def slider(name: str) -> Locator:
        return root.locator(f"input[name={name}]")

    def answered(**asked: int) -> None:
        taken = "asked => Object.entries(asked).every(([name, value]) => sent.at(-1)?.value[name] === value)"
        page.wait_for_function(taken, arg=asked)
        parts.answer()

    expect(verdict).to_have_text("Sure: recording 2 lags by 640 samples.")
    expect(said).to_contain_text("The peak is at 640 because")
    drag_in(slider("noise"), (0.33, 0.5), (0.5, 0.5), (0.7, 0.5), (0.99, 0.5))
    answered(noise=30)
    assert len(parts.sent()) < 10
    expect(verdict).to_have_text("Nothing in common found: the highest point is at chance level.")
    expect(root.locator("svg .peak.doubtful")).to_have_count(2)
    expect(root.locator("svg .curve").first).to_have_css("fill", "none")
    found = root.locator(".numbers").inner_text()
    root.locator(".other").press("Enter")
    answered(draw=1)
    expect(root.locator(".numbers")).not_to_have_text(found)
    slider("noise").press("Home")
    expect(slider("noise")).to_have_attribute("aria-valuetext", "−30\N{NO-BREAK SPACE}dB")
    expect(slider("period")).to_be_disabled()
    slider("repetition").press("End")
    expect(slider("period")).to_be_enabled()
    slider("period").press("Home")
    answered(noise=-30, repetition=100, period=20)
    expect(verdict).to_have_text("Cannot tell: it repeats every 20 samples.")
    expect(root.locator("svg .rival").nth(5)).to_be_attached()

    turned_dark(page, width=420)
    root.get_by_role("button", name="Echo", exact=True).click()
    slider("echo").press("End")
    answered(echo=150, repetition=0)
    expect(verdict).to_have_text("Fooled: sure of 940 samples, but the true lag is 640.")
    expect_fitting(page, 420)
    check(page, "disturbances", only="main")
    page.evaluate("sent.push({ ...sent.at(-1), value: { noise: 99 } })")
    parts.answer()
    expect(verdict).to_have_text("Sure: recording 2 lags by 640 samples.")


# The plan of the sensors and the source


def test_the_source_is_moved_by_mouse_and_keys_and_the_sensors_set_apart(show_parts: ShowParts) -> None:
    noise = np.random.default_rng(0).normal(size=3000)
    pair, _, _ = measured()
    result = signal_lag(noise[1000:], noise[:-1000], sampling_rate=1000)  # one second
    page = show_parts(lambda: show_plan(pair, result, LagSearch(speed=300.0))).page
    plan = page.locator(".plan")
    said, stage = plan.locator(".said"), plan.locator(".stage")
    expect(said).to_contain_text("sensor 2 is")
    expect(said).to_contain_text("apart")
    expect(plan.locator("output")).to_have_text("450 m")
    plan.get_by_role("button", name="In line").click()
    expect(said).to_contain_text("450 m longer")
    expect(said).to_contain_text("the path difference equals their distance")
    plan.get_by_role("button", name="Equidistant").click()
    expect(said).to_contain_text("the lag is 0")
    stage.press("Shift+ArrowRight")
    expect(said).to_contain_text("The path to sensor 1 is")
    drag_in(stage, (0.5, 0.17), (0.1, 0.5))
    expect(said).to_contain_text("450")
    plan.locator("input").focus()
    page.keyboard.press("Home")
    expect(plan.locator("output")).to_have_text("300 m")
    plan.get_by_role("button", name="In line").click()
    expect(said).to_contain_text(re.compile(r"300\sm longer.*This is your lag\."))
    assert sent(page) == []
    turned_dark(page, width=390)
    check(page, "plan", only="main")
