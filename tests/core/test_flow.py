"""Optical flow: known motions, signs, types, refusals, another program's answer, and the verdict on two frames."""

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pairs import shifted, shifted_pair, texture

from benchmarks.flow_kinds import (
    COLS,
    ROWS,
    before_a_background,
    noisy,
    openpiv,
    other_particles,
    other_photographs,
    other_screens,
    particles,
    screen,
)
from stereolag import FlowMap, Reason, optical_flow
from stereolag.motion.candidates import Candidates, best_of_neighbours, best_of_neighbours_reference, match_level
from stereolag.motion.evidence import unambiguous
from stereolag.motion.flow import FlowMatcher
from stereolag.motion.levels import Frame as Level
from stereolag.motion.levels import (
    edge_aware_mean,
    edge_aware_mean_reference,
    median_residual,
    median_residual_reference,
)

Frame = npt.NDArray[np.uint8]


def as_frame(image: npt.ArrayLike, seed: int = 0, noise: float = 0.0) -> Frame:
    return noisy(np.random.default_rng(seed), image, noise)


def middle(values, margin=40):
    return values[margin:-margin, margin:-margin]


@pytest.mark.parametrize(
    ("dtype", "dy", "dx"),
    [(np.uint8, 0, 0), (np.uint8, -25, 31), (np.uint16, 0, 9), (np.float32, -6, 0), (np.float64, 4.3, -11.6)],
)
def test_recovers_a_known_shift(dtype, dy, dx):
    first, second = shifted_pair(150, 190, dy, dx, dtype=dtype)
    flow = optical_flow(first, second, search=32)
    assert np.isfinite(middle(flow.dx)).mean() > 0.98
    assert abs(np.nanmedian(middle(flow.dy)) - dy) < 0.025
    assert abs(np.nanmedian(middle(flow.dx)) - dx) < 0.025
    assert np.nanpercentile(np.hypot(middle(flow.dy) - dy, middle(flow.dx) - dx), 99) < 0.25


