from __future__ import annotations

from itertools import combinations

import numpy as np

from stereolag import signal_lag
from stereolag.figures import disturbances
from stereolag.figures.disturbances import Ingredients, ingredients


def arrays(parts: Ingredients) -> dict[str, np.ndarray]:
    return {name: getattr(parts, name) for name in ("fresh", "pattern", "noise_1", "noise_2")}


def test_the_same_is_mixed_each_time() -> None:
    first, second = arrays(ingredients()), arrays(ingredients())
    for name, values in first.items():
        assert values.dtype == np.int8
        np.testing.assert_array_equal(values, second[name])
        assert abs(values.std() / disturbances.UNIT - 1) < 0.06
        assert np.mean(np.abs(values) == 127) < 1e-4  # hardly anything is clipped


def test_sensor_2_hears_the_sound_from_the_first_sample_to_the_last() -> None:
    parts = ingredients()
    earliest = disturbances.LAG + disturbances.ECHO_DELAY + disturbances.MOST_DRIFT
    assert earliest < disturbances.BEFORE
    assert parts.fresh.size == disturbances.SETTLING + disturbances.BEFORE + disturbances.SAMPLES
    assert disturbances.SOFTNESS**disturbances.SETTLING < 1e-15
    assert disturbances.LAG + disturbances.ECHO_DELAY < disturbances.MAX_LAG


def test_nothing_in_it_resembles_anything_else() -> None:
    for one, other in combinations(arrays(ingredients()).values(), 2):
        assert signal_lag(one, other).verdict == "nothing"
