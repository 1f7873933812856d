"""Matching by cost volume and semi-global optimisation, on pairs whose shift is known."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from stereolag.progress import silent
from stereolag.stereo.semi_global import matching as semi_global
from stereolag.stereo.semi_global.costs import MatchingCost
from stereolag.stereo.semi_global.matching import VolumeMatches, match_semi_global, strips
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
    """Return the image moved left by any part of a pixel, as 8-bit levels."""
    turn = np.exp(2j * np.pi * np.fft.fftfreq(image.shape[1]) * disparity)
    return np.clip(np.rint(np.fft.ifft(np.fft.fft(image, axis=1) * turn, axis=1).real), 0, 255).astype(np.uint8)


def matched(left: Picture, right: Picture, first: int = 0, count: int = 16) -> VolumeMatches:
    return match_semi_global(
        left,
        right,
        window_size=9,
        min_disparity=first,
        num_disparities=count,
        cost=MatchingCost(),
        optimisation=SemiGlobal(),
        progress=silent,
    )


@pytest.mark.parametrize(("shift", "first"), [(0, -8), (5, 0), (-6, -12), (11, 3)])
def test_a_whole_shift_is_found_everywhere(shift: int, first: int) -> None:
    image = texture(48, 96)
    found = matched(moved(image, 0), moved(image, shift), first)
    inside = (slice(None), slice(20, -20))
    assert (found.dx[inside] == -shift).all()
    assert (found.right_dx[inside] == -shift).all()
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
    assert (found.dx[30:50, 55:75] == -10).mean() > 0.98
    assert (found.dx[:15, 10:] == -3).mean() > 0.98


def test_strips_cover_every_row_once_and_see_beyond() -> None:
    for height in (1, 100, 5000):
        pieces = list(strips(height, 4 * 2**20))
        assert [row for piece in pieces for row in range(piece.first, piece.end)] == list(range(height))
        assert all(piece.bottom - piece.top <= semi_global.MOST_BYTES / (4 * 2**20) for piece in pieces)


def test_strips_give_nearly_what_the_whole_gives(monkeypatch: pytest.MonkeyPatch) -> None:
    image = texture(120, 100)
    left, right = moved(image, 0), moved(image, 5.3)
    whole = matched(left, right)
    monkeypatch.setattr(semi_global, "MOST_BYTES", 100 * 16 * 5 * 80)
    assert len(list(strips(120, 100 * 16 * 5))) > 2
    parts = matched(left, right)
    assert (parts.dx == whole.dx).mean() > 0.99
    assert np.abs(parts.disparity - whole.disparity)[parts.dx == whole.dx].mean() < 0.01


def test_progress_only_grows_and_ends_at_one() -> None:
    image = texture(30, 60)
    told: list[float] = []
    match_semi_global(
        moved(image, 0),
        moved(image, 2),
        window_size=5,
        min_disparity=0,
        num_disparities=8,
        cost=MatchingCost(),
        optimisation=SemiGlobal(),
        progress=told.append,
    )
    assert told == sorted(told) and told[-1] == 1
