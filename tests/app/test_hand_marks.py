"""Input from the browser is not trusted: a box must be inside its image, a mask must fit its template."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereolag.core.arrays import Box
from stereolag.ui.search.inputs import packed_mask, read_box, read_packed_mask

SHAPE = (60, 80, 3)
GOOD = {"row": 10, "col": 20, "height": 30, "width": 40}


def test_a_box_is_read() -> None:
    box = read_box(GOOD, SHAPE)
    assert box == Box(10, 20, 30, 40)
    assert np.zeros(SHAPE)[box.slices].shape == (30, 40, 3)
    assert read_box({name: float(value) for name, value in GOOD.items()}, SHAPE) == box


@pytest.mark.parametrize(
    "value",
    [
        None,
        "box",
        [1, 2, 3, 4],
        {},
        {"row": 1},
        GOOD | {"more": 1},
        *(GOOD | {"row": bad} for bad in (None, "1", 1.5, float("nan"), float("inf"), [1], -1, 31, 10**400)),
        *(GOOD | {"width": bad} for bad in (0, 3, -40, 61, 1e300)),
    ],
)
def test_anything_else_is_refused_in_one_short_sentence(value: Any) -> None:
    with pytest.raises(ValueError, match=r"\.$") as refused:
        read_box(value, SHAPE)
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 200


@given(
    value=st.fixed_dictionaries({name: st.integers(-100, 200) | st.floats() for name in GOOD}),
    shape=st.tuples(st.integers(1, 100), st.integers(1, 100)),
)
def test_a_box_that_is_taken_lies_in_its_image(value: dict[str, Any], shape: tuple[int, int]) -> None:
    try:
        box = read_box(value, shape)
    except ValueError:
        return
    assert np.zeros(shape)[box.slices].shape == (box.height, box.width)
    assert min(box.height, box.width) >= 4


@given(st.integers(1, 40), st.integers(1, 40), st.integers(0, 2**32 - 1))
def test_a_mask_comes_back_as_it_was(height: int, width: int, seed: int) -> None:
    mask = np.random.default_rng(seed).random((height, width)) < 0.5
    text = packed_mask(mask)
    if mask.sum() < 2:
        with pytest.raises(ValueError, match="at least 2 pixels"):
            read_packed_mask(text, (height, width))
        return
    again = read_packed_mask(text, (height, width))
    assert again.dtype == np.uint8
    np.testing.assert_array_equal(again, mask * 255)


@pytest.mark.parametrize(
    "value",
    [
        None,
        7,
        b"////",
        "",
        "////",
        "*" * 28,
        "é" * 28,
        "/" * 27 + "\n",
        "/" * 10_000_000,
        base64.b64encode(bytes([255]) * 21).decode(),
        base64.b64encode(bytes([255]) * 19).decode() + "====",
    ],
)
def test_another_text_is_refused(value: Any) -> None:
    with pytest.raises(ValueError, match="does not have 16 × 10 pixels"):
        read_packed_mask(value, (10, 16))  # 20 bytes, 28 characters
