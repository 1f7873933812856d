"""Whatever the bytes, a reader returns its result or raises a ValueError of one line, without a warning."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from hostile_files import valid_files
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from stereolag.io.calibrations import read_calibration
from stereolag.io.disparities import read_disparity
from stereolag.io.images import read_image
from stereolag.io.recordings import read_signal
from stereolag.io.settings import read_matcher

VALID = valid_files()


@st.composite
def mutated(draw: st.DrawFn, originals: list[bytes]) -> bytes:
    """Draw a valid file with some bytes replaced, removed, inserted or cut off."""
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
    pytest.param(read_image, VALID["image"], id="image"),
    pytest.param(read_signal, VALID["signal"], id="signal"),
    pytest.param(read_disparity, VALID["disparity"], id="disparity"),
    pytest.param(lambda data: read_disparity(data, divisor=4), VALID["disparity"], id="disparity with divisor"),
    pytest.param(read_calibration, VALID["calibration"], id="calibration"),
    pytest.param(read_matcher, VALID["matcher"], id="matcher"),
]


@pytest.mark.parametrize(("read", "originals"), CASES)
def test_the_originals_are_valid(read, originals):
    for data in originals:
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
