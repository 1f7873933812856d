"""Our own motion: the rigid motion of the static world, whether it may be another, and how exactly it is known."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import DoubleMap, FloatMap, Indices, Mask, Vector
from stereolag.core.inputs import Image, as_grey
from stereolag.motion.moving_objects import Camera, MovingTest, Points

MOST_POINTS = 4000
"""Most points used, taken evenly over the image; more do not improve the motion."""

CELL = 8
"""Side of the image cells that contribute their best pixel each, if the image is given, px."""

FLAT_SHARE = 0.3
"""Share of the cells left out, those with the least structure: flow is least accurate without texture."""

LEAST_DISPARITY = 2.0
"""Least disparity used, px: farther points agree with any translation and would outvote near ones."""

FEWEST_POINTS = 20
TRIALS, CONFIDENCE, REFINEMENTS = 500, 0.9999, 3

AREAS = (12, 20)
"""Rows and columns of areas of the picture. Each has one vote, however rich its texture, and counts as one independent
witness: flow and disparity are smooth over the width of their windows."""

MAJORITY, LEAST_RIVAL, RIVAL = 0.5, 0.1, 0.5
"""Least share of the areas that our own motion explains. Of those that only one of two motions explains, a rival has
this share of the whole or more, and this share of our own motion's."""

COMMON = 0.5
"""Share of the expected error of a disparity that all disparities of a map may have in common."""

PROBE = 0.5
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
        Share of the pixels used that agree, 0..1.
    error_m
        Standard error of the distance travelled, metres.
    doubt
        Why it may not be that of the world: "nothing static" if it explains less than half of the picture; "two
        motions" if it alone explains less than twice as much as another one alone: a bonnet, or a lorry ahead that is
        as fast as we are, looks like a world that stands still. Otherwise "".
    """

    rotation: npt.NDArray[np.float64]
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
    """N pixels: their points (N, 3), disparities, rows and columns, those in the second frame, and areas."""

    points: Points
    disparity: npt.NDArray[np.float32]
    places: npt.NDArray[np.float32]
    seen: npt.NDArray[np.float32]
    area: Indices

    def part(self, chosen: Mask) -> _Sample:
        points, disparity, places, seen, area = self
        return _Sample(points[chosen], disparity[chosen], places[:, chosen], seen[:, chosen], area[chosen])

    def votes(self) -> Vector:
        """Return the weight of each pixel in the vote of all areas, which is 1 in sum."""
        counts = np.bincount(self.area)
        return np.asarray(1 / (counts[self.area] * np.count_nonzero(counts)))


def estimate_own_motion(
    points: Points,
    disparity: FloatMap,
    places: FloatMap,
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
    places
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
    standard error is robust to errors that the pixels of an area share (C. Cameron and D. Miller, "A practitioner's
    guide to cluster-robust inference", Journal of Human Resources 50, 2015).
    """
    farthest = camera.calibration.focal_px * camera.calibration.baseline_m / LEAST_DISPARITY
    known: Mask = np.isfinite(points).all(axis=2) & np.isfinite(places).all(axis=0) & (points[..., 2] < farthest)
    usable = np.flatnonzero(known) if image is None else corners(image, known)
    if usable.size < FEWEST_POINTS:
        raise ValueError(f"Only {usable.size} pixels have both depth and motion; at least {FEWEST_POINTS} are needed.")
    chosen = usable[np.linspace(0, usable.size - 1, min(usable.size, MOST_POINTS)).astype(np.intp)]
    row, col = np.unravel_index(chosen, known.shape)
    sample = _Sample(
        points.reshape(-1, 3)[chosen],
        disparity.ravel()[chosen],
        np.stack([row, col]).astype(np.float32),
        places.reshape(2, -1)[:, chosen],
        row * AREAS[0] // known.shape[0] * AREAS[1] + col * AREAS[1] // known.shape[1],
    )
    tolerance = 3 * settings.flow_error
    own, agreeing = _fitted(sample, camera, tolerance)
    votes, explained = sample.votes(), _explains(own, sample, camera, settings)
    doubt: Doubt = "" if votes[explained].sum() >= MAJORITY else "nothing static"
    rest = sample.part(~explained)
    if votes[~explained].sum() >= LEAST_RIVAL and len(rest.points) >= FEWEST_POINTS:
        try:
            rival = _explains(_fitted(rest, camera, tolerance)[0], sample, camera, settings)
        except ValueError:
            rival = explained
        alone = votes[rival & ~explained].sum()
        if alone >= max(LEAST_RIVAL, RIVAL * votes[explained & ~rival].sum()):
            doubt = "two motions"
    error_m = _standard_error(own, sample.part(agreeing), camera, settings)
    return replace(own, error_m=error_m, doubt=doubt)


