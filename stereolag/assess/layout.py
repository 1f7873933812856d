"""One picture with both views: how it is divided, found from the picture itself, and the views in it."""

from __future__ import annotations

from enum import StrEnum

import cv2
import numpy as np

from stereolag.core.arrays import median
from stereolag.core.inputs import Image, as_eight_bit, as_grey, local_deviation
from stereolag.stereo.opencv import StereoSGBM


class Layout(StrEnum):
    """How both views stand in one picture; "half" ones are squeezed to half of their width or height."""

    BESIDE = "beside"
    HALF_BESIDE = "half-beside"
    OVER_UNDER = "over-under"
    HALF_OVER_UNDER = "half-over-under"


def views(image: Image, layout: Layout, *, crossed: bool = False) -> tuple[Image, Image]:
    """Return the left and the right view of a picture, squeezed ones at the shape they were taken in.

    Parameters
    ----------
    image
        A checked image. If its width or height is odd, the middle column or row is left out.
    crossed
        Whether the right view comes first, as in JPS files for crossed eyes.

    Raises
    ------
    ValueError
        An image with only one column or row to divide.
    """
    across = layout in (Layout.BESIDE, Layout.HALF_BESIDE)
    half = image.shape[int(across)] // 2
    if half == 0:
        raise ValueError(f"The image is 1 pixel {'wide' if across else 'high'}; at least 2 are needed for both views.")
    two = (image[:, :half], image[:, -half:]) if across else (image[:half], image[-half:])
    if layout in (Layout.HALF_BESIDE, Layout.HALF_OVER_UNDER):
        height, width = two[0].shape[:2]
        size = (2 * width, height) if across else (width, 2 * height)
        two = tuple(np.asarray(cv2.resize(one, size, interpolation=cv2.INTER_LINEAR)) for one in two)  # type: ignore[assignment]
    return two[::-1] if crossed else two


class Anaglyph(ValueError):  # noqa: N818
    """A picture whose views are in its colours."""


LOOKED_AT = 240
"""Px; views of this width show whether they are two of one scene."""

REACH = 48
"""Px of these, forwards and backwards; zero is in the middle of many pictures made for screens."""

TEXTURE, LEAST_TEXTURED = 3.0, 0.05
"""Standard deviation around a pixel, grey levels, from which on it tells something, and the least share of such."""

LEAST_MATCHED = 0.45
"""Share of these that are matched in two views of one scene; 0.1 to 0.35 are by chance."""

WIDEST = 4.0
"""Largest width over height of a view."""

SQUEEZED = (0.84, 0.94), (2.6, 4.0)
"""Width over height of views that are half as wide, or half as high, as those of 16:9."""

DEEP, LEAST_DEEP = 1.5, 0.3
"""Px of disparity between red and cyan, and the share of the pixels that have more, which make an anaglyph."""


def likely_layout(image: Image) -> tuple[Layout, bool] | None:
    """Return how both views stand in a picture, and whether the right one comes first; None if it holds but one.

    Of the ways to divide it, the one under which most pixels find a partner; the view that comes first is the left one
    if things in front shift to the left in the other, as far as that is to be seen. Whether views are squeezed follows
    from their shape alone.

    Raises
    ------
    Anaglyph
        A picture whose views are in its colours.
    """
    found = {}
    for layout in (Layout.BESIDE, Layout.OVER_UNDER):
        if min(image.shape[:2]) > 1:
            left, right = views(image, layout)
            if left.shape[1] <= WIDEST * left.shape[0]:
                found[layout] = _matched(left, right)
    layout = max(found, key=lambda one: found[one][0], default=Layout.BESIDE)
    share, middle = found.get(layout, (0.0, 0.0))
    if share < LEAST_MATCHED:
        if image.ndim == 3 and _is_anaglyph(image):
            raise Anaglyph(
                "The image is an anaglyph: its views are in its colours, for red and cyan glasses, and differ too much "
                "to be matched. Give both views as they were taken."
            )
        return None
    height, width = views(image, layout)[0].shape[:2]
    low, high = SQUEEZED[layout is Layout.OVER_UNDER]
    if low <= width / height <= high:
        layout = Layout.HALF_BESIDE if layout is Layout.BESIDE else Layout.HALF_OVER_UNDER
    return layout, middle < 0


def _matched(left: Image, right: Image) -> tuple[float, float]:
    """Return the share of the pixels of small views that find a partner, and their median disparity, px."""
    size = LOOKED_AT, max(16, round(LOOKED_AT * left.shape[0] / left.shape[1]))
    small = [cv2.resize(one, size, interpolation=cv2.INTER_AREA) for one in as_eight_bit(as_grey(left), as_grey(right))]
    matcher = StereoSGBM(min_disparity=-REACH, num_disparities=2 * REACH, block_size=7, uniqueness_ratio=10)
    seen = slice(REACH, -REACH)
    disparity, textured = matcher.compute(*small).disparity[:, seen], local_deviation(small[0], 7)[:, seen] > TEXTURE
    known = np.isfinite(disparity) & textured
    if textured.mean() < LEAST_TEXTURED or not known.any():
        return 0.0, 0.0
    return float(known.sum() / textured.sum()), median(disparity[known])


def _is_anaglyph(image: Image) -> bool:
    """Return whether red is another view than green and blue: of one view, all colours are in one place."""
    red, cyan = (cv2.equalizeHist(one) for one in as_eight_bit(image[:, :, 0], image[:, :, 1]))
    size = LOOKED_AT, max(16, round(LOOKED_AT * image.shape[0] / image.shape[1]))
    small = [cv2.resize(one, size, interpolation=cv2.INTER_AREA) for one in (red, cyan)]
    matcher = StereoSGBM(min_disparity=-REACH // 2, num_disparities=REACH, block_size=11, uniqueness_ratio=5)
    disparity = matcher.compute(*small).disparity[:, REACH // 2 : -REACH // 2]
    known = np.isfinite(disparity)
    return bool(known.mean() > LEAST_MATCHED and (np.abs(disparity[known]) > DEEP).mean() > LEAST_DEEP)


def in_words(image: Image, layout: Layout, *, crossed: bool) -> str:
    """Return how a picture was divided."""
    across = layout in (Layout.BESIDE, Layout.HALF_BESIDE)
    side = image.shape[int(across)]
    said = ["The image was split down the middle." if across else "The image was split into upper and lower half."]
    if side % 2:
        name, line = ("width", "column") if across else ("height", "row")
        said.append(f"Its {name} of {side} px is odd: the middle {line} is left out.")
    if layout in (Layout.HALF_BESIDE, Layout.HALF_OVER_UNDER):
        said.append(f"The views were squeezed, and are stretched to twice their {'width' if across else 'height'}.")
    if crossed:
        said.append("The right view comes first.")
    return " ".join(said)
