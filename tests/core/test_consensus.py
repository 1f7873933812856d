"""The agreement of maps, checked against direct counts."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from stereolag.stereo.evaluation import consensus

NAN = np.nan


@pytest.mark.parametrize(
    ("answers", "agreeing"),
    [
        ((10.0, 10.9, 10.5), 3),
        ((10.0, 11.0, 12.0), 2),
        ((10.0, 20.0, 30.0), 1),
        ((10.0, NAN, 10.2), 2),
        ((NAN, 5.0, NAN), 1),
        ((NAN, NAN, NAN), 0),
    ],
)
def test_the_largest_group_is_counted(answers: tuple[float, ...], agreeing: int) -> None:
    maps = [np.full((2, 3), answer, np.float32) for answer in answers]
    np.testing.assert_array_equal(consensus(maps), np.full((2, 3), agreeing))


@given(arrays.arrays(np.float32, (4, 2, 2), elements=st.one_of(st.just(NAN), st.floats(0, 6, width=16))))
def test_it_equals_the_count_around_each_answer_in_any_order(maps: np.ndarray) -> None:
    found = consensus(list(maps))
    for row, col in np.ndindex(2, 2):
        answers = maps[:, row, col]
        groups = [int(((answers >= one) & (answers <= one + 1)).sum()) for one in answers]
        assert found[row, col] == max(groups)
    np.testing.assert_array_equal(consensus(list(maps[::-1])), found)


def test_maps_of_different_size_are_refused() -> None:
    with pytest.raises(ValueError, match="same size"):
        consensus([np.zeros((2, 2), np.float32), np.zeros((2, 3), np.float32)])
    with pytest.raises(ValueError, match="one or more"):
        consensus([])
