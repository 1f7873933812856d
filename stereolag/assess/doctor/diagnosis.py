"""The diagnosis of a stereo pair: one finding per question, and the search range they suggest."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import numpy.typing as npt

from stereolag.assess.doctor.correspondences import find_correspondences
from stereolag.assess.doctor.disparity_range import disparities_of, disparities_seen, range_for
from stereolag.assess.doctor.features import Correspondences
from stereolag.assess.doctor.findings import (
    FEWEST_MATCHES,
    Finding,
    FindingCode,
    judge_bent_rows,
    judge_exposure,
    judge_identical,
    judge_matches,
    judge_raw_sides,
    judge_rotation,
    judge_rows,
    judge_searched,
    judge_sides,
    judge_texture,
)
from stereolag.assess.doctor.remedies import exposed_alike, exposure
from stereolag.assess.doctor.rows import bend_of, match_noise, row_residuals, row_spread, straightened, vertical_plane
from stereolag.assess.doctor.uncalibrated import UncalibratedRectification
from stereolag.core.estimates import OVERHEAD, Estimate, check_memory, kept_blocks
from stereolag.core.inputs import Image, as_grey, as_stereo_pair, local_deviation
from stereolag.stereo.estimates import fitting_pair

TEXTURE_WINDOW = 11
"""Side of the windows in which texture is judged, px."""

FLAT_DEVIATION = 0.01
"""A window has hardly any texture if its standard deviation is below this share of the image's grey-level range."""

EXPOSED, TEXTURE = 9, 42
"""Bytes per image value while the exposure is fitted, and per pixel while the texture is judged."""

COARSE_SECONDS, VALUE_SECONDS = 0.4, 4e-8
"""Seconds for the features and the coarse search, and per image value."""

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
    check_memory(
        estimate_diagnosis(shape, dtype),
        partial(fitting_pair, shape=shape, of_shape=partial(estimate_diagnosis, dtype=dtype), of_disparities=None),
    )
    points = find_correspondences(*images)
    judged = len(points) >= FEWEST_MATCHES
    range_of_greys = _range_of_greys(images[0])
    identical = _judge_identity(images, points if judged else None, range_of_greys)
    geometry = _judge_geometry(points) if judged and identical.healthy else ()
    sides_known = all(finding.healthy for finding in geometry if finding.code == FindingCode.SWAPPED)
    seen = disparities_seen(images[0], exposed_alike(*images), points) if identical.healthy and sides_known else None
    findings = (
        judge_matches(len(points)),
        identical,
        *geometry,
        judge_exposure(*exposure(*images, points if judged else None), range_of_greys),
        judge_texture(_flat_share(images[0], range_of_greys)),
    )
    examined = Diagnosis(findings, seen, None if seen is None else range_for(*seen))
    searched = judge_range(examined, min_disparity, num_disparities)
    return examined if searched is None else replace(examined, findings=(*findings, searched))


def estimate_diagnosis(shape: tuple[int, ...], dtype: npt.DTypeLike = np.uint8) -> Estimate:
    """Return the memory and time of :func:`diagnose` for two images of a shape, channels included, and dtype.

    Every channel of the right image is fitted to the left one's exposure in float64; measuring texture takes maps in
    float64. Features and coarse search cost the same at any size.
    """
    pixels, values, pixel = shape[0] * shape[1], int(np.prod(shape)), np.dtype(dtype).itemsize
    memory = max(EXPOSED * values, TEXTURE * pixels) + pixel * values
    return Estimate(
        memory + kept_blocks(4 * pixels, 2) + 2 * OVERHEAD, COARSE_SECONDS + VALUE_SECONDS * (values + pixels)
    )


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
    straight = straightened(points) if max(bent, float(np.std(bend))) * points.scale > DOUBTED_PX else None
    if straight is not None and np.std(bend) > bent:
        bent, ends = float(np.std(bend)), np.percentile(bend, (2, 98))
    rows = judge_bent_rows(
        bent,
        noise if straight is None else min(noise, straight.spread_px),
        (float(ends[0]), float(ends[1])),
        points.scale,
        None if straight is None else (straight.spread_px, straight.model.lens),
    )
    if straight is None or rows.remedy is None:
        sides = judge_sides(*disparities_of(points))
        return sides, judge_rows(offset, spread), judge_rotation(*turned), rows
    # The remedy for bent rows also corrects offset and rotation.
    sides = _judge_raw_sides(straight.model, points)
    return sides, judge_rows(offset, spread, remedy=None), judge_rotation(*turned, remedy=None), rows


def _judge_raw_sides(model: UncalibratedRectification, points: Correspondences) -> Finding:
    """Judge whether the sides of an unrectified pair are swapped, from its disparities after rectification."""
    disparities, deviations = model.disparities(points)
    lowest, highest = np.percentile(disparities, (2, 98))
    in_front, behind = (float(np.mean(side * disparities > SURELY * deviations)) for side in (1, -1))
    return judge_raw_sides(float(lowest), float(highest), in_front, behind)


def _flat_share(image: Image, range_of_greys: float) -> float:
    """Return the share of windows with hardly any texture relative to the image's grey-level range."""
    return float(np.mean(local_deviation(as_grey(image), TEXTURE_WINDOW) < FLAT_DEVIATION * range_of_greys))


def _range_of_greys(image: Image) -> float:
    low, high = np.percentile(as_grey(image), (1, 99))
    return max(float(high - low), 1e-6)
