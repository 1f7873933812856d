"""Clouds of dust, which dull the picture beneath them and add grain."""

import numpy as np
from numpy.typing import NDArray

from .palette import Colour, Rng

DULLING = 0.52
GRAIN = 17.0


def raise_dust(
    pixels: NDArray[np.uint8], row: float, col: float, radius: float, dust: Colour, rng: Rng
) -> NDArray[np.uint8]:
    """Blend a round cloud of dust into an RGB picture: thick to three quarters of its radius, then thinning out."""
    vertical, horizontal = window = _window(pixels, row, col, radius)
    rows, cols = np.ogrid[vertical, horizontal]
    distance = np.hypot(rows - row, cols - col) / radius
    thickness = np.clip((1 - distance) / 0.25, 0, 1)[..., None]
    clear = pixels[window].astype(float)
    grain = rng.normal(0, GRAIN, clear.shape)
    hazy = clear + thickness * (DULLING * (np.array(dust) - clear) + grain)
    result = pixels.copy()
    result[window] = np.clip(np.rint(hazy), 0, 255)
    return result


def _window(pixels: NDArray[np.uint8], row: float, col: float, radius: float) -> tuple[slice, slice]:
    height, width = pixels.shape[:2]
    vertical = slice(max(int(row - radius), 0), min(int(row + radius) + 1, height))
    return vertical, slice(max(int(col - radius), 0), min(int(col + radius) + 1, width))
