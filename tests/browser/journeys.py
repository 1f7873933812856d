"""Each page used by keyboard, with the example and with own files, and axe-core run on it.

Components are tested alone elsewhere, by axe-core too; here they must fit their page, be styled and be heard.
"""

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext

import numpy as np
from playwright.sync_api import Locator, Page, expect

from tests.app import uploads
from tests.app.test_calibrate_page import SQUARE_MM, files
from tests.app.test_driving_page import drive
from tests.browser.axe import COLOURS_ALONE, check, findings
from tests.browser.layout import expect_on_first_screen
from tests.browser.parts import themes
from tests.browser.visits import expect_fitting, expect_visible, file_of, give, screenshot, settled

MOST_IN_A_ROW = 10

LIGHT_TEXT, DARK_TEXT = "rgb(91, 89, 100)", "rgb(180, 178, 189)"

BENCH = (".st-key-bench", ".st-key-page-head", ".st-key-page-links")
"""Parts of the depth page that stay while the others change."""

PANEL = "[role=tabpanel]"
"""What changes from one tab of a page to the next."""

Journey = Callable[[Page], None]

WATCH_RUNS = """
() => {
  window.runs?.disconnect();
  delete document.body.dataset.reran;
  window.runs = new MutationObserver(() => { document.body.dataset.reran = "yes"; });
  runs.observe(document.querySelector("[data-testid=stApp]"), { attributeFilter: ["data-test-script-state"] });
}
"""

WORN = """
(one, names) => Object.fromEntries(names.map((name) => [name, getComputedStyle(one).getPropertyValue(name)]))
"""


@contextmanager
def without_a_run(page: Page) -> Iterator[None]:
    """Expect an action to happen in the browser alone."""
    page.evaluate(WATCH_RUNS)
    yield
    assert page.evaluate("document.body.dataset.reran") is None


def expect_at_home(page: Page, selector: str) -> None:
    """Expect a component to have the same style on its page as alone, and to fit."""
    part = page.locator(selector).last
    scheme = page.get_by_test_id("stApp").evaluate("(app) => getComputedStyle(app).colorScheme")
    worn = part.evaluate(WORN, list(themes()[scheme]))
    assert worn == themes()[scheme]
    assert part.evaluate("(one) => one.getRootNode().host.dataset.testid") == "stBidiComponentIsolated"
    assert page.viewport_size is not None
    expect_fitting(page, page.viewport_size["width"])


def expect_found(page: Page, row: int, col: int) -> None:
    expect_visible(page.get_by_role("heading", name=f"Found at row {row}, column {col}", exact=True))
    settled(page)


def choose(page: Page, wanted: str, *, begin: str) -> None:
    """Move along a row of buttons with the arrow keys, starting from one of them, and choose another."""
    page.get_by_role("radio", name=begin, exact=True).first.focus()
    button = page.get_by_role("radio", name=wanted, exact=True).first
    for _ in range(MOST_IN_A_ROW):
        if button.evaluate("button => button === document.activeElement"):
            break
        page.keyboard.press("ArrowRight")
    page.keyboard.press("Enter")
    expect(button).to_be_checked()
    settled(page)
    expect(button).to_be_focused()


def open_tab(page: Page, name: str) -> None:
    """Open a tab: the next one with the arrow key, another with the Enter key."""
    here, tab = page.get_by_role("tab", selected=True), page.get_by_role("tab", name=name, exact=True)
    names = page.get_by_role("tab").all_inner_texts()
    if names.index(name) == names.index(here.inner_text()) + 1:
        here.press("ArrowRight")
        expect(tab).to_be_focused()
    else:
        tab.press("Enter")
    expect(tab).to_have_attribute("aria-selected", "true")
    settled(page)


def press(page: Page, name: str) -> None:
    page.get_by_role("button", name=name, exact=True).first.press("Enter")
    settled(page)


def unfold(page: Page, *titles: str) -> None:
    for title in titles:
        page.locator("summary:visible").filter(has_text=title).first.press("Enter")
        settled(page)


def announced(page: Page) -> Locator:
    """Return the live region, marked: a replacement for it would not be read aloud."""
    region = page.locator("#stereolag-announced")
    region.evaluate("(one) => { one.dataset.met = 'before'; }")
    return page.locator("#stereolag-announced[data-met=before][role=status][aria-live=polite]")


