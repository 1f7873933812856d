"""Flicker of disparity maps: their change from frame to frame where the picture did not change."""

from __future__ import annotations

import math

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.inputs import Image, as_eight_bit, as_grey, as_image

STILL_LEVELS = 3.0
"""Mean change of a neighbourhood up to which it counts as still, grey levels of 255: about camera noise."""

NEIGHBOURHOOD = 7
"""Side of the neighbourhood, px; about that of a small matching window, so that the matcher's input is unchanged."""

LEAST_SHARE = 0.001
"""Least share of the pixels for a meaningful figure."""


def still_pixels(
    before: npt.ArrayLike, now: npt.ArrayLike, *, levels: float = STILL_LEVELS, size: int = NEIGHBOURHOOD
) -> npt.NDArray[np.bool_]:
    """Return the mask of pixels at which a picture did not change.

    Parameters
    ----------
    before, now
        (H, W), (H, W, 3) or (H, W, 4): two frames of one camera, of one size.
    levels
        Mean absolute change of a neighbourhood up to which it counts as still, grey levels of 255.
    size
        Side of the neighbourhood, px.

    Returns
    -------
    still
        (H, W) bool.
    """
    frames = as_eight_bit(as_grey(as_image(before, "before")), as_grey(as_image(now, "now")))
    change = cv2.blur(cv2.absdiff(*frames), (size, size))
    return np.asarray(change <= levels)


def flicker(before: npt.ArrayLike, now: npt.ArrayLike, still: npt.ArrayLike) -> float:
    """Return the mean absolute change of the disparity where the picture did not change, px.

    Parameters
    ----------
    before, now
        (H, W) disparities of two consecutive frames, px; NaN = none.
    still
        (H, W) bool from :func:`still_pixels`.

    Returns
    -------
    flicker
        px; NaN if less than a thousandth of the pixels are still and have a disparity in both.

    Raises
    ------
    ValueError
        If the shapes differ.

    Notes
    -----
    The world may move where the picture does not, such as a road passing below the car, but its disparity then stays:
    any change comes from the matching. The mean is used because flicker consists of jumps, which a median would miss.
    """
    first, second = np.asarray(before, dtype=np.float32), np.asarray(now, dtype=np.float32)
    unchanged = np.asarray(still, dtype=np.bool_)
    if not first.shape == second.shape == unchanged.shape:
        raise ValueError(f"the shapes are {first.shape}, {second.shape} and {unchanged.shape}; all must be one (H, W).")
    change = cv2.absdiff(first, second)[unchanged]
    known = change[np.isfinite(change)]
    return float(known.mean()) if known.size >= LEAST_SHARE * first.size and known.size else math.nan


def same_picture_size(before: Image, now: Image) -> bool:
    """Return whether two frames can be compared: a camera may be switched to another size during a sequence."""
    return before.shape[:2] == now.shape[:2] and before.dtype == now.dtype
