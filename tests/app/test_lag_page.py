"""The lag page: verdicts, recordings of one's own, all methods, the panels, and microphones heard live."""

import re
from typing import Any, get_args

import numpy as np
import numpy.typing as npt
import pytest
from scipy import signal
from streamlit.testing.v1 import AppTest

from benchmarks.recording_bytes import filmed
from benchmarks.verdict import drifting, tones, unrelated
from stereolag.core.typography import typeset
from stereolag.signals import phasors
from stereolag.signals.by_hand import MAX_LAG, Disturbances
from stereolag.signals.verdict import Reason
from stereolag.ui.lag import parts
from stereolag.ui.lag.inputs import Piece, answer
from stereolag.ui.lag.panels import disturbance_data
from stereolag.ui.lag.sentences import DISTURBANCE_EXAMPLES, DISTURBED_LESSONS, DISTURBED_VERDICTS
from tests.app import pages, reading, uploads
from tests.app.pages import LAG, moved, open_page, uploaded
from tests.app.reading import address, captions, ignored, labelled, lag_found
from tests.packed import told, unpacked
from tests.snapshots import Snapshot

Sound = npt.NDArray[np.float64]


def measured(first: tuple[str, bytes], second: tuple[str, bytes], part: str = "Lined up") -> AppTest:
    """Return the page after uploading recordings; its first part would look for a stretch to slide."""
    state = {"recordings": "own", "lag.part": part}
    app = uploaded(open_page(LAG, state), "recordings", file_1=first, file_2=second)
    assert not app.error
    return app


def two_waves(first: Sound, second: Sound) -> tuple[tuple[str, bytes], tuple[str, bytes]]:
    one, other = (uploads.wav(sound, 44_100) for sound in (first, second))
    return ("1.wav", one), ("2.wav", other)


# The verdict


def test_no_metres_and_no_lag_where_it_is_not_sure() -> None:
    app = measured(*two_waves(*tones(6_000, 0.01, 0.0, 0)))
    assert app.header[0].value.startswith("Cannot tell: it repeats every **100 samples**.")
    assert " m" not in app.header[0].value
    assert "Highest at" in reading.numbers(app)
    assert re.fullmatch(r"\d+\.\d of \d\.\d needed", reading.numbers(app)["Evidence"])


def test_a_sure_lag_has_its_path_difference_and_how_far_it_can_be_off() -> None:
    app = open_page(LAG)
    headline = (
        "Sensor 2 hears it **1.136 s** (50,082.00 ± 0.01 samples) after sensor 1: its path is **378.17 m** longer."
    )
    assert app.header[0].value == typeset(headline)
    fair, plain = marked(app), marked(moved(app, {"lag.curve": "Not weighted"}))
    assert fair["x"] == plain["x"] == [50_082]
    assert fair["y"][0] == pytest.approx(plain["y"][0] * np.sqrt(1 - 50_082 / 100_000), abs=1e-3)
    assert float(reading.numbers(app)["Agreement"]) == pytest.approx(plain["y"][0], abs=1e-3)


def test_the_score_of_a_lag_that_changes_is_that_of_the_aligned_recordings() -> None:
    app = measured(*two_waves(*drifting(60_000, 400, 900.0, 0.1, 1)), part="Slide it")
    said = r"Sensor 2 hears it \*\*400 samples later at the start, 454 at the end \(\+90\d.\d ±\s0.1\sppm\)\*\*\."
    assert re.fullmatch(said, app.header[0].value), app.header[0].value
    assert float(reading.numbers(app)["Agreement"]) > 0.95  # at no single lag above 0.1
    assert "A lag that changes spreads the peak over them" in captions(app)


def marked(app: AppTest) -> dict[str, list[float]]:
    """Return the trace that marks the lag on the correlation curve."""
    (curve,) = [chart for chart in reading.charts(app) if "lag, samples" in str(chart["layout"]["xaxis"].get("title"))]
    return dict(curve["data"][-1])


# Recordings of one's own