def through_home(page: Page) -> None:
    with without_a_run(page):
        page.locator(".sliding .stage").press("End")
        expect(page.locator(".sliding .where")).to_contain_text("Lag 50,962 · sum ")
    check(page, "Home")
    page.get_by_role("link", name="Open Sensor lag").press("Enter")
    expect_visible(page.get_by_role("heading", name="Sensor lag"))
    settled(page)
    numbers = page.locator(".stPlotlyChart .xtick text").first  # axe-core does not judge text in drawings
    for scheme, colour in (("dark", DARK_TEXT), ("light", LIGHT_TEXT)):
        page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
        expect(numbers).to_have_css("fill", colour)


def _through_the_panels(page: Page) -> None:
    keys = {  # the control of each panel, what its End key leads to, and where that is said
        "Slide it": (".sliding .stage", "· sum ", ".sliding .where"),
        "Fool it": (".disturbances input[name=noise]", "Nothing in common found", ".disturbances .verdict"),
        "Arrows": (".phasors .lag", "Lag 12 ·", ".phasors .where"),
        "To metres": (".plan .apart input", "1,135 m", ".plan output"),
    }
    for tab, (control, result, place) in keys.items():
        open_tab(page, tab)
        with nullcontext() if tab == "Fool it" else without_a_run(page):
            page.locator(control).press("End")
            expect(page.locator(place)).to_contain_text(re.compile(result.replace(" m", r"\sm")))
        expect_at_home(page, control.split()[0])
        screenshot(page)


def through_sensor_lag(page: Page) -> None:
    region = announced(page)
    said = "Sensor 2 hears it 1.136 s (50,082.00 ± 0.01 samples) after sensor 1: its path is 378.17 m longer."
    expect(region).to_have_text(said)
    _through_the_panels(page)
    choose(page, "Harbour in the wind", begin="Coast")
    expect_visible(page.get_by_role("heading", name="Sensor 1 hears it 0.7083 s"))
    expect(region).to_contain_text("Sensor 1 hears it 0.7083 s")
    open_tab(page, "Listen")
    expect(page.locator("audio")).to_have_count(4)
    page.wait_for_function("[...document.querySelectorAll('audio')].every((one) => one.readyState > 0)")
    open_tab(page, "Take away")
    unfold(page, "The source report")
    check(page, "Sensor lag")
    with page.expect_download():
        page.get_by_role("button", name="Python script").press("Enter")

    choose(page, "Your own files", begin="Harbour in the wind")
    boxes, sound = page.get_by_test_id("stFileUploader"), np.random.default_rng(0).uniform(-0.5, 0.5, 4_510)
    files = file_of("first.wav", uploads.wav(sound[100:])), file_of("second.wav", uploads.wav(sound))
    for box, file in zip((boxes.first, boxes.nth(1)), files, strict=True):
        with page.expect_file_chooser() as asked:
            box.get_by_test_id("stBaseButton-secondary").press("Enter")
        asked.value.set_files(file)
        expect_visible(box.get_by_text(file["name"]))
        settled(page)
    open_tab(page, "Slide it")
    expect_on_first_screen(page, "Sensor lag")
    open_tab(page, "Methods")
    press(page, "Compare the methods")
    check(page, "Sensor lag: methods compared")
    page.get_by_test_id("stPageLink").get_by_role("link", name="Home").press("Enter")
    expect(region).to_have_text("")


