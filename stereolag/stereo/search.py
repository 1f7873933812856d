"""Search areas: the part of the right image in which a window of the left one is looked for."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from stereolag.kernels.lag_range import LagRange
from stereolag.settings import Settings


class SearchArea(Settings):
    """What both search geometries share; make one with :meth:`centred` or :meth:`rectified`."""

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


class CentredSearch(SearchArea):
    """A square around the window's own place: it reaches ``(search_size - window_size) // 2`` px to every side."""

    kind: Literal["centred"] = "centred"
    search_size: int = Field(
        default=40,
        title="Search area",
        description="Side of the square of the right image in which a window is looked for, px. "
        "Equal to the window (unpadded) the correlation is circular and wraps at half the window.",
        ge=2,
        le=1024,
    )
    vertical: int | None = Field(
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
            first, last = -(window_size // 2), (window_size - 1) // 2
            return LagRange(first, last, first, last)
        reach = (self.search_size - window_size) // 2
        vertical = reach if self.vertical is None else self.vertical
        return LagRange(-vertical, vertical, -reach, reach)

    def circular(self, window_size: int) -> bool:
        """Return whether the search area is the window itself."""
        return self.search_size == window_size


class RectifiedSearch(SearchArea):
    """A one-sided strip along the row, as OpenCV searches a rectified pair, with an optional vertical reach."""

    kind: Literal["rectified"] = "rectified"
    num_disparities: int = Field(
        default=64,
        title="Disparities searched",
        description="How many disparities are tried, px (OpenCV's numDisparities).",
        ge=1,
        le=1024,
        json_schema_extra={"step": 16},
    )
    min_disparity: int = Field(
        default=0,
        title="Smallest disparity",
        description="The first disparity tried, px (OpenCV's minDisparity).",
        ge=-512,
        le=512,
    )
    vertical: int = Field(
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


AnySearch = Annotated[CentredSearch | RectifiedSearch, Field(discriminator="kind")]
"""The type of a settings field that holds a search area."""
