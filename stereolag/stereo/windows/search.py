"""Search areas, their lags, and the query and result of a window matcher."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, ClassVar, Literal, NamedTuple, Self, TypeAlias

import numpy as np
import numpy.typing as npt
from pydantic import Field

from stereolag.core.arrays import FloatMap
from stereolag.core.inputs import Image
from stereolag.core.settings import KIND, OfThePair, Pixels, Settings, SliderRange
from stereolag.loops.vector_lanes import LANES, lanes_for
from stereolag.stereo.matcher import MinDisparity, NumDisparities


class SearchArea(Settings):
    """Base class of both search areas, which :meth:`centred` and :meth:`rectified` create.

    Examples
    --------
    >>> import stereolag as sl
    >>> sl.SearchArea.rectified(num_disparities=64).lags(window_size=20)  # px, right minus left
    LagRange(dy_first=0, dy_last=0, dx_first=-63, dx_last=0)
    >>> sl.SearchArea.centred(40, vertical=2).lags(window_size=20)
    LagRange(dy_first=-2, dy_last=2, dx_first=-10, dx_last=10)
    """

    title: ClassVar[str] = ""
    """Name on the page."""
    first_shown: ClassVar[tuple[str, ...]] = ()
    """Settings that most users need; if empty, all."""

    @staticmethod
    def centred(search_size: int, *, vertical: int | None = None) -> CentredSearch:
        """Return a square search area of `search_size` px around the window's own position, as in the source report.

        It reaches ``(search_size - window_size) // 2`` px to every side; `vertical` overrides it up and down.
        """
        return CentredSearch(search_size=search_size, vertical=vertical)

    @staticmethod
    def rectified(num_disparities: int, min_disparity: int = 0, vertical: int = 0) -> RectifiedSearch:
        """Return a one-sided strip, as OpenCV searches: disparities `min_disparity` … ``+ num_disparities - 1``."""
        return RectifiedSearch(num_disparities=num_disparities, min_disparity=min_disparity, vertical=vertical)

    def lags(self, window_size: int) -> LagRange:
        """Return the displacements (right minus left, px) tried for a window of `window_size` px.

        Raises
        ------
        ValueError
            The search area has no room for the window.
        """
        raise TypeError("SearchArea is abstract: use SearchArea.centred(...) or SearchArea.rectified(...).")

    def circular(self, window_size: int) -> bool:
        """Return whether the correlation wraps around, as in the source report's unpadded case."""
        return False

    @classmethod
    def reaching(cls, num_disparities: int) -> Self:
        """Return the search area that covers `num_disparities` disparities from 0."""
        raise TypeError("SearchArea is abstract: use SearchArea.centred(...) or SearchArea.rectified(...).")


class CentredSearch(SearchArea):
    """Square around the window's own position, reaching ``(search_size - window_size) // 2`` px to every side."""

    title = "Square"

    kind: Literal["centred"] = "centred"
    search_size: Annotated[int, Pixels(), OfThePair(), SliderRange(high=256)] = Field(
        default=40,
        title="Search area",
        description="Side of the square of the right image in which a window is looked for, px. "
        "If equal to the window (unpadded), the correlation is circular and wraps at half the window.",
        ge=2,
        le=1024,
    )
    vertical: Annotated[int | None, Pixels(), SliderRange(high=256)] = Field(
        default=None,
        title="Vertical reach",
        description="Rows searched above and below, px; none: the same as sideways.",
        ge=0,
        le=256,
    )

    def lags(self, window_size: int) -> LagRange:
        """Return ±(search_size - window_size) // 2 in both directions, or ±window_size / 2, wrapped, if unpadded."""
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
        """Return the square that reaches `num_disparities` px to either side of a window of 32 px."""
        return cls(search_size=2 * num_disparities + 32)


