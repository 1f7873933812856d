"""How views are arranged, seen in the pictures themselves before anything is matched densely.

Both in one picture, and how it is divided; or in two that are mirrored, above each other, of two moments, or repeating.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import cv2
import numpy as np

from stereolag.assess.features import FEWEST_MATCHES, Correspondences
from stereolag.assess.orientation import (
    EVIDENCE,
    LEAST_NOISE_PX,
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
    """How both views stand in one picture; "half" ones are squeezed to half of their width or height."""

    BESIDE = "beside"
    HALF_BESIDE = "half-beside"
    OVER_UNDER = "over-under"
    HALF_OVER_UNDER = "half-over-under"


def views(image: Image, layout: Layout, *, crossed: bool = False) -> tuple[Image, Image]:
    """Return the left and the right view of a picture, squeezed ones at the shape they were taken in.

    Parameters
    ----------
    image
        A checked image. If its width or height is odd, the middle column or row is left out.
    crossed
        Whether the right view comes first, as in JPS files for crossed eyes.

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


class Anaglyph(ValueError):  # noqa: N818
    """A picture whose views are in its colours."""


LOOKED_AT = 240
"""Px; views of this width show whether they are two of one scene."""

REACH = 48
"""Px of these, forwards and backwards; zero is in the middle of many pictures made for screens."""

TEXTURE, LEAST_TEXTURED = 3.0, 0.05
"""Standard deviation around a pixel, grey levels, from which on it tells something, and the least share of such."""

LEAST_MATCHED = 0.45
"""Share of these that are matched in two views of one scene; 0.1 to 0.35 are by chance."""

REPEATING, LEFT_OVER = 0.35, 0.5
"""Share matched in both halves of a view from which on its scene repeats itself, as a wall of windows does; two views
then leave at most this share of what they leave unmatched."""

WIDEST = 4.0
"""Largest width over height of a view."""

SQUEEZED = (0.84, 0.94), (2.6, 4.0)
"""Width over height of views that are half as wide, or half as high, as those of 16:9."""

DEEP, LEAST_DEEP = 1.5, 0.3
"""Px of disparity between red and cyan, and the share of the pixels that have more, which make an anaglyph."""


def likely_layout(image: Image) -> tuple[Layout, bool] | None:
    """Return how both views stand in a picture, and whether the right one comes first; None if it holds but one.

    Of the ways to divide it, the one under which most pixels find a partner. The view that comes first is the left one
    if most things shift to the left in the other, unless what hides what surely says otherwise: many pictures made for
    screens are cropped until all is behind them. Whether views are squeezed follows from their shape alone.

    Raises
    ------
    Anaglyph
        A picture whose views are in its colours.
    """
    found = {}
    for layout in (Layout.BESIDE, Layout.OVER_UNDER):
        if min(image.shape[:2]) > 3:
            left, right = views(image, layout)
            if left.shape[1] <= WIDEST * left.shape[0]:
                found[layout] = _matched(left, right)
    layout = max(found, key=lambda one: found[one][0], default=Layout.BESIDE)
    share, middle = found.get(layout, (0.0, 0.0))
    if share < LEAST_MATCHED or _repeats(image, layout, share):
        if image.ndim == 3 and _is_anaglyph(image):
            raise Anaglyph(
                "The image is an anaglyph: its views are in its colours, for red and cyan glasses, and differ too much "
                "to be matched. Give both views as they were taken."
            )
        return None
    left, right = views(image, layout)
    height, width = left.shape[:2]
    low, high = SQUEEZED[layout is Layout.OVER_UNDER]
    if low <= width / height <= high:
        layout = Layout.HALF_BESIDE if layout is Layout.BESIDE else Layout.HALF_OVER_UNDER
    crossed = middle < 0
    return layout, crossed != (depth_order(*((right, left) if crossed else (left, right))) < -SURE_ORDER)


