"""The findings of the input doctor, as codes and numbers: the limits of the healthy ones, and the remedies."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from types import MappingProxyType
from typing import Any

from stereolag.assess.features import MIN_MATCHES
from stereolag.assess.layout import Epipole, Layout
from stereolag.assess.orientation import MAX_HEALTHY_LENS

MAX_BEND_PX = 0.6
"""Largest healthy spread of bent rows beyond noise, px at the size at which features were matched, which limits the
precision. Public drives, rectified by their makers, bend by up to 0.57 px."""

MAX_IDENTICAL_DIFFERENCE = 0.002
"""Mean difference between identical pictures, as a share of the image's grey-level range."""

MAX_IDENTICAL_SHIFT_PX = 0.35
"""Displacement of features between identical views, px at the size at which they were matched."""

MAX_GAIN_DIFFERENCE = 0.10
"""Largest healthy difference in contrast."""

MAX_BRIGHTNESS_DIFFERENCE = 0.04
"""Largest healthy difference in brightness, as a share of the image's grey-level range."""

MIN_SIDES_SHARE = 0.7
"""The sides of a raw pair are known if more than this share of its features agree ..."""

MAX_OPPOSING_SHARE = 0.1
"""... and less than this share disagree."""


class FindingCode(StrEnum):
    """The questions that the input doctor asks about a pair."""

    MATCHES = "matches"
    IDENTICAL = "identical"
    LAYOUT = "layout"
    MIRRORED = "mirrored"
    ABOVE_EACH_OTHER = "above_each_other"
    ONE_MOVING_CAMERA = "one_moving_camera"
    NOT_SAME_MOMENT = "not_same_moment"
    SWAPPED = "swapped"
    ROWS = "rows"
    ROTATION = "rotation"
    BENT_ROWS = "bent_rows"
    EXPOSURE = "exposure"
    TEXTURE = "texture"
    EMPTY_BORDER = "empty_border"
    RANGE = "range"


class Remedy(StrEnum):
    """The fix for a finding: a corrected pair (:func:`apply_remedy`), or another search range."""

    MIRROR_RIGHT = "mirror_right"
    TURN_UPRIGHT = "turn_upright"
    """Turn both images by a quarter, so that cameras above each other stand side by side."""
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
        LAYOUT     if the left image holds both views, ``beside``: 1 if one is beside the other, 0 if one is above the
                   other; ``half``: 1 if they are squeezed
        MIRRORED   ``count`` of features that agree with the right image once it is mirrored, 0 if not tried
        ABOVE_EACH_OTHER, ONE_MOVING_CAMERA, NOT_SAME_MOMENT
                   ``quarters`` of a turn that bring the cameras side by side, counter-clockwise; ``x``, ``y`` of the
                   epipole, if it is near, in widths and heights of the left image; ``turned_deg``: angle of one camera
                   that only turned; ``moved`` features of things that moved up or down, if there are enough
        SWAPPED    ``lowest_px``, ``highest_px``: 2nd and 98th percentile of the disparities of matched features, after
                   an uncalibrated rectification if rows bend; ``known``: 0 if they do not determine the sides
        ROWS       ``offset_px``: median of dy, right minus left, or dy at the centre of a rotated or scaled image;
                   ``spread_px``: robust standard deviation of dy
        ROTATION   ``rotation_deg``, ``scale`` of the right image relative to the left one
        BENT_ROWS  ``spread_px``: robust standard deviation of dy after removing offset, rotation and scale;
                   ``noise_px`` of the matches; ``lowest_px``, ``highest_px``: 2nd and 98th percentile of that dy; if
                   there is a remedy, ``rectified_px``: the spread after it, for matches it was not fitted to, and its
                   ``lens`` coefficient, 0 if none helps
        EXPOSURE   ``gain``, ``offset`` in grey levels: ``right ≈ gain * left + offset``
        TEXTURE    ``flat_share`` of the pixels, without the sky, whose surroundings have hardly any texture, 0..1
        EMPTY_BORDER
                   ``left_share``, ``right_share``: share of the pixels of each image in black borders, 0..1
        RANGE      ``lowest_px``, ``highest_px``: disparities in the pair; ``min_disparity``, ``num_disparities``:
                   searched; ``missing_px``: largest distance of the former beyond the latter, 0 if none are missing;
                   ``suggested_min_disparity``, ``suggested_num_disparities``; ``repeats_px``: distance at which the
                   picture repeats along its rows, 0 if it does not
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


HEALTHY_NUMBERS: Mapping[FindingCode, Mapping[str, tuple[float, float]]] = {
    FindingCode.MIRRORED: {"count": (0, 0)},
    FindingCode.ABOVE_EACH_OTHER: {"quarters": (0, 0)},
    FindingCode.ROWS: {"offset_px": (0, 0.75)},
    FindingCode.ROTATION: {"rotation_deg": (0, 0.15), "scale": (1, 0.006)},
    FindingCode.TEXTURE: {"flat_share": (0, 0.4)},
    FindingCode.EMPTY_BORDER: {"left_share": (0, 0.01), "right_share": (0, 0.01)},
}
"""For questions whose numbers are judged one by one: the ideal value of each, and its largest healthy deviation."""


