"""Reliable feature matches between two views, rectified or not: those that agree on one relative orientation."""

from __future__ import annotations

import cv2
import numpy as np

from stereolag.assess.doctor.features import (
    Chosen,
    Correspondences,
    binary_candidates,
    gradient_candidates,
    reduced_pair,
)
from stereolag.assess.doctor.rows import bend_of, centre_of, robust_fit, row_spread, row_terms
from stereolag.assess.doctor.uncalibrated import NOISE_PX, UncalibratedRectification, fit_rectification, robust_cost
from stereolag.core.inputs import Image

EPIPOLAR_PX = 1.0
"""Largest distance of a match from its epipolar line, px at the size at which it was matched."""

ENOUGH, EASY_SHARE, EVEN_PX = 100, 0.4, 0.4
"""Thresholds for an easy pair: number of agreeing matches, their share of all matches, scatter of their rows (px)."""

UNBENT_PX = 0.3
"""Row bend of an easy pair above which its matches are selected again with a lens model, px."""

AGREEMENT = 2.5
"""On an easy pair, a match whose dy is off by more than this many standard deviations is dropped."""

CHANCE_SHARE = 0.15
"""Agreeing matches are no evidence below this share of the distinct ones: some agree by chance."""

PLANES, PLANE_SHARE, STEEPEST = 2000, 0.012, 0.2
"""Planes of dy tried, largest distance of a match from its plane as a share of the rows, and steepest slope allowed."""

TOLERANCES_PX = (7.0, 4.0, 2.0, 1.5, 1.5)
"""Largest row error of the matches kept in each round of refitting the model of the views."""


def find_correspondences(left: Image, right: Image) -> Correspondences:
    """Match features and keep the matches that agree on the relative orientation of the views.

    On a nearly rectified pair these are mutual ORB matches whose dy fits small rotations and a lens distortion,
    starting from those on the epipolar lines of one fundamental matrix (MAGSAC++, Barath et al. 2020). If there are few
    of them, SIFT matches are added, and those consistent with two rotated cameras and one lens coefficient are kept.

    Their ``dy`` are the row differences: about 0 on a rectified pair.

    Parameters
    ----------
    left, right
        (H, W) or (H, W, 3 | 4) images of one size: uint8, uint16 or float.

    Returns
    -------
    Correspondences
        Possibly empty: matches that could have arisen by chance are no evidence.
    """
    pair = reduced_pair(left, right)
    quick = binary_candidates(pair)
    easy = _nearly_rectified(quick.points)
    if len(easy) >= ENOUGH:
        return _followed(quick.points, easy) if np.std(bend_of(easy)) * pair.scale > UNBENT_PX else easy
    thorough = gradient_candidates(pair)
    every, distinct = quick.points.joined(thorough.points), quick.distinct.joined(thorough.distinct)
    models = [_settled(distinct, seed) for seed in (_epipolar(distinct), _on_a_plane(distinct))]
    best = min((model for model in models if model), key=lambda model: robust_cost(model, distinct), default=None)
    if best is None or _agreeing(best, distinct).sum() < CHANCE_SHARE * len(distinct):
        return every.chosen(np.zeros(len(every), dtype=np.bool_))
    return _followed(every, every.chosen(_agreeing(best, every)))


def _epipolar(points: Correspondences) -> Chosen:
    """Return the mask of matches on the epipolar lines of the best fundamental matrix."""
    if len(points) < 8:
        return np.zeros(len(points), dtype=np.bool_)
    _, agreeing = cv2.findFundamentalMat(
        points.left, points.right, cv2.USAC_MAGSAC, EPIPOLAR_PX / points.scale, 0.999, 5000
    )
    return np.zeros(len(points), dtype=np.bool_) if agreeing is None else np.asarray(agreeing.ravel() == 1)


def _nearly_rectified(points: Correspondences) -> Correspondences:
    """Return the matches of an easy pair whose dy fits small rotations and a lens; none for any other pair."""
    agreeing = _epipolar(points)
    for _ in range(3):
        if agreeing.sum() < ENOUGH:
            return points.chosen(np.zeros(len(points), dtype=np.bool_))
        terms = row_terms(points)
        residuals = points.dy - terms @ robust_fit(terms[agreeing], points.dy[agreeing].astype(np.float64))
        spread = row_spread(residuals[agreeing]) * points.scale
        agreeing = np.abs(residuals) * points.scale < AGREEMENT * max(spread, NOISE_PX)
    easy = spread < EVEN_PX and agreeing.mean() > EASY_SHARE
    return points.chosen(agreeing if easy else np.zeros(len(points), dtype=np.bool_))


def _on_a_plane(points: Correspondences) -> Chosen:
    """Return the mask of matches near the best plane of dy over the image (RANSAC), for cameras nearly side by side.

    On a repeating pattern, more matches may agree on an epipolar geometry that such cameras cannot have.
    """
    if len(points) < 8:
        return np.zeros(len(points), dtype=np.bool_)
    places = np.column_stack([np.ones(len(points)), (points.left - centre_of(points)) / points.shape[1]])
    sample = np.random.default_rng(0).integers(0, len(points), (PLANES, 3))
    corners, heights = places[sample], points.dy[sample].astype(np.float64)
    wide = np.abs(np.linalg.det(corners)) > 0.01
    planes = np.linalg.solve(corners[wide], heights[wide][..., None])[..., 0]
    slopes = np.abs(planes[:, 1:]).max(axis=1, initial=0) / points.shape[1]
    planes = planes[slopes < STEEPEST]
    if not len(planes):
        return np.zeros(len(points), dtype=np.bool_)
    near = np.abs(points.dy - planes @ places.T) < PLANE_SHARE * points.shape[0]
    return np.asarray(near[near.sum(axis=1).argmax()])


def _settled(points: Correspondences, agreeing: Chosen) -> UncalibratedRectification | None:
    """Return the model of the views that most matches agree on, starting from a subset; None with too few."""
    model = None
    for tolerance in TOLERANCES_PX:
        if agreeing.sum() < 8:
            return None
        model = fit_rectification(points.chosen(agreeing), lens=model is not None, start=model)
        agreeing = np.abs(model.row_errors(points)) * points.scale < tolerance
    return model


def _followed(every: Correspondences, agreeing: Correspondences) -> Correspondences:
    """Return all matches that fit the rotations and lens of a subset: in the corners a lens moves matches far."""
    for _ in range(2):
        model = fit_rectification(agreeing, lens=True)
        errors = np.abs(model.row_errors(agreeing)) * every.scale
        # Wrong matches are on the right rows only by chance, so a tight tolerance keeps fewer of them.
        tolerance = max(2 * NOISE_PX, AGREEMENT * 1.4826 * float(np.median(errors)))
        agreeing = every.chosen(np.abs(model.row_errors(every)) * every.scale < tolerance)
    return agreeing


def _agreeing(model: UncalibratedRectification, points: Correspondences) -> Chosen:
    return np.asarray(np.abs(model.row_errors(points)) * points.scale < TOLERANCES_PX[-1])