def through_rocketman_search(page: Page) -> None:
    expect(page.locator(".by-hand .where")).to_contain_text("Row")
    with without_a_run(page):
        page.get_by_role("button", name="Reveal").press("Enter")
        expect(page.locator(".by-hand .said")).to_contain_text("The peak is at row 528, column 982: 1.000.")
    for part in (".score-map", ".by-hand"):
        expect_at_home(page, part)
    unfold(page, "Paint a mask")
    check(page, "Rocketman search")
    open_tab(page, "Take away")
    page.emulate_media(color_scheme="dark")
    main = page.get_by_role("button", name="All in one ZIP")
    main.hover()
    expect(main).to_have_css("background-color", "rgb(185, 173, 245)")
    assert findings(page, COLOURS_ALONE, only="[data-testid=stDownloadButton]") == []
    use, counts = page.get_by_role("button", name="Use this mask"), page.locator(".painting .counts")
    page.locator(".painting .stage").press(" ")
    expect(counts).not_to_have_text("7,913 of 13,653 pixels count")
    painted = counts.inner_text()
    use.press("Enter")
    settled(page)
    expect_found(page, 528, 982)
    expect(counts).to_have_text(painted)
    expect(use).to_be_disabled()
    expect_at_home(page, ".painting")
    choose(page, "Cut from the image", begin="The example’s template")
    expect_found(page, 636, 1070)
    page.locator(".cutting .stage").press("Shift+ArrowDown")
    expect_found(page, 646, 1070)
    expect_at_home(page, ".cutting")
    check(page, "Rocketman search: a template cut out", but=(PANEL,))
    page.get_by_role("radio", name="The example’s template", exact=True).press("Enter")
    expect_found(page, 528, 982)
    choose(page, "Your own files", begin="Garden maze")
    picture = uploads.texture(400, 300)
    give(page, file_of("p.png", uploads.png(picture)), file_of("t.png", uploads.png(picture[100:160, 200:260])))
    expect_found(page, 100, 200)
    for tab in ("Places", "Step by step"):  # a small image is searched at once
        open_tab(page, tab)
    page.locator(".funnel .steps button").nth(3).press("Enter")
    expect(page.locator(".funnel .said")).to_contain_text("Best: row 100, column 200, score 1.000.")
    expect_at_home(page, ".funnel")
    open_tab(page, "Damage it")
    check(page, "Rocketman search: damaged", only=PANEL)
    expect_visible(page.get_by_role("button", name="Undo all damage"))
    open_tab(page, "Drag it")
    expect_on_first_screen(page, "Rocketman search")


def _along_the_maps(page: Page) -> None:
    page.get_by_role("application").press("ArrowRight")
    expect(page.locator(".linked .where")).to_have_text("row 240, column 321")
    for _ in range(4):
        page.keyboard.press("+")
    expect(page.get_by_role("button", name="Whole image")).to_have_text("5.1×")
    for _ in range(12):
        page.keyboard.press("Shift+ArrowRight")
    expect(page.locator(".linked .where")).to_have_text("row 240, column 441")
    left, _, width, _ = map(float, (page.locator(".viewport svg").first.get_attribute("viewBox") or "").split())
    assert left <= 441 < left + width  # the view follows the crosshair
    page.keyboard.press("0")
    expect(page.get_by_role("button", name="Whole image")).to_have_text("1×")
    figures, small = page.locator(".linked figure"), page.get_by_role("button", name="Ground truth")
    for count in (3, 2):
        small.press("Enter")
        expect(figures).to_have_count(count)
        expect(small).to_be_focused()


def _under_the_pointer(page: Page) -> None:
    reading, picture = page.locator(".hovered .reading"), page.locator(".linked").last.locator(".viewport").first
    before = str(reading.text_content())
    with without_a_run(page):
        picture.hover(position={"x": 40, "y": 60})
        expect(reading).not_to_have_text(before)
    for part in (".linked", ".hovered"):
        expect_at_home(page, part)
    expect_visible(page.get_by_text(re.compile("px windows, ")).first)
    chart = page.get_by_test_id("stPlotlyChart").last
    expect(chart.locator(".shapelayer path, .layer-between path").first).to_be_attached()


def _a_cell_of_the_sweep(page: Page) -> None:
    """Take the settings of a cell over by a click on it: they are those of the map above, then."""
    page.get_by_role("radio", name="StereoBM").last.press("Enter")
    settled(page)
    for name, values in (("Block: values", "9, 15, 21"), ("Disparities searched: values", "32, 64")):
        box = page.get_by_label(name)
        box.fill(values)
        box.press("Enter")
        settled(page)
    page.get_by_role("button", name="Sweep 6 combinations").first.press("Enter")
    settled(page)
    expect_visible(page.get_by_text("Right: bad-2, %, lower is better.").first)
    chart = page.get_by_test_id("stPlotlyChart").last
    bad = chart.locator(".js-plotly-plot").evaluate("plot => [...plot._fullData[0].z].map(row => [...row])")
    assert np.shape(bad) in {(2, 3), (3, 2)}
    cell = [int(place) for place in np.unravel_index(np.argmin(bad), np.shape(bad))]
    x, y = chart.locator(".js-plotly-plot").evaluate(
        "(plot, [row, col]) => { const { xaxis, yaxis } = plot._fullLayout;"
        " return [xaxis._offset + xaxis.l2p(col), yaxis._offset + yaxis.l2p(row)]; }",
        cell,
    )
    chart.click(position={"x": x, "y": y})
    settled(page)
    of_blocks = page.locator(".linked").first.locator("figure", has=page.get_by_text("StereoBM", exact=True))
    shown = of_blocks.locator(".figures div").filter(has_text="Bad-2").locator("dd")
    expect(shown).to_contain_text(f"{np.min(bad):.1f}")


