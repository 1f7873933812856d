"""Memory and time that a template search needs, from the arrays that each method allocates."""

from __future__ import annotations

import math
from collections.abc import Callable

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.estimates import OVERHEAD, Estimate, kept_blocks, largest_fitting
from stereolag.core.searches import TemplateMethod
from stereolag.templates.pose_ranges import PoseRange, Range, checked_poses
from stereolag.templates.score_maps import tiling

Shape = tuple[int, ...]

DOUBLE, SCORE = 8, 4
"""Bytes of a number in the computation, and of a score."""

FFT_SECONDS = 1.2e-9
"""Seconds per point of a tile and doubling of their number, on one thread, for one transform and the sums with it."""

PRODUCT_SECONDS = 2.8e-10
"""Seconds per product of a pixel of the image and one of the template."""

PIXEL_SECONDS = 4e-9
"""Seconds per pixel compared with a rare value."""

PEAK = 40
"""Most bytes per score that the search for the peaks of a map takes."""

REFINING_SECONDS = 0.8
"""Seconds for refining the best places in size and angle."""

FEWEST_MEGAPIXELS = 0.01
"""Smaller images are not worth suggesting."""


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

    All methods keep the template's deviations from its mean, in float64, and twice as much while these are computed.
    In addition, at most,

    * "fft" allocates the score map, the spectrum of every channel of the template, and for every thread that works on
      a tile the tile's channels, the spectra of one of them and of the sum, and the energy of its windows;
    * "direct" allocates the image in float64, its squares, and for every position the products and sums of each
      channel; its time is proportional to the number of positions times the template's pixels;
    * "sampled" allocates three marks for each position. If no value of the template is rare in the image it needs
      more: such a search is refused once the positions with the value are counted.

    Over sizes and angles, "fft" allocates the maps of a reduced image, one for every thread, and then a colour image of
    half the size and the templates refined in it.

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
    pixels, size = rows * cols, height * width
    places = (rows - height + 1) * (cols - width + 1)
    pixel_type = np.dtype(dtype)
    kept = 0
    if not both_coloured and len(image_shape) == 3:  # its luminance, and with alpha a contiguous copy of its colours
        kept += pixels * pixel_type.itemsize * (4 if image_shape[2] == 4 else 1)
    deviations = DOUBLE * channels * size
    making = kept + 3 * deviations + channels * pixel_type.itemsize * size
    if method == "sampled":
        memory = kept + deviations + 3 * places
        if both_coloured and image_shape[2] == 4:
            memory += 3 * pixels * pixel_type.itemsize
        return Estimate(max(making, memory) + OVERHEAD, PIXEL_SECONDS * pixels)
    if method == "direct":
        planes, of_place = DOUBLE * channels * pixels, DOUBLE * places
        sums = (2 + channels) * of_place
        memory = kept + deviations + planes + max(planes, sums + (channels + 5) * of_place) + DOUBLE * (pixels + size)
        seconds = PRODUCT_SECONDS * places * size * (2 * channels + 1)
        return Estimate(max(making, memory) + OVERHEAD, seconds)
    poses = checked_poses(method, scales, rotations)
    if poses is not None:
        return _with_poses(image_shape, template_shape, channels, pixel_type, kept + making, poses)
    part = has_alpha(template_shape) if masked is None else masked
    search = _Tiles.of(image_shape, template_shape, channels, pixel_type, part)
    memory = kept + deviations + SCORE * places + search.shared + search.at_once * search.memory
    seconds = search.transforms * FFT_SECONDS * search.points * math.log2(search.points) / search.at_once
    return Estimate(max(making, memory) + OVERHEAD, seconds)


def _with_poses(
    image_shape: Shape, template_shape: Shape, channels: int, dtype: np.dtype[np.generic], made: int, poses: PoseRange
) -> Estimate:
    """Return the estimate for a search over sizes and angles: the coarse maps at once, then the warped templates.

    Parameters
    ----------
    made
        Bytes of everything prepared from image and template before.
    """
    (rows, cols), factor, grid = image_shape[:2], poses.coarse_factor(template_shape), poses.grid()
    largest = max(scale for scale, _ in grid)
    sides = [math.ceil(side * largest / factor) for side in template_shape[:2]]
    little = max(rows / factor, sides[0]), max(cols / factor, sides[1])
    search = _Tiles.of((math.ceil(little[0]), math.ceil(little[1])), tuple(sides), 1, np.dtype(np.float32), masked=True)
    # For each map, its scores and their copies in the search for peaks come on top.
    pixels = math.ceil(little[0]) * math.ceil(little[1])
    threads = max(1, cv2.getNumThreads())
    each = search.shared + search.at_once * search.memory + (SCORE + PEAK) * pixels
    coarse = rows * cols * dtype.itemsize + SCORE * pixels + threads * each
    turned = math.hypot(*template_shape[:2]) * largest
    layers = 4 * SCORE * (channels + 1) * math.ceil(turned) ** 2 + 3 * DOUBLE * channels * math.ceil(turned) ** 2
    halved = SCORE * channels * rows * cols * 4 / max(2.0, factor) ** 2
    fine = halved + threads * layers
    seconds = len(grid) * search.transforms * FFT_SECONDS * search.points * math.log2(search.points) / threads
    return Estimate(round(made + max(coarse, fine)) + OVERHEAD, seconds + REFINING_SECONDS)


