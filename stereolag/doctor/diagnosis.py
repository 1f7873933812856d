"""The input doctor: what is wrong with a pair before any matcher sees it, in numbers, and what would mend it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.doctor.correspondences import find_correspondences, vertical_plane
from stereolag.doctor.findings import (
    FEWEST_MATCHES,
    INFINITY_SLACK_PX,
    Ailment,
    Finding,
    about_exposure,
    about_matches,
    about_range,
    about_rotation,
    about_rows,
    about_sides,
    about_texture,
)
from stereolag.doctor.remedies import exposed_alike, exposure
from stereolag.estimates import OVERHEAD, Estimate, check_memory, kept_blocks
from stereolag.inputs import Image, as_grey, as_stereo_pair
from stereolag.stereo.estimates import fitting_pair
from stereolag.stereo.opencv import StereoSGBM

FLAT_DEVIATION = 0.01
"""Of 11 × 11 px, as a share of the picture's range of greys: less is hardly any texture."""

RANGE_MARGIN = 0.1
"""How far beyond the disparities seen the suggested search reaches, as a share of them."""

EXPOSED, TEXTURE = 9, 20
"""Bytes of one number of the picture fitted in exposure, and of a pixel while its texture is judged."""

COARSE_SECONDS, NUMBER_SECONDS = 0.2, 4e-8
"""Seconds of the features and the coarse search, and of each number of the picture."""

COARSE_WIDTH = 320
"""Width to which a pair is reduced for the look at its range, px."""


@dataclass(frozen=True)
class Diagnosis:
    """What the doctor found on a pair.

    Attributes
    ----------
    findings
        One a question, in the order in which they should be mended.
    row_offset_px, row_spread_px
        Median and robust standard deviation of dy (right minus left); NaN with too few matches.
    rotation_deg, scale
        Of the right view against the left one; NaN with too few matches.
    gain, offset
        ``right ≈ gain * left + offset``, in grey levels.
    flat_share
        Share of the picture without texture, 0..1.
    disparities
        0.5th and 99.5th percentile of what a coarse semi-global search over 40 % of the width finds, px.
    suggested_min, suggested_num
        The search range that covers them, `suggested_num` a multiple of 16.
    """

    findings: tuple[Finding, ...]
    row_offset_px: float
    row_spread_px: float
    rotation_deg: float
    scale: float
    gain: float
    offset: float
    flat_share: float
    disparities: tuple[float, float]
    suggested_min: int
    suggested_num: int

    @property
    def healthy(self) -> bool:
        """Return whether nothing was found."""
        return all(finding.healthy for finding in self.findings)

    def finding(self, ailment: Ailment) -> Finding:
        """Return what was found about one ailment."""
        return next(finding for finding in self.findings if finding.ailment == ailment)


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
    rotation of the right view shows as a ``dy`` that grows across the picture, a difference of scale as one that
    grows down it.
    """
    images = as_stereo_pair(left, right)
    shape, dtype = images[0].shape, images[0].dtype
    check_memory(
        estimate_diagnosis(shape, dtype),
        partial(fitting_pair, shape=shape, of_shape=partial(estimate_diagnosis, dtype=dtype), of_disparities=None),
    )
    points = find_correspondences(*images)
    judged = len(points) >= FEWEST_MATCHES
    nothing = float("nan")
    row_offset = float(np.median(points.dy)) if judged else nothing
    row_spread = 1.4826 * float(np.median(np.abs(points.dy - row_offset))) if judged else nothing
    _, sine, growth = vertical_plane(points) if judged else (nothing, nothing, nothing)
    sparse_low, sparse_high = np.percentile(-points.dx, (1, 99)) if judged else (nothing, nothing)
    low, high = _disparities_seen(images[0], exposed_alike(*images))
    suggested_min, suggested_num = _suggested_range(low, high)
    gain, offset = exposure(*images, points if judged else None)
    flat = _flat_share(images[0])
    findings = [about_matches(len(points))]
    if judged:
        findings += [
            about_sides(sparse_low, sparse_high),
            about_rows(row_offset, row_spread),
            about_rotation(float(np.degrees(sine)), growth),
        ]
    findings += [about_exposure(gain, offset, _range_of_greys(images[0])), about_texture(flat)]
    examined = Diagnosis(
        findings=tuple(findings),
        row_offset_px=row_offset,
        row_spread_px=row_spread,
        rotation_deg=float(np.degrees(sine)),
        scale=1 + growth,
        gain=gain,
        offset=offset,
        flat_share=flat,
        disparities=(low, high),
        suggested_min=suggested_min,
        suggested_num=suggested_num,
    )
    about_range = judge_range(examined, min_disparity, num_disparities)
    return examined if about_range is None else replace(examined, findings=(*examined.findings, about_range))


def estimate_diagnosis(shape: tuple[int, ...], dtype: npt.DTypeLike = np.uint8) -> Estimate:
    """Return what :func:`diagnose` will take for two images of a shape, with channels or without, and a dtype.

    The right image is fitted to the left one's exposure in float64, every channel; the share without texture takes
    five maps in float32. The features and the coarse search take the same for all sizes.
    """
    pixels, numbers, pixel = shape[0] * shape[1], int(np.prod(shape)), np.dtype(dtype).itemsize
    memory = max(EXPOSED * numbers, TEXTURE * pixels) + pixel * numbers
    return Estimate(
        memory + kept_blocks(4 * pixels, 2) + 2 * OVERHEAD, COARSE_SECONDS + NUMBER_SECONDS * (numbers + pixels)
    )


def judge_range(diagnosis: Diagnosis, min_disparity: int, num_disparities: int) -> Finding | None:
    """Judge one more search range of a pair that was examined.

    Parameters
    ----------
    diagnosis
        What :func:`diagnose` found on the pair.
    min_disparity, num_disparities
        The search range, px.

    Returns
    -------
    finding
        None for a pair that is swapped or whose views do not match: its range would be that of the wrong pair.
    """
    if not all(one.healthy for one in diagnosis.findings if one.ailment in (Ailment.MATCHES, Ailment.SWAPPED)):
        return None
    low, high = diagnosis.disparities
    suggested = diagnosis.suggested_min, diagnosis.suggested_num
    return about_range(low, high, min_disparity, num_disparities, *suggested)


def _disparities_seen(left: Image, right: Image) -> tuple[float, float]:
    """Return the range of disparities in the pair, px, from a coarse search far wider than any pair should need.

    Sparse matches would miss the near things, which fill few but important pixels.
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
    """Return the range to search for what was seen, with a margin; a rectified pair may as well begin at infinity."""
    margin = RANGE_MARGIN * max(high - low, 8.0)
    first = 0 if -INFINITY_SLACK_PX <= low - margin <= 16 or -INFINITY_SLACK_PX <= low <= 16 else int(low - margin)
    count = int(np.ceil(high + margin)) - first + 1
    return first, max(16, 16 * -(-count // 16))


def _flat_share(image: Image) -> float:
    """Return the share of 11 × 11 windows with hardly any texture, against the picture's range of greys."""
    grey = as_grey(image).astype(np.float32)
    mean = cv2.blur(grey, (11, 11))
    variance = cv2.blur((grey - float(grey.mean())) ** 2, (11, 11)) - (mean - float(grey.mean())) ** 2
    return float(np.mean(variance < (FLAT_DEVIATION * _range_of_greys(image)) ** 2))


def _range_of_greys(image: Image) -> float:
    low, high = np.percentile(as_grey(image), (1, 99))
    return max(float(high - low), 1e-6)
