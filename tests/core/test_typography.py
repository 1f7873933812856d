"""Numbers as readers see them."""

from __future__ import annotations

import pytest

from stereolag.core.typography import MINUS, NO_BREAK, typeset

SET = {
    "lag -31,234 samples": f"lag {MINUS}31,234 samples",
    "-0.5": f"{MINUS}0.5",
    "-0.00 and -0 %, -0.01": f"0.00 and 0{NO_BREAK}%, {MINUS}0.01",
    "by -12.50°": f"by {MINUS}12.50°",
    "(-3 px)": f"({MINUS}3{NO_BREAK}px)",
    "from -5 to -1 px": f"from {MINUS}5 to {MINUS}1{NO_BREAK}px",
    "**378.17 m** longer": f"**378.17{NO_BREAK}m** longer",
    "**378.17** m longer": f"**378.17**{NO_BREAK}m longer",
    "90 % of 1.136 s": f"90{NO_BREAK}% of 1.136{NO_BREAK}s",
    "12 px·m, 3 ± 1 ppm": f"12{NO_BREAK}px·m, 3 ±{NO_BREAK}1{NO_BREAK}ppm",
}


@pytest.mark.parametrize("text", SET)
def test_minus_signs_and_units(text: str) -> None:
    assert typeset(text) == SET[text]
    assert typeset(typeset(text)) == typeset(text)


@pytest.mark.parametrize(
    "text",
    [
        "Bad-2",
        "16-bit",
        "In 3-D",
        "2026-11-23",
        "`--min -5 px`",
        "50 samples",
        "5 more",
        "3 methods",
        "left-right",
        "max_lag is '-1', “-1”",
    ],
)
def test_what_is_no_negative_number_and_no_unit_stays(text: str) -> None:
    assert typeset(text) == text
