"""Memory and time of matching window by window."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from stereolag.estimates import OVERHEAD, Estimate, kept_blocks
from stereolag.stereo.estimates import ANSWER, FINISHING, PIXEL_SECONDS, Shape, grey_bytes
from stereolag.stereo.windows.engines import Engine, predicted_seconds
from stereolag.stereo.windows.matches import Score
from stereolag.stereo.windows.search import LagRange
from stereolag.stereo.windows.window_fft import BATCH_BYTES

WINDOW_CHECKS = 24
"""Bytes of a window while the left-right check compares the two directions."""

BYTES_OF_A_POINT = 32
"""What the batched FFT reckons for each point of a search area."""

SLOWER_WHOLE, SLOWER_DOUBLE, SLOWER_FFT, SLOWER_WHITENED = 3, 8, 1.5, 5
"""How many times as long as predicted a whole match takes: by sums of uint8 and of float64, by FFT, and whitened."""


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
        As :class:`stereolag.stereo.windows.matches.WindowQuery` holds them.
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
    images = grey_bytes(shape, dtype)
    whole = np.dtype(dtype) == np.uint8
    margin = (height + lags.rows) * (width + lags.cols + 32)
    # Pixels of other types are compared as float64, once as they are and once framed, and one more on its way.
    matching = 2 * margin if whole else 8 * (4 * pixels + margin)
    if engine == "fft":
        slower = SLOWER_WHITENED if score == "phase" else SLOWER_FFT
        area = window_size**2 if circular else (window_size + lags.rows) * (window_size + lags.cols)
        matching += min(BATCH_BYTES, BYTES_OF_A_POINT * area * windows) * 5 // 4 + kept * windows
        if score == "phase":
            matching += 8 * (pixels + margin)
    else:
        slower = SLOWER_WHOLE if whole else SLOWER_DOUBLE
        matching += (kept + 4 * both_views) * windows + 2 * 12 * (lags.rows + step) * (width + lags.cols)
    stages = [
        matching,
        kept * windows + WINDOW_CHECKS * windows * both_views,
        (kept + 2) * windows + ANSWER * pixels,
        FINISHING * pixels * finished,
    ]
    seconds = PIXEL_SECONDS * pixels + slower * predicted_seconds((height, width), window_size, step, lags, engine)
    return Estimate(images + max(stages) + kept_blocks(4 * pixels, 3) + OVERHEAD, seconds)
