"""What the input doctor looks for in a stereo pair, where the limits lie, and how it says so."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

FEWEST_MATCHES = 25
"""Below this the geometry of a pair is not judged."""

ROW_OFFSET_PX = 0.75
ROTATION_DEG = 0.15
SCALE_DIFFERENCE = 0.004
GAIN_DIFFERENCE = 0.10
OFFSET_SHARE = 0.04
FLAT_SHARE = 0.25
"""Limits beyond which a finding turns amber; OFFSET_SHARE is of the range of greys, FLAT_SHARE of the picture."""

INFINITY_SLACK_PX = 4.0
"""Disparities as little below 0 as this are still infinity on a rectified pair."""


class Ailment(StrEnum):
    """What the doctor looks for."""

    MATCHES = "matches"
    SWAPPED = "swapped"
    ROWS = "rows"
    ROTATION = "rotation"
    EXPOSURE = "exposure"
    TEXTURE = "texture"
    RANGE = "range"


@dataclass(frozen=True)
class Finding:
    """One thing the doctor looked at.

    Attributes
    ----------
    ailment
        What it is about.
    healthy
        Whether there is nothing to mend.
    sentence
        What was found, with its number.
    remedy
        What a click would do, or "" where nothing can be done.
    """

    ailment: Ailment
    healthy: bool
    sentence: str
    remedy: str = ""


def about_matches(count: int) -> Finding:
    """Judge how many features were found in both pictures."""
    if count >= FEWEST_MATCHES:
        return Finding(Ailment.MATCHES, True, f"{count} features are found in both pictures.")
    return Finding(
        Ailment.MATCHES,
        False,
        f"Only {count} features are found in both pictures, too few to judge how they lie: "
        "are they two views of one scene?",
    )


def about_sides(low: float, high: float) -> Finding:
    """Judge whether left is left, by the ends of the disparities, px."""
    if high <= 0 or (low < 0 and -low > 4 * max(high, 1.0)):
        return Finding(
            Ailment.SWAPPED,
            False,
            f"Left and right look swapped: disparities run from {low:.0f} to {high:.0f} px and should be positive.",
            "Swap left and right",
        )
    return Finding(Ailment.SWAPPED, True, f"Left is left: disparities run from {low:.0f} to {high:.0f} px.")


def about_rows(offset: float, spread: float) -> Finding:
    """Judge the median and the spread of dy, px."""
    side = "lower" if offset > 0 else "higher"
    if abs(offset) > ROW_OFFSET_PX:
        said = f"Rows of the right picture lie {abs(offset):.1f} px {side} (spread {spread:.1f} px)"
        return Finding(Ailment.ROWS, False, f"{said}: rows of a rectified pair match.", "Align the rows")
    return Finding(Ailment.ROWS, True, f"Rows match: {abs(offset):.1f} px off (spread {spread:.1f} px).")


def about_rotation(degrees: float, growth: float) -> Finding:
    """Judge how the right view is turned, degrees, and by which share it has grown."""
    said = f"The right view is turned by {degrees:+.2f}° and scaled by {100 * growth:+.1f} %"
    if abs(degrees) > ROTATION_DEG or abs(growth) > SCALE_DIFFERENCE:
        return Finding(
            Ailment.ROTATION,
            False,
            f"{said}: the pair is not rectified.",
            "Rectify from the pictures themselves (depth becomes relative)",
        )
    return Finding(Ailment.ROTATION, True, f"{said}: straight enough.")


def about_range(
    low: float, high: float, min_disparity: int, num_disparities: int, suggested_min: int, suggested_num: int
) -> Finding:
    """Judge the range searched against the disparities seen, px, and suggest another."""
    last = min_disparity + num_disparities - 1
    needs = f"{low:.0f} px" if round(low) == round(high) else f"{low:.0f} to {high:.0f} px"
    said = f"The pair needs about {needs} and {min_disparity} to {last} px are searched"
    remedy = f"Search {suggested_num} disparities from {suggested_min}"
    if low < min_disparity - INFINITY_SLACK_PX or high > last + 1:
        return Finding(Ailment.RANGE, False, f"{said}: too small a range.", remedy)
    if num_disparities >= 2 * suggested_num:
        return Finding(Ailment.RANGE, False, f"{said}: far more than needed.", remedy)
    return Finding(Ailment.RANGE, True, f"{said}: a good range.")


def about_exposure(gain: float, offset: float, range_of_greys: float) -> Finding:
    """Judge ``right = gain * left + offset`` against the picture's range of greys."""
    said = f"The right picture is {gain:.2f} × as contrasty and {offset:+.0f} levels brighter"
    if abs(gain - 1) > GAIN_DIFFERENCE or abs(offset) > OFFSET_SHARE * range_of_greys:
        return Finding(
            Ailment.EXPOSURE,
            False,
            f"{said}: ZNCC does not mind, StereoBM and plain correlation do.",
            "Match the brightness",
        )
    return Finding(Ailment.EXPOSURE, True, f"{said}: exposed alike.")


def about_texture(flat: float) -> Finding:
    """Judge the share of the picture without texture."""
    said = f"{100 * flat:.0f} % of the picture has hardly any texture"
    if flat > FLAT_SHARE:
        return Finding(Ailment.TEXTURE, False, f"{said}: no window can be matched there; larger windows help a little.")
    return Finding(Ailment.TEXTURE, True, f"{said}.")
