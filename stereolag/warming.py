"""``python -m stereolag.warming``: run every measurement once on small inputs, for every type of image and recording.

This compiles loops that were never compiled, keeping their machine code on disk, and loads the others. Later
measurements wait for neither, and the times shown are those of the computation alone.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import cache, partial
from multiprocessing import get_context
from typing import Any

import numpy as np

from stereolag import CorrelationMatcher, SearchArea, match_template, optical_flow, preset, signal_lag
from stereolag.core.inputs import Image
from stereolag.loops.bands import available_cores
from stereolag.loops.compilation import compile_alone
from stereolag.signals.correlation import SHORTEST_BLOCK
from stereolag.stereo.finishing.stages import AmbiguityTest, LeftRightCheck
from stereolag.stereo.matcher import StereoMatcher

LAG_METHODS: tuple[dict[str, Any], ...] = (
    {"method": "fft"},
    {"method": "phat"},
    {"method": "sampled", "seed": 0},
    {"method": "direct", "max_lag": 300},
)
IMAGE_TYPES = (np.uint8, np.uint16, np.float32, np.float64)
STRIP = SearchArea.rectified(16)
MATCHERS = (
    CorrelationMatcher(window_size=7, search=STRIP, engine="window_sums", ambiguity=AmbiguityTest()),
    CorrelationMatcher(window_size=7, search=STRIP, left_right=LeftRightCheck()),
    CorrelationMatcher(window_size=7, overlap=0.5, search=SearchArea.centred(15), engine="window_sums"),
    CorrelationMatcher(window_size=7, overlap=0.5, search=SearchArea.centred(15), engine="fft"),
    preset("fast", num_disparities=16),
    preset("accurate", num_disparities=16),
)


def _measure_sounds() -> None:
    random = np.random.default_rng(0)
    sound, long = random.normal(size=4000), random.normal(size=4 * SHORTEST_BLOCK)
    for settings in LAG_METHODS:
        signal_lag(sound[200:], sound[:-200], **settings)
    signal_lag(long, long, max_lag=30)


def _measure_pictures() -> None:
    for picture in _pictures():
        grey, part = picture[..., 0], picture[20:40, 30:50]
        masked = np.dstack([part, np.full(part.shape[:2], 255, part.dtype)])
        masked[:4, :4, 3] = 0
        for image, template in ((picture, masked), (picture, part), (grey, part[..., 0])):
            match_template(image, template, method="fft")
            match_template(image, template, method="sampled", seed=0)
        optical_flow(grey, np.roll(grey, 2, axis=1), search=8)


def _match(matcher: StereoMatcher) -> None:
    for picture in _pictures():
        for left in (picture[..., 0], picture):
            right = np.roll(left, -4, axis=1)
            right[30:] = left[30:]  # disparities at the end of the search too
            matcher.compute(left, right)


def _pictures() -> list[Image]:
    random = np.random.default_rng(0)
    return [random.integers(0, 255, (60, 80, 3)).astype(kind) for kind in IMAGE_TYPES]


PARTS: tuple[Callable[[], None], ...] = (
    *(partial(_match, matcher) for matcher in reversed(MATCHERS)),
    _measure_pictures,
    _measure_sounds,
)
"""All measurements, those with the most loops first."""


@cache
def warm() -> None:
    """Run every measurement once on small images and recordings; once per process is enough."""
    for part in PARTS:
        part()


def _run_part(number: int) -> None:
    PARTS[number]()


def compile_all() -> None:
    """Compile every loop, in a process for each core."""
    with ProcessPoolExecutor(available_cores(), get_context("spawn"), compile_alone) as processes:
        list(processes.map(_run_part, range(len(PARTS))))


if __name__ == "__main__":
    compile_all()