@pytest.mark.parametrize(
    ("settings", "shape", "move"), [({"window_size": 31}, (48, 140), (-12, 60)), ({"levels": 1}, (320, 64), (124, -9))]
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
    monkeypatch.setattr("stereolag.motion.candidates.MAX_LAGS", most)
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


def test_agrees_with_openpiv_on_particles():
    first, second, truth = particles(np.random.default_rng(12))
    vectors, places, _ = openpiv(first, second)
    flow = optical_flow(first, second, window_size=15, search=16)
    found, true = (motion[:, *places] for motion in (np.stack([flow.dy, flow.dx]), truth))
    assert np.nanmedian(np.abs(found - vectors)) < 0.1
    assert np.nanmedian(np.abs(found - true)) < 0.05


@given(st.integers(1, 4), st.integers(0, 2**32 - 1))
@settings(max_examples=25)
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


def test_what_is_refused_is_named():
    image = texture(30, 40).astype(np.uint8)
    for second, changes, message in (
        (image[:, :30], {}, "first is 40 × 30 and second is 30 × 30"),
        (image, {"window_size": 31}, "window_size is 31 px and the images are 40 × 30"),
        (image, {"window_size": 8}, "window_size is 8; allowed are odd sizes"),
        (image, {"serach": 8}, "serach"),
        (image, {"search": 0}, "search is 0"),
    ):
        with pytest.raises(ValueError, match=message):
            optical_flow(image, second, **changes)


# The verdict


def errors(flow: FlowMap, dy: npt.ArrayLike, dx: npt.ArrayLike) -> npt.NDArray[np.float32]:
    return np.hypot(flow.dy - np.float32(dy), flow.dx - np.float32(dx))[flow.valid]


@pytest.mark.parametrize("kind", [other_photographs, other_particles, other_screens], ids=lambda kind: kind.__name__)
def test_frames_without_anything_in_common_have_no_flow_and_none_is_filled_in(kind):
    first, second, _ = kind(np.random.default_rng(1))
    for filling in (False, True):
        flow = optical_flow(first, second, search=32, filling=filling)
        assert flow.verdict == "unrelated" and not flow.valid.any() and np.isnan(flow.score).all()
        assert (flow.reason == Reason.AMBIGUOUS).mean() > 0.2


@pytest.mark.parametrize("level", [0, 128])
@pytest.mark.parametrize("noise", [0.0, 4.0])
def test_a_blank_frame_has_no_flow_on_either_side_with_or_without_noise(level: int, noise: float) -> None:
    picture, blank = as_frame(texture(ROWS, COLS, blur=1.5)), as_frame(np.full((ROWS, COLS), level), 9, noise)
    for pair in ((picture, blank), (blank, picture), (blank, as_frame(np.full((ROWS, COLS), level), 10, noise))):
        flow = optical_flow(*pair, search=16)
        assert flow.verdict == "blank" and not flow.valid.any()
        assert (flow.reason == Reason.LOW_TEXTURE).mean() > 0.5


@pytest.mark.parametrize("frame", [screen(np.random.default_rng(1)), as_frame(texture(ROWS, COLS))])
def test_identical_frames_do_not_move_at_all_and_a_flat_part_has_low_texture(frame: Frame) -> None:
    frame = frame.copy()
    frame[30:80, 50:110] = 90
    flow = optical_flow(frame, frame.copy(), search=32)
    assert flow.verdict == "identical" and flow.valid.mean() > 0.2
    assert not np.hypot(flow.dy, flow.dx)[flow.valid].any()
    assert set(np.unique(flow.reason)) <= {Reason.MEASURED, Reason.LOW_TEXTURE}
    assert (flow.reason[34:76, 54:106] == Reason.LOW_TEXTURE).all()


def test_around_a_small_window_that_moves_a_screen_stands_still_to_the_last_bit() -> None:
    first, second = (screen(np.random.default_rng(2)) for _ in range(2))
    window = as_frame(texture(40, 50, seed=8))
    first[50:90, 60:110], second[50:90, 72:122] = window, window
    flow = optical_flow(first, second, search=32)
    assert flow.verdict == "related"
    assert np.nanmedian(flow.dx[55:85, 65:105]) == pytest.approx(12, abs=0.05)
    far = np.ones((ROWS, COLS), np.bool_)
    far[10:130, 20:162] = False
    still = np.hypot(flow.dy, flow.dx)[far & flow.valid]
    assert still.size > 1000 and (still == 0).mean() > 0.95


@pytest.mark.parametrize("seed", [1, 2])
def test_before_a_static_background_nothing_is_measured_until_it_is_subtracted(seed: int) -> None:
    first, second, truth = before_a_background(np.random.default_rng(seed))
    flow = optical_flow(first, second, search=16)
    assert flow.verdict == "static background"
    assert not flow.valid.any() and (flow.reason == Reason.AMBIGUOUS).mean() > 0.9
    moving = optical_flow(first, second, search=16, subtract_minimum=True)
    assert moving.verdict == "related" and moving.coverage > 0.7
    assert (errors(moving, *truth) > 1.5).mean() < 0.05


@pytest.mark.parametrize("change", ["noise", "darker", "JPEG", "low light"])
def test_frames_of_one_scene_remain_related(change: str) -> None:
    scene = texture(ROWS, COLS, seed=6, blur=2)
    frames = [scene, shifted(scene, 2.5, -6)]
    if change == "noise":
        frames = [as_frame(one, seed, 12) for seed, one in enumerate(frames)]
    elif change == "darker":
        frames = [as_frame(frames[0]), as_frame(0.6 * frames[1] + 20)]
    elif change == "JPEG":
        frames = [cv2.imdecode(cv2.imencode(".jpg", as_frame(one), [1, 40])[1], 0) for one in frames]
    else:
        frames = [as_frame(0.15 * one, seed, 2.5) for seed, one in enumerate(frames)]
    flow = optical_flow(*frames, search=16)
    assert flow.verdict == "related" and flow.coverage > 0.8
    assert (errors(flow, 2.5, -6) > 1.5).mean() < 0.02


def test_the_half_of_a_frame_that_is_exchanged_has_next_to_no_flow() -> None:
    scene = texture(ROWS, 2 * COLS, seed=7, blur=1.5)
    second = shifted(scene, 2, 3)
    second[:, COLS:] = texture(ROWS, 2 * COLS, seed=8, blur=1.5)[:, COLS:]
    flow = optical_flow(as_frame(scene), as_frame(second), search=16)
    assert flow.verdict == "related"
    assert flow.valid[:, 8 : COLS - 10].mean() > 0.9 and flow.valid[:, COLS + 50 :].mean() < 0.05
    assert np.median(errors(flow, 2, 3)) < 0.1


ROW, COL = np.mgrid[:ROWS, :COLS]


@pytest.mark.parametrize(
    ("scene", "verdict"),
    [
        (100 + 0.3 * ROW, "blank"),
        (220 - (ROW - ROWS / 2) ** 2 / 240 - (COL - COLS / 2) ** 2 / 240, "related"),
        (128 + 60 * np.sin(0.4 * ROW + 0.2 * COL), "related"),
    ],
    ids=["slope", "vignette", "stripes"],
)
def test_noise_is_no_motion_of_what_is_smooth_or_striped(scene: npt.NDArray[np.float64], verdict: str) -> None:
    flow = optical_flow(as_frame(scene, 1, 2), as_frame(scene, 2, 2), search=32)
    assert flow.verdict == verdict and flow.coverage < 0.05


def wall(tile: int) -> npt.NDArray[np.float64]:
    """Return a wall of different bricks, one pattern of which repeats after `tile` px."""
    return np.tile(texture(tile, tile, seed=11, blur=1.5), (-(-ROWS // tile), -(-COLS // tile)))[:ROWS, :COLS]


def test_a_pattern_that_repeats_within_reach_has_no_motion_and_beyond_it_one() -> None:
    first, second = (as_frame(np.roll(wall(28), (0, dx), (0, 1)), dx, 2) for dx in (0, 6))
    flow = optical_flow(first, second, search=48)
    assert flow.verdict == "related" and flow.coverage < 0.05
    assert (flow.reason == Reason.AMBIGUOUS).mean() > 0.9
    flow = optical_flow(first, second, search=16)
    assert flow.coverage > 0.8 and np.median(errors(flow, 0, 6)) < 0.1


def test_a_pattern_that_goes_on_in_its_surroundings_moves_as_they_do() -> None:
    scene = texture(ROWS, COLS, seed=12, blur=1.5)
    scene[:, :150] = wall(28)[:, :150]
    flow = optical_flow(as_frame(scene, 1, 2), as_frame(np.roll(scene, 6, axis=1), 2, 2), search=48)
    assert flow.valid[20:-20, 20:130].mean() > 0.8 and np.median(errors(flow, 0, 6)) < 0.1


def test_a_pattern_goes_on_no_farther_than_to_a_jump_of_its_motion() -> None:
    scene = texture(ROWS, COLS, seed=12, blur=1.5)
    scene[:, 80:] = wall(28)[:, 80:]
    pyramids = [Level(one, one, 1.0).pyramid(3) for one in map(as_frame, (scene, shifted(scene, 0, 6)))]
    flow = np.zeros((2, ROWS, COLS), np.float32)
    flow[1] = np.where(COL < 180, 6, 6 - 28)
    kept = unambiguous(*pyramids, flow, np.ones((ROWS, COLS), np.bool_), 48)[20:-20]
    assert kept[:, 20:160].mean() > 0.9 and kept[:, 200:-20].mean() < 0.1


def test_white_noise_that_moved_is_a_picture() -> None:
    first = np.random.default_rng(0).integers(0, 256, (60, 100), dtype=np.uint8)
    flow = optical_flow(first, np.roll(first, -5, axis=1), search=16)
    assert flow.verdict == "related" and flow.coverage > 0.8
