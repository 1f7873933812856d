"""Features of two views, matched by their descriptors and refined to a fraction of a pixel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from stereolag.core.arrays import Array, EightBit, FloatMap, Indices, Mask, Vector

Points = FloatMap
Descriptors = Array

MIN_MATCHES = 25
"""Number of matched features from which the geometry of a pair is judged."""

MAX_SIDE_PX = 1000
"""Longer side to which larger images are reduced before features are detected, px."""

MAX_FEATURES = 2000
"""Number of features detected in each view."""

MAX_LOWE_RATIO = 0.8
"""A SIFT feature is matched if its best candidate is closer than this share of the next one's distance (Lowe 2004)."""

MAX_DISTINCTIVE_RATIO = 0.85
"""A match is distinctive if its distance is below this share of the distance to any other feature of its own image; on
a repeating pattern, where it may be one repetition off, it is not."""

SAME_POINT_PX = 5.0
"""Features closer together than this show the same point, px."""

EXACT_TREE: dict[str, bool | int | float | str] = {"algorithm": 4, "leaf_max_size": 10}
"""FLANN's tree for points in two dimensions, whose search is exact (``KDTREE_SINGLE``, Muja and Lowe 2009)."""

DESCRIPTORS_PER_BLOCK = 32
"""Descriptors compared at a time: their distances stay in the cache."""

FLOW_WINDOW_PX = 15
"""Side of the window of the optical flow that refines a match, px."""

MAX_REFINEMENT_PX = 3
"""Largest displacement of a match by its refinement, px."""


@dataclass(frozen=True)
class Correspondences:
    """Matched points.

    Attributes
    ----------
    left, right
        (n, 2) float32 (x, y) in the left and in the right image, px.
    shape
        (rows, cols) of the images.
    scale
        Factor by which the images were reduced before features were matched, at most 1; it limits the precision.
    candidates
        The distinctive matches from which these were selected; None if nearly all of them agree.
    of_any_rows
        For a pair that looks nearly rectified, the matches before selection by their rows; otherwise None.
    moved
        For such a pair, the number of distinctive matches on things that moved up or down between its images.
    """

    left: Points
    right: Points
    shape: tuple[int, int]
    scale: float = 1.0
    candidates: Correspondences | None = None
    of_any_rows: Correspondences | None = None
    moved: int = 0

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

    def chosen(self, which: Mask | Indices) -> Correspondences:
        """Return the matches selected by a mask or by indices."""
        return replace(self, left=self.left[which], right=self.right[which])

    def joined(self, other: Correspondences) -> Correspondences:
        """Return these matches together with others of the same pair."""
        left, right = np.concatenate([self.left, other.left]), np.concatenate([self.right, other.right])
        return replace(self, left=left, right=right)


@dataclass(frozen=True, eq=False)
class FeatureMatches:
    """Feature matches of two views, found without assumptions about rows, range or exposure.

    They are mostly right on an easy pair, and mostly wrong on a hard one.

    Attributes
    ----------
    points
        The matches, refined to sub-pixel precision by Lucas-Kanade flow.
    positions, descriptors
        Those of all features, for the left and for the right view.
    indices
        (2, n) indices of the matched features of the left and of the right view.
    distances
        (n,) distances between their descriptors.
    norm
        The norm that compares descriptors.
    """

    points: Correspondences
    positions: Sequence[Points]
    descriptors: Sequence[Descriptors]
    indices: Indices
    distances: Vector
    norm: int

    def distinctive(self) -> Correspondences:
        """Return the matches whose features resemble no other feature of their own view."""
        distinctive = np.ones(len(self.points), dtype=np.bool_)
        for positions, descriptors, matched in zip(self.positions, self.descriptors, self.indices, strict=True):
            ranked = cv2.BFMatcher(self.norm).knnMatch(descriptors[matched], descriptors, k=4) if len(matched) else ()
            for number, (feature, similar) in enumerate(zip(matched, ranked, strict=True)):
                others = (
                    candidate.distance
                    for candidate in similar
                    if np.abs(positions[feature] - positions[candidate.trainIdx]).max() > SAME_POINT_PX
                )
                distinctive[number] &= self.distances[number] < MAX_DISTINCTIVE_RATIO * next(others, np.inf)
        return self.points.chosen(distinctive)


