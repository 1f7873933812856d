"""Example pixels of a pair: one for each kind of match, found from the scores of its window."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from enum import StrEnum

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.assess.explaining.match import BARE_CONTRAST, MatchKind, explain_match
from stereolag.core.inputs import Image, as_grey, as_stereo_pair
from stereolag.core.progress import Progress, silent
from stereolag.stereo.windows.engines import cheaper_engine, find_matches
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.stereo.windows.matches import WindowMatches

Pixel = tuple[int, int]


class ExampleKind(StrEnum):
    """The kinds of example."""

    CLEAR = "clear"
    """One peak, well above every other score."""
    REPEATS = "repeats"
    """Two peaks of the same height with a valley between them."""
    BARE = "bare"
    """A window without texture."""
    HIDDEN = "hidden"
    """A point that a nearer object hides from the right camera."""


LOOKED_AT = 150
"""Number of candidate windows examined, the most promising first."""

CONFUSABLE = 0.1
"""Windows whose two best scores differ by less than this share may show a repeating pattern."""

DEEP_VALLEY = 0.5
"""In a repeating pattern the scores fall at least half the way to their lowest between one repetition and the next."""

FLANK_FALL = 1.5
"""On the flank of a parabola, the best score more than 1 px away is at least twice as far below the peak as the peak's
neighbours are on average; a second peak can be closer to it."""

NARROWEST_HIDDEN = 3
"""Width of a hidden strip beside a near object, px; narrower holes come from rounding."""


def example_pixel(
    kind: ExampleKind,
    matcher: CorrelationMatcher,
    left: npt.ArrayLike,
    right: npt.ArrayLike,
    *,
    progress: Progress = silent,
) -> Pixel | None:
    """Return the (row, col) in the left image that best shows a kind of match; None if the pair has no example.

    Parameters
    ----------
    kind
        The kind to look for.
    matcher
        Provides window, search area and score.
    left, right
        The pair: (H, W), (H, W, 3) or (H, W, 4) images of one size and type.
    progress
        Called with the fraction done.
    """
    images = as_stereo_pair(left, right)
    if kind is ExampleKind.HIDDEN:
        return _hidden(matcher, *images, progress)
    step = max(2, matcher.window_size // 4)
    matches = _matches(matcher, *images, step, progress)
    match kind:
        case ExampleKind.CLEAR:
            promising, wanted = _surest(matches), {MatchKind.CLEAR}
        case ExampleKind.REPEATS:
            promising, wanted = _most_confusable(matches), {MatchKind.REPEATS}
        case ExampleKind.BARE:
            promising = _barest(matches, float(as_grey(images[0]).std()))
            wanted = {MatchKind.BARE, MatchKind.SMOOTH, MatchKind.NOTHING}
    middle = (matcher.window_size - 1) // 2
    whole = _searched_whole(matcher, images[0].shape[1], step)
    for window in sorted(promising, key=lambda window: not whole[window % whole.size]):
        row, col = (int(at) * step + middle for at in np.unravel_index(window, matches.score.shape))
        seen = explain_match(matcher, *images, row, col)
        if seen.kind in wanted and (kind is not ExampleKind.REPEATS or seen.valley_depth > DEEP_VALLEY):
            return row, col
    return None


def _matches(matcher: CorrelationMatcher, left: Image, right: Image, step: int, progress: Progress) -> WindowMatches:
    """Return the best match and the runner-up of windows `step` px apart."""
    query = replace(matcher.query(as_grey(left), as_grey(right)), step=step, runner_up=True, right_matches=False)
    shape = (query.left.shape[0], query.left.shape[1])
    by_spectrum = query.circular or query.score == "phase"
    engine = "fft" if by_spectrum else cheaper_engine(shape, query.window_size, step, query.lags)
    return find_matches(query, engine, progress)


def _searched_whole(matcher: CorrelationMatcher, width: int, step: int) -> npt.NDArray[np.bool_]:
    """Return for every column of windows whether its search along the row stays within the image width."""
    lags, size = matcher.search.lags(matcher.window_size), matcher.window_size
    start = np.arange(0, width - size + 1, step)
    return (start + lags.dx_first >= 0) & (start + size + lags.dx_last <= width)


def _surest(matches: WindowMatches) -> Iterator[int]:
    return _highest_first(matches.score - _runner_up(matches))


def _most_confusable(matches: WindowMatches) -> Iterator[int]:
    """Yield textured windows with two equal peaks first, skipping those whose runner-up is on the peak's flank."""
    behind = matches.score - _runner_up(matches)
    middle = len(matches.around) // 2
    falls = [matches.score - matches.around[middle, [0, 2]].mean(axis=0)]
    if len(matches.around) > 1:
        falls.append(matches.score - matches.around[[0, 2], 1].mean(axis=0))
    confusable = (behind < CONFUSABLE * np.abs(matches.score)) & (behind < FLANK_FALL * np.minimum.reduce(falls))
    textured = (CONFUSABLE * np.abs(matches.score) - behind) * np.sqrt(matches.texture)
    return _highest_first(np.where(confusable, textured, np.nan))


