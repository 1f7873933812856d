"""A stereo pair with surfaces at several depths, for tests that need better and worse maps."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from pairs import texture

FAR = 4
NEAR = {(30, 90, 60, 130): 14, (80, 140, 150, 230): 20, (15, 60, 170, 250): 9}
"""{(first row, end row, first column, end column): disparity} of the squares in front of the wall."""

Picture = npt.NDArray[np.uint8]


def steps_pair(*, noise: float = 8.0) -> tuple[Picture, Picture, npt.NDArray[np.float32]]:
    """Return left, right and truth: squares in front of a wall, 160 × 280, with noise in grey levels."""
    rng = np.random.default_rng(5)
    left = texture(160, 280, seed=4, blur=1.5)
    right = np.roll(left, -FAR, axis=1)
    truth = np.full(left.shape, FAR, dtype=np.float32)
    for (top, bottom, first, last), disparity in sorted(NEAR.items(), key=lambda one: one[1]):
        patch = texture(bottom - top, last - first, seed=disparity, blur=1.5)
        left[top:bottom, first:last] = patch
        right[top:bottom, first - disparity : last - disparity] = patch
        truth[top:bottom, first:last] = disparity
    both = [np.clip(np.rint(image + rng.normal(0, noise, image.shape)), 0, 255) for image in (left, right)]
    return both[0].astype(np.uint8), both[1].astype(np.uint8), truth
