"""The verdict on two frames: each kind has its own, and no flow is made of chance."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from pairs import shifted, texture

from stereolag import FlowMap, Reason, optical_flow

ROWS, COLS = 160, 200
Frame = npt.NDArray[np.uint8]


def as_frame(image: npt.ArrayLike, seed: int = 0, noise: float = 0.0) -> Frame:
    random = np.random.default_rng(seed)
    return np.clip(np.rint(image + random.normal(0, noise, np.shape(image))), 0, 255).astype(np.uint8)


def particles(seed: int, move: tuple[float, float] = (0, 0), count: int = 700) -> npt.NDArray[np.float64]:
    """Return bright spots on black, all moved by (dy, dx)."""
    places = np.random.default_rng(seed).uniform((-20, -20), (ROWS + 20, COLS + 20), (count, 2)) + move
    row, col = np.mgrid[:ROWS, :COLS]
    image = np.zeros((ROWS, COLS))
    for y, x in places:
        near = np.s_[max(0, int(y) - 5) : max(0, int(y) + 6), max(0, int(x) - 5) : max(0, int(x) + 6)]
        image[near] += 120 * np.exp(-((row[near] - y) ** 2 + (col[near] - x) ** 2) / 2)
    return image


def screen(seed: int) -> Frame:
    """Return a page of text in boxes."""
    random = np.random.default_rng(seed)
    image = np.full((ROWS, COLS), 240, np.uint8)
    for top in range(14, ROWS, 14):
        letters = "".join(chr(random.integers(97, 122)) if random.random() > 0.2 else " " for _ in range(26))
        cv2.putText(image, letters, (4, top), cv2.FONT_HERSHEY_SIMPLEX, 0.36, 20, 1, cv2.LINE_AA)
    return image


def errors(flow: FlowMap, dy: float, dx: float) -> npt.NDArray[np.float32]:
    return np.hypot(flow.dy - np.float32(dy), flow.dx - np.float32(dx))[flow.valid]


UNRELATED = {
    "photographs": (as_frame(texture(ROWS, COLS, seed=1, blur=2.5)), as_frame(texture(ROWS, COLS, seed=2, blur=1.2))),
    "particles": (as_frame(8 + particles(3), 3, 4), as_frame(8 + particles(4), 4, 4)),
    "texts": (screen(5), screen(6)),
}


@pytest.mark.parametrize("kind", UNRELATED)
def test_frames_without_anything_in_common_have_no_flow_and_none_is_filled_in(kind: str) -> None:
    for filling in (False, True):
        flow = optical_flow(*UNRELATED[kind], search=32, filling=filling)
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


@pytest.mark.parametrize("frame", [screen(1), as_frame(texture(ROWS, COLS))])
def test_identical_frames_do_not_move_at_all(frame: Frame) -> None:
    flow = optical_flow(frame, frame.copy(), search=32)
    assert flow.verdict == "identical" and flow.valid.mean() > 0.2
    assert not np.hypot(flow.dy, flow.dx)[flow.valid].any()
    assert set(np.unique(flow.reason)) <= {Reason.MEASURED, Reason.LOW_TEXTURE}


def test_around_a_small_window_that_moves_a_screen_stands_still_to_the_last_bit() -> None:
    first, second = screen(2), screen(2)
    window = as_frame(texture(40, 50, seed=8))
    first[50:90, 60:110], second[50:90, 72:122] = window, window
    flow = optical_flow(first, second, search=32)
    assert flow.verdict == "related"
    assert np.nanmedian(flow.dx[55:85, 65:105]) == pytest.approx(12, abs=0.05)
    far = np.ones((ROWS, COLS), np.bool_)
    far[10:130, 20:162] = False
    still = np.hypot(flow.dy, flow.dx)[far & flow.valid]
    assert still.size > 1000 and (still == 0).mean() > 0.95


@pytest.mark.parametrize("background", [1.0, 3.0])
def test_before_a_static_background_nothing_is_measured_until_it_is_subtracted(background: float) -> None:
    wall = 60 + 0.7 * (texture(ROWS, COLS, seed=4, blur=background) - 60) / 1.5
    first, second = (as_frame(wall + particles(5, move, 350), seed, 2) for seed, move in ((1, (0, 0)), (2, (3, -5))))
    flow = optical_flow(first, second, search=16)
    assert flow.verdict == "static background"
    assert not flow.valid.any() and (flow.reason == Reason.AMBIGUOUS).mean() > 0.9
    moving = optical_flow(first, second, search=16, subtract_minimum=True)
    assert moving.verdict == "related" and moving.coverage > 0.7
    assert (errors(moving, 3, -5) > 1.5).mean() < 0.05


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


def test_white_noise_that_moved_is_a_picture() -> None:
    first = np.random.default_rng(0).integers(0, 256, (60, 100), dtype=np.uint8)
    flow = optical_flow(first, np.roll(first, -5, axis=1), search=16)
    assert flow.verdict == "related" and flow.coverage > 0.8