SOUND = signal.resample_poly(uploads.noise(2_400), 4, 1)


def test_another_rate_is_brought_to_the_lower_and_said() -> None:
    slow = uploads.wav(signal.resample_poly(SOUND, 1, 2), 8_000)
    app = measured(("a.wav", uploads.wav(SOUND[1_000:], 16_000)), ("b.wav", slow))
    assert lag_found(app) == 500
    assert app.header[0].value.endswith(typeset("at 333 m/s, assumed."))
    assert typeset("4,300 samples, 8,000 Hz, resampled from 16,000 Hz.") in captions(app)


@pytest.mark.parametrize(
    ("name", "data", "time", "assumed"),
    [
        ("b.wav", uploads.wav(SOUND), "0.125 s", "at 333 m/s, assumed."),
        ("b.csv", uploads.csv(SOUND), "0.02268 s", "at 333 m/s and 44,100 Hz, both assumed."),
    ],
)
def test_without_a_rate_that_of_the_other_is_taken_or_one_is_assumed(name, data, time, assumed):
    app = measured(("a.csv", uploads.csv(SOUND[1_000:])), (name, data))
    assert typeset(f"**{time}**") in app.header[0].value
    assert app.header[0].value.endswith(typeset(assumed))
    assert "no rate in the file" in captions(app)


def test_a_time_column_gives_the_rate_and_its_gap_and_a_column_is_chosen_by_name() -> None:
    sound = SOUND.round(6)
    whole = "\n".join(["time_s,B (V),A (V)", *(f"{i / 100:.2f},{sound[i]},{sound[i + 37]}" for i in range(3000))])
    there = (i for i in range(3000) if not 1000 <= i < 1300)
    gap = "\n".join(["t,A", *(f"{i / 100:.2f},{sound[i]}" for i in there)])
    app = measured(("a.csv", whole.encode()), ("b.csv", gap.encode()))
    chooser = labelled(app.selectbox, "Channel")
    assert chooser.options == ["2: B (V)", "3: A (V)"]
    chooser.set_value(3).run()
    assert lag_found(app) == 37 and typeset("**0.37 s**") in app.header[0].value
    assert typeset("Sensor 2: 30 s, 3,000 samples, 100 Hz, 3 s missing after 9.99 s, filled, times") in captions(app)


def test_recordings_of_a_sample_a_day() -> None:
    """Thermometers, gauges and prices: the page failed for all of them."""
    days, sound = np.datetime64("2015-01-01") + np.arange(2000), SOUND[:2050].round(6)
    tables = ["\n".join(map("{};{}".format, days, values)).encode() for values in (sound[50:], sound)]
    app = measured(*zip(("a.csv", "b.csv"), tables, strict=True))
    assert lag_found(app) == 50
    assert typeset("**4,320,000 s**") in app.header[0].value
    (rate,) = (box.value for box in app.number_input if "sampling_rate" in (box.key or ""))
    assert rate == pytest.approx(1 / 86_400)
    assert not ignored(pages.linked(LAG, sampling_rate=str(rate)))


def test_a_video_of_two_tracks_has_a_control_for_them() -> None:
    film = filmed("matroska", "flac", SOUND[100:], SOUND[:-100], rate=16_000)
    app = measured(("film.mkv", film), ("alone.wav", uploads.wav(SOUND[:-100], 16_000)))
    assert lag_found(app) == 100
    labelled(app.selectbox, "Track").set_value(2).run()
    assert lag_found(app) == 0
    assert "track 2 of 2" in captions(app)


# All methods


