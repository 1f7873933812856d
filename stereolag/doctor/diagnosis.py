"""The input doctor: problems of a stereo pair, in numbers, found before any matcher sees it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.doctor.correspondences import Correspondences, find_correspondences, vertical_plane
from stereolag.doctor.findings import (
    FEWEST_MATCHES,
    INFINITY_SLACK_PX,
    Finding,
    FindingCode,
    judge_exposure,
    judge_matches,
    judge_rotation,
    judge_rows,
    judge_searched,
    judge_sides,
    judge_texture,
)
from stereolag.doctor.remedies import exposed_alike, exposure
from stereolag.estimates import OVERHEAD, Estimate, check_memory, kept_blocks
from stereolag.inputs import Image, as_grey, as_stereo_pair, local_deviation
from stereolag.stereo.estimates import fitting_pair
from stereolag.stereo.opencv import StereoSGBM

TEXTURE_WINDOW = 11
"""Side of the windows whose texture is judged, px."""

FLAT_DEVIATION = 0.01
"""Standard deviation of such a window, as a share of the image's range of grey levels: less is hardly any texture."""

RANGE_MARGIN = 0.1
"""How far beyond the disparities seen the suggested range reaches, as a share of their span."""

EXPOSED, TEXTURE = 9, 42
"""Bytes per value of the image while its exposure is fitted, and per pixel while its texture is judged."""

COARSE_SECONDS, VALUE_SECONDS = 0.2, 4e-8
"""Seconds of the features and the coarse search, and per value of the image."""

COARSE_WIDTH = 320
"""Width to which a pair is reduced to look for its range of disparities, px."""


@dataclass(frozen=True)
class Diagnosis:
    """The findings of the doctor on a pair.

    Attributes
    ----------
    findings
        One per question, in the order in which they should be fixed. The geometry (SWAPPED, ROWS, ROTATION) is left
        out with too few matched features, the range on a pair whose sides are swapped or whose views do not match.
    disparities
        0.5th and 99.5th percentile of the disparities that a coarse semi-global search over 40 % of the width
        measures, px.
    suggested_min_disparity, suggested_num_disparities
        The search range that covers them, px; the number is a multiple of 16.
    """

    findings: tuple[Finding, ...]
    disparities: tuple[float, float]
    suggested_min_disparity: int
    suggested_num_disparities: int

    @property
    def healthy(self) -> bool:
        """Return whether every finding is healthy."""
        return all(finding.healthy for finding in self.findings)

    def finding(self, code: FindingCode) -> Finding | None:
        """Return the finding on one question; None where it could not be judged."""
        return next((finding for finding in self.findings if finding.code == code), None)


def diagnose(
    left: npt.ArrayLike, right: npt.ArrayLike, *, min_disparity: int = 0, num_disparities: int = 64
) -> Diagnosis:
    """Examine a stereo pair and the range in which it is about to be searched.

    Parameters
    ----------
    left, right
        (H, W), (H, W, 3) or (H, W, 4) images of one size and type.
    min_disparity, num_disparities
        The search range to judge, px.

    Returns
    -------
    Diagnosis
        Findings on swapped sides, row offset, rotation and scale, exposure, texture and search range.

    Raises
    ------
    ValueError
        Images that are not a pair, or that need more memory than one job may take (:func:`estimate_diagnosis`).

    Notes
    -----
    The geometry rests on sparse feature matches: on a rectified pair ``dy`` is 0 and every disparity positive. A
    rotation of the right view shows as a ``dy`` that grows across the image, a difference in scale as one that grows
    down it.
    """
    images = as_stereo_pair(left, right)
    shape, dtype = images[0].shape, images[0].dtype
    check_memory(
        estimate_diagnosis(shape, dtype),
        partial(fitting_pair, shape=shape, of_shape=partial(estimate_diagnosis, dtype=dtype), of_disparities=None),
    )
    points = find_correspondences(*images)
    judged = len(points) >= FEWEST_MATCHES
    seen = _disparities_seen(images[0], exposed_alike(*images))
    suggested = _suggested_range(*seen)
    range_of_greys = _range_of_greys(images[0])
    findings = (
        judge_matches(len(points)),
        *(_judge_geometry(points) if judged else ()),
        judge_exposure(*exposure(*images, points if judged else None), range_of_greys),
        judge_texture(_flat_share(images[0], range_of_greys)),
    )
    examined = Diagnosis(findings, seen, *suggested)
    searched = judge_range(examined, min_disparity, num_disparities)
    return examined if searched is None else replace(examined, findings=(*findings, searched))


