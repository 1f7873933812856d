"""Checks, filters and filling of a map, each compared with its plain formula."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pairs import shifted_pair, steps_pair
from scipy import ndimage

import stereolag as sl
from stereolag import CorrelationMatcher, Reason, SearchArea
from stereolag.core.arrays import EightBit, FloatMap
from stereolag.core.inputs import local_deviation
from stereolag.stereo.finishing import stages, surfaces
from stereolag.stereo.finishing.filling import fill_between_ends_reference, filled_from_behind, filled_from_ends


@given(st.integers(0, 99), st.integers(0, 3))
def test_the_check_is_that_of_the_definition(seed: int, tolerance: int) -> None:
    rng = np.random.default_rng(seed)
    dx, right = rng.integers(-5, 6, (2, 4, 9)).astype(np.int16)
    right[rng.random(right.shape) < 0.1] = -32768  # no match
    found = stages.left_right_disagree(dx, right, tolerance)
    np.testing.assert_array_equal(found, stages.left_right_disagree_reference(dx, right, tolerance))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64])
@pytest.mark.parametrize("size", [3, 4, 9])
def test_the_local_deviation_is_that_of_the_window_and_a_flat_one_has_none(dtype: type, size: int) -> None:
    image = (np.random.default_rng(0).random((30, 40)) * 200).astype(dtype)
    image[5:25, 5:25] = image[0, 0]
    before, after = size // 2, size - 1 - size // 2
    framed = np.pad(image.astype(np.float64), (before, after), mode="reflect")
    plain = np.lib.stride_tricks.sliding_window_view(framed, (size, size)).std(axis=(2, 3))
    found = local_deviation(image, size)
    np.testing.assert_allclose(found, plain, atol=1e-9)
    assert not found[10:20, 10:20].any()


def test_a_large_offset_hides_no_deviation() -> None:
    faint = np.random.default_rng(0).normal(0, 0.01, (30, 40))
    np.testing.assert_allclose(local_deviation(faint + 1e6, 5), local_deviation(faint, 5), rtol=1e-5)
    assert not local_deviation(np.full((9, 9), 1e6 + 1 / 3), 5).any()


@pytest.mark.parametrize(("dtype", "scale"), [(np.uint16, 1), (np.uint16, 4), (np.uint16, 16), (np.float32, 12)])
def test_empty_bits_do_not_take_the_texture_away(dtype: type, scale: int) -> None:
    """Cameras of 10 and 12 bits leave the upper bits of 16 empty."""
    faint = np.linspace(0, 0.3, 160)
    left, right = (np.rint(128 + (image - 128.0) * faint).astype(np.uint8) for image in shifted_pair(90, 160, 0, -9))
    left[:8], right[:8] = 255, 0
    matcher = CorrelationMatcher(search=SearchArea.centred(24), texture=stages.TextureTest(least=8.0))
    plain = matcher.compute(left, right).reason == Reason.LOW_TEXTURE
    one, other = (image.astype(dtype) * dtype(scale) for image in (left, right))
    assert 0.2 < plain.mean() < 0.8
    same = plain == (matcher.compute(one, other).reason == Reason.LOW_TEXTURE)
    assert same.mean() > 0.98


NAN = np.float32(np.nan)


def measured(disparity: FloatMap) -> EightBit:
    return np.where(np.isfinite(disparity), Reason.MEASURED, Reason.LEFT_RIGHT).astype(np.uint8)


def filled(disparity: FloatMap, guide: EightBit) -> FloatMap:
    return surfaces.filled_along_surfaces(disparity, gaps_filled(disparity), guide, surfaces.SurfaceFilling())


def gaps_filled(disparity: FloatMap) -> FloatMap:
    return filled_from_behind(disparity, measured(disparity))[0]


@settings(max_examples=20)
@given(
    seed=st.integers(0, 99),
    reach=st.integers(1, 2),
    spacing=st.integers(1, 3),
    channels=st.sampled_from([1, 3]),
    contrast=st.integers(1, 255),
    cols=st.integers(9, 40),
    spread=st.sampled_from([125, 900]),
    missing=st.sampled_from([0.3, 1.0]),
)
def test_the_weighted_median_is_that_of_the_definition(seed, reach, spacing, channels, contrast, cols, spread, missing):
    rng = np.random.default_rng(seed)
    values = (rng.integers(-8 * spread, 8 * spread, (9, cols)) / 8).astype(np.float32)
    values[rng.random((9, cols)) < missing] = np.nan
    values[2] = np.nan
    guide = rng.integers(0, 256, (9, cols, channels), dtype=np.uint8)
    radius = reach * spacing
    found = stages.weighted_median(values, guide, radius, spacing, contrast)
    np.testing.assert_array_equal(found, stages.weighted_median_reference(values, guide, radius, spacing, contrast))


@given(
    seed=st.integers(0, 99),
    rows=st.integers(1, 40),
    cols=st.integers(1, 40),
    size=st.sampled_from([1, 2, 5, 30, 200]),
    difference=st.sampled_from([0.06, 0.5, 2.0]),
    smooth=st.integers(0, 2),
)
def test_speckles_are_opencvs(seed: int, rows: int, cols: int, size: int, difference: float, smooth: int) -> None:
    rng = np.random.default_rng(seed)
    disparity = (ndimage.gaussian_filter(rng.normal(size=(rows, cols)), smooth) * 9).astype(np.float32)
    disparity[rng.random((rows, cols)) < 0.2] = np.nan
    kept, reason = stages.without_speckles(
        disparity, measured(disparity), stages.SpeckleFilter(size=size, difference=difference)
    )
    small = stages.speckles_reference(disparity, size, difference)
    np.testing.assert_array_equal(kept, np.where(small, NAN, disparity))
    np.testing.assert_array_equal(reason, np.where(small, Reason.SPECKLE, measured(disparity)))


def test_a_gap_takes_the_farther_end_and_an_empty_row_the_nearest_that_is_not() -> None:
    gaps = np.array([[NAN, 4, NAN, NAN, 9, NAN]], np.float32)
    np.testing.assert_array_equal(gaps_filled(gaps), [[4, 4, 4, 4, 9, 9]])
    disparity = np.full((7, 3), NAN)
    empty, reason = filled_from_behind(disparity, measured(disparity))
    assert np.isnan(empty).all() and (reason == Reason.LEFT_RIGHT).all()
    disparity[2], disparity[5] = 1, 2
    full, reason = filled_from_behind(disparity, measured(disparity))
    np.testing.assert_array_equal(full[:, 0], [1, 1, 1, 1, 2, 2, 2])
    np.testing.assert_array_equal(reason == Reason.FILLED, np.isnan(disparity))
    for value in (NAN, np.float32(3)):
        whole = np.full((30, 40), value)
        np.testing.assert_array_equal(
            surfaces.filled_along_surfaces(whole, whole, painted((30, 40)), surfaces.SurfaceFilling()), whole
        )


@given(st.integers(0, 999), st.floats(0, 0.9), st.integers(1, 9))
def test_rows_are_filled_as_by_the_formula(seed: int, gaps: float, length: int) -> None:
    rng = np.random.default_rng(seed)
    disparity = (rng.normal(0, 2, (30, 60)) + rng.uniform(-0.1, 0.1) * np.arange(60)).astype(np.float32)
    disparity[np.repeat(rng.random((30, 60)) < gaps / length, length, axis=1)[:, :60]] = np.nan
    disparity[: rng.integers(0, 30), : rng.integers(0, 12)] = np.nan
    filled, reason = filled_from_ends(disparity, np.zeros(disparity.shape, np.uint8))
    np.testing.assert_allclose(filled, fill_between_ends_reference(disparity), rtol=0, atol=1e-4)
    np.testing.assert_array_equal(reason == Reason.FILLED, np.isnan(disparity))


def test_a_wall_goes_on_beyond_what_the_right_camera_sees_level_if_ragged_and_no_farther_than_measured() -> None:
    y, x = np.indices((60, 120), np.float32)
    wall, nothing = 20 - 0.06 * x + 0.02 * y, np.zeros(x.shape, np.uint8)
    seen = np.where(x < 30, NAN, wall).astype(np.float32)
    np.testing.assert_allclose(filled_from_behind(seen, nothing)[0][:, :30], wall[:, :30], atol=0.04)
    receding = np.where(x < 60, NAN, 0.05 * (x - 58)).astype(np.float32)
    assert filled_from_behind(receding, nothing)[0].min() == np.nanmin(receding)
    ragged = np.where((x < 30) | (np.random.default_rng(0).random(x.shape) < 0.3), NAN, 20 - 0.06 * x)
    ragged[:, 30] = 18.2
    level = filled_from_behind(ragged.astype(np.float32), nothing)[0][:, :30]
    assert (np.ptp(level, axis=1) == 0).all()
    assert (np.abs(level - 18.05) < 0.2).all()


@settings(max_examples=30)
@given(st.integers(0, 999), st.sampled_from([1, 3]), st.integers(1, 30), st.integers(1, 40), st.integers(3, 12))
def test_pixels_choose_as_by_the_formula(seed: int, channels: int, height: int, width: int, side: int) -> None:
    rng = np.random.default_rng(seed)
    planes = rng.integers(0, 255, (channels, height, width)).astype(np.float32)
    grid = max(1, round(height / side)), max(1, round(width / side))
    count = grid[0] * grid[1]
    places = rng.uniform(0, height, count), rng.uniform(0, width, count)
    centres = np.column_stack([*rng.integers(0, 255, (channels, count)), *places]).astype(np.float32)
    weights = np.float32(0.001), np.float32(1 / side**2)
    labels = np.full((height, width), -1, np.int32)
    surfaces.choose_patches(planes, centres, grid, weights, 0, grid[0], labels)
    np.testing.assert_array_equal(labels, surfaces.choose_patches_reference(planes, centres, grid, weights))
    after = surfaces.mean_centres(planes, labels, centres)
    for patch in range(count):
        inside = labels == patch
        rows, cols = np.nonzero(inside)
        mean = [*planes[:, inside].mean(axis=1), rows.mean(), cols.mean()] if inside.any() else centres[patch]
        np.testing.assert_allclose(after[patch], mean, rtol=1e-5)


@pytest.mark.parametrize("shape", [(1, 9), (3, 50), (40, 2), (33, 47)])
def test_any_size_is_cut_and_filled(shape: tuple[int, int]) -> None:
    found = surfaces.superpixels(np.zeros((3, *shape), np.float32), 15, 20)
    assert found.labels.shape == shape
    assert set(np.unique(found.labels)) <= set(range(found.grid[0] * found.grid[1]))
    assert np.isfinite(found.centres).all()
    disparity = np.full(shape, 4, np.float32)
    disparity.flat[1:3] = np.nan
    np.testing.assert_allclose(filled(disparity, np.zeros(shape, np.uint8)), 4, atol=1e-3)


def test_borders_are_those_counted() -> None:
    rng = np.random.default_rng(0)
    found = surfaces.superpixels(rng.integers(0, 255, (3, 60, 80)).astype(np.float32), 10, 10)
    labels, near = found.labels, surfaces.neighbours(found.grid)
    long = surfaces.borders(labels, found.grid)
    beside = (labels[:, 1:], labels[:, :-1]), (labels[1:], labels[:-1])
    pairs = np.concatenate([np.stack([one.ravel(), other.ravel()]) for one, other in beside], axis=1)
    # Patches that touch are at most three apart on the grid: the loop has no room for more, and needs none.
    for patch in range(len(near)):
        for number, other in enumerate(near[patch]):
            if other != patch:
                met = ((pairs == [[patch], [other]]).all(axis=0) | (pairs == [[other], [patch]]).all(axis=0)).sum()
                assert long[patch, number, 0] == met
    assert long[:, :, 0].sum() == 2 * (pairs[0] != pairs[1]).sum()


def painted(shape: tuple[int, int], seed: int = 0) -> EightBit:
    return np.random.default_rng(seed).integers(90, 110, (*shape, 3), dtype=np.uint8)


@pytest.mark.parametrize("seed", range(4))
def test_planes_are_fitted_as_by_the_formula(seed: int) -> None:
    rng = np.random.default_rng(seed)
    patches = surfaces.superpixels(rng.integers(0, 255, (3, 60, 80)).astype(np.float32), 15, 30)
    y, x = np.indices((60, 80))
    values = (20 + 0.05 * x - 0.1 * y + rng.normal(0, 1, (60, 80))).astype(np.float32)
    gaps = (rng.random((60, 80)) < 0.5) & (x > 40)
    count = len(patches.centres)
    measured = surfaces.Samples(*surfaces.sampled(patches.labels, np.where(gaps, NAN, values), count, 32))
    guessed = surfaces.Samples(
        *surfaces.sampled(patches.labels, np.where(gaps, values + np.float32(1), NAN), count, 16)
    )
    at = np.ascontiguousarray(patches.centres[:, -2:])
    joins, near = surfaces.borders(patches.labels, patches.grid), surfaces.neighbours(patches.grid)
    planes = surfaces.best_of_trials(*guessed[:2], at, surfaces.trials())
    assert 0 < np.isnan(planes[:, 2]).sum() < count
    again = surfaces.refitted(planes, measured, guessed, joins, near, at)
    np.testing.assert_allclose(
        again, surfaces.refitted_reference(planes, measured, guessed, joins, near, at), rtol=1e-3, atol=2e-4
    )


@pytest.mark.parametrize(
    ("across", "down", "channels"), [(0.0, 0.0, None), (0.0, 0.1, 1), (0.04, 0.1, 3), (-0.05, -0.03, 3)]
)
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
    assert np.nanmin(noisy) <= found.min() and found.max() <= np.nanmax(noisy)
    gaps = np.isnan(noisy)
    assert np.mean(np.abs(found - road)[gaps] > 1) < 0.02
    assert np.abs(found - road)[gaps].mean() < 0.75 * np.abs(gaps_filled(noisy) - road)[gaps].mean()


def test_alpha_of_sixteen_bits_changes_nothing() -> None:
    left, right, _ = steps_pair(noise=2.0)
    colours = [np.repeat(one[:, :, None].astype(np.uint16) * 16, 3, axis=2) for one in (left, right)]
    opaque = [np.dstack([one, np.full(one.shape[:2], 65535, np.uint16)]) for one in colours]
    matcher = sl.preset("accurate", num_disparities=32)
    maps = [matcher.compute(*pair).disparity for pair in (colours, opaque)]
    np.testing.assert_array_equal(maps[0], maps[1])
