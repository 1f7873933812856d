"""Whatever the bytes, a reader answers with its result or with a ValueError of one line, and lets no warning out."""

from __future__ import annotations

import io
from collections.abc import Callable

import cv2
import numpy as np
import pytest
import soundfile
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from stereolag.export import settings_json
from stereolag.reading import read_calibration, read_disparity, read_image, read_matcher, read_signal
from stereolag.stereo.methods import METHODS

RNG = np.random.default_rng(11)
PIXELS = RNG.integers(0, 256, (9, 11, 3), dtype=np.uint8)
SAMPLES = RNG.uniform(-0.5, 0.5, (300, 2))
MATRIX = "  rows: 3\n  cols: 3\n  dt: d\n  data: [500, 0, 160, 0, 500, 120, 0, 0, 1]\n"


def picture(kind: str, pixels: np.ndarray = PIXELS) -> bytes:
    stream = io.BytesIO()
    exif = Image.Exif()
    exif[0x0112] = 6
    Image.fromarray(pixels).save(stream, kind, exif=exif)
    return stream.getvalue()


def sound(kind: str) -> bytes:
    stream = io.BytesIO()
    soundfile.write(stream, SAMPLES, 44_100, format=kind)
    return stream.getvalue()


def npy(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


PICTURES = [picture(kind) for kind in ("PNG", "JPEG", "BMP", "TIFF", "WEBP", "PPM", "GIF")] + [
    picture("PNG", RNG.integers(0, 65536, (9, 11), dtype=np.uint16)),
    cv2.imencode(".png", RNG.integers(0, 65536, (9, 11, 3), dtype=np.uint16))[1].tobytes(),
    cv2.imencode(".tiff", RNG.integers(0, 65536, (9, 11, 3), dtype=np.uint16))[1].tobytes(),
]
RECORDINGS = [sound(kind) for kind in ("WAV", "FLAC", "OGG", "MP3", "AIFF")] + [
    npy(SAMPLES),
    b"Samples\r\n0.5,1\r\n-2e3,7\r\n3,4\r\n",
]
DISPARITIES = [
    b"Pf\n3 2\n-1.0\n" + np.arange(6, dtype="<f4").tobytes(),
    b"P5\n3 2\n255\n" + bytes(range(6)),
    npy(np.arange(6.0).reshape(2, 3)),
    cv2.imencode(".png", np.arange(600, dtype=np.uint16).reshape(20, 30))[1].tobytes(),
]
CALIBRATIONS = [
    b"cam0=[400 0 100; 0 400 90; 0 0 1]\ncam1=[400 0 110; 0 400 90; 0 0 1]\ndoffs=10\nbaseline=193\nwidth=200\n",
    b"P2: 720 0 600 45 0 720 170 0 0 0 1 0\nP3: 720 0 600 -339 0 720 170 0 0 0 1 0\n",
    f"%YAML:1.0\n---\nM1: !!opencv-matrix\n{MATRIX}M2: !!opencv-matrix\n{MATRIX}R: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n"
    "T: [-0.1, 0, 0]\nD1: [-0.2, 0.1, 0, 0]\nimage_size: [320, 240]\n".encode(),
    b'{"focal_px": 700, "baseline_m": 0.5, "doffs_px": 3, "cx": 10, "width": 640, "Q": {"rows": 1}}',
    b"image_width: 640\nprojection_matrix:\n  rows: 3\n  cols: 4\n  data: [7, 0, 3, -1, 0, 7, 2, 0, 0, 0, 1, 0]\n",
]
MATCHERS = [settings_json(method()).encode() for method in METHODS.values()]


@st.composite
def mutated(draw: st.DrawFn, originals: list[bytes]) -> bytes:
    """Draw a valid file with some bytes changed, cut out, put in or cut off."""
    data = bytearray(draw(st.sampled_from(originals)))
    for _ in range(draw(st.integers(1, 6))):
        place = draw(st.integers(0, len(data)))
        change = draw(st.sampled_from(["replace", "insert", "remove", "cut"]))
        if change == "cut":
            del data[place:]
        elif change == "remove":
            del data[place : place + draw(st.integers(1, 8))]
        else:
            new = draw(st.one_of(st.binary(min_size=1, max_size=4), st.sampled_from([b"\xff" * 4, b"9" * 9, b"\0"])))
            data[place : place + (len(new) if change == "replace" else 0)] = new
    return bytes(data)


def survives(read: Callable[[bytes], object], data: bytes) -> None:
    try:
        read(data)
    except ValueError as error:
        assert str(error).strip()
        assert "\n" not in str(error)


CASES = [
    pytest.param(read_image, PICTURES, id="image"),
    pytest.param(read_signal, RECORDINGS, id="signal"),
    pytest.param(read_disparity, DISPARITIES, id="disparity"),
    pytest.param(lambda data: read_disparity(data, divisor=4), DISPARITIES, id="disparity with divisor"),
    pytest.param(read_calibration, CALIBRATIONS, id="calibration"),
    pytest.param(read_matcher, MATCHERS, id="matcher"),
]


@pytest.mark.parametrize(("read", "originals"), CASES)
def test_the_originals_are_valid(read, originals):
    for data in originals:
        if read is not read_disparity or not data.startswith(b"P5"):
            read(data)


@pytest.mark.parametrize(("read", "originals"), CASES)
@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(draws=st.data())
def test_mutated_files(read, originals, draws):
    survives(read, draws.draw(mutated(originals)))


@pytest.mark.parametrize(("read", "originals"), CASES)
@settings(max_examples=60)
@given(data=st.one_of(st.binary(max_size=200), st.text(max_size=100).map(lambda text: text.encode("utf-8", "replace"))))
def test_random_bytes(read, originals, data):
    survives(read, data)
    survives(read, originals[0][:8] + data)
