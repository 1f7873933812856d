"""Compilation of part of a matcher's loops, by another process."""

from __future__ import annotations

import numpy as np

from stereolag.core.inputs import Image, as_grey
from stereolag.core.settings import FitsImage, marker
from stereolag.loops.compilation import compile_alone
from stereolag.stereo.finishing.stages import Finishing, finished
from stereolag.stereo.matcher import PixelMatches, Reason, StereoMatcher
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.stereo.windows.search import WindowMatches


def few_rows(matcher: StereoMatcher, *images: Image) -> list[Image]:
    """Return the upper rows of images, enough for the matcher's loops to be compiled or loaded."""
    sides = [int(value) for name, value in matcher if marker(type(matcher).model_fields[name], FitsImage)]
    return [image[: max(sides, default=0) + 16] for image in images]


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
        around = random.random((3 if query.lags.rows > 1 else 1, 3, *query.grid), np.float32)
        dx = random.integers(-6, -3, query.grid).astype(np.int16)
        matches = WindowMatches(
            dy=np.zeros_like(dx),
            dx=dx,
            score=around[len(around) // 2, 1],
            around=around,
            texture=around[0, 0] * 99,
            runner_up=around[0, 0] if query.runner_up else None,
            right_dx=np.full(query.right.shape, -5, np.int16) if query.right_matches else None,
        )
        matcher.completed(matches, query, left, right)
    elif isinstance(matcher, Finishing):
        disparity = random.integers(3, 6, left.shape[:2]).astype(np.float32)
        gaps = random.random(disparity.shape) < 0.1
        disparity[gaps] = np.nan
        reason = np.where(gaps, np.uint8(Reason.LEFT_RIGHT), np.uint8(Reason.MEASURED))
        finished(PixelMatches(disparity, reason, np.ones_like(disparity)), left, right, matcher)
