"""The divisor of an 8-bit ground truth is inferred from the pair."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from stereolag import read_disparity, read_image, samples
from stereolag.assess.disparities import DIVISORS, likely_divisor
from stereolag.geometry.rectification import scaled_disparity, scaled_image


def stored(truth: np.ndarray, divisor: int) -> np.ndarray:
    """Return the truth as stored in an 8-bit file, NaN where that is 0: unknown."""
    values = np.rint(truth * divisor)
    return np.where(values == 0, np.nan, values).astype(np.float32)


@pytest.mark.parametrize("divisor", DIVISORS)
def test_whatever_fits_into_8_bits_is_told_on_an_example(divisor: int) -> None:
    example = samples.stereo_pairs()["cube"]
    left, right, truth = read_image(example.left), read_image(example.right), read_disparity(example.disparity)
    # Divisors as large as Tsukuba's 16 are for small images.
    factor = min(1.0, 255 / (divisor * float(np.nanmax(truth))))
    left, right, truth = scaled_image(left, factor), scaled_image(right, factor), scaled_disparity(truth, factor)
    assert likely_divisor(stored(truth, divisor), left, right) == divisor


@pytest.mark.parametrize("name", ["tsukuba", "teddy", "cones", "aloe_half"])
def test_it_is_the_one_its_makers_name(name: str, data_dir: Path) -> None:
    folder = data_dir / "stereo" / name
    left, right, truth = (next(folder.glob(f"{stem}.*")) for stem in ("left", "right", "gt"))
    values = read_disparity(truth, divisor=1)
    meant = json.loads((folder / "calib.json").read_text(encoding="utf-8"))["disparity_divisor"]
    assert likely_divisor(values, read_image(left), read_image(right)) == meant


@pytest.mark.parametrize("side", [4, 40])
def test_where_nothing_can_be_told_it_is_the_smallest(side: int) -> None:
    flat = np.zeros((side, side), np.uint8)
    assert likely_divisor(np.full((side, side), 40.0), flat, flat) == DIVISORS[0]
