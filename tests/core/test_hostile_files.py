"""Hostile files through the guard: each is read or refused in one sentence, at no cost to the server."""

import random
import re
from collections.abc import Iterator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.hostile import measured, mutated
from benchmarks.hostile_files import READERS, hostile_files, valid_files
from stereolag.core.jobs import limits, set_defaults
from stereolag.io.guard import guarded
from stereolag.io.recordings import read_signal

FILES = hostile_files()
LONG = re.compile("49 megapixels|40 megapixels|MB|million|[0-9],000|minutes|text, |in a row|overlapping|a short line")
LARGE = [
    "PNG, 16-bit colour, IDAT claims 2 GB",
    "PNG, packed comment of 64 MB",
    "PNG, 1 pixel and 64 MB behind it",
    "PNG, EXIF of overlapping tags",
    "PNG, comment of 60 MB",
    "JPEG, comments of 60 MB",
    "JPEG, 30 million restarts",
    "TIFF, 20,000 overlapping tags of 1 MB",
    "TIFF, tile of 30,000 a side",
    "WEBP, profile of 60 MB",
    "PGM, 60 MB of spaces",
    "recording: text, a short line and one of 60 MB",
    "recording: FLAC, header claims 30 million of 100",
    "recording: WAV, 30 million samples",
    "map: PFM, 60 MB of spaces",
    "calibration: YAML, ten by ten aliases",
    "calibration: XML, ten by ten entities",
    "calibration: NPZ, an array of 64 MB that claims 200 bytes",
]
SMALL = [name for name in FILES if not LONG.search(name) and name not in LARGE]
VALID = valid_files()


@pytest.fixture(autouse=True, scope="module")
def _as_on_a_server() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("stereolag.core.jobs._defaults", {})
        set_defaults(max_megasamples=30)
        yield
    limits.cache_clear()


@pytest.mark.parametrize("name", LARGE + SMALL)
def test_a_hostile_file_is_read_or_refused_at_no_cost_to_the_server(name: str) -> None:
    file = FILES[name]
    reading = measured(name, file.reader, file.make(), file.answer)
    assert not reading.fault, reading
    assert len(reading.answer) < 250


def survives(reader: str, data: bytes) -> None:
    try:
        guarded(READERS[reader])(data)
    except ValueError as error:
        assert str(error).strip()
        assert "\n" not in str(error)


KINDS = {name: name for name in ("image", "signal", "disparity", "calibration", "matcher")}
KINDS |= {"disparity ÷ 4": "disparity"}
CASES = pytest.mark.parametrize(("reader", "kind"), KINDS.items(), ids=KINDS)

WRITTEN = "0123456789.,;:+-eE \t\r\n\"'{}[]()<>#%&*!/abcfgnopxyµ\0"
"""What settings, calibrations and columns are made of. All of Unicode would take seconds to list."""


@CASES
def test_the_originals_are_valid(reader: str, kind: str) -> None:
    for data in VALID[kind]:
        READERS[reader](data)


@CASES
@given(seed=st.integers(0, 2**32 - 1))
def test_mutated_files(reader: str, kind: str, seed: int) -> None:
    chance = random.Random(seed)
    survives(reader, mutated(chance.choice(VALID[kind]), chance))


@CASES
@settings(max_examples=25)
@given(data=st.one_of(st.binary(max_size=200), st.text(WRITTEN, max_size=100).map(str.encode)))
def test_random_bytes(reader: str, kind: str, data: bytes) -> None:
    survives(reader, data)
    survives(reader, VALID[kind][0][:8] + data)


def test_whoever_runs_it_sets_the_limit_of_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stereolag.core.jobs._defaults", {})
    set_defaults(max_megasamples=1)
    for data in (b"1\n" * 1_000_001, FILES["recording: FLAC, header claims 30 million of 100"].make()):
        with pytest.raises(ValueError, match="at most 1,000,000 in total"):
            read_signal(data)
    set_defaults(max_megasamples=30)
