"""The arrangement of two views, recognised from the pictures themselves.

Both views may be in one picture, which is then divided; or two pictures may be mirrored, of cameras above each other,
of two moments, or of a repeating scene.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.assess.features import MIN_MATCHES, Correspondences
from stereolag.assess.orientation import (
    MIN_EVIDENCE,
    MIN_NOISE_PX,
    find_correspondences,
    fundamental_matrix,
    match_noise,
    robust_fit,
    row_spread,
    row_terms,
    vertical_plane,
)
from stereolag.assess.search_range import quick_map, reduced
from stereolag.assess.uncalibrated import centre_of, fit_rectification
from stereolag.core.arrays import DoubleMap, median
from stereolag.core.inputs import Image, as_eight_bit, as_grey, local_deviation
from stereolag.stereo.opencv import StereoSGBM


class Layout(StrEnum):
    """Arrangement of both views in one picture; "half" views are squeezed to half their width or height."""

    BESIDE = "beside"
    HALF_BESIDE = "half-beside"
    OVER_UNDER = "over-under"
    HALF_OVER_UNDER = "half-over-under"


def views(image: Image, layout: Layout, *, crossed: bool = False) -> tuple[Image, Image]:
    """Return the left and the right view of a picture; squeezed views are stretched to their original shape.

    Parameters
    ----------
    image
        A checked image. If its width or height is odd, the middle column or row is left out.
    crossed
        Whether the right view comes first, as in JPS files for cross-eyed viewing.

    Raises
    ------
    ValueError
        An image with only one column or row to divide.
    """
    across = layout in (Layout.BESIDE, Layout.HALF_BESIDE)
    half = image.shape[int(across)] // 2
    if half == 0:
        raise ValueError(f"The image is 1 pixel {'wide' if across else 'high'}; at least 2 are needed for both views.")
    two = (image[:, :half], image[:, -half:]) if across else (image[:half], image[-half:])
    if layout in (Layout.HALF_BESIDE, Layout.HALF_OVER_UNDER):
        height, width = two[0].shape[:2]
        size = (2 * width, height) if across else (width, 2 * height)
        two = tuple(np.asarray(cv2.resize(one, size, interpolation=cv2.INTER_LINEAR)) for one in two)  # type: ignore[assignment]
    return two[::-1] if crossed else two


def without_margins(image: Image, layout: Layout) -> Image:
    """Return a picture of two views without a frame around both or a gap between them, which displace one of them.

    These are blank lines that leave views of one size; dark parts of a scene leave different sizes.
    """
    across = layout in (Layout.BESIDE, Layout.HALF_BESIDE)
    beside = image if across else image.swapaxes(0, 1)
    half = beside.shape[1] // 2
    halves = [_filled(part, 0) for part in (beside[:, :half], beside[:, -half:])]
    sizes = [part.stop - part.start for part in halves]
    if halves[0] == halves[1] or max(sizes) - min(sizes) > MAX_MARGIN_ERROR_PX:
        return image
    starts = halves[0].start, beside.shape[1] - half + halves[1].start
    left, right = (beside[:, start : start + min(sizes)] for start in starts)
    both = np.concatenate([left, right], axis=1)
    both = both[_filled(both, 1)]
    return np.ascontiguousarray(both if across else both.swapaxes(0, 1))


def _filled(image: Image, axis: int) -> slice:
    """Return the lines along an axis of a picture, from the first that is not blank to the last; all if all are."""
    grey, _ = as_eight_bit(as_grey(image), as_grey(image))
    filled = np.flatnonzero(np.ptp(grey, axis=axis) > MAX_BLANK_GREYS)
    return slice(int(filled[0]), int(filled[-1]) + 1) if filled.size else slice(0, grey.shape[1 - axis])


class Anaglyph(ValueError):  # noqa: N818
    """Error for a picture whose views are in its colours."""


MAX_BLANK_GREYS = 8
"""Largest difference of grey levels along a blank line; JPEG is not exact."""

MAX_MARGIN_ERROR_PX = 2
"""Difference of sizes without margins up to which they are one size, px; JPEG blurs the ends."""

LAYOUT_WIDTH_PX = 240
"""Width to which views are reduced to determine the layout, px."""

LAYOUT_REACH_PX = 48
"""Reach of the search to either side in these views, px; pictures made for screens often have 0 in the middle."""

MIN_TEXTURE = 3.0
"""Standard deviation around a pixel, grey levels, from which it is textured."""

MIN_TEXTURED_SHARE = 0.05
"""Share of textured pixels below which nothing counts as matched."""

MIN_MATCHED_SHARE = 0.45
"""Share of the textured pixels that are matched in two views of one scene; 0.1 to 0.35 are matched by chance."""

MIN_REPEATING_SHARE = 0.35
"""Share matched between the halves of a view from which its scene repeats itself, as a wall of windows does."""

MAX_UNMATCHED_RATIO = 0.5
"""Unmatched pixels of two views of a repeating scene, as a share of those between the halves of one view."""

MAX_ASPECT = 4.0
"""Largest width over height of a view."""

HALF_WIDTH_ASPECTS, HALF_HEIGHT_ASPECTS = (0.84, 0.94), (2.6, 4.0)
"""Bounds of width over height of views that are half as wide, and half as high, as 16:9."""

MIN_COLOUR_DISPARITY_PX = 1.5
"""Disparity between red and cyan from which a pixel is evidence of an anaglyph, px."""

MIN_COLOUR_SHARE = 0.3
"""Share of such pixels in an anaglyph."""


def likely_layout(image: Image) -> tuple[Layout, bool] | None:
    """Return the layout of a picture, and whether the right view comes first; None if it holds one view only.

    Of the possible divisions, the one under which most pixels are matched is taken. The view that comes first is the
    left one if most points shift to the left in the other view, unless occlusions clearly contradict it: many pictures
    made for screens are cropped until everything is behind the screen. Whether views are squeezed follows from their
    shape alone.

    Raises
    ------
    Anaglyph
        A picture whose views are in its colours.
    """
    layouts = (Layout.BESIDE, Layout.OVER_UNDER) if min(image.shape[:2]) > 3 else ()
    pictures = {layout: without_margins(image, layout) for layout in layouts}
    divided = {layout: views(picture, layout) for layout, picture in pictures.items()}
    matched = {
        layout: _matched(left, right)
        for layout, (left, right) in divided.items()
        if left.shape[1] <= MAX_ASPECT * left.shape[0]
    }
    layout = max(matched, key=lambda one: matched[one][0], default=Layout.BESIDE)
    share, median_disparity = matched.get(layout, (0.0, 0.0))
    if share < MIN_MATCHED_SHARE or _repeats(pictures[layout], layout, share):
        if image.ndim == 3 and _is_anaglyph(image):
            raise Anaglyph(
                "The image is an anaglyph: its views are in its colours, for red and cyan glasses, and differ too much "
                "to be matched. Give both views as they were taken."
            )
        return None
    left, right = divided[layout]
    height, width = left.shape[:2]
    low, high = HALF_WIDTH_ASPECTS if layout is Layout.BESIDE else HALF_HEIGHT_ASPECTS
    if low <= width / height <= high:
        layout = Layout.HALF_BESIDE if layout is Layout.BESIDE else Layout.HALF_OVER_UNDER
    crossed = median_disparity < 0
    order = depth_order(right, left) if crossed else depth_order(left, right)
    return layout, crossed != (order < -MIN_ORDER_SIGMAS)


def _coarse_disparities(
    left: Image, right: Image, reach: int, block_size: int, uniqueness_ratio: int
) -> tuple[npt.NDArray[np.float32], float]:
    """Return the disparities found at the textured pixels of small grey views, and the share of these pixels found.

    None are found if hardly any pixel has texture.
    """
    size = LAYOUT_WIDTH_PX, max(16, round(LAYOUT_WIDTH_PX * left.shape[0] / left.shape[1]))
    small = [cv2.resize(view, size, interpolation=cv2.INTER_AREA) for view in (left, right)]
    matcher = StereoSGBM(
        min_disparity=-reach, num_disparities=2 * reach, block_size=block_size, uniqueness_ratio=uniqueness_ratio
    )
    seen = slice(reach, -reach)
    textured = local_deviation(small[0], 7)[:, seen] > MIN_TEXTURE
    disparities = matcher.compute(*small).disparity[:, seen][textured]
    if textured.mean() < MIN_TEXTURED_SHARE:
        return disparities[:0], 0.0
    known = np.isfinite(disparities)
    return disparities[known], float(known.mean())


def _matched(left: Image, right: Image) -> tuple[float, float]:
    """Return the share of the textured pixels of small views that are matched, and their median disparity, px."""
    greys = as_eight_bit(as_grey(left), as_grey(right))
    disparities, share = _coarse_disparities(*greys, LAYOUT_REACH_PX, block_size=7, uniqueness_ratio=10)
    return share, median(disparities) if disparities.size else 0.0


def _repeats(image: Image, layout: Layout, share: float) -> bool:
    """Return whether both views, which match at this share, are hardly more alike than the halves of each view."""
    share_of_halves = max(_matched(*views(view, layout))[0] for view in views(image, layout))
    return share_of_halves > MIN_REPEATING_SHARE and 1 - share > MAX_UNMATCHED_RATIO * (1 - share_of_halves)


def _is_anaglyph(image: Image) -> bool:
    """Return whether red shows another view than green and blue; in a single view, all colours coincide."""
    red, cyan = (cv2.equalizeHist(one) for one in as_eight_bit(image[:, :, 0], image[:, :, 1]))
    disparities, share = _coarse_disparities(red, cyan, LAYOUT_REACH_PX // 2, block_size=11, uniqueness_ratio=5)
    if share <= MIN_MATCHED_SHARE:
        return False
    return bool((np.abs(disparities) > MIN_COLOUR_DISPARITY_PX).mean() > MIN_COLOUR_SHARE)


def in_words(image: Image, layout: Layout, *, crossed: bool) -> str:
    """Return how a picture was divided."""
    across = layout in (Layout.BESIDE, Layout.HALF_BESIDE)
    side = image.shape[int(across)]
    said = [f"The image was split {'down the middle' if across else 'into its upper and lower halves'}."]
    if (seen := without_margins(image, layout).shape[int(across)]) != side:
        said.append(f"Blank margins are left out: {seen} of {side} px remain.")
        side = seen
    if side % 2:
        name, line = ("width", "column") if across else ("height", "row")
        said.append(f"Its {name} of {side} px is odd: the middle {line} is left out.")
    if layout in (Layout.HALF_BESIDE, Layout.HALF_OVER_UNDER):
        said.append(f"The views were squeezed, and are stretched to twice their {'width' if across else 'height'}.")
    if crossed:
        said.append("The right view comes first.")
    return " ".join(said)


# Two pictures: mirrored, of cameras above each other, of two moments, of a repeating scene.

MAX_MIRRORED_MATCHES = 400
"""With this number of agreeing features or more, the right picture cannot be mirrored."""

MIN_MIRROR_RATIO = 2.5
"""Ratio of the agreeing features of a mirrored picture, once it is mirrored back, to those of the picture as given."""

MAX_COLUMN_RATIO = 0.35
"""Cameras stand above each other if the scatter of columns is below this share of the scatter of rows."""

MIN_PARALLAX_PX = 1.0
"""Scatter of rows due to cameras above each other, px at the size at which features were matched."""

MAX_EPIPOLE_DISTANCE = 1.5
"""Distance of an epipole from the centre, image widths or heights, up to which one picture was taken from farther
ahead: two cameras side by side turned that far would not see a common scene."""

MIN_EPIPOLE_SCATTER_PX = 0.35
"""Scatter of rows from which an epipole is looked for, px."""

MIN_EPIPOLAR_SHARE = 0.8
"""Share of the matches that must be near their epipolar lines."""

MAX_EPIPOLAR_PX = 1.5
"""Distance from its epipolar line up to which a match agrees, px at the size at which features were matched."""

MAX_EPIPOLAR_TRIALS = 2000
"""Largest number of samples of matches drawn to find epipolar lines or a homography."""

MIN_FLAT_SHARE = 0.95
"""Share of the matches that fit one homography, above which the position of the other camera is unknown: the rest may
be wrong matches."""

MIN_ROTATION_SHARE = 0.5
"""Share of the matches that fit one homography, above which a rotation is tried: a lens bends the others."""

ROTATION_FOCALS = (0.3, 2.5)
"""Bounds of the focal length of a rotated camera, image widths: with a longer one, a rotation hardly differs from a
shift; a camera that moves forwards fits a rotation with a far shorter one."""

MAX_ROTATION_RATIO = 1.5
"""Spread of the residuals of a rotation, over the noise of the matches, up to which it explains them: up to 1.2 for
simulated matches, 1.4 for resampled pictures."""

OCCLUSION_WIDTH_PX = 640
"""Width to which a pair is reduced to find occlusions, px."""

MIN_OCCLUSION_STEP_PX = 3.0
"""Step of the disparity beside a strip that only one view shows, px."""

MAX_WIDTH_DEVIATION = 0.4
"""Largest difference between the width of such a strip and the step, as a share of the step."""

EDGE_WINDOW_PX = 7
"""Width in which the edge of an occlusion is looked for, px."""

NOISE_GREYS = 4.0
"""Difference that is only noise, grey levels."""

MIN_STRIP_VOTE = 0.6
"""Sum of both cues of a strip, each from -1 to 1, above which the strip votes."""

MIN_ORDER_SIGMAS = 5.0
"""Standard deviations of the sum of votes above which it is certain: the lowest of 195 pairs in the right order has
-3.8."""

MIN_REPEAT_CORRELATION = 0.7
"""Correlation of a picture with itself from which it repeats along its rows."""

MIN_PEAK_RATIO = 0.9
"""Share of the highest correlation from which another peak counts as equal."""

REPETITION_WIDTH_PX = 320
"""Width to which a picture is reduced before repetition is looked for, px."""


@dataclass(frozen=True)
class Epipole:
    """The image of one camera in the picture of the other.

    Attributes
    ----------
    x, y
        Its position in the left picture, in widths and heights from the top left corner; 0.5, 0.5 is the centre.
    """

    x: float
    y: float

    @property
    def inside(self) -> bool:
        """Return whether it is in the picture."""
        return 0 <= self.x <= 1 and 0 <= self.y <= 1


def mirrored_matches(left: Image, right: Image, found: int) -> int:
    """Return the number of features that agree once the right picture is mirrored; 0 unless many more than `found`.

    Parameters
    ----------
    found
        Number of features that agree with the right picture as given. The mirrored one is not tried if there are
        ``MAX_MIRRORED_MATCHES`` or more.
    """
    if found >= MAX_MIRRORED_MATCHES:
        return 0
    mirrored = len(find_correspondences(left, np.ascontiguousarray(right[:, ::-1])))
    return mirrored if mirrored >= max(MIN_MATCHES, MIN_MIRROR_RATIO * found) else 0


@dataclass(frozen=True, eq=False)
class Views:
    """Epipolar geometry of two views, not necessarily side by side.

    Attributes
    ----------
    points
        The matches on the epipolar lines of one fundamental matrix (MAGSAC++, Barath et al. 2020).
    epipole
        The image of the right camera in or near the left picture, otherwise None. For cameras side by side it is far
        beyond the picture's sides; between two moments of a moving camera, points move away from it.
    """

    points: Correspondences
    epipole: Epipole | None

    @property
    def above_each_other(self) -> bool:
        """Return whether depth displaces points along the columns instead of the rows."""
        points = self.points
        transposed = Correspondences(points.left[:, ::-1], points.right[:, ::-1], points.shape[::-1], points.scale)
        rows, columns = _scatter(points), _scatter(transposed)
        return rows > MIN_PARALLAX_PX and columns < MAX_COLUMN_RATIO * rows


def _scatter(points: Correspondences) -> float:
    """Return the scatter of the rows of matches, px at the size at which features were matched."""
    return row_spread(vertical_plane(points)[1]) * points.scale


def find_views(found: Correspondences) -> Views | None:
    """Return the epipolar geometry of two views; None with too few matches.

    Parameters
    ----------
    found
        Matches from :func:`~stereolag.assess.orientation.find_correspondences`. Their candidates are taken if there
        are any, since the matches were selected by their rows. For the same reason a slow motion is looked for in the
        matches of any rows.
    """
    views = _views_of(found if found.candidates is None else found.candidates)
    if views is None or views.epipole is not None or found.of_any_rows is None:
        return views
    moving = _views_of(found.of_any_rows, nearly_rectified=True)
    return views if moving is None or moving.epipole is None else moving


def _views_of(points: Correspondences, *, nearly_rectified: bool = False) -> Views | None:
    """Return the epipolar geometry of some matches.

    Nearly rectified ones have an epipole only if its lines explain them better than cameras side by side.
    """
    if len(points) < MIN_MATCHES:
        return None
    lines, agreeing = fundamental_matrix(points, MAX_EPIPOLAR_PX, MAX_EPIPOLAR_TRIALS)
    if lines is None or agreeing.mean() < MIN_EPIPOLAR_SHARE or agreeing.sum() < MIN_MATCHES:
        return None
    chosen = points.chosen(agreeing)
    column, row, depth = np.linalg.svd(lines)[2][2]
    height, width = points.shape
    if _scatter(chosen) < MIN_EPIPOLE_SCATTER_PX or abs(depth) < 1e-12:
        return Views(chosen, None)
    epipole = Epipole(float(column / depth / width), float(row / depth / height))
    near = max(abs(epipole.x - 0.5), abs(epipole.y - 0.5)) < MAX_EPIPOLE_DISTANCE
    explains = near and (not nearly_rectified or _explained_by_lines(chosen, lines)) and not fits_homography(chosen)
    return Views(chosen, epipole if explains else None)


def _explained_by_lines(points: Correspondences, lines: DoubleMap) -> bool:
    """Return whether epipolar lines explain matches better than slightly turned cameras side by side with a lens.

    The distortion of a strong lens also leads to epipolar lines, which may meet anywhere.
    """
    left, right = (np.column_stack([view, np.ones(len(points))]) for view in (points.left, points.right))
    through = left @ lines.T
    from_lines = (through * right).sum(axis=1) / np.hypot(through[:, 0], through[:, 1])
    terms, dy = row_terms(points), points.dy.astype(np.float64)
    noise = max(MIN_NOISE_PX, row_spread(from_lines))
    from_rows = dy - terms @ robust_fit(terms, dy)
    row_misfit, line_misfit = (np.log1p((residuals / noise) ** 2) for residuals in (from_rows, from_lines))
    return float((row_misfit - line_misfit).sum()) > MIN_EVIDENCE


def fits_homography(points: Correspondences, share: float = MIN_FLAT_SHARE) -> bool:
    """Return whether more than this share of the matches fits one homography: of a rotated camera, or of a plane.

    Such matches show neither the position of the other camera nor the order in depth.
    """
    tolerance = MAX_EPIPOLAR_PX / points.scale
    _, fits = cv2.findHomography(points.left, points.right, cv2.USAC_MAGSAC, tolerance, maxIters=MAX_EPIPOLAR_TRIALS)
    return fits is not None and float(np.mean(fits)) > share


def pure_rotation_deg(points: Correspondences) -> float:
    """Return the angle between two pictures of one camera that only turned, degrees; 0 if that is not certain.

    A rotation explains all matches up to their noise, and better than an affine map and a lens do, which explain a
    plane seen by rectified cameras. Turned cameras may see a plane as one camera does that only turned.
    """
    if len(points) < MIN_MATCHES or not fits_homography(points, MIN_ROTATION_SHARE):
        return 0.0
    rotation = fit_rectification(points, lens=True, depth=False)
    errors = rotation.errors(points)
    agreeing = float(np.mean(np.hypot(*errors.T) * points.scale < MAX_EPIPOLAR_PX))
    noise = max(MIN_NOISE_PX, match_noise(points, errors[:, 1]))
    left, right = ((one - centre_of(points.shape)) / points.shape[1] for one in (points.left, points.right))
    lens = right * (right**2).sum(axis=1, keepdims=True) - left * (left**2).sum(axis=1, keepdims=True)
    affine = np.kron(np.eye(2), np.column_stack([np.ones(len(points)), left]))
    terms = np.column_stack([affine, lens.T.ravel()])
    displacement = np.concatenate([points.dx, points.dy]).astype(np.float64)
    plane_errors = displacement - terms @ robust_fit(terms, displacement)
    gain = np.log1p((plane_errors / noise) ** 2).sum() - np.log1p((errors / noise) ** 2).sum()
    only_noise = row_spread(errors.ravel()) < MAX_ROTATION_RATIO * noise
    plausible = ROTATION_FOCALS[0] < rotation.focal < ROTATION_FOCALS[1]
    certain = agreeing > MIN_FLAT_SHARE and only_noise and gain > MIN_EVIDENCE and plausible
    return rotation.turn if certain else 0.0


def depth_order(left: Image, right: Image) -> float:
    """Return the evidence that near objects have the larger disparity, standard deviations; negative if the smaller.

    An object hides a strip of its background from one of the cameras. Beside each step of the disparity, such a strip
    resembles the background, and ends at an edge of the object. Each strip, a run of unmatched pixels in one row, has
    a vote; those of adjoining rows are not independent.
    """
    votes = []
    views = [reduced(view, OCCLUSION_WIDTH_PX) for view in as_eight_bit(as_grey(left), as_grey(right))]
    for view, other in (views, [np.ascontiguousarray(view[:, ::-1]) for view in views[::-1]]):
        disparity, grey, width = quick_map(view, other).ravel(), view.astype(np.float64), view.shape[1]
        known = np.flatnonzero(np.isfinite(disparity))
        before, after = known[:-1], known[1:]
        strip, step = after - before - 1, disparity[after] - disparity[before]
        inside = (before // width == after // width) & (before % width >= strip) & (after % width + strip < width)
        as_wide = np.abs(strip - step) <= 1 + MAX_WIDTH_DEVIATION * step
        chosen = inside & (step >= MIN_OCCLUSION_STEP_PX) & as_wide
        before, after, strip = before[chosen], after[chosen], strip[chosen]
        sums = np.append(0.0, np.cumsum(grey))
        low, hidden, high = ((sums[end] - sums[end - strip]) / strip for end in (before + 1, after, after + strip))
        edges = cv2.dilate(np.abs(np.gradient(grey, axis=1)), np.ones((1, EDGE_WINDOW_PX))).ravel()
        cues = (np.abs(hidden - high), np.abs(hidden - low)), (edges[after], edges[before])
        votes.append(sum((pro - contra) / (pro + contra + NOISE_GREYS) for pro, contra in cues))
    every = np.concatenate(votes)
    clear = every[np.abs(every) > MIN_STRIP_VOTE]
    return float(np.sign(clear).sum()) / math.sqrt(max(1, clear.size))


def repetition(image: Image) -> float:
    """Return the distance at which a picture repeats along its rows, px; 0 if it does not.

    The autocorrelation of the picture's details along the rows first falls below half of ``MIN_REPEAT_CORRELATION``,
    and then reaches it.
    """
    scale = min(1.0, REPETITION_WIDTH_PX / image.shape[1])
    size = max(16, round(image.shape[1] * scale)), max(16, round(image.shape[0] * scale))
    grey = cv2.resize(as_grey(image).astype(np.float32), size, interpolation=cv2.INTER_AREA)
    detail = grey - cv2.blur(grey, (size[0] // 6 * 2 + 1, 1))
    lags = size[0] // 2
    correlation = np.ones(lags)
    for lag in range(1, lags):
        one, other = detail[:, :-lag].ravel(), detail[:, lag:].ravel()
        correlation[lag] = float(one @ other) / (float(np.sqrt((one @ one) * (other @ other))) + 1e-12)
    low = np.flatnonzero(correlation < MIN_REPEAT_CORRELATION / 2)
    if not low.size or correlation[low[0] :].max() < MIN_REPEAT_CORRELATION:
        return 0.0
    later = correlation[low[0] :]
    # Every multiple of the distance fits as well: take the first of the highest peaks.
    high = np.flatnonzero(later >= MIN_PEAK_RATIO * later.max())
    end = int(np.append(np.flatnonzero(np.diff(high) > 1), high.size - 1)[0])
    first_peak = high[: end + 1]
    return float((low[0] + first_peak[np.argmax(later[first_peak])]) / scale)