def judge(code: FindingCode, remedy: Remedy | None = None, **numbers: float) -> Finding:
    """Judge the numbers of a question of :data:`HEALTHY_NUMBERS`; with this remedy if it is ill."""
    ill = any(abs(numbers[name] - ideal) > tolerance for name, (ideal, tolerance) in HEALTHY_NUMBERS[code].items())
    return judged(code, ill, remedy, **numbers)


def judge_matches(count: int) -> Finding:
    """Judge the number of features matched between the images."""
    return Finding(FindingCode.MATCHES, count >= MIN_MATCHES, {"count": count, "needed": MIN_MATCHES})


def judge_identical(difference: float, moved: float | None, scale: float) -> Finding:
    """Judge whether both pictures show one view.

    Parameters
    ----------
    difference
        Mean difference, as a share of the grey-level range.
    moved
        Largest displacement of nearly all features, px; None with too few of them.
    scale
        Scale at which they were matched.
    """
    same = difference < MAX_IDENTICAL_DIFFERENCE or (moved is not None and moved * scale < MAX_IDENTICAL_SHIFT_PX)
    numbers = {} if moved is None else {"moved_px": moved}
    return judged(FindingCode.IDENTICAL, same, None, difference=difference, **numbers)


def judge_layout(layout: Layout | None) -> Finding:
    """Judge the layout of both views in the left image; None if it holds one view."""
    numbers = {} if layout is None else {part: float(part in layout.value) for part in ("beside", "half")}
    return judged(FindingCode.LAYOUT, layout is not None, None, **numbers)


def judge_moments(epipole: Epipole | None, turned: float = 0.0, moved: int = 0) -> tuple[Finding, Finding]:
    """Judge whether one moving camera took both images, and whether they are of one moment.

    Parameters
    ----------
    epipole
        The epipole, if it is in or near the left image.
    turned
        Angle of one camera that only turned, degrees; 0 if it did not.
    moved
        Number of features on things that moved up or down.
    """
    position = {} if epipole is None else {"x": epipole.x, "y": epipole.y}
    things = {"moved": float(moved)} if epipole is None and moved >= MIN_MATCHES else {}
    inside = epipole is not None and epipole.inside
    motion = {"turned_deg": turned} if turned else position
    return (
        judged(FindingCode.ONE_MOVING_CAMERA, inside or turned > 0, None, **motion),
        judged(FindingCode.NOT_SAME_MOMENT, bool(position or things), None, **position, **things),
    )


def judge_sides(lowest: float, highest: float) -> Finding:
    """Judge whether the sides of a rectified pair are swapped, from the ends of its disparity range, px."""
    swapped = highest <= 0 or (lowest < 0 and -lowest > 4 * max(highest, 1.0))
    return judged(FindingCode.SWAPPED, swapped, Remedy.SWAP_SIDES, lowest_px=lowest, highest_px=highest, known=1)


def judge_raw_sides(lowest: float, highest: float, in_front: float, behind: float) -> Finding:
    """Judge whether the sides of an unrectified pair are swapped.

    Parameters
    ----------
    lowest, highest
        Ends of its disparity range after an uncalibrated rectification, px.
    in_front, behind
        Shares of its features that are certainly in front of infinity, and certainly behind it, as with swapped sides.
    """
    known = max(in_front, behind) > MIN_SIDES_SHARE > MAX_OPPOSING_SHARE > min(in_front, behind)
    numbers = {"lowest_px": lowest, "highest_px": highest, "known": float(known)}
    return judged(FindingCode.SWAPPED, known and behind > in_front, Remedy.SWAP_SIDES, **numbers)


def judge_bent_rows(
    spread: float,
    noise: float,
    ends: tuple[float, float],
    scale: float,
    rectified: tuple[float, float] | None,
    *,
    lens: float = 0.0,
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
    lens
        The lens coefficient that bends the rows; 0 if it is not significant.
    """
    bent = abs(lens) > MAX_HEALTHY_LENS or math.sqrt(max(spread**2 - noise**2, 0.0)) * scale > MAX_BEND_PX
    numbers = {"spread_px": spread, "noise_px": noise, "lowest_px": ends[0], "highest_px": ends[1]}
    after = {} if rectified is None else {"rectified_px": rectified[0], "lens": rectified[1]}
    return judged(FindingCode.BENT_ROWS, bent, Remedy.RECTIFY if after else None, **numbers, **after)


def judge_exposure(gain: float, offset: float, greys: tuple[float, float]) -> Finding:
    """Judge ``right ≈ gain * left + offset`` in the middle of the image's `greys`, the darkest and the brightest."""
    darkest, brightest = greys
    difference = offset + (gain - 1) * (darkest + brightest) / 2
    ill = abs(gain - 1) > MAX_GAIN_DIFFERENCE or abs(difference) > MAX_BRIGHTNESS_DIFFERENCE * (brightest - darkest)
    return judged(FindingCode.EXPOSURE, ill, Remedy.MATCH_EXPOSURE, gain=gain, offset=offset)


def judged(code: FindingCode, ill: bool, remedy: Remedy | None, **numbers: float) -> Finding:
    """Return the finding on a question; with its remedy if it is ill."""
    return Finding(code, not ill, numbers, remedy if ill else None)
