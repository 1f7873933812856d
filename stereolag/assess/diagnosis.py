"""The input doctor: the findings on a stereo pair, as codes and numbers, and their remedies."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.assess.features import MIN_MATCHES, Correspondences
from stereolag.assess.findings import (
    MAX_BEND_PX,
    MIN_SIDES_SHARE,
    Finding,
    FindingCode,
    Remedy,
    judge,
    judge_bent_rows,
    judge_exposure,
    judge_identical,
    judge_layout,
    judge_matches,
    judge_moments,
    judge_raw_sides,
    judge_sides,
    judged,
)
from stereolag.assess.layout import (
    MIN_ORDER_SIGMAS,
    Anaglyph,
    Views,
    depth_order,
    find_views,
    fits_homography,
    likely_layout,
    mirrored_matches,
    pure_rotation_deg,
    repetition,
)
from stereolag.assess.orientation import (
    MAX_HEALTHY_LENS,
    bend_of,
    best_rectification,
    find_correspondences,
    match_noise,
    row_spread,
    vertical_plane,
)
from stereolag.assess.search_range import (
    INFINITY_SLACK_PX,
    coarse_range,
    disparities_of,
    quick_map,
    range_for,
    reduced,
)
from stereolag.assess.uncalibrated import UncalibratedRectification, centre_of
from stereolag.core.arrays import DoubleMap, median, percentiles
from stereolag.core.inputs import (
    Image,
    as_grey,
    as_stereo_pair,
    local_deviation,
    transparent,
    with_border_transparent,
)
from stereolag.core.jobs import COSTS, Estimate, check_memory
from stereolag.geometry.rectification import turned

TEXTURE_WINDOW_PX = 11
"""Side of the windows in which texture is judged, px."""

MAX_FLAT_DEVIATION = 0.01
"""A window has hardly any texture if its standard deviation is below this share of the image's grey-level range."""

EXPOSURE_SQUARE = 1 / 15
"""Side of the squares in which exposure is compared, as a share of the width: defocus changes neither the brightness
nor the contrast of their means."""

MAX_ROTATION_DEG = 45.0
"""Rotation between both pictures above which no other geometry is judged before they are level, degrees."""

MIN_SIGN_SIGMAS = 2.0
"""Standard deviations from 0 above which the sign of a disparity is certain."""


