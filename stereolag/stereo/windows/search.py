"""Search areas: the part of the right image in which a window of the left one is looked for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal, NamedTuple, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field

from stereolag.loops.vector_lanes import LANES
from stereolag.settings import OfThePair, Pixels, Settings, Usual
from stereolag.stereo.matcher import MinDisparity, NumDisparities

ROOM_FOR_WINDOW = 32


class SearchArea(Settings):
    """What both search geometries share; make one with :meth:`centred` or :meth:`rectified`.

    Examples
    --------
    >>> import stereolag as sl
    >>> sl.SearchArea.rectified(num_disparities=64).lags(window_size=20)  # px, right minus left
    LagRange(dy_first=0, dy_last=0, dx_first=-63, dx_last=0)
    >>> sl.SearchArea.centred(40, vertical=2).lags(window_size=20)
    LagRange(dy_first=-2, dy_last=2, dx_first=-10, dx_last=10)
    """

    title: ClassVar[str] = ""
    """What the page calls it."""
    first_shown: ClassVar[tuple[str, ...]] = ()
    """The settings that most visitors want; none given: all."""

    @staticmethod
    def centred(search_size: int, *, vertical: int | None = None) -> CentredSearch:
        """Return a square search area of `search_size` px around the window's own place, as in the report.

        It reaches ``(search_size - window_size) // 2`` px to every side; `vertical` gives the rows their own reach.
        """
        return CentredSearch(search_size=search_size, vertical=vertical)

    @staticmethod
    def rectified(num_disparities: int, min_disparity: int = 0, vertical: int = 0) -> RectifiedSearch:
        """Return a one-sided strip, as OpenCV searches: disparities `min_disparity` … ``+ num_disparities - 1``."""
        return RectifiedSearch(num_disparities=num_disparities, min_disparity=min_disparity, vertical=vertical)

    def lags(self, window_size: int) -> LagRange:
        """Return the displacements (right minus left, px) at which a window of `window_size` px is tried.

        Raises
        ------
        ValueError
            The search area has no room for the window.
        """
        raise TypeError("SearchArea is abstract: use SearchArea.centred(...) or SearchArea.rectified(...).")

    def circular(self, window_size: int) -> bool:
        """Return whether the correlation wraps around: the report's unpadded case, without room for a linear match."""
        return False

    @classmethod
    def reaching(cls, num_disparities: int) -> Self:
        """Return the search area that holds so many disparities from 0."""
        raise TypeError("SearchArea is abstract: use SearchArea.centred(...) or SearchArea.rectified(...).")


class CentredSearch(SearchArea):
    """A square around the window's own place: it reaches ``(search_size - window_size) // 2`` px to every side."""

    title = "Square"

    kind: Literal["centred"] = "centred"
    search_size: Annotated[int, Pixels(), OfThePair(), Usual(high=256)] = Field(
        default=40,
        title="Search area",
        description="Side of the square of the right image in which a window is looked for, px. "
        "Equal to the window (unpadded) the correlation is circular and wraps at half the window.",
        ge=2,
        le=1024,
    )
    vertical: Annotated[int | None, Pixels(), Usual(high=256)] = Field(
        default=None,
        title="Vertical reach",
        description="Rows searched above and below, px; none means as far as sideways.",
        ge=0,
        le=256,
    )

    def lags(self, window_size: int) -> LagRange:
        """Return ±(search_size - window_size) // 2 both ways, or ±window_size / 2, wrapped, when unpadded."""
        if self.search_size < window_size:
            raise ValueError(
                f"search_size is {self.search_size} px and window_size {window_size} px; "
                "the search area must be at least as large as the window."
            )
        if self.circular(window_size):
            if self.vertical is not None:
                raise ValueError(
                    f"search.vertical is {self.vertical} px and an unpadded search (search_size = window_size) wraps "
                    "both ways: leave it out, or give a larger search_size."
                )
            first, last = -(window_size // 2), (window_size - 1) // 2
            return LagRange(first, last, first, last)
        reach = (self.search_size - window_size) // 2
        vertical = reach if self.vertical is None else self.vertical
        return LagRange(-vertical, vertical, -reach, reach)

    def circular(self, window_size: int) -> bool:
        """Return whether the search area is the window itself."""
        return self.search_size == window_size

    @classmethod
    def reaching(cls, num_disparities: int) -> Self:
        """Return the square that reaches so many disparities to either side of a window of 32 px."""
        return cls(search_size=2 * num_disparities + ROOM_FOR_WINDOW)


class RectifiedSearch(SearchArea):
    """A one-sided strip along the row, as OpenCV searches a rectified pair, with an optional vertical reach."""

    title = "Strip along the row"
    first_shown = ("num_disparities", "min_disparity", "vertical")

    kind: Literal["rectified"] = "rectified"
    num_disparities: NumDisparities = 64
    min_disparity: MinDisparity = 0
    vertical: Annotated[int, Pixels(), Usual(high=16)] = Field(
        default=0,
        title="Vertical reach",
        description="Rows searched above and below, px, for pairs that are not quite rectified.",
        ge=0,
        le=64,
    )

    def lags(self, window_size: int) -> LagRange:
        """Return dx = -(min_disparity + num_disparities - 1) … -min_disparity and dy = ±vertical."""
        farthest = self.min_disparity + self.num_disparities - 1
        return LagRange(-self.vertical, self.vertical, -farthest, -self.min_disparity)

    @classmethod
    def reaching(cls, num_disparities: int) -> Self:
        """Return the strip of so many disparities."""
        return cls(num_disparities=num_disparities)


AnySearch = Annotated[CentredSearch | RectifiedSearch, Field(discriminator="kind")]
"""The type of a settings field that holds a search area."""


MOST_LAGS = 2**16 - 1
"""Of more, the codes would leave too few bits for the score that they share an integer with."""


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


def lag_table(lags: LagRange, stride: int, *, wrapped: bool = False) -> LagTable:
    """Return `lags` laid out in strips, for a right image of `stride` pixels a row.

    The neighbours of the lags at one end are those at the other if the search is `wrapped`.
    """
    width = strips_of(lags) * LANES
    dy, dx = (np.concatenate([[0], lag[::-1]]) for lag in lags.ranked())
    row, col = dy - lags.dy_first, dx - lags.dx_first
    row[0], col[0] = 0, 0
    codes = np.full((lags.rows, width), np.iinfo(np.int32).min, np.int32)
    codes[row[1:], col[1:]] = np.arange(1, lags.count + 1)
    places = np.arange(codes.size, dtype=np.int32).reshape(codes.shape)[:, : lags.cols]
    # A border of "no lag" around the range gives every lag its neighbours.
    index = np.pad(places, 1, mode="wrap") if wrapped else np.pad(places, 1, constant_values=codes.size)
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
