"""``python -m stereolag.warming``: run every measurement once on small inputs, for every type of image and recording.

This compiles loops that were never compiled, keeping their machine code on disk, and loads the others. Later
measurements wait for neither, and the times shown are those of the computation alone.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from stereolag import CorrelationMatcher, SearchArea, match_template, optical_flow, preset, signal_lag
from stereolag.signals.correlation import SHORTEST_BLOCK
from stereolag.stereo.finishing.checks import AmbiguityTest, LeftRightCheck

IMAGE_TYPES = (np.uint8, np.uint16, np.float32, np.float64)


@cache
def warm() -> None:
    """Run every measurement once on small images and recordings; once per process is enough."""
    random = np.random.default_rng(0)
    _warm_recordings(random)
    _warm_templates(random)
    _warm_stereo(random)
    _warm_motion(random)


def _warm_recordings(random: np.random.Generator) -> None:
    sound = random.normal(size=4000)
    signal_lag(sound[200:], sound[:-200], method="fft")
    signal_lag(sound[200:], sound[:-200], method="phat")
    signal_lag(sound[200:], sound[:-200], method="sampled", seed=0)
    signal_lag(sound[200:], sound[:-200], method="direct", max_lag=300)
    long = random.normal(size=4 * SHORTEST_BLOCK)
    signal_lag(long, long, max_lag=30)


def _warm_templates(random: np.random.Generator) -> None:
    for kind in IMAGE_TYPES:
        picture = random.integers(0, 255, (60, 80, 3)).astype(kind)
        template = np.dstack([picture[20:40, 30:50], np.full((20, 20), 255, kind)])
        template[:4, :4, 3] = 0
        for pair in (
            (picture, template),
            (picture, picture[20:40, 30:50]),
            (picture[..., 0], picture[20:40, 30:50, 0]),
        ):
            match_template(*pair, method="fft")
            match_template(*pair, method="sampled", seed=0)


def _warm_stereo(random: np.random.Generator) -> None:
    search = SearchArea.rectified(16)
    matchers = (
        CorrelationMatcher(window_size=7, search=search, engine="window_sums", ambiguity=AmbiguityTest()),
        CorrelationMatcher(window_size=7, search=search, left_right=LeftRightCheck()),
        CorrelationMatcher(window_size=7, overlap=0.5, search=SearchArea.centred(15), engine="window_sums"),
        preset("fast", num_disparities=16),
        preset("accurate", num_disparities=16),
    )
    for kind in IMAGE_TYPES:
        for channels in ((), (3,)):
            left = random.integers(0, 255, (48, 64, *channels)).astype(kind)
            for matcher in matchers:
                matcher.compute(left, np.roll(left, -4, axis=1))


def _warm_motion(random: np.random.Generator) -> None:
    for kind in IMAGE_TYPES:
        first = random.integers(0, 255, (48, 64)).astype(kind)
        optical_flow(first, np.roll(first, 2, axis=1), search=8)


if __name__ == "__main__":
    warm()
