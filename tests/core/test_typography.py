"""Numbers as readers see them."""

import pytest

from stereolag.core.typography import MINUS, NO_BREAK, four_digits, typeset

SET = {
    "lag -31,234 samples": f"lag {MINUS}31,234 samples",
    "-0.00 and -0 %, -0.01": f"0.00 and 0{NO_BREAK}%, {MINUS}0.01",
    "by -12.50°": f"by {MINUS}12.50°",
    "(-3 px)": f"({MINUS}3{NO_BREAK}px)",
    "from -5 to -1 px": f"from {MINUS}5 to {MINUS}1{NO_BREAK}px",
    "**378.17 m** longer": f"**378.17{NO_BREAK}m** longer",
    "**378.17** m longer": f"**378.17**{NO_BREAK}m longer",
    "12 px·m, 3 ± 1 ppm": f"12{NO_BREAK}px·m, 3 ±{NO_BREAK}1{NO_BREAK}ppm",
}
UNCHANGED = [
    "Bad-2",
    "16-bit",
    "In 3-D",
    "2026-11-23",
    "`--min -5 px`",
    "50 samples",
    "5 more",
    "max_lag is '-1', “-1”",
]


@pytest.mark.parametrize(("text", "expected"), [*SET.items(), *zip(UNCHANGED, UNCHANGED, strict=True)])
def test_minus_signs_and_units_are_set_and_all_else_stays(text: str, expected: str) -> None:
    assert typeset(text) == typeset(expected) == expected


def test_large_numbers_are_no_powers_of_ten() -> None:
    numbers = (0, 0.00113412, 1.13568, 9999.4, 30_000, 1.728e8)
    assert list(map(four_digits, numbers)) == ["0", "0.001134", "1.136", "9,999", "30,000", "172,800,000"]
