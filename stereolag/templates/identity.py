"""Whether a place shows the template: light, colour and a shift below a pixel are fitted, and the residual is judged.

It is judged block by block, so that a difference in one place is not lost in the agreement of all others: a sibling of
an icon, one stroke different, correlates at 0.95, and so does a landscape with another one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import product
from typing import Literal, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Mask, median, percentiles
from stereolag.core.inputs import Image
from stereolag.templates.aligning import Plane, gradient
from stereolag.templates.drawn_over import drawn_over, has_outline, has_same_ink, is_gone, touches_rim, without_gaps
from stereolag.templates.fits import (
    MIN_BLOCK_DIFFERENCE,
    MIN_JUDGED_SHARE,
    MOTION_TOLERANCE_PX,
    Fit,
    best_fit,
    block_means,
    blocks_of,
)
from stereolag.templates.patterns import FULL_WEIGHT, NEARNESS_OFFSET, Pattern, blurred, edges, nearness
from stereolag.templates.redrawn import Redrawing, redrawing
from stereolag.templates.softening import CHROMA_SIGMA_PX

Kind: TypeAlias = Literal[
    "same", "lower_contrast", "higher_contrast", "partly_covered", "other_colours", "differs", "not_there"
]
"""Content of a place: the template; the template with another contrast, or partly covered; its shape in other colours;
something that differs from it in some blocks; something else."""

MIN_EDGE_ENERGY = 0.2
"""Least energy of a silhouette's edges in a block that can disagree, as a share of the largest of all blocks."""

MIN_EDGE_CORRELATION = 0.6
"""Least correlation of a silhouette's edges in a block with those of the image, whatever is beside them.

Measured: from 0.75 on photographs where the shape is, up to 0.41 in the worst block of another shape in the same ring.
"""

MIN_OTHER_COLOUR_DISTANCE = 40.0
"""Least distance of another colour from every mixture of a silhouette's colour with the background, grey levels of 255
over all channels.

Measured: up to 37 where the shape is, half transparent too; from 90 in another hue.
"""

MIN_OTHER_COLOUR_STEP = 0.25
"""The same distance as a share of the step from the background to the shape; in another hue from 0.5."""

MAX_IMPOSSIBLE_SHARE = 0.02
"""Largest share of the pixels of a block with values that the template has over no background.

Measured: none at glows drawn over photographs; elsewhere from 4 %.
"""

MAX_COMPOSITE_GAIN = 1.12
"""Largest gain of a channel, or its inverse, of a template over a background.

Measured: 0.96 to 1.10 at glows drawn over photographs; elsewhere 0.3 to 4.
"""

MIN_COLOUR_CHANGE = 0.037
"""Least squared difference of other colours from any gains of the channels, as a share of the template's variance.

Measured: up to 0.033 under other lights and in JPEG, from 0.040 for lamps and buttons of another colour.
"""

MIN_EXPLAINED = 0.9
"""Least share of the variance of a place that an opaque template explains.

Measured: from 0.964 where the template is, off the grid, in JPEG and in JPEG of screens reduced to half too, 0.959
under noise of half its contrast.
"""

MIN_EXPLAINED_TRANSLUCENT = 0.57
"""The same for a template through which an unknown background shows, as under a mask.

If its alpha is known, and no background makes the place of it, as much is needed as of an opaque one: 0.67 to 0.88 is
found where other sprites are, and other light or JPEG leave most soft ones with less.
"""

MIN_EXPLAINED_SMALL = 0.958
"""The same for an opaque template of fewer than :data:`SMALL_TEMPLATE_PIXELS`, a few blocks of which agree by chance.

Measured: up to 0.94 at most places where a template of 9 px is not; 0.90 to 0.96 where an icon of 17 to 26 px, in JPEG
of a screen reduced to half, is its sibling.
"""

SMALL_TEMPLATE_PIXELS = 900

CONTRAST_TOLERANCE = 1.25
"""Ratio of two contrasts from which they count as different."""


