"""Maps steadied by the previous frame: less flicker, no smearing, no delay, and reproducible to the bit."""

import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from pairs import texture
from small_drives import Counting, contents, matched, rows_of, write_frames

from stereolag import DisparityMap, Reason, StereoBM, StereoSGBM, preset
from stereolag.core.arrays import EightBit, FloatMap
from stereolag.core.settings import SettingsError
from stereolag.io.disparities import kitti_png
from stereolag.sequences import SequenceSettings, SequenceState, Steadiness, StereoSequence, open_sequence, run_sequence
from stereolag.sequences.frames import FrameTask, encoded_frame, match_frame
from stereolag.sequences.motion import motion_since, steadied

ROWS, COLS, FRAMES = 96, 160, 6
BEHIND, BEFORE = 4, 11
"""Disparities of the wall and of the square in front of it, px."""

STEADY = SequenceSettings(steadiness=Steadiness())

METHODS = {
    "fast": preset("fast", num_disparities=16),
    "accurate": preset("accurate", num_disparities=16),
    "bm": StereoBM(num_disparities=16, block_size=9),
    "sgbm": StereoSGBM(num_disparities=16),
}


def scene(number: int, *, step: int) -> tuple[EightBit, EightBit, FloatMap]:
    """Return a wall and a square that moves by `step` px per frame, with camera noise, and the disparity."""
    wall, square = (texture(ROWS, COLS + 32, seed=seed, blur=1.5) for seed in (0, 1))
    start, random = 30 + step * number, np.random.default_rng(100 + number)
    left, right = wall[:, :COLS].copy(), wall[:, BEHIND : COLS + BEHIND].copy()
    left[30:70, start : start + 40] = square[30:70, :40]
    right[30:70, start - BEFORE : start - BEFORE + 40] = square[30:70, :40]
    truth = np.full((ROWS, COLS), BEHIND, np.float32)
    truth[30:70, start : start + 40] = BEFORE
    seen = [np.clip(np.rint(one + random.normal(0, 2, one.shape)), 0, 255).astype(np.uint8) for one in (left, right)]
    return seen[0], seen[1], truth


def drive(folder: Path, *, step: int, count: int = FRAMES) -> StereoSequence:
    left, right, truth = write_frames(folder, (scene(number, step=step) for number in range(count)))
    return open_sequence(left, right, truth=truth)


def mean_of(out: Path, column: str, method: str) -> float:
    return float(np.mean([float(row[column]) for row in rows_of(out) if row["method"] == method and row[column]]))


def made(disparity: FloatMap, reason: Reason | EightBit = Reason.MEASURED) -> DisparityMap:
    reasons = np.broadcast_to(np.asarray(reason, np.uint8), disparity.shape).copy()
    return DisparityMap(disparity.copy(), reasons, None, None, 0.0, METHODS["bm"])


@pytest.mark.parametrize("step", [0, 7])
def test_every_method_flickers_less_and_errs_no_more(tmp_path: Path, step: int) -> None:
    sequence = drive(tmp_path / "drive", step=step)
    run_sequence(sequence, METHODS, tmp_path / "alone")
    run_sequence(sequence, METHODS, tmp_path / "steady", settings=STEADY)
    for method in METHODS:
        figures = {
            column: (mean_of(tmp_path / "alone", column, method), mean_of(tmp_path / "steady", column, method))
            for column in ("flicker_px", "bad_2_percent", "epe_px", "coverage")
        }
        assert figures["flicker_px"][1] < (0.85 if step == 0 else 0.95) * figures["flicker_px"][0], method
        assert figures["bad_2_percent"][1] <= figures["bad_2_percent"][0] + 0.1, method
        assert figures["epe_px"][1] < 1.05 * figures["epe_px"][0], method
        assert figures["coverage"][1] == figures["coverage"][0], method


def test_a_thing_that_moved_leaves_no_trace() -> None:
    frames = [scene(number, step=7) for number in (0, 1)]
    before, now = (made(truth) for _, _, truth in frames)
    motion = motion_since(frames[0][0], frames[1][0])
    change = np.abs(steadied(before, now, motion, Steadiness(limit=1)) - now.disparity)
    assert change.max() <= 0.5 and (change > 0.1).mean() < 0.01
    assert change[32:68, 31:36].max() < 0.05, "what it uncovered"
    assert change[32:68, 39:75].max() < 0.1, "where it is now"


@pytest.mark.parametrize("approach", [1.05, 1.1])
def test_what_comes_nearer_is_not_late(approach: float) -> None:
    wide = np.clip(texture(200, 300, blur=2), 0, 255).astype(np.uint8)
    matrix = cv2.getRotationMatrix2D((150, 100), 0, approach)
    nearer = np.asarray(cv2.warpAffine(wide, matrix, (300, 200), flags=cv2.INTER_CUBIC), np.uint8)
    random = np.random.default_rng(0)
    truth = np.float32(30 * approach)
    before, now = (made((level + random.normal(0, 0.25, wide.shape)).astype(np.float32)) for level in (30, truth))
    motion = motion_since(wide, nearer)
    assert motion is not None and truth - 30 > 1.4 * Steadiness().limit
    out = steadied(before, now, motion, Steadiness())
    assert abs(out.mean() - truth) < 0.02
    assert out.std() < 0.85 * now.disparity.std()


