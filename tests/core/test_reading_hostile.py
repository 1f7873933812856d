"""Hostile files: each is read or refused in one sentence, within 5 s and 500 MB; and no reader waits for another."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import threading
import warnings
from pathlib import Path

import numpy as np
import pytest
from hostile_cases import READ, READERS
from hostile_files import hostile_files
from measured_reading import Reading, answer_of
from picture_bytes import by_pillow, noise, png

from stereolag.core.jobs import limits
from stereolag.io import images
from stereolag.io.images import read_image
from stereolag.io.recordings import read_signal

MOST_SECONDS = 5
MOST_MB = 500
SMALL_MB = 40
"""Memory that a bomb of a few kilobytes may take."""

A_SERVER = {"STEREOLAG_MAX_MEGASAMPLES": "30"}
"""The limit of the pages; a script on its owner's machine may read more."""

FILES = hostile_files()
LONG = re.compile("49 megapixels|40 megapixels|MB|million|[0-9],000|minutes|text, |in a row|overlapping|a short line")
BOMBS = [
    "PNG, 16-bit colour, IDAT claims 2 GB",
    "PNG, packed comment of 64 MB",
    "PNG, packed profile of 64 MB",
    "PNG, 1 pixel and 64 MB behind it",
    "PNG, EXIF of overlapping tags",
    "JPEG, EXIF of overlapping tags",
    "TIFF, 20,000 overlapping tags of 1 MB",
    "TIFF, tile of 30,000 a side",
    "FLAC, header claims 30 million of 100",
    *(name for name in FILES if name.startswith("calibration: ")),
]
LARGE = [
    "PNG, comment of 60 MB",
    "PNG, 3 million chunks",
    "PNG, EXIF of 60 MB",
    "JPEG, comments of 60 MB",
    "JPEG, 3,000 scans",
    "JPEG, 30 million restarts",
    "GIF, comment of 60 MB",
    "TIFF, 10 million strips",
    "TIFF, private tag of 60 MB",
    "WEBP, profile of 60 MB",
    "BMP, 60 MB of runs",
    "PGM, 60 MB of spaces",
    "PPM as text, 7 million comments",
    "text, a short line and one of 60 MB",
    "text, 30 million lines",
    "text, wrong in the last line",
    "FLAC, 30 million silent samples",
    "map: PGM, 60 MB of spaces",
    "map: PFM, 60 MB of spaces",
    "map: NPY, 49 megapixels",
]
SMALL = [name for name in FILES if not LONG.search(name) and name not in BOMBS]


@pytest.fixture(autouse=True)
def _as_on_a_server(monkeypatch: pytest.MonkeyPatch):
    for name, value in A_SERVER.items():
        monkeypatch.setenv(name, value)
    limits.cache_clear()
    yield
    limits.cache_clear()


@pytest.fixture(scope="module")
def readings() -> dict[str, Reading]:
    here = Path(__file__).parent
    answer = subprocess.run(
        [sys.executable, str(here / "measured_reading.py")],
        input=json.dumps(BOMBS + LARGE),
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | A_SERVER | {"PYTHONPATH": os.pathsep.join([str(here.parents[1]), str(here)])},
        timeout=200,
    )
    return {row["name"]: Reading(**row) for row in json.loads(answer.stdout)}


@pytest.mark.skipif(not hasattr(os, "fork"), reason="memory is measured in forked processes")
@pytest.mark.parametrize("name", BOMBS + LARGE)
def test_a_large_file_is_read_or_refused_in_time_and_memory(name: str, readings: dict[str, Reading]) -> None:
    reading = readings[name]
    assert not reading.fault, reading.answer
    assert reading.seconds < MOST_SECONDS
    assert reading.extra_mb < (SMALL_MB if name in BOMBS else MOST_MB)
    is_as_expected(reading.answer, FILES[name].answer)


@pytest.mark.parametrize("name", SMALL)
def test_a_small_file_is_read_or_refused(name: str) -> None:
    answer, fault = answer_of(READERS[FILES[name].reader], FILES[name].make())
    assert not fault, answer
    is_as_expected(answer, FILES[name].answer)


