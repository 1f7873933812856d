"""A share of the first compilation of a matcher's loops, for another process."""

from __future__ import annotations

import numpy as np

from stereolag.core.inputs import Image, as_grey
from stereolag.core.settings import FitsImage, marker
from stereolag.loops.compilation import compile_alone
from stereolag.stereo.finishing.stages import Finishing, finished
from stereolag.stereo.matcher import PixelMatches, Reason, StereoMatcher
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.stereo.windows.search import WindowMatches

ROWS = 16
"""Rows matched, in addition to those of a window."""


def few_rows(matcher: StereoMatcher, *images: Image) -> list[Image]:
    """Return the upper rows of images, as many as the matcher's loops need to be compiled or loaded."""
    sides = [int(value) for name, value in matcher if marker(type(matcher).model_fields[name], FitsImage)]
    return [image[: max(sides, default=0) + ROWS] for image in images]


def compile_share(matcher: StereoMatcher, shape: tuple[int, ...], dtype: str) -> None:
    """Compile the loops of all stages after the search, for images of a shape and dtype."""
    compile_alone()
    (image,) = few_rows(matcher, np.zeros(shape, dtype))
    complete(matcher, image, image)


def complete(matcher: StereoMatcher, left: Image, right: Image) -> None:
    """Complete a map of random matches as a matcher does."""
    random = np.random.default_rng(0)
    if isinstance(matcher, CorrelationMatcher):
        query = matcher.query(as_grey(left), as_grey(right))
        shape = tuple((side - query.window_size) // query.step + 1 for side in query.left.shape)
        around = random.random((3 if query.lags.rows > 1 else 1, 3, *shape), np.float32)
        lag = random.integers(-6, -3, shape).astype(np.int16)
        found = WindowMatches(
            dy=np.zeros_like(lag),
            dx=lag,
            score=around[len(around) // 2, 1],
            around=around,
            texture=around[0, 0] * 99,
            runner_up=around[0, 0] if query.runner_up else None,
            right_dx=np.full(query.right.shape, -5, np.int16) if query.right_matches else None,
        )
        matcher.completed(found, query, left, right)
    elif isinstance(matcher, Finishing):
        disparity = random.integers(3, 6, left.shape[:2]).astype(np.float32)
        gaps = random.random(disparity.shape) < 0.1
        disparity[gaps] = np.nan
        reason = np.where(gaps, np.uint8(Reason.LEFT_RIGHT), np.uint8(Reason.MEASURED))
        finished(PixelMatches(disparity, reason, np.ones_like(disparity)), left, right, matcher)
