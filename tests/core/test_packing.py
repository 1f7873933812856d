"""Pictures, readings and pairs packed for the browser, read back byte by byte."""

import io
import json
from typing import Any

import cv2
import numpy as np
import pytest
from PIL import Image

from stereolag.core.inputs import as_grey
from stereolag.figures.legends import Colours, strip_legend, word_legend
from stereolag.ui.components import TRUTH_OFFSET_PX, TRUTH_STEPS_PER_PX, packed_grey_pair
from stereolag.ui.elements import Number
from stereolag.ui.linked_pictures import DepthScale, Picture, Reading, described, packed
from tests.packed import unpacked, values_of

GREY = np.full((6, 9, 3), 120, np.uint8)


@pytest.mark.parametrize("largest", [0.0, 0.9, 63.7, 1023.5, 5e6])
def test_readings_arrive_to_their_last_decimal_or_as_fine_as_sixteen_bits_are(largest: float) -> None:
    values = np.linspace(-largest, largest, 54).reshape(6, 9).astype(np.float32)
    values[2, 3] = np.nan
    header, parts = unpacked(packed(Picture("map", None, (Reading(values, unit="px", digits=2),))).data)
    reading = header["readings"][0]
    assert header["image"] is None
    np.testing.assert_allclose(values_of(reading, parts), values, atol=max(0.005, largest / 32767))
    assert reading["unit"] == "px"


def test_words_and_pictures_arrive_whole() -> None:
    pixels = np.arange(6 * 9 * 3, dtype=np.uint8).reshape(6, 9, 3)
    codes = np.arange(54, dtype=np.uint8).reshape(6, 9) % 3
    header, parts = unpacked(packed(Picture("map", pixels, (Reading(codes, words=("a", "b", "c")),))).data)
    np.testing.assert_array_equal(np.asarray(Image.open(io.BytesIO(parts[header["image"]]))), pixels)
    np.testing.assert_array_equal(values_of(header["readings"][0], parts), codes)
    header, parts = unpacked(packed(Picture("photograph", pixels, photograph=True)).data)
    assert Image.open(io.BytesIO(parts[header["image"]])).format == "JPEG"
    assert header["type"] == "image/jpeg"


def test_a_set_is_described_with_its_colours_its_legends_and_its_figures() -> None:
    palette = np.stack([np.arange(256, dtype=np.uint8)] * 3, axis=1)
    figure = Number("EPE", "0.5 px", "Mean error.")
    values = Reading(np.zeros((6, 9)), depth=lambda: DepthScale(10, 0, 0.1))
    pictures = [
        Picture("map", None, (values,), (figure,)),
        Picture("photograph", GREY, photograph=True, pickable=False, thumbnail=True),
    ]
    legends = [
        strip_legend("px", 0, 20, palette, ends=("FAR", "NEAR"), below=lambda value: f"{value / 10:g} m"),
        word_legend("why", ["#ff0000"], ["red"]),
    ]
    packs = [packed(picture) for picture in pictures]
    header = described(
        pictures, packs, name="grid", colours=Colours(0, 20, palette), legends=legends, columns=2, hint="Look."
    )
    assert json.dumps(header)
    assert (header["name"], header["rows"], header["cols"], header["columns"]) == ("grid", 6, 9, 2)
    assert [one["digest"] for one in header["pictures"]] == [pack.digest for pack in packs]
    assert header["pictures"][0]["depths"] == [{"focal_times_baseline": 10, "doffs_px": 0, "disparity_error": 0.1}]
    assert header["pictures"][0]["figures"] == [
        {"label": "EPE", "value": "0.5\N{NO-BREAK SPACE}px", "meaning": "Mean error."}
    ]
    assert [one["thumbnail"] for one in header["pictures"]] == [False, True]
    assert bytes.fromhex(header["colours"]["palette"]) == palette.tobytes()
    strip, words = header["legends"]
    assert strip["colours"][:2] == ("#000000", "#111111")
    assert strip["words"] == ("FAR", "NEAR")
    assert [tick for tick in strip["ticks"] if tick[1] == "10"] == [(0.5, "10", "1 m")]
    assert words["words"] == ("red",)


def test_of_a_wide_picture_every_other_pixel_is_sent_and_rows_and_columns_stay_those_of_the_whole() -> None:
    values = np.arange(3 * 2001, dtype=np.float32).reshape(3, 2001)
    pack = packed(Picture("wide", np.zeros((3, 2001, 3), np.uint8), (Reading(values),)))
    header, parts = unpacked(pack.data)
    assert (pack.shape, pack.step) == ((3, 2001), 2)
    np.testing.assert_array_equal(values_of(header["readings"][0], parts), values[::2, ::2])
    assert pack.digest == packed(Picture("another", np.zeros((3, 2001, 3), np.uint8), (Reading(values),))).digest
    assert pack.digest != packed(Picture("wide", np.zeros((3, 2001, 3), np.uint8), (Reading(values + 1),))).digest


def test_pictures_of_different_size_are_refused() -> None:
    with pytest.raises(ValueError, match="must all have one"):
        packed(Picture("map", GREY, (Reading(np.zeros((6, 8))),)))


def images_of(item: bytes) -> tuple[dict[str, Any], list[np.ndarray]]:
    header, parts = unpacked(item)
    return header, [cv2.imdecode(np.frombuffer(part, np.uint8), cv2.IMREAD_UNCHANGED) for part in parts]


def test_eight_bit_images_arrive_as_the_grey_that_is_matched() -> None:
    left, right = np.random.default_rng(1).integers(0, 256, (2, 30, 40, 3), dtype=np.uint8)
    header, images = images_of(packed_grey_pair(left, right, None, name="here", digest="this pair"))
    assert (header["name"], header["digest"], header["rows"], header["cols"]) == ("here", "this pair", 30, 40)
    assert len(images) == 2
    np.testing.assert_array_equal(images[0], as_grey(left))
    np.testing.assert_array_equal(images[1], as_grey(right))


@pytest.mark.parametrize("dtype", [np.uint16, np.float32])
def test_other_images_are_spread_over_eight_bits_together(dtype: type) -> None:
    left = np.linspace(0, 1000, 1200).reshape(30, 40).astype(dtype)
    _, (eight_bit, right) = images_of(packed_grey_pair(left, left // 2, None, name="", digest=""))
    assert eight_bit.dtype == np.uint8
    assert eight_bit.max() == 255
    assert 120 < right.max() < 135


def test_the_ground_truth_arrives_to_a_sixty_fourth_of_a_pixel() -> None:
    image = np.zeros((2, 3), np.uint8)
    truth = np.array([[26.5, np.nan, 0.0], [-13.27, 300.1, 600.0]], np.float32)
    _, images = images_of(packed_grey_pair(image, image, truth, name="", digest=""))
    codes = images[2][..., 2].astype(int) * 256 + images[2][..., 1]
    found = np.where(codes > 0, codes / TRUTH_STEPS_PER_PX - TRUTH_OFFSET_PX, np.nan)
    expected = np.where(truth < 512, truth, np.nan)
    np.testing.assert_allclose(found, expected, atol=0.5 / TRUTH_STEPS_PER_PX)
