"""Boards held before a known stereo camera: the figures of a pose, what is worth keeping, and what is missing."""

import itertools

import numpy as np
import pytest

from stereolag.geometry.board_samples import MAX_SAMPLES, BoardPose, Collected, board_pose, is_still
from stereolag.geometry.boards import Board, BoardViews, Corners, Markers
from stereolag.geometry.calibrating import ENOUGH_COVERAGE, calibrate_boards, covered_cells
from tests.held_boards import BASELINE_M, CHESSBOARD, SIZE, SQUARE_M, held, obeying, seen

PLACES = (60, 30), (240, 180)


def pose_of(*pair: Corners) -> BoardPose:
    return board_pose(*pair, CHESSBOARD, SIZE)


def test_the_place_of_a_board_is_what_room_both_pictures_leave_it() -> None:
    middle = pose_of(*seen(held()))
    assert middle.across == pytest.approx(0.5, abs=0.02) and middle.down == pytest.approx(0.5, abs=0.02)
    assert middle.size == pytest.approx(np.sqrt(0.35**2 * 5 / 8 * 640 / 480), rel=0.05)
    left, right = seen(held())
    touching = right.points[:, 0].min()
    moved = pose_of(*(Corners(one.numbers, one.points - [touching, 0]) for one in (left, right)))
    assert moved.across == 0  # the board touches the border of the right picture, though not of the left one
    filling = Corners(np.arange(54), CHESSBOARD.points()[:, :2] * [639 / 8, 479 / 5])
    assert pose_of(filling, filling)[:2] == (0.5, 0.5)


@pytest.mark.parametrize(
    ("turn", "expected"),
    [
        ((0, 0.4, 0), (1, 0)),
        ((0, -0.4, 0), (-1, 0)),
        ((0.4, 0, 0), (0, -1)),
        ((-0.4, 0, 0), (0, 1)),
        ((0, 0, 0.4), (0, 0)),
    ],
)
def test_the_side_that_is_nearer_is_known_whichever_end_the_corners_are_counted_from(turn, expected):
    left, right = seen(held(turn=turn))
    pose = pose_of(left, right)
    np.testing.assert_allclose(pose[3:], np.sin(0.4) * np.array(expected), atol=0.12)
    back = Corners(left.numbers, left.points[::-1])
    np.testing.assert_allclose(pose_of(back, right), pose, atol=1e-6)


def test_a_part_of_a_board_with_markers_has_a_pose() -> None:
    some = np.array([0, 1, 2, 9, 10, 11, 18, 19, 20])
    part = [Corners(some, one.of(some)) for one in seen(held(turn=(0, 0.5, 0)))]
    assert board_pose(part[0], part[1], Board(9, 6, Markers("DICT_4X4_1000")), SIZE).tilt_across > 0.3


def test_a_board_is_still_if_no_corner_moves_by_more_than_ten_pixels_a_second() -> None:
    now, _ = seen(held())
    for seconds in (0.05, 0.2):
        for speed, still in ((9, True), (11, False)):
            before = Corners(now.numbers, now.points + np.array([speed * seconds, 0]))
            assert is_still(now, before, CHESSBOARD, 640, seconds) is still
            assert is_still(now, Corners(now.numbers, before.points[::-1]), CHESSBOARD, 640, seconds) is still
    far = Corners(now.numbers, now.points + np.array([5, 0]))
    assert not is_still(now, far, CHESSBOARD, 640, 2)  # who knows where it was meanwhile
    first, last = (Corners(numbers, now.of(numbers)) for numbers in (np.arange(6), np.arange(40, 54)))
    assert not is_still(first, last, Board(9, 6, Markers("DICT_4X4_1000")), 640, 0.1)


def test_a_pose_adds_something_if_it_differs_from_all_that_are_kept() -> None:
    collected = Collected()
    for across in (0.2, 0.6):
        pair = seen(held(across))
        assert collected.is_new(pose_of(*pair))
        collected.keep(pose_of(*pair), *pair, SIZE)
    assert not collected.is_new(pose_of(*seen(held(0.55))))
    assert collected.is_new(pose_of(*seen(held(0.55, turn=(0.5, 0, 0)))))


def test_whoever_does_what_is_missing_is_soon_done_and_well_calibrated() -> None:
    random = np.random.default_rng(4)
    pairs, done = [], []
    for collected, poses in obeying(4):
        pairs.append(seen(poses, random))
        done.append(collected.progress())
    done.append(collected.progress())
    assert not collected.missing()
    assert all(now[one] >= before[one] for before, now in itertools.pairwise(done) for one in now)
    assert set(done[0].values()) == {0} and set(done[-1].values()) == {1}
    left, right = zip(*pairs, strict=True)
    result = calibrate_boards(BoardViews(CHESSBOARD, SIZE, left, right, ((SIZE, SIZE),) * len(pairs)), SQUARE_M)
    assert len(result.used) == len(pairs)
    assert min(result.left_coverage, result.right_coverage) > ENOUGH_COVERAGE - 0.01
    assert result.focal_error < 0.01
    assert result.calibration.baseline_m == pytest.approx(BASELINE_M, rel=0.01)


def test_what_is_covered_is_within_the_corners_of_each_picture() -> None:
    boards = [Corners(np.arange(4), np.array([[x, y], [x + 80, y], [x, y + 60], [x + 80, y + 60]])) for x, y in PLACES]
    cells = covered_cells(boards, (400, 300))
    assert cells.mean() == pytest.approx(2 * 0.2**2, rel=0.15)
    assert cells[10:30, 15:35].all() and cells[60:80, 60:80].all()


def test_many_pictures_are_enough_whatever_they_lack() -> None:
    collected, pair = Collected(), seen(held())
    for _ in range(MAX_SAMPLES):
        assert collected.missing()
        collected.keep(pose_of(*pair), *pair, SIZE)
    assert not collected.missing()