@dataclass(frozen=True)
class Identity:
    """Content of a place, compared with the template.

    Parameters
    ----------
    kind
        See :data:`Kind`.
    contrast
        Standard deviation of the place over that of the template.
    gain
        For each channel, its contrast: the slope of its values against those of the template.
    explained
        Share of the variance of the place that the template explains.
    blocks
        Rows of blocks over the template: whether they agree.
    redrawing
        Place and size of the template if it is drawn anew at another size.
    motion
        Exact place relative to the given one: px down and right, logarithm of the size, and angle, radians clockwise.
    explained_detail
        Share explained of the variance beyond a quadratic surface.
    """

    kind: Kind
    contrast: float
    gain: tuple[float, ...]
    explained: float
    blocks: tuple[tuple[bool, ...], ...]
    redrawing: Redrawing | None = None
    motion: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    explained_detail: float = 1.0

    @property
    def is_template(self) -> bool:
        """Whether the place shows all of the template, in whatever light."""
        return self.kind in ("same", "lower_contrast", "higher_contrast")


def identity(
    image: Image,
    pattern: Pattern,
    row: int,
    col: int,
    *,
    refine_pose: bool = False,
    resized: tuple[Pattern, float] | None = None,
    tolerance_px: float = MOTION_TOLERANCE_PX,
) -> Identity:
    """Return the content of a place of the image, compared with the template.

    Parameters
    ----------
    image
        (rows, cols, channels), as many channels as the pattern.
    pattern
        The template, resized and rotated as at the place.
    row, col
        The place, accurate to a pixel.
    refine_pose
        Whether size and angle are refined too.
    resized
        The template as given and the size of the pattern over its own, unless it is rotated: it may be drawn anew.
    tolerance_px
        The alignment ends once a step moves no corner by more.
    """
    if pattern.silhouette:
        return _identity_of_silhouette(image, pattern, row, col)
    may_be_composite = pattern.most_opaque > 0 and image.dtype.kind == "u"
    if may_be_composite:  # a sloping background moves the best score by a pixel
        for down, right in product((0, -1, 1), repeat=2):
            composite = _gain_over_background(image, pattern, row + down, col + right)
            if composite is not None:
                return _rounded("same", 1.0, *composite, np.ones(blocks_of(pattern.shape), dtype=np.bool_))
    fit = best_fit(image, pattern, row, col, refine_pose, tolerance_px)
    if not fit.variance > 0 or fit.contrast <= 0:
        return Identity("not_there", 0.0, (0.0,) * pattern.colours.shape[2], 0.0, ())
    judged = fit.judged_shares > MIN_JUDGED_SHARE
    disagrees = fit.disagreeing(judged)
    energies = fit.block_energies()
    agrees = ~disagrees & (judged | (energies == 0))
    visible = float(energies[agrees].sum() / max(energies.sum(), 1e-12))
    is_outside = not agrees[~disagrees].all()
    kind = _kind(fit, disagrees, energies, visible, is_outside=is_outside, refine_pose=refine_pose)
    if not fit.is_opaque and fit.explained < (MIN_EXPLAINED if may_be_composite else MIN_EXPLAINED_TRANSLUCENT):
        kind = "not_there"
    if (
        kind in ("differs", "not_there")
        and not refine_pose
        and image.dtype == pattern.colours.dtype == np.uint8
        and (pattern.weights == 1).all()
    ):
        covered = drawn_over(image, pattern, row, col)
        if covered is not None:
            free = block_means(covered, agrees.shape) == 0
            return _rounded("partly_covered", 1.0, (1.0,) * len(fit.gain), fit.explained_in(free), free)
    if kind in ("differs", "not_there") and resized is not None and fit.colour_change < MIN_COLOUR_CHANGE:
        redrawn = redrawing(image, resized[0], row, col, resized[1])
        if redrawn is not None:
            kind = _kind_by_contrast(redrawn.contrast)
            shown = _rounded(kind, redrawn.contrast, redrawn.gain, redrawn.explained, np.ones_like(agrees))
            return replace(shown, redrawing=redrawn)
    shown = _rounded(kind, fit.contrast, fit.gain, fit.explained, agrees)
    return replace(
        shown,
        motion=tuple(map(float, fit.motion)),
        explained_detail=fit.explained_detail if shown.is_template and (fit.is_opaque or may_be_composite) else 1.0,
    )