def _matched(left: Image, right: Image) -> tuple[float, float]:
    """Return the share of the pixels of small views that find a partner, and their median disparity, px."""
    size = LOOKED_AT, max(16, round(LOOKED_AT * left.shape[0] / left.shape[1]))
    small = [cv2.resize(one, size, interpolation=cv2.INTER_AREA) for one in as_eight_bit(as_grey(left), as_grey(right))]
    matcher = StereoSGBM(min_disparity=-REACH, num_disparities=2 * REACH, block_size=7, uniqueness_ratio=10)
    seen = slice(REACH, -REACH)
    disparity, textured = matcher.compute(*small).disparity[:, seen], local_deviation(small[0], 7)[:, seen] > TEXTURE
    known = np.isfinite(disparity) & textured
    if textured.mean() < LEAST_TEXTURED or not known.any():
        return 0.0, 0.0
    return float(known.sum() / textured.sum()), median(disparity[known])


def _repeats(image: Image, layout: Layout, share: float) -> bool:
    """Return whether halves, of whose pixels so many match, are hardly more alike than the halves of each of them."""
    halves = [views(one, layout) for one in views(image, layout)]
    again = max(_matched(*two)[0] for two in halves)
    return again > REPEATING and 1 - share > LEFT_OVER * (1 - again)