class RectifiedSearch(SearchArea):
    """One-sided strip along the row, as OpenCV searches a rectified pair, with an optional vertical reach."""

    title = "Strip along the row"
    first_shown = ("num_disparities", "min_disparity", "vertical")

    kind: Literal["rectified"] = "rectified"
    num_disparities: NumDisparities = 64
    min_disparity: MinDisparity = 0
    vertical: Annotated[int, Pixels(), SliderRange(high=16)] = Field(
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
        """Return the strip of `num_disparities` disparities."""
        return cls(num_disparities=num_disparities)


AnySearch = Annotated[CentredSearch | RectifiedSearch, Field(discriminator=KIND)]
"""Type of a settings field for a search area."""


MAX_LAGS = 2**16 - 1
"""Largest number of lags whose codes leave enough bits for the score in the same integer."""


@dataclass(frozen=True)
class LagRange:
    """Rectangle of displacements, right minus left, in px; both ends are included.

    Raises
    ------
    ValueError
        An end before its start.
    """

    dy_first: int
    dy_last: int
    dx_first: int
    dx_last: int

    def __post_init__(self) -> None:
        for axis, first, last in (("dy", self.dy_first, self.dy_last), ("dx", self.dx_first, self.dx_last)):
            if last < first:
                raise ValueError(f"The search ends at {axis} = {last}, before its start at {first}.")

    @property
    def rows(self) -> int:
        """Number of vertical displacements."""
        return self.dy_last - self.dy_first + 1

    @property
    def cols(self) -> int:
        """Number of horizontal displacements."""
        return self.dx_last - self.dx_first + 1

    @property
    def count(self) -> int:
        """Number of lags."""
        return self.rows * self.cols

    def within(self, max_dy: int, max_dx: int) -> LagRange | None:
        """Return the part within ±`max_dy` and ±`max_dx`; None if there is none."""
        dy_first, dy_last = max(self.dy_first, -max_dy), min(self.dy_last, max_dy)
        dx_first, dx_last = max(self.dx_first, -max_dx), min(self.dx_last, max_dx)
        is_empty = dy_last < dy_first or dx_last < dx_first
        return None if is_empty else LagRange(dy_first, dy_last, dx_first, dx_last)

    def ranked(self) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """Return (dy, dx) of every lag, in order of preference among equal scores.

        The shortest displacement comes first; ties go to the smaller ``abs(dy)``, then dy, then dx.
        """
        dy, dx = np.mgrid[self.dy_first : self.dy_last + 1, self.dx_first : self.dx_last + 1].reshape(2, -1)
        order = np.lexsort((dx, dy, np.abs(dy), dy**2 + dx**2))
        return dy[order], dx[order]


class LagTable(NamedTuple):
    """Lag range laid out in strips of sixteen neighbours in dx, one row of dy after another, for the compiled loops.

    Each lag has a code, an integer from 1 up: the shorter the displacement, the larger the code. The codes are in the
    low bits of the integers that are compared for the best score, so that one comparison also breaks ties.
    """

    codes: npt.NDArray[np.int32]
    """(strips * 16): the code of each lag; lanes outside the range have the sign bit set, so that they never win."""
    code_mask: int
    """Mask of the bits of the code."""
    right_offset: npt.NDArray[np.int64]
    """(strips): distance in the framed right image from the first lag's pixel to the strip's, in pixels."""
    around: npt.NDArray[np.int32]
    """By code, (codes, 9 | 3): indices in the strips of the 3 × 3 lags around a lag (1 × 3 if there is one dy); for a
    lag outside the range, and for code 0, the index just past the strips."""
    dy: npt.NDArray[np.int16]
    """By code."""
    dx: npt.NDArray[np.int16]
    """By code."""


@lru_cache(maxsize=8)  # creating one takes as long as a finishing stage
def lag_table(lags: LagRange, stride: int, *, wrapped: bool = False) -> LagTable:
    """Return `lags` laid out in strips, for a right image of `stride` pixels per row.

    If the search is `wrapped`, the lags at one end are neighbours of those at the other. Tables are shared, and
    must not be changed.
    """
    width = lanes_for(lags.cols)
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
