"""The lags among which a window is looked for, and the order in which equal scores rank."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from stereolag.kernels.lanes import LANES

MOST_LAGS = 2**16 - 1


@dataclass(frozen=True)
class LagRange:
    """A rectangle of displacements, right minus left, in px; both ends belong to it.

    Raises
    ------
    ValueError
        An end before its beginning.
    """

    dy_first: int
    dy_last: int
    dx_first: int
    dx_last: int

    def __post_init__(self) -> None:
        for axis, first, last in (("dy", self.dy_first, self.dy_last), ("dx", self.dx_first, self.dx_last)):
            if last < first:
                raise ValueError(f"The search ends at {axis} = {last}, before its beginning at {first}.")

    @property
    def rows(self) -> int:
        """How many vertical displacements."""
        return self.dy_last - self.dy_first + 1

    @property
    def cols(self) -> int:
        """How many horizontal displacements."""
        return self.dx_last - self.dx_first + 1

    @property
    def count(self) -> int:
        """How many lags."""
        return self.rows * self.cols

    def within(self, most_dy: int, most_dx: int) -> LagRange | None:
        """Return the part that moves no farther than that, or None if there is none."""
        dy_first, dy_last = max(self.dy_first, -most_dy), min(self.dy_last, most_dy)
        dx_first, dx_last = max(self.dx_first, -most_dx), min(self.dx_last, most_dx)
        if dy_last < dy_first or dx_last < dx_first:
            return None
        return LagRange(dy_first, dy_last, dx_first, dx_last)

    def ranked(self) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """Return (dy, dx) of every lag in the order in which equal scores rank.

        The shortest displacement comes first; of equally short ones the smaller ``abs(dy)``, then the smaller dy,
        then the smaller dx.
        """
        dy, dx = np.mgrid[self.dy_first : self.dy_last + 1, self.dx_first : self.dx_last + 1].reshape(2, -1)
        order = np.lexsort((dx, dy, np.abs(dy), dy**2 + dx**2))
        return dy[order], dx[order]


class LagTable(NamedTuple):
    """A lag range laid out in strips of sixteen neighbours in dx, row of dy after row, for the compiled loops.

    Each lag has a code, an integer from 1 up: the shorter the displacement, the larger the code. The codes stand in
    the low bits of the integers that are compared for the best score, so that one comparison settles score and tie.
    """

    codes: npt.NDArray[np.int32]
    """(strips * 16): the code of each lag; the lanes beyond the range hold the sign bit, and lose."""
    code_mask: int
    """The bits that hold the code."""
    right_offset: npt.NDArray[np.int64]
    """(strips): pixels of the framed right image from the first lag's to the strip's."""
    around: npt.NDArray[np.int32]
    """By code, (codes, 9 | 3): index of the 3 × 3 lags around a lag (1 × 3 where there is one dy) in the strips; the
    index just behind the strips, where no lag is, for a lag that is not in the range, and for code 0."""
    dy: npt.NDArray[np.int16]
    """By code."""
    dx: npt.NDArray[np.int16]
    """By code."""


def lag_table(lags: LagRange, stride: int) -> LagTable:
    """Return `lags` laid out in strips, for a right image of `stride` pixels a row.

    Raises
    ------
    ValueError
        More lags than codes.
    """
    if lags.count > MOST_LAGS:
        raise ValueError(f"The search holds {lags.count} lags; at most {MOST_LAGS} are allowed.")
    width = strips_of(lags) * LANES
    dy, dx = (np.concatenate([[0], lag[::-1]]) for lag in lags.ranked())
    row, col = dy - lags.dy_first, dx - lags.dx_first
    row[0], col[0] = 0, 0
    codes = np.full((lags.rows, width), np.iinfo(np.int32).min, np.int32)
    codes[row[1:], col[1:]] = np.arange(1, lags.count + 1)
    # A border of "no lag" around the range gives every lag its neighbours.
    index = np.full((lags.rows + 2, lags.cols + 2), codes.size, np.int32)
    index[1:-1, 1:-1] = np.arange(codes.size, dtype=np.int32).reshape(codes.shape)[:, : lags.cols]
    up = (-1, 0, 1) if lags.rows > 1 else (0,)
    around = np.stack([index[row + 1 + down, col + 1 + aside] for down in up for aside in (-1, 0, 1)], axis=1)
    around[0] = codes.size
    strip_row, strip_col = np.mgrid[0 : lags.rows, 0:width:LANES].reshape(2, -1)
    return LagTable(
        codes=codes.ravel(),
        code_mask=(1 << int(lags.count).bit_length()) - 1,
        right_offset=strip_row * stride + strip_col,
        around=around,
        dy=dy.astype(np.int16),
        dx=dx.astype(np.int16),
    )


def strips_of(lags: LagRange) -> int:
    """Return how many strips of sixteen hold the horizontal displacements."""
    return -(-lags.cols // LANES)
