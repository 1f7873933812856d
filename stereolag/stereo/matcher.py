"""The interface of every stereo matcher: immutable, self-describing settings, one ``compute``, and its result."""

from __future__ import annotations

import os
import time
from abc import abstractmethod
from contextlib import nullcontext
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Annotated, Any, ClassVar, NamedTuple, Self

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import Field

from stereolag.core.arrays import FloatMap, Mask, ReasonMap
from stereolag.core.inputs import Image, as_stereo_pair, in_eight_bits, transparent, with_border_transparent
from stereolag.core.jobs import COSTS, Estimate, Progress, check_memory, silent
from stereolag.core.settings import OfThePair, Pixels, Settings, SliderRange, changed, multiple_of
from stereolag.core.showing import Shown
from stereolag.loops.compilation import compiling_beside
from stereolag.loops.memory import keep_freed_memory


class Reason(IntEnum):
    """The reason why a pixel is blank, or the origin of its disparity.

    Examples
    --------
    >>> import numpy as np
    >>> import stereolag as sl
    >>> left = np.random.default_rng(0).integers(0, 256, (60, 100), dtype=np.uint8)
    >>> right = np.roll(left, -5, axis=1)  # disparity 5 px
    >>> result = sl.SemiGlobalMatcher(num_disparities=16).compute(left, right)
    >>> sl.Reason(result.reason[30, 50]).name, sl.Reason(result.reason[30, 2]).name
    ('MEASURED', 'OUT_OF_FRAME')
    """

    MEASURED = 0
    FILLED = 1
    OUT_OF_FRAME = 2
    LOW_TEXTURE = 3
    AMBIGUOUS = 4
    LEFT_RIGHT = 5
    SPECKLE = 6
    AT_SEARCH_EDGE = 7


MAX_ABS_MIN_DISPARITY = 512
"""Largest magnitude of the first disparity in all methods, px."""

MAX_NUM_DISPARITIES = 1024
"""Largest number of disparities in all methods."""

NumDisparities = Annotated[
    int,
    Pixels(rounded_up=True),
    OfThePair(),
    SliderRange(high=256),
    Field(
        title="Disparities searched",
        description="How many disparities are tried, px (OpenCV's numDisparities).",
        ge=1,
        le=MAX_NUM_DISPARITIES,
        json_schema_extra={"step": 16},
    ),
]
MinDisparity = Annotated[
    int,
    Pixels(),
    OfThePair(),
    SliderRange(-64, 64),
    Field(
        title="Smallest disparity",
        description="The first disparity tried, px (OpenCV's minDisparity).",
        ge=-MAX_ABS_MIN_DISPARITY,
        le=MAX_ABS_MIN_DISPARITY,
    ),
]


class PixelMatches(NamedTuple):
    """Result of a matcher: (H, W) maps in the frame of the left image."""

    disparity: FloatMap
    """px; NaN = none."""
    reason: ReasonMap
    """:class:`~stereolag.stereo.matcher.Reason` of every pixel."""
    score: FloatMap | None = None
    """Higher is more certain; None if the method has no score."""
    dy: FloatMap | None = None
    """Vertical displacement, right minus left, px; None if the search runs along the row only, so that it is 0."""


