"""Candidate feature matches between two views, found without assumptions about rows, range or exposure."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.inputs import Image, as_grey

Points = npt.NDArray[np.float32]
Eight = npt.NDArray[np.uint8]
Chosen = npt.NDArray[np.bool_]

FEWEST_MATCHES = 25
"""Fewest matched features for which the geometry of a pair is judged."""

LARGEST_SIDE = 1000
"""Longer side to which larger images are reduced before features are detected, px."""

FEATURES = 2000
FAST_THRESHOLD = 8
LOWEST_CONTRAST = 0.02

DISTINCT = 0.8
"""A SIFT feature is matched if its best candidate is closer than this share of the next one's distance (Lowe 2004)."""

LONELY = 0.85
"""A match is distinct if it is closer than this share of the distance to any other feature of its own image; on a
repeating pattern, where it may be one repetition off, it is not."""

APART_PX = 5.0
"""Features closer together than this show the same point."""

PATCH = 15
"""Side of the optical-flow window that refines a match, px."""


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


@dataclass(frozen=True)
class ReducedPair:
    """Both views in 8-bit grey, reduced to the size at which features are matched."""

    left: Eight
    right: Eight
    shape: tuple[int, int]
    scale: float


def reduced_pair(left: Image, right: Image) -> ReducedPair:
    """Return two checked images of one size, prepared for feature matching."""
    shape = left.shape[0], left.shape[1]
    scale = min(1.0, LARGEST_SIDE / max(shape))
    return ReducedPair(_stretched(left, scale), _stretched(right, scale), shape, scale)


@dataclass(frozen=True)
class View:
    """The features of one view: positions, descriptors, and the norm that compares descriptors."""

    places: Points
    codes: npt.NDArray[np.integer[Any] | np.floating[Any]]
    norm: int

    def __len__(self) -> int:
        return len(self.places)

    def lonely(self, which: npt.NDArray[np.intp], distances: npt.NDArray[np.float64]) -> Chosen:
        """Return the mask of features whose match is closer than any other feature of this view."""
        ranked = cv2.BFMatcher(self.norm).knnMatch(self.codes[which], self.codes, k=4)
        others = np.full(len(which), np.inf)
        for number, (own, near) in enumerate(zip(which, ranked, strict=True)):
            apart = (one.distance for one in near if self._apart(own, one.trainIdx))
            others[number] = next(apart, np.inf)
        return np.asarray(distances < LONELY * others)

    def _apart(self, one: int, other: int) -> bool:
        return bool(np.abs(self.places[one] - self.places[other]).max() > APART_PX)


@dataclass(frozen=True)
class Candidates:
    """Feature matches of a reduced pair: mostly right on an easy pair, mostly wrong on a hard one."""

    pair: ReducedPair
    left: View
    right: View
    found: tuple[cv2.DMatch, ...]
    must_converge: bool = field(kw_only=True)
    """Whether a match that optical flow cannot refine is dropped; otherwise it keeps its unrefined position."""

    @cached_property
    def points(self) -> Correspondences:
        """Return the matches, refined to sub-pixel precision by Lucas-Kanade flow."""
        return self._matched(np.ones(len(self.found), dtype=np.bool_))

    @cached_property
    def distinct(self) -> Correspondences:
        """Return the matches whose features resemble no other feature of their own image."""
        if not self.found:
            return self.points
        distances = np.array([match.distance for match in self.found])
        left, right = (np.array(which) for which in zip(*((m.queryIdx, m.trainIdx) for m in self.found), strict=True))
        return self._matched(self.left.lonely(left, distances) & self.right.lonely(right, distances))

    def _matched(self, which: Chosen) -> Correspondences:
        start, guess = self._places[0][which], self._places[1][which]
        end, near = self._refined[0][which], self._refined[1][which]
        if self.must_converge:
            start, end = start[near], end[near]
        else:
            end = np.where(near[:, None], end, guess)
        # A pixel of the small image stands for the centre of a block of the large one.
        ends = [np.asarray((points + 0.5) / self.pair.scale - 0.5, dtype=np.float32) for points in (start, end)]
        return Correspondences(ends[0], ends[1], self.pair.shape, self.pair.scale)

    @cached_property
    def _places(self) -> tuple[Points, Points]:
        left = self.left.places[[match.queryIdx for match in self.found]]
        return left, self.right.places[[match.trainIdx for match in self.found]]

    @cached_property
    def _refined(self) -> tuple[Points, Chosen]:
        """Return the refined end points, and the mask of those whose flow converged near the guess."""
        start, guess = self._places
        if not len(start):
            return guess, np.zeros(0, dtype=np.bool_)
        end, ok, _ = cv2.calcOpticalFlowPyrLK(
            self.pair.left,
            self.pair.right,
            start,
            guess.copy(),
            winSize=(PATCH, PATCH),
            maxLevel=0,
            flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
        )
        return np.asarray(end, np.float32), (ok.ravel() == 1) & (np.abs(end - guess).max(axis=1) < 3)


def binary_candidates(pair: ReducedPair) -> Candidates:
    """Return the mutual best matches of ORB features (Rublee et al. 2011): fast."""
    detector = cv2.ORB.create(FEATURES, fastThreshold=FAST_THRESHOLD)
    left, right = _views(pair, detector, cv2.NORM_HAMMING, smallest=detector.getPatchSize())
    found = cv2.BFMatcher(left.norm, crossCheck=True).match(left.codes, right.codes) if len(left) and len(right) else ()
    return Candidates(pair, left, right, tuple(found), must_converge=True)


def gradient_candidates(pair: ReducedPair) -> Candidates:
    """Return SIFT matches that pass the ratio test (Lowe 2004): several times slower, but robust to differing views."""
    detector = cv2.SIFT.create(FEATURES, contrastThreshold=LOWEST_CONTRAST)
    left, right = _views(pair, detector, cv2.NORM_L2, smallest=PATCH)
    if not len(left) or len(right) < 2:
        return Candidates(pair, left, right, (), must_converge=False)
    ranked = cv2.BFMatcher(left.norm).knnMatch(left.codes, right.codes, k=2)
    found = tuple(best for best, second in ranked if best.distance < DISTINCT * second.distance)
    return Candidates(pair, left, right, found, must_converge=False)


def _views(pair: ReducedPair, detector: cv2.Feature2D, norm: int, *, smallest: int) -> tuple[View, View]:
    """Return the features of both views; none if a side of the image is below `smallest`."""
    found = []
    for image in (pair.left, pair.right):
        keys, codes = detector.detectAndCompute(image, None) if min(image.shape) >= smallest else ((), None)
        places = np.array([key.pt for key in keys], dtype=np.float32).reshape(-1, 2)
        found.append(View(places, np.empty((0, 1), np.uint8) if codes is None else codes, norm))
    return found[0], found[1]


def _stretched(image: Image, scale: float) -> Eight:
    """Return the image scaled, in 8-bit grey stretched over its own range so that exposure does not affect matching."""
    size = max(1, round(image.shape[1] * scale)), max(1, round(image.shape[0] * scale))
    grey = np.asarray(cv2.resize(as_grey(image), size, interpolation=cv2.INTER_AREA), np.float32)
    low, high = np.percentile(grey[::4, ::4], (1, 99))
    return np.asarray(np.clip((grey - low) * (255 / max(high - low, 1e-6)), 0, 255), dtype=np.uint8)