def _identity_of_silhouette(image: Image, pattern: Pattern, row: int, col: int) -> Identity:
    """Return the content of a place of a silhouette: its edges in every block, and none of its colour beside it.

    The first two channels of the image are its edges, the others its difference from the silhouette's colour.
    """
    height, width = pattern.shape
    part = np.nan_to_num(image[row : row + height, col : col + width])
    alpha, observed, difference = pattern.colours[:, :, 0], part[:, :, :2], part[:, :, 2:]
    near = nearness(difference)
    own, grid = edges(pattern.colours), blocks_of(pattern.shape)
    energy = np.square(own).sum(axis=2)
    is_edge = energy > MIN_EDGE_ENERGY**2 * energy.max()
    own_energy, products, observed_energy = (
        block_means(plane, grid)
        for plane in (energy, (own * observed).sum(axis=2), np.square(observed).sum(axis=2) * is_edge)
    )
    has_edges = own_energy > MIN_EDGE_ENERGY * own_energy.max()
    agrees = ~has_edges | (products > MIN_EDGE_CORRELATION * np.sqrt(own_energy * observed_energy))
    inside = near[alpha >= alpha.max() * FULL_WEIGHT]
    has_own_colour = median(inside) > -math.log(NEARNESS_OFFSET + 12)  # grey levels of 255
    if has_own_colour:
        outside = cv2.dilate(np.asarray(alpha, dtype=np.float32), np.ones((3, 3), np.uint8)) < 1 - FULL_WEIGHT
        as_near = near > percentiles(inside, 10)[0] - 0.05
        agrees &= block_means(outside & as_near, grid) <= 0.2
    total = products.sum()
    explained = float(total**2 / max(own_energy.sum() * observed_energy.sum(), 1e-12)) if total > 0 else 0.0
    visible = float(own_energy[agrees].sum() / own_energy.sum())
    if agrees.all():
        other = not has_own_colour and _has_other_colour(alpha, difference)
        return _rounded("other_colours" if other else "same", 1.0, (1.0,), explained, agrees)
    return _rounded("differs" if visible >= MIN_VISIBLE_DIFFERS else "not_there", 1.0, (1.0,), explained, agrees)


def _has_other_colour(alpha: Plane, difference: Plane) -> bool:
    """Return whether a shape is of no mixture of its own colour, from which `difference` is, with the background."""
    soft, shown = (blurred(plane, CHROMA_SIGMA_PX, cv2.BORDER_REPLICATE) for plane in (alpha, difference))
    # At the edges of the shape, on both sides of which the background is the same.
    down, right = gradient(soft)
    steepness = np.square(down) + np.square(right)
    slopes = [own[:, :, np.newaxis] * other for own, other in zip((down, right), gradient(shown), strict=True)]
    step = np.sum(slopes, axis=(0, 1, 2)) / steepness.sum()
    outside = (shown - soft[:, :, np.newaxis] * step).reshape(-1, step.size)
    background = np.average(outside, axis=0, weights=steepness.ravel())
    inside = background + step
    aside = inside - background * (inside @ background) / max(float(background @ background), 1e-12)
    limit = max(MIN_OTHER_COLOUR_DISTANCE, MIN_OTHER_COLOUR_STEP * float(np.linalg.norm(step)))
    return bool(np.linalg.norm(aside) > limit)


