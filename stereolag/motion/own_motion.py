"""Our own motion: the rigid motion of the static world, its standard error, and whether it may be mistaken."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, TypeAlias

import cv2
import numpy as np

from stereolag.core.arrays import DoubleMap, FloatMap, Indices, Mask, Vector
from stereolag.core.inputs import Image, as_grey
from stereolag.motion.moving_objects import Camera, MovingTest, Points

MAX_POINTS = 4000
"""Largest number of points used, evenly spread over the image; more do not improve the motion."""

CELL_PX = 8
"""Side of the image cells that contribute their best pixel each, if the image is given, px."""

FLAT_SHARE = 0.3
"""Share of the cells left out, those with the least structure: flow is least accurate without texture."""

MIN_DISPARITY_PX = 2.0
"""Least disparity used, px: farther points agree with any translation and would outvote near ones."""

MIN_POINTS = 20
"""Least number of points from which a motion is estimated."""

AREA_GRID = (12, 20)
"""Rows and columns of areas of the image. Each area has one vote, however rich its texture, and counts as one
independent observation: flow and disparity are smooth over the width of their windows."""

MIN_EXPLAINED_SHARE = 0.5
"""Least share of the areas that our own motion must explain."""

MIN_RIVAL_SHARE = 0.1
"""Least share of the areas that a rival motion, and not our own, explains."""

MIN_RIVAL_RATIO = 0.5
"""Least number of these areas, as a share of those that our own motion, and not the rival, explains."""

COMMON_ERROR_SHARE = 0.5
"""Share of the expected error of a disparity that all disparities of a map may have in common."""

DISPARITY_STEP_PX = 0.5
"""Step in disparity for the numerical derivative of a static point's flow, px."""

Doubt: TypeAlias = Literal["", "nothing static", "two motions", "inaccurate"]


@dataclass(frozen=True, eq=False)
class OwnMotion:
    """Motion of the static world in camera coordinates: ``X2 = rotation @ X1 + translation``.

    Attributes
    ----------
    rotation
        (3, 3).
    translation
        (3,) metres.
    inliers
        Share of the points used that agree, 0..1.
    error_m
        Standard error of the distance travelled, metres.
    doubt
        Why it may not be that of the world: "nothing static" if it explains less than half of the image; "two motions"
        if another rigid motion alone explains at least half as much of it as this one alone: a bonnet, or a lorry ahead
        that is as fast as we are, looks like a static world. Otherwise "".
    """

    rotation: DoubleMap
    translation: Vector
    inliers: float
    error_m: float = np.inf
    doubt: Doubt = ""

    @property
    def travelled(self) -> Vector:
        """Return the camera's displacement in first-frame coordinates, (3,) metres: X right, Y down, Z forward."""
        return np.asarray(-self.rotation.T @ self.translation)

    def moved(self, points: Points) -> Points:
        """Return the positions of static points in camera coordinates at the second frame."""
        return np.asarray(points @ self.rotation.T + self.translation)


class _Sample(NamedTuple):
    """N pixels: their points (N, 3), disparities, (2, N) rows and columns in both frames, px, and areas."""

    points: Points
    disparity: FloatMap
    places: FloatMap
    places_after: FloatMap
    area: Indices

    def part(self, chosen: Mask) -> _Sample:
        points, disparity, places, places_after, area = self
        return _Sample(points[chosen], disparity[chosen], places[:, chosen], places_after[:, chosen], area[chosen])

    def votes(self) -> Vector:
        """Return the weights of the pixels, 1 in sum, which give every area with a pixel the same weight."""
        counts = np.bincount(self.area)
        return np.asarray(1 / (counts[self.area] * np.count_nonzero(counts)))


