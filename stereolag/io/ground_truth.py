"""The ground truth of a pair as stored in a file: its divisor, and whether it fits the pair, by a quick match."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import FloatMap
from stereolag.core.inputs import Image
from stereolag.geometry.rectification import cropped_to_common_size, scaled_disparity, scaled_image
from stereolag.io.disparities import StoredDisparity
from stereolag.stereo.opencv import StereoSGBM

DIVISORS = (1, 2, 4, 8, 16)
"""Factors by which data sets scale disparities to use the 8 bits: Middlebury 1, 2, 4 and 8, Tsukuba 16."""

QUICK_MAP_WIDTH_PX = 480
"""Maximum width of the quick map: enough to find the divisor, in a few hundredths of a second."""

MAX_AGREEING_ERROR_PX = 1.0
"""Two disparities agree if they differ by no more than this or `MAX_AGREEING_ERROR_SHARE`, whichever is larger."""

MAX_AGREEING_ERROR_SHARE = 0.05
"""The same as a share of the disparity; neighbouring divisors differ by a factor of two."""

MIN_DECISIVE_PX = 3.0
"""Minimum magnitude of the quick map's disparities that may contradict a file."""

MIN_OVERRIDING_SHARE = 0.5
"""Minimum share of the pixels at which another interpretation of a file must agree to replace its own."""

MIN_DEPTH_RATIO = 1.25
"""Minimum ratio of the pixels that agree with the inverse of the numbers to those that agree with the numbers, if these
are depths."""

MIN_FITTING_SHARE = 0.3
"""Minimum share of the pixels at which a ground truth must agree with the quick map to fit: 15 of them had 0.77 and
more."""

MIN_DECISIVE_PIXELS = 500
"""Minimum number of pixels for any verdict against a file."""

AS_DEPTH = (
    "The ground truth looks like depth, not disparity: save focal length × baseline / depth, in px, in place of it."
)

OTHER_DIVISORS = tuple(sign * size for size in (1.0, 16.0, 32.0, 64.0, 100.0, 128.0, 256.0) for sign in (1, -1))
"""Divisors of files with more than 8 bits: OpenCV 16, CREStereo 32, KITTI and Spring 256, DrivingStereo 128 or 256; a
stereo camera may use the opposite sign."""


@dataclass(frozen=True)
class TruthFit:
    """The fit of a ground truth to its pair, compared with a quick map.

    Attributes
    ----------
    divisor
        The divisor with the most agreeing pixels; that of the file, or the first, if there is a tie or no agreement.
    doubt
        A sentence if it hardly agrees with any divisor; "" otherwise.
    is_depth
        Whether it is clearly depth, not disparity: no map may be evaluated with it.
    """

    divisor: float
    doubt: str = ""
    is_depth: bool = False


