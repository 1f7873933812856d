from __future__ import annotations

import base64
import json
import string
from collections.abc import Callable
from typing import Any, get_args

import numpy as np
from streamlit.testing.v1 import AppTest

from stereolag.signals import by_hand
from stereolag.signals.verdict import Reason
from stereolag.ui.lag.disturbances.words import EXAMPLES, SLIDERS, START, WORDS


def test_the_lag_page_hands_over_what_is_mixed_whatever_is_measured(open_page: Callable[[str], AppTest]) -> None:
    app = open_page("pages/1_Sensor_lag.py")
    (told,) = disturbed(app)
    parts, expected = told["parts"], by_hand.ingredients()
    texts = (parts["fresh"], parts["pattern"], *parts["noises"])
    arrays = (expected.fresh, expected.pattern, expected.noise_1, expected.noise_2)
    for text, array in zip(texts, arrays, strict=True):
        np.testing.assert_array_equal(np.frombuffer(base64.b64decode(text), dtype=np.int8), array)
    assert parts["lag"] == by_hand.LAG and told["reach"] == by_hand.MAX_LAG
    app.button_group(key="recordings").set_value("harbour").run()
    assert disturbed(app) == [told]  # the sliders do not change


def test_every_example_can_be_set_with_the_sliders() -> None:
    names = [slider["name"] for slider in SLIDERS]
    assert list(START) == names and set(WORDS["sliders"]) == set(names)
    for example in EXAMPLES:
        settings = START | example["settings"]
        assert list(settings) == names
        for slider in SLIDERS:
            value = settings[slider["name"]]
            assert slider["low"] <= value <= slider["high"]
            assert (value - slider["low"]) % slider["step"] == 0


def test_every_verdict_of_this_method_has_its_words() -> None:
    reasons = {*get_args(Reason), "wrong"} - {"few_votes"}  # this method has no votes
    assert set(WORDS["verdicts"]) == set(WORDS["lessons"]) == reasons
    known = {"lag", "true", "delay", "period", "spacing", "rivals", "from", "to", "searched", "evidence"}
    texts = [*WORDS["verdicts"].values(), *WORDS["lessons"].values(), *WORDS["notes"].values(), WORDS["numbers"]]
    used = {name for text in texts for _, name, _, _ in string.Formatter().parse(text) if name}
    assert used <= known | {"needed"}


def disturbed(app: AppTest) -> list[dict[str, Any]]:
    parts = [element.proto for element in app.get("bidi_component")]
    return [json.loads(one.json) for one in parts if one.component_name == "stereolag.disturbances"]
