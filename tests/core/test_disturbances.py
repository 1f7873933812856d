from __future__ import annotations

from itertools import combinations

import numpy as np

from stereolag import signal_lag
from stereolag.signals import by_hand
from stereolag.signals.by_hand import Ingredients, ingredients


def arrays(parts: Ingredients) -> dict[str, np.ndarray]:
    return {name: getattr(parts, name) for name in ("fresh", "pattern", "noise_1", "noise_2")}


def test_the_same_is_mixed_each_time() -> None:
    first, second = arrays(ingredients()), arrays(ingredients())
    for name, values in first.items():
        assert values.dtype == np.int8
        np.testing.assert_array_equal(values, second[name])
        assert abs(values.std() / by_hand.UNIT - 1) < 0.06
        assert np.mean(np.abs(values) == 127) < 1e-4  # hardly anything is clipped


def test_sensor_2_hears_the_sound_from_the_first_sample_to_the_last() -> None:
    parts = ingredients()
    earliest = by_hand.LAG + by_hand.ECHO_DELAY + by_hand.MOST_DRIFT
    assert earliest < by_hand.BEFORE
    assert parts.fresh.size == by_hand.SETTLING + by_hand.BEFORE + by_hand.SAMPLES
    assert by_hand.SOFTNESS**by_hand.SETTLING < 1e-15
    assert by_hand.LAG + by_hand.ECHO_DELAY < by_hand.MAX_LAG


def test_nothing_in_it_resembles_anything_else() -> None:
    for one, other in combinations(arrays(ingredients()).values(), 2):
        assert signal_lag(one, other).verdict == "nothing"
