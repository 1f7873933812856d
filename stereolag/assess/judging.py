"""Settings judged on pairs: the error of a map as one figure, the certainty of a gain, and sweeps of two parameters."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import chain, product
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import FloatMap, Mask
from stereolag.core.inputs import Image, as_stereo_pair
from stereolag.core.jobs import Estimate, Progress, part, silent
from stereolag.core.settings import Bounds, Number, Settings, changed
from stereolag.stereo.matcher import Reason, StereoMatcher
from stereolag.stereo.methods import preset
from stereolag.stereo.semi_global.matcher import SemiGlobalMatcher

MAX_GOOD_ERROR_PX = 2.0
"""A disparity that is off by more than this is bad, px."""

CHANCE_SIGMAS = 2.5
"""Gain, in standard errors, that may be due to chance. Of two dozen equal settings, the luckiest is about two standard
errors above the rest (the expected maximum of 24 normal deviates is 1.95)."""

BLOCKS_PER_SIDE = 8
"""Number of blocks across and down into which a map is divided."""


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
        """Judge a map against a reference of the same shape, (H, W) px, NaN = not judged."""
        known = np.isfinite(reference)
        wrong = known & ~(np.abs(disparity - reference) <= MAX_GOOD_ERROR_PX)
        rows, cols = (np.arange(side) * BLOCKS_PER_SIDE // side for side in known.shape)

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
        return self.points - CHANCE_SIGMAS * self.error

    @classmethod
    def between(cls, before: Sequence[Judgement], after: Sequence[Judgement]) -> Gain:
        """Return the mean gain over pairs, each judged before and after.

        The standard error is that of a ratio estimate over the blocks of each pair (W. Cochran, *Sampling Techniques*,
        1977, 6.8): a gain from a single corner or border of the images may be chance or a border effect.
        """
        gains = [cls._of_pair(*judgements) for judgements in zip(before, after, strict=True)]
        error = sum(gain.error**2 for gain in gains) ** 0.5 / len(gains)
        return cls(sum(gain.points for gain in gains) / len(gains), error)

    @classmethod
    def _of_pair(cls, before: Judgement, after: Judgement) -> Gain:
        judged, corrected = before.judged, before.wrong - after.wrong
        share, blocks = corrected.sum() / judged.sum(), np.count_nonzero(judged)
        if blocks < 2:
            return cls(float(100 * share), float("inf"))
        variance = ((corrected - share * judged) ** 2).sum() * blocks / (blocks - 1)
        return cls(float(100 * share), float(100 * np.sqrt(variance) / judged.sum()))


MIN_MEASURED_SHARE = 0.25
"""Share of measured pixels from which a reference represents the pair: 2 to 12 % are measured in two unrelated images,
or with left and right exchanged, 22 % with rows 10 px off, and more than half in sound pairs."""

JUDGEMENT_BYTES_PER_PX = 97
"""Bytes per pixel of a map and its comparison with the reference, in float64."""

JUDGEMENT_SECONDS_PER_PX = 5e-8
"""Seconds of that comparison per pixel."""

STRIP_ROWS = 64
"""Rows in a strip of the images."""

SEAM_ROWS = 12
"""Rows at either end of a strip that are matched but not judged."""

MAX_STRIPS_SHARE = 0.75
"""Strips that cover this share of the images or more hardly take less time than the whole images."""


class Unjudged(StrEnum):
    """Why settings cannot be judged without ground truth."""

    JUDGES_ITSELF = "judges itself"
    """The reference would come from the same or a closely related method, so a figure from it means nothing."""
    TOO_LITTLE_MEASURED = "too little measured"
    """The accurate preset measured too little of the pair to represent it."""


class Criterion(StrEnum):
    """The figure that settings are judged by: bad-2, the percentage of pixels off by more than 2 px or missing."""

    TRUE_BAD_2 = "true bad-2"
    """Over the pixels with ground truth."""
    ESTIMATED_BAD_2 = "estimated bad-2"
    """Over the pixels that the accurate preset measured, relative to its disparities."""


@dataclass(frozen=True, eq=False)
class TuningPair:
    """A pair on which settings are tried.

    Attributes
    ----------
    left, right
        The images.
    reference
        (H, W) disparities with which maps are compared, px; NaN where they are not judged.
    criterion
        Whether bad-2 relative to the reference is true or estimated.
    """

    left: Image
    right: Image
    reference: FloatMap
    criterion: Criterion

    @classmethod
    def of(
        cls,
        left: npt.ArrayLike,
        right: npt.ArrayLike,
        truth: npt.ArrayLike | None = None,
        *,
        search_range: tuple[int, int] | None = None,
        progress: Progress | None = None,
    ) -> TuningPair:
        """Return a pair judged against its ground truth or, without one, against :func:`measured_reference`.

        Parameters
        ----------
        left, right
            (H, W), (H, W, 3) or (H, W, 4) images of one size and type.
        truth
            (H, W) disparity, px; NaN or infinite = unknown.
        search_range
            First disparity and number, px, over which the reference is measured; by default the preset's own.
        progress
            Called with the fraction of the reference computed.

        Raises
        ------
        ValueError
            If the images or the truth do not fit together, the truth has no disparity, or the reference needs more
            memory than one job may take.
        """
        images = as_stereo_pair(left, right)
        if truth is None:
            reference = measured_reference(*images, search_range=search_range, progress=progress)
            return cls(*images, reference, Criterion.ESTIMATED_BAD_2)
        known = np.asarray(truth, dtype=np.float32)
        if known.shape != images[0].shape[:2]:
            raise ValueError(
                f"truth has shape {known.shape} and the images {images[0].shape[:2]}; both must be the same."
            )
        if not np.isfinite(known).any():
            raise ValueError("truth contains no finite disparity to compare with.")
        return cls(*images, known, Criterion.TRUE_BAD_2)

    @classmethod
    def unjudgeable(cls, left: npt.ArrayLike, right: npt.ArrayLike) -> TuningPair:
        """Return a pair without a reference, whose maps alone are of interest: every bad-2 is NaN."""
        images = as_stereo_pair(left, right)
        return cls(*images, np.full(images[0].shape[:2], np.nan, dtype=np.float32), Criterion.ESTIMATED_BAD_2)

    def unjudged(self, matcher: StereoMatcher) -> Unjudged | None:
        """Return why this pair cannot judge the settings of a matcher; None if it can."""
        if self.criterion is Criterion.TRUE_BAD_2:
            return None
        if judges_itself(matcher):
            return Unjudged.JUDGES_ITSELF
        return Unjudged.TOO_LITTLE_MEASURED if np.isfinite(self.reference).mean() < MIN_MEASURED_SHARE else None

    def strips(self, share: float, min_height: int = 0) -> TuningPair:
        """Return roughly the given share of the rows, as stacked full-width strips spread evenly over the images.

        Strips are matched pixel for pixel like the whole images, except for the rows beside their seams, which are not
        judged; a reduced pair would need other windows and penalties, and have other errors. The whole pair is returned
        if strips would not save much, have nothing to judge, or be lower than `min_height`, px.
        """
        height = len(self.reference)
        count = max(1, round(share * height / STRIP_ROWS))
        if count * STRIP_ROWS >= MAX_STRIPS_SHARE * height or count * STRIP_ROWS < min_height:
            return self
        spacing = height / count
        tops = [round(spacing * number + (spacing - STRIP_ROWS) / 2) for number in range(count)]
        rows = np.concatenate([np.arange(top, top + STRIP_ROWS) for top in tops])
        reference = self.reference[rows].reshape(count, STRIP_ROWS, -1)
        reference[:, :SEAM_ROWS] = reference[:, -SEAM_ROWS:] = np.nan
        if not np.isfinite(reference).any():
            return self
        stacked = reference.reshape(len(rows), -1)
        return replace(self, left=self.left[rows], right=self.right[rows], reference=stacked)

    def estimate(self, matcher: StereoMatcher) -> Estimate:
        """Return the memory and time of :meth:`judge`."""
        matching, pixels = matcher.estimate(self.left.shape, self.left.dtype), self.reference.size
        memory = max(matching.memory, JUDGEMENT_BYTES_PER_PX * pixels)
        return Estimate(memory, matching.seconds + JUDGEMENT_SECONDS_PER_PX * pixels)

    def judge(self, matcher: StereoMatcher, *, progress: Progress | None = None) -> Judgement:
        """Judge the map of a matcher.

        Raises
        ------
        ValueError
            If the settings do not fit the images, or need more memory than one job may take.
        """
        return Judgement.of(matcher.compute(self.left, self.right, progress=progress).disparity, self.reference)


def criterion_of(pairs: Sequence[TuningPair]) -> Criterion:
    """Return the criterion of a mean over pairs: estimated if any pair's is."""
    estimated = any(pair.criterion is Criterion.ESTIMATED_BAD_2 for pair in pairs)
    return Criterion.ESTIMATED_BAD_2 if estimated else Criterion.TRUE_BAD_2