def estimate_own_motion(
    points: Points,
    disparity: FloatMap,
    places_after: FloatMap,
    camera: Camera,
    settings: MovingTest,
    image: Image | None = None,
) -> OwnMotion:
    """Return the rigid motion that takes most points to their positions in the second frame.

    Parameters
    ----------
    points
        (H, W, 3) metres, seen in the first frame; NaN = none.
    disparity
        (H, W) px, of the same points.
    places_after
        (2, H, W) rows and columns of the same points in the second frame, px; NaN = none.
    camera
        The left camera.
    settings
        Expected errors of the flow and the disparities.
    image
        (H, W) or (H, W, 3 | 4), the first frame: if given, its corners are used, otherwise evenly spread pixels.

    Raises
    ------
    ValueError
        If there are fewer than 20 points, or not enough of them agree on a motion.

    Notes
    -----
    Perspective-n-point by RANSAC, refined with Levenberg-Marquardt on all inliers (OpenCV's ``solvePnPRansac`` and
    ``solvePnPRefineLM``). OpenCV seeds its random numbers anew in each call, so the result is deterministic. The
    standard error is robust to errors shared by the pixels of an area (C. Cameron and D. Miller, "A practitioner's
    guide to cluster-robust inference", Journal of Human Resources 50, 2015).
    """
    max_depth = camera.calibration.focal_px * camera.calibration.baseline_m / MIN_DISPARITY_PX
    known: Mask = np.isfinite(points).all(axis=2) & np.isfinite(places_after).all(axis=0) & (points[..., 2] < max_depth)
    usable = np.flatnonzero(known) if image is None else corners(image, known)
    if usable.size < MIN_POINTS:
        raise ValueError(f"Only {usable.size} pixels have both depth and motion; at least {MIN_POINTS} are needed.")
    chosen = usable[np.linspace(0, usable.size - 1, min(usable.size, MAX_POINTS)).astype(np.intp)]
    row, col = np.unravel_index(chosen, known.shape)
    sample = _Sample(
        points.reshape(-1, 3)[chosen],
        disparity.ravel()[chosen],
        np.stack([row, col]).astype(np.float32),
        places_after.reshape(2, -1)[:, chosen],
        row * AREA_GRID[0] // known.shape[0] * AREA_GRID[1] + col * AREA_GRID[1] // known.shape[1],
    )
    tolerance = 3 * settings.flow_error
    own, inliers = _fitted(sample, camera, tolerance)
    votes, explained = sample.votes(), _explained(own, sample, camera, settings)
    doubt: Doubt = "" if votes[explained].sum() >= MIN_EXPLAINED_SHARE else "nothing static"
    rest = sample.part(~explained)
    if votes[~explained].sum() >= MIN_RIVAL_SHARE and len(rest.points) >= MIN_POINTS:
        try:
            by_rival = _explained(_fitted(rest, camera, tolerance)[0], sample, camera, settings)
        except ValueError:
            by_rival = explained
        only_own, only_rival = votes[explained & ~by_rival].sum(), votes[by_rival & ~explained].sum()
        if only_rival >= max(MIN_RIVAL_SHARE, MIN_RIVAL_RATIO * only_own):
            doubt = "two motions"
    return replace(own, error_m=_standard_error(own, sample.part(inliers), camera, settings), doubt=doubt)


def _fitted(sample: _Sample, camera: Camera, tolerance: float) -> tuple[OwnMotion, Mask]:
    """Return the rigid motion that most pixels agree with to within a tolerance, px, and the mask of these pixels."""
    image_points = np.ascontiguousarray(sample.places_after[::-1].T).astype(np.float64)
    found, rotation_vector, shift, numbers = cv2.solvePnPRansac(
        sample.points,
        image_points,
        camera.matrix,
        None,
        iterationsCount=500,
        reprojectionError=tolerance,
        confidence=0.9999,
        flags=cv2.SOLVEPNP_SQPNP,  # P3P, which uses three points alone, once was off by a tenth, with 95 % inliers
    )
    inliers = np.zeros(len(image_points), np.bool_)
    inliers[numbers[:, 0] if found and numbers is not None else []] = True
    for _ in range(3):
        if np.count_nonzero(inliers) < MIN_POINTS:
            break
        rotation_vector, shift = cv2.solvePnPRefineLM(
            sample.points[inliers], image_points[inliers], camera.matrix, None, rotation_vector, shift
        )
        rotation = np.asarray(cv2.Rodrigues(rotation_vector)[0], np.float64)
        translation = np.asarray(shift[:, 0], np.float64)
        projected = camera.projected(sample.points @ rotation.T + translation)
        inliers = np.hypot(*(projected - sample.places_after)) < tolerance
    if np.count_nonzero(inliers) < MIN_POINTS:
        raise ValueError("No rigid motion explains the flow: nothing static seems to be in view.")
    return OwnMotion(rotation, translation, float(inliers.mean())), inliers


