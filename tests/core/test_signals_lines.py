"""The line by medians, compared with SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.stats
from hypothesis import given
from hypothesis import strategies as st

from stereolag.signals.verdict import median_line

POINTS = st.lists(
    st.tuples(st.integers(-1_000, 1_000), st.integers(-(10**6), 10**6)),
    min_size=3,
    max_size=30,
    unique_by=lambda one: one,
)


@given(POINTS.filter(lambda points: len({place for place, _ in points}) > 2))
def test_it_is_the_line_of_scipy(points: list[tuple[int, int]]) -> None:
    places, values = np.array(points, dtype=np.float64).T
    wanted = scipy.stats.theilslopes(values, places)
    assert median_line(places, values) == pytest.approx((wanted.slope, wanted.intercept), rel=1e-9, abs=1e-9)
