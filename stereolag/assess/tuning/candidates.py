"""The candidate settings of a search: all combinations of steps that work well together.

The search range is given by the pair, and the tolerance of a check only decides which matches are believed, so neither
is varied.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import singledispatch
from itertools import product
from typing import Any

from stereolag.assess.tuning.parameters import parameters
from stereolag.core.settings import FitsImage, Settings, changed, marker
from stereolag.stereo.finishing.checks import LeftRightCheck
from stereolag.stereo.finishing.filters import MedianFilter, SpeckleFilter
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.opencv import StereoBM, StereoSGBM
from stereolag.stereo.semi_global.matcher import SemiGlobalMatcher
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.stereo.windows.search import CentredSearch

Step = dict[str, Any]
"""Settings to change together, with names as in :func:`stereolag.core.settings.changed`."""

AS_SET: Step = {}
SIZES = 7
"""Number of values tried for a side about which nothing else is known."""

WINDOW_SIZES = (9, 11, 7, 13, 15, 5, 21)
EVERY_PIXEL = 0.95
"""The overlap that places windows of up to 29 px at every pixel, as the left-right check requires."""

MEDIAN_RADII = (6, 10)
BLOCK_SIZES = (11, 9, 13, 15, 17, 7, 21)
GRADIENT_CAPS = (63, 31)
SMALL_BLOCK_SIZES = (9, 1, 7, 3, 5, 11)
JUMP_PENALTIES = (16, 32, 64, 128)
"""P2 per pixel of the block, as StereoSGBM sums costs over it. P1 is a quarter of P2, as in OpenCV's own examples."""

SLANT_SHARE = 4
GRADIENT_CAP_SUMMED = 31
SEMI_GLOBAL_SIZES = (9, 7, 11, 5)
PENALTY_FACTORS = (1.0, 0.5, 2.0)


def candidates(matcher: StereoMatcher) -> list[StereoMatcher]:
    """Return the settings to try in place of a matcher's, most promising first.

    All have the same search range as the matcher, which is not included.
    """
    found: list[StereoMatcher] = []
    for choice in _likely_first(*steps(matcher)):
        try:
            tried = changed(matcher, {name: value for step in choice for name, value in step.items()})
        except ValueError:  # incompatible steps
            continue
        if tried != matcher and tried not in found and tried.search_range() == matcher.search_range():
            found.append(tried)
    return found


def _likely_first(*axes: Sequence[Any]) -> list[tuple[Any, ...]]:
    """Return every combination of one value per axis, ordered by the sum of the values' positions on their axes."""
    ranked = sorted(product(*map(enumerate, axes)), key=lambda choice: sum(rank for rank, _ in choice))
    return [tuple(value for _, value in choice) for choice in ranked]


@singledispatch
def steps(matcher: StereoMatcher) -> Sequence[Sequence[Step]]:
    """Return the axes of steps, most promising first, of which all combinations are tried.

    The default for other methods varies the sides that must fit into the image, and the stages that all methods share.
    """
    known = parameters(matcher)
    sides = [
        [AS_SET, *({name: value} for value in known[name].values(SIZES))]
        for name, field in type(matcher).model_fields.items()
        if name in known and marker(field, FitsImage) is not None
    ]
    return [*sides, _finishing(matcher)]


@steps.register
def _of_windows(matcher: CorrelationMatcher) -> Sequence[Sequence[Step]]:
    finishing = [
        {"overlap": max(matcher.overlap, EVERY_PIXEL), "score": "zncc", "engine": "auto"} | step if step else step
        for step in _finishing(matcher)
    ]
    return [[*(_of_window(matcher, size) for size in WINDOW_SIZES), AS_SET], [*finishing, {"score": "zncc"}]]


def _of_window(matcher: CorrelationMatcher, size: int) -> Step:
    """Return the step to a window size, with a search square that keeps its reach."""
    search = matcher.search
    if not isinstance(search, CentredSearch):
        return {"window_size": size}
    if search.circular(matcher.window_size):
        return AS_SET
    return {"window_size": size, "search.search_size": search.search_size - matcher.window_size + size}


@steps.register
def _of_bm(matcher: StereoBM) -> Sequence[Sequence[Step]]:
    return [
        [*({"block_size": size} for size in BLOCK_SIZES), AS_SET],
        [*({"pre_filter_cap": cap} for cap in GRADIENT_CAPS), AS_SET],
    ]


@steps.register
def _of_sgbm(matcher: StereoSGBM) -> Sequence[Sequence[Step]]:
    def penalised(size: int, jump: int) -> Step:
        large = jump * size**2
        return {
            "block_size": size,
            "p1": large // SLANT_SHARE,
            "p2": large,
            "pre_filter_cap": GRADIENT_CAP_SUMMED,
        }

    return [[penalised(size, jump) for size, jump in _likely_first(SMALL_BLOCK_SIZES, JUMP_PENALTIES)]]


@steps.register
def _of_semi_global(matcher: SemiGlobalMatcher) -> Sequence[Sequence[Step]]:
    penalties = ("penalty_small", "penalty_at_edges", "penalty_large")
    return [
        [AS_SET, *({"window_size": size} for size in SEMI_GLOBAL_SIZES)],
        [
            {
                f"optimisation.{name}": max(1, round(factor * getattr(matcher.optimisation, name)))
                for name in penalties
                if factor != 1
            }
            for factor in PENALTY_FACTORS
        ],
        _finishing(matcher),
    ]


def _finishing(matcher: StereoMatcher) -> list[Step]:
    """Return all stages with medians of different radius, then the current settings.

    Active checks keep their tolerance. A hole counts as wrong, so checking and then filling beats either alone.
    """
    if not {"left_right", "speckle", "filling", "median"} <= set(type(matcher).model_fields):
        return [AS_SET]
    now = dict(matcher)
    left_right: LeftRightCheck = now["left_right"] or LeftRightCheck()
    speckle: SpeckleFilter = now["speckle"] or SpeckleFilter()
    median: MedianFilter = now["median"] or MedianFilter()
    return [
        *(
            {
                "left_right": left_right,
                "speckle": speckle,
                "filling": True,
                "median": changed(median, {"radius": radius}),
            }
            for radius in MEDIAN_RADII
        ),
        AS_SET,
    ]


def side_of(matcher: StereoMatcher) -> int:
    """Return the side of a matcher's window or block, px; 0 if it has none."""
    fields = type(matcher).model_fields
    return next((getattr(matcher, name) for name, field in fields.items() if marker(field, FitsImage) is not None), 0)


def differences(before: Settings, after: Settings, path: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Yield the differences between two settings of one class: dotted name, old value and new value."""
    for name in type(before).model_fields:
        old, new = getattr(before, name), getattr(after, name)
        if isinstance(old, Settings) and type(old) is type(new):
            yield from differences(old, new, f"{path}{name}.")
        elif old != new:
            yield f"{path}{name}", old, new
