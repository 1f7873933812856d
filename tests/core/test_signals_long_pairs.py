"""Long recordings are judged piece by piece, with the same result as whole ones."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from benchmarks.verdict import common, drifting, noise, tones, unrelated
from stereolag.signals import signal_lag
from stereolag.signals import whitening as long_pairs
from stereolag.signals.search import CentredRecording
from stereolag.signals.verdict import judge
from stereolag.signals.whitening import (
    LongPair,
    add_agreement,
    add_agreement_reference,
    add_energy,
    add_energy_reference,
    whiten,
    whiten_reference,
)


def repeated() -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(0)
    once = np.tile(noise(5000, random), 8)
    return once, once + noise(once.size, random)


def opposite() -> tuple[np.ndarray, np.ndarray]:
    one, other = common(40_000, 100, 1)
    return one, -other


PAIRS: dict[str, Any] = {
    "later": lambda: common(40_000, 3000, 0),
    "earlier": lambda: common(150_000, -3000, 1),
    "unlike lengths": lambda: (common(40_000, -300, 2)[0][:25_000], common(40_000, -300, 2)[1]),
    "nothing in common": lambda: unrelated("different sounds", 40_000, 2),
    "bangs": lambda: unrelated("different sounds", 40_000, 4),
    "a tone": lambda: tones(40_000, 0.0123, 0.1, 1),
    "drift": lambda: drifting(60_000, 700, 50, 0.5, 3),
    "repetition": repeated,
    "opposite": opposite,
}


@pytest.mark.parametrize("name", PAIRS)
def test_the_judgement_is_that_of_the_whole(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(long_pairs, "_PIECE", 2**13)
    one, other = PAIRS[name]()
    found = signal_lag(one, other, max_lag=8000)
    pair = LongPair(CentredRecording(one), CentredRecording(other))
    judged = judge(pair, found.lag, 8000, lags=found.lags, curve=found.correlation)
    assert found.judgement is not None
    for (field, expected), value in zip(
        flat(dataclasses.asdict(found.judgement)), [value for _, value in flat(dataclasses.asdict(judged))], strict=True
    ):
        if isinstance(expected, float):
            assert math.isclose(value, expected, rel_tol=1e-6, abs_tol=1e-9) or (
                math.isnan(value) and math.isnan(expected)
            ), field
        else:
            assert value == expected, field


def flat(values: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    for name, value in values.items():
        if isinstance(value, dict):
            yield from flat(value)
        elif isinstance(value, tuple):
            yield from ((name, each) for each in value)
        else:
            yield name, value


@pytest.mark.parametrize("size", [1, 100, 5000])
@pytest.mark.parametrize("count", [1, 17])
def test_whitening_is_a_convolution(size: int, count: int) -> None:
    samples, taps = np.random.default_rng(0).normal(size=(2, size + count - 1))
    whitened = np.empty(size)
    whiten(samples, taps[:count], whitened)
    np.testing.assert_allclose(whitened, whiten_reference(samples, taps[:count]), atol=1e-12)


@pytest.mark.parametrize("together", [1, 7, 64, 1000])
@pytest.mark.parametrize("cuts", [(), (300,), (1, 64, 65, 448)])
def test_sums_are_the_plain_formula_however_they_are_cut(together: int, cuts: tuple[int, ...]) -> None:
    one, other = np.random.default_rng(1).normal(size=(2, 640))
    sums = np.zeros(9)
    for start, stop in zip((0, *cuts), (*cuts, 640), strict=True):
        add_agreement(one[start:stop], other[start:stop], together, sums)
    np.testing.assert_allclose(sums, add_agreement_reference(one, other, together), atol=1e-9)
    np.testing.assert_allclose(add_energy(one, other), add_energy_reference(one, other))