class StereoMatcher(Settings):
    """Base class of every stereo method: a subclass defines its settings, its description and :meth:`match`.

    Listing a method in :data:`stereolag.stereo.methods.METHODS` makes it available everywhere: on the page and in
    addresses, sweeps, settings files and tables.
    """

    title: ClassVar[str] = ""
    """Heading on the page; defaults to the class name."""
    short_name: ClassVar[str] = ""
    """Name in an address; defaults to the class name in lower case."""
    first_shown: ClassVar[tuple[str, ...]] = ()
    """Settings that most users need; all others are folded away below them. If empty, all are shown."""
    gives_reasons: ClassVar[bool] = True
    """Whether the reasons in its maps say why a pixel is blank."""
    is_compiled: ClassVar[bool] = False
    """Whether it matches and completes its maps by compiled loops."""

    @classmethod
    def other_name(cls, name: str) -> str:
        """Return the name of a setting in other programs, shown beside its title; "" if it has none."""
        return ""

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        if "title" not in vars(cls):
            cls.title = cls.__name__
        if "short_name" not in vars(cls):
            cls.short_name = cls.__name__.lower()

    def compute(self, left: npt.ArrayLike, right: npt.ArrayLike, *, progress: Progress | None = None) -> DisparityMap:
        """Match two images and return the disparity of every pixel of the left one.

        Parameters
        ----------
        left, right
            (H, W), (H, W, 3) or (H, W, 4) images of one size and type: uint8, uint16 or float. Nothing is measured
            where alpha is 0, or in a black border as left by rectification.
        progress
            Called with the fraction done, 0..1.

        Returns
        -------
        DisparityMap
            Disparity and displacement in px, NaN where the pixel is blank, with a reason for every pixel.

        Raises
        ------
        ValueError
            Images that differ in size or type, contain NaN, are smaller than the method needs, or need more memory than
            one job may take (:meth:`estimate`).
        """
        for name, image in (("left", left), ("right", right)):
            if isinstance(image, str | bytes | os.PathLike):
                raise ValueError(f"{name} is a {type(image).__name__}; give an array, such as sl.read_image({name}).")
        left_image, right_image = as_stereo_pair(left, right)
        check_memory(self.estimate(left_image.shape, left_image.dtype))
        keep_freed_memory()
        start = time.perf_counter()
        left_image, right_image = with_border_transparent(left_image), with_border_transparent(right_image)
        images = in_eight_bits(left_image, right_image)
        later_stages = "stereolag.stereo.compiling", self, images[0].shape, images[0].dtype.str
        with compiling_beside(*later_stages) if self.is_compiled else nullcontext():
            found = self.match(*images, progress or silent)
        found = without_outside(found, left_image)
        return DisparityMap(*found, elapsed_s=time.perf_counter() - start, settings=self)

    @abstractmethod
    def match(self, left: Image, right: Image, progress: Progress) -> PixelMatches:
        """Match two checked images; called by :meth:`compute`, which does the checking and timing."""

    def estimate(self, shape: tuple[int, ...], dtype: npt.DTypeLike = np.uint8) -> Estimate:
        """Return the memory and time of :meth:`compute` for images of a shape (rows, cols[, channels]) and dtype.

        A method that needs memory beyond its maps overrides this.
        """
        return COSTS["stereo"].estimate(pixels=shape[0] * shape[1])

    def search_range(self) -> tuple[int, int] | None:
        """Return the first disparity searched and the number of disparities, px; None for an unlimited search."""
        if not {"min_disparity", "num_disparities"} <= set(type(self).model_fields):
            return None
        values = dict(self)
        return values["min_disparity"], values["num_disparities"]

    def reach(self) -> tuple[int, int] | None:
        """Return the first disparity a map can contain and how many, px; not the search range if that wraps."""
        return self.search_range()

    def with_search_range(self, min_disparity: int, num_disparities: int) -> Self:
        """Return the matcher with another range, as far as the method allows it; itself if it has no range.

        Parameters
        ----------
        min_disparity
            The first disparity, px.
        num_disparities
            Number of disparities; rounded up to the multiple that the method needs.
        """
        if self.search_range() is None:
            return self
        multiple = multiple_of(type(self).model_fields["num_disparities"])
        first = min(max(min_disparity, -MAX_ABS_MIN_DISPARITY), MAX_ABS_MIN_DISPARITY)
        count = min(-(-num_disparities // multiple) * multiple, MAX_NUM_DISPARITIES)
        return changed(self, {"min_disparity": first, "num_disparities": count})


def without_outside(found: PixelMatches, left: Image, right: Image | None = None) -> PixelMatches:
    """Return matches without those of transparent pixels (alpha 0) or, with `right`, with transparent pixels of it."""
    outside, right_outside = transparent(left), None if right is None else transparent(right)
    if right_outside is not None:
        rows, cols = np.ogrid[: right_outside.shape[0], : right_outside.shape[1]]
        right_cols = np.rint(np.nan_to_num(cols - found.disparity)).astype(int).clip(0, right_outside.shape[1] - 1)
        if found.dy is not None:
            rows = np.rint(np.nan_to_num(rows + found.dy)).astype(int).clip(0, right_outside.shape[0] - 1)
        leads_out = right_outside[rows, right_cols] & np.isfinite(found.disparity)
        outside = leads_out if outside is None else outside | leads_out
    if outside is None:
        return found
    nan = np.float32(np.nan)
    return PixelMatches(
        np.where(outside, nan, found.disparity),
        np.where(outside, np.uint8(Reason.OUT_OF_FRAME), found.reason),
        None if found.score is None else np.where(outside, nan, found.score),
        None if found.dy is None else np.where(outside, nan, found.dy),
    )


def grey_bytes(shape: tuple[int, ...], dtype: npt.DTypeLike) -> int:
    """Return the bytes of both grey images, plus a contiguous copy of one's colours if there is an alpha channel."""
    if len(shape) == 2:
        return 0
    return shape[0] * shape[1] * np.dtype(dtype).itemsize * (2 + 3 * (shape[2] == 4))


@dataclass(frozen=True, eq=False, repr=False)
class DisparityMap(Shown):
    """Disparity map in the frame of the left image, with reason, score and displacement of every pixel.

    Attributes
    ----------
    disparity
        (H, W) float32, px, ``-dx``; NaN = no disparity.
    reason
        (H, W) uint8, a :class:`~stereolag.stereo.matcher.Reason` for every pixel.
    score
        (H, W) float32 score of the match, higher is more certain; all NaN if the method has none.
    dy, dx
        (H, W) float32 displacement, right minus left, px; NaN = no disparity.
    elapsed_s
        Time of the computation alone, s.
    settings
        The matcher that made the map.

    Examples
    --------
    >>> import stereolag as sl
    >>> from stereolag import samples
    >>> cube = samples.stereo_pairs()["cube"]
    >>> result = sl.StereoBM(num_disparities=64).compute(sl.read_image(cube.left), sl.read_image(cube.right))
    >>> result
    <DisparityMap 640 × 480, ...% measured, by StereoBM in ... s>
    >>> round(float(result.disparity[240, 320]))  # px, of the pixel at (row, col)
    45
    >>> result.disparity[0, 0], sl.Reason(result.reason[0, 0]).name
    (np.float32(nan), 'OUT_OF_FRAME')
    """

    disparity: FloatMap
    reason: ReasonMap
    _score: FloatMap | None
    _dy: FloatMap | None
    elapsed_s: float
    settings: StereoMatcher

    def __post_init__(self) -> None:
        for array in (self.disparity, self.reason, self._score, self._dy):
            if array is not None:
                array.flags.writeable = False

    def __repr__(self) -> str:
        rows, cols = self.disparity.shape
        return (
            f"<DisparityMap {cols} × {rows}, {100 * self.coverage:.1f} % measured, by {type(self.settings).__name__} "
            f"in {self.elapsed_s:.3g} s>"
        )

    @property
    def score(self) -> FloatMap:
        """Return the scores; all NaN, using no memory, if the method has none."""
        return np.broadcast_to(np.float32(np.nan), self.disparity.shape) if self._score is None else self._score

    @property
    def dy(self) -> FloatMap:
        """Return the vertical displacement, right minus left, px."""
        return np.where(self.valid, np.float32(0), np.float32(np.nan)) if self._dy is None else self._dy

    @property
    def dx(self) -> FloatMap:
        """Return the horizontal displacement, right minus left, px."""
        return np.float32(0) - self.disparity

    @property
    def lag(self) -> FloatMap:
        """Return the Euclidean lag ``hypot(dy, dx)``, px, as in the source report's depth maps."""
        return np.hypot(self.dy, self.dx)

    @property
    def valid(self) -> Mask:
        """Return where there is a disparity, measured or filled."""
        return np.isfinite(self.disparity)

    @property
    def filled(self) -> Mask:
        """Return where the disparity was filled in from the surroundings instead of measured."""
        # A member of the enumeration would be compared as int64, which takes thirty times as long.
        return np.asarray(self.reason == np.uint8(Reason.FILLED))

    @property
    def measured(self) -> Mask:
        """Return where the disparity was measured, not filled in."""
        return self.valid & ~self.filled

    @property
    def coverage(self) -> float:
        """Return the share of pixels whose disparity was measured, not filled in, 0..1."""
        return int(np.count_nonzero(self.measured)) / self.reason.size

    def without_scores(self) -> DisparityMap:
        """Return the map without its scores, which is enough to show it and takes a third less memory."""
        return replace(self, _score=None)

    def turned(self, quarters: int) -> DisparityMap:
        """Return the map rotated counter-clockwise by quarters of a turn; its disparities are then along columns."""
        if quarters % 4 == 0:
            return self
        score = None if self._score is None else np.rot90(self._score, quarters).copy()
        disparity, reason = np.rot90(self.disparity, quarters).copy(), np.rot90(self.reason, quarters).copy()
        return DisparityMap(disparity, reason, score, None, self.elapsed_s, self.settings)

    def enlarged(self, rows: int, cols: int, settings: StereoMatcher) -> DisparityMap:
        """Return the map of a downscaled pair enlarged to the pair's full size, in px of that size.

        Every pixel has the disparity of the nearest one. Nothing is interpolated, since the mean of a near and a far
        disparity belongs to neither surface. Enlarging adds no precision: an error of 1 px in the smaller images
        becomes one of `cols` / width px.

        Parameters
        ----------
        rows, cols
            The full size of the pair.
        settings
            The settings of this map for images of that size (:func:`stereolag.core.settings.scaled_settings`).

        Raises
        ------
        ValueError
            A size smaller than the map's.
        """
        height, width = self.disparity.shape
        if rows < height or cols < width:
            raise ValueError(f"The map is {width} × {height} pixels; enlarged, it cannot have {cols} × {rows}.")

        def larger(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
            return np.asarray(cv2.resize(array, (cols, rows), interpolation=cv2.INTER_NEAREST_EXACT))

        has_score, has_dy = np.isfinite(self.score).any(), np.nan_to_num(self.dy).any()
        return DisparityMap(
            larger(self.disparity) * np.float32(cols / width),
            larger(self.reason),
            larger(self.score) if has_score else None,
            larger(self.dy) * np.float32(rows / height) if has_dy else None,
            self.elapsed_s,
            settings,
        )
