"""Files of visitors: what a page makes of good ones, and how it answers bad ones and keeps its previous contents.

Which files are bad, and the sentence about each, is tested in ``tests/core``.
"""

import numpy as np
import pytest
from streamlit.testing.v1 import AppTest

from stereolag.core.jobs import limits
from stereolag.core.typography import typeset
from stereolag.io.arrays import npy
from tests.app import keys, reading, uploads
from tests.app.pages import DEPTH, FIND, LAG, moved, open_page, uploaded
from tests.app.reading import captions, figures, labelled, lag_found, shown, viewers
from tests.app.uploads import pngs

PAGES = {"recordings": LAG, "pictures": FIND, "pairs": DEPTH}

SCENE = uploads.texture(60, 90)
SOUND = uploads.noise(3_000)
PAIR = pngs(left=SCENE[:, :-5], right=SCENE[:, 5:])


def open_own(inputs: str, **files: tuple[str, bytes]) -> AppTest:
    """Return the page of some inputs after files were uploaded to it."""
    state = {inputs: "own", "lag.part": "Lined up"}  # the first part looks for a stretch to slide
    return uploaded(open_page(PAGES[inputs], state), inputs, **files)


def numbers(app: AppTest) -> dict[str, str]:
    """Return the numbers of the result, or those below the first map."""
    maps = figures(app) if any(one["name"] == "depth.bench" for one in viewers(app)) else {}
    return reading.numbers(app) | next(iter(maps.values()), {})


def test_one_file_of_two_channels_is_enough() -> None:
    both = np.column_stack((SOUND[100:], SOUND[:-100]))
    app = open_own("recordings", file_1=("both.wav", uploads.wav(both)))
    assert not app.error
    assert lag_found(app) == 100
    assert "channel 1 of 2." in captions(app) and "channel 2 of 2." in captions(app)
    allowed = "At most 64 MB and 30 million samples per file, over all channels: 11 minutes of one"
    assert typeset(allowed) in captions(app)
    app.selectbox[0].set_value(2)
    app.selectbox[1].set_value(1).run()
    assert lag_found(app) == -100
    assert not app.warning
    app.selectbox[0].set_value(1).run()
    assert "Both recordings are one signal" in app.warning[0].value


def test_only_what_a_mask_marks_is_looked_for() -> None:
    template, mask = uploads.texture(20, 30, seed=1), np.zeros((20, 30), dtype=np.uint8)
    template[:, :6] = SCENE[20:40, 30:36]
    template[:, 6:] = 255 - SCENE[20:40, 36:60]
    mask[:, :6] = 255
    app = open_own("pictures", **pngs(picture=SCENE, template=template))
    assert app.header[0].value == "Not found"
    uploaded(app, "pictures", **pngs(mask=mask))
    assert not app.error
    assert app.header[0].value == "Found at row 20, column 30"


def test_an_own_pair_begins_with_the_range_found_and_the_fast_preset_and_that_is_undone() -> None:
    scene = uploads.texture(200, 400)
    app = open_own("pairs", **pngs(left=scene[:, :-90], right=scene[:, 90:]))
    assert not app.error
    slider, first = (labelled(app.slider, name) for name in ("Disparities searched", "Smallest disparity"))
    assert first.value <= 90 < first.value + slider.value
    assert app.slider(key=keys.WINDOW).value == 11
    assert "range found for this pair" in captions(app)
    assert not app.session_state[keys.FOLD]
    app.button(key="depth.start.undo").click().run()
    assert app.slider(key=slider.key).value == 64
    assert app.slider(key=keys.WINDOW).value == 20
    assert "range found for this pair" not in captions(app)


def test_the_divisor_of_a_truth_of_8_bits_is_told_from_the_pair_and_can_be_another() -> None:
    app = open_own("pairs", **PAIR, **pngs(truth=np.full((60, 85), 40, dtype=np.uint8)))
    assert not app.error
    divisors = next(group for group in app.button_group if "÷ divisor" in group.label)
    assert divisors.value == 8
    assert divisors.options == [f"÷ {by}: up to {40 / by:.4g} px" for by in (1, 2, 4, 8, 16)]
    before = numbers(app)["EPE"]
    divisors.set_value(4).run()
    assert numbers(app)["EPE"] != before
    moved(app, {"pairs.divisor": 8.0})
    assert not app.error
    assert numbers(app)["EPE"] == before


