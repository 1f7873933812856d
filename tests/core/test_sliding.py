from __future__ import annotations

import numpy as np
import pytest
from numpy.lib.stride_tricks import sliding_window_view

from stereolag import samples
from stereolag.io.recordings import read_signal
from stereolag.signals import by_hand


def sums(slide: by_hand.Slide) -> np.ndarray:
    return sliding_window_view(slide.recording, slide.cut.size) @ slide.cut


def scores(slide: by_hand.Slide) -> np.ndarray:
    windows = sliding_window_view(slide.recording, slide.cut.size)
    return np.array([np.corrcoef(window, slide.cut)[0, 1] for window in windows])


def lags(slide: by_hand.Slide, heights: np.ndarray) -> list[int]:
    """Return the lags with the largest height."""
    return [slide.lag + slide.step * int(place) for place in np.flatnonzero(heights > heights.max() - 1e-6)]


def coast(**changed: int) -> by_hand.Slide:
    example = samples.recordings()["coast"]
    pair = (read_signal(path).channels[0] for path in (example.signal_1, example.signal_2))
    return by_hand.excerpt(*pair, **({"lag": example.lag, "start": 5191, "step": 6} | changed))


def test_seven_numbers_meet_themselves_once_and_nothing_else_comes_near() -> None:
    slide = by_hand.seven_numbers()
    heights = np.sort(sums(slide))
    assert lags(slide, sums(slide)) == lags(slide, scores(slide)) == [8]
    assert heights[-1] == 72 and heights[-2] < 72 / 1.5


def test_the_coast_peaks_at_its_true_lag_alone() -> None:
    slide = coast()
    assert lags(slide, sums(slide)) == lags(slide, scores(slide)) == [50_082]
    assert scores(slide).max() > 0.999
    away = np.abs(np.arange(scores(slide).size) - by_hand.HOME) > 4
    assert scores(slide)[away].max() < 0.3


def test_a_tone_fits_at_every_period() -> None:
    slide = by_hand.tone()
    assert lags(slide, sums(slide)) == list(range(-80, 101, 20))


def test_noise_comes_nowhere_near_a_match() -> None:
    slide = by_hand.noise()
    assert sums(slide).max() < 0.5 * slide.cut @ slide.cut
    assert scores(slide).max() == pytest.approx(0.45, abs=0.005)  # the value in the text beside it


def test_the_loud_stretch_wins_until_it_is_normalised() -> None:
    slide = by_hand.loud_stretch()
    (loudest,) = lags(slide, sums(slide))
    assert loudest > 130
    assert sums(slide).max() > 1.3 * slide.cut @ slide.cut
    assert lags(slide, scores(slide)) == [90]


@pytest.mark.parametrize("changed", [{"step": 7}, {"start": -1}, {"start": 29_390}, {"start": 22_000}])
def test_an_excerpt_that_is_not_there_is_refused(changed: dict[str, int]) -> None:
    with pytest.raises(ValueError, match="lag is 50082" if "step" in changed else "start is"):
        coast(**changed)
