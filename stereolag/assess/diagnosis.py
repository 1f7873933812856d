"""The input doctor: the findings on a stereo pair, as codes and numbers, and their remedies."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.assess.features import FEWEST_MATCHES, Correspondences
from stereolag.assess.findings import (
    BENT_PX,
    SURE_SHARE,
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
    SURE_ORDER,
    Anaglyph,
    depth_order,
    find_views,
    flat,
    likely_layout,
    mirrored_matches,
    repetition,
    turned_alone,
)
from stereolag.assess.orientation import (
    LENS_LEFT,
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
from stereolag.assess.uncalibrated import centre_of
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

TEXTURE_WINDOW = 11
"""Side of the windows in which texture is judged, px."""

FLAT_DEVIATION = 0.01
"""A window has hardly any texture if its standard deviation is below this share of the image's grey-level range."""

SURROUNDINGS = 1 / 15
"""Side of the squares in which brightness is compared, as a share of the width: a view that is out of focus is not
darker, nor has less contrast there."""

MOST_TURNED = 45.0
"""Degrees between both pictures beyond which nothing else is told of their geometry before they are level."""

SURELY = 2.0
"""Standard deviations from 0 at which the sign of a disparity is certain."""


@dataclass(frozen=True)
class Diagnosis:
    """The findings of the input doctor on a pair.

    Attributes
    ----------
    findings
        One per question, in the order in which they should be fixed. The geometry (SWAPPED, ROWS, ROTATION, BENT_ROWS)
        is omitted with too few matched features, all but ROTATION if one image is on its side or upside down. LAYOUT is
        asked only if another finding is ill; of a pair whose geometry is healthy the answer is known, as a wall of
        bricks resembles itself. Arrangement (MIRRORED to NOT_SAME_MOMENT), geometry and range are omitted for identical
        pictures; geometry and range also for an arrangement that is ill, and the range if the sides are swapped or it
        cannot be determined. A remedy is offered only if a small copy of the pair has a plausible map after it, and a
        better one than before.
    disparities
        The range of disparities in the pair as given, px, from a coarse semi-global search over 40 % of the width and
        from the matched features; None if it cannot be determined.
    suggested_range
        First disparity and number of disparities, a multiple of 16, of a search that covers them with a modest margin;
        None if it cannot be determined.
    repeats_px
        Distance at which the left image repeats along its rows, px; 0 if it does not. A wider search finds each point
        more than once.

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

        A search wider than needed only takes longer, unless it finds points of a repeating picture more than once.
        """
        misleading = ("missing_px", "repeats_px")
        return tuple(one for one in self.ill if one.code != FindingCode.RANGE or any(map(one.numbers.get, misleading)))

    def finding(self, code: FindingCode) -> Finding | None:
        """Return the finding on one question; None if it could not be judged."""
        return next((finding for finding in self.findings if finding.code == code), None)

    def over(self, searched: tuple[int, int] | None) -> Diagnosis:
        """Return the diagnosis with another search range judged: first disparity and their number, px; None: none."""
        rest = tuple(finding for finding in self.findings if finding.code != FindingCode.RANGE)
        judged = None if searched is None else judge_range(self, *searched)
        return replace(self, findings=rest if judged is None else (*rest, judged))


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
    check_memory(estimate_diagnosis(images[0].shape, images[0].dtype))
    found = find_correspondences(*images)
    points = found if len(found) >= FEWEST_MATCHES else None
    grey, other = (as_grey(image) for image in images)
    darkest, brightest = percentiles(grey, 1, 99)
    range_of_greys = max(float(brightest - darkest), 1e-6)
    difference = float(np.mean(np.abs(other.astype(np.float32) - grey.astype(np.float32)))) / range_of_greys
    moved = None if points is None else percentiles(np.hypot(points.dx, points.dy), 95).item()
    identical = judge_identical(difference, moved, found.scale)
    arrangement = _judge_arrangement(images, found) if identical.healthy else ()
    upright = identical.healthy and all(finding.healthy for finding in arrangement)
    geometry = _judge_geometry(images, points) if points is not None and upright else ()
    sides_known = not geometry or any(one.healthy for one in geometry if one.code == FindingCode.SWAPPED)
    seen = coarse_range(images[0], exposed_alike(*images, points), points) if upright and sides_known else None
    findings = (
        judge_matches(len(found)),
        identical,
        *arrangement,
        *geometry,
        judge_exposure(*_exposure(*images, points), (float(darkest), float(brightest))),
        judge(FindingCode.TEXTURE, flat_share=_flat_share(grey, range_of_greys)),
        judge(FindingCode.EMPTY_BORDER, left_share=_border_share(images[0]), right_share=_border_share(images[1])),
    )
    if any(not finding.healthy for finding in findings):
        divided = None
        if not (geometry and all(finding.healthy for finding in geometry)):  # else they are two views
            with suppress(Anaglyph):  # both views are in its colours
                divided = likely_layout(images[0])
        layout = judge_layout(divided and divided[0])
        if layout.healthy:
            findings = tuple(_worth_offering(findings, images, found))
        else:  # nothing else is to be mended
            seen, findings = None, tuple(replace(one, remedy=None) for one in findings)
        findings = *findings[:2], layout, *findings[2:]
    repeats = repetition(images[0]) if seen is not None else 0.0
    width = images[0].shape[1]
    examined = Diagnosis(findings, seen, None if seen is None else range_for(*seen, width, repeats), repeats)
    return examined.over((min_disparity, num_disparities))


