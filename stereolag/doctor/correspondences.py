"""A sparse set of reliable matches between two views, found without any assumption about rows, range or exposure."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.inputs import Image, as_grey

Points = npt.NDArray[np.float32]

FEATURES = 2000
LARGEST_SIDE = 1000
PATCH = 15
"""Side of the window whose flow refines a match, px."""

AGREEMENT = 2.5
"""A match whose dy is farther from the fitted plane of dy than this many robust standard deviations is dropped."""

LARGEST_SPREAD = 0.03
"""Matches that scatter more about their plane, as a share of the image's height, agree on nothing."""


@dataclass(frozen=True)
class Correspondences:
    """Matched points: (n, 2) float32 (x, y) in the left and in the right image, px, and the images' (rows, cols)."""

    left: Points
    right: Points
    shape: tuple[int, int]

    @property
    def dx(self) -> Points:
        """Return the horizontal displacements, right minus left, px."""
        return self.right[:, 0] - self.left[:, 0]

    @property
    def dy(self) -> Points:
        """Return the vertical displacements, right minus left, px."""
        return self.right[:, 1] - self.left[:, 1]

    def __len__(self) -> int:
        return len(self.left)


def find_correspondences(left: Image, right: Image) -> Correspondences:
    """Match ORB features (Rublee et al. 2011) and refine them to a fraction of a pixel by Lucas-Kanade flow.

    Parameters
    ----------
    left, right
        (H, W) or (H, W, 3 | 4) images of one size: uint8, uint16 or float.

    Returns
    -------
    Correspondences
        The mutual best matches that agree on how dy varies over the image; possibly none.
    """
    shape = left.shape[0], left.shape[1]
    scale = min(1.0, LARGEST_SIDE / max(shape))
    detector = cv2.ORB.create(FEATURES, fastThreshold=8)
    none = np.empty((0, 2), dtype=np.float32)
    if min(shape) * scale < detector.getPatchSize():
        return Correspondences(none, none, shape)
    views = [_stretched(image, scale) for image in (left, right)]
    (left_keys, left_codes), (right_keys, right_codes) = (detector.detectAndCompute(view, None) for view in views)
    if left_codes is None or right_codes is None:
        return Correspondences(none, none, shape)
    pairs = cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True).match(left_codes, right_codes)
    start = np.array([left_keys[pair.queryIdx].pt for pair in pairs], dtype=np.float32).reshape(-1, 2)
    guess = np.array([right_keys[pair.trainIdx].pt for pair in pairs], dtype=np.float32).reshape(-1, 2)
    start, end = _refined(views[0], views[1], start, guess)
    # A pixel of the small image is the centre of a block of the large one.
    start, end = (start + 0.5) / scale - 0.5, (end + 0.5) / scale - 0.5
    found = Correspondences(start, end, shape)
    keep = _consistent(found)
    return Correspondences(found.left[keep], found.right[keep], shape)


def vertical_plane(points: Correspondences) -> tuple[float, float, float]:
    """Return (a, b, c) of ``right.y = a + b * (x - cx) + (1 + c) * (y - cy) + cy`` by least squares over the matches.

    a is the row offset at the centre (px), b the sine of the rotation and c the difference of scale between the views.
    """
    centre = (np.array(points.shape[::-1]) - 1) / 2
    offset = points.left - centre
    plane = np.column_stack([np.ones(len(points)), offset])
    fit, *_ = np.linalg.lstsq(plane, points.dy, rcond=None)
    return float(fit[0]), float(fit[1]), float(fit[2])


def _stretched(image: Image, scale: float) -> npt.NDArray[np.uint8]:
    """Return scaled 8-bit grey over the image's own range, so that exposure does not affect the features."""
    grey = np.asarray(cv2.resize(as_grey(image), None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.float32)
    low, high = np.percentile(grey[::4, ::4], (1, 99))
    return np.asarray(np.clip((grey - low) * (255 / max(high - low, 1e-6)), 0, 255), dtype=np.uint8)


def _refined(
    left: npt.NDArray[np.uint8], right: npt.NDArray[np.uint8], start: Points, guess: Points
) -> tuple[Points, Points]:
    """Return the matches whose flow converges near the guess, ends refined to a fraction of a pixel."""
    if not len(start):
        return start, guess
    end, ok, _ = cv2.calcOpticalFlowPyrLK(
        left, right, start, guess.copy(), winSize=(PATCH, PATCH), maxLevel=0, flags=cv2.OPTFLOW_USE_INITIAL_FLOW
    )
    near = (ok.ravel() == 1) & (np.abs(end - guess).max(axis=1) < 3)
    return start[near], end[near]


def _consistent(points: Correspondences) -> npt.NDArray[np.bool_]:
    """Return which matches share one smooth field of dy: wrong ones lie anywhere, right ones on a plane."""
    keep = np.ones(len(points), dtype=np.bool_)
    spread = np.inf
    for _ in range(12):
        if keep.sum() < 8:
            return np.zeros(len(points), dtype=np.bool_)
        some = Correspondences(points.left[keep], points.right[keep], points.shape)
        if np.isinf(spread):
            residual = points.dy - np.median(points.dy)
        else:
            a, b, c = vertical_plane(some)
            centre = (np.array(points.shape[::-1]) - 1) / 2
            residual = points.dy - (a + (points.left - centre) @ np.array([b, c]))
        spread = max(0.3, 1.4826 * float(np.median(np.abs(residual[keep]))))
        keep = np.abs(residual) < AGREEMENT * spread
    return keep & (spread <= LARGEST_SPREAD * points.shape[0])