def _fitted(sample: _Sample, camera: Camera, tolerance: float) -> tuple[OwnMotion, Mask]:
    """Return the rigid motion that most pixels agree with, within a tolerance, px, and which ones do."""
    seen = np.ascontiguousarray(sample.seen[::-1].T).astype(np.float64)
    found, turn, shift, numbers = cv2.solvePnPRansac(
        sample.points,
        seen,
        camera.matrix,
        None,
        iterationsCount=TRIALS,
        reprojectionError=tolerance,
        confidence=CONFIDENCE,
        flags=cv2.SOLVEPNP_SQPNP,  # of three points alone, P3P's motion once was a tenth off, with 95 % of the inliers
    )
    agreeing = np.zeros(len(seen), np.bool_)
    agreeing[numbers[:, 0] if found and numbers is not None else []] = True
    for _ in range(REFINEMENTS):
        if np.count_nonzero(agreeing) < FEWEST_POINTS:
            break
        turn, shift = cv2.solvePnPRefineLM(sample.points[agreeing], seen[agreeing], camera.matrix, None, turn, shift)
        rotation, translation = np.asarray(cv2.Rodrigues(turn)[0], np.float64), np.asarray(shift[:, 0], np.float64)
        projected = camera.projected(sample.points @ rotation.T + translation)
        agreeing = np.hypot(*(projected - sample.seen)) < tolerance
    if np.count_nonzero(agreeing) < FEWEST_POINTS:
        raise ValueError("No rigid motion explains the flow: nothing static seems to be in view.")
    return OwnMotion(rotation, translation, float(agreeing.mean())), agreeing


def _explains(motion: OwnMotion, sample: _Sample, camera: Camera, settings: MovingTest) -> Mask:
    """Return which pixels a motion explains, within the errors to be expected of their flow and their depth."""
    expected = camera.seen(motion.moved(sample.points))
    errors = expected_errors(motion, expected, sample.disparity, sample.places, camera, settings)
    return np.asarray(np.hypot(*((sample.seen - expected[:2]) / errors[:2])) <= settings.threshold)


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
    varied = own.moved(camera.points(disparity + np.float32(PROBE), places))
    slope = (camera.seen(varied) - expected) / PROBE
    flow_error = settings.flow_error + settings.relative_error * np.hypot(*(expected[:2] - places))
    own_error = np.stack([flow_error, flow_error, np.full(disparity.shape, settings.disparity_error)])
    return np.asarray(np.hypot(own_error, slope * settings.disparity_error))


def _standard_error(own: OwnMotion, sample: _Sample, camera: Camera, settings: MovingTest) -> float:
    """Return the standard error of the distance travelled, metres; infinite if too few areas tell."""
    turn = cv2.Rodrigues(own.rotation)[0]
    projected, slopes = cv2.projectPoints(sample.points, turn, own.translation, camera.matrix, None)
    slopes = slopes[:, :6].reshape(-1, 2, 6)
    areas, number = np.unique(sample.area, return_inverse=True)
    if areas.size <= slopes.shape[2]:
        return np.inf
    pulls = np.zeros((areas.size + 1, slopes.shape[2]))
    np.add.at(pulls, number, np.einsum("nij,ni->nj", slopes, sample.seen[::-1].T - projected[:, 0]))
    # An error that all disparities share moves every point along its ray.
    varied = own.moved(camera.points(sample.disparity + np.float32(COMMON * settings.disparity_error), sample.places))
    pulls[-1] = np.einsum("nij,in->j", slopes, camera.projected(varied)[::-1] - projected[:, 0].T)
    information = np.einsum("nij,nik->jk", slopes, slopes)
    information += 1e-12 * np.trace(information) * np.eye(len(information))  # points on a line leave a turn open
    spread = np.linalg.solve(information, pulls.T)[3:]
    return float(np.sqrt(np.linalg.eigvalsh(spread @ spread.T)[-1]))


def corners(image: Image, known: Mask) -> Indices:
    """Return the flat indices of the best corner of every cell among the known pixels.

    The smaller eigenvalue of the structure tensor measures how distinct a window is from its neighbours (Shi & Tomasi,
    "Good features to track", CVPR 1994).
    """
    grey = cv2.GaussianBlur(as_grey(image).astype(np.float32), (0, 0), 1.0)
    strength = np.where(known, cv2.cornerMinEigenVal(grey, 7), np.float32(-1))
    rows, cols = (side // CELL for side in strength.shape)
    cells = strength[: rows * CELL, : cols * CELL].reshape(rows, CELL, cols, CELL).swapaxes(1, 2)
    flat = cells.reshape(rows, cols, CELL * CELL)
    best, strongest = flat.argmax(axis=2), flat.max(axis=2)
    there = strongest >= 0
    if not there.any():
        return np.empty(0, np.intp)
    there &= strongest >= np.quantile(strongest[there], FLAT_SHARE)
    row, col = np.nonzero(there)
    inside = best[there]
    found = (row * CELL + inside // CELL) * known.shape[1] + col * CELL + inside % CELL
    return np.asarray(found, np.intp)
