"""A few damaged lines of a text are mended and counted; more are refused, and the line is named."""

from __future__ import annotations

import numpy as np
import pytest

from stereolag.io.recordings import read_signal

VALUES = np.random.default_rng(0).normal(size=(600, 2)).round(6)


def lines(columns: int = 1, separator: str = ";") -> list[str]:
    return [separator.join(map(repr, row)) for row in VALUES[:, :columns].tolist()]


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_nul_bytes_behind_a_number_go_and_are_counted(newline: str) -> None:
    text = lines()
    for number in (3, 99, 599):
        text[number] += "\0\0"
    recording = read_signal(newline.join(text).encode())
    assert recording.mended_lines == 3
    np.testing.assert_array_equal(recording.channels, VALUES[:, :1].T)


@pytest.mark.parametrize("separator", [";", ",", "\t"])
@pytest.mark.parametrize("column", [0, 1])
def test_an_empty_field_lies_between_its_neighbours(separator: str, column: int) -> None:
    text = lines(2, separator)
    kept = text[50].split(separator)
    kept[column] = " "
    text[50] = separator.join(kept)
    recording = read_signal(("a header\n" + "\n".join(text)).encode())
    expected = VALUES.T.copy()
    expected[column, 50] = (expected[column, 49] + expected[column, 51]) / 2
    assert recording.mended_lines == 1
    np.testing.assert_allclose(recording.channels, expected, atol=1e-12)


def test_two_in_a_row_and_the_last_are_filled_too() -> None:
    text = lines(2)
    for number in (20, 21, 599):
        text[number] = text[number].split(";")[0] + ";"
    recording = read_signal("\n".join(text).encode())
    before, after = VALUES[19, 1], VALUES[22, 1]
    np.testing.assert_allclose(recording.channels[1, 20:22], before + (after - before) * np.array([1, 2]) / 3)
    assert recording.channels[1, 599] == VALUES[598, 1]
    assert recording.mended_lines == 3


def test_sound_text_is_not_mended() -> None:
    assert read_signal("\n".join(lines(2)).encode()).mended_lines == 0


@pytest.mark.parametrize("damage", ["nul", "field", "both"])
def test_more_are_refused(damage: str) -> None:
    text = lines(2)
    for number in range(30, 36):
        nul = damage == "nul" or (damage == "both" and number % 2)
        text[number] = text[number] + "\0" if nul else text[number].split(";")[0] + ";"
    line = 31 if damage != "both" else r"\d+"
    with pytest.raises(ValueError, match=f"Line {line} (holds a NUL byte|lacks a number); allowed are"):
        read_signal("\n".join(text).encode())


@pytest.mark.parametrize(
    ("damaged", "message"),
    [
        ("1.5\0002;3", "Line 11 holds a NUL byte"),
        ("\0", "Line 11 holds a NUL byte"),
        ("1.5;x", "Line 11 holds “x”"),
        ("1.5;nan", "Line 11 holds nan"),
        ("1.5", "Line 11 holds 1 numbers and the lines before it 2"),
        (";", "Line 11 lacks a number"),
    ],
)
def test_what_is_not_small_damage_is_refused(damaged: str, message: str) -> None:
    text = lines(2)
    text[10] = damaged
    with pytest.raises(ValueError, match=message):
        read_signal("\n".join(text).encode())


def test_a_word_beside_an_empty_field_is_still_named() -> None:
    text = lines(2)
    text[10], text[12] = "1.5;", "1.5;x"
    with pytest.raises(ValueError, match=r"Line 13 holds “x”"):
        read_signal("\n".join(text).encode())


def test_of_few_lines_none_is_mended() -> None:
    with pytest.raises(ValueError, match="Line 2 lacks a number"):
        read_signal(b"1;2\n3;\n5;6\n")
