"""Measurements run once on small inputs, for every type of image and recording.

This compiles all loops without machine code on disk, and loads the others. Later measurements wait for neither, and the
times shown are those of the computation alone. ``python -m stereolag.warming`` compiles all loops,
``python -m stereolag.warming pages`` those that run when the pages open.
"""

from __future__ import annotations

import hashlib
import operator
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager, suppress
from functools import cache, partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from stereolag import CorrelationMatcher, SearchArea, match_template, optical_flow, preset, signal_lag
from stereolag.core.inputs import Image
from stereolag.loops.bands import available_cores
from stereolag.loops.compilation import FOLDER, compile_alone, python_process
from stereolag.loops.numba_inside import processor
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
OTHER_MATCHERS = (
    preset("accurate", num_disparities=16),
    CorrelationMatcher(window_size=7, overlap=0.5, search=SearchArea.centred(15), engine="fft"),
    CorrelationMatcher(window_size=7, overlap=0.5, search=SearchArea.centred(15), engine="window_sums"),
    CorrelationMatcher(window_size=7, search=STRIP, left_right=LeftRightCheck()),
    CorrelationMatcher(window_size=7, search=STRIP, engine="window_sums", ambiguity=AmbiguityTest()),
)


def _measure_sounds() -> None:
    random = np.random.default_rng(0)
    sound, long = random.normal(size=4000), random.normal(size=4 * SHORTEST_BLOCK)
    for settings in LAG_METHODS:
        signal_lag(sound[200:], sound[:-200], **settings)
    signal_lag(long, long, max_lag=30)


def _search_pictures() -> None:
    for picture in _pictures():
        grey, part = picture[..., 0], picture[20:40, 30:50]
        masked = np.dstack([part, np.full(part.shape[:2], 255, part.dtype)])
        masked[:4, :4, 3] = 0
        for image, template in ((picture, masked), (picture, part), (grey, part[..., 0])):
            match_template(image, template, method="fft")
            match_template(image, template, method="sampled", seed=0)


def _measure_flow() -> None:
    for picture in _pictures():
        optical_flow(picture[..., 0], np.roll(picture[..., 0], 2, axis=1), search=8)


def _match(matcher: StereoMatcher) -> None:
    for picture in _pictures():
        for left in (picture[..., 0], picture):
            right = np.roll(left, -4, axis=1)
            right[30:] = left[30:]  # disparities at the end of the search too
            matcher.compute(left, right)


def _pictures() -> list[Image]:
    random = np.random.default_rng(0)
    return [random.integers(0, 255, (60, 80, 3)).astype(kind) for kind in IMAGE_TYPES]


Part = Callable[[], None]

OF_PAGES: Sequence[Part] = (
    partial(_match, preset("fast", num_disparities=16)),
    _search_pictures,
    _measure_sounds,
)
"""The measurements that run when the pages open."""

PARTS: Sequence[Part] = (
    partial(_match, OTHER_MATCHERS[0]),
    *OF_PAGES,
    *(partial(_match, matcher) for matcher in OTHER_MATCHERS[1:]),
    _measure_flow,
)
"""All measurements, the one with the most loops first."""


def _mark() -> Path | None:
    """Return the file that exists once every loop is compiled for this processor; None if machine code is not kept."""
    return FOLDER and FOLDER / f"all-{hashlib.sha256(processor().encode()).hexdigest()[:16]}"


def _is_complete() -> bool:
    mark = _mark()
    return mark is not None and mark.exists()


@cache
def warm() -> None:
    """Run every measurement once per process; those of the pages alone while the other loops are not compiled yet."""
    for part in PARTS if _is_complete() else OF_PAGES:
        part()


@contextmanager
def compiling_the_rest() -> Iterator[None]:
    """Have a process of low priority compile meanwhile the loops that `warm` has left out."""
    if FOLDER is None or _is_complete():
        yield
        return
    with python_process("-m", "stereolag.warming", "rest", stdin=subprocess.DEVNULL):
        yield


def main(asked: Sequence[str]) -> None:
    """Compile the loops of the pages, or all of them, in parallel; the rest one by one, at low priority."""
    parts = OF_PAGES if "pages" in asked else PARTS
    if _is_complete():
        return
    if "rest" in asked:
        if hasattr(os, "nice"):
            os.nice(10)
        compile_alone()
        for part in parts:  # in this process, since others would outlive it
            part()
    else:
        with ProcessPoolExecutor(available_cores(), get_context("spawn"), compile_alone) as processes:
            list(processes.map(operator.call, parts))
    if parts is PARTS and (mark := _mark()):
        with suppress(OSError):  # a full disk
            mark.touch()


if __name__ == "__main__":
    main(sys.argv[1:])