def test_every_method_has_a_row_and_runs_are_timed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parts, "MAX_METHOD_S", 0.5)
    app = open_page(LAG, {"lag.part": "Methods"})
    assert not app.dataframe
    app.button(key="lag.comparison.recordings coast.start").click().run()
    table = pages.finished(app).dataframe[0].value
    assert list(table["Method"]) == ["FFT", "GCC-PHAT", "Sampled", "Direct"]
    assert list(table["Lag, samples"]) == ["50,082"] * 3 + ["–"]
    assert list(table["Verdict"]) == ["sure"] * 3 + ["left out"]
    assert table["Time"][3].startswith("about ")
    moved(app, {"lag.runs": 10})
    app.button(key="lag.run_times.recordings coast.start").click().run()
    pages.finished(app)
    assert "FFT: half of the runs took less than " in captions(app)
    moved(app, {"lag.runs": 20})
    assert "half of the runs" not in captions(app)


# The panels

EXAMPLES = {
    "sliding": ("Slide it", ["excerpt", "seven", "tone", "noise", "loud"], {"plain", "normalised"}),
    "phasors": ("Arrows", ["knock", "coast", "harbour", "tone", "noise"], {"plain", "whitened"}),
}


def examples(app: AppTest, panel: str) -> list[dict[str, Any]]:
    app.session_state["lag.part"] = EXAMPLES[panel][0]
    app.run()
    (data,) = told(app, panel)
    return list(data["examples"])


def test_the_panels_hold_the_recordings_measured_and_examples() -> None:
    app = open_page(LAG)
    for panel, (_, names, said) in EXAMPLES.items():
        found = examples(app, panel)
        assert [example["name"] for example in found] == names
        assert all(one["title"] and one["try"] and set(one["said"]) == said for one in found)
    slides, arrows = (examples(app, panel) for panel in EXAMPLES)
    assert "The peak is at 50,082 samples, as over the whole recordings" in slides[0]["said"]["plain"]
    coast = arrows[1]
    assert coast["offset"] + phasors.LAG * coast["step"] == 50_082
    assert f"mean of {coast['step']} samples" in coast["try"] and f"{coast['offset']:,} samples later" in coast["try"]
    app.button_group(key="recordings").set_value("harbour").run()
    assert examples(app, "phasors") == arrows  # as before: painted values stay in the browser
    others = examples(app, "sliding")
    assert others[1:] == slides[1:] and others[0]["lag"] < 0 < slides[0]["lag"]


def test_ones_own_arrows_come_first_once_their_lag_is_found() -> None:
    scene = uploads.noise(12_000)
    own, *others = examples(measured(*two_waves(scene[:-500], scene[500:])), "phasors")
    assert [example["name"] for example in others] == EXAMPLES["phasors"][1]
    assert own["title"] == "Your recordings"
    assert own["offset"] + phasors.LAG * own["step"] == -500
    assert own["said"]["whitened"] == "The chain reaches furthest at lag 4, as in the whole recordings."
    app = measured(*two_waves(uploads.noise(9_000, seed=1), uploads.noise(9_000, seed=2)))
    assert [one["name"] for one in examples(app, "phasors")] == EXAMPLES["phasors"][1]


def test_recordings_too_short_to_slide_leave_the_examples() -> None:
    app = measured(*two_waves(SOUND[20:220], SOUND[:200]))
    assert [one["name"] for one in examples(app, "sliding")] == EXAMPLES["sliding"][1][1:]


def test_what_is_said_of_every_disturbance(snapshot: Snapshot) -> None:
    examples = {one["title"]: disturbance_data(Disturbances(**one["settings"])) for one in DISTURBANCE_EXAMPLES}
    others = ({"noise": 30}, {"echo": 100}, {"echo": 150}, {"repetition": 50, "echo": 60})
    found = examples | {str(one): disturbance_data(Disturbances(**one)) for one in others}
    snapshot({name: list(one["said"].values()) for name, one in found.items()})
    noisy = examples["Noise"]
    assert len(noisy["curve"]) == 2 * MAX_LAG + 1 and [len(part) for part in noisy["recordings"]] == [240, 240]
    assert set(DISTURBED_VERDICTS) == set(DISTURBED_LESSONS) == {*get_args(Reason), "wrong"} - {"few_votes", "one_lag"}


# Microphones heard live

RATE = 16_000
Sounds = npt.NDArray[np.int16]


