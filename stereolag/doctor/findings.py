"""The questions of the input doctor, and the limits of a healthy pair: codes and numbers, no sentences."""

from __future__ import annotations

import math
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
BENT_PX = 0.5
"""Beyond noise, of the size in which features were matched: finer is not measured."""
SAME_GREYS = 0.002
"""Mean difference of two pictures that are one, as a share of the image's range of grey levels."""
SAME_PLACE_PX = 0.35
"""How far features of one view lie apart at most, of the size in which they were matched."""
GAIN_DIFFERENCE = 0.10
OFFSET_SHARE = 0.04
"""Of the image's range of grey levels."""
FLAT_SHARE = 0.25
"""Of the pixels."""

SURE_SHARE, UNSURE_SHARE = 0.7, 0.1
"""The sides of a raw pair are told by more than this share of its features, and less than that against it."""

INFINITY_SLACK_PX = 4.0
"""Disparities no farther below 0 than this still count as infinity on a rectified pair."""


class FindingCode(StrEnum):
    """The questions that the doctor asks of a pair."""

    MATCHES = "matches"
    IDENTICAL = "identical"
    SWAPPED = "swapped"
    ROWS = "rows"
    ROTATION = "rotation"
    BENT_ROWS = "bent_rows"
    EXPOSURE = "exposure"
    TEXTURE = "texture"
    RANGE = "range"


class Remedy(StrEnum):
    """The fix of a finding: another pair of images (:func:`stereolag.doctor.apply_remedy`), or another search range."""

    SWAP_SIDES = "swap_sides"
    ALIGN_ROWS = "align_rows"
    LEVEL = "level"
    """Rotate and scale the right image until its rows match; depth becomes relative."""
    RECTIFY = "rectify"
    """Turn both images, and free them of a lens distortion where that helps, until rows match; depth becomes relative.
    It is no substitute for a calibration."""
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

        =========  =========================================================================================
        MATCHES    ``count`` of features matched between the images, ``needed`` to judge the geometry
        IDENTICAL  ``difference``: mean of the pixels' differences, as a share of the range of grey levels;
                   ``moved_px``: how far 95 % of the matched features lie apart at most, with enough of them
        SWAPPED    ``lowest_px``, ``highest_px``: 2nd and 98th percentile of the disparities of matched features, after
                   an uncalibrated rectification where rows bend; ``known``: 0 where they do not tell the sides
        ROWS       ``offset_px``, ``spread_px``: median and robust standard deviation of dy, right minus left
        ROTATION   ``rotation_deg``, ``scale`` of the right image against the left one
        BENT_ROWS  ``spread_px``: robust standard deviation of dy that offset, rotation and scale leave; ``noise_px`` of
                   the matches; ``lowest_px``, ``highest_px``: 2nd and 98th percentile of that dy; where there is a
                   remedy, ``rectified_px``: the spread after it, of matches it was not fitted to, and its ``lens``
                   coefficient, 0 where none helps
        EXPOSURE   ``gain``, ``offset`` in grey levels: ``right ≈ gain * left + offset``
        TEXTURE    ``flat_share`` of the pixels whose surroundings have hardly any texture, 0..1
        RANGE      ``lowest_px``, ``highest_px``: disparities seen; ``min_disparity``, ``num_disparities``: searched;
                   ``missing_px``: how far those seen reach beyond those searched, 0 where they do not;
                   ``suggested_min_disparity``, ``suggested_num_disparities``
        =========  =========================================================================================
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


def judge_identical(difference: float, moved: float | None, scale: float) -> Finding:
    """Judge whether both pictures show one view.

    Parameters
    ----------
    difference
        Mean difference of their pixels, as a share of the range of grey levels.
    moved
        How far nearly all features lie apart at most, px; None with too few of them.
    scale
        At which the features were matched.
    """
    same = difference < SAME_GREYS or (moved is not None and moved * scale < SAME_PLACE_PX)
    numbers = {} if moved is None else {"moved_px": moved}
    return _found(FindingCode.IDENTICAL, same, None, difference=difference, **numbers)


def judge_sides(lowest: float, highest: float) -> Finding:
    """Judge whether left is left on a rectified pair, by the ends of the disparities, px."""
    swapped = highest <= 0 or (lowest < 0 and -lowest > 4 * max(highest, 1.0))
    return _found(FindingCode.SWAPPED, swapped, Remedy.SWAP_SIDES, lowest_px=lowest, highest_px=highest, known=1)


def judge_raw_sides(lowest: float, highest: float, in_front: float, behind: float) -> Finding:
    """Judge whether left is left on a pair that is not rectified.

    Parameters
    ----------
    lowest, highest
        Ends of the disparities after an uncalibrated rectification, px.
    in_front, behind
        Shares of the features whose disparity is surely above 0, and surely below, as it is with swapped sides.
    """
    swapped, known = behind > in_front, max(in_front, behind) > SURE_SHARE > UNSURE_SHARE > min(in_front, behind)
    numbers = {"lowest_px": lowest, "highest_px": highest, "known": float(known)}
    return _found(FindingCode.SWAPPED, swapped and known, Remedy.SWAP_SIDES, **numbers)


def judge_rows(offset: float, spread: float, remedy: Remedy | None = Remedy.ALIGN_ROWS) -> Finding:
    """Judge the median and the spread of dy, px."""
    misaligned = abs(offset) > ROW_OFFSET_PX
    return _found(FindingCode.ROWS, misaligned, remedy, offset_px=offset, spread_px=spread)


def judge_rotation(degrees: float, scale: float, remedy: Remedy | None = Remedy.LEVEL) -> Finding:
    """Judge the rotation, degrees, and the scale of the right image against the left one."""
    unrectified = abs(degrees) > ROTATION_DEG or abs(scale - 1) > SCALE_DIFFERENCE
    return _found(FindingCode.ROTATION, unrectified, remedy, rotation_deg=degrees, scale=scale)


def judge_bent_rows(
    spread: float, noise: float, ends: tuple[float, float], scale: float, rectified: tuple[float, float] | None
) -> Finding:
    """Judge what offset, rotation and scale leave of dy.

    Parameters
    ----------
    spread, noise
        Robust standard deviation of it, and what noise has in it, px.
    ends
        Lowest and highest of it, but for a few, px.
    scale
        At which features were matched.
    rectified
        The spread after an uncalibrated rectification, px, and its lens coefficient; None where none helps.
    """
    bent = math.sqrt(max(spread**2 - noise**2, 0.0)) * scale > BENT_PX
    numbers = {"spread_px": spread, "noise_px": noise, "lowest_px": ends[0], "highest_px": ends[1]}
    if rectified is None:
        return _found(FindingCode.BENT_ROWS, bent, None, **numbers)
    numbers |= {"rectified_px": rectified[0], "lens": rectified[1]}
    return _found(FindingCode.BENT_ROWS, bent, Remedy.RECTIFY, **numbers)


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