def estimate_diagnosis(shape: tuple[int, ...], dtype: npt.DTypeLike = np.uint8) -> Estimate:
    """Return the memory and time that :func:`diagnose` needs for two images of a shape, channels included, and dtype.

    The right image is fitted to the left one's exposure in float64, every channel; the share without texture takes
    maps in float64. The features and the coarse search take the same for all sizes.
    """
    pixels, values, pixel = shape[0] * shape[1], int(np.prod(shape)), np.dtype(dtype).itemsize
    memory = max(EXPOSED * values, TEXTURE * pixels) + pixel * values
    return Estimate(
        memory + kept_blocks(4 * pixels, 2) + 2 * OVERHEAD, COARSE_SECONDS + VALUE_SECONDS * (values + pixels)
    )


def judge_range(diagnosis: Diagnosis, min_disparity: int, num_disparities: int) -> Finding | None:
    """Judge another search range of a pair that was examined.

    Parameters
    ----------
    diagnosis
        The result of :func:`diagnose` for the pair.
    min_disparity, num_disparities
        The search range, px.

    Returns
    -------
    finding
        None for a pair that is swapped or whose views do not match: its range would be that of the wrong pair.
    """
    doubtful = (FindingCode.MATCHES, FindingCode.SWAPPED)
    if not all(finding.healthy for finding in diagnosis.findings if finding.code in doubtful):
        return None
    suggested = diagnosis.suggested_min_disparity, diagnosis.suggested_num_disparities
    return judge_searched(diagnosis.disparities, (min_disparity, num_disparities), suggested)


def _judge_geometry(points: Correspondences) -> tuple[Finding, ...]:
    """Judge how the views lie to each other."""
    lowest, highest = np.percentile(-points.dx, (1, 99))
    offset = float(np.median(points.dy))
    spread = 1.4826 * float(np.median(np.abs(points.dy - offset)))
    _, sine, growth = vertical_plane(points)
    return (
        judge_sides(float(lowest), float(highest)),
        judge_rows(offset, spread),
        judge_rotation(float(np.degrees(sine)), 1 + growth),
    )


def _disparities_seen(left: Image, right: Image) -> tuple[float, float]:
    """Return the range of disparities in the pair, px, from a coarse search far wider than any pair should need.

    Sparse matches would miss near objects, which fill few but important pixels.
    """
    scale = min(1.0, COARSE_WIDTH / left.shape[1])
    height, width = (max(1, round(side * scale)) for side in left.shape[:2])
    coarse = [cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA) for image in (left, right)]
    count, first = 16 * max(1, -(-int(0.4 * width) // 16)), -int(0.12 * width)
    framed = [cv2.copyMakeBorder(image, 8, 8, count + 8, 8 - first, cv2.BORDER_REPLICATE) for image in coarse]
    matcher = StereoSGBM(
        num_disparities=count,
        min_disparity=first,
        p2=1600,
        uniqueness_ratio=15,
        speckle_window_size=60,
        speckle_range=1,
    )
    found = matcher.compute(*framed).disparity[8:-8, count + 8 : count + 8 + width]
    seen = found[np.isfinite(found)]
    if seen.size < 0.02 * found.size:
        return 0.0, 64.0
    low, high = np.percentile(seen, (0.5, 99.5)) / scale
    return float(low), float(high)


def _suggested_range(low: float, high: float) -> tuple[int, int]:
    """Return the range to search for the disparities seen, with a margin; from 0 (infinity) if they begin near it."""
    margin = RANGE_MARGIN * max(high - low, 8.0)
    first = 0 if -INFINITY_SLACK_PX <= low - margin <= 16 or -INFINITY_SLACK_PX <= low <= 16 else int(low - margin)
    count = int(np.ceil(high + margin)) - first + 1
    return first, max(16, 16 * -(-count // 16))


def _flat_share(image: Image, range_of_greys: float) -> float:
    """Return the share of the windows with hardly any texture, against the image's range of grey levels."""
    return float(np.mean(local_deviation(as_grey(image), TEXTURE_WINDOW) < FLAT_DEVIATION * range_of_greys))


def _range_of_greys(image: Image) -> float:
    low, high = np.percentile(as_grey(image), (1, 99))
    return max(float(high - low), 1e-6)
