"""What a stereo matcher will take, from the maps and volumes that each of its stages holds.

Bytes are counted for each pixel, or each window, of the stage that holds most of them.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from stereolag.estimates import OVERHEAD, Estimate, kept_blocks, largest_fitting
from stereolag.kernels.lag_range import LagRange
from stereolag.kernels.window_fft import BATCH_BYTES
from stereolag.stereo.engines import Engine, Score, predicted_seconds
from stereolag.stereo.semi_global import BYTES_OF_A_CELL, MOST_BYTES, OVERLAP

Shape = tuple[int, ...]

ANSWER = 17
"""A pixel of the map: disparity, dy, dx, score and reason."""

FINISHING = 48
"""A pixel while the map is filtered and filled: the maps before and after, their reasons, and what OpenCV takes."""

WINDOW_CHECKS = 24
"""A window while the left-right check compares the two directions."""

FOUND = 20
"""A pixel of what the volume says: the cheapest lag, the costs around it, the runner-up and the right view's lag."""

VALLEY = 50
"""A pixel while the valley between the lags is fitted."""

FEATURES = 66
"""A pixel while the features of both images are made."""

SURFACES = 72
"""A pixel while the batched FFT sums the windows of the images: float64 images, frames and summed-area tables."""

BYTES_OF_A_POINT = 32
"""What the batched FFT reckons for each point of a search area."""

PIXEL_SECONDS = 1.2e-7
"""Seconds a pixel, for the checks, filters and maps."""

SLOWER_WHOLE, SLOWER_DOUBLE, SLOWER_FFT, SLOWER_WHITENED = 3, 8, 1.5, 5
"""How many times as long as predicted a whole match takes: by sums of uint8 and of float64, by FFT, and whitened."""

VOLUME_SECONDS = 3e-9
"""Seconds a cell of the volume: its cost, eight paths and its part in the selection."""

DISPARITY_STEP, MOST_DISPARITIES = 16, 1024
"""Numbers of disparities that a refusal names are multiples of the one, up to the other."""


