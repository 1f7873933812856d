"""Two recordings disturbed by sliders: the browser's mixture, and its verdict, which equals the library's."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, Locator, Page, expect

from stereolag import signal_lag
from stereolag.signals import by_hand
from stereolag.ui.lag.disturbances import ARITHMETIC, HERE, described_parts, fool_it
from stereolag.ui.lag.disturbances.words import START
from tests.browser.parts import ShowParts, sent
from tests.browser.visits import expect_fitting, screenshot, turned_dark

GRID = {
    "clean": ({"noise": -30}, "clear"),
    "as loud": ({"noise": 0}, "clear"),
    "just": ({"noise": 10}, "clear"),
    "sunk": ({"noise": 12}, "chance"),
    "drowned": ({"noise": 30, "draw": 3}, "chance"),
    "low teeth": ({"repetition": 50}, "clear"),
    "high teeth": ({"repetition": 90}, "repeats"),
    "noisy teeth": ({"repetition": 80, "noise": 8}, "repeats"),
    "nothing but teeth": ({"repetition": 100, "noise": -30}, "repeats"),
    "tone": ({"repetition": 100, "period": 20}, "repeats"),
    "noisy tone": ({"repetition": 100, "period": 20, "noise": 8}, "rivals"),
    "drowned tone": ({"repetition": 100, "period": 20, "noise": 20}, "chance"),
    "not only a tone": ({"repetition": 90, "period": 20}, "clear"),
    "echo": ({"echo": 60}, "clear"),
    "as loud an echo": ({"echo": 100}, "rivals"),
    "louder echo": ({"echo": 130, "noise": 6}, "clear"),
    "little drift": ({"drift": 1}, "clear"),
    "drift": ({"drift": 6}, "drift"),
    "most drift": ({"drift": 20, "noise": 0}, "drift"),
    "drift in noise": ({"drift": 12, "noise": 6}, "chance"),
    "everything": ({"drift": 3, "noise": 0, "repetition": 90, "echo": 60}, "repeats"),
}


@pytest.fixture(scope="module")
def arithmetic(browser: Browser) -> Iterator[Page]:
    """Return a blank page that can mix and judge."""
    page = browser.new_page()
    for name in ARITHMETIC:
        page.add_script_tag(path=HERE / name)
    page.evaluate(
        "(parts) => { window.parts = { ...parts, fresh: bytes(parts.fresh), pattern: bytes(parts.pattern),"
        " noises: parts.noises.map(bytes) }; }",
        described_parts(),
    )
    yield page
    page.close()


def mixed(page: Page, **changed: float) -> tuple[np.ndarray, np.ndarray]:
    settings = START | {"draw": 0} | changed
    shares = {name: settings[name] / 100 for name in ("repetition", "echo")}
    # As JSON, because Playwright inspects every number separately.
    told = page.evaluate("(it) => JSON.stringify(mixed(parts, it).map((one) => [...one]))", settings | shares)
    first, second = json.loads(told)
    return np.array(first), np.array(second)


def judged(page: Page, first: np.ndarray, second: np.ndarray, reach: int) -> dict[str, Any]:
    code = """(told) => {
      const [one, other, reach] = JSON.parse(told);
      const found = judged(Float64Array.from(one), Float64Array.from(other), reach);
      return JSON.stringify({ ...found, curve: [...found.curve] });
    }"""
    found = json.loads(page.evaluate(code, json.dumps([first.tolist(), second.tolist(), reach])))
    assert isinstance(found, dict)
    return found


def check_verdict(page: Page, first: np.ndarray, second: np.ndarray, reach: int = by_hand.MAX_LAG) -> str:
    """Compare the browser's verdict with the library's answer for the same arrays; return the reason."""
    found = judged(page, first, second, reach)
    expected = signal_lag(first, second, max_lag=reach)
    judgement = expected.judgement
    assert judgement is not None
    assert (found["verdict"], found["reason"]) == (expected.verdict, judgement.reason)
    assert found["lag"] == expected.lag
    assert tuple(found["rivals"]) == expected.rivals
    assert found["spacing"] == (None if judgement.spacing is None else pytest.approx(judgement.spacing))
    assert found["opposite"] == judgement.opposite_lag
    np.testing.assert_allclose(found["curve"], expected.correlation, atol=1e-9)
    for name in ("evidence", "needed", "chance", "height", "ribbon"):
        assert found[name] == pytest.approx(getattr(judgement, name), rel=1e-6), name
    drift = judgement.drift
    assert (found["drift"] is None) == (drift is None)
    for name in ("start", "ppm", "error_ppm", "span", "blocks") if drift else ():
        assert found["drift"][name] == pytest.approx(getattr(drift, name), rel=1e-6), name
    return judgement.reason


@pytest.mark.parametrize("name", GRID)
def test_the_browser_judges_what_it_mixes_as_the_library_does(arithmetic: Page, name: str) -> None:
    settings, reason = GRID[name]
    assert check_verdict(arithmetic, *mixed(arithmetic, **settings)) == reason


def test_the_browser_judges_other_recordings_as_the_library_does(arithmetic: Page) -> None:
    random = np.random.default_rng(0)
    white = random.normal(size=3000)
    clicks = np.zeros((2, 3000))
    clicks[0, 700], clicks[1, 900] = 1.0, 1.0
    hum = np.sin(2 * np.pi * np.arange(6000) / 37.3)
    reasons = [
        check_verdict(arithmetic, white[:2000], -white[300:2500], 1500),
        check_verdict(arithmetic, *(clicks + 1e-3 * random.normal(size=clicks.shape)), reach=2999),
        check_verdict(arithmetic, *random.normal(size=(2, 1500)).cumsum(axis=1), reach=1000),
        check_verdict(arithmetic, *(hum + 2 * random.normal(size=(2, 6000))), reach=3000),
    ]
    assert reasons[:2] == ["opposite_sign", "too_little"]
    assert reasons[3] == "repeats"


def test_what_is_mixed_is_what_the_sliders_say(arithmetic: Page) -> None:
    first, second = mixed(arithmetic, noise=-200)
    lag = by_hand.LAG
    np.testing.assert_allclose(second[lag:], first[:-lag], atol=1e-6)
    assert first.std() == pytest.approx(1.0, abs=0.02)
    noisy, _ = mixed(arithmetic, noise=6)
    assert 20 * np.log10((noisy - first).std()) == pytest.approx(6.0, abs=0.2)
    other, _ = mixed(arithmetic, noise=6, draw=1)
    assert abs(np.corrcoef(noisy - first, other - first)[0, 1]) < 0.05
    _, echoed = mixed(arithmetic, noise=-200, echo=50)
    delay = by_hand.ECHO_DELAY
    np.testing.assert_allclose(echoed[delay:], second[delay:] + 0.5 * second[:-delay], atol=1e-6)
    repeated, _ = mixed(arithmetic, noise=-200, repetition=100, period=40)
    np.testing.assert_allclose(repeated[40:], repeated[:-40], atol=1e-6)
    half, _ = mixed(arithmetic, noise=-200, repetition=50)
    assert np.corrcoef(half[400:], half[:-400])[0, 1] == pytest.approx(0.5, abs=0.07)
    _, drifting = mixed(arithmetic, noise=-200, drift=10)
    lags = [signal_lag(part[0], part[1], max_lag=lag + 20).lag for part in ends(first, drifting)]
    assert lags[1] - lags[0] == pytest.approx(10 * 6000 / by_hand.SAMPLES, abs=1.1)


def ends(first: np.ndarray, second: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the first and the last 2,192 samples of both signals."""
    return [(one[part], other[part]) for part in (slice(2192), slice(-2192, None)) for one, other in [(first, second)]]


