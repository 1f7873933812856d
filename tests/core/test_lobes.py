"""The lobe of a peak, compared with another library's reconstruction, and on hills of known shape."""

from __future__ import annotations

import numpy as np
import pytest
from skimage.morphology import reconstruction

from stereolag.assess.explaining import lobe, passes


@pytest.mark.parametrize("shape", [(1, 64), (21, 33)])
def test_the_passes_are_those_of_a_reconstruction_from_the_peak(shape: tuple[int, int]) -> None:
    scores = np.random.default_rng(4).normal(size=shape)
    peak = divmod(int(np.argmax(scores)), shape[1])
    seed = np.full(shape, scores.min())
    seed[peak] = scores[peak]
    expected = reconstruction(seed, scores, footprint=np.ones((3, 3)))
    np.testing.assert_array_equal(passes(scores, peak), expected)


def test_every_tooth_of_a_comb_is_a_hill_of_its_own_and_a_ripple_is_not() -> None:
    along = np.arange(64)
    comb = np.cos((along - 26) * 2 * np.pi / 14.5)[None]
    own = lobe(comb, passes(comb, (0, 26)), 0.03)[0]
    assert own[20:33].all()
    assert not own[[12, 40, 41, 55]].any()
    rippled = (1 - np.abs(along - 26) / 40 + 0.01 * np.cos(along * np.pi))[None]
    assert lobe(rippled, passes(rippled, (0, 26)), 0.03).all()


def test_a_place_beyond_a_gap_lies_outside_and_beyond_the_border_inside_if_the_search_wraps() -> None:
    scores = np.array([[1.0, 0.9, 0.5, np.nan, 0.7, 0.8]])
    assert lobe(scores, passes(scores, (0, 0)), 0.03).tolist() == [[True, True, True, False, False, False]]
    around = lobe(scores, passes(scores, (0, 0), wrapped=True), 0.03)
    assert around.tolist() == [[True, True, True, False, True, True]]