def _judge_arrangement(images: tuple[Image, Image], found: Correspondences) -> tuple[Finding, ...]:
    """Judge whether the pictures are of two cameras side by side, at one moment, and the same way round."""
    count = mirrored_matches(*images, len(found))
    mirrored = judge(FindingCode.MIRRORED, Remedy.MIRROR_RIGHT, count=count)
    if not mirrored.healthy:
        return (mirrored,)
    angle = turned_alone(found)
    views = None if angle else find_views(found)
    if views is None:
        return mirrored, judge(FindingCode.ABOVE_EACH_OTHER, quarters=0), *judge_moments(None, angle)
    above = views.above_each_other
    quarters = quarters_upright(found) if above else 0
    stand = judge(FindingCode.ABOVE_EACH_OTHER, Remedy.TURN_UPRIGHT, quarters=quarters)
    return mirrored, stand, *judge_moments(None if above else views.epipole)


def quarters_upright(found: Correspondences) -> int:
    """Return the quarters of a turn, counter-clockwise, that bring cameras above each other side by side.

    The upper camera sees points lower in its picture, and is to become the left one.
    """
    views = find_views(found)
    return 1 if views is None or median(views.points.dy) < 0 else -1


def _border_share(image: Image) -> float:
    """Return the share of the pixels that no camera took, as for the matchers: transparent, or black up to the rim."""
    outside = transparent(with_border_transparent(image))
    return 0.0 if outside is None else float(outside.mean())


