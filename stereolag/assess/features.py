"""Features of two views that show the same points, matched by their descriptors and refined."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Mask

Points = npt.NDArray[np.float32]
Eight = npt.NDArray[np.uint8]
Codes = npt.NDArray[np.integer[Any] | np.floating[Any]]

FEWEST_MATCHES = 25
"""Fewest matched features for which the geometry of a pair is judged."""

LARGEST_SIDE = 1000
"""Longer side to which larger images are reduced before features are detected, px."""

FEATURES = 2000

LOWE_RATIO = 0.8
"""A SIFT feature is matched if its best candidate is closer than this share of the next one's distance (Lowe 2004)."""

DISTINCTIVE = 0.85
"""A match is distinctive if it is closer than this share of the distance to any other feature of its own image; on a
repeating pattern, where it may be one repetition off, it is not."""

APART_PX = 5.0
"""Features closer together than this show the same point."""

EXACT_TREE: dict[str, bool | int | float | str] = {"algorithm": 4, "leaf_max_size": 10}
"""FLANN's tree for places of two coordinates, whose search is exact (``KDTREE_SINGLE``, Muja and Lowe 2009)."""

CODES_AT_ONCE = 32
"""Descriptors compared at a time: their distances stay in the cache."""

PATCH, FARTHEST_REFINED_PX = 15, 3
"""Side of the optical-flow window that refines a match, and how far it may move a match, px."""


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
        The distinctive matches of which these agree; None if nearly all of them do.
    of_any_rows
        Of a pair that looks nearly rectified, the matches before those were chosen whose rows agree; else None.
    """

    left: Points
    right: Points
    shape: tuple[int, int]
    scale: float = 1.0
    candidates: Correspondences | None = None
    of_any_rows: Correspondences | None = None

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

    def chosen(self, which: Mask | npt.NDArray[np.intp]) -> Correspondences:
        """Return the matches selected by a mask or by indices."""
        return replace(self, left=self.left[which], right=self.right[which])

    def joined(self, other: Correspondences) -> Correspondences:
        """Return these matches together with others of the same pair."""
        left, right = np.concatenate([self.left, other.left]), np.concatenate([self.right, other.right])
        return replace(self, left=left, right=right)


@dataclass(frozen=True, eq=False)
class FeatureMatches:
    """Feature matches of two views, found without assumptions about rows, range or exposure.

    Mostly right on an easy pair, mostly wrong on a hard one.

    Attributes
    ----------
    points
        The matches, refined to sub-pixel precision by Lucas-Kanade flow.
    places, codes
        Positions and descriptors of all features, for the left and for the right view.
    indices
        (2, n) The matched features of the left and of the right view.
    distances
        (n,) The distances of their descriptors.
    norm
        The norm that compares descriptors.
    """

    points: Correspondences
    places: Sequence[Points]
    codes: Sequence[Codes]
    indices: npt.NDArray[np.intp]
    distances: npt.NDArray[np.float64]
    norm: int

    def distinctive(self) -> Correspondences:
        """Return the matches whose features resemble no other feature of their own view."""
        distinctive = np.ones(len(self.points), dtype=np.bool_)
        for places, codes, which in zip(self.places, self.codes, self.indices, strict=True):
            ranked = cv2.BFMatcher(self.norm).knnMatch(codes[which], codes, k=4) if len(which) else ()
            for number, (own, near) in enumerate(zip(which, ranked, strict=True)):
                others = (one.distance for one in near if np.abs(places[own] - places[one.trainIdx]).max() > APART_PX)
                distinctive[number] &= self.distances[number] < DISTINCTIVE * next(others, np.inf)
        return self.points.chosen(distinctive)


def match_features(views: tuple[Eight, Eight], shape: tuple[int, int], scale: float, *, binary: bool) -> FeatureMatches:
    """Match the features of the left and the right view in 8-bit grey, and refine their places by optical flow.

    Parameters
    ----------
    shape, scale
        (rows, cols) of the images, and the factor by which they were reduced.
    binary
        The mutual best matches of ORB features (Rublee et al. 2011), which is fast; one whose flow does not converge is
        dropped. Otherwise SIFT matches that pass the ratio test (Lowe 2004): several times slower, but more robust; one
        whose flow does not converge stays where it was.
    """
    detector: cv2.Feature2D
    if binary:
        detector = cv2.ORB.create(FEATURES, fastThreshold=8)
        smallest, norm = detector.getPatchSize(), cv2.NORM_HAMMING
    else:
        detector, smallest, norm = cv2.SIFT.create(FEATURES, contrastThreshold=0.02), PATCH, cv2.NORM_L2
    places, codes = [], []
    for view in views:
        keys, described = detector.detectAndCompute(view, None) if min(view.shape) >= smallest else ((), None)
        places.append(np.array([key.pt for key in keys], dtype=np.float32).reshape(-1, 2))
        codes.append(np.empty((0, 1), np.uint8) if described is None else described)
    indices, distances = np.empty((2, 0), np.intp), np.empty(0)
    if binary and all(map(len, places)):
        indices, distances = mutual_matches(codes[0], codes[1])
    elif not binary and len(places[0]) and len(places[1]) > 1:
        ranked = cv2.BFMatcher(norm).knnMatch(codes[0], codes[1], k=2)
        found = [best for best, second in ranked if best.distance < LOWE_RATIO * second.distance]
        indices = np.array([(one.queryIdx, one.trainIdx) for one in found], dtype=np.intp).reshape(-1, 2).T
        distances = np.array([one.distance for one in found])
    start, end = places[0][indices[0]], places[1][indices[1]]
    if len(start):
        flow, ok = tracked(views, start, end)
        near = ok & (np.abs(flow - end).max(axis=1) < FARTHEST_REFINED_PX)
        end = np.where(near[:, None], flow, end)
        if binary:
            start, end, indices, distances = start[near], end[near], indices[:, near], distances[near]
    return FeatureMatches(at_full_size(start, end, shape, scale), places, codes, indices, distances, norm)


def mutual_matches(left: Codes, right: Codes) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.float64]]:
    """Return the binary descriptors of both views that are nearest to each other, and the bits in which they differ.

    The first of equally near ones counts, as in OpenCV's ``BFMatcher`` with a cross-check, which takes twice as long.

    Parameters
    ----------
    left, right
        (n, bytes) and (m, bytes), bytes a multiple of 8, m at most 65,536.

    Returns
    -------
    indices
        (2, matches) of the left and of the right descriptors, in the order of the left ones.
    distances
        (matches,)
    """
    words, others = left.view(np.uint64).T.copy(), right.view(np.uint64)
    nearest_left = np.empty(len(right), np.intp)
    # To each left one: the bits, then the index of the right one.
    nearest = np.full(len(left), np.iinfo(np.uint32).max, np.uint32)
    for first in range(0, len(right), CODES_AT_ONCE):
        some = others[first : first + CODES_AT_ONCE]
        bits = np.zeros((len(some), len(left)), np.uint16)
        for word, values in enumerate(words):
            bits += np.bitwise_count(some[:, word, None] ^ values)
        nearest_left[first : first + len(some)] = bits.argmin(axis=1)
        keys = bits.astype(np.uint32) << 16
        keys |= np.arange(first, first + len(some), dtype=np.uint32)[:, None]
        np.minimum(nearest, keys.min(axis=0), out=nearest)
    nearest_right = (nearest & 0xFFFF).astype(np.intp)
    mutual = np.flatnonzero(nearest_left[nearest_right] == np.arange(len(left)))
    return np.stack([mutual, nearest_right[mutual]]), (nearest[mutual] >> 16).astype(np.float64)


def tracked(
    views: tuple[Eight, Eight], start: Points, end: Points, levels: int = 0, weakest: float = 1e-4
) -> tuple[Points, Mask]:
    """Return where points of the first view are in the second one, searched from `end`, and which were found."""
    flow, ok, _ = cv2.calcOpticalFlowPyrLK(
        *views,
        start,
        end.copy(),
        winSize=(PATCH, PATCH),
        maxLevel=levels,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
        minEigThreshold=weakest,
    )
    return np.asarray(flow, np.float32), np.asarray(ok.ravel() == 1)


def at_full_size(start: Points, end: Points, shape: tuple[int, int], scale: float) -> Correspondences:
    """Return the matches of reduced images, whose pixels stand for the centres of blocks of the large ones."""
    left, right = (np.asarray((points + 0.5) / scale - 0.5, dtype=np.float32) for points in (start, end))
    return Correspondences(left, right, shape, scale)