def is_as_expected(answer: str, expected: str) -> None:
    assert len(answer) < 250
    if expected == READ:
        assert answer.startswith("read")
    elif expected:
        assert re.search(expected, answer)
        assert not answer.startswith("read")


def test_there_are_a_hundred_of_them() -> None:
    assert len(FILES) > 100


def test_no_reader_waits_for_another(monkeypatch: pytest.MonkeyPatch) -> None:
    """A slow decoder holds no lock that another reader needs, and readers leave the warning filters alone."""
    entered, released = threading.Event(), threading.Event()
    decode, slow = images.PillowImage.open, png(9, 9)

    def wait_for_slow(stream, formats):
        if stream.getvalue() == slow:
            entered.set()
            released.wait(30)
        return decode(stream, formats=formats)

    monkeypatch.setattr(images.PillowImage, "open", wait_for_slow)
    filters = list(warnings.filters)
    first, second = (threading.Thread(target=read_image, args=(data,), daemon=True) for data in (slow, png(5, 5)))
    first.start()
    assert entered.wait(30)
    assert list(warnings.filters) == filters
    second.start()
    second.join(20)
    finished_meanwhile = not second.is_alive()
    released.set()
    first.join(30)
    assert finished_meanwhile
    assert not first.is_alive()
    assert list(warnings.filters) == filters


@pytest.fixture
def tight_limits(monkeypatch: pytest.MonkeyPatch, _as_on_a_server: None):
    monkeypatch.setenv("STEREOLAG_MAX_MEGAPIXELS", "4")
    monkeypatch.setenv("STEREOLAG_MAX_MEGASAMPLES", "1")
    limits.cache_clear()
    yield
    limits.cache_clear()


@pytest.mark.usefixtures("tight_limits")
def test_whoever_runs_it_sets_the_limits() -> None:
    with pytest.raises(ValueError, match="at most 4 megapixels are accepted"):
        read_image(png(2001, 2000))
    assert read_image(png(2000, 2000)).shape == (2000, 2000)
    with pytest.raises(ValueError, match="at most 1,000,000 are accepted"):
        read_signal(b"1\n" * 1_000_001)
    with pytest.raises(ValueError, match="at most 1,000,000 in all"):
        read_signal(FILES["FLAC, header claims 30 million of 100"].make())


@pytest.mark.parametrize("tail", [1, 2, 100])
def test_every_cut_jpeg_is_damaged(tail: int) -> None:
    whole = by_pillow("JPEG", noise(3, 40))
    assert read_image(whole).shape == (40, 40, 3)
    with pytest.raises(ValueError, match="damaged or cut short"):
        read_image(whole[:-tail])


def test_netpbm_values_are_stretched_to_their_type() -> None:
    np.testing.assert_array_equal(read_image(b"P5 3 1 15\n\0\x05\x0f"), [[0, 85, 255]])
    np.testing.assert_array_equal(read_image(b"P6 1 1 3\n\0\1\3"), [[[0, 85, 255]]])
    np.testing.assert_array_equal(read_image(b"P2 # a\n2 1\n#b\n255 7 255"), [[7, 255]])
    np.testing.assert_array_equal(read_image(b"P1 4 2 0110 1 0 0 1"), [[255, 0, 0, 255], [0, 255, 255, 0]])
    deep = np.array([[[1, 2, 65535]]], np.uint16)
    found = read_image(b"P6 1 1 65535\n" + deep.astype(">u2").tobytes())
    assert found.dtype == np.uint16
    np.testing.assert_array_equal(found, deep)


def test_a_frame_lies_on_the_canvas_of_its_animation() -> None:
    data = FILES["WEBP, 90,000 frames"].make()
    wider = data[:24] + (19).to_bytes(3, "little") + (17).to_bytes(3, "little") + data[30:]
    image = read_image(wider)
    assert image.shape == (18, 20, 4)
    assert (image[:16, :16, 3] == 255).all()
    assert not image[16:].any()
    assert not image[:, 16:].any()