def through_depth_maps(page: Page) -> None:
    _along_the_maps(page)
    region, figures = announced(page), page.locator(".figures").first
    expect(region).to_contain_text("Coverage")
    before, shown = region.inner_text(), figures.inner_text()
    unfold(page, "choose a pair or bring your own")
    choose(page, "1/4", begin="1/2")
    expect(region).not_to_have_text(before)
    expect(figures).not_to_have_text(shown)
    expect(region).to_contain_text("Bad-2")
    unfold(page, "choose a pair or bring your own")  # folded again
    choose(page, "Compare", begin="Compare")
    check(page, "Depth maps: Compare", but=BENCH)
    for here, part, use in (
        ("Compare", "Why this match?", _under_the_pointer),
        ("Why this match?", "Scoreboard", settled),
        ("Scoreboard", "Sweep", _a_cell_of_the_sweep),
    ):
        choose(page, part, begin=here)
        use(page)
        check(page, f"Depth maps: {part}", but=BENCH)
    for name in ("Compare", "Convolution"):
        page.get_by_role("radio", name=name, exact=True).first.press("Enter")
        settled(page)
    unfold(page, "choose a pair or bring your own")
    choose(page, "1/2", begin="1/2")
    choose(page, "Your own files", begin="Puzzle cube")
    scene = np.kron(uploads.texture(60, 90), np.ones((4, 4, 1), np.uint8))
    pair = {"left.png": scene[:, :320], "right.png": scene[:, 12:332]}
    give(page, *(file_of(name, uploads.png(picture)) for name, picture in pair.items()))
    expect_on_first_screen(page, "Depth maps")
    unfold(page, "More settings", "Take it away")
    press(page, "Before / after")
    press(page, "Colours")
    check(page, "Depth maps: all unfolded")


def through_calibrate(page: Page) -> None:
    check(page, "Calibrate")
    count = page.get_by_role("heading", name="Calibrated from")
    expect(count).to_contain_text("10 of 11")
    page.get_by_role("button", name="1", exact=True).focus()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Enter")
    expect(count).to_contain_text("9 of 11")
    settled(page)
    shown: Locator = page.get_by_role("combobox", name="Pair shown")
    before = shown.input_value()
    for key in ("ArrowDown", "ArrowDown", "Enter"):
        shown.press(key)
    expect(shown).not_to_have_value(before)
    settled(page)
    choose(page, "Your own files", begin="Drawn chessboard")
    give(page, file_of("alone.png", b"one picture is no pair"))
    expect(page.get_by_test_id("stAlertContentError")).to_contain_text("No left and right pictures match by name")
    check(page, "Calibrate: a refused file")
    give(page, [file_of(*file) for file in files().items()])
    side = page.get_by_role("spinbutton", name="Side of a square")
    side.fill(f"{SQUARE_MM}")
    side.press("Enter")
    expect(count).to_contain_text("4 of 4")
    settled(page)
    expect_on_first_screen(page, "Calibrate")


def through_driving(page: Page) -> None:
    """Use the driving page; its player has its own keyboard tests."""
    expect_visible(page.locator(".player"))
    check(page, "Driving")
    choose(page, "Your ZIP, or side-by-side video", begin="Example")
    expect_visible(page.get_by_text("Until your frames are here"))
    give(page, file_of("drive.zip", drive(count=3)))
    expect_visible(page.get_by_text("3 of 3 frames in"))
    expect_on_first_screen(page, "Driving")


JOURNEYS: dict[str, Journey] = {
    "Home": through_home,
    "Sensor lag": through_sensor_lag,
    "Rocketman search": through_rocketman_search,
    "Depth maps": through_depth_maps,
    "Calibrate": through_calibrate,
    "Driving": through_driving,
}
