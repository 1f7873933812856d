"""Template search: the positions of a small image in a larger one."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import get_args

import numpy as np
import numpy.typing as npt

from stereolag.core.inputs import Image, as_image, as_images
from stereolag.core.jobs import Progress, check_memory, silent
from stereolag.core.searches import TemplateMethod
from stereolag.templates.estimates import estimate_search, has_alpha
from stereolag.templates.exact_pixels import ExactPlacements, exact_positions
from stereolag.templates.judging import Places, judged
from stereolag.templates.patterns import Pattern, alike, opaque_pixels, pattern_of
from stereolag.templates.peaks import peaks
from stereolag.templates.pose_ranges import PoseRange, checked_poses
from stereolag.templates.poses import posed_places
from stereolag.templates.reduction import likely_places
from stereolag.templates.result import TemplateSearch
from stereolag.templates.score_maps import direct_score_map, fft_score_map
from stereolag.templates.variants import as_given

EXACT = 0.999
"""Least score of an exact copy."""

LIKELY = 6
"""Number of rivals looked for in addition to the exact pixels."""

NEAR_EXACT = 0.9
"""Least score of an exact copy's rival on some of its pixels: on all of them it needs 0.996."""


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
        (rows, cols) grey or (rows, cols, 3 | 4) RGB(A); uint8, uint16 or float. Its alpha is ignored.
    template
        Likewise, no larger than the image. Only its most opaque pixels are compared. If one of the two is grey, the
        luminance of the other is compared.
    method
        "fft" scores every position, in a time that hardly depends on the size of the template.
        "direct" gives the same result by sliding the template along every row: minutes for a photograph.
        "sampled" (Appendix B of the source report) scores only positions where the image has the exact values of a rare
        pixel of the template and of the two ends of its opaque run. It is the fastest, but finds nothing in an image
        that was recompressed, rescaled or dimmed, where "fft" still finds the template, and it is slow in an image with
        so few values that none is rare. Its matches are compared with the likeliest places of a smaller image, which
        takes longer than finding them.
    mask
        (height, width) of the template: its pixels above 0 are compared, regardless of the template's alpha.
    max_matches
        Largest number of matches, each a local maximum of the score. The lead is measured after the last match that has
        one: of three equal copies, one alone is not found, but all three are if three are wanted.
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
        `found` only if a position reaches `min_score` and has a clear lead over all others
        (:mod:`stereolag.templates.verdict`); `matches` is empty if none reaches `min_score`.

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
    started = time.perf_counter()
    score_map: npt.NDArray[np.float32] | None
    if method == "sampled":
        _check_same_type(searched, pattern)
        positions = exact_positions(searched, pattern, min_score, seed, report)
        places, own = _with_rivals(searched, pattern, positions, min_score)
        score_map, candidates = None, positions.candidates
    elif poses is not None:
        places, candidates = posed_places(searched, pattern, poses, report)
        score_map, own = None, len(places.rows)
    else:
        score_map = (fft_score_map if method == "fft" else direct_score_map)(searched, pattern, report)
        rows, cols = peaks(score_map, -1.0)
        places, own = Places(rows, cols, score_map[rows, cols], pattern.shape), len(rows)
        candidates = score_map.size
    search = judged(places, max_matches, min_score, score_map=score_map, candidates=candidates, matchable=own)
    search = as_given(search, searched, pattern)
    return replace(search, elapsed_s=time.perf_counter() - started)


def _with_rivals(image: Image, pattern: Pattern, positions: ExactPlacements, min_score: float) -> tuple[Places, int]:
    """Return the positions that share exact pixels, followed by likely places elsewhere, and the number of the former.

    An exact copy can also have rivals of another brightness or contrast, which share none of its pixels; only those
    that score close to it count.
    """
    scored = np.isfinite(positions.scores)
    places = Places(positions.rows[scored], positions.cols[scored], positions.scores[scored], pattern.shape)
    own = len(places.rows)
    if own and (best := places.scores.max()) >= min_score:
        places = places.joined(*likely_places(image, pattern, LIKELY, NEAR_EXACT if best >= EXACT else None))
    return places, own


def _check_options(method: str, max_matches: int, min_score: float) -> None:
    if method not in get_args(TemplateMethod):
        raise ValueError(f"method is {method!r}; allowed are {', '.join(map(repr, get_args(TemplateMethod)))}.")
    if max_matches < 1:
        raise ValueError(f"max_matches is {max_matches}; it must be 1 or more.")
    if not -1 <= min_score <= 1:
        raise ValueError(f"min_score is {min_score}; a correlation coefficient lies between -1 and 1.")


def _checked(
    image: npt.ArrayLike,
    template: npt.ArrayLike,
    mask: npt.ArrayLike | None,
    method: TemplateMethod,
    poses: PoseRange | None,
) -> tuple[Image, Pattern]:
    """Return the image (rows, cols, channels) and the pattern to search for, if there is memory for the search."""
    large, small = as_images(image, template, ("image", "template"))
    least = 1.0 if poses is None else poses.scales[0]
    if small.shape[0] * least > large.shape[0] or small.shape[1] * least > large.shape[1]:
        resized = "" if least == 1 else f" at {least:g} of its size"
        raise ValueError(
            f"template is {small.shape[1]} × {small.shape[0]} pixels and image {large.shape[1]} × "
            f"{large.shape[0]}; the template must fit into the image{resized}."
        )
    needed = estimate_search(
        large.shape,
        small.shape,
        dtype=large.dtype,
        method=method,
        masked=mask is not None or has_alpha(small.shape),
        scales=None if poses is None else poses.scales,
        rotations=None if poses is None else poses.rotations,
    )
    check_memory(needed)
    opaque = opaque_pixels(small, None if mask is None else as_image(mask, "mask"))
    large, colours = alike(large, small)
    return large, pattern_of(colours, opaque)


def _check_same_type(large: Image, pattern: Pattern) -> None:
    if large.dtype != pattern.colours.dtype:
        raise ValueError(
            f"image holds {large.dtype} and template {pattern.colours.dtype} pixels; "
            "the method 'sampled' compares exact values and needs one type (or use 'fft')."
        )