def _gain_over_background(image: Image, pattern: Pattern, row: int, col: int) -> tuple[tuple[float, ...], float] | None:
    """Return gains and explained share if the place can be the template over a background; else None.

    The background may have any values that a pixel can have; only for the gains, it is taken for a linear slope.
    """
    height, width = pattern.shape
    part = image[max(row, 0) : max(row + height, 0), max(col, 0) : max(col + width, 0)].astype(np.float64)
    if part.shape[:2] != pattern.shape:
        return None
    top = float(np.iinfo(image.dtype).max)
    alpha = pattern.most_opaque * np.cbrt(pattern.weights)[:, :, np.newaxis]
    over, through = alpha * pattern.colours, 1 - alpha
    energy = (pattern.weights * np.square(pattern.deviations).sum(axis=0)).sum()
    slack = min(6 * top / 255, 0.25 * float(np.sqrt(energy / pattern.count)))  # six grey levels of 255
    valid = pattern.weights > 0
    impossible = ((part < over - slack) | (part > over + through * top + slack)).any(axis=2) & valid
    if block_means(impossible, blocks_of(pattern.shape)).max() > MAX_IMPOSSIBLE_SHARE:
        return None
    weights = np.sqrt(pattern.weights[valid])
    rows, cols = (at[:, np.newaxis] / max(valid.shape) for at in np.nonzero(valid))
    gains, residual, variance = [], 0.0, 0.0
    for channel in range(part.shape[2]):
        observed, shown, behind = part[:, :, channel][valid], over[:, :, channel][valid], through[valid]
        terms = np.column_stack([shown, behind, behind * rows, behind * cols])
        weighted = terms * weights[:, np.newaxis]
        strength = 1e-9 + 1e-9 * float(np.square(shown).sum())
        ridge = 1e-3 * weights.sum() * np.diag([0, 1, 1, 1]) + np.diag([strength, 0, 0, 0])
        fitted = np.linalg.solve(terms.T @ weighted + ridge, weighted.T @ observed)
        gains.append(float(fitted[0]))
        residual += float((weights * np.square(observed - terms @ fitted)).sum())
        variance += float((weights * np.square(observed - np.average(observed, weights=weights))).sum())
    if not all(1 / MAX_COMPOSITE_GAIN <= gain <= MAX_COMPOSITE_GAIN for gain in gains):
        return None
    return tuple(gains), max(0.0, 1 - residual / variance) if variance > 0 else 0.0


def _rounded(
    kind: Kind, contrast: float, gain: tuple[float, ...], explained: float, agrees: npt.NDArray[np.bool_]
) -> Identity:
    """Return an identity, its figures to the six digits that single precision holds: those of an exact copy are 1."""
    contrast, explained, *gains = (float(f"{figure:.6g}") for figure in (contrast, explained, *gain))
    return Identity(kind, contrast, tuple(gains), explained, tuple(tuple(map(bool, line)) for line in agrees))


COVERED_SHARES = (0.08, 0.45)
"""Smallest and largest share of the pixels that an occluder may hide."""

MIN_COVERABLE_PIXELS = 2304
"""Least number of pixels of a template that may be covered: with the mark of an icon covered, nobody can tell it from
its sibling."""

NOISE_PERCENTILE = 90
"""Percentile of the squared differences in the blocks that agree, by which noise is measured."""

MIN_NOISE_RATIO = 4.0
"""Least squared difference over that percentile of a pixel that differs."""

MIN_PIXEL_DIFFERENCE = 0.004
"""Least squared difference of a pixel that differs, as a share of the template's variance."""

MIN_OCCLUDER_DIFFERING = 0.76
"""Least share of an occluder's pixels that differ; a sibling shares its ground with the template.

Measured: from 0.79 under an occluder, up to 0.73 elsewhere.
"""

MIN_DIFFERING_IN_OCCLUDER = 0.9
"""Least share of the differing pixels that are in the occluder."""

NOISY_COVERED_SHARES = (0.1, 0.45)
"""Smallest and largest share of the blocks under an occluder whose outline noise hides; it crosses the rim."""

MIN_NOISY_AT_RIM = 0.4
"""Least share of the pixels of such an occluder that differ at the rim of the template.

Measured: from 0.58 under an occluder; up to 0.27 at another digit, or a bar filled to another length, in its frame.
"""

