"""What is packed for the browser, read back byte by byte."""

from __future__ import annotations

import io
import json
import zlib
from typing import Any

import numpy as np
import pytest
from PIL import Image

from stereolag.figures.linked_pictures import DepthScale, Picture, Reading, packed, strip_legend, word_legend

GREY = np.full((6, 9, 3), 120, np.uint8)


def unpacked(content: bytes) -> tuple[dict[str, Any], bytes]:
    length = int.from_bytes(content[:4], "little")
    return json.loads(content[4 : 4 + length]), content[4 + length :]


def values_of(reading: dict[str, Any], body: bytes) -> np.ndarray:
    start, size = reading["values"]
    steps = np.frombuffer(zlib.decompress(body[start : start + size]), "<i2").reshape(-1, reading["cols"])
    raw = np.cumsum(steps, axis=1, dtype=np.int16)
    return np.where(raw == -32768, np.nan, raw * reading["quantum"])


@pytest.mark.parametrize("largest", [0.0, 0.9, 63.7, 1023.5, 5e6])
def test_readings_arrive_to_their_last_decimal_or_as_fine_as_sixteen_bits_are(largest: float) -> None:
    values = np.linspace(-largest, largest, 54).reshape(6, 9).astype(np.float32)
    values[2, 3] = np.nan
    header, body = unpacked(packed([Picture("map", GREY, (Reading(values, unit="px", digits=2),))], name="x"))
    reading = header["pictures"][0]["readings"][0]
    np.testing.assert_allclose(values_of(reading, body), values, atol=max(0.005, largest / 32767))
    assert reading["unit"] == "px"


def test_words_pictures_and_legends_arrive_whole() -> None:
    pixels = np.arange(6 * 9 * 3, dtype=np.uint8).reshape(6, 9, 3)
    codes = np.arange(54, dtype=np.uint8).reshape(6, 9) % 3
    pictures = [
        Picture("map", pixels, (Reading(codes, words=("a", "b", "c")),)),
        Picture("photograph", pixels, photograph=True, pickable=False),
    ]
    palette = np.stack([np.arange(256, dtype=np.uint8)] * 3, axis=1)
    legends = [strip_legend("px", 0, 12.5, palette), word_legend("why", ["#ff0000"], ["red"])]
    header, body = unpacked(packed(pictures, name="grid", legends=legends, columns=2, hint="Look."))
    assert (header["name"], header["rows"], header["cols"], header["columns"]) == ("grid", 6, 9, 2)
    first, second = header["pictures"]
    start, size = first["image"]
    np.testing.assert_array_equal(np.asarray(Image.open(io.BytesIO(body[start : start + size]))), pixels)
    start, size = second["image"]
    assert Image.open(io.BytesIO(body[start : start + size])).format == "JPEG"
    np.testing.assert_array_equal(values_of(first["readings"][0], body), codes)
    assert header["legends"][0]["colours"][:2] == ["#000000", "#111111"]
    assert header["legends"][0]["words"] == ["0", "12.5"]
    assert header["legends"][1]["words"] == ["red"]


def test_of_a_wide_picture_every_other_pixel_is_sent_and_rows_and_columns_stay_those_of_the_whole() -> None:
    values = np.arange(3 * 2001, dtype=np.float32).reshape(3, 2001)
    pixels = np.zeros((3, 2001, 3), np.uint8)
    header, body = unpacked(packed([Picture("wide", pixels, (Reading(values),))], name="x"))
    assert (header["rows"], header["cols"], header["step"]) == (3, 2001, 2)
    np.testing.assert_array_equal(values_of(header["pictures"][0]["readings"][0], body), values[::2, ::2])


def test_the_digest_changes_with_the_content_alone() -> None:
    def digest(depth: DepthScale | None, value: float) -> str:
        reading = Reading(np.full((6, 9), value), depth=depth)
        return str(unpacked(packed([Picture("map", GREY, (reading,))], name="x"))[0]["digest"])

    assert digest(None, 1.5) == digest(None, 1.5)
    assert len({digest(None, 1.5), digest(None, 1.25), digest(DepthScale(10, 0, 0.1), 1.5)}) == 3


def test_pictures_of_different_size_are_refused() -> None:
    with pytest.raises(ValueError, match="must all have one"):
        packed([Picture("map", GREY, (Reading(np.zeros((6, 8))),))], name="x")
