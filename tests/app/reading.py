"""Helpers that read what a page shows."""

import hashlib
import json
import re
from collections.abc import Iterable
from typing import Any

from streamlit.testing.v1 import AppTest

from stereolag.ui.controls import exact_key
from tests.packed import delivered


def address(app: AppTest) -> dict[str, str]:
    return {name: value if isinstance(value, str) else value[0] for name, value in app.query_params.items()}


def ignored(app: AppTest) -> list[str]:
    return [warning.value for warning in app.warning if "ignored" in warning.value]


def numbers(app: AppTest) -> dict[str, str]:
    """Return the numbers of a result, by their labels: as large numbers, or in a line below its headline."""
    lines = [one for caption in app.caption for one in NUMBER.findall(caption.value) if " · " in caption.value]
    return {metric.label: metric.value for metric in app.metric} | dict(lines)


NUMBER = re.compile(r"(?:^| · )([^·*]+) \*\*(.+?)\*\*")

LAG_FOUND = re.compile(r"Sensor ([12]) hears it .*?\(([\d,.]+)")


def lag_found(app: AppTest) -> int:
    """Return the lag in the headline, in whole samples."""
    said = app.header[0].value
    if "at the same time" in said:
        return 0
    found = LAG_FOUND.search(said)
    assert found is not None, said
    return round(float(found[2].replace(",", ""))) * (1 if found[1] == "2" else -1)


def captions(app: AppTest) -> str:
    """Return all captions of a page, with their tooltips, as one text."""
    return " ".join(f"{caption.value} {caption.help}" for caption in app.caption)


def charts(app: AppTest) -> list[dict[str, Any]]:
    return [json.loads(chart.proto.spec) for chart in app.get("plotly_chart")]


def controls(app: AppTest) -> dict[str, Any]:
    """Return the controls that can be moved, without the boxes beside sliders, by their keys."""
    widgets = [*app.slider, *app.number_input, *app.selectbox, *app.toggle, *app.get("button_group")]
    boxes = {exact_key(slider.key) for slider in app.slider}
    return {widget.key: widget for widget in widgets if not widget.disabled and widget.key not in boxes}


def labelled(elements: Iterable[Any], label: str) -> Any:
    return next(one for one in elements if one.label == label)


def viewers(app: AppTest) -> list[dict[str, Any]]:
    """Return the descriptions of the page's sets of linked pictures."""
    return delivered(app, "description")


def outlines(app: AppTest) -> dict[str, str]:
    """Return the outline paths drawn over the maps, by the name of the set of linked pictures."""
    return {one["name"]: one["outlines"] for one in viewers(app) if one["outlines"]}


def figures(app: AppTest) -> dict[str, dict[str, str]]:
    """Return the numbers below each map of the depth page, by title and label."""
    bench = next(viewer for viewer in viewers(app) if viewer["name"] == "depth.bench")
    return {
        picture["title"]: {figure["label"]: figure["value"] for figure in picture["figures"]}
        for picture in bench["pictures"]
        if picture["figures"]
    }


def shown(app: AppTest) -> str:
    """Return a hash of all pictures, charts, headlines and numbers of a page, but no run times."""
    pictures = [picture.url for element in app.get("image") for picture in element.proto.imgs]
    specs = [element.proto.spec for element in app.get("plotly_chart")]
    headlines = [header.value for header in app.header]
    headlines += [f"{name} {value}" for name, value in numbers(app).items() if name != "Computed in"]
    linked_pictures = [viewer | {"digest": ""} for viewer in viewers(app)]
    for picture in (picture for viewer in linked_pictures for picture in viewer["pictures"]):
        picture["figures"] = [figure for figure in picture["figures"] if figure["label"] != "Computed in"]
    all_shown = (*pictures, *specs, *headlines, json.dumps(linked_pictures))
    return hashlib.sha256("\0".join(all_shown).encode()).hexdigest()
