"""Disparity maps as pictures in one range of colours, and the legend to read them by."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.figures.colours import VIRIDIS, Rgb, colour_numbers, colour_table, coloured, palette
from stereolag.figures.legend import strip
from stereolag.figures.pictures import as_rgb, indexed_png, png, thinned
from stereolag.inputs import Image

FAR_TO_NEAR = VIRIDIS[::-1]
"""Far yellow, near purple, as in the report."""

PALETTES: dict[str, Rgb] = {
    "viridis": FAR_TO_NEAR,
    "plasma": palette(cv2.COLORMAP_PLASMA)[::-1],
    "turbo": palette(cv2.COLORMAP_TURBO),
}
"""The colours a visitor may choose, from far to near; none holds the grey of no answer."""

ROUNDED_TO = 4
"""Px to which the ends of a range are rounded: small changes of a map leave its colours where they were."""


def disparity_range(maps: Sequence[npt.NDArray[np.float32]]) -> tuple[float, float]:
    """Return the disparities, px, at the ends of the colours: all but the outermost 1 % of the maps lies between.

    Given the truth alone the range holds still whatever the settings; without it, the maps to compare share one.
    """
    known = np.concatenate([np.empty(0, dtype=np.float32), *(one[np.isfinite(one)] for one in map(thinned, maps))])
    if known.size == 0:
        return 0.0, float(ROUNDED_TO)
    low, high = np.percentile(known, (1, 99))
    first = np.floor(low / ROUNDED_TO) * ROUNDED_TO
    return float(first), float(max(np.ceil(high / ROUNDED_TO) * ROUNDED_TO, first + ROUNDED_TO))


def disparity_png(disparity: npt.NDArray[np.float32], low: float, high: float, colours: Rgb = FAR_TO_NEAR) -> bytes:
    """Return a disparity map as a PNG, thinned where it is wide: by default far yellow, near purple; no answer grey."""
    return indexed_png(colour_numbers(thinned(disparity), low, high), colour_table(colours))


def image_into_map(image: Image, disparity: npt.NDArray[np.float32], low: float, high: float) -> bytes:
    """Return the image that turns into its disparity map two fifths of the way to the right, as a PNG."""
    picture = as_rgb(image).copy()
    seam = picture.shape[1] * 2 // 5
    picture[:, seam:] = coloured(disparity, low, high, FAR_TO_NEAR)[:, seam:]
    return png(picture)


def disparity_legend(low: float, high: float, colours: Rgb = FAR_TO_NEAR) -> str:
    """Return a strip of the colours with the disparities they stand for, as HTML."""
    return strip(
        low, high, colours, "far ← disparity, px → near", "One range of colours for all maps. Grey: no answer."
    )