@dataclass(frozen=True)
class Diagnosis:
    """The findings of the input doctor on a pair.

    Attributes
    ----------
    findings
        One per question, in the order in which they should be fixed. The geometry (SWAPPED, ROWS, ROTATION, BENT_ROWS)
        is omitted with too few matched features, all but ROTATION if one image is on its side or upside down. LAYOUT is
        judged only if another finding is ill, and is always healthy if the geometry is: a wall of bricks would resemble
        two views. Arrangement (MIRRORED to NOT_SAME_MOMENT), geometry and range are omitted for identical pictures;
        geometry and range also for an arrangement that is ill, unless only things moved, and the range if the sides are
        swapped or it cannot be determined. A remedy is offered only if a small copy of the pair has a plausible map
        after it, and a better one than before.
    disparities
        The range of disparities in the pair as given, px, from a coarse semi-global search over 40 % of the width and
        from the matched features; None if it cannot be determined.
    suggested_range
        First disparity and number of disparities, a multiple of 16, of a search that covers them with a modest margin;
        None if it cannot be determined.
    repeats_px
        Distance at which the left image repeats along its rows, px; 0 if it does not. A wider search finds several
        matches for each point.

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
    repeats_px: float = 0.0

    @property
    def healthy(self) -> bool:
        """Return whether every finding is healthy."""
        return not self.ill

    @property
    def ill(self) -> tuple[Finding, ...]:
        """Return the findings that are not healthy."""
        return tuple(finding for finding in self.findings if not finding.healthy)

    @property
    def doubts(self) -> tuple[Finding, ...]:
        """Return the findings that make a map doubtful.

        A search wider than needed only takes longer, unless the picture repeats within it.
        """
        misleading = ("missing_px", "repeats_px")
        return tuple(one for one in self.ill if one.code != FindingCode.RANGE or any(map(one.numbers.get, misleading)))

    def finding(self, code: FindingCode) -> Finding | None:
        """Return the finding on one question; None if it could not be judged."""
        return next((finding for finding in self.findings if finding.code == code), None)

    def over(self, searched: tuple[int, int] | None) -> Diagnosis:
        """Return the diagnosis for another search range: first disparity and number, px; None to judge no range."""
        others = tuple(finding for finding in self.findings if finding.code != FindingCode.RANGE)
        judged = None if searched is None else judge_range(self, *searched)
        return replace(self, findings=others if judged is None else (*others, judged))


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
        Findings on the arrangement of the views, their geometry, exposure and texture, and the search range.

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
    check_memory(estimate_diagnosis(images[0].shape, images[0].dtype))
    found = find_correspondences(*images)
    points = found if len(found) >= MIN_MATCHES else None
    left_grey, right_grey = (as_grey(image) for image in images)
    darkest, brightest = percentiles(left_grey, 1, 99)
    range_of_greys = max(float(brightest - darkest), 1e-6)
    difference = float(np.mean(np.abs(right_grey.astype(np.float32) - left_grey.astype(np.float32)))) / range_of_greys
    moved = None if points is None else percentiles(np.hypot(points.dx, points.dy), 95).item()
    identical = judge_identical(difference, moved, found.scale)
    arrangement = _judge_arrangement(images, found) if identical.healthy else ()
    side_by_side = identical.healthy and all(one.healthy or "moved" in one.numbers for one in arrangement)
    geometry = _judge_geometry(images, points) if points is not None and side_by_side else ()
    sides_known = not geometry or any(finding.healthy for finding in geometry if finding.code == FindingCode.SWAPPED)
    has_range = side_by_side and sides_known
    disparities = coarse_range(images[0], with_left_exposure(*images, points), points) if has_range else None
    findings = (
        judge_matches(len(found)),
        identical,
        *arrangement,
        *geometry,
        judge_exposure(*_exposure(*images, points), (float(darkest), float(brightest))),
        judge(FindingCode.TEXTURE, flat_share=_flat_share(left_grey, range_of_greys)),
        judge(FindingCode.EMPTY_BORDER, left_share=_border_share(images[0]), right_share=_border_share(images[1])),
    )
    if any(not finding.healthy for finding in findings):
        likely = None
        if not (geometry and all(finding.healthy for finding in geometry)):  # a healthy geometry is of two views
            with suppress(Anaglyph):  # its views are not side by side
                likely = likely_layout(images[0])
        layout = judge_layout(likely and likely[0])
        if layout.healthy:
            findings = tuple(_with_tried_remedies(findings, images, found))
        else:  # the views must be divided first
            disparities, findings = None, tuple(replace(finding, remedy=None) for finding in findings)
        findings = *findings[:2], layout, *findings[2:]
    if disparities is None:
        return Diagnosis(findings, None, None)
    repeats = repetition(images[0])
    suggested = range_for(*disparities, images[0].shape[1], repeats)
    return Diagnosis(findings, disparities, suggested, repeats).over((min_disparity, num_disparities))


def _judge_arrangement(images: tuple[Image, Image], found: Correspondences) -> tuple[Finding, ...]:
    """Judge whether the pictures are of two cameras side by side, of one moment, and neither is mirrored."""
    mirrored = judge(FindingCode.MIRRORED, Remedy.MIRROR_RIGHT, count=mirrored_matches(*images, len(found)))
    if not mirrored.healthy:
        return (mirrored,)
    angle = pure_rotation_deg(found)
    views = None if angle else find_views(found)
    if views is None:
        return mirrored, judge(FindingCode.ABOVE_EACH_OTHER, quarters=0), *judge_moments(None, angle, found.moved)
    above = views.above_each_other
    quarters = quarters_upright(views) if above else 0
    stacked = judge(FindingCode.ABOVE_EACH_OTHER, Remedy.TURN_UPRIGHT, quarters=quarters)
    return mirrored, stacked, *judge_moments(None if above else views.epipole, moved=found.moved)


def quarters_upright(views: Views | None) -> int:
    """Return the quarters of a turn, counter-clockwise, that bring cameras above each other side by side.

    The upper camera, in whose picture points are lower, becomes the left one.
    """
    return 1 if views is None or median(views.points.dy) < 0 else -1


def _border_share(image: Image) -> float:
    """Return the share of the pixels that the matchers ignore: transparent ones, and black ones up to the border."""
    outside = transparent(with_border_transparent(image))
    return 0.0 if outside is None else float(outside.mean())


def _flat_share(grey: Image, range_of_greys: float) -> float:
    """Return the share of the pixels in surroundings with hardly any texture, not counting a sky.

    A sky is flat, touches the upper edge and is in the upper half. It is at infinity whatever is measured there.
    """
    flat = local_deviation(grey, TEXTURE_WINDOW_PX) < MAX_FLAT_DEVIATION * range_of_greys
    count, parts = cv2.connectedComponents(flat.astype(np.uint8), connectivity=4)
    touches_top = np.isin(np.arange(count), parts[0])
    sky = flat & touches_top[parts]
    sky[flat.shape[0] // 2 :] = False
    ground = flat.size - int(np.count_nonzero(sky))
    return float(np.count_nonzero(flat & ~sky)) / max(1, ground)


def estimate_diagnosis(shape: tuple[int, ...], dtype: npt.DTypeLike = np.uint8) -> Estimate:
    """Return the memory and time of :func:`diagnose` for two images of a shape, channels included, and dtype.

    The exposure of every channel of the right image is matched in float64, and texture is measured in float64 maps. The
    cost of features and of the coarse search does not depend on the size.
    """
    pixels, values = shape[0] * shape[1], int(np.prod(shape))
    copy = values * np.dtype(dtype).itemsize
    return COSTS["diagnosis"].estimate(pixels=pixels, values=values, copy=copy, searches=1)


def judge_range(diagnosis: Diagnosis, min_disparity: int, num_disparities: int) -> Finding | None:
    """Judge another search range, px, for an examined pair; None if its sides or its range are unknown."""
    if diagnosis.disparities is None or diagnosis.suggested_range is None:
        return None
    (lowest, highest), suggested = diagnosis.disparities, diagnosis.suggested_range
    missing = max(0.0, min_disparity - INFINITY_SLACK_PX - lowest, highest - (min_disparity + num_disparities))
    repeated = 0 < diagnosis.repeats_px < num_disparities
    return judged(
        FindingCode.RANGE,
        missing > 0 or num_disparities >= 2 * suggested[1] or repeated,
        Remedy.SET_RANGE,
        lowest_px=lowest,
        highest_px=highest,
        min_disparity=min_disparity,
        num_disparities=num_disparities,
        missing_px=missing,
        suggested_min_disparity=suggested[0],
        suggested_num_disparities=suggested[1],
        repeats_px=diagnosis.repeats_px,
    )


def _judge_geometry(images: tuple[Image, Image], points: Correspondences) -> tuple[Finding, ...]:
    """Judge the relative orientation of the views."""
    offset = median(points.dy)
    spread = 1.4826 * median(np.abs(points.dy - offset))
    (central, across, down), residuals = vertical_plane(points)
    grid, lens = bend_of(points)
    matched_bend, noise = row_spread(residuals), match_noise(points, residuals)
    bend, ends = matched_bend, percentiles(residuals, 2, 98)
    grid_bend = float(np.std(grid))
    doubtful = max(matched_bend, grid_bend) * points.scale > MAX_BEND_PX or abs(lens) > MAX_HEALTHY_LENS
    rectification = best_rectification(points) if doubtful else None
    if grid_bend > matched_bend and (rectification is not None or lens):
        bend, ends = grid_bend, percentiles(grid, 2, 98)
    bent_rows = judge_bent_rows(
        bend,
        noise if rectification is None else min(noise, rectification.spread_px),
        (float(ends[0]), float(ends[1])),
        points.scale,
        None if rectification is None else (rectification.spread_px, rectification.lens),
        lens=lens,
    )
    # The remedy for bent rows also corrects offset and rotation; that for a rotation also the offset.
    numbers = {"rotation_deg": math.degrees(math.atan2(across, 1 - down)), "scale": 1 / math.hypot(across, 1 - down)}
    rotation = judge(FindingCode.ROTATION, Remedy.LEVEL if bent_rows.remedy is None else None, **numbers)
    if abs(numbers["rotation_deg"]) > MAX_ROTATION_DEG:
        return (rotation,)
    if not rotation.healthy:  # the median depends on where the matches are, unless they surround the rotation's centre
        offset = float(central)
    remedy = Remedy.ALIGN_ROWS if bent_rows.remedy is None and rotation.healthy else None
    rows = judge(FindingCode.ROWS, remedy, offset_px=offset, spread_px=spread)
    sides = _judge_sides(images, points, None if bent_rows.remedy is None else rectification)
    return sides, rows, rotation, bent_rows


def _judge_sides(
    images: tuple[Image, Image], points: Correspondences, rectification: UncalibratedRectification | None
) -> Finding:
    """Judge whether the sides are swapped, after a rectification if there is one."""
    if rectification is not None:
        disparities, deviations = rectification.disparities(points)
        lowest, highest = percentiles(disparities, 2, 98)
        shares = [float(np.mean(sign * disparities > MIN_SIGN_SIGMAS * deviations)) for sign in (1, -1)]
        in_front, behind = (0.0, 0.0) if max(shares) > MIN_SIDES_SHARE and fits_homography(points) else shares
        return judge_raw_sides(float(lowest), float(highest), in_front, behind)
    finding = judge_sides(*disparities_of(points))
    if finding.healthy:
        return finding
    left, right = apply_remedy(images[0], with_left_exposure(*images, points), Remedy.LEVEL, found=points)
    # Infinity is below 0 if pictures were cropped or cameras turned; then the exchanged pair has the wrong depth order.
    exchange_is_wrong = depth_order(right, left) < -MIN_ORDER_SIGMAS
    return replace(finding, healthy=True, remedy=None) if exchange_is_wrong else finding


TRIAL_WIDTH_PX = 640
"""Width to which a pair is reduced to try a remedy, px."""

MIN_PLAUSIBLE_SHARE = 0.35
"""Share of the pixels that must be matched after a remedy: a fifth is matched in pictures of different scenes, and 0.39
and more in pairs with the right remedy."""

MIN_SHARE_GAIN = 0.01
"""Increase in that share due to the remedy."""


def _with_tried_remedies(
    findings: tuple[Finding, ...], images: tuple[Image, Image], found: Correspondences
) -> Iterator[Finding]:
    """Yield the findings, without remedies after which a small copy has no plausible map, or no better one."""
    before: float | None = None
    for finding in findings:
        # Exchanged pictures match as well as given, and features show which is the left one.
        if finding.remedy is not None and finding.remedy is not Remedy.SWAP_SIDES:
            before = _share_matched(*images) if before is None else before
            after = _share_matched(*apply_remedy(*images, finding.remedy, found=found))
            helps = after >= max(MIN_PLAUSIBLE_SHARE, before + MIN_SHARE_GAIN)
            yield finding if helps else replace(finding, remedy=None)
        else:
            yield finding


def _share_matched(left: Image, right: Image) -> float:
    """Return the share of the pixels of a small copy that are matched."""
    small = reduced(left, TRIAL_WIDTH_PX), reduced(right, TRIAL_WIDTH_PX)
    return float(np.isfinite(quick_map(*small, reach=0.4)).mean())


def apply_remedy(
    left: npt.ArrayLike, right: npt.ArrayLike, remedy: Remedy, *, found: Correspondences | None = None
) -> tuple[Image, Image]:
    """Apply one remedy to a pair.

    The left image is unchanged, so that everything known about its pixels remains valid, except that swapping exchanges
    the images, ``Remedy.TURN_UPRIGHT`` turns both, and ``Remedy.RECTIFY`` warps both. ``Remedy.RECTIFY`` and
    ``Remedy.LEVEL`` make depth relative, as the cameras are unknown.

    Parameters
    ----------
    left, right
        (H, W), (H, W, 3) or (H, W, 4) images of one size and type.
    remedy
        The remedy of a :class:`Finding`.
    found
        The matches between the images; by default they are found here.

    Returns
    -------
    left, right
        The corrected images, of the same size and type; turned ones have their sides exchanged.

    Raises
    ------
    ValueError
        If the remedy is ``Remedy.SET_RANGE``, which changes matcher settings rather than images; if too few features
        are matched to find the geometry; or if no rectification from the images alone brings the rows much closer.
    """
    left, right = as_stereo_pair(left, right)
    match remedy:
        case Remedy.SET_RANGE:
            raise ValueError(f"remedy is '{remedy}', which changes the search range of a matcher, not an image.")
        case Remedy.SWAP_SIDES:
            return right, left
        case Remedy.MIRROR_RIGHT:
            return left, np.ascontiguousarray(right[:, ::-1])
    points = find_correspondences(left, right) if found is None else found
    match remedy:
        case Remedy.MATCH_EXPOSURE:
            return left, with_left_exposure(left, right, points)
        case Remedy.TURN_UPRIGHT:
            quarters = quarters_upright(find_views(points))
            return turned(left, quarters), turned(right, quarters)
    if len(points) < MIN_MATCHES:
        raise ValueError(
            f"{len(points)} features were matched between the images; at least {MIN_MATCHES} are needed to align "
            "their rows."
        )
    if remedy is Remedy.RECTIFY:
        model = best_rectification(points)
        if model is None:
            raise ValueError(
                "Rotating the images and removing one lens distortion from both aligns their rows hardly better than "
                "moving, rotating and scaling one of them; calibrate the camera."
            )
        return model.applied(left, right)
    if remedy is Remedy.ALIGN_ROWS:
        transform = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, -median(points.dy)]])
    else:
        transform = _levelling(points)
    return left, np.asarray(cv2.warpAffine(right, transform, right.shape[1::-1], borderMode=cv2.BORDER_REPLICATE))


def _levelling(points: Correspondences) -> DoubleMap:
    """Return the (2, 3) similarity transform about the image centre that makes the rows of the right image match.

    It removes dy, and dx stays unchanged at the centre.
    """
    centre = centre_of(points.shape)
    (central, across, down), _ = vertical_plane(points)
    turn = np.array([[1 - down, across, 0.0], [-across, 1 - down, -central]])
    turn[:, 2] += centre - turn[:, :2] @ centre
    return turn


def _exposure(left: Image, right: Image, points: Correspondences | None) -> tuple[float, float]:
    """Return the gain, and the offset in grey levels, of ``right = gain * left + offset``.

    They are compared around matched points, or as a whole if there are too few: each shows some areas that the other
    does not.
    """
    samples: list[Image] = [as_grey(image).astype(np.float32) for image in (left, right)]
    if points is not None and len(points) >= MIN_MATCHES:
        side = max(5, round(EXPOSURE_SQUARE * left.shape[1]))
        samples = [
            cv2.remap(cv2.blur(grey, (side, side)), at[:, 0], at[:, 1], cv2.INTER_LINEAR).ravel()
            for grey, at in zip(samples, (points.left, points.right), strict=True)
        ]
    deviations = [float(np.std(sample)) for sample in samples]
    gain = deviations[1] / deviations[0] if min(deviations) > 0 else 1.0
    return gain, float(np.mean(samples[1]) - gain * np.mean(samples[0]))


def with_left_exposure(left: Image, right: Image, points: Correspondences | None) -> Image:
    """Return the right image with its brightness and contrast fitted to the left image's, in its own dtype."""
    gain, offset = _exposure(left, right, points)
    fitted = (right.astype(np.float64) - offset) / gain
    if right.ndim == 3 and right.shape[2] == 4:
        fitted[:, :, 3] = right[:, :, 3]
    if right.dtype.kind != "f":
        limits = np.iinfo(right.dtype)
        np.clip(np.rint(fitted, out=fitted), limits.min, limits.max, out=fitted)
    return fitted.astype(right.dtype)
