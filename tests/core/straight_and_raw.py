"""A rectified pair of a known stereo camera, and the same pair as taken by that camera."""

from functools import cache

import cv2
import numpy as np

from stereolag.core.arrays import EightBit
from stereolag.geometry.calibration import StereoRig

SIZE = (320, 240)
M1 = np.array([[280, 0, 157], [0, 283, 123], [0, 0, 1.0]])
M2 = np.array([[284, 0, 165], [0, 283, 117], [0, 0, 1.0]])
D1 = np.array([-0.25, 0.08, 0.001, -0.0008, 0])
D2 = np.array([-0.22, 0.06, -0.0006, 0.0012, 0.002])
R = cv2.Rodrigues(np.array([0.012, -0.03, 0.015]))[0]
T = np.array([-0.12, 0.004, -0.003])
RIG = StereoRig(M1, D1, M2, D2, R, T, *SIZE)
R1, R2, P1, P2, Q, *_ = cv2.stereoRectify(M1, D1, M2, D2, SIZE, R, T[:, None], flags=cv2.CALIB_ZERO_DISPARITY, alpha=0)
ENTRIES = {"M1": M1, "D1": D1, "M2": M2, "D2": D2, "R": R, "T": T, "image_width": SIZE[0], "image_height": SIZE[1]}
RECTIFYING = {"R1": R1, "R2": R2, "P1": P1, "P2": P2, "Q": Q}
DISPARITY = 14


@cache
def straight_pair(seed: int = 0) -> tuple[EightBit, EightBit]:
    """Return a rectified pair of grey blobs, all at one distance."""
    noise = np.random.default_rng(seed).uniform(0, 1, (SIZE[1], SIZE[0] + DISPARITY)).astype(np.float32)
    blobs = cv2.GaussianBlur(noise, (0, 0), 2.0)
    grey = cv2.normalize(blobs, None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)
    return grey[:, : SIZE[0]].copy(), grey[:, DISPARITY:].copy()


@cache
def raw_pair(seed: int = 0) -> tuple[EightBit, EightBit]:
    """Return the same pair as taken by the cameras."""
    cameras = ((M1, D1, R1, P1[:, :3]), (M2, D2, R2, P2[:, :3]))
    maps = [cv2.initInverseRectificationMap(*camera, SIZE, cv2.CV_32FC1) for camera in cameras]
    left, right = (
        cv2.remap(image, *found, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
        for image, found in zip(straight_pair(seed), maps, strict=True)
    )
    return left, right