def test_depth_given_as_ground_truth_is_told_and_judges_nothing() -> None:
    scene = uploads.texture(120, 240)
    pair = pngs(left=scene[:, :200], right=np.vstack([scene[:60, 12:212], scene[60:, 24:224]]))
    depth = np.repeat([[300 / 12], [300 / 24]], 60, axis=0) * np.ones(200)
    app = open_own("pairs", **pair, truth=("depth.npy", npy(depth)))
    assert "looks like depth" in app.error[0].value
    assert "EPE" not in numbers(app)


def test_uploads_are_still_there_when_the_visitor_comes_back() -> None:
    app = open_own("pairs", **PAIR)
    app.number_input(key="pairs.divisor").set_value(8.0)
    before = numbers(uploaded(app, "pairs", **pngs(truth=np.full((60, 85), 40, dtype=np.uint8))))
    assert "EPE" in before
    uploaded(app, "pairs", left=("another name.png", PAIR["left"][1]))
    assert numbers(app)["Computed in"] == before["Computed in"]  # the same pixels are not computed again

    def visit_the_example() -> None:
        moved(app, {"pairs": "cube"})
        moved(app, {"pairs": "own"})

    def visit_another_page() -> None:
        app.switch_page(LAG).run()
        app.switch_page(DEPTH).run()

    for visit in (visit_the_example, visit_another_page):
        visit()
        assert not app.error
        assert not app.info
        assert numbers(app) == before
        assert app.number_input(key="pairs.divisor").value == 8
    moved(app, {"pairs.divisor": 20.0})
    assert numbers(app)["EPE"] != before["EPE"]
    app.button(key="pairs.truth.remove").click().run()
    assert "EPE" not in numbers(app)
    app.button(key="pairs.left.remove").click().run()
    assert "the page shows the example" in app.info[0].value


def test_one_picture_twice_is_said() -> None:
    scene = uploads.texture(120, 200)
    app = open_own("pairs", **pngs(left=scene, right=scene))
    assert not app.error
    assert "are the same image" in captions(app)


def test_what_takes_too_much_memory_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STEREOLAG_JOB_MEMORY_MB", "256")
    limits.cache_clear()
    long = ("long.wav", uploads.wav(uploads.noise(2_000_000)))
    app = open_own("recordings", file_1=long, file_2=long)
    monkeypatch.undo()
    limits.cache_clear()
    assert_one_sentence(app, "one job may take 268 MB")
    assert not app.header  # no lag


def test_files_that_were_removed_do_not_come_back_when_others_do_not_fit() -> None:
    app = open_own("pairs", **pngs(left=SCENE, right=SCENE[:, ::-1]))
    assert not app.error
    for name in ("left", "right"):
        app.file_uploader(key=f"pairs.{name}").set_value(None)
    app.run()
    uploaded(app, "pairs", **pngs(left=SCENE, right=SCENE[:20]))
    assert len(app.error) == 1
    assert not numbers(app)


# Bad files

GOOD = {
    "recordings": {box: ("a.wav", uploads.wav(SOUND)) for box in ("file_1", "file_2")},
    "pairs": pngs(right=SCENE, left=SCENE),
    "pictures": pngs(template=SCENE[:20, :20], picture=SCENE),
}
NO_PICTURE = "b.png", b"not a picture at all\n" * 20
BAD = {
    "recordings": [
        (("a.wav", uploads.wav_without_channels()), "0 channels"),
        (("a.wav", uploads.wav(np.array([0.5]))), "at least 2 are needed"),
        # Must be last: the file is readable, so it stays in use.
        (("a.wav", uploads.wav(np.full(500, 0.25))), "constant"),
    ],
    "pictures": [(NO_PICTURE, "accepted are")],
    "pairs": [(NO_PICTURE, "accepted are")],
}


