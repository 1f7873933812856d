"""Memory and time that a template search needs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.jobs import COSTS, HEAP_BLOCK, Estimate
from stereolag.core.searches import TemplateMethod
from stereolag.templates.pose_ranges import PoseRange, Range, checked_poses
from stereolag.templates.score_maps import tiling

Shape = tuple[int, ...]


def estimate_search(
    image_shape: Shape,
    template_shape: Shape,
    *,
    dtype: npt.DTypeLike = np.uint8,
    method: TemplateMethod = "fft",
    masked: bool | None = None,
    scales: Range | None = None,
    rotations: Range | None = None,
) -> Estimate:
    """Return the memory and time that :func:`stereolag.templates.match_template` needs.

    The method's row of :data:`stereolag.core.jobs.COSTS` lists what it takes. "sampled" needs more if no value of the
    template is rare in the image: such a search is refused once the places with the value are counted.

    Parameters
    ----------
    image_shape, template_shape
        (rows, cols) or (rows, cols, channels), the template no larger than the image.
    dtype
        Dtype of the image.
    method
        As for :func:`~stereolag.templates.match_template`.
    masked
        Whether only some pixels of the template are compared; None: if it has alpha.
    scales, rotations
        As for :func:`~stereolag.templates.match_template`.
    """
    (rows, cols), (height, width) = image_shape[:2], template_shape[:2]
    both_coloured = len(image_shape) == 3 and len(template_shape) == 3
    channels = 3 if both_coloured else 1
    pixels, values = rows * cols, channels * height * width
    places = (rows - height + 1) * (cols - width + 1)
    itemsize = np.dtype(dtype).itemsize
    grey = 0
    if not both_coloured and len(image_shape) == 3:  # its luminance, and with alpha a contiguous copy of its colours
        grey = pixels * itemsize * (4 if image_shape[2] == 4 else 1)
    if method == "sampled":
        copied = 3 * pixels * itemsize if both_coloured and image_shape[2] == 4 else 0
        return COSTS["template by pixels"].estimate(grey=grey + copied, values=values, places=places, pixels=pixels)
    if method == "direct":
        return COSTS["template by products"].estimate(
            grey=grey,
            values=values,
            planes=channels * pixels,
            pixels=pixels,
            places=places,
            sums=channels * places,
            products=places * height * width * (2 * channels + 1),
        )
    poses = checked_poses(method, scales, rotations)
    if poses is not None:
        return _estimate_poses(image_shape, template_shape, channels, itemsize, grey, poses)
    part = has_alpha(template_shape) if masked is None else masked
    tiles = _tile_amounts(image_shape, template_shape, channels, part, np.dtype(dtype).kind == "f")
    at_once = min(tiles.number, max(1, cv2.getNumThreads()))
    return COSTS["template by fft"].estimate(
        grey=grey,
        values=values,
        places=places,
        points=tiles.shared + at_once * tiles.points,
        turns=tiles.turns / at_once,
    )


def _estimate_poses(
    image_shape: Shape, template_shape: Shape, channels: int, itemsize: int, grey: int, poses: PoseRange
) -> Estimate:
    """Return the estimate for a search over sizes and angles: the coarse maps at once, then the warped templates."""
    (rows, cols), factor, grid = image_shape[:2], poses.coarse_factor(template_shape), poses.grid()
    largest = max(scale for scale, _ in grid)
    sides = [math.ceil(side * largest / factor) for side in template_shape[:2]]
    little = [math.ceil(max(side / factor, least)) for side, least in zip((rows, cols), sides, strict=True)]
    tiles = _tile_amounts(little, sides, 1, masked=True, floats=True)
    threads = max(1, cv2.getNumThreads())
    pixels, score, peak, double = little[0] * little[1], 4, 40, 8
    coarse = rows * cols * itemsize + score * pixels
    coarse += threads * (double * (tiles.shared + min(tiles.number, threads) * tiles.points) + (score + peak) * pixels)
    turned = math.ceil(math.hypot(*template_shape[:2]) * largest) ** 2
    fine = score * channels * rows * cols * 4 / max(2.0, factor) ** 2
    fine += threads * turned * (4 * score * (channels + 1) + 3 * double * channels)
    return COSTS["template by poses"].estimate(
        grey=grey,
        values=channels * math.prod(template_shape[:2]),
        coarse=coarse,
        fine=fine,
        turns=len(grid) * tiles.turns / threads,
        searches=1,
    )


class _Tiles(NamedTuple):
    """The tiles into which the image is cut for the FFT: their number and work, in points of a plane of doubles."""

    number: int
    shared: int
    """Points of the template's spectra."""
    points: int
    """Points of everything that one tile needs."""
    turns: float


def _tile_amounts(
    image_shape: Sequence[int], template_shape: Sequence[int], channels: int, masked: bool, floats: bool
) -> _Tiles:
    (rows, cols), (height, width) = image_shape[:2], template_shape[:2]
    (down, fft_rows), (across, fft_cols) = tiling(rows - height + 1, height), tiling(cols - width + 1, width)
    count = -(-(rows - height + 1) // down) * -(-(cols - width + 1) // across)
    points = fft_rows * fft_cols
    # The channels; the spectra of one of them and of the sum, or the sum with the energy, norm and squares of the
    # windows; under a mask those of the mask too.
    planes = channels * (down + height - 1) * (across + width - 1)
    places, values = down * across, channels * height * width
    work = max(min(channels, 2) * points, points + places + max(values, planes * floats))
    if masked:
        work = max(planes + points, 3 * points + 3 * places)
    # Freed spectra, which the allocator may keep.
    slack = 2 * min(points, HEAP_BLOCK // 8)
    transforms = channels + masked + count * (channels + 1 + (channels + 2) * masked)
    return _Tiles(count, (channels + masked) * points, planes + work + slack, transforms * points * math.log2(points))


def has_alpha(shape: Shape) -> bool:
    """Return whether images of that shape have an alpha channel."""
    return len(shape) == 3 and shape[2] == 4
