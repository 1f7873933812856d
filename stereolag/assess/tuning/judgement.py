"""Comparison of a map with a reference, and the certainty that one map is better than another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import FloatMap, Mask

BAD_PX = 2.0
"""A disparity that is off by more than this is bad."""

BY_CHANCE = 2.5
"""Gain in standard errors that chance may produce. Of two dozen equal settings, the luckiest is about two standard
errors above the rest (the expected maximum of 24 normal deviates is 1.95)."""

BLOCKS = 8
"""Number of blocks along each side of a map in which it is judged."""


@dataclass(frozen=True, eq=False)
class Judgement:
    """The result of comparing a map with a reference.

    Attributes
    ----------
    wrong, judged
        (64,) pixel counts per block of the images: those off by more than 2 px or missing, and those judged.
    dense
        Whether the map has a disparity at every pixel.
    """

    wrong: npt.NDArray[np.float64]
    judged: npt.NDArray[np.float64]
    dense: bool

    @classmethod
    def of(cls, disparity: FloatMap, reference: FloatMap) -> Judgement:
        """Judge a map against a reference, (H, W) px, NaN = not judged.

        Raises
        ------
        ValueError
            If the shapes differ.
        """
        if disparity.shape != reference.shape:
            raise ValueError(
                f"disparity has shape {disparity.shape} and reference {reference.shape}; both must be the same (H, W)."
            )
        known = np.isfinite(reference)
        wrong = known & ~(np.abs(disparity - reference) <= BAD_PX)
        rows, cols = (np.arange(side) * BLOCKS // side for side in known.shape)

        def counted(mask: Mask) -> npt.NDArray[np.float64]:
            by_rows = np.add.reduceat(mask, np.searchsorted(rows, np.unique(rows)), axis=0, dtype=np.int64)
            by_both = np.add.reduceat(by_rows, np.searchsorted(cols, np.unique(cols)), axis=1)
            return by_both.ravel().astype(np.float64)

        return cls(counted(wrong), counted(known), bool(np.isfinite(disparity).all()))

    @property
    def bad(self) -> float:
        """Return the percentage of judged pixels that are wrong, lower is better; NaN if none is judged."""
        judged = self.judged.sum()
        return float(100 * self.wrong.sum() / judged) if judged else float("nan")


@dataclass(frozen=True)
class Gain:
    """The improvement in bad-2 of settings over others, in percentage points, and its standard error."""

    points: float
    error: float

    @property
    def sure(self) -> float:
        """Return the gain minus the part that may be due to chance."""
        return self.points - BY_CHANCE * self.error

    @classmethod
    def between(cls, before: Sequence[Judgement], after: Sequence[Judgement]) -> Gain:
        """Return the mean gain over pairs, each judged before and after.

        The standard error is that of a ratio estimate over the blocks of each pair (W. Cochran, *Sampling Techniques*,
        1977, 6.8): a gain from a single corner or border of the images may be chance or a border effect.
        """
        parts = [cls._of_one(*both) for both in zip(before, after, strict=True)]
        return cls(
            sum(part.points for part in parts) / len(parts), sum(part.error**2 for part in parts) ** 0.5 / len(parts)
        )

    @classmethod
    def _of_one(cls, before: Judgement, after: Judgement) -> Gain:
        judged, righted = before.judged, before.wrong - after.wrong
        share, blocks = righted.sum() / judged.sum(), np.count_nonzero(judged)
        if blocks < 2:
            return cls(float(100 * share), float("inf"))
        variance = ((righted - share * judged) ** 2).sum() * blocks / (blocks - 1)
        return cls(float(100 * share), float(100 * np.sqrt(variance) / judged.sum()))