MIN_NOISY_DIFFERING = 0.6
"""Least share of the pixels of such an occluder that differ."""

MIN_VISIBLE_NOISY = 0.55
"""Least share of the template's energy that is visible beside such an occluder."""

MIN_VISIBLE_COVERED = 0.45
"""Least share of the template's energy that is visible if a part is covered."""

MIN_VISIBLE_OUTSIDE = 0.4
"""The same if a part is outside the image."""

MIN_VISIBLE_DIFFERS = 0.4
"""The same for something that differs in some blocks, and is not something else."""

MAX_SORTED_DIFFERENCE = 0.1
"""Largest mean difference of the sorted values over that of the values in place, where a part only moved.

Measured: up to 0.02 where a part moved, from 0.2 under an occluder.
"""

MIN_EXPLAINED_BESIDE = 0.985
"""Least share of the variance explained beside an occluder that crosses the template's rim, unless there is grain.

Measured: from 0.985 in 25 of 26 places of which 10 to 40 % is covered; 0.87 to 0.983 where something like it was taken
for covered: another coin, the next line of a list, other terrain, another part of the sky.
"""

MIN_GRAIN = 2.0
"""Least grain beside such an occluder over the residual there: noise has 8 to 9, the places above 0.002 to 0.25."""


def _kind(
    fit: Fit, disagrees: npt.NDArray[np.bool_], energies: Plane, visible: float, *, is_outside: bool, refine_pose: bool
) -> Kind:
    """Return the kind of a place from the blocks that disagree and the share of the energy visible in all others."""
    if disagrees.any():
        if fit.colour_change < MIN_COLOUR_CHANGE and (
            _is_occluded(fit, disagrees, energies)
            or (visible >= MIN_VISIBLE_NOISY and _is_occluded_from_rim(fit, disagrees))
        ):
            return "partly_covered"
        return "differs" if visible >= MIN_VISIBLE_DIFFERS else "not_there"
    least = MIN_EXPLAINED_SMALL if math.prod(fit.shape) < SMALL_TEMPLATE_PIXELS else MIN_EXPLAINED
    # At another size, strokes are drawn anew or averaged: small marks differ even where the template is.
    if fit.is_opaque and (fit.explained < least or (not refine_pose and fit.has_another_mark())):
        return "differs"
    if fit.colour_change >= MIN_COLOUR_CHANGE:
        return "other_colours"
    if is_outside:
        return "partly_covered" if visible >= MIN_VISIBLE_OUTSIDE else "not_there"
    return _kind_by_contrast(fit.contrast)


def _kind_by_contrast(contrast: float) -> Kind:
    """Return the kind of a place where the template is, by its contrast."""
    if 1 / CONTRAST_TOLERANCE < contrast < CONTRAST_TOLERANCE:
        return "same"
    return "lower_contrast" if contrast < 1 else "higher_contrast"


def _is_occluded(fit: Fit, disagrees: npt.NDArray[np.bool_], energies: Plane) -> bool:
    """Return whether all blocks that disagree hold or touch one occluder, all of whose pixels differ."""
    judged = fit.judged
    if judged.sum() < MIN_COVERABLE_PIXELS:
        return False
    squares = fit.squared_differences(sharp=True)
    free = ~fit.pixels_of(disagrees) & judged
    noise = float(percentiles(squares[free], NOISE_PERCENTILE)[0]) if free.any() else math.inf
    limit = max(MIN_NOISE_RATIO * noise, MIN_PIXEL_DIFFERENCE * fit.variance)
    differ = squares > min(limit, MIN_BLOCK_DIFFERENCE * fit.variance)
    occluder = _largest_hull(differ)
    reach = 2 * math.ceil(3 * CHROMA_SIGMA_PX) + 1
    touched = cv2.dilate(np.asarray(occluder, dtype=np.uint8), np.ones((reach, reach), np.uint8))
    if (disagrees & (block_means(touched, energies.shape) == 0)).any():  # true also without any occluder
        return False
    hidden = occluder & judged
    visible = float((energies * (1 - block_means(occluder, energies.shape))).sum() / max(energies.sum(), 1e-12))
    return (
        COVERED_SHARES[0] <= hidden.sum() / judged.sum() <= COVERED_SHARES[1]
        and bool(differ[hidden].mean() >= MIN_OCCLUDER_DIFFERING)
        and bool((differ & occluder).sum() / differ.sum() >= MIN_DIFFERING_IN_OCCLUDER)
        and visible >= MIN_VISIBLE_COVERED
        and not _is_in_another_state(fit, disagrees, occluder & differ)
    )


