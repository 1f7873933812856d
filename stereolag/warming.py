"""``python -m stereolag.warming``: run every measurement once on small inputs, for every type of image and recording.

This compiles loops that were never compiled, keeping their machine code on disk, and loads the others. Later
measurements wait for neither, and the times shown are those of the computation alone.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from stereolag import CorrelationMatcher, SearchArea, match_template, optical_flow, preset, signal_lag
from stereolag.signals.correlation import SHORTEST_BLOCK
from stereolag.stereo.finishing.stages import AmbiguityTest, LeftRightCheck

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
    preset("fast", num_disparities=16),
    preset("accurate", num_disparities=16),
)


@cache
def warm() -> None:
    """Run every measurement once on small images and recordings; once per process is enough."""
    random = np.random.default_rng(0)
    sound, long = random.normal(size=4000), random.normal(size=4 * SHORTEST_BLOCK)
    for settings in LAG_METHODS:
        signal_lag(sound[200:], sound[:-200], **settings)
    signal_lag(long, long, max_lag=30)
    for kind in IMAGE_TYPES:
        picture = random.integers(0, 255, (60, 80, 3)).astype(kind)
        grey, part = picture[..., 0], picture[20:40, 30:50]
        masked = np.dstack([part, np.full(part.shape[:2], 255, kind)])
        masked[:4, :4, 3] = 0
        for image, template in ((picture, masked), (picture, part), (grey, part[..., 0])):
            match_template(image, template, method="fft")
            match_template(image, template, method="sampled", seed=0)
        for left in (grey, picture):
            for matcher in MATCHERS:
                matcher.compute(left, np.roll(left, -4, axis=1))
        optical_flow(grey, np.roll(grey, 2, axis=1), search=8)


if __name__ == "__main__":
    warm()