def sounds(first: npt.ArrayLike, second: npt.ArrayLike) -> Sounds:
    both = np.stack([first, second])
    return np.asarray(8000 * both / np.abs(both).max(), dtype=np.int16)


DRIFTING = sounds(*drifting(2 * RATE, 40, 150, 0.2, 3))
STEADY = sounds(*drifting(2 * RATE, 40, 0, 0.2, 3))


def heard(piece: Sounds, *, devices: int = 1, kept: dict[str, Any] | None = None, **header: Any) -> dict[str, Any]:
    """Return what the panel is told after a piece."""
    parts = tuple(one.tobytes() for one in piece)
    message = Piece.model_validate({"rate": RATE, "devices": devices, "begun": 1, "parts": parts} | header)
    return unpacked(answer({} if kept is None else kept, message, speed=340.0, max_lag=None))[0]


def test_a_sure_lag_has_metres_only_from_one_device_and_while_it_stays() -> None:
    steady = heard(STEADY)
    assert (steady["sure"], steady["lag"], steady["difference"]) == (True, "40", pytest.approx(0.85, abs=0.01))
    assert "its path is 0.85\N{NO-BREAK SPACE}m longer" in steady["said"]
    assert heard(DRIFTING)["said"] == "The source is moving: the lag was 40 samples and is 45 now."
    assert heard(STEADY[::-1])["lag"] == "−40"
    two, apart = heard(STEADY, devices=2)["said"], heard(DRIFTING, devices=2)["said"]
    assert two.startswith("Sensor 2 hears it 40.0 samples later. Two devices start at different moments")
    assert "at the start, 45 at the end (+1" in apart
    assert apart.endswith("Two devices have two clocks, and these run apart.")


def test_without_a_sure_lag_it_is_said_why() -> None:
    sound, silence = STEADY[0], np.zeros_like(STEADY[0])
    for piece, said in (
        (np.stack([silence, silence]), "It is quiet"),
        (np.stack([sound, silence]), "Only sensor 1 hears something: sensor 2 is silent."),
        (np.stack([sound, sound]), "One channel only"),
        (STEADY[:, :100], "Listening …"),
        (sounds(*unrelated("noise and noise", RATE, 0)), "Nothing in common found"),
    ):
        found = heard(piece)
        assert found["said"].startswith(said)
        assert (found["sure"], found["lag"], found["difference"]) == (False, "", None)


def test_microphones_switched_on_anew_begin_anew() -> None:
    kept: dict[str, Any] = {}
    for begun, count in ((1, 1000), (1, 2000), (2, 1000)):
        heard(STEADY[:, :1000], kept=kept, begun=begun)
        assert kept["listening"].samples.shape == (2, count)


def test_what_is_frozen_becomes_the_recordings_of_the_page() -> None:
    app = open_page(LAG, {"recordings": "live"})
    assert not app.header
    assert address(app) == {"recordings": "live"}
    kept = app.session_state["live.lag"].kept
    assert "frozen" not in heard(STEADY, kept=kept)
    assert "frozen" not in kept
    assert heard(STEADY, kept=kept, freeze=7)["frozen"] == 7
    heard(STEADY[:, ::-1], kept=kept)  # what is heard before the page runs again is no part of it
    app.run()
    assert lag_found(app) == 40
    assert app.tabs[-1].label == "Take away"
    assert "32,000 samples, 16,000 Hz, channel 2 of 2" in "\n".join(one.value for one in app.caption).replace(
        "\xa0", " "
    )
    digest = kept["frozen"][0].digest
    assert app.number_input(key=f"lag.speed.{digest} 1 {digest} 2").value == 340
    app.number_input(key=f"lag.max_lag.{digest} 1 {digest} 2").set_value(100).run()
    assert address(app) == {"recordings": "live", "max_lag": "100"}
    heard(np.zeros_like(STEADY), kept=kept, begun=2, freeze=8)
    app.run()
    assert "is constant" in app.error[0].value
    assert lag_found(app) == 40