def _is_occluded_from_rim(fit: Fit, disagrees: npt.NDArray[np.bool_]) -> bool:
    """Return whether the blocks that disagree are one occluder that crosses the rim of the template."""
    least, most = NOISY_COVERED_SHARES
    if math.prod(fit.shape) < SMALL_TEMPLATE_PIXELS or not least <= disagrees.mean() <= most:
        return False
    _, labels, stats, _ = cv2.connectedComponentsWithStats(disagrees.astype(np.uint8), connectivity=4)
    region = labels == 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    if (
        not touches_rim(region)
        or region.sum() < 0.8 * disagrees.sum()
        or (fit.explained_in(~disagrees) < MIN_EXPLAINED_BESIDE and fit.grain_in(~disagrees) < MIN_GRAIN)
    ):
        return False
    judged, square = fit.judged, np.ones((3, 3), np.uint8)
    inner = cv2.erode(judged.astype(np.uint8), square, borderType=cv2.BORDER_CONSTANT, borderValue=0)
    inside = fit.pixels_of(disagrees)
    differ_sharply = fit.squared_differences(sharp=True) > MIN_BLOCK_DIFFERENCE * fit.variance
    at_rim = differ_sharply[inside & judged & (inner == 0)]
    if not at_rim.size or at_rim.mean() < MIN_NOISY_AT_RIM:
        return False
    differ = fit.squared_differences()[inside & judged] > 0.02 * fit.variance
    return bool(differ.mean() >= MIN_NOISY_DIFFERING) and not _is_in_another_state(
        fit, disagrees, inside & differ_sharply
    )


def _is_in_another_state(fit: Fit, disagrees: npt.NDArray[np.bool_], differ: Mask) -> bool:
    """Return whether the differing pixels are a part of the template in another state, with nothing in front of it.

    So if the template has the outline of that part, or of its core, as JPEG adds haloes; if something plain in the
    template is gone; if the values there are only in other places, as the mark of a choice is; or if another mark is
    there in the same ink.
    """
    if not differ.any():
        return False
    squares = fit.squared_differences(sharp=True)
    core = differ & (squares > 0.1 * float(percentiles(squares[differ], NOISE_PERCENTILE)[0]))
    if any(has_outline(fit.template, _largest_hull(part)) for part in (differ, core)) or is_gone(*fit.sharp, differ):
        return True
    drawn, seen = fit.sharp
    predicted, observed = drawn[differ], seen[differ]
    sorted_difference = np.abs(np.sort(predicted, axis=0) - np.sort(observed, axis=0)).mean()
    if sorted_difference <= MAX_SORTED_DIFFERENCE * np.abs(predicted - observed).mean():
        return True
    where = fit.pixels_of(disagrees) & fit.judged
    # Where much differs, the light cannot be fitted.
    return any(has_same_ink(plane[where], seen[where]) for plane in (drawn, fit.soft_template))


def _largest_hull(differ: Mask) -> Mask:
    """Return the convex hull of the largest differing region, without parts thinner than 3 px."""
    found, _ = cv2.findContours(without_gaps(differ), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    hull = np.zeros(differ.shape, np.uint8)
    if found:
        cv2.fillConvexPoly(hull, cv2.convexHull(max(found, key=cv2.contourArea)), 1)
    return hull > 0