def _barest(matches: WindowMatches, deviation: float) -> Iterator[int]:
    """Yield bare windows, those without any match before those of a smooth sky, then others with little texture."""
    bare = matches.texture < BARE_CONTRAST * deviation
    yield from _highest_first(np.where(bare, -np.nan_to_num(matches.score, nan=-1.0), np.nan))
    yield from _highest_first(np.where(bare, np.nan, -matches.texture))


def _runner_up(matches: WindowMatches) -> npt.NDArray[np.float32]:
    return matches.score if matches.runner_up is None else matches.runner_up


def _highest_first(merit: npt.NDArray[np.floating]) -> Iterator[int]:
    known = np.flatnonzero(np.isfinite(merit))
    yield from known[np.argsort(merit.ravel()[known])[::-1]][:LOOKED_AT].tolist()


def _hidden(matcher: CorrelationMatcher, left: Image, right: Image, progress: Progress) -> Pixel | None:
    """Return the middle of the widest strip that a nearer object hides from the right camera."""
    # Mirrored, the right image plays the left one; mirrored back, its map belongs to the right image's pixels.
    mirrored = matcher.compute(
        np.ascontiguousarray(right[:, ::-1]), np.ascontiguousarray(left[:, ::-1]), progress=progress
    )
    depth = cv2.distanceTransform(_hidden_strips(mirrored.disparity[:, ::-1]).astype(np.uint8), cv2.DIST_L2, 5)
    if 2 * float(depth.max()) < NARROWEST_HIDDEN:
        return None
    row, col = divmod(int(np.argmax(depth)), depth.shape[1])
    return row, col


def _hidden_strips(right_disparity: npt.NDArray[np.float32]) -> npt.NDArray[np.bool_]:
    """Return the (H, W) pixels of the left image that the right camera cannot see, from the right image's map.

    No pixel of the right image is matched to them, and the gap is as wide as the rise in disparity across it: a nearer
    object hides exactly that much of the background. Other gaps are mismatches.
    """
    left_disparity = np.full_like(right_disparity, -np.inf)
    rows, cols = np.nonzero(np.isfinite(right_disparity))
    there = np.rint(cols + right_disparity[rows, cols]).astype(np.intp)
    inside = (there >= 0) & (there < right_disparity.shape[1])
    rows, cols, there = rows[inside], cols[inside], there[inside]
    np.maximum.at(left_disparity, (rows, there), right_disparity[rows, cols])  # the nearer one occludes

    gap = np.isneginf(left_disparity)
    left_disparity[gap] = np.nan
    gap[:, [0, -1]] = False  # a gap at the border has no other side
    change = np.diff(gap.astype(np.int8), axis=1)
    (row, before), (_, last) = np.nonzero(change == 1), np.nonzero(change == -1)
    width = last - before
    growth = left_disparity[row, last + 1] - left_disparity[row, before]
    hides = (width >= NARROWEST_HIDDEN) & (np.abs(growth - width) <= 1 + width / 4)
    strips = np.zeros(gap.shape, dtype=np.bool_)
    for at, start, end in zip(row[hides], before[hides] + 1, last[hides] + 1, strict=True):
        strips[at, start:end] = True
    return strips
