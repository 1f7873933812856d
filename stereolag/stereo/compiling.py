"""The first compilation of a matcher's loops, shared between two processes."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np

from stereolag.core.inputs import Image
from stereolag.stereo.finishing.stages import Finishing, finished
from stereolag.stereo.matcher import PixelMatches, Reason, StereoMatcher


def compile_with_help(matcher: StereoMatcher, left: Image, right: Image) -> None:
    """Match two small images, while another process compiles the loops that filter and fill.

    A process compiles one loop at a time. Their machine code is kept on disk, where this process finds it.
    """
    with ProcessPoolExecutor(1, get_context("spawn")) as helper:
        helper.submit(_finish, matcher, left, right)
        matcher.compute(left, right)


def _finish(matcher: StereoMatcher, left: Image, right: Image) -> None:
    """Filter and fill a map of random disparities as a matcher does."""
    if isinstance(matcher, Finishing):
        random = np.random.default_rng(0)
        disparity = random.integers(3, 6, left.shape[:2]).astype(np.float32)
        gaps = random.random(disparity.shape) < 0.1
        disparity[gaps] = np.nan
        reason = np.where(gaps, np.uint8(Reason.LEFT_RIGHT), np.uint8(Reason.MEASURED))
        finished(PixelMatches(disparity, reason, np.ones_like(disparity)), left, right, matcher)
