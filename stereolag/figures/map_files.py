"""Coloured files of a disparity map: the map with its legend, and its point cloud."""

from __future__ import annotations

from stereolag.core.arrays import FloatMap, Rgb
from stereolag.core.inputs import Image
from stereolag.figures.pictures import VIRIDIS, as_rgb, coloured
from stereolag.figures.printed_legend import with_legend
from stereolag.geometry.calibration import Calibration
from stereolag.geometry.scene import clean_point_cloud
from stereolag.io.disparities import image_png, ply

LEGEND = "disparity, px: from far to near"
MOST_POINTS = 2_000_000


def coloured_png(disparity: FloatMap, low: float, high: float, palette: Rgb = VIRIDIS) -> bytes:
    """Return a coloured disparity map above its legend, as a PNG.

    Parameters
    ----------
    disparity
        (rows, cols) px, NaN = none.
    low, high
        Disparities at the first and the last colour, px, ``low < high``.
    palette
        (256, 3) uint8 RGB, from far to near.
    """
    return image_png(with_legend(coloured(disparity, low, high, palette), low, high, palette, LEGEND))


def cloud_ply(calibration: Calibration, disparity: FloatMap, left: Image) -> bytes:
    """Return the points of a disparity map in metres and in the colours of the left image, as a binary PLY.

    Flying pixels are left out; above 2 million points a uniform random sample is kept, the same every time.
    """
    return ply(*clean_point_cloud(calibration, disparity, as_rgb(left), max_points=MOST_POINTS))