def match_features(
    views: tuple[EightBit, EightBit], shape: tuple[int, int], scale: float, *, binary: bool
) -> FeatureMatches:
    """Match the features of the left and the right view in 8-bit grey, and refine their positions by optical flow.

    Parameters
    ----------
    shape, scale
        (rows, cols) of the images, and the factor by which they were reduced.
    binary
        Return the mutual best matches of ORB features (Rublee et al. 2011), which is fast; a match whose flow does not
        converge is dropped. Otherwise return SIFT matches that pass the ratio test (Lowe 2004): several times slower,
        but more robust; a match whose flow does not converge keeps its position.
    """
    detector: cv2.Feature2D
    if binary:
        detector = cv2.ORB.create(MAX_FEATURES, fastThreshold=8)
        min_side, norm = detector.getPatchSize(), cv2.NORM_HAMMING
    else:
        detector, min_side, norm = cv2.SIFT.create(MAX_FEATURES, contrastThreshold=0.02), FLOW_WINDOW_PX, cv2.NORM_L2
    positions, descriptors = [], []
    for view in views:
        keys, described = detector.detectAndCompute(view, None) if min(view.shape) >= min_side else ((), None)
        positions.append(np.array([key.pt for key in keys], dtype=np.float32).reshape(-1, 2))
        descriptors.append(np.empty((0, 1), np.uint8) if described is None else described)
    indices, distances = np.empty((2, 0), np.intp), np.empty(0)
    if binary and all(map(len, positions)):
        indices, distances = mutual_matches(descriptors[0], descriptors[1])
    elif not binary and len(positions[0]) and len(positions[1]) > 1:
        ranked = cv2.BFMatcher(norm).knnMatch(descriptors[0], descriptors[1], k=2)
        matches = [best for best, second in ranked if best.distance < MAX_LOWE_RATIO * second.distance]
        indices = np.array([(match.queryIdx, match.trainIdx) for match in matches], dtype=np.intp).reshape(-1, 2).T
        distances = np.array([match.distance for match in matches])
    start, end = positions[0][indices[0]], positions[1][indices[1]]
    if len(start):
        refined, ok = tracked(views, start, end)
        near = ok & (np.abs(refined - end).max(axis=1) < MAX_REFINEMENT_PX)
        end = np.where(near[:, None], refined, end)
        if binary:
            start, end, indices, distances = start[near], end[near], indices[:, near], distances[near]
    return FeatureMatches(at_full_size(start, end, shape, scale), positions, descriptors, indices, distances, norm)


def mutual_matches(left: Descriptors, right: Descriptors) -> tuple[Indices, Vector]:
    """Return the binary descriptors of both views that are nearest to each other, and the bits in which they differ.

    Of equally near descriptors the first is taken, as in OpenCV's ``BFMatcher`` with a cross-check, which takes twice
    as long.

    Parameters
    ----------
    left, right
        (n, bytes) and (m, bytes), bytes a multiple of 8, m at most 65,536.

    Returns
    -------
    indices
        (2, matches) of the left and of the right descriptors, in the order of the left ones.
    distances
        (matches,) numbers of differing bits.
    """
    words, others = left.view(np.uint64).T.copy(), right.view(np.uint64)
    nearest_left = np.empty(len(right), np.intp)
    # For each left descriptor: the number of differing bits, then in the low 16 bits the index of the right one.
    nearest = np.full(len(left), np.iinfo(np.uint32).max, np.uint32)
    for first in range(0, len(right), DESCRIPTORS_PER_BLOCK):
        block = others[first : first + DESCRIPTORS_PER_BLOCK]
        bits = np.zeros((len(block), len(left)), np.uint16)
        for word, values in enumerate(words):
            bits += np.bitwise_count(block[:, word, None] ^ values)
        nearest_left[first : first + len(block)] = bits.argmin(axis=1)
        keys = bits.astype(np.uint32) << 16
        keys |= np.arange(first, first + len(block), dtype=np.uint32)[:, None]
        np.minimum(nearest, keys.min(axis=0), out=nearest)
    nearest_right = (nearest & 0xFFFF).astype(np.intp)
    mutual = np.flatnonzero(nearest_left[nearest_right] == np.arange(len(left)))
    return np.stack([mutual, nearest_right[mutual]]), (nearest[mutual] >> 16).astype(np.float64)


def tracked(
    views: tuple[EightBit, EightBit], start: Points, end: Points, levels: int = 0, min_eigenvalue: float = 1e-4
) -> tuple[Points, Mask]:
    """Return the positions of points of the first view in the second, searched from `end`, and which were found."""
    flow, ok, _ = cv2.calcOpticalFlowPyrLK(
        *views,
        start,
        end.copy(),
        winSize=(FLOW_WINDOW_PX, FLOW_WINDOW_PX),
        maxLevel=levels,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
        minEigThreshold=min_eigenvalue,
    )
    return np.asarray(flow, np.float32), np.asarray(ok.ravel() == 1)


def at_full_size(start: Points, end: Points, shape: tuple[int, int], scale: float) -> Correspondences:
    """Return the matches of reduced images in px of the full size: a reduced pixel is the centre of a block."""
    left, right = (np.asarray((points + 0.5) / scale - 0.5, dtype=np.float32) for points in (start, end))
    return Correspondences(left, right, shape, scale)
