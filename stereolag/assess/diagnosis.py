"""The input doctor: the findings on a stereo pair, as codes and numbers, and the search range they suggest."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from stereolag.assess.disparities import INFINITY_SLACK_PX, disparities_of, disparities_seen, range_for
from stereolag.assess.features import FEWEST_MATCHES, Correspondences
from stereolag.assess.orientation import (
    UncalibratedRectification,
    bend_of,
    best_rectification,
    find_correspondences,
    match_noise,
    row_residuals,
    row_spread,
    vertical_plane,
)
from stereolag.assess.remedies import Remedy, exposed_alike, exposure
from stereolag.core.inputs import Image, as_grey, as_stereo_pair, local_deviation
from stereolag.core.jobs import COSTS, Estimate, check_memory

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


TEXTURE_WINDOW = 11
"""Side of the windows in which texture is judged, px."""

FLAT_DEVIATION = 0.01
"""A window has hardly any texture if its standard deviation is below this share of the image's grey-level range."""


DOUBTED_PX = 0.5
"""Spread of the rows above which they are tested for bending, px at the size at which features were matched."""

SURELY = 2.0
"""Standard deviations from 0 at which the sign of a disparity is certain."""


@dataclass(frozen=True)
class Diagnosis:
    """The findings of the input doctor on a pair.

    Attributes
    ----------
    findings
        One per question, in the order in which they should be fixed. The geometry (SWAPPED, ROWS, ROTATION, BENT_ROWS)
        is omitted with too few matched features. Geometry and range are omitted for identical pictures, and the range
        also if the sides are swapped or it cannot be determined.
    disparities
        The range of disparities in the pair as given, px, from a coarse semi-global search over 40 % of the width and
        from the matched features; None if it cannot be determined.
    suggested_range
        First disparity and number of disparities, a multiple of 16, of a search that covers them with a modest margin;
        None if it cannot be determined.

    Examples
    --------
    >>> import numpy as np
    >>> import stereolag as sl
    >>> left = np.random.default_rng(0).integers(0, 256, (90, 140), dtype=np.uint8)
    >>> diagnosis = sl.diagnose(left, np.roll(left, -5, axis=1), num_disparities=16)
    >>> diagnosis.healthy
    True
    >>> diagnosis.suggested_range  # first disparity and how many, px
    (0, 16)
    """

    findings: tuple[Finding, ...]
    disparities: tuple[float, float] | None
    suggested_range: tuple[int, int] | None

    @property
    def healthy(self) -> bool:
        """Return whether every finding is healthy."""
        return all(finding.healthy for finding in self.findings)

    def finding(self, code: FindingCode) -> Finding | None:
        """Return the finding on one question; None if it could not be judged."""
        return next((finding for finding in self.findings if finding.code == code), None)


def diagnose(
    left: npt.ArrayLike, right: npt.ArrayLike, *, min_disparity: int = 0, num_disparities: int = 64
) -> Diagnosis:
    """Examine a stereo pair and the disparity range about to be searched.

    Parameters
    ----------
    left, right
        (H, W), (H, W, 3) or (H, W, 4) images of one size and type.
    min_disparity, num_disparities
        The search range to judge, px.

    Returns
    -------
    Diagnosis
        Findings on identical pictures, swapped sides, row offset, rotation and scale, bent rows, exposure, texture and
        search range.

    Raises
    ------
    ValueError
        If the images are not a pair, or need more memory than one job may take (:func:`estimate_diagnosis`).

    Notes
    -----
    The geometry is judged from sparse feature matches, found without assuming rectified rows: on a rectified pair
    ``dy`` is 0 and every disparity is positive. A rotation of the right view makes ``dy`` grow across the image, a
    difference in scale makes it grow down the image, and converging cameras or distorting lenses make it bend.

    Examples
    --------
    With left and right exchanged, every disparity is negative:

    >>> import numpy as np
    >>> import stereolag as sl
    >>> left = np.random.default_rng(0).integers(0, 256, (90, 140), dtype=np.uint8)
    >>> right = np.roll(left, -5, axis=1)  # disparity 5 px
    >>> diagnosis = sl.diagnose(right, left)
    >>> [(finding.code.name, finding.remedy.name) for finding in diagnosis.findings if not finding.healthy]
    [('SWAPPED', 'SWAP_SIDES')]
    >>> round(diagnosis.finding("swapped").numbers["highest_px"], 1)
    -5.0
    """
    images = as_stereo_pair(left, right)
    shape, dtype = images[0].shape, images[0].dtype
    check_memory(estimate_diagnosis(shape, dtype))
    points = find_correspondences(*images)
    judged = len(points) >= FEWEST_MATCHES
    grey = as_grey(images[0])
    darkest, brightest = np.percentile(grey, (1, 99))
    range_of_greys = max(float(brightest - darkest), 1e-6)
    identical = _judge_identity(images, points if judged else None, range_of_greys)
    geometry = _judge_geometry(points) if judged and identical.healthy else ()
    sides_known = all(finding.healthy for finding in geometry if finding.code == FindingCode.SWAPPED)
    seen = disparities_seen(images[0], exposed_alike(*images), points) if identical.healthy and sides_known else None
    findings = (
        judge_matches(len(points)),
        identical,
        *geometry,
        judge_exposure(*exposure(*images, points if judged else None), range_of_greys),
        judge_texture(float(np.mean(local_deviation(grey, TEXTURE_WINDOW) < FLAT_DEVIATION * range_of_greys))),
    )
    examined = Diagnosis(findings, seen, None if seen is None else range_for(*seen))
    searched = judge_range(examined, min_disparity, num_disparities)
    return examined if searched is None else replace(examined, findings=(*findings, searched))