def test_gaps_stay_gaps_and_what_disagrees_stays_as_it_is() -> None:
    picture = np.clip(texture(80, 100), 0, 255).astype(np.uint8)
    motion = motion_since(picture, picture)
    assert motion is not None and motion.same.all() and motion.still.all()
    before, now = np.full((80, 100), 10, np.float32), np.full((80, 100), 10.5, np.float32)
    now[:40] = 40
    now[20:30, 20:30] = math.nan
    out = steadied(made(before), made(now), motion, Steadiness())
    assert np.array_equal(np.isnan(out), np.isnan(now))
    assert np.array_equal(out[:40], now[:40], equal_nan=True)
    # A change in all measured pixels is a change of the scene, not flicker.
    assert np.abs(out[60:] - 10.5).max() < 0.05


def test_guesses_are_averaged_where_nothing_changed() -> None:
    picture = np.clip(texture(120, 160), 0, 255).astype(np.uint8)
    motion = motion_since(picture, picture)
    reason = np.zeros((120, 160), np.uint8)
    reason[50:70, 60:90] = Reason.FILLED
    before = np.full((120, 160), 10, np.float32)
    now = before.copy()
    now[50:70, 60:90] = 20
    assert (steadied(made(before, reason), made(now, reason), motion, Steadiness())[50:70, 60:90] == 15).all()
    # A measurement is not a guess, and a guess next to a change may have changed too.
    assert (steadied(made(before), made(now), motion, Steadiness())[50:70, 60:90] == 20).all()
    now[:, :60] = 20
    assert (steadied(made(before, reason), made(now, reason), motion, Steadiness())[50:70, 60:90] == 20).all()


def test_the_motion_is_the_same_on_any_number_of_threads_and_none_of_frames_that_cannot_be_compared() -> None:
    for before, now in (((80, 90), (80, 91)), ((12, 90), (12, 90))):
        assert motion_since(np.zeros(before, np.uint8), np.zeros(now, np.uint8)) is None
    frames = [scene(number, step=7)[0] for number in (0, 1)]
    threads, found = cv2.getNumThreads(), []
    try:
        for count in (1, 5):
            cv2.setNumThreads(count)
            found.append(motion_since(*frames))
    finally:
        cv2.setNumThreads(threads)
    alone, several = found
    assert all(np.array_equal(part, other) for part, other in zip(alone, several, strict=True))


def test_a_run_that_is_resumed_and_a_frame_alone_are_the_same(tmp_path: Path) -> None:
    sequence, matchers = drive(tmp_path / "drive", step=7), {"bm": Counting(num_disparities=16)}
    matched.clear()
    run_sequence(sequence, matchers, tmp_path / "whole", settings=STEADY, video=tmp_path / "drive.mp4")
    assert len(matched) == FRAMES, "each once, also those that choose the colours"
    whole, out, states = contents(tmp_path / "whole"), tmp_path / "parts", list[SequenceState]()

    def cancelled() -> bool:
        return bool(states) and states[-1].done >= 3

    run_sequence(sequence, matchers, out, settings=STEADY, progress=states.append, cancelled=cancelled)
    matched.clear()
    assert run_sequence(sequence, matchers, out, settings=STEADY).finished_before == 3
    assert len(matched) == FRAMES - 3 + 1
    assert contents(out) == whole
    assert mean_of(out, "flicker_px", "bm") == mean_of(tmp_path / "whole", "flicker_px", "bm")
    tasks = [FrameTask(number, sequence.reader(number), matchers, steadiness=Steadiness()) for number in (2, 3)]
    alone = encoded_frame(tasks[1], match_frame(tasks[1]), match_frame(tasks[0]))
    assert alone.maps["bm"].data == whole["bm/003.png"]


def test_without_it_nothing_changes_and_a_damaged_frame_takes_no_part(tmp_path: Path) -> None:
    sequence, matcher = drive(tmp_path / "drive", step=7, count=4), METHODS["fast"]
    (tmp_path / "drive" / "right" / "001.png").write_bytes(b"no picture")
    run_sequence(sequence, {"fast": matcher}, tmp_path / "alone")
    result = run_sequence(sequence, {"fast": matcher}, tmp_path / "steady", settings=STEADY)
    assert [*result.damaged] == ["001"]
    alone, steady = contents(tmp_path / "alone"), contents(tmp_path / "steady")
    for number in (0, 2, 3):
        frame = sequence.frame(number)
        assert alone[f"fast/{number:03d}.png"] == kitti_png(matcher.compute(frame.left, frame.right).disparity)
        same = alone[f"fast/{number:03d}.png"] == steady[f"fast/{number:03d}.png"]
        assert same == (number != 3), "the first has none before it, the third a damaged one"
    with pytest.raises(ValueError, match="made with other steadiness"):
        run_sequence(sequence, {"fast": matcher}, tmp_path / "alone", settings=STEADY)
    for limit in (0, 17):
        with pytest.raises(SettingsError, match=f"limit is {limit}; allowed are numbers above 0 to 16"):
            Steadiness(limit=limit)