def estimate_windows(
    shape: Shape,
    dtype: npt.DTypeLike,
    *,
    window_size: int,
    step: int,
    lags: LagRange,
    engine: Engine,
    score: Score,
    circular: bool,
    both_views: bool,
    finished: bool,
) -> Estimate:
    """Return what matching window by window will take.

    Parameters
    ----------
    shape, dtype
        Of one image: (rows, cols) or (rows, cols, channels).
    window_size, step, lags, engine, score, circular
        As :func:`stereolag.stereo.windows.match_by_windows` takes them.
    both_views
        Whether the best left window of every right one is looked for too.
    finished
        Whether the map is filtered or filled.
    """
    (height, width), pixels = shape[:2], shape[0] * shape[1]
    rows, cols = (max(1, (side - window_size) // step + 1) for side in (height, width))
    windows = rows * cols
    # The scores at and around the peak, the lag, the texture, the runner-up and the offset between two lags.
    kept = (4 * 9 + 4 if lags.rows > 1 else 4 * 3 + 2) + 4 + 4 + 8 + 2 * both_views
    images = _as_grey(shape, dtype)
    whole = np.dtype(dtype) == np.uint8
    if engine == "fft":
        slower = SLOWER_WHITENED if score == "phase" else SLOWER_FFT
        area = (window_size + lags.rows) * (window_size + lags.cols)
        batch = min(BATCH_BYTES, BYTES_OF_A_POINT * area * windows)
        framed = (height + lags.rows) * (width + lags.cols)
        matching = max(SURFACES * framed, 32 * framed + 4 * batch + kept * windows)
        if circular:  # no frame, and no sums: both images in float64, and one on its way
            matching = 24 * pixels + 2 * batch + kept * windows
    else:
        slower = SLOWER_WHOLE if whole else SLOWER_DOUBLE
        margin = (height + lags.rows) * (width + lags.cols + 32)
        # Pixels of other types are compared as float64, once as they are and once framed, and one more on its way.
        matching = 2 * margin if whole else 8 * (4 * pixels + margin)
        matching += (kept + 4 * both_views) * windows + 2 * 12 * (lags.rows + step) * (width + lags.cols)
    stages = [
        matching,
        kept * windows + WINDOW_CHECKS * windows * both_views,
        (kept + 2) * windows + ANSWER * pixels,
        FINISHING * pixels * finished,
    ]
    seconds = PIXEL_SECONDS * pixels + slower * predicted_seconds((height, width), window_size, step, lags, engine)
    return Estimate(images + max(stages) + kept_blocks(4 * pixels, 3) + OVERHEAD, seconds)


def estimate_volume(shape: Shape, dtype: npt.DTypeLike, *, num_disparities: int) -> Estimate:
    """Return what matching by semi-global optimisation will take, in strips of rows where its volume is large.

    Parameters
    ----------
    shape, dtype
        Of one image: (rows, cols) or (rows, cols, channels).
    num_disparities
        How many are tried, px.
    """
    (height, width), pixels = shape[:2], shape[0] * shape[1]
    bytes_of_a_row = width * num_disparities * BYTES_OF_A_CELL
    own = height if height * bytes_of_a_row <= MOST_BYTES else max(1, MOST_BYTES // bytes_of_a_row - 2 * OVERLAP)
    strip = min(height, own + 2 * OVERLAP)
    # What a strip found stays until all are joined, with the rows that it shares with its neighbours.
    found = FOUND * pixels * min(strip, height) // min(own, height)
    fronts = 24 * (width + 2) * (num_disparities + 2)
    in_strip = strip * max(bytes_of_a_row, FEATURES * (width + num_disparities) + width * num_disparities)
    stages = [
        found + fronts + in_strip,
        found + (FOUND + VALLEY) * pixels,
        (2 * FOUND + FINISHING) * pixels,
    ]
    cells = pixels * num_disparities * strip / own
    seconds = 3 * PIXEL_SECONDS * pixels + VOLUME_SECONDS * cells
    return Estimate(_as_grey(shape, dtype) + max(stages) + kept_blocks(4 * pixels, 3) + OVERHEAD, seconds)


def estimate_opencv(
    shape: Shape, dtype: npt.DTypeLike, *, num_disparities: int, bytes_of_a_cost: int, rows: int, seconds: float
) -> Estimate:
    """Return what one of OpenCV's matchers will take.

    Parameters
    ----------
    shape, dtype
        Of one image: (rows, cols) or (rows, cols, channels).
    num_disparities
        How many are tried, px.
    bytes_of_a_cost, rows
        What it keeps for each column and disparity, and of how many rows.
    seconds
        It takes for each pixel and disparity.
    """
    pixels = shape[0] * shape[1]
    grey = _as_grey(shape, dtype)
    # Other types are stretched to 8 bits in float64, which is gone before the maps are made.
    stretched = 0 if np.dtype(dtype) == np.uint8 else 20 * pixels
    costs = rows * shape[1] * num_disparities * bytes_of_a_cost
    maps = max(stretched, 4 * pixels + costs, (ANSWER + 3) * pixels)
    return Estimate(
        grey + maps + kept_blocks(4 * pixels, 2) + OVERHEAD,
        PIXEL_SECONDS / 2 * pixels + seconds * pixels * num_disparities,
    )


def fitting_pair(
    allowed: int,
    *,
    shape: Shape,
    of_shape: Callable[[Shape], Estimate],
    of_disparities: Callable[[int], Estimate] | None,
) -> str:
    """Return a sentence that names what share of the size, or how many disparities, would fit."""

    def of_percent(percent: int) -> Estimate:
        return of_shape((*(max(1, side * percent // 100) for side in shape[:2]), *shape[2:]))

    percent = largest_fitting(of_percent, 100, allowed)
    size = "Half" if percent == 50 else f"{percent} % of"
    fitting = [f"{size} the width and height"] if percent else []
    if of_disparities is not None:
        of_count = of_disparities
        count = DISPARITY_STEP * largest_fitting(
            lambda steps: of_count(DISPARITY_STEP * steps), MOST_DISPARITIES // DISPARITY_STEP, allowed
        )
        fitting += [f"{count} disparities"] if count else []
    if len(fitting) == 1:
        return f"{fitting[0]} would fit."
    return f"{', or '.join(fitting)}, would fit." if fitting else "Less than 1 % of the width and height would fit."


def _as_grey(shape: Shape, dtype: npt.DTypeLike) -> int:
    """Return the bytes of both images as grey, and of one's colours in one piece where they lie beside an alpha."""
    if len(shape) == 2:
        return 0
    pixel = np.dtype(dtype).itemsize
    return shape[0] * shape[1] * pixel * (2 + 3 * (shape[2] == 4))