def measured_reference(
    left: npt.ArrayLike,
    right: npt.ArrayLike,
    *,
    search_range: tuple[int, int] | None = None,
    progress: Progress | None = None,
) -> FloatMap:
    """Return the (H, W) disparities measured by the accurate preset, the reference for maps without ground truth.

    Pixels that it filled or left blank are NaN, not judged. Its own errors are few and affect all compared settings
    alike, so that the ranking is nearly that by ground truth. The arguments are as for :meth:`TuningPair.of`.

    Raises
    ------
    ValueError
        If the images do not fit together, or the range needs more memory than one job may take.
    """
    found = _judging_matcher(search_range).compute(left, right, progress=progress)
    return np.where(found.reason == np.uint8(Reason.MEASURED), found.disparity, np.float32(np.nan))


def estimate_reference(
    search_range: tuple[int, int] | None, shape: tuple[int, ...], dtype: npt.DTypeLike = np.uint8
) -> Estimate:
    """Return the memory and time of :func:`measured_reference` for two images of a shape and dtype."""
    return _judging_matcher(search_range).estimate(shape, dtype)


def _judging_matcher(search_range: tuple[int, int] | None) -> StereoMatcher:
    matcher = preset("accurate")
    return matcher if search_range is None else matcher.with_search_range(*search_range)