def truth_fit(
    stored: npt.ArrayLike, left: Image, right: Image, divisors: Sequence[float] = DIVISORS, own: float | None = None
) -> TruthFit:
    """Return the fit of the stored values to a quick map, for the divisor with which they agree best.

    Parameters
    ----------
    stored
        (H, W) values as stored in the file, NaN where unknown; the size of the left image.
    left, right
        The rectified pair, of any sizes that :func:`stereolag.geometry.rectification.cropped_to_common_size` allows.
    divisors
        Those to choose from.
    own
        The divisor of the file's format, if known: kept unless another one agrees at half of the pixels, and at twice
        as many as this one.
    """
    left, right = cropped_to_common_size(left, right)
    rows, cols = left.shape[:2]
    factor = min(1.0, QUICK_MAP_WIDTH_PX / cols)
    values = scaled_disparity(np.asarray(stored)[:rows, :cols], factor)
    small = [scaled_image(image, factor) for image in (left, right)]
    max_disparity = min(255, small[0].shape[1] // 2)  # 8 bits hold no more
    try:
        quick_map = StereoSGBM(num_disparities=max(16, max_disparity // 16 * 16)).compute(*small).disparity
    except ValueError:  # too narrow for a search
        return TruthFit(divisors[0] if own is None else own)
    known = np.isfinite(values) & np.isfinite(quick_map)
    decisive = known & (np.abs(quick_map) > MIN_DECISIVE_PX)  # near 0, several divisors agree
    pixels = known if own is None else decisive

    def count_agreeing(disparity: npt.ArrayLike, pixels: npt.NDArray[np.bool_]) -> int:
        tolerance = np.maximum(MAX_AGREEING_ERROR_PX, MAX_AGREEING_ERROR_SHARE * quick_map[pixels])
        return int(np.count_nonzero(np.abs(np.asarray(disparity)[pixels] - quick_map[pixels]) <= tolerance))

    best = max(divisors, key=lambda divisor: count_agreeing(values / divisor, pixels))
    with_best, enough = count_agreeing(values / best, pixels), MIN_OVERRIDING_SHARE * np.count_nonzero(pixels)
    if own is not None and with_best <= max(enough, 2 * count_agreeing(values / own, pixels)):
        best = own
    count = np.count_nonzero(decisive)
    if count < MIN_DECISIVE_PIXELS:
        return TruthFit(best)
    agreeing = count_agreeing(values / best, decisive)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        at_any_scale = count_agreeing(values * np.median(quick_map[decisive] / values[decisive]), decisive)
        as_depth = count_agreeing(np.median(quick_map[decisive] * values[decisive]) / values, decisive)
    if as_depth > MIN_OVERRIDING_SHARE * count and as_depth > MIN_DEPTH_RATIO * max(agreeing, at_any_scale):
        return TruthFit(best, AS_DEPTH, is_depth=True)
    # Of cameras turned towards each other, the truth has disparities below 0 too, which were not searched.
    searched = np.count_nonzero(decisive & (values / best > 0))
    if searched < MIN_DECISIVE_PIXELS or agreeing >= MIN_FITTING_SHARE * searched:
        return TruthFit(best)
    return TruthFit(
        best,
        f"The ground truth agrees with a quick map at {100 * agreeing / searched:.0f} % of the pixels: does it belong "
        "to this left image, and is its divisor right?",
    )


def stored_truth_fit(stored: StoredDisparity, left: Image, right: Image) -> TruthFit:
    """Return the fit of a ground truth to its pair; the divisor may differ from that of the file's format."""
    values = halved_truth(stored.divided(1.0), left.shape[:2])
    if stored.divisor is None:
        return truth_fit(values, left, right)
    if values.shape != left.shape[:2]:  # refused with the pair
        return TruthFit(stored.divisor)
    return truth_fit(values, left, right, OTHER_DIVISORS, stored.divisor)


def halved_truth(truth: FloatMap, shape: tuple[int, ...]) -> FloatMap:
    """Return a ground truth with every second row and column if it has twice the size of its pair, as Spring's."""
    return truth[::2, ::2] if truth.shape == (2 * shape[0], 2 * shape[1]) else truth


def divisor_in_words(stored: StoredDisparity, divisor: float) -> str:
    """Return a sentence about a divisor found by a quick map; "" if it is that of the file's format."""
    if stored.divisor is None:
        return f"The ground truth has 8 bits: ÷ {divisor:g} agrees best with a quick map."
    ratio = abs(divisor / stored.divisor)
    if divisor == stored.divisor:
        return ""
    size = f"{max(ratio, 1 / ratio):.3g} times too {'large' if ratio > 1 else 'small'}" if ratio != 1 else ""
    looks = " and ".join(filter(None, (size, "opposite in sign" if divisor < 0 else "")))
    return (
        f"The ground truth looks {looks} compared with a quick map: it is read as ÷ {divisor:g}, not "
        f"÷ {stored.divisor:g}."
    )


def truth_in_px(
    stored: StoredDisparity, left: Image, right: Image, divisor: float | None = None
) -> tuple[FloatMap, str]:
    """Return the ground truth of a pair, px, and a sentence about its fit or its divisor, or "".

    `divisor`, if given, is used without a check.

    Raises
    ------
    ValueError
        A map that is clearly depth.
    """
    note = ""
    if divisor is None:
        fit = stored_truth_fit(stored, left, right)
        if fit.is_depth:
            raise ValueError(fit.doubt)
        divisor, note = fit.divisor, fit.doubt or divisor_in_words(stored, fit.divisor)
    return halved_truth(stored.divided(divisor), left.shape[:2]), note
