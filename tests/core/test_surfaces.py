"""Gaps filled as slanted surfaces."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from scenes import steps_pair

import stereolag as sl
from stereolag.stereo.finishing.filling import filled_from_behind
from stereolag.stereo.finishing.surfaces import (
    TRIALS,
    Samples,
    SurfaceFilling,
    best_of_trials,
    borders,
    filled_along_surfaces,
    fitted,
    neighbours,
    refitted,
    refitted_reference,
    sampled,
    superpixels,
)
from stereolag.stereo.matcher import Reason

FloatMap = npt.NDArray[np.float32]
NAN = np.float32(np.nan)


def filled(disparity: FloatMap, guide: npt.NDArray[np.uint8]) -> FloatMap:
    reason = np.where(np.isnan(disparity), np.uint8(Reason.LEFT_RIGHT), np.uint8(Reason.MEASURED))
    return filled_along_surfaces(disparity, filled_from_behind(disparity, reason)[0], guide, SurfaceFilling())


def painted(shape: tuple[int, int], seed: int = 0) -> npt.NDArray[np.uint8]:
    return np.random.default_rng(seed).integers(90, 110, (*shape, 3), dtype=np.uint8)


def test_samples_are_spread_evenly_over_a_patch() -> None:
    labels = np.repeat([[0, 1]], 40, axis=0).astype(np.int32)
    values = np.arange(80, dtype=np.float32).reshape(40, 2)
    values[5:, 1] = np.nan
    points, kept, counts = sampled(labels, values, 3, 8)
    np.testing.assert_array_equal(counts, [40, 5, 0])
    np.testing.assert_array_equal(kept, [8, 5, 0])
    np.testing.assert_array_equal(points[0], [[0] * 8, np.arange(0, 40, 5), np.arange(0, 80, 10)])
    np.testing.assert_array_equal(points[1, 2, :5], [1, 3, 5, 7, 9])


@pytest.mark.parametrize("seed", range(4))
def test_planes_are_fitted_as_by_the_formula(seed: int) -> None:
    rng = np.random.default_rng(seed)
    patches = superpixels(rng.integers(0, 255, (3, 60, 80)).astype(np.float32), 15, 30)
    y, x = np.indices((60, 80))
    values = (20 + 0.05 * x - 0.1 * y + rng.normal(0, 1, (60, 80))).astype(np.float32)
    gaps = (rng.random((60, 80)) < 0.5) & (x > 40)
    count = len(patches.centres)
    measured = Samples(*sampled(patches.labels, np.where(gaps, NAN, values), count, 32))
    guessed = Samples(*sampled(patches.labels, np.where(gaps, values + np.float32(1), NAN), count, 16))
    at = np.ascontiguousarray(patches.centres[:, -2:])
    joins, near = borders(patches.labels, patches.grid), neighbours(patches.grid)
    planes = best_of_trials(*guessed[:2], at, TRIALS)
    assert 0 < np.isnan(planes[:, 2]).sum() < count
    again = refitted(planes, *measured, *guessed, joins, near, at)
    np.testing.assert_allclose(
        again, refitted_reference(planes, measured, guessed, joins, near, at), rtol=1e-3, atol=2e-4
    )


def test_a_trial_plane_ignores_what_lies_elsewhere() -> None:
    rng = np.random.default_rng(0)
    x, y = rng.uniform(0, 30, (2, 1, 60)).astype(np.float32)
    z = 10 + 0.2 * x - 0.1 * y
    z[0, ::5] += 25
    found = best_of_trials(
        np.stack([x, y, z], axis=1), np.array([60], np.int32), np.array([[15, 15]], np.float32), TRIALS
    )
    np.testing.assert_allclose(found, [[0.2, -0.1, 11.5]], atol=0.01)


def test_patches_of_fewer_than_three_guesses_have_no_plane_and_all_others_have() -> None:
    patches = superpixels(np.full((1, 40, 60), 50, np.float32), 15, 20)
    values = np.full((40, 60), 6, np.float32)
    guesses = np.full((40, 60), NAN)
    guesses[:, :20] = 6
    count = len(patches.centres)
    guessed = Samples(*sampled(patches.labels, guesses, count, 16))
    planes = fitted(patches, Samples(*sampled(patches.labels, values, count, 32)), guessed)
    np.testing.assert_array_equal(np.isnan(planes[:, 2]), guessed.kept < 3)
    np.testing.assert_allclose(
        planes[guessed.kept >= 3], np.tile([[0, 0, 6]], ((guessed.kept >= 3).sum(), 1)), atol=1e-3
    )


@pytest.mark.parametrize("channels", [None, 1, 3])
@pytest.mark.parametrize(("across", "down"), [(0.0, 0.0), (0.0, 0.1), (0.04, 0.1), (-0.05, -0.03)])
def test_a_hole_in_a_plane_continues_it(across: float, down: float, channels: int | None) -> None:
    y, x = np.indices((150, 200), np.float32)
    plane = 30 + across * x + down * y
    noisy = plane + np.random.default_rng(0).normal(0, 0.1, plane.shape)
    noisy[40:110, 60:110] = np.nan
    guide = painted((150, 200))
    guide = guide[:, :, 0] if channels is None else np.ascontiguousarray(guide[:, :, :channels])
    found = filled(noisy.astype(np.float32), guide)
    assert np.abs(found - plane)[40:110, 60:110].max() < 0.5
    np.testing.assert_array_equal(found[:40], noisy[:40].astype(np.float32))


def test_an_empty_road_is_filled_smoothly_where_rows_make_stripes() -> None:
    y, _ = np.indices((160, 240), np.float32)
    road = 5 + 0.3 * y
    rng = np.random.default_rng(0)
    noisy = (road + rng.normal(0, 0.4, road.shape)).astype(np.float32)
    # As far down a road, few pixels are measured, and some of them wrongly.
    noisy[rng.random(road.shape) < 0.02] += 9
    noisy[:, 40:210][rng.random((160, 170)) < 0.97] = np.nan
    found = filled(noisy, painted(road.shape))
    gaps = np.isnan(noisy)
    assert np.mean(np.abs(found - road)[gaps] > 1) < 0.02
    reason = np.full(road.shape, Reason.LEFT_RIGHT, np.uint8)
    along_rows = filled_from_behind(noisy, reason)[0]
    assert np.abs(found - road)[gaps].mean() < 0.75 * np.abs(along_rows - road)[gaps].mean()


def test_what_is_hidden_behind_a_box_is_the_wall_and_not_the_box() -> None:
    disparity = np.full((120, 200), 8, np.float32)
    guide = painted((120, 200))
    disparity[30:90, 90:150] = 25
    guide[30:90, 90:150] //= 2
    disparity[30:90, 73:90] = np.nan
    found = filled(disparity, guide)
    np.testing.assert_allclose(found[30:90, 73:90], 8, atol=0.3)


def test_a_map_without_measurements_or_without_gaps_stays_as_it_is() -> None:
    guide = painted((30, 40))
    for value in (NAN, np.float32(3)):
        disparity = np.full((30, 40), value)
        np.testing.assert_array_equal(filled_along_surfaces(disparity, disparity, guide, SurfaceFilling()), disparity)


@pytest.mark.parametrize("shape", [(1, 9), (9, 1), (3, 5), (17, 8)])
def test_small_maps_are_filled_too(shape: tuple[int, int]) -> None:
    disparity = np.full(shape, 4, np.float32)
    disparity.flat[1:3] = np.nan
    np.testing.assert_allclose(filled(disparity, np.zeros(shape, np.uint8)), 4, atol=1e-3)


def test_nothing_is_filled_beyond_what_was_measured() -> None:
    rng = np.random.default_rng(3)
    disparity = np.where(rng.random((80, 90)) < 0.8, NAN, rng.uniform(0, 60, (80, 90))).astype(np.float32)
    found = filled(disparity, rng.integers(0, 255, (80, 90, 3), dtype=np.uint8))
    assert np.isfinite(found).all()
    assert np.nanmin(disparity) <= found.min() and found.max() <= np.nanmax(disparity)


def test_alpha_of_sixteen_bits_changes_nothing() -> None:
    left, right, _ = steps_pair(noise=2.0)
    colours = [np.repeat(one[:, :, None].astype(np.uint16) * 16, 3, axis=2) for one in (left, right)]
    opaque = [np.dstack([one, np.full(one.shape[:2], 65535, np.uint16)]) for one in colours]
    matcher = sl.preset("accurate", num_disparities=32)
    maps = [matcher.compute(*pair).disparity for pair in (colours, opaque)]
    np.testing.assert_array_equal(maps[0], maps[1])