def widest_range(matchers: Iterable[StereoMatcher]) -> tuple[int, int] | None:
    """Return the range that covers those of all matchers, (first disparity, number), px; None if none has a range."""
    ranges = [found for found in (matcher.search_range() for matcher in matchers) if found is not None]
    if not ranges:
        return None
    first = min(low for low, _ in ranges)
    return first, max(low + count for low, count in ranges) - first


def judges_itself(matcher: StereoMatcher) -> bool:
    """Return whether a matcher is the one behind :func:`measured_reference`, or closely related to it."""
    return isinstance(matcher, SemiGlobalMatcher)


STEPS_OUTWARDS = [sign * number for number in range(1, 13) for sign in (1, -1)]
"""1, -1, 2, -2 and so on: steps away from a current value."""

MAX_WHOLE_RANGE = 1.0
"""Parameters with an allowed range up to this wide are tried over all of it, the others around their current value."""


@dataclass(frozen=True)
class Parameter:
    """A number among the settings of a method.

    Attributes
    ----------
    name
        Dotted for nested settings: "search.vertical".
    title
        Its label on the page.
    value
        Its current value.
    bounds
        Its allowed range.
    """

    name: str
    title: str
    value: Number
    bounds: Bounds

    def values(self, count: int) -> tuple[Number, ...]:
        """Return at most `count` allowed values to try, ascending, including the current one.

        Sizes are tried in half octaves around their value, fractions over their whole range, and numbers that are zero
        or may be negative in doubling steps away from their value. All are a multiple of the step from the current
        value.
        """
        step = self.bounds.step
        low = -math.inf if self.bounds.low is None else self.bounds.low
        high = math.inf if self.bounds.high is None else self.bounds.high
        if high - low <= MAX_WHOLE_RANGE:
            wanted = [low + (high - low) * number / (count - 1) for number in range(count)]
        elif self.value > 0 and (low >= 0 or self.bounds.low is None):
            wanted = [self.value * math.sqrt(2) ** number for number in STEPS_OUTWARDS]
        else:
            wanted = [self.value + step * math.copysign(2 ** (abs(number) - 1), number) for number in STEPS_OUTWARDS]
        on_grid = (self.value + step * round((value - self.value) / step) for value in wanted)
        allowed = (round(value, 9) for value in on_grid if low <= value <= high)
        return tuple(sorted([*dict.fromkeys([self.value, *allowed])][:count]))


def parameters(matcher: StereoMatcher) -> dict[str, Parameter]:
    """Return the numeric settings of a matcher that have an effect, by name, in order of declaration."""
    return {parameter.name: parameter for parameter in _numbers(matcher, "") if _is_free(matcher, parameter)}


def _is_free(matcher: StereoMatcher, parameter: Parameter) -> bool:
    """Return whether the other settings allow a parameter any value but its current one."""
    for value in parameter.values(3):  # the current value and one to either side
        with suppress(ValueError):
            if changed(matcher, {parameter.name: value}) != matcher:
                return True
    return False


def _numbers(settings: Settings, path: str) -> Iterator[Parameter]:
    for name, field in type(settings).model_fields.items():
        value = getattr(settings, name)
        if type(settings).obstacle(name, settings) is not None:
            continue
        if isinstance(value, Settings):
            yield from _numbers(value, f"{path}{name}.")
        elif isinstance(value, int | float) and not isinstance(value, bool):
            yield Parameter(f"{path}{name}", field.title or name, value, Bounds.of(field))


Axis = tuple[str, Sequence[Any]]
"""The name of a parameter and its values."""

MAX_SHOWN_WIDTH_PX = 180
"""Largest width of the maps that a sweep keeps, px."""