def estimate_diagnosis(shape: tuple[int, ...], dtype: npt.DTypeLike = np.uint8) -> Estimate:
    """Return the memory and time of :func:`diagnose` for two images of a shape, channels included, and dtype.

    Every channel of the right image is fitted to the left one's exposure in float64; measuring texture takes maps in
    float64. Features and coarse search cost the same at any size.
    """
    pixels, values = shape[0] * shape[1], int(np.prod(shape))
    copy = values * np.dtype(dtype).itemsize
    return COSTS["diagnosis"].estimate(pixels=pixels, values=values, copy=copy, searches=1)


def judge_range(diagnosis: Diagnosis, min_disparity: int, num_disparities: int) -> Finding | None:
    """Judge another search range for a pair that has been examined.

    Parameters
    ----------
    diagnosis
        The result of :func:`diagnose` for the pair.
    min_disparity, num_disparities
        The search range, px.

    Returns
    -------
    finding
        None if the range of the pair could not be determined, or its sides are swapped.
    """
    if diagnosis.disparities is None or diagnosis.suggested_range is None:
        return None
    return judge_searched(diagnosis.disparities, (min_disparity, num_disparities), diagnosis.suggested_range)


def _judge_identity(images: tuple[Image, Image], points: Correspondences | None, range_of_greys: float) -> Finding:
    """Judge whether both images show one view."""
    left, right = (as_grey(image).astype(np.float32) for image in images)
    difference = float(np.mean(np.abs(right - left))) / range_of_greys
    if points is None:
        return judge_identical(difference, None, 1.0)
    return judge_identical(difference, float(np.percentile(np.hypot(points.dx, points.dy), 95)), points.scale)


def _judge_geometry(points: Correspondences) -> tuple[Finding, ...]:
    """Judge the relative orientation of the views."""
    offset = float(np.median(points.dy))
    spread = 1.4826 * float(np.median(np.abs(points.dy - offset)))
    _, sine, growth = vertical_plane(points)
    turned = float(np.degrees(sine)), 1 + growth
    residuals, bend = row_residuals(points), bend_of(points)
    bent, noise, ends = row_spread(residuals), match_noise(points, residuals), np.percentile(residuals, (2, 98))
    straight = best_rectification(points) if max(bent, float(np.std(bend))) * points.scale > DOUBTED_PX else None
    if straight is not None and np.std(bend) > bent:
        bent, ends = float(np.std(bend)), np.percentile(bend, (2, 98))
    rows = judge_bent_rows(
        bent,
        noise if straight is None else min(noise, straight.spread_px),
        (float(ends[0]), float(ends[1])),
        points.scale,
        None if straight is None else (straight.spread_px, straight.lens),
    )
    if straight is None or rows.remedy is None:
        sides = judge_sides(*disparities_of(points))
        return sides, judge_rows(offset, spread), judge_rotation(*turned), rows
    # The remedy for bent rows also corrects offset and rotation.
    sides = _judge_raw_sides(straight, points)
    return sides, judge_rows(offset, spread, remedy=None), judge_rotation(*turned, remedy=None), rows


def _judge_raw_sides(model: UncalibratedRectification, points: Correspondences) -> Finding:
    """Judge whether the sides of an unrectified pair are swapped, from its disparities after rectification."""
    disparities, deviations = model.disparities(points)
    lowest, highest = np.percentile(disparities, (2, 98))
    in_front, behind = (float(np.mean(side * disparities > SURELY * deviations)) for side in (1, -1))
    return judge_raw_sides(float(lowest), float(highest), in_front, behind)
