"""Disparity maps: round trips, NaN where unknown, and real ground truths read as their makers intended."""

from __future__ import annotations

import io
import json

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from stereolag.io.disparities import read_disparity

shapes = st.tuples(st.integers(1, 12), st.integers(1, 12))


def png(pixels: np.ndarray) -> bytes:
    return cv2.imencode(".png", pixels)[1].tobytes()


def pfm(disparity: np.ndarray, scale: str = "-1.0") -> bytes:
    rows, cols = disparity.shape
    body = disparity[::-1].astype("<f4" if scale.startswith("-") else ">f4")
    return f"Pf\n{cols} {rows}\n{scale}\n".encode() + body.tobytes()


def npy(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


@given(
    disparity=hnp.arrays(np.float32, shapes, elements=st.floats(width=32)).filter(lambda a: np.isfinite(a).any()),
    scale=st.sampled_from(["-1.0", "1.0", "-0.003922", "2e-3"]),
)
def test_pfm_round_trip_in_both_byte_orders(disparity, scale):
    expected = np.where(np.isfinite(disparity), disparity, np.nan)
    found = read_disparity(pfm(disparity, scale))
    assert found.dtype == np.float32
    np.testing.assert_array_equal(found, expected)


@given(pixels=hnp.arrays(np.uint16, shapes).filter(np.any))
def test_kitti_png_round_trip(pixels):
    found = read_disparity(png(pixels))
    assert found.dtype == np.float32
    np.testing.assert_array_equal(np.isnan(found), pixels == 0)
    np.testing.assert_array_equal(np.nan_to_num(found) * 256, pixels)


@given(pixels=hnp.arrays(np.uint8, shapes).filter(np.any), divisor=st.sampled_from([1, 2, 4, 16]))
def test_8_bit_with_a_divisor(pixels, divisor):
    rows, cols = pixels.shape
    pgm = f"P5\n# made by hand\n{cols} {rows}\n255\n".encode() + pixels.tobytes()
    for data in (png(pixels), pgm):
        found = read_disparity(data, divisor=divisor)
        np.testing.assert_array_equal(np.nan_to_num(found) * divisor, pixels)
        np.testing.assert_array_equal(np.isnan(found), pixels == 0)


@given(disparity=hnp.arrays(np.float32, shapes, elements=st.floats(-500, 500, width=32)))
def test_npy_round_trip(disparity):
    np.testing.assert_array_equal(read_disparity(npy(disparity)), disparity)
    np.testing.assert_allclose(read_disparity(npy(disparity.astype(np.float64)), divisor=4), disparity / 4, atol=1e-30)


def test_a_pgm_is_not_stretched():
    dark = b"P5 2 1 15\n\x05\x0f"
    np.testing.assert_array_equal(read_disparity(dark, divisor=1), [[5, 15]])
    deep = b"P5 2 1 4095\n" + np.array([512, 4095], ">u2").tobytes()
    np.testing.assert_array_equal(read_disparity(deep), [[2, 4095 / 256]])


def test_integers_in_npy_are_px_and_0_is_one():
    np.testing.assert_array_equal(read_disparity(npy(np.array([[0, 7]]))), [[0, 7]])


def test_numbers_beyond_float32_are_unknown():
    np.testing.assert_array_equal(read_disparity(npy(np.array([[1e300, 7]]))), [[np.nan, 7]])


def test_a_signalling_nan_is_unknown_without_a_warning():
    odd = b"Pf\n2 1\n-1\n\x00\x00\xa0\x7f" + np.float32(3).tobytes()
    np.testing.assert_array_equal(read_disparity(odd), [[np.nan, 3]])


def test_windows_line_ends_in_a_pfm_header():
    np.testing.assert_array_equal(read_disparity(b"Pf\r\n1 1\r\n-1\r\n" + np.float32(3).tobytes()), [[3]])


@pytest.mark.parametrize(
    ("data", "options", "message"),
    [
        (b"", {}, "empty file"),
        (b"words", {}, "accepted are PFM, PNG or PGM"),
        (png(np.full((2, 2), 9, np.uint8)), {}, "8 bits per pixel: its divisor must be given"),
        (b"P5 1 1 255\n\x07", {}, "8 bits per pixel: its divisor must be given"),
        (png(np.full((2, 2, 3), 9, np.uint8)), {"divisor": 4}, r"shape \(2, 2, 3\); allowed is one channel"),
        (png(np.zeros((2, 2), np.uint16)), {}, "no disparity at all"),
        (pfm(np.full((2, 2), np.inf)), {}, "no disparity at all"),
        (png(np.ones((2, 2), np.uint16)), {"divisor": 0}, "divisor is 0"),
        (png(np.ones((2, 2), np.uint16)), {"divisor": -4}, "divisor is -4"),
        (png(np.ones((2, 2), np.uint16)), {"divisor": float("nan")}, "divisor is nan"),
        (pfm(np.ones((3, 3)))[:-1], {}, "cut short: 3 × 3 pixels need 36 bytes, it has 35"),
        (pfm(np.ones((3, 3)), "0"), {}, "scale 0"),
        (pfm(np.ones((3, 3)), "1e"), {}, "scale 1e"),
        (b"PF\n1 1\n-1\n" + bytes(12), {}, "not a grey PFM"),
        (b"Pf\n0 5\n-1\n", {}, "0 × 5 pixels: it holds none"),
        (b"Pf\n30000 30000\n-1\n", {}, "30000 × 30000 pixels.*at most 50 megapixels"),
        (b"P5\n30000 30000\n255\n", {}, "30000 × 30000 pixels.*at most 50 megapixels"),
        (b"P5\n2 2\n255\n\x01", {}, "cut short: 2 × 2 pixels need 4 bytes, it has 1"),
        (b"P5\n2 2\n70000\n", {}, "70000 for its largest value; allowed are 1 to 65535"),
        (b"P5 1 1 7\n\x09", {}, "holds 9, above the 7"),
        (b"P2 1 1 7\n1", {}, "not a binary PGM"),
        (b"P5 nonsense", {}, "not a binary PGM"),
        (npy(np.ones(4)), {}, r"shape \(4,\)"),
        (npy(np.ones((2, 2), complex)), {}, "holds complex128"),
    ],
)
def test_bad_files_are_one_clear_sentence(data, options, message):
    with pytest.raises(ValueError, match=message) as caught:
        read_disparity(data, **options)
    assert "\n" not in str(caught.value)


def test_every_real_ground_truth(data_dir):
    truths = sorted((data_dir / "stereo").glob("*/gt.*"))
    assert len(truths) == 10
    for path in truths:
        notes = json.loads((path.parent / "calib.json").read_text())
        disparity = read_disparity(path, divisor=notes["disparity_divisor"])
        assert disparity.dtype == np.float32
        assert 4 < np.nanmin(disparity) < np.nanmax(disparity) < notes["max_disparity"]
        assert 0.1 < np.isfinite(disparity).mean() < 1


def test_a_real_pfm_by_hand(data_dir):
    data = (data_dir / "stereo" / "motorcycle_q" / "gt.pfm").read_bytes()
    raw = np.frombuffer(data[-741 * 497 * 4 :], "<f4").reshape(497, 741)[::-1]
    np.testing.assert_array_equal(read_disparity(data), np.where(np.isinf(raw), np.nan, raw))
