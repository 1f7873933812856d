"""The questions of the input doctor, and the limits of a healthy pair: codes and numbers, no sentences."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from types import MappingProxyType
from typing import Any

FEWEST_MATCHES = 25
"""With fewer matched features the geometry of a pair is not judged."""

ROW_OFFSET_PX = 0.75
ROTATION_DEG = 0.15
SCALE_DIFFERENCE = 0.004
GAIN_DIFFERENCE = 0.10
OFFSET_SHARE = 0.04
"""Of the image's range of grey levels."""
FLAT_SHARE = 0.25
"""Of the pixels."""

INFINITY_SLACK_PX = 4.0
"""Disparities no farther below 0 than this still count as infinity on a rectified pair."""


class FindingCode(StrEnum):
    """The questions that the doctor asks of a pair."""

    MATCHES = "matches"
    SWAPPED = "swapped"
    ROWS = "rows"
    ROTATION = "rotation"
    EXPOSURE = "exposure"
    TEXTURE = "texture"
    RANGE = "range"


class Remedy(StrEnum):
    """The fix of a finding: another pair of images (:func:`stereolag.doctor.apply_remedy`), or another search range."""

    SWAP_SIDES = "swap_sides"
    ALIGN_ROWS = "align_rows"
    LEVEL = "level"
    """Rotate and scale the right image until its rows match; depth becomes relative."""
    MATCH_EXPOSURE = "match_exposure"
    SET_RANGE = "set_range"
    """Search the range that the finding suggests: settings change, not the images."""


@dataclass(frozen=True)
class Finding:
    """The answer to one question about a pair.

    Attributes
    ----------
    code
        The question.
    healthy
        Whether the pair is within the limits.
    numbers
        The measurements, by name, read-only:

        ========  ==========================================================================================
        MATCHES   ``count`` of features matched between the images, ``needed`` to judge the geometry
        SWAPPED   ``lowest_px``, ``highest_px``: 1st and 99th percentile of the disparities of matched features
        ROWS      ``offset_px``, ``spread_px``: median and robust standard deviation of dy, right minus left
        ROTATION  ``rotation_deg``, ``scale`` of the right image against the left one
        EXPOSURE  ``gain``, ``offset`` in grey levels: ``right ≈ gain * left + offset``
        TEXTURE   ``flat_share`` of the pixels whose surroundings have hardly any texture, 0..1
        RANGE     ``lowest_px``, ``highest_px``: disparities seen; ``min_disparity``, ``num_disparities``: searched;
                  ``missing_px``: how far those seen reach beyond those searched, 0 where they do not;
                  ``suggested_min_disparity``, ``suggested_num_disparities``
        ========  ==========================================================================================
    remedy
        The fix; None where there is nothing to fix, or no fix.
    """

    code: FindingCode
    healthy: bool
    numbers: Mapping[str, float] = field(hash=False)
    remedy: Remedy | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "numbers", MappingProxyType(dict(self.numbers)))

    def __reduce__(self) -> tuple[Any, ...]:
        # A mapping proxy cannot be pickled; pairs may be diagnosed in other processes.
        return type(self), (self.code, self.healthy, dict(self.numbers), self.remedy)


def judge_matches(count: int) -> Finding:
    """Judge how many features were matched between the images."""
    return Finding(FindingCode.MATCHES, count >= FEWEST_MATCHES, {"count": count, "needed": FEWEST_MATCHES})


def judge_sides(lowest: float, highest: float) -> Finding:
    """Judge whether left is left, by the ends of the disparities, px."""
    swapped = highest <= 0 or (lowest < 0 and -lowest > 4 * max(highest, 1.0))
    return _found(FindingCode.SWAPPED, swapped, Remedy.SWAP_SIDES, lowest_px=lowest, highest_px=highest)


def judge_rows(offset: float, spread: float) -> Finding:
    """Judge the median and the spread of dy, px."""
    misaligned = abs(offset) > ROW_OFFSET_PX
    return _found(FindingCode.ROWS, misaligned, Remedy.ALIGN_ROWS, offset_px=offset, spread_px=spread)


def judge_rotation(degrees: float, scale: float) -> Finding:
    """Judge the rotation, degrees, and the scale of the right image against the left one."""
    unrectified = abs(degrees) > ROTATION_DEG or abs(scale - 1) > SCALE_DIFFERENCE
    return _found(FindingCode.ROTATION, unrectified, Remedy.LEVEL, rotation_deg=degrees, scale=scale)


def judge_exposure(gain: float, offset: float, range_of_greys: float) -> Finding:
    """Judge ``right ≈ gain * left + offset`` against the image's range of grey levels."""
    unlike = abs(gain - 1) > GAIN_DIFFERENCE or abs(offset) > OFFSET_SHARE * range_of_greys
    return _found(FindingCode.EXPOSURE, unlike, Remedy.MATCH_EXPOSURE, gain=gain, offset=offset)


def judge_texture(flat_share: float) -> Finding:
    """Judge the share of the pixels without texture."""
    return _found(FindingCode.TEXTURE, flat_share > FLAT_SHARE, None, flat_share=flat_share)


def judge_searched(seen: tuple[float, float], searched: tuple[int, int], suggested: tuple[int, int]) -> Finding:
    """Judge a search range.

    Parameters
    ----------
    seen
        Lowest and highest disparity in the pair, px.
    searched, suggested
        First disparity, px, and how many.
    """
    (lowest, highest), (first, count) = seen, searched
    missing = max(0.0, first - INFINITY_SLACK_PX - lowest, highest - (first + count))
    return _found(
        FindingCode.RANGE,
        missing > 0 or count >= 2 * suggested[1],
        Remedy.SET_RANGE,
        lowest_px=lowest,
        highest_px=highest,
        min_disparity=first,
        num_disparities=count,
        missing_px=missing,
        suggested_min_disparity=suggested[0],
        suggested_num_disparities=suggested[1],
    )


def _found(code: FindingCode, ill: bool, remedy: Remedy | None, **numbers: float) -> Finding:
    return Finding(code, not ill, numbers, remedy if ill else None)
