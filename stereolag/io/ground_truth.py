"""The ground truth of a pair as a file gives it: the divisor that fits the pair, and whether it fits at all."""

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
"""Px; a map this wide is enough to find the divisor, and takes a few hundredths of a second."""
MAX_AGREEING_ERROR_PX, MAX_AGREEING_ERROR_SHARE = 1.0, 0.05
"""Two disparities agree if they differ by no more than the larger of this distance and this share; neighbouring
divisors differ by a factor of two."""

MIN_DECISIVE_PX = 3.0
"""Disparities of the quick map from which on it may speak against a file."""

MIN_OVERRIDING_SHARE = 0.5
"""Share of the pixels at which another reading of a file must agree to be taken in place of its own."""

MIN_DEPTH_RATIO = 1.25
"""How many times as many pixels must agree with the inverse of a file's numbers as with these, if they are depth."""

MIN_FITTING_SHARE = 0.3
"""Share of the pixels below which a ground truth hardly agrees with a quick map: of 15, 0.77 and more."""

MIN_DECISIVE_PIXELS = 500

AS_DEPTH = (
    "The ground truth looks like depth, not disparity: save focal length × baseline / depth, in px, in place of it."
)

OTHER_DIVISORS = tuple(sign * size for size in (1.0, 16.0, 64.0, 100.0, 128.0, 256.0) for sign in (1, -1))
"""Divisors of files with more than 8 bits: OpenCV 16, KITTI and Spring 256, DrivingStereo 128 or 256; a stereo camera's
own program may count with the other sign."""


@dataclass(frozen=True)
class TruthFit:
    """How a ground truth fits its pair, beside a quick map.

    Attributes
    ----------
    divisor
        The divisor with the most agreeing pixels; that of the file, or the first, if there is a tie or no agreement.
    doubt
        A sentence where it hardly agrees with any; "" otherwise.
    is_depth
        Whether it plainly is depth, not disparity: no map may be judged by it.
    """

    divisor: float
    doubt: str = ""
    is_depth: bool = False


def truth_fit(
    stored: npt.ArrayLike, left: Image, right: Image, divisors: Sequence[float] = DIVISORS, own: float | None = None
) -> TruthFit:
    """Return how the stored values agree with a quick map, and the divisor that makes them agree best.

    Parameters
    ----------
    stored
        (H, W) values as stored in the file, NaN where unknown; the size of the left image.
    left, right
        The rectified pair, of any sizes that :func:`stereolag.geometry.rectification.cropped_to_common_size` allows.
    divisors
        Those to choose from.
    own
        The divisor that the file itself speaks for, if it does: kept unless another agrees at half of the pixels, and
        at twice as many as this one.
    """
    left, right = cropped_to_common_size(left, right)
    rows, cols = left.shape[:2]
    factor = min(1.0, QUICK_MAP_WIDTH_PX / cols)
    values = scaled_disparity(np.asarray(stored)[:rows, :cols], factor)
    small = [scaled_image(image, factor) for image in (left, right)]
    reach = min(255, small[0].shape[1] // 2)  # no more than 8 bits hold
    try:
        found = StereoSGBM(num_disparities=max(16, reach // 16 * 16)).compute(*small).disparity
    except ValueError:  # too narrow for a search
        return TruthFit(divisors[0] if own is None else own)
    known = np.isfinite(values) & np.isfinite(found)
    telling = known & (np.abs(found) > MIN_DECISIVE_PX)  # next to 0, the smallest of any divisors would agree
    pixels = known if own is None else telling

    def agreeing(read: npt.ArrayLike, pixels: npt.NDArray[np.bool_]) -> int:
        tolerance = np.maximum(MAX_AGREEING_ERROR_PX, MAX_AGREEING_ERROR_SHARE * found[pixels])
        return int(np.count_nonzero(np.abs(np.asarray(read)[pixels] - found[pixels]) <= tolerance))

    best = max(divisors, key=lambda divisor: agreeing(values / divisor, pixels))
    others, enough = agreeing(values / best, pixels), MIN_OVERRIDING_SHARE * np.count_nonzero(pixels)
    if own is not None and others <= max(enough, 2 * agreeing(values / own, pixels)):
        best = own
    count = np.count_nonzero(telling)
    if count < MIN_DECISIVE_PIXELS:
        return TruthFit(best)
    agrees = agreeing(values / best, telling)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        of_any_scale = agreeing(values * np.median(found[telling] / values[telling]), telling)
        as_depth = agreeing(np.median(found[telling] * values[telling]) / values, telling)
    if as_depth > MIN_OVERRIDING_SHARE * count and as_depth > MIN_DEPTH_RATIO * max(agrees, of_any_scale):
        return TruthFit(best, AS_DEPTH, is_depth=True)
    searched = np.count_nonzero(telling & (values / best > 0))  # cameras turned towards each other have others, too
    if searched < MIN_DECISIVE_PIXELS or agrees >= MIN_FITTING_SHARE * searched:
        return TruthFit(best)
    said = f"The ground truth agrees with a quick map at {100 * agrees / searched:.0f} % of the pixels"
    return TruthFit(best, f"{said}: is it of this left image, and its divisor right?")


def stored_truth_fit(stored: StoredDisparity, left: Image, right: Image) -> TruthFit:
    """Return how a ground truth fits its pair; its divisor may be another than its file speaks for."""
    values = halved_truth(stored.divided(1.0), left.shape[:2])
    if stored.divisor is None:
        return truth_fit(values, left, right)
    if values.shape != left.shape[:2]:  # refused with the pair
        return TruthFit(stored.divisor)
    return truth_fit(values, left, right, OTHER_DIVISORS, stored.divisor)


def halved_truth(truth: FloatMap, shape: tuple[int, ...]) -> FloatMap:
    """Return every second row and column of a ground truth of twice the size of its pair, as Spring's; or unchanged."""
    return truth[::2, ::2] if truth.shape == (2 * shape[0], 2 * shape[1]) else truth


def divisor_in_words(stored: StoredDisparity, divisor: float) -> str:
    """Return a sentence about a divisor that a quick map speaks for, against the file; "" if both agree."""
    if stored.divisor is None:
        return f"The ground truth has 8 bits: ÷ {divisor:g} agrees best with a quick map."
    ratio = abs(divisor / stored.divisor)
    if divisor == stored.divisor:
        return ""
    size = f"{max(ratio, 1 / ratio):.3g} times too {'large' if ratio > 1 else 'small'}" if ratio != 1 else ""
    sign = "of the other sign" if divisor < 0 else ""
    looks = " and ".join(filter(None, (size, sign)))
    return f"The ground truth looks {looks} beside a quick map: it is read as ÷ {divisor:g}, not ÷ {stored.divisor:g}."


def truth_in_px(
    stored: StoredDisparity, left: Image, right: Image, divisor: float | None = None
) -> tuple[FloatMap, str]:
    """Return the ground truth of a pair, px, and a sentence if a quick map speaks for its divisor, or against it.

    `divisor`, if given, is taken as it is.

    Raises
    ------
    ValueError
        It plainly is depth.
    """
    said = ""
    if divisor is None:
        fit = stored_truth_fit(stored, left, right)
        if fit.is_depth:
            raise ValueError(fit.doubt)
        divisor, said = fit.divisor, fit.doubt or divisor_in_words(stored, fit.divisor)
    return halved_truth(stored.divided(divisor), left.shape[:2]), said
