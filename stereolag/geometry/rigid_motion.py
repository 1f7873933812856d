"""Exact motion of pixels with known depth on objects that move as rigid bodies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import FloatMap
from stereolag.geometry.calibration import Calibration


@dataclass(frozen=True)
class RigidMotion:
    """Motion of every pixel from one frame to the next, all ``(height, width)`` float32, px.

    Attributes
    ----------
    dy, dx
        Position of the pixel's point in the next frame minus its position in this one; NaN where the point will be
        behind the camera. It may be outside the next frame, or hidden there.
    disparity_change
        Disparity of the point in the next frame minus its disparity in this one.
    """

    dy: FloatMap
    dx: FloatMap
    disparity_change: FloatMap


def rigid_motion(
    disparity: npt.ArrayLike, objects: npt.NDArray[np.uint8], motions: npt.ArrayLike, calibration: Calibration
) -> RigidMotion:
    """Return the optical flow and the change of disparity caused by rigid motions.

    Parameters
    ----------
    disparity
        ``(height, width)``, px, of a rectified pair; 0 or NaN means infinitely far.
    objects
        ``(height, width)``, the number of the body shown by each pixel.
    motions
        ``(bodies, 4, 4)``: entry `n` takes body `n` from the left camera's coordinates in this frame (metres, x to the
        right, y down, z forwards) to those in the next.
    calibration
        Calibration of the rectified pair.

    Returns
    -------
    motion

    Raises
    ------
    ValueError
        Maps of different shape, motions that are not 4 × 4, or a pixel that shows a body without a motion.

    Notes
    -----
    A point is represented as ``(x, y, z, 1) / z``, so that one formula serves the sky too: its last component is 0,
    which leaves only the rotation. Scene flow as in Menze & Geiger, "Object Scene Flow for Autonomous Vehicles", 2015.
    """
    shift = np.asarray(disparity, dtype=np.float64)
    shift = np.where(shift > 0, shift + calibration.doffs_px, 0.0)
    poses = np.asarray(motions, dtype=np.float64)
    if shift.ndim != 2 or shift.shape != objects.shape:
        raise ValueError(
            f"disparity is {shift.shape} and objects is {objects.shape}; allowed are two maps of one shape."
        )
    if poses.ndim != 3 or poses.shape[1:] != (4, 4):
        raise ValueError(f"motions is {poses.shape}; allowed is (bodies, 4, 4).")
    if objects.size and objects.max() >= len(poses):
        raise ValueError(f"objects has number {objects.max()}; allowed are 0 to {len(poses) - 1}, one for each motion.")

    focal, scale = calibration.focal_px, calibration.focal_px * calibration.baseline_m
    height, width = shift.shape
    cx = (width - 1) / 2 if calibration.cx is None else calibration.cx
    cy = (height - 1) / 2 if calibration.cy is None else calibration.cy
    rows, columns = np.mgrid[:height, :width].astype(np.float64)
    point = np.stack([(columns - cx) / focal, (rows - cy) / focal, np.ones(shift.shape), shift / scale], -1)
    moved = np.einsum("hwij,hwj->hwi", poses[objects], point)
    ahead = np.where(moved[..., 2] > 0, moved[..., 2], np.nan)
    return RigidMotion(
        dy=(focal * moved[..., 1] / ahead + cy - rows).astype(np.float32),
        dx=(focal * moved[..., 0] / ahead + cx - columns).astype(np.float32),
        disparity_change=(shift / ahead - shift).astype(np.float32),
    )
