"""The loops behind the curves of two recordings, checked against their formulas."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereolag.signals.correlation import (
    cross_spectrum,
    cross_spectrum_reference,
    running_sums,
    running_sums_reference,
    sliding_pearson,
    turn_back,
    turn_back_reference,
    turn_forth,
    turn_forth_reference,
    weighted_pearson,
    weighted_pearson_reference,
)


def spectra(seed: int) -> tuple[np.ndarray, np.ndarray]:
    first, second = (np.random.default_rng(seed).normal(size=(2, 2, 40)).transpose(0, 2, 1)) @ [1, 1j]
    return first, second


@given(st.integers(0, 99), st.integers(2, 60))
def test_running_sums_are_those_of_the_formula(seed: int, size: int) -> None:
    signal = np.random.default_rng(seed).normal(size=size)
    for found, plain in zip(running_sums(signal), running_sums_reference(signal), strict=True):
        np.testing.assert_allclose(found, plain, atol=1e-12)


@given(st.integers(0, 99), st.integers(1, 40), st.integers(-30, 0), st.integers(0, 9))
def test_turning_and_crossing_are_those_of_the_formula(seed: int, size: int, first: int, last: int) -> None:
    one, other = spectra(seed)
    signal, turned = one.real[:size].copy(), np.empty(40, np.complex128)
    turn_forth(signal, other, turned)
    np.testing.assert_allclose(turned, turn_forth_reference(signal, other))
    np.testing.assert_allclose(turn_back(one, other, first, last), turn_back_reference(one, other, first, last))
    plain = cross_spectrum_reference(one, other)
    np.testing.assert_allclose(cross_spectrum(one, other), plain)


@pytest.mark.parametrize("sizes", [(60, 60), (20, 75), (75, 20)])
def test_both_ways_to_the_weighted_correlation_are_the_formula(sizes: tuple[int, int]) -> None:
    random = np.random.default_rng(4)
    first, second = (signal - signal.mean() for signal in (random.normal(size=size) for size in sizes))
    second[: sizes[1] // 3] = second[0]
    lags = np.arange(1 - sizes[0], sizes[1])
    curve = np.empty(lags.size)
    sliding_pearson(first, second, int(lags[0]), curve)
    plain = weighted_pearson_reference(first, second, lags)
    np.testing.assert_allclose(curve, plain, atol=1e-9)
    products = np.correlate(second, first, "full")[sizes[0] - 1 :]
    weighted_pearson(products, 0, *running_sums(first), *running_sums(second))
    np.testing.assert_allclose(products, plain[lags >= 0], atol=1e-9)
