"""The questions of the input doctor and the limits of a healthy pair, as codes and numbers rather than sentences."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from types import MappingProxyType
from typing import Any

FEWEST_MATCHES = 25
"""Fewest matched features for which the geometry of a pair is judged."""

ROW_OFFSET_PX = 0.75
ROTATION_DEG = 0.15
SCALE_DIFFERENCE = 0.004
BENT_PX = 0.5
"""Beyond noise, at the size at which features were matched, which limits the precision."""
SAME_GREYS = 0.002
"""Mean difference up to which two pictures count as identical, as a share of the image's grey-level range."""
SAME_PLACE_PX = 0.35
"""Largest displacement of features between identical views, at the size at which they were matched."""
GAIN_DIFFERENCE = 0.10
OFFSET_SHARE = 0.04
"""Share of the image's grey-level range."""
FLAT_SHARE = 0.25
"""Share of the pixels."""

SURE_SHARE, UNSURE_SHARE = 0.7, 0.1
"""The sides of a raw pair are known if more than the first share of its features agree and less than the second
disagree."""

INFINITY_SLACK_PX = 4.0
"""Disparities no more than this below 0 still count as infinity on a rectified pair."""


class FindingCode(StrEnum):
    """The questions that the input doctor asks about a pair."""

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
    """The fix for a finding: a corrected pair (:func:`.apply_remedy`), or another search range."""

    SWAP_SIDES = "swap_sides"
    ALIGN_ROWS = "align_rows"
    LEVEL = "level"
    """Rotate and scale the right image until its rows match; depth becomes relative."""
    RECTIFY = "rectify"
    """Rotate both views, and undo a lens distortion if that helps, until rows match; depth becomes relative.
    This is no substitute for a calibration."""
    MATCH_EXPOSURE = "match_exposure"
    SET_RANGE = "set_range"
    """Search the range that the finding suggests: changes the settings, not the images."""


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
        IDENTICAL  ``difference``: mean pixel difference, as a share of the grey-level range;
                   ``moved_px``: 95th percentile of the displacement of matched features, if there are enough
        SWAPPED    ``lowest_px``, ``highest_px``: 2nd and 98th percentile of the disparities of matched features, after
                   an uncalibrated rectification if rows bend; ``known``: 0 if they do not determine the sides
        ROWS       ``offset_px``, ``spread_px``: median and robust standard deviation of dy, right minus left
        ROTATION   ``rotation_deg``, ``scale`` of the right image relative to the left one
        BENT_ROWS  ``spread_px``: robust standard deviation of dy after removing offset, rotation and scale;
                   ``noise_px`` of the matches; ``lowest_px``, ``highest_px``: 2nd and 98th percentile of that dy; if
                   there is a remedy, ``rectified_px``: the spread after it, for matches it was not fitted to, and its
                   ``lens`` coefficient, 0 if none helps
        EXPOSURE   ``gain``, ``offset`` in grey levels: ``right ≈ gain * left + offset``
        TEXTURE    ``flat_share`` of the pixels whose surroundings have hardly any texture, 0..1
        RANGE      ``lowest_px``, ``highest_px``: disparities seen; ``min_disparity``, ``num_disparities``: searched;
                   ``missing_px``: how far the disparities seen extend beyond those searched, 0 if they do not;
                   ``suggested_min_disparity``, ``suggested_num_disparities``
        =========  =========================================================================================
    remedy
        The fix; None if there is nothing to fix, or no fix.
    """

    code: FindingCode
    healthy: bool
    numbers: Mapping[str, float] = field(hash=False)
    remedy: Remedy | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "numbers", MappingProxyType(dict(self.numbers)))

    def __reduce__(self) -> tuple[Any, ...]:
        # A mapping proxy cannot be pickled, and pairs may be diagnosed in other processes.
        return type(self), (self.code, self.healthy, dict(self.numbers), self.remedy)


def judge_matches(count: int) -> Finding:
    """Judge the number of features matched between the images."""
    return Finding(FindingCode.MATCHES, count >= FEWEST_MATCHES, {"count": count, "needed": FEWEST_MATCHES})


def judge_identical(difference: float, moved: float | None, scale: float) -> Finding:
    """Judge whether both pictures show one view.

    Parameters
    ----------
    difference
        Mean pixel difference, as a share of the grey-level range.
    moved
        Largest displacement of nearly all features, px; None with too few of them.
    scale
        Scale at which the features were matched.
    """
    same = difference < SAME_GREYS or (moved is not None and moved * scale < SAME_PLACE_PX)
    numbers = {} if moved is None else {"moved_px": moved}
    return _found(FindingCode.IDENTICAL, same, None, difference=difference, **numbers)


def judge_sides(lowest: float, highest: float) -> Finding:
    """Judge whether the sides of a rectified pair are swapped, from the ends of its disparity range, px."""
    swapped = highest <= 0 or (lowest < 0 and -lowest > 4 * max(highest, 1.0))
    return _found(FindingCode.SWAPPED, swapped, Remedy.SWAP_SIDES, lowest_px=lowest, highest_px=highest, known=1)


def judge_raw_sides(lowest: float, highest: float, in_front: float, behind: float) -> Finding:
    """Judge whether the sides of an unrectified pair are swapped.

    Parameters
    ----------
    lowest, highest
        Ends of the disparity range after an uncalibrated rectification, px.
    in_front, behind
        Shares of the features whose disparity is certainly above 0, and certainly below 0, as with swapped sides.
    """
    swapped, known = behind > in_front, max(in_front, behind) > SURE_SHARE > UNSURE_SHARE > min(in_front, behind)
    numbers = {"lowest_px": lowest, "highest_px": highest, "known": float(known)}
    return _found(FindingCode.SWAPPED, swapped and known, Remedy.SWAP_SIDES, **numbers)


def judge_rows(offset: float, spread: float, remedy: Remedy | None = Remedy.ALIGN_ROWS) -> Finding:
    """Judge the median and the spread of dy, px."""
    misaligned = abs(offset) > ROW_OFFSET_PX
    return _found(FindingCode.ROWS, misaligned, remedy, offset_px=offset, spread_px=spread)


def judge_rotation(degrees: float, scale: float, remedy: Remedy | None = Remedy.LEVEL) -> Finding:
    """Judge the rotation, degrees, and the scale of the right image relative to the left one."""
    unrectified = abs(degrees) > ROTATION_DEG or abs(scale - 1) > SCALE_DIFFERENCE
    return _found(FindingCode.ROTATION, unrectified, remedy, rotation_deg=degrees, scale=scale)


def judge_bent_rows(
    spread: float, noise: float, ends: tuple[float, float], scale: float, rectified: tuple[float, float] | None
) -> Finding:
    """Judge the dy that remains after removing offset, rotation and scale.

    Parameters
    ----------
    spread, noise
        Its robust standard deviation, and the contribution of noise, px.
    ends
        Its lowest and highest values without a few outliers, px.
    scale
        Scale at which the features were matched.
    rectified
        The spread after an uncalibrated rectification, px, and its lens coefficient; None if none helps.
    """
    bent = math.sqrt(max(spread**2 - noise**2, 0.0)) * scale > BENT_PX
    numbers = {"spread_px": spread, "noise_px": noise, "lowest_px": ends[0], "highest_px": ends[1]}
    if rectified is None:
        return _found(FindingCode.BENT_ROWS, bent, None, **numbers)
    numbers |= {"rectified_px": rectified[0], "lens": rectified[1]}
    return _found(FindingCode.BENT_ROWS, bent, Remedy.RECTIFY, **numbers)


def judge_exposure(gain: float, offset: float, range_of_greys: float) -> Finding:
    """Judge ``right ≈ gain * left + offset`` relative to the image's grey-level range."""
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
        First disparity, px, and number of disparities.
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
