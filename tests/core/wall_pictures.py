"""A wall at 6 m as any two cameras take it, drawn by casting the ray of every pixel."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.geometry.calibration import StereoRig

WALL_M = 6.0


def wall_pictures(rig: StereoRig, size: tuple[int, int]) -> list[npt.NDArray[np.uint8]]:
    """Return what both cameras see of a spotted wall straight ahead of the left one, in pictures of this size."""
    noise = np.random.default_rng(7).uniform(0, 255, (1200, 1200)).astype(np.float32)
    spots = cv2.normalize(cv2.GaussianBlur(noise, (0, 0), 2.5), None, 0, 255, cv2.NORM_MINMAX)
    cols, rows = np.meshgrid(np.arange(size[0], dtype=np.float64), np.arange(size[1], dtype=np.float64))
    pixels = np.stack((cols, rows), axis=-1).reshape(-1, 1, 2)
    pictures = []
    for matrix, lens, turn, place in (
        (rig.left_matrix, rig.left_distortion, np.eye(3), np.zeros(3)),
        (rig.right_matrix, rig.right_distortion, rig.rotation, rig.translation),
    ):
        undistorted = (cv2.fisheye if rig.fisheye else cv2).undistortPoints(pixels, matrix, lens)
        rays = np.column_stack((undistorted.reshape(-1, 2), np.ones(len(pixels)))) @ turn
        eye = -turn.T @ place
        on_wall = eye + rays * ((WALL_M - eye[2]) / rays[:, 2])[:, None]
        texture = (60 * on_wall[:, :2] + 600).astype(np.float32).reshape(size[1], size[0], 2)
        seen = cv2.remap(spots, texture[:, :, 0], texture[:, :, 1], cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
        pictures.append(np.clip(np.rint(seen), 0, 255).astype(np.uint8))
    return pictures
