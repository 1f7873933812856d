"""Matching by cost volume and semi-global optimisation, on pairs with a known shift."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from stereolag.core.jobs import silent
from stereolag.core.settings import SettingsError
from stereolag.stereo.finishing.checks import AmbiguityTest, LeftRightCheck
from stereolag.stereo.matcher import Reason
from stereolag.stereo.semi_global import matcher as semi_global
from stereolag.stereo.semi_global.cost_terms import MatchingCost
from stereolag.stereo.semi_global.matcher import SemiGlobalMatcher, VolumeQuery, match_semi_global, strips
from stereolag.stereo.semi_global.paths import SemiGlobal

Picture = npt.NDArray[np.uint8]


def texture(height: int, width: int, seed: int = 0) -> npt.NDArray[np.float64]:
    """Return a smooth random texture that wraps around its sides."""
    rng = np.random.default_rng(seed)
    spectrum = np.fft.fft2(rng.normal(size=(height, width)))
    fy, fx = np.fft.fftfreq(height)[:, None], np.fft.fftfreq(width)
    plain = np.fft.ifft2(spectrum * np.exp(-40 * (fx**2 + fy**2))).real
    return np.asarray(128 + 40 * plain / plain.std())


def moved(image: npt.NDArray[np.float64], disparity: float) -> Picture:
    """Return the image moved left by any fraction of a pixel, as 8-bit levels."""
    turn = np.exp(2j * np.pi * np.fft.fftfreq(image.shape[1]) * disparity)
    return np.clip(np.rint(np.fft.ifft(np.fft.fft(image, axis=1) * turn, axis=1).real), 0, 255).astype(np.uint8)


class Matched(NamedTuple):
    """Disparities of every pixel: rounded to whole px, with the fraction, and from the right view."""

    whole: npt.NDArray[np.int64]
    disparity: npt.NDArray[np.float64]
    from_right: npt.NDArray[np.int64]


def query(left: Picture, right: Picture, first: int = 0, count: int = 16) -> VolumeQuery:
    return VolumeQuery(left, right, 9, first, count, MatchingCost(), SemiGlobal())


def matched(left: Picture, right: Picture, first: int = 0, count: int = 16) -> Matched:
    found = match_semi_global(query(left, right, first, count), silent)
    whole = found.lag.astype(int) + first
    return Matched(whole, whole + found.offset, found.right_lag.astype(int) + first)


@pytest.mark.parametrize(("shift", "first"), [(0, -8), (5, 0), (-6, -12), (11, 3)])
def test_a_whole_shift_is_found_everywhere(shift: int, first: int) -> None:
    image = texture(48, 96)
    found = matched(moved(image, 0), moved(image, shift), first)
    inside = (slice(None), slice(20, -20))
    assert (found.whole[inside] == shift).all()
    assert (found.from_right[inside] == shift).all()
    assert abs(found.disparity[inside].mean() - shift) < 0.02


@pytest.mark.parametrize("fraction", [0.1, 0.25, 0.4, 0.5, 0.6, 0.75, 0.9])
def test_the_mean_error_between_the_lags_is_small(fraction: float) -> None:
    image = texture(100, 200)
    found = matched(moved(image, 0), moved(image, 6 + fraction))
    assert abs(found.disparity[10:-10, 25:-25].mean() - (6 + fraction)) < 0.05


def test_swapping_mirrored_images_gives_the_mirrored_map() -> None:
    image = texture(40, 90)
    left, right = moved(image, 0), moved(image, 4.3)
    found, other = matched(left, right), matched(right[:, ::-1].copy(), left[:, ::-1].copy())
    assert abs(found.disparity[:, 25:-25].mean() - other.disparity[:, 25:-25].mean()) < 0.03


def test_a_square_before_a_wall_and_what_it_hides() -> None:
    rng = np.random.default_rng(1)
    wall = cv2.GaussianBlur(rng.integers(0, 256, (80, 150), dtype=np.uint8), (0, 0), 1)
    square = cv2.GaussianBlur(rng.integers(0, 256, (30, 30), dtype=np.uint8), (0, 0), 1)
    left, right = wall[:, :120].copy(), wall[:, 3:123].copy()
    left[25:55, 50:80], right[25:55, 40:70] = square, square
    found = matched(left, right)
    assert (found.whole[30:50, 55:75] == 10).mean() > 0.98
    assert (found.whole[:15, 10:] == 3).mean() > 0.98


def test_strips_cover_every_row_once_and_see_beyond() -> None:
    for height in (1, 100, 5000):
        pieces = list(strips(height, 4 * 2**20))
        assert [row for piece in pieces for row in range(piece.first, piece.end)] == list(range(height))
        assert all(piece.bottom - piece.top <= semi_global.MOST_BYTES / (4 * 2**20) for piece in pieces)


def test_strips_give_nearly_what_the_whole_gives(monkeypatch: pytest.MonkeyPatch) -> None:
    image = texture(120, 100)
    left, right = moved(image, 0), moved(image, 5.3)
    whole = matched(left, right)
    monkeypatch.setattr(semi_global, "MOST_BYTES", 100 * 16 * 3 * 80)
    assert len(list(strips(120, 100 * 16 * 3))) > 2
    parts = matched(left, right)
    assert (parts.whole == whole.whole).mean() > 0.99
    assert np.abs(parts.disparity - whole.disparity)[parts.whole == whole.whole].mean() < 0.01


def test_progress_only_grows_and_ends_at_one() -> None:
    image = texture(30, 60)
    told: list[float] = []
    match_semi_global(query(moved(image, 0), moved(image, 2)), told.append)
    assert told == sorted(told) and told[-1] == 1


@pytest.mark.parametrize("size", [4, 10, 254])
def test_a_window_without_a_middle_is_refused(size: int) -> None:
    with pytest.raises(SettingsError, match=f"window_size is {size}; allowed are odd sizes"):
        SemiGlobalMatcher(window_size=size)


def test_weights_that_are_all_nothing_are_refused() -> None:
    *others, last = MatchingCost.weights()
    with pytest.raises(
        SettingsError, match=f"{', '.join(others)} and {last} add up to 0; allowed are 1 to 250 together"
    ):
        MatchingCost(**dict.fromkeys(MatchingCost.weights(), 0))


WEIGHTS = [(100, 100, 40), (100, 0, 0), (0, 100, 0), (0, 0, 50), (3, 0, 0)]


@pytest.mark.parametrize("weights", WEIGHTS)
def test_the_score_lies_between_none_and_all_of_the_weights_in_use(weights: tuple[int, int, int]) -> None:
    """It used to reach -0.23, and 1 without any weight, because it was computed from weights that were not in use."""
    cost = MatchingCost(**dict(zip(("correlation", "census", "gradient"), weights, strict=True)))
    matcher = SemiGlobalMatcher(num_disparities=16, window_size=5, cost=cost)
    noise = np.random.default_rng(0).integers(0, 256, (2, 40, 70), dtype=np.uint8)
    unrelated = matcher.compute(*noise).score
    same = matcher.compute(noise[0], noise[0]).score
    for score in (unrelated, same):
        assert score.min() >= 0 and score.max() <= 1
    inside = np.s_[6:-6, 22:-6]
    assert np.median(same[inside]) > 0.98
    assert np.median(unrelated[inside]) < 0.9


def test_the_same_share_of_the_weights_scores_alike() -> None:
    left, right = moved(texture(40, 90), 0), moved(texture(40, 90), 4)
    half, whole = (
        SemiGlobalMatcher(
            num_disparities=16,
            cost=MatchingCost(correlation=50 * k, census=50 * k, gradient=20 * k),
            optimisation=SemiGlobal(penalty_small=12 * k, penalty_large=200 * k, penalty_at_edges=40 * k),
        )
        .compute(left, right)
        .score
        for k in (1, 2)
    )
    np.testing.assert_allclose(half, whole, atol=0.01)


def test_the_checks_of_the_matcher_give_their_reasons() -> None:
    noise = np.random.default_rng(0).integers(0, 256, (2, 40, 90), dtype=np.uint8)
    matcher = SemiGlobalMatcher(num_disparities=16, left_right=LeftRightCheck())
    assert (matcher.compute(*noise).reason == Reason.LEFT_RIGHT).mean() > 0.2
    matcher = SemiGlobalMatcher(num_disparities=16, ambiguity=AmbiguityTest(lead=0.5))
    assert (matcher.compute(*noise).reason == Reason.AMBIGUOUS).mean() > 0.5
    bare = noise[0].copy()
    bare[:, 30:60] = 90
    reason = SemiGlobalMatcher(num_disparities=16).compute(bare, bare).reason
    assert (reason[:, 35:55] == Reason.LOW_TEXTURE).all()


def test_a_window_larger_than_the_images_is_named() -> None:
    with pytest.raises(ValueError, match="window_size is 9 px and the images are 40 × 8"):
        SemiGlobalMatcher().compute(*np.zeros((2, 8, 40), np.uint8))