@dataclass(frozen=True, eq=False)
class Sweep:
    """A grid of settings (Fig. 3.3 of the report).

    Attributes
    ----------
    rows, cols
        The values of the two parameters.
    bad
        (n_rows, n_cols) mean bad-2 over the pairs, %, lower is better; NaN without a map or a reference.
    criterion
        Whether `bad` is true or estimated bad-2.
    maps
        (n_rows, n_cols, height, width) disparities of the first pair, px of its full size, reduced to at most
        :data:`MAX_SHOWN_WIDTH_PX`; NaN = none.
    shown
        (n_rows, n_cols) whether there is a map: the settings fit each other and the images, and were tried.
    finished
        Whether all combinations were tried, and the sweep was not cancelled.
    """

    rows: tuple[Any, ...]
    cols: tuple[Any, ...]
    bad: npt.NDArray[np.float64]
    criterion: Criterion
    maps: FloatMap
    shown: Mask
    finished: bool

    @property
    def best(self) -> tuple[int, int] | None:
        """Return the (row, col) of the best cell; None if none could be judged."""
        return None if np.isnan(self.bad).all() else divmod(int(np.nanargmin(self.bad)), len(self.cols))


def sweep(
    matcher: StereoMatcher,
    pairs: Sequence[TuningPair],
    *,
    rows: Axis,
    cols: Axis,
    progress: Progress | None = None,
    cancelled: Callable[[], bool] = lambda: False,
) -> Sweep:
    """Match one or more pairs at every combination of two parameters.

    Parameters
    ----------
    matcher
        Provides all other settings.
    pairs
        At least one; pairs that cannot judge do not count. If a parameter affects the search range, a reference
        measured in place of ground truth must cover the :func:`widest_range` of :func:`combinations`.
    rows, cols
        (name, values) of two parameters, named as in :func:`stereolag.core.settings.changed`; at least one value each.
    progress
        Called with the fraction done.
    cancelled
        Called before every cell; True ends the sweep with the cells made so far.
    """
    report = progress or silent
    grid, (height, width) = (len(rows[1]), len(cols[1])), pairs[0].reference.shape
    shown_width = min(MAX_SHOWN_WIDTH_PX, width)
    size = shown_width, max(1, round(shown_width * height / width))
    maps = np.full((*grid, *size[::-1]), np.nan, dtype=np.float32)
    bad, shown, finished = np.full(grid, np.nan), np.zeros(grid, dtype=np.bool_), True
    for number, settings in enumerate(combinations(matcher, rows, cols)):
        if cancelled():
            finished = False
            break
        if settings is None:
            continue
        cell = divmod(number, grid[1])
        with suppress(ValueError):  # settings that do not fit the images, or need too much memory
            disparity, bad[cell] = _tried(settings, pairs, part(report, number, bad.size))
            maps[cell] = cv2.resize(disparity, size, interpolation=cv2.INTER_NEAREST_EXACT)
            shown[cell] = True
    report(1.0)
    return Sweep(tuple(rows[1]), tuple(cols[1]), bad, criterion_of(pairs), maps, shown, finished)


def combinations(matcher: StereoMatcher, rows: Axis, cols: Axis) -> Iterator[StereoMatcher | None]:
    """Yield the settings of every cell of a sweep, row by row; None for values that do not fit together."""
    for row, col in product(rows[1], cols[1]):
        try:
            yield changed(matcher, {rows[0]: row, cols[0]: col})
        except ValueError:
            yield None


def estimate_sweep(matcher: StereoMatcher, pairs: Sequence[TuningPair], *, rows: Axis, cols: Axis) -> Estimate:
    """Return the memory and time of :func:`sweep`, whose cells are made one after another.

    A cell that alone needs more memory than one job may take has no map.
    """
    cells = [cell for cell in combinations(matcher, rows, cols) if cell is not None]
    jobs = [pair.estimate(cell) for cell in cells for pair in pairs]
    return Estimate(max((job.memory for job in jobs), default=0), sum(job.seconds for job in jobs))


def _tried(settings: StereoMatcher, pairs: Sequence[TuningPair], progress: Progress) -> tuple[FloatMap, float]:
    """Return the first pair's map and the mean bad-2 over the pairs that can judge, NaN without any."""
    maps = (
        settings.compute(pair.left, pair.right, progress=part(progress, number, len(pairs))).disparity
        for number, pair in enumerate(pairs)
    )
    first = next(maps)
    every = [Judgement.of(each, pair.reference).bad for each, pair in zip(chain([first], maps), pairs, strict=True)]
    judged = [bad for bad in every if not math.isnan(bad)]
    return first, sum(judged) / len(judged) if judged else math.nan
