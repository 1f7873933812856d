from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from streamlit.testing.v1 import AppTest

from stereolag.signals.phasors import (
    LAG,
    SIZE,
    Phasors,
    common_stretch,
    tone,
)
from stereolag.ui.lag.phasors.words import own_in_words
from tests.app.uploads import noise, wav

EXAMPLES = ["knock", "coast", "harbour", "tone", "noise"]


def told(app: AppTest) -> list[dict[str, Any]]:
    """Return the examples sent to the browser."""
    parts = [element.proto for element in app.get("bidi_component")]
    (one,) = [json.loads(part.json) for part in parts if part.component_name == "stereolag.phasors"]
    examples: list[dict[str, Any]] = one["examples"]
    return examples


def upload(app: AppTest, first: np.ndarray, second: np.ndarray) -> AppTest:
    app.button_group(key="recordings").set_value("own").run()
    app.file_uploader(key="recordings.file_1").upload("1.wav", wav(first), "audio/wav")
    app.file_uploader(key="recordings.file_2").upload("2.wav", wav(second), "audio/wav")
    return app.run()


def test_the_lag_page_offers_five_examples_whatever_is_measured(open_page: Callable[..., AppTest]) -> None:
    app = open_page("pages/1_Sensor_lag.py")
    examples = told(app)
    assert [example["name"] for example in examples] == EXAMPLES
    for example in examples:
        assert example["title"] and example["try"] and set(example["said"]) == {"plain", "whitened"}
        assert len(example["magnitude_1"]) == len(example["magnitude_2"]) == len(example["turns"]) == SIZE // 2
    coast = next(example for example in examples if example["name"] == "coast")
    assert coast["offset"] + LAG * coast["step"] == 50_082
    assert f"mean of {coast['step']} samples" in coast["try"] and f"{coast['offset']:,} samples later" in coast["try"]
    app.button_group(key="recordings").set_value("harbour").run()
    assert told(app) == examples  # painted values stay in the browser


def test_ones_own_recordings_come_first_once_their_lag_is_found(open_page: Callable[..., AppTest]) -> None:
    scene = noise(12_000)
    app = upload(open_page("pages/1_Sensor_lag.py"), scene[:-500], scene[500:])
    own, *others = told(app)
    assert [example["name"] for example in others] == EXAMPLES
    assert own["title"] == "Your recordings"
    assert own["offset"] + LAG * own["step"] == -500
    assert own["said"]["whitened"] == "The chain reaches furthest at lag 4, as in the whole recordings."


def test_recordings_with_nothing_in_common_have_no_arrows(open_page: Callable[..., AppTest]) -> None:
    app = upload(open_page("pages/1_Sensor_lag.py"), noise(9_000, seed=1), noise(9_000, seed=2))
    assert [example["name"] for example in told(app)] == EXAMPLES


@pytest.mark.parametrize(
    ("found", "said"),
    [
        (common_stretch("own", noise(9_000), noise(9_000), 0), "furthest at lag 4, as in the whole recordings."),
        (tone(), "furthest at lag −1, not at 4 as in the whole recordings."),
    ],
)
def test_what_is_said_of_ones_own_is_what_the_chain_does(found: Phasors, said: str) -> None:
    assert own_in_words(found)["said"]["plain"].endswith(said)
