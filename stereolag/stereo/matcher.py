"""What every stereo matcher is: immutable settings with one ``compute``."""

from __future__ import annotations

import time
from abc import abstractmethod
from dataclasses import dataclass
from functools import partial
from typing import Self

import numpy as np
import numpy.typing as npt

from stereolag.estimates import Estimate, check_memory
from stereolag.inputs import Image, as_stereo_pair
from stereolag.progress import Progress, silent
from stereolag.settings import Settings
from stereolag.stereo.estimates import DISPARITY_STEP, fitting_pair
from stereolag.stereo.result import DisparityMap, FloatMap, ReasonMap


@dataclass(frozen=True)
class Displacements:
    """What a matcher hands over: (H, W) displacements, scores and reasons."""

    dy: FloatMap
    dx: FloatMap
    score: FloatMap
    reason: ReasonMap


class StereoMatcher(Settings):
    """Base of every stereo method: a subclass is its settings, one :meth:`match` and what that will take."""

    def compute(self, left: npt.ArrayLike, right: npt.ArrayLike, *, progress: Progress | None = None) -> DisparityMap:
        """Match two images and return the disparity of every pixel of the left one.

        Parameters
        ----------
        left, right
            (H, W), (H, W, 3) or (H, W, 4) images of one size and type: uint8, uint16 or float.
        progress
            Called with the fraction done, 0..1.

        Returns
        -------
        DisparityMap
            Disparity and displacement in px, NaN where there is none, with a reason for every pixel.

        Raises
        ------
        ValueError
            Images that differ in size or type, hold NaN, are smaller than the method needs, or need more memory than
            one job may take (:meth:`estimate`).
        """
        left_image, right_image = as_stereo_pair(left, right)
        self._check_memory(left_image)
        start = time.perf_counter()
        found = self.match(left_image, right_image, progress or silent)
        elapsed = time.perf_counter() - start
        return DisparityMap(
            # 0 less dx: a negated zero would print as -0.
            disparity=np.float32(0) - found.dx,
            dy=found.dy,
            dx=found.dx,
            score=found.score,
            reason=found.reason,
            elapsed_s=elapsed,
            settings=self,
        )

    @abstractmethod
    def estimate(self, shape: tuple[int, ...], dtype: npt.DTypeLike = np.uint8) -> Estimate:
        """Return what :meth:`compute` will take for two images of a shape, with channels or without, and a dtype."""

    @abstractmethod
    def with_disparities(self, num_disparities: int) -> Self | None:
        """Return the matcher with another number of disparities; None where it does not search a number of them."""

    def _check_memory(self, image: Image) -> None:
        def fewer(count: int) -> Estimate:
            other = self.with_disparities(count)
            assert other is not None
            return other.estimate(image.shape, image.dtype)

        check_memory(
            self.estimate(image.shape, image.dtype),
            partial(
                fitting_pair,
                shape=image.shape,
                of_shape=partial(self.estimate, dtype=image.dtype),
                of_disparities=None if self.with_disparities(DISPARITY_STEP) is None else fewer,
            ),
        )

    @abstractmethod
    def match(self, left: Image, right: Image, progress: Progress) -> Displacements:
        """Match two checked images; called by :meth:`compute`, which checks and times."""
