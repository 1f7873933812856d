"""The result of an optical flow."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from stereolag.core.arrays import FloatMap, Mask, ReasonMap
from stereolag.stereo.reasons import Reason

if TYPE_CHECKING:
    from stereolag.core.settings import Settings


@dataclass(frozen=True, eq=False, repr=False)
class FlowMap:
    """Displacements of the pixels of the first frame to the second one.

    Attributes
    ----------
    dy, dx
        (H, W) float32 displacement, second minus first, px; NaN = none. The pixel at (row, col) of the first frame is
        at (row + dy, col + dx) of the second one.
    score
        (H, W) float32 Pearson correlation of the matching window, -1..1; NaN = none.
    reason
        (H, W) uint8, a :class:`~stereolag.stereo.reasons.Reason` for every pixel. LEFT_RIGHT: the way back from the
        second frame leads elsewhere, mostly because the pixel is hidden there. SPECKLE: an outlier among its
        neighbours by the universal median test.
    elapsed_s
        Computation time, s.
    settings
        The :class:`~stereolag.motion.matcher.FlowMatcher` that made it.

    Examples
    --------
    >>> import numpy as np
    >>> import stereolag as sl
    >>> first = np.random.default_rng(0).integers(0, 256, (60, 100), dtype=np.uint8)
    >>> flow = sl.optical_flow(first, np.roll(first, -5, axis=1), search=16)
    >>> flow
    <FlowMap 100 × 60, ...% valid, in ... s>
    >>> flow.dx[30, 2], sl.Reason(flow.reason[30, 2]).name  # px; the pixel has left the frame
    (np.float32(nan), 'OUT_OF_FRAME')
    """

    dy: FloatMap
    dx: FloatMap
    score: FloatMap
    reason: ReasonMap
    elapsed_s: float
    settings: Settings

    def __post_init__(self) -> None:
        for array in (self.dy, self.dx, self.score, self.reason):
            array.flags.writeable = False

    def __repr__(self) -> str:
        rows, cols = self.dx.shape
        return f"<FlowMap {cols} × {rows}, {self.coverage:.1%} valid, in {self.elapsed_s:.3g} s>"

    @property
    def valid(self) -> Mask:
        """Return the mask of pixels with a displacement, measured or filled."""
        return np.isfinite(self.dx)

    @property
    def filled(self) -> Mask:
        """Return the mask of pixels whose displacement was filled in from the surroundings instead of measured."""
        return np.asarray(self.reason == Reason.FILLED)

    @property
    def coverage(self) -> float:
        """Return the share of pixels that have a displacement, 0..1."""
        return float(np.count_nonzero(self.valid) / self.valid.size)
