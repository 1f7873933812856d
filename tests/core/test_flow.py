"""Optical flow: known motions, signs, types, refusals, and another program's answer."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from openpiv import pyprocess
from pairs import shifted_pair, texture

from stereolag import Reason, optical_flow
from stereolag.motion.candidates import (
    Candidates,
    best_of_neighbours,
    best_of_neighbours_reference,
    match_level,
)
from stereolag.motion.flow import FlowMatcher
from stereolag.motion.levels import (
    edge_aware_mean,
    edge_aware_mean_reference,
    median_residual,
    median_residual_reference,
    return_error,
)


def middle(values, margin=40):
    return values[margin:-margin, margin:-margin]


@pytest.mark.parametrize(
    ("dtype", "dy", "dx"),
    [
        (np.uint8, 0, 0),
        (np.uint8, -25, 31),
        (np.uint16, 0, 9),
        (np.float32, -6, 0),
        (np.float64, 4.3, -11.6),
    ],
)
def test_recovers_a_known_shift(dtype, dy, dx):
    first, second = shifted_pair(150, 190, dy, dx, dtype=dtype)
    flow = optical_flow(first, second, search=48)
    assert np.isfinite(middle(flow.dx)).mean() > 0.98
    assert abs(np.nanmedian(middle(flow.dy)) - dy) < 0.025
    assert abs(np.nanmedian(middle(flow.dx)) - dx) < 0.025
    assert np.nanpercentile(np.hypot(middle(flow.dy) - dy, middle(flow.dx) - dx), 99) < 0.25


@pytest.mark.parametrize(
    ("settings", "shape", "move"),
    [({"window_size": 31}, (48, 140), (-12, 60)), ({"levels": 1}, (320, 64), (124, -9))],
)
def test_a_search_at_full_size_may_hold_any_number_of_lags(settings, shape, move):
    """The second move is only in the second strip of lags; a long, narrow frame has as many lags at less cost."""
    first, second = shifted_pair(*shape, *move)
    flow = optical_flow(first, second, **settings)
    margin = flow.settings.window_size // 2
    (top, left), (bottom, right) = np.maximum(0, np.negative(move)), np.minimum(shape, np.subtract(shape, move))
    seen = np.s_[top + margin : bottom - margin, left + margin : right - margin]
    assert np.isfinite(flow.dx[seen]).mean() > 0.9
    assert abs(np.nanmedian(flow.dy[seen]) - move[0]) < 0.02
    assert abs(np.nanmedian(flow.dx[seen]) - move[1]) < 0.02


@pytest.mark.parametrize("most", [51, 80, 200])
def test_lags_tried_in_strips_answer_as_all_at_once(most, monkeypatch):
    first, second = shifted_pair(60, 70, 2.4, -3.3)
    second[20:30] = first[20:30]  # a part that has not moved
    first[40:50], second[40:50] = 9, 9
    whole = match_level(first, second, None, 7, 8)
    monkeypatch.setattr("stereolag.motion.candidates.MOST_LAGS", most)
    for one, other in zip(match_level(first, second, None, 7, 8), whole, strict=True):
        np.testing.assert_allclose(one, other, atol=2e-6)


@pytest.mark.parametrize("dtype", [np.uint8, np.float32])
@pytest.mark.parametrize(("window", "reach"), [(7, 1), (3, 2)])
def test_what_is_left_of_a_motion_is_found_as_by_the_general_search(dtype, window, reach):
    first, second = shifted_pair(60, 70, 0.6, -0.8, dtype=dtype)
    first[20:30, 10:20], second[20:30, 30:45] = 7, 9
    near, general = (
        match_level(first, second, flow, window, reach) for flow in (np.zeros((2, 60, 70), np.float32), None)
    )
    # Two lags may fit a small window alike, to a rounding.
    assert (np.abs(near.flow - general.flow) < 1e-3).mean() > 0.999
    np.testing.assert_allclose(near.score, general.score, atol=2e-6)
    np.testing.assert_array_equal(near.texture, general.texture)


@pytest.mark.parametrize("shape", [(40, 150), (151, 67), (9, 200), (7, 7)])
def test_any_size_as_large_as_the_window_gives_a_map(shape):
    first, second = shifted_pair(*shape, 0, 1)
    flow = optical_flow(first, second, search=5)
    assert flow.dy.shape == flow.dx.shape == flow.score.shape == flow.reason.shape == shape
    assert flow.dx.dtype == flow.dy.dtype == flow.score.dtype == np.float32
    if min(shape) > 20:
        assert abs(np.nanmedian(flow.dx) - 1) < 0.02


def test_every_pixel_without_motion_has_a_reason_and_filling_leaves_none():
    first, second = shifted_pair(100, 140, 0, 12)
    told = []
    flow = optical_flow(first, second, search=20, progress=told.append)
    assert told[-1] == 1 and told == sorted(told)
    assert flow.settings == FlowMatcher(search=20) and flow.elapsed_s > 0
    with pytest.raises(ValueError, match="read-only"):
        flow.dx[0, 0] = 1
    np.testing.assert_array_equal(flow.valid, flow.reason == Reason.MEASURED)
    np.testing.assert_array_equal(flow.valid, np.isfinite(flow.dy))
    np.testing.assert_array_equal(flow.valid, np.isfinite(flow.score))
    # These pixels moved out of the frame on the right.
    assert not flow.valid[:, -8:].any()
    filled = optical_flow(first, second, search=20, filling=True)
    assert filled.valid.all() and filled.coverage == 1
    np.testing.assert_array_equal(filled.filled, ~flow.valid)
    np.testing.assert_array_equal(filled.dx[flow.valid], flow.dx[flow.valid])
    assert np.abs(filled.dx[:, -8:] - 12).mean() < 1


def test_a_flat_part_has_low_texture():
    first, second = (image.copy() for image in shifted_pair(120, 160, 0, 0))
    for image in (first, second):
        image[30:80, 50:110] = 90
    flow = optical_flow(first, second, search=10)
    assert (flow.reason[34:76, 54:106] == Reason.LOW_TEXTURE).all()
    assert not (flow.reason[:, :40] == Reason.LOW_TEXTURE).any()
    everywhere = optical_flow(np.full((60, 80), 7, np.uint8), np.full((60, 80), 7, np.uint8), search=10)
    assert (everywhere.reason == Reason.LOW_TEXTURE).all() and not everywhere.valid.any()


def test_what_is_covered_in_the_second_frame_is_not_measured():
    first = texture(140, 200, seed=3, blur=1.5)
    second, patch = first.copy(), texture(80, 80, seed=8, blur=1.5)
    first[30:110, 40:120] = patch
    second[30:110, 55:135] = patch
    flow = optical_flow(first, second, search=32)
    covered, around = flow.reason[40:100, 121:134], flow.reason[40:100, 50:110]
    assert (covered != Reason.MEASURED).mean() > 0.55
    assert (covered == Reason.LEFT_RIGHT).mean() > 0.2
    assert (around == Reason.LEFT_RIGHT).mean() < 0.1
    assert abs(np.nanmedian(flow.dx[40:100, 50:110]) - 15) < 0.05
    assert abs(np.nanmedian(flow.dx[:20])) < 0.05


def test_a_growing_picture_has_a_growing_flow():
    first = texture(180, 240, seed=6, blur=1.5)
    scale, angle = 1.06, np.deg2rad(2)
    row, col = np.mgrid[:180, :240].astype(np.float32)
    y, x = row - 90, col - 120
    # The pixel at p in the first frame is at centre + scale * rotated(p - centre) in the second one.
    true_dy = scale * (np.cos(angle) * y + np.sin(angle) * x) - y
    true_dx = scale * (np.cos(angle) * x - np.sin(angle) * y) - x
    back_y, back_x = (np.cos(angle) * y - np.sin(angle) * x) / scale, (np.cos(angle) * x + np.sin(angle) * y) / scale
    second = cv2.remap(first, (back_x + 120).astype(np.float32), (back_y + 90).astype(np.float32), cv2.INTER_CUBIC)
    flow = optical_flow(first, second, search=16)
    error = np.hypot(flow.dy - true_dy, flow.dx - true_dx)[10:-10, 10:-10]
    assert np.isfinite(error).mean() > 0.9
    assert np.nanmean(error) < 0.1


def particles(rows, cols, move, *, count=1500):
    rng = np.random.default_rng(11)
    places = rng.uniform((-20, -20), (rows + 20, cols + 20), (count, 2))
    row, col = np.mgrid[:rows, :cols]
    frames = []
    for dy, dx in ((0.0, 0.0), move):
        image = np.zeros((rows, cols))
        for y, x in places + np.array([dy, dx]):
            near = np.s_[max(0, int(y) - 5) : max(0, int(y) + 6), max(0, int(x) - 5) : max(0, int(x) + 6)]
            image[near] += 180 * np.exp(-((row[near] - y) ** 2 + (col[near] - x) ** 2) / 2)
        frames.append(np.clip(image + rng.normal(8, 3, image.shape), 0, 255).astype(np.uint8))
    return frames


def test_agrees_with_openpiv_on_particles():
    move = 2.3, -4.6
    first, second = particles(160, 192, move)
    frames = first.astype(np.int32), second.astype(np.int32)
    u, v, _ = pyprocess.extended_search_area_piv(*frames, window_size=32, overlap=16, search_area_size=48)
    flow = optical_flow(first, second, window_size=15, search=16)
    found = [np.nanmedian(middle(part, 24)) for part in (flow.dy, flow.dx)]
    np.testing.assert_allclose(found, [np.median(v), np.median(u)], atol=0.1)
    np.testing.assert_allclose(found, move, atol=0.05)


def test_the_median_test_finds_planted_outliers_and_nothing_else():
    row, col = np.mgrid[:60, :80].astype(np.float32)
    flow = np.stack([0.05 * row, 3 - 0.02 * col])
    flow += np.random.default_rng(2).normal(0, 0.05, flow.shape).astype(np.float32)
    planted = np.zeros(flow.shape[1:], np.bool_)
    planted[7::13, 5::13] = True
    flow[:, planted] += np.array([[2.0], [-3.0]], np.float32)
    found = median_residual(flow, 3, 0.1) > 3
    assert found[planted].all()
    assert found[~planted].mean() < 0.01


@given(st.integers(1, 4), st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None)
def test_every_loop_equals_its_formula(spacing, seed):
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(spacing + 1, 30, 2))
    flow = rng.normal(size=(2, *shape)).astype(np.float32).round(1)
    expected = median_residual_reference(flow, spacing, 0.1)
    np.testing.assert_allclose(median_residual(flow, spacing, 0.1), expected, rtol=1e-4, atol=1e-5)
    score, weight = rng.normal(size=shape).astype(np.float32), rng.uniform(0.1, 1, shape).astype(np.float32)
    candidates = Candidates(flow, score, weight)
    best, expected = (one(candidates, spacing) for one in (best_of_neighbours, best_of_neighbours_reference))
    np.testing.assert_array_equal(best.score, expected.score)
    np.testing.assert_array_equal(best.flow, expected.flow)
    guide = rng.integers(0, 40, shape).astype(np.uint8)
    expected = edge_aware_mean_reference(flow, weight, guide)
    np.testing.assert_allclose(edge_aware_mean(flow, weight, guide), expected, atol=2e-4)


def test_the_mean_fills_from_the_same_side_of_an_edge():
    flow = np.zeros((2, 30, 60), np.float32)
    flow[1, :, 30:] = 10
    guide = np.where(np.arange(60) < 30, 20, 220).astype(np.uint8) * np.ones((30, 1), np.uint8)
    weight = np.ones((30, 60), np.float32)
    weight[:, 25:30] = 0
    flow[1, :, 25:30] = 99
    filled = edge_aware_mean(flow, weight, guide)
    assert np.abs(filled[1, :, :30]).max() < 0.1
    assert np.abs(filled[1, :, 30:] - 10).max() < 0.1


def test_the_way_back_of_a_shift_ends_where_it_began():
    flow = np.broadcast_to(np.array([2.0, -3.5], np.float32)[:, None, None], (2, 30, 40)).copy()
    error = return_error(flow, -flow)
    assert error[:27, 4:].max() < 1e-5
    assert (error[:, :3] > 100).all()
    assert abs(return_error(flow, -flow + np.float32(1))[5:20, 10:30] - np.sqrt(2)).max() < 1e-5


def test_what_is_refused_is_named():
    image = texture(30, 40).astype(np.uint8)
    for second, changes, message in (
        (image[:, :30], {}, "first is 40 × 30 and second is 30 × 30"),
        (image.astype(np.float64), {}, "first holds uint8 and second float64"),
        (image, {"window_size": 31}, "window_size is 31 px and the images are 40 × 30"),
        (image, {"window_size": 8}, "window_size is 8; it must be odd"),
        (image, {"serach": 8}, "serach"),
        (image, {"search": 0}, "search is 0"),
    ):
        with pytest.raises(ValueError, match=message):
            optical_flow(image, second, **changes)
