from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from streamlit.testing.v1 import AppTest

from stereolag.core.jobs import limits
from stereolag.core.typography import typeset
from tests.app import keys, pages, uploads
from tests.app.conftest import figures, viewers
from tests.app.pages import DEPTH, FIND, LAG, OpenPage, lag_found

pytestmark = pytest.mark.usefixtures("small_pairs", "small_mazes")

PAGES = {"recordings": LAG, "pictures": FIND, "pairs": DEPTH}

SCENE = uploads.texture(60, 90)
SOUND = uploads.noise(3_000)


@pytest.fixture
def with_uploads(open_page: OpenPage) -> Callable[..., AppTest]:
    """Return a function that opens the page of some inputs and uploads files to it."""

    def opened(inputs: str, **files: tuple[str, bytes]) -> AppTest:
        return upload(open_page(PAGES[inputs], {inputs: "own"}), inputs, **files)

    return opened


def upload(app: AppTest, inputs: str, **files: tuple[str, bytes]) -> AppTest:
    for name, (file_name, data) in files.items():
        app.file_uploader(key=f"{inputs}.{name}").upload(file_name, data, "application/octet-stream")
    return app.run()


def numbers(app: AppTest) -> dict[str, str]:
    """Return the numbers of the result, or those below the first map."""
    maps = figures(app) if any(one["name"] == "depth.bench" for one in viewers(app)) else {}
    return pages.numbers(app) | next(iter(maps.values()), {})


def test_a_recording_without_a_rate_takes_that_of_the_other(with_uploads: Callable[..., AppTest]) -> None:
    first, second = SOUND[:2_000], SOUND[700:][:2_000]
    app = with_uploads("recordings", file_1=("a.csv", uploads.csv(first)), file_2=("b.wav", uploads.wav(second)))
    assert lag_found(app) == -700
    assert typeset("**0.0875 s**") in app.header[0].value


def test_one_file_of_two_channels_is_enough(with_uploads: Callable[..., AppTest]) -> None:
    both = np.column_stack((SOUND[100:], SOUND[:-100]))
    app = with_uploads("recordings", file_1=("both.wav", uploads.wav(both)))
    assert not app.error
    assert lag_found(app) == 100
    said = "\n".join(caption.value for caption in app.caption)
    assert "channel 1 of 2." in said and "channel 2 of 2." in said
    assert typeset("At most 64 MB and 30 million samples per file, over all channels: 11 minutes of one") in said
    app.selectbox[0].set_value(2)
    app.selectbox[1].set_value(1).run()
    assert lag_found(app) == -100


def test_only_what_a_mask_marks_is_looked_for(with_uploads: Callable[..., AppTest]) -> None:
    template = uploads.texture(20, 30, seed=1)
    template[:, :6] = SCENE[20:40, 30:36]
    template[:, 6:] = 255 - SCENE[20:40, 36:60]
    mask = np.zeros((20, 30), dtype=np.uint8)
    mask[:, :6] = 255
    app = with_uploads("pictures", picture=("scene.png", uploads.png(SCENE)), template=("t.png", uploads.png(template)))
    assert app.header[0].value == "Not found"
    upload(app, "pictures", mask=("mask.png", uploads.png(mask)))
    assert not app.exception
    assert not app.error
    assert app.header[0].value == "Found at row 20, column 30"


def test_an_own_pair_begins_with_the_range_found_and_the_fast_preset_and_that_is_undone(
    with_uploads: Callable[..., AppTest],
) -> None:
    scene = uploads.texture(200, 400)
    app = with_uploads(
        "pairs", left=("l.png", uploads.png(scene[:, :-90])), right=("r.png", uploads.png(scene[:, 90:]))
    )
    assert not app.error
    slider = next(slider for slider in app.slider if slider.label == "Disparities searched")
    first = next(slider for slider in app.slider if slider.label == "Smallest disparity")
    assert first.value <= 90 < first.value + slider.value
    assert app.slider(key=keys.WINDOW).value == 11
    assert "range found for this pair" in pages.captions(app)
    assert not app.session_state[keys.FOLD]
    app.button(key="depth.start.undo").click().run()
    assert app.slider(key=slider.key).value == 64
    assert app.slider(key=keys.WINDOW).value == 20
    assert "range found for this pair" not in pages.captions(app)


