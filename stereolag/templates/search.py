"""Template search: the positions of a small image in a larger one."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from numbers import Integral
from typing import NamedTuple, get_args

import numpy as np
import numpy.typing as npt

from stereolag.core.inputs import Image, as_image, as_images
from stereolag.core.jobs import COSTS, MAX_HEAP_BLOCK, Estimate, Progress, check_memory, part, silent
from stereolag.core.searches import TemplateMethod
from stereolag.loops.bands import available_cores
from stereolag.templates.exact_pixels import exact_positions
from stereolag.templates.hidden_parts import hidden_amounts, hidden_places
from stereolag.templates.patterns import Pattern, prepared
from stereolag.templates.places import peaks
from stereolag.templates.poses import PoseRange, Range, checked_poses, posed_places
from stereolag.templates.score_maps import direct_score_map, fft_score_map, tiling, with_gaps
from stereolag.templates.verdict import TemplateSearch, judged

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

    The terms are in the method's row of :data:`stereolag.core.jobs.COSTS`. "sampled" needs more if no value of the
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
    hidden = hidden_amounts(image_shape, template_shape, channels, itemsize)
    if method == "direct":
        return COSTS["template by products"].estimate(
            grey=grey,
            values=values,
            planes=channels * pixels,
            pixels=pixels,
            places=places,
            sums=channels * places,
            products=places * height * width * (2 * channels + 1),
            **hidden,
        )
    poses = checked_poses(method, scales, rotations)
    if poses is not None:
        return _estimate_poses(image_shape, template_shape, channels, itemsize, grey, poses)
    weighted = has_alpha(template_shape) if masked is None else masked
    single = np.dtype(dtype) == np.uint8
    tiles = _tile_amounts(image_shape, template_shape, channels, weighted, single)
    at_once = min(tiles.number, available_cores())
    return COSTS["template by fft"].estimate(
        grey=grey,
        values=values,
        places=places,
        # 8 bits are transformed in single precision.
        points=(tiles.shared + at_once * tiles.points) / (2 if single else 1),
        turns=tiles.turns / at_once,
        **hidden,
    )


def _estimate_poses(
    image_shape: Shape, template_shape: Shape, channels: int, itemsize: int, grey: int, poses: PoseRange
) -> Estimate:
    """Return the estimate for a search over sizes and angles: the coarse maps together, then the warped templates."""
    (rows, cols), factor, grid = image_shape[:2], poses.coarse_factor(template_shape), poses.grid(template_shape)
    largest = max(scale for scale, _ in grid)
    sides = [math.ceil(side * largest / factor) for side in template_shape[:2]]
    reduced = [math.ceil(max(side / factor, least)) for side, least in zip((rows, cols), sides, strict=True)]
    tiles = _tile_amounts(reduced, sides, 1, masked=True, single=False)
    threads = available_cores()
    pixels, score, peak, double = reduced[0] * reduced[1], 4, 40, 8
    coarse = rows * cols * itemsize + score * pixels
    coarse += threads * (double * (tiles.shared + tiles.points) + (score + peak) * pixels)
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
    image_shape: Sequence[int], template_shape: Sequence[int], channels: int, masked: bool, single: bool
) -> _Tiles:
    (rows, cols), (height, width) = image_shape[:2], template_shape[:2]
    (down, across), transformed = tiling((rows - height + 1, cols - width + 1), (height, width))
    count = -(-(rows - height + 1) // down) * -(-(cols - width + 1) // across)
    points = math.prod(transformed)
    # The channels, their spectra unless OpenCV makes them, and the products of one channel and of all; with a mask also
    # the squares and their spectrum, the energy and the sums of windows.
    planes = (channels + masked) * (down + height - 1) * (across + width - 1)
    work = (channels * (not single) + min(channels, 2) + 3 * masked) * points
    if single:  # OpenCV's own transforms of blocks of the tile, in double precision whatever it is given
        blocks = (min(max(9 * side // 2, 256), length) + side for side, length in ((height, down), (width, across)))
        work += 4 * math.prod(blocks)
    # Freed spectra, which the allocator may keep.
    slack = 0 if single else 2 * min(points, MAX_HEAP_BLOCK // 8)
    transforms = channels + masked + count * (channels + 1 + (channels + 2) * masked)
    shared = (channels + masked) * (height * width if single else points)
    return _Tiles(count, shared, planes + work + slack, transforms * points * math.log2(points))


def has_alpha(shape: Shape) -> bool:
    """Return whether images of that shape have an alpha channel."""
    return len(shape) == 3 and shape[2] == 4


def match_template(
    image: npt.ArrayLike,
    template: npt.ArrayLike,
    *,
    method: TemplateMethod = "fft",
    mask: npt.ArrayLike | None = None,
    max_matches: int = 1,
    min_score: float = 0.5,
    scales: tuple[float, float] | None = None,
    rotations: tuple[float, float] | None = None,
    seed: int | None = None,
    progress: Progress | None = None,
) -> TemplateSearch:
    """Find a template in an image by the zero-mean normalised cross-correlation (ZNCC).

    The mean of each channel over the compared pixels is subtracted; products and squares are then summed over all
    channels (Pearson's coefficient, as in OpenCV's TM_CCOEFF_NORMED). The sign counts: a negative of the template is
    not a match. Every position fully inside the image is searched.

    Parameters
    ----------
    image
        (rows, cols) grey or (rows, cols, 3 | 4) RGB(A); integers or floats. Its alpha is ignored. Places that contain
        pixels without data, NaN or far beyond all others, have no score.
    template
        Likewise, no larger than the image. Its alpha is the weight of its pixels, as a mask is. If one of the two is
        grey, the luminance of the other is compared. A template of one colour is searched by the edges of its alpha.
    method
        "fft" scores every position, in a time that hardly depends on the size of the template.
        "direct" gives the same result by sliding the template along every row: minutes for a photograph.
        "sampled" (Appendix B of the source report) scores only positions where the image has the exact values of a rare
        pixel of the template and of the two ends of its opaque run. It is the fastest, but finds nothing in an image
        that was recompressed, rescaled or dimmed, where "fft" still finds the template, and it is slow in an image with
        so few values that none is rare.
    mask
        (height, width) of the template, instead of its alpha: the weights of its pixels, from 0.
    max_matches
        Largest number of copies wanted: of three copies, one alone is not found, but all three are if three or more are
        wanted. To want more never makes a poorer place a match.
    min_score
        Least score of a match, -1..1.
    scales
        Smallest and largest size of the template in the image relative to its own; None: its own size only. For "fft".
    rotations
        Smallest and largest rotation of the template in the image, degrees, positive counter-clockwise as seen; None:
        upright only. For "fft".
    seed
        Seed of the random choices of "sampled"; the other methods make none.
    progress
        Called with the fraction done, 0..1.

    Returns
    -------
    TemplateSearch
        `found` only if a position that reaches `min_score` shows the template (:mod:`stereolag.templates.identity`),
        and no more positions do than are wanted; `matches` is empty if none reaches `min_score`.

    Raises
    ------
    ValueError
        Arrays that are not images, a template larger than the image, a mask of another size, no opaque pixels,
        opaque pixels all of one value, an unknown method, numbers out of bounds; for "sampled" also image and template
        of different types; more memory needed than one job may take
        (:func:`~stereolag.templates.estimate_search`).

    Examples
    --------
    >>> import numpy as np
    >>> import stereolag as sl
    >>> image = np.random.default_rng(0).integers(0, 256, (120, 160), dtype=np.uint8)
    >>> search = sl.match_template(image, image[40:60, 70:100])
    >>> search.found, search.matches[0].row, search.matches[0].col  # px, of the top-left pixel
    (True, 40, 70)
    """
    _check_options(method, max_matches, min_score)
    poses = checked_poses(method, scales, rotations)
    searched, pattern = _checked(image, template, mask, method, poses)
    report = silent if progress is None else progress
    search_hidden = method != "sampled" and poses is None
    first, second = (part(report, number, 2) for number in range(2)) if search_hidden else (report, silent)
    started = time.perf_counter()
    score_map: npt.NDArray[np.float32] | None = None
    if method == "sampled":
        if searched.dtype != pattern.colours.dtype:
            raise ValueError(
                f"image holds {searched.dtype} and template {pattern.colours.dtype} pixels; "
                "the method 'sampled' compares exact values and needs one type (or use 'fft')."
            )
        places, candidates = exact_positions(searched, pattern, min_score, seed, first)
    elif poses is not None:
        places, candidates = posed_places(searched, pattern, poses, first)
    else:
        score_map = (fft_score_map if method == "fft" else direct_score_map)(searched, pattern, first)
        places, candidates = peaks(score_map, pattern.shape), score_map.size
    judge = partial(judged, image=searched, pattern=pattern, max_matches=max_matches, min_score=min_score)
    search = judge(places, score_map=score_map, candidates=candidates)
    if search_hidden and not search.found:
        places = hidden_places(searched, pattern, second)
        search = judge(places, score_map=score_map, candidates=candidates, otherwise=search)
    report(1.0)
    gaps = with_gaps(searched, pattern.shape)
    left_out = 0.0 if gaps is None or not gaps.size else float(gaps.mean())
    return replace(search, left_out=left_out, elapsed_s=time.perf_counter() - started)


def _check_options(method: str, max_matches: int, min_score: float) -> None:
    if method not in get_args(TemplateMethod):
        raise ValueError(f"method is {method!r}; allowed are {', '.join(map(repr, get_args(TemplateMethod)))}.")
    if not isinstance(max_matches, Integral) or max_matches < 1:
        raise ValueError(f"max_matches is {max_matches}; allowed are whole numbers from 1.")
    if not -1 <= min_score <= 1:
        raise ValueError(f"min_score is {min_score}; a correlation coefficient lies between -1 and 1.")


def check_fits(image: Image, template: Image, least: float = 1.0) -> None:
    """Raise a ValueError for a template that is larger than the image even at its smallest size."""
    if template.shape[0] * least > image.shape[0] or template.shape[1] * least > image.shape[1]:
        (rows, cols), (height, width) = image.shape[:2], template.shape[:2]
        resized = "" if least == 1 else f" at {least:g} of its size"
        swapped = " Each fits in the other’s place: change them over." if height >= rows and width >= cols else ""
        raise ValueError(
            f"The template is {width} × {height} pixels and the image {cols} × {rows}; the template must fit into the "
            f"image{resized}.{swapped}"
        )


def _checked(
    image: npt.ArrayLike,
    template: npt.ArrayLike,
    mask: npt.ArrayLike | None,
    method: TemplateMethod,
    poses: PoseRange | None,
) -> tuple[Image, Pattern]:
    """Return the image (rows, cols, channels) and the pattern to search for, after all checks."""
    given = np.asarray(template)
    if given.ndim == 3 and given.shape[2] == 2:  # grey with alpha: compared by its grey, like a grey template
        template, mask = given[:, :, 0], given[:, :, 1] if mask is None else mask
    large, small = as_images(image, template, ("image", "template"), gaps=True)
    check_fits(large, small, 1.0 if poses is None else poses.scales[0])
    check_memory(
        estimate_search(
            large.shape,
            small.shape,
            dtype=large.dtype,
            method=method,
            masked=mask is not None or has_alpha(small.shape),
            scales=None if poses is None else poses.scales,
            rotations=None if poses is None else poses.rotations,
        )
    )
    return prepared(large, small, None if mask is None else as_image(mask, "mask"), exact=method == "sampled")
