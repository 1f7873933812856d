"""Row geometry of two views measured from matches: offset, rotation and scale, and the residual."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy  # scipy.spatial is loaded on first use

from stereolag.assess.doctor.features import Correspondences
from stereolag.assess.doctor.uncalibrated import UncalibratedRectification, fit_rectification, held_out_errors
from stereolag.core.arrays import DoubleMap

ROUNDS = 10
LEAST_NOISE_PX = 0.1
CELLS, NEIGHBOURS = 100, 3
"""Cells across the image that contribute one match each, and neighbours each match is compared with."""

GRID, GRID_NEIGHBOURS = 16, 5
"""Grid cells across and down in which row bend is evaluated, and nearest matches that give each cell's disparity."""

EVIDENCE = 20.0
"""Decrease in the summed logarithms of the row errors that justifies more parameters."""

RECTIFIED_GAIN = 0.6
"""Share of the original row residuals below which a rectification must bring held-out row errors to be worthwhile."""


@dataclass(frozen=True)
class Straightened:
    """A rectification from the images alone, and its error on held-out matches.

    Attributes
    ----------
    model
        Fitted to all matches.
    spread_px
        Robust standard deviation of the held-out row differences, px.
    """

    model: UncalibratedRectification
    spread_px: float


def centre_of(points: Correspondences) -> DoubleMap:
    """Return the (x, y) of the image centre, px."""
    return (np.array(points.shape[::-1], dtype=np.float64) - 1) / 2


def robust_fit(terms: DoubleMap, values: DoubleMap) -> DoubleMap:
    """Return the (k,) coefficients of ``values = terms @ coefficients`` by Cauchy-reweighted least squares.

    Parameters
    ----------
    terms, values
        (n, k) and (n,), px.
    """
    weights = np.ones(len(values))
    for _ in range(ROUNDS):
        root = np.sqrt(weights)
        coefficients, *_ = np.linalg.lstsq(terms * root[:, None], values * root, rcond=None)
        left = values - terms @ coefficients
        noise = max(LEAST_NOISE_PX, 1.4826 * float(np.median(np.abs(left))))
        weights = 1 / (1 + (left / (2 * noise)) ** 2)
    return np.asarray(coefficients)


def vertical_plane(points: Correspondences) -> tuple[float, float, float]:
    """Return (a, b, c) of ``right.y = a + b * (x - cx) + (1 + c) * (y - cy) + cy``, fitted robustly to the matches.

    a is the row offset at the centre (px), b the sine of the rotation and c the difference in scale between the views.
    """
    terms = np.column_stack([np.ones(len(points)), points.left - centre_of(points)])
    offset, rotation, growth = robust_fit(terms, points.dy.astype(np.float64))
    return float(offset), float(rotation), float(growth)


def row_residuals(points: Correspondences) -> DoubleMap:
    """Return dy minus its best-fitting offset, rotation and scale, px."""
    offset, *slopes = vertical_plane(points)
    return np.asarray(points.dy - (offset + (points.left - centre_of(points)) @ np.array(slopes)), dtype=np.float64)


def row_spread(residuals: DoubleMap) -> float:
    """Return a standard deviation that bent corners raise but a few wrong matches do not, px.

    The median reflects the middle of the image, where a lens bends nothing; the 90th percentile reflects its corners.
    """
    middle, outer = np.percentile(np.abs(residuals), (50, 90))
    return max(1.4826 * float(middle), float(outer) / 1.645)


def row_terms(points: Correspondences) -> DoubleMap:
    """Return the (n, 7) effects on dy of two slightly rotated cameras and a distorting lens.

    To first order: offset, rotation, scale; the yaws of the left and right cameras and their pitch; and radial
    distortion, which moves a point in proportion to the cube of its distance from the centre.
    """
    width, centre = points.shape[1], centre_of(points)
    left, right = ((places - centre) / width for places in (points.left, points.right))
    x, y = left.T
    lens = right[:, 1] * (right**2).sum(axis=1) - y * (left**2).sum(axis=1)
    return np.column_stack([np.ones(len(points)), x, y, x * y, right[:, 0] * y, y * y, lens])


def bend_of(points: Correspondences) -> DoubleMap:
    """Return the bend of the rows in each cell of a grid over the image, px; 0 everywhere if it is only noise.

    It is the dy due to rotations and lens, minus the best offset, rotation and scale; on a grid, because matches follow
    texture and are rare in the corners, where rows bend most.
    """
    dy, terms = points.dy.astype(np.float64), row_terms(points)
    bent, straight = robust_fit(terms, dy), robust_fit(terms[:, :3], dy)
    noise = max(LEAST_NOISE_PX, row_spread(dy - terms @ bent))
    gain = np.log1p(((dy - terms[:, :3] @ straight) / noise) ** 2) - np.log1p(((dy - terms @ bent) / noise) ** 2)
    rows, cols = points.shape
    x, y = np.meshgrid((np.arange(GRID) + 0.5) * cols / GRID, (np.arange(GRID) + 0.5) * rows / GRID)
    left = np.column_stack([x.ravel(), y.ravel()])
    if gain.sum() < EVIDENCE:
        return np.zeros(len(left))
    _, near = scipy.spatial.cKDTree(points.left).query(left, k=min(GRID_NEIGHBOURS, len(points)))
    right = left + np.column_stack([np.median(points.dx[near], axis=1), np.zeros(len(left))])
    there = row_terms(Correspondences(left.astype(np.float32), right.astype(np.float32), points.shape))
    bend = there @ bent
    plane, *_ = np.linalg.lstsq(there[:, :3], bend, rcond=None)
    return np.asarray(bend - there[:, :3] @ plane)


def match_noise(points: Correspondences, residuals: DoubleMap) -> float:
    """Return the robust standard deviation of row residuals between neighbours, px: no lens or rotation explains it."""
    # Features on the same corner have correlated errors, so each small cell contributes only one match.
    _, cells = np.unique((points.left * (CELLS / points.shape[1])).astype(np.intp), axis=0, return_index=True)
    if len(cells) <= NEIGHBOURS:
        return 0.0
    places, left = points.left[cells], residuals[cells]
    near = np.asarray(scipy.spatial.cKDTree(places).query(places, k=NEIGHBOURS + 1)[1])
    return row_spread((left[near[:, 1:]] - left[:, None]).ravel() / np.sqrt(2))


def straightened(points: Correspondences) -> Straightened | None:
    """Return the rectification from matches alone that does best on held-out matches; None if none helps much.

    It includes a lens coefficient only if that helps.
    """
    turned = fit_rectification(points, lens=False)
    freed = fit_rectification(points, lens=True, start=turned)
    turned_errors = held_out_errors(points, lens=False, start=turned)
    freed_errors = held_out_errors(points, lens=True, start=freed)
    noise = max(LEAST_NOISE_PX, row_spread(freed_errors))
    gain = np.log1p((turned_errors / noise) ** 2).sum() - np.log1p((freed_errors / noise) ** 2).sum()
    model, errors = (freed, freed_errors) if gain > EVIDENCE else (turned, turned_errors)
    found = Straightened(model, row_spread(errors))
    return found if found.spread_px < RECTIFIED_GAIN * row_spread(row_residuals(points)) else None
