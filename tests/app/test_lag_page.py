"""The lag page: the verdict before the lag, recordings of one's own, all methods in a table, and the panels."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from typing import Any, get_args

import numpy as np
import numpy.typing as npt
import plotly.io
import pytest
from scipy import signal
from streamlit.testing.v1 import AppTest

from benchmarks.recording_bytes import filmed
from benchmarks.verdict import drifting, tones
from stereolag.core.typography import typeset
from stereolag.signals.by_hand import MAX_LAG, Disturbances
from stereolag.signals.phasors import LAG, SIZE
from stereolag.signals.verdict import Reason
from stereolag.ui.lag import parts
from stereolag.ui.lag.parts import judged
from stereolag.ui.lag.sentences import DISTURBANCE_EXAMPLES, DISTURBED_LESSONS, DISTURBED_VERDICTS
from tests.app import uploads
from tests.app.pages import lag_found, numbers
from tests.packed import told
from tests.snapshots import Snapshot

OpenPage = Callable[..., AppTest]
Sound = npt.NDArray[np.float64]
PAGE = "pages/1_Sensor_lag.py"


def measured(open_page: OpenPage, *files: tuple[str, bytes]) -> AppTest:
    """Return the page after uploading recordings."""
    app = open_page(PAGE, {"recordings": "own"})
    for number, (name, data) in enumerate(files, start=1):
        app.file_uploader(key=f"recordings.file_{number}").upload(name, data, "application/octet-stream")
    app.run()
    assert not app.exception and not app.error
    return app


def two_waves(first: Sound, second: Sound) -> tuple[tuple[str, bytes], tuple[str, bytes]]:
    one, other = (uploads.wav(sound, 44_100) for sound in (first, second))
    return ("1.wav", one), ("2.wav", other)


def captions(app: AppTest) -> str:
    return "\n".join(f"{caption.value} {caption.proto.help}" for caption in app.caption)


# The verdict


def test_no_metres_and_no_lag_where_it_is_not_sure(open_page: OpenPage) -> None:
    app = measured(open_page, *two_waves(*tones(6_000, 0.01, 0.0, 0)))
    assert app.header[0].value.startswith("Cannot tell: it repeats every **100 samples**.")
    assert " m" not in app.header[0].value
    assert "Highest at" in numbers(app)
    assert re.fullmatch(r"\d+\.\d of \d\.\d needed", numbers(app)["Evidence"])


def test_a_sure_lag_has_its_path_difference_and_how_far_it_can_be_off(open_page: OpenPage) -> None:
    app = open_page(PAGE)
    headline = (
        "Sensor 2 hears it **1.136 s** (50,082.00 ± 0.01 samples) after sensor 1: its path is **378.17 m** longer."
    )
    assert app.header[0].value == typeset(headline)
    fair = drawn(app)
    app.button_group(key="lag.curve").set_value("Not weighted").run()
    plain = drawn(app)
    assert fair[-1]["x"] == plain[-1]["x"] == [50_082]
    assert fair[-1]["y"][0] == pytest.approx(plain[-1]["y"][0] * np.sqrt(1 - 50_082 / 176_401), abs=1e-3)
    assert float(numbers(app)["Agreement"]) == pytest.approx(plain[-1]["y"][0], abs=1e-3)


def test_what_was_assumed_stands_in_the_headline(open_page: OpenPage) -> None:
    app = measured(open_page, *two_waves(SOUND[300:], SOUND[:-300]))
    assert app.header[0].value.endswith(typeset("its path is **2.27 m** longer, at 333 m/s, assumed."))
    app.number_input[1].set_value(340.0).run()
    assert app.header[0].value.endswith(typeset("its path is **2.31 m** longer."))


def test_the_score_of_a_lag_that_changes_is_that_of_the_aligned_recordings(open_page: OpenPage) -> None:
    app = measured(open_page, *two_waves(*drifting(60_000, 400, 900.0, 0.1, 1)))
    said = r"Sensor 2 hears it \*\*400 samples later at the start, 454 at the end \(\+90\d.\d ±\s0.1\sppm\)\*\*\."
    assert re.fullmatch(said, app.header[0].value), app.header[0].value
    assert float(numbers(app)["Agreement"]) > 0.95  # at no single lag above 0.1
    assert "A lag that changes spreads the peak over them" in captions(app)


def drawn(app: AppTest) -> list[dict[str, list[float]]]:
    """Return the traces of the correlation curve."""
    specs = [plotly.io.from_json(one.proto.spec, skip_invalid=True).to_dict() for one in app.get("plotly_chart")]
    (curve,) = [spec for spec in specs if "lag, samples" in str(spec["layout"]["xaxis"].get("title"))]
    return list(curve["data"])


# Recordings of one's own

SOUND = signal.resample_poly(uploads.noise(2_400), 4, 1)


def test_another_rate_is_brought_to_the_lower_and_said(open_page: OpenPage) -> None:
    slow = uploads.wav(signal.resample_poly(SOUND, 1, 2), 8_000)
    app = measured(open_page, ("a.wav", uploads.wav(SOUND[1_000:], 16_000)), ("b.wav", slow))
    assert lag_found(app) == 500
    assert typeset("**0.0625 s**") in app.header[0].value
    assert typeset("Sensor 1: 0.5375 s, 4,300 samples, 8,000 Hz, resampled from 16,000 Hz.") in captions(app)


def test_an_assumed_rate_is_said_aloud_and_mended_lines_are_counted(open_page: OpenPage) -> None:
    lines = uploads.csv(SOUND).split(b"\n")
    lines[7] += b"\0"
    app = measured(open_page, ("a.csv", b"\n".join(lines)), ("b.csv", uploads.csv(SOUND)))
    assert typeset("no rate in the file: 44,100 Hz assumed unless set below, 1 damaged line mended.") in captions(app)


def test_a_time_column_gives_the_rate_and_its_gap_and_a_column_is_chosen_by_name(open_page: OpenPage) -> None:
    sound = SOUND.round(6)
    whole = "\n".join(["time_s,B (V),A (V)", *(f"{i / 100:.2f},{sound[i]},{sound[i + 37]}" for i in range(3000))])
    there = (i for i in range(3000) if not 1000 <= i < 1300)
    gap = "\n".join(["t,A", *(f"{i / 100:.2f},{sound[i]}" for i in there)])
    app = measured(open_page, ("a.csv", whole.encode()), ("b.csv", gap.encode()))
    chooser = app.selectbox(key=next(one.key for one in app.selectbox if one.label == "Channel"))
    assert chooser.options == ["2: B (V)", "3: A (V)"]
    chooser.set_value(3).run()
    assert lag_found(app) == 37 and typeset("**0.37 s**") in app.header[0].value
    assert typeset("Sensor 2: 30 s, 3,000 samples, 100 Hz, 3 s missing after 9.99 s, filled, times") in captions(app)


def test_a_video_of_two_tracks_has_a_control_for_them(open_page: OpenPage) -> None:
    film = filmed("matroska", "flac", SOUND[100:], SOUND[:-100], rate=16_000)
    app = measured(open_page, ("film.mkv", film), ("alone.wav", uploads.wav(SOUND[:-100], 16_000)))
    assert lag_found(app) == 100
    next(one for one in app.selectbox if one.label == "Track").set_value(2).run()
    assert lag_found(app) == 0
    assert "track 2 of 2" in captions(app)


# All methods


def waited(app: AppTest) -> AppTest:
    """Return the page once its job is done."""
    for _ in range(300):
        if not any(one.label == "Cancel" for one in app.button):
            return app
        time.sleep(0.2)
        app.run()
    raise AssertionError("the job goes on and on")


def test_every_method_has_a_row_and_runs_are_timed(open_page: OpenPage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parts, "LONGEST_METHOD_S", 3.0)
    app = open_page(PAGE, {"lag.part": "Methods"})
    assert not app.dataframe
    app.button(key="lag.comparison.recordings coast.start").click().run()
    table = waited(app).dataframe[0].value
    assert list(table["Method"]) == ["FFT", "GCC-PHAT", "Sampled", "Direct"]
    assert list(table["Lag, samples"]) == ["50,082"] * 3 + ["–"]
    assert list(table["Verdict"]) == ["sure"] * 3 + ["left out"]
    assert table["Time"][3].startswith("about ")
    app.slider(key="lag.runs").set_value(10).run()
    app.button(key="lag.run_times.recordings coast.start").click().run()
    waited(app)
    assert "FFT: half of the runs took less than " in captions(app)
    app.slider(key="lag.runs").set_value(20).run()
    assert "half of the runs" not in captions(app)


# The panels

EXAMPLES = {
    "sliding": ("Slide it", ["excerpt", "seven", "tone", "noise", "loud"], {"plain", "normalised"}),
    "phasors": ("Arrows", ["knock", "coast", "harbour", "tone", "noise"], {"plain", "whitened"}),
}


def examples(app: AppTest, panel: str) -> list[dict[str, Any]]:
    """Return the examples of a panel."""
    app.session_state["lag.part"] = EXAMPLES[panel][0]
    app.run()
    (data,) = told(app, panel)
    return list(data["examples"])


def test_the_panels_hold_the_recordings_measured_and_examples(open_page: OpenPage) -> None:
    app = open_page(PAGE)
    for panel, (_, names, said) in EXAMPLES.items():
        found = examples(app, panel)
        assert [example["name"] for example in found] == names
        assert all(one["title"] and one["try"] and set(one["said"]) == said for one in found)
    slides, arrows = (examples(app, panel) for panel in EXAMPLES)
    assert all(len(one["cut"]) < len(one["recording"]) for one in slides)
    assert [one["name"] for one in slides if one["whole"]] == ["seven"]
    assert "The peak is at 50,082 samples, as over the whole recordings" in slides[0]["said"]["plain"]
    assert all(len(one[part]) == SIZE // 2 for one in arrows for part in ("magnitude_1", "magnitude_2", "turns"))
    coast = arrows[1]
    assert coast["offset"] + LAG * coast["step"] == 50_082
    assert f"mean of {coast['step']} samples" in coast["try"] and f"{coast['offset']:,} samples later" in coast["try"]
    app.button_group(key="recordings").set_value("harbour").run()
    assert examples(app, "phasors") == arrows  # as before: painted values stay in the browser
    others = examples(app, "sliding")
    assert others[1:] == slides[1:] and others[0]["lag"] < 0 < slides[0]["lag"]


def test_ones_own_arrows_come_first_once_their_lag_is_found(open_page: OpenPage) -> None:
    scene = uploads.noise(12_000)
    own, *others = examples(measured(open_page, *two_waves(scene[:-500], scene[500:])), "phasors")
    assert [example["name"] for example in others] == EXAMPLES["phasors"][1]
    assert own["title"] == "Your recordings"
    assert own["offset"] + LAG * own["step"] == -500
    assert own["said"]["whitened"] == "The chain reaches furthest at lag 4, as in the whole recordings."
    app = measured(open_page, *two_waves(uploads.noise(9_000, seed=1), uploads.noise(9_000, seed=2)))
    assert [one["name"] for one in examples(app, "phasors")] == EXAMPLES["phasors"][1]


def test_recordings_too_short_to_slide_leave_the_examples(open_page: OpenPage) -> None:
    app = measured(open_page, *two_waves(SOUND[20:220], SOUND[:200]))
    assert [one["name"] for one in examples(app, "sliding")] == EXAMPLES["sliding"][1][1:]


def test_what_is_said_of_every_disturbance(snapshot: Snapshot) -> None:
    examples = {one["title"]: judged(Disturbances(**one["settings"])) for one in DISTURBANCE_EXAMPLES}
    others = ({"noise": 30}, {"echo": 100}, {"echo": 150}, {"repetition": 50, "echo": 60})
    found = examples | {str(one): judged(Disturbances(**one)) for one in others}
    snapshot({name: list(one["said"].values()) for name, one in found.items()})
    noisy = examples["Noise"]
    assert len(noisy["curve"]) == 2 * MAX_LAG + 1 and [len(part) for part in noisy["recordings"]] == [240, 240]
    assert set(DISTURBED_VERDICTS) == set(DISTURBED_LESSONS) == {*get_args(Reason), "wrong"} - {"few_votes"}
