"""Panels of the page Sensor lag: the data and the texts with which the browser works."""

from __future__ import annotations

import base64
import string
from collections.abc import Callable
from typing import Any, get_args

import numpy as np
import pytest
from streamlit.testing.v1 import AppTest

from stereolag.signals import by_hand
from stereolag.signals.phasors import LAG, SIZE, Phasors, common_stretch, tone
from stereolag.signals.verdict import Reason
from stereolag.ui.lag.panels import SLIDERS, START
from stereolag.ui.lag.sentences import DISTURBANCE_EXAMPLES, DISTURBANCE_WORDS, own_in_words
from tests.app.uploads import noise, wav
from tests.packed import told

PHASORS = ["knock", "coast", "harbour", "tone", "noise"]


def test_the_lag_page_offers_five_examples_to_slide_whatever_is_measured(open_page: Callable[[str], AppTest]) -> None:
    app = open_page("pages/1_Sensor_lag.py")
    (panel,) = told(app, "sliding")
    assert [example["name"] for example in panel["examples"]] == ["seven", "coast", "tone", "noise", "loud"]
    for example in panel["examples"]:
        assert len(example["cut"]) < len(example["recording"])
        assert example["title"] and example["try"] and set(example["said"]) == {"plain", "normalised"}
    assert [example["name"] for example in panel["examples"] if example["whole"]] == ["seven"]
    app.button_group(key="recordings").set_value("harbour").run()
    assert told(app, "sliding") == [panel]  # painted values stay in the browser


def test_the_lag_page_hands_over_what_is_mixed_whatever_is_measured(open_page: Callable[[str], AppTest]) -> None:
    app = open_page("pages/1_Sensor_lag.py")
    (panel,) = told(app, "disturbances")
    parts, expected = panel["parts"], by_hand.ingredients()
    texts = (parts["fresh"], parts["pattern"], *parts["noises"])
    arrays = (expected.fresh, expected.pattern, expected.noise_1, expected.noise_2)
    for text, array in zip(texts, arrays, strict=True):
        np.testing.assert_array_equal(np.frombuffer(base64.b64decode(text), dtype=np.int8), array)
    assert parts["lag"] == by_hand.LAG and panel["reach"] == by_hand.MAX_LAG
    app.button_group(key="recordings").set_value("harbour").run()
    assert told(app, "disturbances") == [panel]  # the sliders do not change


def test_every_example_can_be_set_with_the_sliders() -> None:
    names = [slider["name"] for slider in SLIDERS]
    assert list(START) == names and set(DISTURBANCE_WORDS["sliders"]) == set(names)
    for example in DISTURBANCE_EXAMPLES:
        settings = START | example["settings"]
        assert list(settings) == names
        for slider in SLIDERS:
            value = settings[slider["name"]]
            assert slider["low"] <= value <= slider["high"]
            assert (value - slider["low"]) % slider["step"] == 0


def test_every_verdict_of_this_method_has_its_words() -> None:
    words = DISTURBANCE_WORDS
    reasons = {*get_args(Reason), "wrong"} - {"few_votes"}  # this method has no votes
    assert set(words["verdicts"]) == set(words["lessons"]) == reasons
    known = {"lag", "true", "delay", "period", "spacing", "rivals", "from", "to", "searched", "evidence"}
    texts = [*words["verdicts"].values(), *words["lessons"].values(), *words["notes"].values(), words["numbers"]]
    used = {name for text in texts for _, name, _, _ in string.Formatter().parse(text) if name}
    assert used <= known | {"needed"}


def phasors_told(app: AppTest) -> list[dict[str, Any]]:
    """Return the arrows sent to the browser."""
    (one,) = told(app, "phasors")
    examples: list[dict[str, Any]] = one["examples"]
    return examples


def upload(app: AppTest, first: np.ndarray, second: np.ndarray) -> AppTest:
    app.button_group(key="recordings").set_value("own").run()
    app.file_uploader(key="recordings.file_1").upload("1.wav", wav(first), "audio/wav")
    app.file_uploader(key="recordings.file_2").upload("2.wav", wav(second), "audio/wav")
    return app.run()


def test_the_lag_page_offers_five_examples_of_arrows_whatever_is_measured(open_page: Callable[..., AppTest]) -> None:
    app = open_page("pages/1_Sensor_lag.py")
    examples = phasors_told(app)
    assert [example["name"] for example in examples] == PHASORS
    for example in examples:
        assert example["title"] and example["try"] and set(example["said"]) == {"plain", "whitened"}
        assert len(example["magnitude_1"]) == len(example["magnitude_2"]) == len(example["turns"]) == SIZE // 2
    coast = next(example for example in examples if example["name"] == "coast")
    assert coast["offset"] + LAG * coast["step"] == 50_082
    assert f"mean of {coast['step']} samples" in coast["try"] and f"{coast['offset']:,} samples later" in coast["try"]
    app.button_group(key="recordings").set_value("harbour").run()
    assert phasors_told(app) == examples  # painted values stay in the browser


def test_ones_own_recordings_come_first_once_their_lag_is_found(open_page: Callable[..., AppTest]) -> None:
    scene = noise(12_000)
    app = upload(open_page("pages/1_Sensor_lag.py"), scene[:-500], scene[500:])
    own, *others = phasors_told(app)
    assert [example["name"] for example in others] == PHASORS
    assert own["title"] == "Your recordings"
    assert own["offset"] + LAG * own["step"] == -500
    assert own["said"]["whitened"] == "The chain reaches furthest at lag 4, as in the whole recordings."


def test_recordings_with_nothing_in_common_have_no_arrows(open_page: Callable[..., AppTest]) -> None:
    app = upload(open_page("pages/1_Sensor_lag.py"), noise(9_000, seed=1), noise(9_000, seed=2))
    assert [example["name"] for example in phasors_told(app)] == PHASORS


@pytest.mark.parametrize(
    ("found", "said"),
    [
        (common_stretch("own", noise(9_000), noise(9_000), 0), "furthest at lag 4, as in the whole recordings."),
        (tone(), "furthest at lag −1, not at 4 as in the whole recordings."),
    ],
)
def test_what_is_said_of_ones_own_is_what_the_chain_does(found: Phasors, said: str) -> None:
    assert own_in_words(found)["said"]["plain"].endswith(said)
