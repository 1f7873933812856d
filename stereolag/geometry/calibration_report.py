"""The result of a calibration: its quality, and the outcome for each pair of pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import cv2
import numpy as np

from stereolag.geometry.boards import Board, Corners
from stereolag.geometry.calibration import Calibration
from stereolag.geometry.joint_fit import JointFit
from stereolag.geometry.rectification import rectification
from stereolag.geometry.relative_poses import SeenPair
from stereolag.geometry.rig import StereoRig

UNTIL = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 50, 1e-9)
"""Criteria to stop inverting the distortion; after OpenCV's five rounds a wide lens is off by a fifth of a px."""

COVERAGE_CELLS = 100
"""Cells each way in which the coverage by boards is counted."""


class LeftOut(StrEnum):
    """Why a pair is left out."""

    NOT_FOUND_LEFT = "not_found_left"
    NOT_FOUND_RIGHT = "not_found_right"
    NOT_FOUND = "not_found"
    OTHER_SIZE = "other_size"
    FEW_IN_COMMON = "few_in_common"
    SAME_VIEW = "same_view"
    NOT_FLAT = "not_flat"
    CONTRADICTS = "contradicts"
    BY_HAND = "by_hand"


@dataclass(frozen=True, eq=False)
class PairReport:
    """The outcome for one pair of pictures.

    Attributes
    ----------
    left, right
        Corners found, those of the right picture in the order of the left one; None if there are none.
    left_out
        Why the pair is left out; None if it counts.
    turned
        Whether the corners in the right picture had been counted from another end of the board, and were reordered.
    left_rms, right_rms
        Distance of the corners from where the calibration puts them, px RMS; NaN if unknown.
    row_error
        Row difference of matching corners after rectification, px, on average; NaN if unknown.
    """

    left: Corners | None
    right: Corners | None
    left_out: LeftOut | None
    turned: bool = False
    left_rms: float = np.nan
    right_rms: float = np.nan
    row_error: float = np.nan


@dataclass(frozen=True, eq=False)
class StereoCalibration:
    """A calibrated stereo camera.

    Attributes
    ----------
    calibration
        Calibration with its rig and its ``rms``.
    board
        The board in the pictures.
    square_m
        Side of a square, metres.
    pairs
        The outcome for each pair.
    rms
        Distance of the corners from where the calibration puts them, px RMS over both cameras and all pairs that count,
        as returned by ``cv2.stereoCalibrate``.
    row_error
        Row difference of matching corners after rectification, px, on average over these pairs.
    left_coverage, right_coverage
        Share of each picture that has been covered by a board, 0..1.
    focal_error
        Standard error of the focal lengths, as a share of them; the larger one of the two cameras.
    """

    calibration: Calibration
    board: Board
    square_m: float
    pairs: tuple[PairReport, ...]
    rms: float
    row_error: float
    left_coverage: float
    right_coverage: float
    focal_error: float

    @property
    def used(self) -> tuple[int, ...]:
        """Return the numbers of the pairs that count."""
        return tuple(number for number, pair in enumerate(self.pairs) if pair.left_out is None)


def row_errors(seen: dict[int, SeenPair], fit: JointFit, rig: StereoRig, size: tuple[int, int]) -> dict[int, float]:
    """Return the row difference of matching corners in the rectified pair, px, on average over each pair."""
    how = rectification(rig, size)
    cameras = (
        (fit.left.matrix, fit.left.distortion, how.left_rotation, how.left_projection),
        (fit.right.matrix, fit.right.distortion, how.right_rotation, how.right_projection),
    )
    errors = {}
    for number, pair in seen.items():
        left, right = (
            cv2.undistortPoints(places[:, None], matrix, distortion, R=turn, P=projection, criteria=UNTIL)[:, 0, 1]
            for places, (matrix, distortion, turn, projection) in zip(
                (pair.left, pair.right[fit.orders[number]]), cameras, strict=True
            )
        )
        errors[number] = float(np.abs(left - right).mean())
    return errors


def coverage(corners: Sequence[Corners], size: tuple[int, int]) -> float:
    """Return the share of a picture, 0..1, that the board covered in at least one of the pictures."""
    cells = np.zeros((COVERAGE_CELLS, COVERAGE_CELLS), np.uint8)
    for one in corners:
        places = np.floor(one.points * COVERAGE_CELLS / size).astype(np.int32)
        cv2.fillConvexPoly(cells, cv2.convexHull(places), 1)
    return float(cells.mean())
