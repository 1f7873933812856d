"""What window matching is asked for and what it answers, whichever engine does the work."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatMap = npt.NDArray[np.float32]
LagMap = npt.NDArray[np.int16]


@dataclass(frozen=True)
class WindowMatches:
    """The best match of every window, on the grid of windows (n_rows, n_cols).

    Attributes
    ----------
    dy, dx
        int16 displacement of the best candidate, right minus left, px; 0 where there is none.
    score
        float32 score there; NaN where no candidate exists or the window is flat.
    around
        (3, 3, n_rows, n_cols) float32 scores at dy - 1..dy + 1 and dx - 1..dx + 1, the peak in the middle; NaN where
        that lag is not a candidate. (1, 3, ...) for a search along one row of lags.
    texture
        float32 standard deviation of the left window, in grey levels.
    runner_up
        float32 best score among candidates farther than 1 px (either way) from the peak; None when not asked for.
    right_dx
        int16 best horizontal displacement of every right window that has a candidate, else -32768; None when not
        asked for.
    """

    dy: LagMap
    dx: LagMap
    score: FloatMap
    around: FloatMap
    texture: FloatMap
    runner_up: FloatMap | None = None
    right_dx: LagMap | None = None
