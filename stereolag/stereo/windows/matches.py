"""Query and result of a window matcher: one record for each, whichever engine does the work."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import FloatMap
from stereolag.core.inputs import Image
from stereolag.stereo.windows.search import LagRange

Score: TypeAlias = Literal["zncc", "ncc", "cross", "phase"]
LagMap: TypeAlias = npt.NDArray[np.int16]


@dataclass(frozen=True, eq=False)
class WindowQuery:
    """Query of a window matcher: the windows, their search area, and how they are compared.

    Attributes
    ----------
    left, right
        (H, W) grey images of one type.
    window_size, step
        Side of the square windows and distance between them, px.
    lags
        The displacements to try, right minus left, px. The right window must lie wholly inside the right image.
    score
        "zncc": Pearson's correlation. "ncc": the same without removing the means, equation 1.3 of the source report.
        "cross": the sum of products of the mean-free windows. "phase": the whitened cross-power spectrum (Kuglin &
        Hines 1975).
    circular
        Correlate a window with the *same* place in the right image, wrapped around (the source report's unpadded case).
    runner_up
        Whether to also find the best score more than 1 px from the peak.
    right_matches
        Whether to also find the best left window of every right window.
    """

    left: Image
    right: Image
    window_size: int
    step: int
    lags: LagRange
    score: Score = "zncc"
    circular: bool = False
    runner_up: bool = False
    right_matches: bool = False

    @property
    def grid(self) -> tuple[int, int]:
        """Return the number of rows and columns of windows."""
        rows, cols = ((side - self.window_size) // self.step + 1 for side in self.left.shape)
        return rows, cols


@dataclass(frozen=True, eq=False)
class WindowMatches:
    """Best match of every window, on the grid of windows (n_rows, n_cols).

    Attributes
    ----------
    dy, dx
        int16 displacement of the best candidate, right minus left, px; 0 where there is none.
    score
        float32 score of that candidate; NaN where no candidate exists or the window is flat.
    around
        (3, 3, n_rows, n_cols) float32 scores at dy - 1..dy + 1 and dx - 1..dx + 1, the peak in the middle; NaN where
        that lag is not a candidate. (1, 3, ...) for a search along one row of lags.
    texture
        float32 standard deviation of the left window, in grey levels.
    runner_up
        float32 best score among candidates more than 1 px (in either direction) from the peak; None if not requested.
    right_dx
        int16 best horizontal displacement of every right window that has a candidate, else -32768; None if not
        requested.
    """

    dy: LagMap
    dx: LagMap
    score: FloatMap
    around: FloatMap
    texture: FloatMap
    runner_up: FloatMap | None = None
    right_dx: LagMap | None = None
