"""Several sessions at once get the same answers as one after the other."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from pairs import shifted_pair

from stereolag.signals import signal_lag
from stereolag.stereo.methods import PresetName, preset
from stereolag.templates import match_template


@pytest.mark.parametrize("name", ["report", "fast", "accurate"])
def test_matchers_answer_alike_from_many_threads(name: PresetName) -> None:
    matcher = preset(name, num_disparities=16)
    pairs = [shifted_pair(60, 100, 0, -shift, seed=shift) for shift in range(1, 9)]
    alone = [matcher.compute(*pair) for pair in pairs]
    with ThreadPoolExecutor(8) as threads:
        together = list(threads.map(lambda pair: matcher.compute(*pair), pairs))
    for one, other in zip(alone, together, strict=True):
        np.testing.assert_array_equal(one.disparity, other.disparity)
        np.testing.assert_array_equal(one.reason, other.reason)


def test_searches_answer_alike_from_many_threads() -> None:
    sound = np.random.default_rng(0).normal(size=6000)
    picture = shifted_pair(80, 100, 0, 0)[0]

    def measure(lag: int) -> tuple[int, int, int]:
        best = match_template(picture, picture[lag : lag + 20, 30:50]).matches[0]
        return signal_lag(sound[lag:], sound[: sound.size - lag]).lag, best.row, best.col

    with ThreadPoolExecutor(8) as threads:
        assert list(threads.map(measure, range(1, 25))) == [(lag, lag, 30) for lag in range(1, 25)]
