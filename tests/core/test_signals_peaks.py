"""The peak of a curve: ties, main lobe, fractions of a sample; and the loops behind the curves against plain NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from stereolag.signals.correlation import (
    REACH,
    cross_spectrum,
    find_peak,
    main_lobe,
    peak_ratio,
    refine_peak,
    turn_back,
    turn_forth,
)


def peak_of(values: list[float], first_lag: int) -> tuple[int, int]:
    lags = np.arange(first_lag, first_lag + len(values))
    index, ties = find_peak(np.array(values), lags, np.ones_like)
    return int(lags[index]), ties


@pytest.mark.parametrize(
    ("values", "first_lag", "expected"),
    [
        ([0.1, 0.9, 0.2, 0.5, 0.1], -2, (-1, 1)),
        ([0.9, 0.1, 0.2, 0.9, 0.1], -2, (1, 2)),
        ([0.9, 0.1, 0.2, 0.1, 0.9], -2, (2, 2)),
        ([0.1, 0.9, 0.9 + 1e-12, 0.1], 5, (7, 1)),
        ([-0.5, 0.0, -0.2, -0.9], 0, (2, 1)),
        ([0.0, 0.0, 0.0], -1, (0, 1)),
    ],
)
def test_of_equal_peaks_the_smallest_lag_wins(values: list[float], first_lag: int, expected: tuple[int, int]) -> None:
    assert peak_of(values, first_lag) == expected


def test_the_main_lobe_goes_down_to_half_the_peak_and_on_to_the_next_minimum() -> None:
    curve = np.array([0.3, 0.1, 0.2, 0.7, 0.6, 0.8, 1.0, 0.7, 0.75, 0.4, 0.3, 0.35, 0.2])
    assert main_lobe(curve, 6) == (1, 11)
    assert peak_ratio(curve, 6) == pytest.approx(1.0 / 0.35)
    assert main_lobe(curve, 0) == (0, 2)


def test_a_peak_without_rivals_has_no_finite_ratio() -> None:
    assert peak_ratio(np.array([-0.2, -0.3, 1.0, -0.4, -0.1]), 2) == float("inf")
    assert np.isnan(peak_ratio(np.array([0.5, 1.0, 0.5]), 1))
    assert np.isnan(peak_ratio(np.array([-0.5, -0.1, -0.5]), 1))


@pytest.mark.parametrize(("band", "error"), [(1.0, 0.012), (0.95, 0.001), (0.5, 0.001), (0.1, 0.001)])
def test_a_band_limited_peak_is_found_between_the_samples(band: float, error: float) -> None:
    samples = np.arange(-REACH, REACH + 1)
    for offset in np.linspace(-0.49, 0.49, 29):
        assert refine_peak(np.sinc(band * (samples - offset))) == pytest.approx(offset, abs=error)


def test_a_peak_on_the_border_has_no_fraction() -> None:
    assert refine_peak(np.array([0.7])) == 0.0


def test_turning_back_puts_the_imaginary_parts_before_the_real_ones() -> None:
    random = np.random.default_rng(5)
    products, turn = (random.normal(size=(2, 40)).T @ [1, 1j] for _ in range(2))
    turned = products * turn.conj()
    expected = np.concatenate((turned.imag[-30:], turned.real[:21]))
    np.testing.assert_allclose(turn_back(products, turn, -30, 20), expected)
    np.testing.assert_allclose(turn_back(products, turn, 0, 0), turned.real[:1])


def test_turning_forth_and_crossing_are_plain_products() -> None:
    random = np.random.default_rng(6)
    turn, other = (random.normal(size=(2, 40)).T @ [1, 1j] for _ in range(2))
    signal, turned = random.normal(size=25), np.empty(40, dtype=np.complex128)
    turn_forth(signal, turn, turned)
    np.testing.assert_allclose(turned, np.pad(signal, (0, 15)) * turn)
    expected = turned.conj() * other
    np.testing.assert_allclose(cross_spectrum(turned, other), expected)
