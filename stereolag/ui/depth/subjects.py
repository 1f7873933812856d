"""The result to take away: at the pair's own size, whatever size is shown."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from stereolag.core.jobs import Estimate, limits
from stereolag.core.settings import scaled_settings
from stereolag.geometry.calibration import Calibration
from stereolag.pair import Pair
from stereolag.stereo.matcher import DisparityMap, StereoMatcher
from stereolag.ui.depth.calibrating import known_distance
from stereolag.ui.depth.comparing import estimates_so_far
from stereolag.ui.depth.inputs import original
from stereolag.ui.depth.maps import DepthView
from stereolag.ui.depth.restoring import page_state
from stereolag.ui.jobs import is_heavy


@dataclass(eq=False)
class Subject:
    """One map of a view and the data for its files, at the pair's own size.

    Attributes
    ----------
    view, method
        The view on the page, and the name of the map in it.
    pair
        The pair at its own size, with all changes made to it.
    calibration
        Calibration of that pair, derived from a known distance if one was entered.
    factor
        Px of the pair per px shown.
    settings
        Settings of the map for that size; None if they are not allowed.
    settings_refusal
        Why the settings are not allowed; "" if they are.
    computed
        The map computed at that size; None if not computed yet.
    session
        State of the page, as arguments of :func:`stereolag.io.session_json`.
    estimated_bad
        Estimated bad-2 of the maps shown, %, by method name; empty unless it was estimated.
    """

    view: DepthView
    method: str
    pair: Pair
    calibration: Calibration | None
    factor: float
    settings: StereoMatcher | None
    settings_refusal: str
    computed: DisparityMap | None = None
    session: Mapping[str, Any] = field(default_factory=dict)
    estimated_bad: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, view: DepthView, method: str) -> Subject:
        """Return one map of a view as a subject."""
        pair = original(view.pair)
        factor = pair.left.shape[1] / view.pair.left.shape[1]
        known = known_distance(view.pair)
        shown = view.results[method]
        settings, refusal = _for_size(shown.settings, factor)
        return cls(
            view,
            method,
            pair,
            pair.calibration if known is None else known.calibration.scaled(factor),
            factor,
            settings,
            refusal,
            shown if pair is view.pair else None,
            _session(view, pair, factor),
            estimates_so_far(view) if view.pair.truth is None else {},
        )

    @property
    def shown(self) -> DisparityMap:
        """Return the map as the page shows it."""
        return self.view.results[self.method]

    @property
    def reduced(self) -> bool:
        """Return whether the page shows the pair smaller than it is."""
        return self.pair is not self.view.pair

    @cached_property
    def estimate(self) -> Estimate:
        """Return the memory and time needed to compute the map at the pair's own size."""
        assert self.settings is not None
        return self.settings.estimate(self.pair.left.shape, self.pair.left.dtype)

    @property
    def light(self) -> bool:
        """Return whether the map at the pair's own size is cheap enough to be computed along with its file."""
        return self.settings is not None and not is_heavy(self.estimate) and self.estimate.memory <= limits().job_memory

    @property
    def enlarged(self) -> bool:
        """Return whether the map is the one shown, enlarged, instead of computed at the pair's own size."""
        return self.computed is None and not self.light

    @cached_property
    def result(self) -> DisparityMap:
        """Return the map at the pair's own size; made on first use."""
        if self.computed is not None:
            return self.computed
        if self.light:
            assert self.settings is not None
            return self.settings.compute(self.pair.left, self.pair.right)
        return self._enlarged(self.method)

    def each_result(self) -> Iterator[tuple[str, DisparityMap]]:
        """Yield the maps of all methods at the pair's own size, one by one; those of the other methods are enlarged."""
        for name in self.view.results:
            yield name, self.result if name == self.method else self._enlarged(name)

    def _enlarged(self, method: str) -> DisparityMap:
        shown = self.view.results[method]
        if not self.reduced:
            return shown
        rows, cols = self.pair.left.shape[:2]
        settings, _ = _for_size(shown.settings, self.factor)
        return shown.enlarged(rows, cols, settings or shown.settings)

    @property
    def colour_range(self) -> tuple[float, float]:
        """Return the colour range, px at the pair's own size."""
        return self.view.colours.low * self.factor, self.view.colours.high * self.factor


def _session(view: DepthView, pair: Pair, factor: float) -> dict[str, Any]:
    shown, state = view.pair, page_state(view.pair, factor)
    used = {type(matcher): matcher for matcher in state.matchers}
    used |= {type(one.settings): one.settings for one in view.results.values() if type(one.settings) not in used}
    matchers = [scaled for matcher in used.values() if (scaled := _for_size(matcher, factor)[0]) is not None]
    return {
        "matchers": matchers,
        "shown": state.shown,
        "size": state.size,
        "colours": state.colours,
        "description": pair.description,
        "history": [change.sentence for change in pair.changes if change.sentence],
        "num_disparities": shown.num_disparities and math.ceil(shown.num_disparities * factor),
        "min_disparity": math.floor(shown.min_disparity * factor),
    }


def _for_size(settings: StereoMatcher, factor: float) -> tuple[StereoMatcher | None, str]:
    """Return settings for images enlarged by `factor`, or None and why they are not allowed."""
    if factor == 1:
        return settings, ""
    try:
        return scaled_settings(settings, factor), ""
    except ValueError as error:
        return None, f"At the size of the original, {error}"
