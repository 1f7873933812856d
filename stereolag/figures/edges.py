"""The edges of a photograph as lines to overlay on a map of the same scene."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Mask
from stereolag.core.inputs import Image
from stereolag.figures.pictures import as_rgb

LOOKED_AT = 800
"""Px; wider photographs are reduced to this width first: finer edges would be too dense to read as lines."""

BLUR = 2.0
"""Standard deviation of the blur that removes noise and fine texture, px."""

STRONG_SHARE = 0.07
"""An edge starts where the gradient is among this share of the strongest …"""

WEAKER = 0.4
"""… and continues down to this fraction of that gradient."""

LEAST_GRADIENT = 24
"""Minimum gradient at which an edge starts, in units of the Sobel filter: a step of about six grey levels."""

SHORTEST = 0.04
"""Shorter lines are left out; as a share of the width."""

MOST_POINTS = 8_000
"""Most points of all lines together; the longest lines come first, and the rest are left out."""

OFF_LINE = 0.9
"""Largest deviation of a line from the pixels of its edge, px."""

BESIDE = ((0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, -1), (-1, 1))

Line = npt.NDArray[np.float64]


def edge_lines(image: Image) -> list[Line]:
    """Return the edges of an image (Canny's), the longest first.

    Parameters
    ----------
    image
        (H, W), (H, W, 3) or (H, W, 4) of any dtype.

    Returns
    -------
    list of ndarray
        Open lines, each (n, 2) float64 of (column, row), px; the centre of the first pixel is (0.5, 0.5).
    """
    grey = cv2.cvtColor(np.ascontiguousarray(as_rgb(image)), cv2.COLOR_RGB2GRAY)
    rows, cols = grey.shape
    width = min(cols, LOOKED_AT)
    height = max(1, round(rows * width / cols))
    small = cv2.resize(grey, (width, height), interpolation=cv2.INTER_AREA)
    scale = cols / width, rows / height
    long_enough = [chain for chain in _chains(_edges(np.asarray(small))) if len(chain) >= SHORTEST * width]
    lines, points = [], 0
    for chain in sorted(long_enough, key=len, reverse=True):
        line = cv2.approxPolyDP(np.array(chain, np.int32)[:, None, ::-1], OFF_LINE, False)[:, 0]
        points += len(line)
        if points > MOST_POINTS:
            break
        lines.append((line + 0.5) * scale)
    return lines


def edge_path(image: Image) -> str:
    """Return :func:`edge_lines` as an SVG path, px to one decimal; "" for an image without edges."""
    return "".join("M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in line) for line in edge_lines(image))


def _edges(grey: npt.NDArray[np.uint8]) -> Mask:
    """Return the edge pixels of an (H, W) image; edges are one pixel wide."""
    smooth = cv2.GaussianBlur(grey, (0, 0), BLUR)
    dx, dy = (cv2.Sobel(smooth, cv2.CV_16S, *order, borderType=cv2.BORDER_REPLICATE) for order in ((1, 0), (0, 1)))
    strength = np.hypot(dx.astype(np.float32), dy.astype(np.float32))
    high = max(float(np.quantile(strength, 1 - STRONG_SHARE)), LEAST_GRADIENT)
    return np.asarray(cv2.Canny(dx, dy, WEAKER * high, high, L2gradient=True) > 0)


def _chains(edges: Mask) -> Iterator[list[tuple[int, int]]]:
    """Yield chains of adjacent edge pixels, (row, col), each pixel once; chains start at line ends first."""
    left = {(int(row), int(col)) for row, col in np.argwhere(edges)}

    def beside(pixel: tuple[int, int]) -> list[tuple[int, int]]:
        return [at for down, right in BESIDE if (at := (pixel[0] + down, pixel[1] + right)) in left]

    begins = sorted(left, key=lambda pixel: len(beside(pixel)) > 1)
    for begin in begins:
        if begin not in left:
            continue
        chain = [begin]
        left.remove(begin)
        while onward := beside(chain[-1]):
            chain.append(onward[0])
            left.remove(onward[0])
        yield chain
