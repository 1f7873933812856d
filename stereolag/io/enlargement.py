"""The map of a downscaled pair, enlarged to the pair's own size."""

from __future__ import annotations

import cv2
import numpy as np

from stereolag.core.arrays import FloatMap
from stereolag.stereo.matcher import DisparityMap, StereoMatcher


def enlarged(result: DisparityMap, rows: int, cols: int, settings: StereoMatcher) -> DisparityMap:
    """Return a map for images of (rows, cols): every pixel has the disparity of the nearest one, in px of that size.

    Nothing is interpolated, since the mean of a near and a far disparity belongs to neither surface. This makes the
    measurement no more exact: an error of 1 px in the smaller images is one of `cols` / width px here.

    Parameters
    ----------
    result
        A map of the pair at a smaller size.
    rows, cols
        The size of the pair.
    settings
        The settings of `result` for images of that size (:func:`stereolag.core.settings.scaled_settings`).

    Raises
    ------
    ValueError
        A size smaller than the map's.
    """
    height, width = result.disparity.shape
    if rows < height or cols < width:
        raise ValueError(f"The map is {width} × {height} pixels; enlarged, it cannot have {cols} × {rows}.")

    def larger(array: FloatMap, factor: float) -> FloatMap:
        values = cv2.resize(array, (cols, rows), interpolation=cv2.INTER_NEAREST_EXACT)
        return np.asarray(values * np.float32(factor), dtype=np.float32)

    has_score, has_dy = np.isfinite(result.score).any(), np.nan_to_num(result.dy).any()
    return DisparityMap(
        larger(result.disparity, cols / width),
        np.asarray(cv2.resize(result.reason, (cols, rows), interpolation=cv2.INTER_NEAREST_EXACT)),
        larger(result.score, 1) if has_score else None,
        larger(result.dy, rows / height) if has_dy else None,
        result.elapsed_s,
        settings,
    )
