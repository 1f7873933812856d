"""Items for the browser, unpacked as its scripts do it."""

import json
import zlib
from typing import Any

import numpy as np
from streamlit.testing.v1 import AppTest

from stereolag.core.arrays import FloatMap


def unpacked(item: bytes) -> tuple[dict[str, Any], list[bytes]]:
    """Return the header of an item of :mod:`stereolag.ui.components`, and its parts."""
    length = int.from_bytes(item[:4], "little")
    header, body = json.loads(item[4 : 4 + length]), item[4 + length :]
    return header, [body[start : start + size] for start, size in header["parts"]]


def values_of(reading: dict[str, Any], parts: list[bytes]) -> FloatMap:
    """Return the values of a reading of a packed picture, NaN where there is none."""

    def part(name: str, kind: str) -> np.ndarray:
        return np.frombuffer(zlib.decompress(parts[reading[name]]), kind)

    steps = part("steps", "i1").astype("<i2")
    steps[steps == -128] = part("long_steps", "<i2")
    raw = np.cumsum(steps.reshape(reading["rows"], reading["cols"]), axis=1, dtype=np.int16)
    return np.where(raw == -32768, np.nan, raw * reading["quantum"])


def told(app: AppTest, name: str) -> list[dict[str, Any]]:
    """Return the data of all components of a name on a page, or the headers of their items."""
    parts = [element.proto for element in app.get("bidi_component")]
    return [
        json.loads(one.json) if one.json else unpacked(one.bytes)[0]
        for one in parts
        if one.component_name == f"stereolag.{name}"
    ]


def delivered(app: AppTest, kind: str) -> list[dict[str, Any]]:
    """Return the headers of the items of a kind that a page delivers to its components."""
    return [header for header in told(app, "delivery") if header["kind"] == kind]