def _flat_share(grey: Image, range_of_greys: float) -> float:
    """Return the share of the pixels in surroundings with hardly any texture, a sky aside.

    A sky is flat, touches the upper edge and lies in the upper half: it is far away whatever is measured there.
    """
    flat = local_deviation(grey, TEXTURE_WINDOW) < FLAT_DEVIATION * range_of_greys
    count, parts = cv2.connectedComponents(flat.astype(np.uint8), connectivity=4)
    above = np.zeros(count, np.bool_)
    above[parts[0]] = True
    above[0] = False
    sky = above[parts]
    sky[flat.shape[0] // 2 :] = False
    ground = flat.size - int(np.count_nonzero(sky))
    return float(np.count_nonzero(flat & ~sky)) / max(1, ground)


def estimate_diagnosis(shape: tuple[int, ...], dtype: npt.DTypeLike = np.uint8) -> Estimate:
    """Return the memory and time of :func:`diagnose` for two images of a shape, channels included, and dtype.

    Every channel of the right image is fitted to the left one's exposure in float64; measuring texture takes maps in
    float64. Features and coarse search cost the same at any size.
    """
    pixels, values = shape[0] * shape[1], int(np.prod(shape))
    copy = values * np.dtype(dtype).itemsize
    return COSTS["diagnosis"].estimate(pixels=pixels, values=values, copy=copy, searches=1)


def judge_range(diagnosis: Diagnosis, min_disparity: int, num_disparities: int) -> Finding | None:
    """Judge another search range, px, for a pair that has been examined; None if the sides or the range are unknown."""
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
    bent, noise, ends = row_spread(residuals), match_noise(points, residuals), percentiles(residuals, 2, 98)
    bend = float(np.std(grid))
    doubted = max(bent, bend) * points.scale > BENT_PX or abs(lens) > LENS_LEFT
    straight = best_rectification(points) if doubted else None
    if bend > bent and (straight is not None or lens):
        bent, ends = bend, percentiles(grid, 2, 98)
    rows = judge_bent_rows(
        bent,
        noise if straight is None else min(noise, straight.spread_px),
        (float(ends[0]), float(ends[1])),
        points.scale,
        None if straight is None else (straight.spread_px, straight.lens),
        lens=lens,
    )
    # The remedy for bent rows also corrects offset and rotation; that for a rotation also the offset.
    turns = {"rotation_deg": math.degrees(math.atan2(across, 1 - down)), "scale": 1 / math.hypot(across, 1 - down)}
    rotation = judge(FindingCode.ROTATION, Remedy.LEVEL if rows.remedy is None else None, **turns)
    if abs(turns["rotation_deg"]) > MOST_TURNED:
        return (rotation,)
    if not rotation.healthy:  # the median of the matches would tell where they are, off the centre of the rotation
        offset = float(central)
    alone = rows.remedy is None and rotation.healthy
    moved = judge(FindingCode.ROWS, Remedy.ALIGN_ROWS if alone else None, offset_px=offset, spread_px=spread)
    if straight is None or rows.remedy is None:
        sides = judge_sides(*disparities_of(points))
        if not sides.healthy:
            left, right = apply_remedy(images[0], exposed_alike(*images, points), Remedy.LEVEL, found=points)
            if depth_order(right, left) < -SURE_ORDER:  # pictures were cropped, or cameras turned: infinity is below 0
                sides = replace(sides, healthy=True, remedy=None)
        return sides, moved, rotation, rows
    disparities, deviations = straight.disparities(points)
    lowest, highest = percentiles(disparities, 2, 98)
    shares = [float(np.mean(side * disparities > SURELY * deviations)) for side in (1, -1)]
    in_front, behind = (0.0, 0.0) if max(shares) > SURE_SHARE and flat(points) else shares
    sides = judge_raw_sides(float(lowest), float(highest), in_front, behind)
    return sides, moved, rotation, rows


TRIED_WIDTH, TRIED_NEAREST = 640, 0.4
"""Width to which a pair is reduced to try a remedy, px, and the reach of that search, as a share of it."""

PLAUSIBLE, BETTER = 0.35, 0.01
"""Least share of the pixels that are matched after a remedy, and by how much it must have risen: a fifth is matched in
pictures of different scenes, and 0.39 and more in pairs that are mended."""


def _worth_offering(
    findings: tuple[Finding, ...], images: tuple[Image, Image], found: Correspondences
) -> Iterator[Finding]:
    """Yield the findings, without the remedies that lead to no plausible map of a small copy, better than as given."""
    before: float | None = None
    for finding in findings:
        # Swapped pictures are matched as well as given, and features tell which is the left one.
        if finding.remedy is not None and finding.remedy is not Remedy.SWAP_SIDES:
            before = _share_matched(*images) if before is None else before
            after = _share_matched(*apply_remedy(*images, finding.remedy, found=found))
            if after < max(PLAUSIBLE, before + BETTER):
                yield replace(finding, remedy=None)
                continue
        yield finding


def _share_matched(left: Image, right: Image) -> float:
    """Return the share of the pixels of a small copy that are matched."""
    small = reduced(left, TRIED_WIDTH), reduced(right, TRIED_WIDTH)
    return float(np.isfinite(quick_map(*small, TRIED_NEAREST)).mean())


def apply_remedy(
    left: npt.ArrayLike, right: npt.ArrayLike, remedy: Remedy, *, found: Correspondences | None = None
) -> tuple[Image, Image]:
    """Apply one remedy to a pair.

    The left image is unchanged, so that everything known about its pixels remains valid, except that swapping exchanges
    the images, ``Remedy.TURN_UPRIGHT`` turns both, and ``Remedy.RECTIFY`` warps both. That and ``Remedy.LEVEL`` make
    depth relative, as the cameras are unknown.

    Parameters
    ----------
    left, right
        (H, W), (H, W, 3) or (H, W, 4) images of one size and type.
    remedy
        The remedy of a :class:`Finding`.
    found
        The matches between the images; by default they are looked for.

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
    if remedy is Remedy.SET_RANGE:
        raise ValueError(f"remedy is '{remedy}', which changes the search range of a matcher, not an image.")
    if remedy is Remedy.SWAP_SIDES:
        return right, left
    if remedy is Remedy.MIRROR_RIGHT:
        return left, np.ascontiguousarray(right[:, ::-1])
    points = find_correspondences(left, right) if found is None else found
    if remedy is Remedy.MATCH_EXPOSURE:
        return left, exposed_alike(left, right, points)
    if remedy is Remedy.TURN_UPRIGHT:
        quarters = quarters_upright(points)
        return turned(left, quarters), turned(right, quarters)
    if len(points) < FEWEST_MATCHES:
        raise ValueError(
            f"{len(points)} features were matched between the images; at least {FEWEST_MATCHES} are needed to align "
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
    size = right.shape[1], right.shape[0]
    return left, np.asarray(cv2.warpAffine(right, transform, size, borderMode=cv2.BORDER_REPLICATE))


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

    They are compared around matched points, or as a whole if there are too few: the rims show different things.
    """
    samples: list[Image] = [as_grey(image).astype(np.float32) for image in (left, right)]
    if points is not None and len(points) >= FEWEST_MATCHES:
        side = max(5, round(SURROUNDINGS * left.shape[1]))
        samples = [
            cv2.remap(cv2.blur(grey, (side, side)), where[:, 0], where[:, 1], cv2.INTER_LINEAR).ravel()
            for grey, where in zip(samples, (points.left, points.right), strict=True)
        ]
    deviation = [float(np.std(sample)) for sample in samples]
    gain = deviation[1] / deviation[0] if min(deviation) > 0 else 1.0
    return gain, float(np.mean(samples[1]) - gain * np.mean(samples[0]))


def exposed_alike(left: Image, right: Image, points: Correspondences | None) -> Image:
    """Return the right image with its brightness and contrast fitted to the left image's, in its own dtype."""
    gain, offset = _exposure(left, right, points)
    fitted = (right.astype(np.float64) - offset) / gain
    if right.ndim == 3 and right.shape[2] == 4:
        fitted[:, :, 3] = right[:, :, 3]
    if right.dtype.kind != "f":
        limits = np.iinfo(right.dtype)
        np.clip(np.rint(fitted, out=fitted), limits.min, limits.max, out=fitted)
    return fitted.astype(right.dtype)