class _Tiles:
    """The tiles into which the image is cut for the FFT, and the memory that they need.

    Attributes
    ----------
    points
        Points in the transform of a tile.
    at_once
        Tiles processed at one time.
    shared, memory
        Bytes of the template's spectra, and of the work on one tile.
    transforms
        Number of transforms, forward and inverse.
    """

    def __init__(self, points: int, at_once: int, shared: int, memory: int, transforms: int) -> None:
        self.points, self.at_once, self.shared, self.memory = points, at_once, shared, memory
        self.transforms = transforms

    @classmethod
    def of(
        cls, image_shape: Shape, template_shape: Shape, channels: int, dtype: np.dtype[np.generic], masked: bool
    ) -> _Tiles:
        (rows, cols), (height, width) = image_shape[:2], template_shape[:2]
        (down, fft_rows), (across, fft_cols) = tiling(rows - height + 1, height), tiling(cols - width + 1, width)
        count = -(-(rows - height + 1) // down) * -(-(cols - width + 1) // across)
        at_once = min(count, max(1, cv2.getNumThreads()))
        spectrum = DOUBLE * fft_rows * fft_cols
        planes = DOUBLE * channels * (down + height - 1) * (across + width - 1)
        of_place = DOUBLE * down * across
        deviations = DOUBLE * channels * height * width
        # One channel's spectrum and the sum; then the sum, the energy, and the norm and flatness of each window.
        squares = planes if dtype.kind == "f" else 0
        memory = planes + max(min(channels, 2) * spectrum, spectrum + of_place + max(deviations, squares))
        if masked:
            memory = planes + max(planes + spectrum, 3 * spectrum + 3 * of_place)
        memory += kept_blocks(spectrum, 2)
        shared = (channels + masked) * spectrum
        each = channels + 1 + (channels + 2) * masked
        return cls(fft_rows * fft_cols, at_once, shared, memory, channels + masked + count * each)


def has_alpha(shape: Shape) -> bool:
    """Return whether images of that shape have an alpha channel."""
    return len(shape) == 3 and shape[2] == 4


def fitting_image(
    estimate: Callable[[Shape, Shape], Estimate], image_shape: Shape, template_shape: Shape, allowed: int
) -> str:
    """Return a sentence with the size of an image, or else of a template, that would fit into `allowed` bytes.

    Both keep their aspect ratio: the image shrinks down to the template; if that is not enough, the template shrinks.

    Parameters
    ----------
    estimate
        Takes the shapes of an image and of a template.
    """

    def resized(shape: Shape, width: int) -> Shape:
        return max(1, round(shape[0] * width / shape[1])), width, *shape[2:]

    def of_image(width: int) -> Estimate:
        rows, cols, *rest = resized(image_shape, width)
        return estimate((max(rows, template_shape[0]), max(cols, template_shape[1]), *rest), template_shape)

    def of_template(width: int) -> Estimate:
        return estimate(image_shape, resized(template_shape, width))

    width = largest_fitting(of_image, image_shape[1], allowed)
    rows, cols = resized(image_shape, max(width, 1))[:2]
    if width and rows >= template_shape[0] and cols >= template_shape[1]:
        return f"With this template, an image of {cols:,} × {rows:,} pixels ({_megapixels(rows * cols)}) would fit."
    width = largest_fitting(of_template, template_shape[1], allowed)
    if width:
        rows, cols = resized(template_shape, width)[:2]
        return f"In this image, a template of {cols:,} × {rows:,} pixels ({_megapixels(rows * cols)}) would fit."
    return "A smaller image would fit."


def _megapixels(pixels: int) -> str:
    return f"{max(pixels / 1e6, FEWEST_MEGAPIXELS):.3g} megapixels"