def _is_anaglyph(image: Image) -> bool:
    """Return whether red is another view than green and blue: of one view, all colours are in one place."""
    red, cyan = (cv2.equalizeHist(one) for one in as_eight_bit(image[:, :, 0], image[:, :, 1]))
    size = LOOKED_AT, max(16, round(LOOKED_AT * image.shape[0] / image.shape[1]))
    small = [cv2.resize(one, size, interpolation=cv2.INTER_AREA) for one in (red, cyan)]
    matcher = StereoSGBM(min_disparity=-REACH // 2, num_disparities=REACH, block_size=11, uniqueness_ratio=5)
    disparity = matcher.compute(*small).disparity[:, REACH // 2 : -REACH // 2]
    known = np.isfinite(disparity)
    return bool(known.mean() > LEAST_MATCHED and (np.abs(disparity[known]) > DEEP).mean() > LEAST_DEEP)


def in_words(image: Image, layout: Layout, *, crossed: bool) -> str:
    """Return how a picture was divided."""
    across = layout in (Layout.BESIDE, Layout.HALF_BESIDE)
    side = image.shape[int(across)]
    said = ["The image was split down the middle." if across else "The image was split into upper and lower half."]
    if side % 2:
        name, line = ("width", "column") if across else ("height", "row")
        said.append(f"Its {name} of {side} px is odd: the middle {line} is left out.")
    if layout in (Layout.HALF_BESIDE, Layout.HALF_OVER_UNDER):
        said.append(f"The views were squeezed, and are stretched to twice their {'width' if across else 'height'}.")
    if crossed:
        said.append("The right view comes first.")
    return " ".join(said)


# Two pictures: mirrored, above each other, of two moments, repeating.

FEW_MATCHES = 400
"""From this number of agreeing features on, both pictures are taken to show the scene the same way round."""

MIRROR_LEAD = 2.5
"""As many times more features agree with a mirrored picture once it is mirrored back."""

VERTICAL_SHARE, LEAST_PARALLAX_PX = 0.35, 1.0
"""Cameras stand above each other if columns scatter by less than this share of what rows do, and rows by more than
this, px at the size at which features were matched."""

FARTHEST_EPIPOLE = 1.5
"""Image widths or heights from the centre up to which an epipole tells that one picture was taken from farther ahead:
cameras of a rig that are turned by so much see no common scene."""

EPIPOLE_ROWS_PX, AGREEING_SHARE = 0.35, 0.8
"""Scatter of the rows from which on an epipole is looked for, and the least share of the matches on epipolar lines."""

FLAT_SHARE = 0.95
"""Share of the matches that follow one homography from which on nothing is known of the other camera's place: the rest
may be wrong matches."""

MOSTLY_FLAT = 0.5
"""Share of the matches that follow one homography from which on a rotation is looked for: a lens bends the others."""

FOCAL = 0.3, 2.5
"""Focal lengths, image widths: from the longer on, a rotation hardly differs from a shift; what goes forward is taken
for a rotation of one far below the shorter."""

NOISE_LEFT = 1.5
"""Spread of what a rotation leaves of the matches, over their noise, up to which it explains them: up to 1.2 are
left of simulated ones, 1.4 of pictures that were resampled."""

EPIPOLE_TRIALS, EPIPOLE_PX = 2000, 1.5
"""Most samples of matches drawn, and the distance from an epipolar line up to which a match agrees, px at the size at
which features were matched."""

HIDDEN_WIDTH = 640
"""Width to which a pair is reduced to see what hides what, px."""

LEAST_STEP, UNEVEN, EDGE_PX, NOISE_GREYS = 3.0, 0.4, 7, 4.0
"""Least step of the disparity beside a strip that only one view shows, px; how far its width may differ from that, as a
share of it; the width in which its edge is looked for, px; and grey levels that tell nothing."""

SURE_VOTE, SURE_ORDER = 0.6, 5.0
"""Sum of both cues of a strip, each from -1 to 1, that counts, and the standard deviations of all that are certain: of
195 pairs with what is in front in front, the lowest has -3.8."""

REPEATS = 0.7
"""Correlation of the picture with itself from which on it repeats along its rows."""

SAME_TOP = 0.9
"""Share of the highest correlation from which on another top is as high."""

REPEATS_WIDTH = 320
"""Width to which a picture is reduced before repetition is looked for, px."""


@dataclass(frozen=True)
class Epipole:
    """The image of one camera in the picture of the other.

    Attributes
    ----------
    x, y
        Its place in the left picture, in widths and heights from the top left corner; 0.5, 0.5 is the centre.
    """

    x: float
    y: float

    @property
    def inside(self) -> bool:
        """Return whether it lies in the picture."""
        return 0 <= self.x <= 1 and 0 <= self.y <= 1


def mirrored_matches(left: Image, right: Image, found: int) -> int:
    """Return how many features of the left picture agree with the mirror image of the right one; 0 if not many more.

    Nothing is tried where ``FEW_MATCHES`` or more are `found` to agree with the right one as it is.
    """
    if found >= FEW_MATCHES:
        return 0
    mirrored = len(find_correspondences(left, np.ascontiguousarray(right[:, ::-1])))
    return mirrored if mirrored >= max(FEWEST_MATCHES, MIRROR_LEAD * found) else 0


@dataclass(frozen=True, eq=False)
class Views:
    """How points move between two views, whether or not they stay on the same rows.

    Attributes
    ----------
    points
        The matches on the epipolar lines of one fundamental matrix (MAGSAC++, Barath et al. 2020).
    epipole
        The image of the right camera in the left picture, if it is near it. Of cameras side by side it is far beyond
        the picture's sides; between two moments of a moving camera, points move away from it.
    """

    points: Correspondences
    epipole: Epipole | None

    @property
    def above_each_other(self) -> bool:
        """Return whether distance moves points along the columns instead of the rows."""
        given = self.points
        turned = Correspondences(given.left[:, ::-1], given.right[:, ::-1], given.shape[::-1], given.scale)
        rows, columns = _scatter(given), _scatter(turned)
        return rows > LEAST_PARALLAX_PX and columns < VERTICAL_SHARE * rows


def _scatter(points: Correspondences) -> float:
    """Return the scatter of the rows of matches, px at the size at which features were matched."""
    return row_spread(vertical_plane(points)[1]) * points.scale


def find_views(found: Correspondences) -> Views | None:
    """Return how points move between two views; None if too few matches tell.

    Parameters
    ----------
    found
        Matches from :func:`~stereolag.assess.orientation.find_correspondences`. Where they are not nearly all
        candidates, the candidates are taken: the matches were chosen by their rows. For the same reason a slow motion
        is looked for in those of any rows.
    """
    views = _views_of(found if found.candidates is None else found.candidates)
    if views is None or views.epipole is not None or found.of_any_rows is None:
        return views
    again = _views_of(found.of_any_rows, doubted=True)
    return views if again is None or again.epipole is None else again


def _views_of(points: Correspondences, *, doubted: bool = False) -> Views | None:
    """Return how some matches move; if it is doubted, with an epipole only where its lines explain them better."""
    if len(points) < FEWEST_MATCHES:
        return None
    lines, agreeing = fundamental_matrix(points, EPIPOLE_PX, EPIPOLE_TRIALS)
    if lines is None or agreeing.mean() < AGREEING_SHARE or agreeing.sum() < FEWEST_MATCHES:
        return None
    chosen = points.chosen(agreeing)
    column, row, depth = np.linalg.svd(lines)[2][2]
    height, width = points.shape
    if _scatter(chosen) < EPIPOLE_ROWS_PX or abs(depth) < 1e-12:
        return Views(chosen, None)
    place = Epipole(float(column / depth / width), float(row / depth / height))
    near = max(abs(place.x - 0.5), abs(place.y - 0.5)) < FARTHEST_EPIPOLE
    told = near and (not doubted or _told_by_lines(chosen, lines)) and not flat(chosen)
    return Views(chosen, place if told else None)


def _told_by_lines(points: Correspondences, lines: DoubleMap) -> bool:
    """Return whether epipolar lines explain matches better than slightly turned cameras side by side with a lens.

    A strong lens has lines of its own, which may meet anywhere.
    """
    left, right = (np.column_stack([one, np.ones(len(points))]) for one in (points.left, points.right))
    through = left @ lines.T
    beside = (through * right).sum(axis=1) / np.hypot(through[:, 0], through[:, 1])
    terms, dy = row_terms(points), points.dy.astype(np.float64)
    noise = max(LEAST_NOISE_PX, row_spread(beside))
    turned, moved = (np.log1p((left_over / noise) ** 2) for left_over in (dy - terms @ robust_fit(terms, dy), beside))
    return float((turned - moved).sum()) > EVIDENCE


def flat(points: Correspondences, least: float = FLAT_SHARE) -> bool:
    """Return whether at least this share of the matches follows one homography: of a camera that turned, or of a plane.

    They tell neither where the other camera stands nor what is in front of what.
    """
    tolerance = EPIPOLE_PX / points.scale
    _, same = cv2.findHomography(points.left, points.right, cv2.USAC_MAGSAC, tolerance, maxIters=EPIPOLE_TRIALS)
    return same is not None and float(np.mean(same)) > least


def turned_alone(points: Correspondences) -> float:
    """Return the angle between two pictures of one camera that only turned, degrees; 0 if it is not surely that.

    A rotation brings all matches to their places, up to their noise, and better than an affine map and a lens do: so
    rectified cameras see a plane. Cameras that are turned may see a plane as one that only turned does.
    """
    if len(points) < FEWEST_MATCHES or not flat(points, MOSTLY_FLAT):
        return 0.0
    turning = fit_rectification(points, lens=True, depth=False)
    left_over = turning.errors(points)
    agreeing = float(np.mean(np.hypot(*left_over.T) * points.scale < EPIPOLE_PX))
    noise = max(LEAST_NOISE_PX, match_noise(points, left_over[:, 1]))
    left, right = ((one - centre_of(points.shape)) / points.shape[1] for one in (points.left, points.right))
    lens = right * (right**2).sum(axis=1, keepdims=True) - left * (left**2).sum(axis=1, keepdims=True)
    affine = np.kron(np.eye(2), np.column_stack([np.ones(len(points)), left]))
    terms, moved = np.column_stack([affine, lens.T.ravel()]), np.concatenate([points.dx, points.dy]).astype(np.float64)
    on_a_plane = moved - terms @ robust_fit(terms, moved)
    gain = np.log1p((on_a_plane / noise) ** 2).sum() - np.log1p((left_over / noise) ** 2).sum()
    explained = agreeing > FLAT_SHARE and row_spread(left_over.ravel()) < NOISE_LEFT * noise and gain > EVIDENCE
    return turning.turn if explained and FOCAL[0] < turning.focal < FOCAL[1] else 0.0


def depth_order(left: Image, right: Image) -> float:
    """Return how surely disparity grows towards things in front, standard deviations; below 0: towards those behind.

    A thing in front hides a strip of what is behind it from one camera alone. Beside each step of the disparity such a
    strip resembles what is behind, and ends at an edge of what is in front. Adjoining rows tell the same.
    """
    votes = []
    views = [reduced(one, HIDDEN_WIDTH) for one in as_eight_bit(as_grey(left), as_grey(right))]
    for one, other in (views, [np.ascontiguousarray(view[:, ::-1]) for view in views[::-1]]):
        found, grey, width = quick_map(one, other).ravel(), one.astype(np.float64), one.shape[1]
        known = np.flatnonzero(np.isfinite(found))
        before, after = known[:-1], known[1:]
        strip, step = after - before - 1, found[after] - found[before]
        inside = (before // width == after // width) & (before % width >= strip) & (after % width + strip < width)
        told = inside & (step >= LEAST_STEP) & (np.abs(strip - step) <= 1 + UNEVEN * step)
        before, after, strip = before[told], after[told], strip[told]
        sums = np.append(0.0, np.cumsum(grey))
        low, hidden, high = ((sums[end] - sums[end - strip]) / strip for end in (before + 1, after, after + strip))
        edges = cv2.dilate(np.abs(np.gradient(grey, axis=1)), np.ones((1, EDGE_PX))).ravel()
        cues = (np.abs(hidden - high), np.abs(hidden - low)), (edges[after], edges[before])
        votes.append(sum((pro - contra) / (pro + contra + NOISE_GREYS) for pro, contra in cues))
    every = np.concatenate(votes)
    sure = every[np.abs(every) > SURE_VOTE]
    return float(np.sign(sure).sum()) / math.sqrt(max(1, sure.size))


def repetition(image: Image) -> float:
    """Return the distance at which a picture repeats along its rows, px; 0 if it does not.

    The correlation of the picture's details with themselves, a shift later, reaches ``REPEATS`` after having fallen
    below half of that.
    """
    scale = min(1.0, REPEATS_WIDTH / image.shape[1])
    size = max(16, round(image.shape[1] * scale)), max(16, round(image.shape[0] * scale))
    grey = cv2.resize(as_grey(image).astype(np.float32), size, interpolation=cv2.INTER_AREA)
    detail = grey - cv2.blur(grey, (size[0] // 6 * 2 + 1, 1))
    lags = size[0] // 2
    correlation = np.ones(lags)
    for lag in range(1, lags):
        one, other = detail[:, :-lag].ravel(), detail[:, lag:].ravel()
        correlation[lag] = float(one @ other) / (float(np.sqrt((one @ one) * (other @ other))) + 1e-12)
    low = np.flatnonzero(correlation < REPEATS / 2)
    if not low.size:
        return 0.0
    later = correlation[low[0] :]
    # Every multiple of the distance fits as well: the first of the highest tops.
    high = np.flatnonzero(later >= SAME_TOP * later.max())
    end = int(np.append(np.flatnonzero(np.diff(high) > 1), high.size - 1)[0])
    first = high[: end + 1]
    return float((low[0] + first[np.argmax(later[first])]) / scale) if later.max() >= REPEATS else 0.0