def assert_one_sentence(app: AppTest, fragment: str) -> None:
    (error,) = app.error
    assert typeset(fragment) in error.value
    assert error.value.endswith(".")
    assert "Traceback" not in error.value
    assert "\n" not in error.value


@pytest.mark.parametrize("inputs", GOOD)
def test_a_bad_file_leaves_the_page_as_it_was(inputs: str) -> None:
    app = open_own(inputs, **GOOD[inputs])
    assert not app.error and not app.info
    if inputs == "recordings":
        next(box for box in app.number_input if box.label.startswith("Sampling rate")).set_value(12_345.0).run()
    before = shown(app)
    for number, (box, good) in enumerate(GOOD[inputs].items()):
        for bad, fragment in BAD[inputs][: 1 if number else None]:
            uploaded(app, inputs, **{box: bad})
            assert_one_sentence(app, fragment)
            assert shown(app) == before
        uploaded(app, inputs, **{box: good})
        assert not app.error
        assert shown(app) == before


def test_recordings_refused_at_first_leave_no_answer_of_the_example() -> None:
    app = open_own("recordings", file_1=("bro*ken*.wav", b"nothing"))
    assert app.error[0].value.startswith("“bro?ken?.wav”: ")
    assert app.error[0].icon == ":material/block:"
    uploaded(app, "recordings", file_2=GOOD["recordings"]["file_2"])
    bad, fragment = BAD["recordings"][0]
    uploaded(app, "recordings", file_1=bad)
    assert_one_sentence(app, fragment)
    assert not app.header and not app.metric
    uploaded(app, "recordings", file_1=GOOD["recordings"]["file_1"])
    assert not app.error
    assert "at the same time" in app.header[0].value


def test_pictures_refused_at_first_leave_no_answer_of_the_example() -> None:
    app = moved(open_page(DEPTH), {"pairs": "own"})
    assert viewers(app)
    for files, fragment in (
        ({"left": NO_PICTURE}, "accepted are"),
        (pngs(left=SCENE, right=SCENE[:30]), "give or take 3 %"),
    ):
        assert_one_sentence(uploaded(app, "pairs", **files), fragment)
        assert not viewers(app)
    app = open_own("pictures", **pngs(picture=SCENE, template=uploads.texture(70, 100)))
    assert_one_sentence(app, "change them over")
    assert "stay in use" not in app.error[0].value


@pytest.mark.parametrize(
    ("inputs", "bad", "fragment"),
    [
        ("pairs", pngs(left=SCENE[:-10]), "both images must have the same size"),
        ("pictures", pngs(template=uploads.texture(70, 20)), "must fit into the image. The previous files"),
        ("pictures", pngs(mask=np.zeros((20, 20), np.uint8)), "black all over"),
    ],
)
def test_a_good_file_that_does_not_fit_the_others_leaves_the_page_as_it_was(inputs, bad, fragment):
    app = open_own(inputs, **GOOD[inputs])
    before = shown(app)
    assert_one_sentence(uploaded(app, inputs, **bad), fragment)
    assert shown(app) == before


def test_a_file_that_made_way_for_an_unreadable_one_is_back() -> None:
    app = open_own("pairs", **GOOD["pairs"])
    before = shown(app)
    app.file_uploader(key="pairs.left").clear().run()  # as the browser does while the other one is on its way
    assert shown(app) != before
    assert_one_sentence(uploaded(app, "pairs", left=NO_PICTURE), "The previous file stays in use")
    assert shown(app) == before


def test_pictures_too_small_for_a_window_are_refused_and_every_part_goes_on() -> None:
    app = open_own("pairs", **pngs(left=uploads.texture(1, 1, 0), right=uploads.texture(1, 1, 1)))
    for part in reversed(app.button_group(key=keys.PART).options):  # the last is the first again
        moved(app, {keys.PART: part})
    app.button(key=keys.preset_key("report")).click().run()
    assert any("px and the images are" in error.value for error in app.error)
    moved(app, {"pairs": "cube"})
    app.button(key=keys.preset_key("reset")).click().run()
    assert not app.error
    assert app.slider(key=keys.WINDOW).value == 20
