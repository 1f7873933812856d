"""Candidate feature matches between two views, found without assumptions about rows, range or exposure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.inputs import Image, as_grey

Points = npt.NDArray[np.float32]
Eight = npt.NDArray[np.uint8]
Codes = npt.NDArray[np.integer[Any] | np.floating[Any]]
Chosen = npt.NDArray[np.bool_]

FEWEST_MATCHES = 25
"""Fewest matched features for which the geometry of a pair is judged."""

LARGEST_SIDE = 1000
"""Longer side to which larger images are reduced before features are detected, px."""

FEATURES = 2000
FAST_THRESHOLD = 8
LOWEST_CONTRAST = 0.02

LOWE_RATIO = 0.8
"""A SIFT feature is matched if its best candidate is closer than this share of the next one's distance (Lowe 2004)."""

DISTINCTIVE = 0.85
"""A match is distinctive if it is closer than this share of the distance to any other feature of its own image; on a
repeating pattern, where it may be one repetition off, it is not."""

APART_PX = 5.0
"""Features closer together than this show the same point."""

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
    """

    left: Points
    right: Points
    shape: tuple[int, int]
    scale: float = 1.0

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

    def chosen(self, which: Chosen | npt.NDArray[np.intp]) -> Correspondences:
        """Return the matches selected by a mask or by indices."""
        return Correspondences(self.left[which], self.right[which], self.shape, self.scale)

    def joined(self, other: Correspondences) -> Correspondences:
        """Return these matches together with others of the same pair."""
        left, right = np.concatenate([self.left, other.left]), np.concatenate([self.right, other.right])
        return Correspondences(left, right, self.shape, self.scale)


@dataclass(frozen=True, eq=False)
class FeatureMatches:
    """Feature matches of two views: mostly right on an easy pair, mostly wrong on a hard one.

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


@dataclass(frozen=True, eq=False)
class ReducedPair:
    """Both views in 8-bit grey, reduced to the size at which features are matched.

    Attributes
    ----------
    views
        The left and the right view.
    shape
        (rows, cols) before they were reduced.
    scale
        Factor by which they were reduced.
    """

    views: tuple[Eight, Eight]
    shape: tuple[int, int]
    scale: float

    @classmethod
    def of(cls, left: Image, right: Image) -> ReducedPair:
        """Return two checked images of one size, prepared for feature matching."""
        shape = left.shape[0], left.shape[1]
        scale = min(1.0, LARGEST_SIDE / max(shape))
        return cls((_stretched(left, scale), _stretched(right, scale)), shape, scale)

    def binary_matches(self) -> FeatureMatches:
        """Return the mutual best matches of ORB features (Rublee et al. 2011): fast."""
        detector = cv2.ORB.create(FEATURES, fastThreshold=FAST_THRESHOLD)
        places, codes = self._features(detector, smallest=detector.getPatchSize())
        matcher = cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True)
        found = matcher.match(codes[0], codes[1]) if all(map(len, places)) else ()
        return self._refined(places, codes, found, cv2.NORM_HAMMING, must_converge=True)

    def gradient_matches(self) -> FeatureMatches:
        """Return SIFT matches that pass the ratio test (Lowe 2004): several times slower, but more robust."""
        detector = cv2.SIFT.create(FEATURES, contrastThreshold=LOWEST_CONTRAST)
        places, codes = self._features(detector, smallest=PATCH)
        enough = len(places[0]) and len(places[1]) > 1
        ranked = cv2.BFMatcher(cv2.NORM_L2).knnMatch(codes[0], codes[1], k=2) if enough else ()
        found = [best for best, second in ranked if best.distance < LOWE_RATIO * second.distance]
        return self._refined(places, codes, found, cv2.NORM_L2, must_converge=False)

    def _features(self, detector: cv2.Feature2D, *, smallest: int) -> tuple[list[Points], list[Codes]]:
        """Return positions and descriptors of the features of both views; none if a side is below `smallest`."""
        places, codes = [], []
        for view in self.views:
            keys, described = detector.detectAndCompute(view, None) if min(view.shape) >= smallest else ((), None)
            places.append(np.array([key.pt for key in keys], dtype=np.float32).reshape(-1, 2))
            codes.append(np.empty((0, 1), np.uint8) if described is None else described)
        return places, codes

    def _refined(
        self,
        places: list[Points],
        codes: list[Codes],
        found: Sequence[cv2.DMatch],
        norm: int,
        *,
        must_converge: bool,
    ) -> FeatureMatches:
        """Refine matches by optical flow; one whose flow does not converge is dropped, or stays where it was."""
        indices = np.array([(one.queryIdx, one.trainIdx) for one in found], dtype=np.intp).reshape(-1, 2).T
        distances = np.array([one.distance for one in found])
        start, end = places[0][indices[0]], places[1][indices[1]]
        if len(start):
            size, flags = (PATCH, PATCH), cv2.OPTFLOW_USE_INITIAL_FLOW
            flow, ok, _ = cv2.calcOpticalFlowPyrLK(
                *self.views, start, end.copy(), winSize=size, maxLevel=0, flags=flags
            )
            near = (ok.ravel() == 1) & (np.abs(flow - end).max(axis=1) < FARTHEST_REFINED_PX)
            end = np.where(near[:, None], flow, end)
            if must_converge:
                start, end, indices, distances = start[near], end[near], indices[:, near], distances[near]
        # A pixel of the small image stands for the centre of a block of the large one.
        left, right = (np.asarray((points + 0.5) / self.scale - 0.5, dtype=np.float32) for points in (start, end))
        points = Correspondences(left, right, self.shape, self.scale)
        return FeatureMatches(points, places, codes, indices, distances, norm)


def _stretched(image: Image, scale: float) -> Eight:
    """Return the image scaled, in 8-bit grey stretched over its own range so that exposure does not affect matching."""
    size = max(1, round(image.shape[1] * scale)), max(1, round(image.shape[0] * scale))
    grey = np.asarray(cv2.resize(as_grey(image), size, interpolation=cv2.INTER_AREA), np.float32)
    low, high = np.percentile(grey[::4, ::4], (1, 99))
    return np.asarray(np.clip((grey - low) * (255 / max(high - low, 1e-6)), 0, 255), dtype=np.uint8)
