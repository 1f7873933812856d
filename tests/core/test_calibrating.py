"""Boards seen by cameras of known lens and pose: the calibration recovers both, and names the wrong pairs."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from straight_and_raw import RIG, T

import stereolag as sl
from stereolag.geometry import boards
from stereolag.geometry.boards import (
    DICTIONARIES,
    Board,
    BoardViews,
    Corners,
    Markers,
    board_picture,
    find_boards,
    guess_board,
    guess_charuco,
)
from stereolag.geometry.calibrating import LeftOut, StereoCalibration, calibrate_boards
from stereolag.geometry.calibration import StereoRig
from stereolag.geometry.drawn_boards import drawn_pairs

SQUARE_M = 0.03
CHESSBOARD = Board(9, 6)
FLAT = CHESSBOARD.points()
Pictures = list[tuple[np.ndarray, np.ndarray]]


def rig(scale: float = 1.4) -> StereoRig:
    return RIG.scaled(scale)


@pytest.fixture(scope="module")
def pairs() -> Pictures:
    return list(drawn_pairs(rig(), CHESSBOARD, 8, square_m=SQUARE_M, seed=3))


@pytest.fixture(scope="module")
def views(pairs: Pictures) -> BoardViews:
    return find_boards(pairs, CHESSBOARD)


@pytest.fixture(scope="module")
def plain(views: BoardViews) -> StereoCalibration:
    return calibrate_boards(views, SQUARE_M)


def placed_views(
    true: StereoRig, poses: Sequence[tuple[np.ndarray, np.ndarray]], noise: float = 0.03, points: np.ndarray = FLAT
) -> BoardViews:
    """Return the corners of a chessboard as seen by two cameras in these poses (rotation, position in squares)."""
    random = np.random.default_rng(0)
    left, right = [], []
    for turn, place in poses:
        rotation = cv2.Rodrigues(turn)[0]
        beside = cv2.Rodrigues(true.rotation @ rotation)[0], true.rotation @ place + true.translation / SQUARE_M
        for corners, pose, matrix, distortion in (
            (left, (turn, place), true.left_matrix, true.left_distortion),
            (right, beside, true.right_matrix, true.right_distortion),
        ):
            seen = cv2.projectPoints(points, *pose, matrix, distortion)[0][:, 0]
            corners.append(Corners(np.arange(54), seen + random.normal(0, noise, seen.shape)))
    return BoardViews(CHESSBOARD, (640, 480), tuple(left), tuple(right), (((640, 480), (640, 480)),) * len(poses))


def check_rig(calibration: sl.Calibration, true: StereoRig, px: float = 1.0, turn: float = 1e-3) -> None:
    found = calibration.rig
    np.testing.assert_allclose(found.left_matrix, true.left_matrix, atol=px)
    np.testing.assert_allclose(found.right_matrix, true.right_matrix, atol=px)
    np.testing.assert_allclose(found.rotation, true.rotation, atol=turn)
    np.testing.assert_allclose(found.translation, true.translation, atol=3e-4)


def test_the_rig_that_drew_the_pictures_is_found(pairs: Pictures) -> None:
    told: list[float] = []
    calibration = sl.calibrate(iter(pairs[:6]), square_m=SQUARE_M, progress=told.append)
    check_rig(calibration, rig())
    again = find_boards([sl.rectify(*pairs[7], calibration)[:2]], CHESSBOARD).both[0]
    assert np.abs(again[0].points[:, 1] - again[1].points[:, 1]).mean() < 0.1
    assert calibration.rms is not None and calibration.rms < 0.08
    assert told[-1] == 1 and told == sorted(told)
    assert calibration.baseline_m == pytest.approx(np.linalg.norm(T), rel=3e-3)


@pytest.mark.parametrize(
    "board",
    [Board(8, 5, Markers("DICT_4X4_1000", 0.75, legacy=True)), Board(5, 8, Markers("DICT_APRILTAG_36h11", 0.65))],
)
def test_a_charuco_board_seen_in_part_is_known_and_enough(board: Board) -> None:
    # The legacy layout differs if the number of rows of squares is even.
    pairs = list(drawn_pairs(rig(2.2), board, 3, square_m=SQUARE_M, seed=1, partly=True))
    views = find_boards(pairs)
    assert views.board.markers.share == pytest.approx(board.markers.share, abs=0.04)
    assert replace(views.board, markers=replace(views.board.markers, share=board.markers.share)) == board
    assert any(len(one) < board.corners for one in (*views.left, *views.right) if one is not None)
    check_rig(calibrate_boards(views, SQUARE_M).calibration, rig(2.2), px=8, turn=3e-3)


@pytest.mark.parametrize("name", DICTIONARIES)
def test_markers_of_every_dictionary_are_known(name: str) -> None:
    picture = np.pad(board_picture(Board(6, 4, Markers(name, 0.7)), 48), 48, constant_values=255)
    guessed = guess_charuco([picture])
    assert guessed is not None and guessed.markers is not None
    assert (guessed.columns, guessed.rows, guessed.markers.dictionary) == (6, 4, name)


@pytest.mark.parametrize("size", [(7, 7), (11, 8)])
def test_the_size_of_a_chessboard_is_guessed(size: tuple[int, int]) -> None:
    assert guess_board(list(drawn_pairs(rig(1.2), Board(*size), 3, square_m=SQUARE_M, seed=2))) == Board(*size)


def test_large_pictures_in_colour_and_sixteen_bits_are_refined_in_full_size(pairs, views, monkeypatch):
    monkeypatch.setattr(boards, "MAX_SEARCH_SIDE_PX", 240)
    deep = [tuple(np.stack([one] * 3, axis=-1).astype(np.uint16) * 257 for one in pair) for pair in pairs[1:3]]
    found = find_boards(deep, (9, 6))
    for number, side in np.ndindex(2, 2):
        np.testing.assert_allclose(found.both[number][side].points, views.both[number + 1][side].points, atol=0.03)


@pytest.mark.parametrize(("count", "seed"), [(4, 5), (8, 5), (4, 1)])
def test_a_wide_lens_is_given_the_coefficients_it_needs(count: int, seed: int) -> None:
    """From corner positions alone, without drawing: two coefficients cannot describe the distortion of a 100° view.

    In the poses of the last seed, OpenCV's own first guess leads to another focal length.
    """
    wide = replace(
        rig(2.0),
        left_matrix=np.array([[270, 0, 322], [0, 271, 238], [0, 0, 1.0]]),
        right_matrix=np.array([[271, 0, 317], [0, 272, 242], [0, 0, 1.0]]),
        left_distortion=np.array([-0.3, 0.1, 0, 0, -0.015]),
        right_distortion=np.array([-0.3, 0.1, 0, 0, -0.015]),
    )
    random = np.random.default_rng(seed)
    poses = [(random.normal(0, 0.3, 3), random.uniform((-8, -6, 8), (-0.5, 0.5, 11))) for _ in range(count)]
    result = calibrate_boards(placed_views(wide, poses), SQUARE_M)
    assert result.rms < 0.1 and result.row_error < 0.1
    check_rig(result.calibration, wide, px=2)


def test_a_charuco_board_is_drawn_whatever_the_size_of_its_markers() -> None:
    for share in (0.5, 0.65, 0.72, 0.9):
        assert board_picture(Board(8, 5, Markers("DICT_5X5_1000", share)), 48).shape == (8 * 48, 11 * 48)


@pytest.mark.parametrize("spoil", ["wrong moment", "upside down", "moved a little"])
def test_a_pair_that_contradicts_the_others_is_left_out(pairs: Pictures, views: BoardViews, spoil: str) -> None:
    spoilt = {
        "wrong moment": views.right[3],
        "upside down": find_boards([(pairs[2][0], pairs[2][1][::-1, ::-1])], CHESSBOARD).right[0],
        "moved a little": Corners(np.arange(54), views.both[2][1].points + np.array([4, 0])),
    }[spoil]
    result = calibrate_boards(replace(views, right=(*views.right[:2], spoilt, *views.right[3:])), SQUARE_M)
    check_rig(result.calibration, rig())
    assert [pair.left_out for pair in result.pairs] == [None, None, LeftOut.CONTRADICTS, *[None] * 5]


def test_corners_counted_from_the_other_end_are_put_in_order(views: BoardViews, plain: StereoCalibration) -> None:
    turned = {0, 3, 5}
    right = tuple(
        Corners(one.numbers, one.points[::-1]) if one is not None and number in turned else one
        for number, one in enumerate(views.right)
    )
    result = calibrate_boards(replace(views, right=right), SQUARE_M)
    changed = {number for number in range(8) if result.pairs[number].turned != plain.pairs[number].turned}
    assert changed == turned
    assert result.rms == pytest.approx(plain.rms) and plain.row_error < 0.06


def test_pairs_that_cannot_be_used_say_why(pairs: Pictures, views: BoardViews) -> None:
    blank = np.full_like(pairs[0][0], 128)
    found = find_boards([(blank, pairs[4][1]), tuple(image[:-40] for image in pairs[1])], CHESSBOARD)
    assert found.left[0] is None
    left = (*views.left[:3], None, views.left[5], None, found.left[1], views.left[6], views.left[1])
    right = (*views.right[:3], found.right[0], None, None, found.right[1], views.right[6], views.right[1])
    sizes = (*views.sizes[:6], found.sizes[1], *views.sizes[:2])
    result = calibrate_boards(replace(views, left=left, right=right, sizes=sizes), SQUARE_M, leave_out={7})
    expected = ["not_found_left", "not_found_right", "not_found", "other_size", "by_hand", "same_view"]
    assert [pair.left_out for pair in result.pairs[3:]] == expected
    assert result.used == (0, 1, 2)


def test_cameras_one_above_the_other_are_calibrated(views: BoardViews, plain: StereoCalibration) -> None:
    width, height = views.size
    left, right = (
        tuple(Corners(one.numbers, one.points[:, ::-1] * [1, -1] + [0, width]) for one in side if one is not None)
        for side in (views.left, views.right)
    )
    turned = BoardViews(views.board, (height, width), left, right, (((height, width),) * 2,) * len(views))
    result = calibrate_boards(turned, SQUARE_M)
    assert abs(result.calibration.turn) == 1
    assert result.calibration.baseline_m == pytest.approx(plain.calibration.baseline_m, rel=1e-3)
    assert result.row_error == pytest.approx(plain.row_error, abs=0.01)


def alike(views: BoardViews) -> BoardViews:
    """Return views of a board parallel to the image at one distance: any focal length would fit."""
    poses = [(np.zeros(3), np.array([shift - 5, -2.5, 18.0])) for shift in (-2.0, 0.0, 1.5, 3.0)]
    return placed_views(rig(2.0), poses, noise=0.3)


@pytest.mark.parametrize(
    ("message", "change"),
    {
        "contradict each other: .* of 8 agree": lambda views: replace(views, right=views.right[1:] + views.right[:1]),
        "exchanged": lambda views: replace(views, left=views.right, right=views.left),
        "turned by 179°": lambda views: replace(
            views, right=[replace(one, points=np.array(views.size) - 1 - one.points) for one in views.right]
        ),
        "^2 of 8 pairs .* at least 3": lambda views: replace(views, right=(*views.right[:2], *[None] * 6)),
        "above or below": lambda views: placed_views(
            replace(rig(2.0), translation=np.array([-0.1, 0.09, 0])),
            [(np.array([0.3 * n, 0.2 - 0.2 * n, 0]), np.array([-6.0, -4.0, 16 + n])) for n in range(-1, 3)],
        ),
        "tilt": alike,
    }.items(),
)
def test_a_set_from_which_nothing_follows_is_refused(views, message, change):
    with pytest.raises(ValueError, match=message):
        calibrate_boards(change(views), SQUARE_M)


def test_too_few_pairs_left_by_hand_are_no_doubt_of_the_board(views: BoardViews) -> None:
    with pytest.raises(ValueError, match=r"^2 of 8 pairs .* pictures of 8: use some of those left out"):
        calibrate_boards(views, SQUARE_M, leave_out=range(6))


def test_no_row_of_a_small_board_is_left_out_for_its_edge() -> None:
    random, board = np.random.default_rng(5), Board(4, 3)
    flat = board_picture(board, 40)
    rows, cols = flat.shape
    given = np.array([[0, 0], [cols, 0], [cols, rows], [0, rows]], np.float32)
    for _ in range(24):
        view = cv2.getPerspectiveTransform(given, given + random.uniform(-60, 60, (4, 2)).astype(np.float32) + 70)
        picture = cv2.GaussianBlur(cv2.warpPerspective(flat, view, (420, 360), borderValue=110), (0, 0), 0.8)
        places = cv2.perspectiveTransform((board.points()[:, None, :2] + 2) * 40 - 0.5, view)[:, 0]
        found = boards.find_chessboard(picture, board).points
        assert min(np.abs(found[::way] - places).max() for way in (1, -1)) < 1


@pytest.mark.parametrize("quarters", range(4))
def test_corners_are_counted_from_the_white_end_by_both_detectors_however_the_board_is_turned(quarters: int) -> None:
    picture = np.ascontiguousarray(np.rot90(np.pad(board_picture(CHESSBOARD, 40), 60, constant_values=255), quarters))
    for detect in (boards.find_chessboard, boards.find_in_live_frame):
        found = detect(picture, CHESSBOARD)
        assert found is not None
        square = found.points[[0, 1, 9, 10]].mean(axis=0).astype(int)
        assert picture[square[1], square[0]] == 255


NOISE = np.random.default_rng(0).integers(0, 256, (60, 80), dtype=np.uint8)


@pytest.mark.parametrize(
    ("given", "word"),
    [
        ({"pairs": []}, "pairs holds 0"),
        ({"board": (1, 6)}, "columns of the board is 1"),
        ({"square_m": 0.0}, "square_m is 0"),
        ({"square_m": float("nan")}, "square_m is nan"),
        ({"board": None}, "No chessboard or ChArUco board is seen in 6 pictures"),
    ],
)
def test_what_makes_no_sense_is_named(given: dict[str, object], word: str) -> None:
    with pytest.raises(ValueError, match=word):
        sl.calibrate(**({"pairs": [(NOISE, NOISE)] * 3, "board": (9, 6)} | given))


def bent(points: np.ndarray, by: float) -> np.ndarray:
    return np.column_stack((points[:, :2], by * np.sin(points[:, 0] / 8 * np.pi)))


@pytest.mark.parametrize(
    ("points", "off_grid", "doubt"),
    [
        pytest.param(FLAT, 0.0, (), id="flat"),
        pytest.param(bent(FLAT, 0.25), 0.155, (), id="bent by a quarter of a square"),
        pytest.param(FLAT * (1, 1.03, 1), 0.064, ("The squares are 3.0 % higher",), id="stretched"),
    ],
)
def test_a_board_that_is_not_flat_and_even_is_measured_with_the_cameras(points, off_grid, doubt):
    random, true = np.random.default_rng(6), rig(2.0)
    poses = [(random.normal(0, 0.3, 3), random.uniform((-6, -4, 13), (-1, 0, 18))) for _ in range(12)]
    result = calibrate_boards(placed_views(true, poses, 0.1, points), SQUARE_M)
    found = result.calibration.rig
    assert len(result.used) == 12 and result.rms < 0.16
    for matrix, truth in ((found.left_matrix, true.left_matrix), (found.right_matrix, true.right_matrix)):
        assert np.diag(matrix) == pytest.approx(np.diag(truth), rel=8e-3)
    assert result.off_grid_m / SQUARE_M == pytest.approx(off_grid, rel=0.15)
    assert [said.partition(" than")[0] for said in result.doubts if "squares" in said] == [*doubt]
    assert result.calibration.notes == result.doubts


@pytest.mark.parametrize(("by", "doubted"), [(0.0, False), (0.1, True)])
def test_a_bent_board_that_is_never_seen_as_a_whole_is_a_doubt(by: float, doubted: bool) -> None:
    random = np.random.default_rng(6)
    poses = [(random.normal(0, 0.3, 3), random.uniform((-6, -4, 13), (-1, 0, 18))) for _ in range(12)]
    whole = placed_views(rig(2.0), poses, 0.1, bent(FLAT, by))
    partly = [np.sort(random.permutation(54)[:48]) for _ in poses]
    left, right = (
        tuple(Corners(numbers, one.of(numbers)) for one, numbers in zip(side, partly, strict=True))
        for side in (whole.left, whole.right)
    )
    result = calibrate_boards(replace(whole, left=left, right=right), SQUARE_M)
    assert any("seems to be bent" in said for said in result.doubts) is doubted


def test_what_speaks_against_a_calibration_is_said(views: BoardViews, plain: StereoCalibration) -> None:
    few = calibrate_boards(replace(views, left=(*views.left[:4], *[None] * 4)), SQUARE_M)
    assert few.doubts[0].startswith("4 pairs are used") and "The board has covered" in few.doubts[1]
    fine = replace(plain, left_coverage=0.5, right_coverage=0.6)
    assert fine.doubts == ()
    for change, said in (
        ({"left_coverage": 0.49}, "The board has covered 49 % of the picture"),
        ({"focal_error": 0.012}, "The focal length is uncertain by 1.2 %"),
        ({"row_error": 0.6}, "Rows are 0.60 px apart"),
        ({"rms": 1.2}, "Corners are 1.20 px off"),
    ):
        (doubt,) = replace(fine, **change).doubts
        assert doubt.startswith(said)


def test_opencvs_own_pairs_reach_its_error(data_dir: Path) -> None:
    folder = data_dir / "calibration" / "opencv_chessboard"
    files = sorted(folder.glob("left*.jpg"))
    if not files:
        pytest.skip(f"no pairs in {folder}")
    pairs = [(sl.read_image(file), sl.read_image(folder / file.name.replace("left", "right"))) for file in files]
    result: StereoCalibration = calibrate_boards(find_boards(pairs))
    assert result.board == CHESSBOARD and len(result.used) == 13
    assert result.rms < 0.13 and result.row_error < 0.105
    # In squares; OpenCV's sample gets 3.34, with its 14 coefficients and one focal length for both cameras.
    assert np.linalg.norm(result.calibration.rig.translation) == pytest.approx(3.34, abs=0.03)