def test_the_divisor_of_a_truth_of_8_bits_is_told_from_the_pair_and_can_be_another(
    with_uploads: Callable[..., AppTest],
) -> None:
    truth = np.full((60, 85), 40, dtype=np.uint8)
    pair = {"left": ("l.png", uploads.png(SCENE[:, :-5])), "right": ("r.png", uploads.png(SCENE[:, 5:]))}
    app = with_uploads("pairs", **pair, truth=("t.png", uploads.png(truth)))
    assert not app.error
    divisors = next(group for group in app.button_group if "÷ divisor" in group.label)
    assert divisors.value == 8
    assert divisors.options == [f"÷ {by}: up to {40 / by:.4g} px" for by in (1, 2, 4, 8, 16)]
    before = numbers(app)["EPE"]
    divisors.set_value(4).run()
    assert numbers(app)["EPE"] != before
    app.number_input(key="pairs.divisor").set_value(8.0).run()
    assert not app.error
    assert numbers(app)["EPE"] == before


def test_uploads_are_still_there_when_the_visitor_comes_back(with_uploads: Callable[..., AppTest]) -> None:
    truth = uploads.png(np.full((60, 85), 40, dtype=np.uint8))
    app = with_uploads("pairs", left=("l.png", uploads.png(SCENE[:, :-5])), right=("r.png", uploads.png(SCENE[:, 5:])))
    app.number_input(key="pairs.divisor").set_value(8.0)
    before = numbers(upload(app, "pairs", truth=("t.png", truth)))
    assert "EPE" in before
    upload(app, "pairs", left=("another name.png", uploads.png(SCENE[:, :-5])))
    assert numbers(app)["Computed in"] == before["Computed in"]  # the same pixels are not computed again
    for place in ("cube", LAG):
        if place == LAG:
            app.switch_page(LAG).run()
            app.switch_page(DEPTH).run()
        else:
            app.button_group(key="pairs").set_value(place).run()
            app.button_group(key="pairs").set_value("own").run()
        assert not app.exception
        assert not app.error
        assert not app.info
        assert numbers(app) == before
        assert app.number_input(key="pairs.divisor").value == 8
    app.number_input(key="pairs.divisor").set_value(20.0).run()
    assert numbers(app)["EPE"] != before["EPE"]
    app.button(key="pairs.truth.remove").click().run()
    assert "EPE" not in numbers(app)
    app.button(key="pairs.left.remove").click().run()
    assert "the page shows the example" in app.info[0].value


def test_a_file_that_is_taken_out_is_no_longer_used(with_uploads: Callable[..., AppTest]) -> None:
    app = with_uploads("recordings", file_1=("a.csv", uploads.csv(SOUND)), file_2=("b.csv", uploads.csv(SOUND)))
    assert not app.info
    app.file_uploader(key="recordings.file_2").set_value(None).run()
    assert "the page shows the example" in app.info[0].value
    assert not [button for button in app.button if button.key == "recordings.file_2.remove"]


def test_one_picture_twice_is_said(with_uploads: Callable[..., AppTest]) -> None:
    same = ("same.png", uploads.png(uploads.texture(120, 200)))
    app = with_uploads("pairs", left=same, right=same)
    assert not app.error
    assert any("are the same image" in caption.value for caption in app.caption)


def test_what_takes_too_much_memory_is_refused_with_what_would_fit(
    with_uploads: Callable[..., AppTest], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("STEREOLAG_JOB_MEMORY_MB", "256")
    limits.cache_clear()
    long = ("long.wav", uploads.wav(uploads.noise(2_000_000)))
    app = with_uploads("recordings", file_1=long, file_2=long)
    monkeypatch.undo()
    limits.cache_clear()
    assert not app.exception
    assert len(app.error) == 1
    assert typeset("one job may take 268 MB") in app.error[0].value
    assert not app.header  # no lag


def test_files_that_were_removed_do_not_come_back_when_others_do_not_fit(with_uploads: Callable[..., AppTest]) -> None:
    app = with_uploads("pairs", left=("l.png", uploads.png(SCENE)), right=("r.png", uploads.png(SCENE[:, ::-1])))
    assert not app.error
    for name in ("left", "right"):
        app.file_uploader(key=f"pairs.{name}").set_value(None)
    app.run()
    upload(app, "pairs", left=("a.png", uploads.png(SCENE)), right=("b.png", uploads.png(SCENE[:20])))
    assert len(app.error) == 1
    assert not numbers(app)