def _explained(motion: OwnMotion, sample: _Sample, camera: Camera, settings: MovingTest) -> Mask:
    """Return the mask of pixels that a motion explains to within the expected errors of their flow and depth."""
    expected = camera.observed(motion.moved(sample.points))
    errors = expected_errors(motion, expected, sample.disparity, sample.places, camera, settings)
    return np.asarray(np.hypot(*((sample.places_after - expected[:2]) / errors[:2])) <= settings.threshold)


def expected_errors(
    own: OwnMotion,
    expected: DoubleMap,
    disparity: FloatMap,
    places: FloatMap,
    camera: Camera,
    settings: MovingTest,
) -> DoubleMap:
    """Return the (3, ...) expected errors of a static point's row, column and disparity in the second frame, px.

    Parameters
    ----------
    own
        The motion of the static world.
    expected
        (3, ...) row, column and disparity of the points in the second frame, px.
    disparity, places
        (...) and (2, ...) disparity, row and column in the first frame, px.
    camera, settings
        The left camera, and the errors of flow and disparities.
    """
    varied = own.moved(camera.points(disparity + np.float32(DISPARITY_STEP_PX), places))
    slope = (camera.observed(varied) - expected) / DISPARITY_STEP_PX
    flow_error = settings.flow_error + settings.relative_error * np.hypot(*(expected[:2] - places))
    measurement_error = np.stack([flow_error, flow_error, np.full(disparity.shape, settings.disparity_error)])
    return np.asarray(np.hypot(measurement_error, slope * settings.disparity_error))


def _standard_error(own: OwnMotion, sample: _Sample, camera: Camera, settings: MovingTest) -> float:
    """Return the standard error of the distance travelled, metres; infinite with too few areas."""
    rotation_vector = cv2.Rodrigues(own.rotation)[0]
    projected, jacobian = cv2.projectPoints(sample.points, rotation_vector, own.translation, camera.matrix, None)
    jacobian = jacobian[:, :6].reshape(-1, 2, 6)
    areas, number = np.unique(sample.area, return_inverse=True)
    if areas.size <= jacobian.shape[2]:
        return np.inf
    scores = np.zeros((areas.size + 1, jacobian.shape[2]))  # gradients of the sum of squares, one for each cluster
    np.add.at(scores, number, np.einsum("nij,ni->nj", jacobian, sample.places_after[::-1].T - projected[:, 0]))
    # An error common to all disparities moves every point along its ray.
    common_error = np.float32(COMMON_ERROR_SHARE * settings.disparity_error)
    varied = own.moved(camera.points(sample.disparity + common_error, sample.places))
    scores[-1] = np.einsum("nij,in->j", jacobian, camera.projected(varied)[::-1] - projected[:, 0].T)
    information = np.einsum("nij,nik->jk", jacobian, jacobian)
    information += 1e-12 * np.trace(information) * np.eye(len(information))  # collinear points leave a rotation free
    deviations = np.linalg.solve(information, scores.T)[3:]
    return float(np.sqrt(np.linalg.eigvalsh(deviations @ deviations.T)[-1]))


def corners(image: Image, known: Mask) -> Indices:
    """Return the flat indices of the best corner of each cell among the known pixels.

    The smaller eigenvalue of the structure tensor measures how distinct a window is from its neighbours (Shi & Tomasi,
    "Good features to track", CVPR 1994).
    """
    grey = cv2.GaussianBlur(as_grey(image).astype(np.float32), (0, 0), 1.0)
    strength = np.where(known, cv2.cornerMinEigenVal(grey, 7), np.float32(-1))
    rows, cols = (side // CELL_PX for side in strength.shape)
    cells = strength[: rows * CELL_PX, : cols * CELL_PX].reshape(rows, CELL_PX, cols, CELL_PX).swapaxes(1, 2)
    flat = cells.reshape(rows, cols, CELL_PX * CELL_PX)
    best, best_strength = flat.argmax(axis=2), flat.max(axis=2)
    kept = best_strength >= 0
    if not kept.any():
        return np.empty(0, np.intp)
    kept &= best_strength >= np.quantile(best_strength[kept], FLAT_SHARE)
    row, col = np.nonzero(kept)
    row_inside, col_inside = np.divmod(best[kept], CELL_PX)
    return np.asarray((row * CELL_PX + row_inside) * known.shape[1] + col * CELL_PX + col_inside, np.intp)