@pytest.mark.parametrize("size", [2, 7, 96, 1001])
def test_transforms_of_any_length_are_those_of_numpy(arithmetic: Page, size: int) -> None:
    re, im = np.random.default_rng(size).normal(size=(2, size))
    code = "([re, im]) => { const found = spectrumOf(re, im); return [[...found.re], [...found.im]]; }"
    real, imaginary = arithmetic.evaluate(code, [re.tolist(), im.tolist()])
    np.testing.assert_allclose(np.array(real) + 1j * np.array(imaginary), np.fft.fft(re + 1j * im), atol=1e-9 * size)


@pytest.fixture(scope="module")
def fooling_page(show_parts: ShowParts) -> Page:
    return show_parts(lambda: fool_it(key="lag.fooling")).page


def slider(page: Page, name: str) -> Locator:
    return page.locator(f".disturbances input[name={name}]")


def start(page: Page, name: str) -> None:
    page.locator(".disturbances .examples").get_by_role("button", name=name, exact=True).click()


def test_the_verdict_turns_under_the_mouse_and_the_keyboard(fooling_page: Page) -> None:
    page = fooling_page
    verdict, said = page.locator(".disturbances .verdict"), page.locator(".disturbances .said")
    numbers = page.locator(".disturbances .numbers")
    expect(verdict).to_have_text("Sure: recording 2 lags by 640 samples.")
    expect(said).to_contain_text("The peak is at 640 because")
    slider(page, "noise").scroll_into_view_if_needed()
    box = slider(page, "noise").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + box["width"] / 3, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.98 * box["width"], box["y"] + box["height"] / 2, steps=5)
    page.mouse.up()
    expect(verdict).to_have_text("Nothing in common found: the highest point is at chance level.")
    expect(said).to_contain_text("Noise never lines up")
    expect(page.locator(".disturbances svg .peak.doubtful")).to_have_count(2)
    found = numbers.inner_text()
    page.locator(".disturbances .other").press("Enter")
    expect(numbers).not_to_have_text(found)
    slider(page, "noise").press("Home")
    expect(slider(page, "noise")).to_have_attribute("aria-valuetext", "−30\N{NO-BREAK SPACE}dB")
    expect(verdict).to_have_text("Sure: recording 2 lags by 640 samples.")

    expect(slider(page, "period")).to_be_disabled()
    slider(page, "repetition").press("End")
    expect(verdict).to_have_text("Cannot tell: it repeats every 400 samples.")
    expect(slider(page, "period")).to_be_enabled()
    expect(said).to_contain_text("A tone is nothing but repetition")
    expect(page.locator(".disturbances svg .rival").nth(5)).to_be_attached()
    slider(page, "period").press("Home")
    expect(verdict).to_have_text("Cannot tell: it repeats every 20 samples.")
    expect(said).to_contain_text("The grey band follows")

    start(page, "Echo")
    expect(said).to_contain_text("The smaller peak 300 samples later is the echo.")
    slider(page, "echo").press("End")
    expect(verdict).to_have_text("Fooled: sure of 940 samples, but the true lag is 640.")
    slider(page, "echo").fill("105")
    slider(page, "echo").press("ArrowLeft")
    expect(slider(page, "echo")).to_have_attribute("aria-valuetext", "100\N{NO-BREAK SPACE}%")
    expect(verdict).to_have_text("Cannot tell: 940 samples fits as well.")
    start(page, "Drift")
    expect(verdict).to_have_text(re.compile(r"^Sure, with drift: the lag goes from 63\d\.\d to 64\d\.\d samples\.$"))
    assert sent(page) == []


def test_it_reads_in_dark_and_on_a_phone(fooling_page: Page) -> None:
    page = fooling_page
    turned_dark(page, width=420)
    start(page, "Repetition")
    expect(page.locator(".disturbances .verdict")).to_have_text("Cannot tell: it repeats every 400 samples.")
    expect_fitting(page, 420)
    screenshot(page, "sensor-lag-disturbances-phone")
