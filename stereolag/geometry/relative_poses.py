"""The pose of the right camera from each pair of board pictures, and the pairs that agree on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
import scipy  # scipy.optimize is loaded only on first use: the quick judgement of a pair does not need it

from stereolag.core.arrays import DoubleMap, Vector

COARSE_SHARE = 0.02
"""Largest distance of another pair's corners from where one pair's pose puts them, as a share of the picture's width.
One pair determines the tilt of its board, and so of the right camera, only to a fraction of a degree."""


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera matrix (3, 3) and its distortion coefficients."""

    matrix: DoubleMap
    distortion: Vector


@dataclass(frozen=True, eq=False)
class SeenPair:
    """A board seen in both pictures of a pair.

    Attributes
    ----------
    points
        (n, 3) corners of the board that both show, in squares.
    left
        (n, 2) their positions in the left picture, px.
    right
        The same in the right picture, once for each possible order of its corners.
    """

    points: DoubleMap
    left: DoubleMap
    right: tuple[DoubleMap, ...]


@dataclass(frozen=True, eq=False)
class Agreement:
    """The pairs that agree on the pose of the right camera.

    Attributes
    ----------
    agreeing
        (n,) bool.
    orders
        (n,) index of the order of each pair's right corners that fits best.
    """

    agreeing: npt.NDArray[np.bool_]
    orders: npt.NDArray[np.intp]


def agreement(pairs: Sequence[SeenPair], left: Camera, right: Camera, width: int) -> Agreement:
    """Return the largest set of pairs that agree on the pose of the right camera.

    The pose from each pair is tried on all others: with the right camera there, the board seen by the left camera must
    appear in the right picture where it does. Pictures not taken at the same moment, of another board or turned round
    agree with no others.

    Parameters
    ----------
    pairs
        Pairs of one rig.
    left, right
        The cameras, each calibrated on its own.
    width
        Width of the pictures, px.
    """
    boards = [_pose(pair.points, pair.left, left) for pair in pairs]
    best: Agreement | None = None
    rank: tuple[float, ...] = ()
    for (rotation, translation), pair in zip(boards, pairs, strict=True):
        for points in pair.right:
            turn, place = _pose(pair.points, points, right)
            between = turn @ rotation.T
            errors = [
                _errors(other, between @ turned, between @ moved + place - between @ translation, right)
                for other, (turned, moved) in zip(pairs, boards, strict=True)
            ]
            least = np.array([min(one) for one in errors])
            agreeing = least <= COARSE_SHARE * width
            # If a board looks the same from two ends, all pairs turned round would agree too; the camera is not.
            upright = float(np.trace(between)) > 1  # rotated by less than a right angle
            typical = float(np.median(least[agreeing])) if agreeing.any() else np.inf
            now = (float(agreeing.sum()), float(upright), -typical)
            if best is None or now > rank:
                best, rank = Agreement(agreeing, np.array([int(np.argmin(one)) for one in errors])), now
    assert best is not None
    return best


def pair_errors(
    pair: SeenPair, order: int, left: Camera, right: Camera, rotation: DoubleMap, translation: Vector
) -> tuple[float, float]:
    """Return how far the corners are from where a rig puts them, left and right, px RMS, at the board's best pose."""
    seen = pair.left, pair.right[order]
    start = _pose(pair.points, pair.left, left)

    def residuals(pose: Vector) -> Vector:
        turn, place = np.asarray(cv2.Rodrigues(pose[:3])[0], dtype=np.float64), pose[3:]
        beside = rotation @ turn, rotation @ place + translation
        placed = (
            _projected(pair.points, turn, place, left) - seen[0],
            _projected(pair.points, *beside, right) - seen[1],
        )
        return np.concatenate(placed).ravel()

    begin = np.concatenate((cv2.Rodrigues(start[0])[0].ravel(), start[1]))
    fitted = scipy.optimize.least_squares(residuals, begin, method="lm", max_nfev=400)
    ends = np.square(residuals(fitted.x)).reshape(2, -1)
    first, second = np.sqrt(2 * ends.mean(axis=1))
    return float(first), float(second)


def _pose(points: DoubleMap, seen: DoubleMap, camera: Camera) -> tuple[DoubleMap, Vector]:
    """Return the rotation (3, 3) and the translation (3,) of a board in a camera's frame."""
    found, turn, place = cv2.solvePnP(points, seen, camera.matrix, camera.distortion, flags=cv2.SOLVEPNP_IPPE)
    if found:
        turn, place = cv2.solvePnPRefineLM(points, seen, camera.matrix, camera.distortion, turn, place)
    else:
        _, turn, place = cv2.solvePnP(points, seen, camera.matrix, camera.distortion)
    return np.asarray(cv2.Rodrigues(turn)[0], dtype=np.float64), np.asarray(place, dtype=np.float64).ravel()


def _errors(pair: SeenPair, rotation: DoubleMap, translation: Vector, right: Camera) -> list[float]:
    """Return how far the right corners are from a prediction, px RMS, for each order."""
    placed = _projected(pair.points, rotation, translation, right)
    return [float(np.sqrt(np.square(placed - seen).sum(axis=1).mean())) for seen in pair.right]


def _projected(points: DoubleMap, rotation: DoubleMap, translation: Vector, camera: Camera) -> DoubleMap:
    turn = cv2.Rodrigues(rotation)[0]
    return np.asarray(cv2.projectPoints(points, turn, translation, camera.matrix, camera.distortion)[0][:, 0])
