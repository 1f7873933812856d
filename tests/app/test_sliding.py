from __future__ import annotations

import json
from collections.abc import Callable

from streamlit.testing.v1 import AppTest


def test_the_lag_page_offers_five_examples_to_slide_whatever_is_measured(open_page: Callable[[str], AppTest]) -> None:
    app = open_page("pages/1_Sensor_lag.py")
    (told,) = sliding(app)
    assert [example["name"] for example in told["examples"]] == ["seven", "coast", "tone", "noise", "loud"]
    for example in told["examples"]:
        assert len(example["cut"]) < len(example["recording"])
        assert example["title"] and example["try"] and set(example["said"]) == {"plain", "normalised"}
    assert [example["name"] for example in told["examples"] if example["whole"]] == ["seven"]
    app.button_group(key="recordings").set_value("harbour").run()
    assert sliding(app) == [told]  # painted values stay in the browser


def sliding(app: AppTest) -> list[dict[str, list[dict[str, object]]]]:
    parts = [element.proto for element in app.get("bidi_component")]
    return [json.loads(one.json) for one in parts if one.component_name == "stereolag.sliding"]
