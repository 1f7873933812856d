"""The pictures of docs/, made from bundled examples and drawn boards: ``python -m tools.pictures``."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
from PIL import Image

import stereolag as sl
from stereolag.figures.boards import coverage_picture, with_corners, with_row_lines
from stereolag.figures.legends import with_legend
from stereolag.figures.pictures import VIRIDIS, as_rgb, coloured
from stereolag.geometry.boards import Board, find_boards
from stereolag.geometry.calibration import StereoRig
from stereolag.geometry.drawn_boards import drawn_pairs
from stereolag.samples import stereo_pairs

Rgb = npt.NDArray[np.uint8]

FOLDER = Path(__file__).resolve().parents[1] / "docs" / "pictures"
GAP_PX = 12
"""Width of the white gap between two pictures, px."""

BOARD = Board(9, 6)
SQUARE_M = 0.03
"""Side of a square of the board, metres."""

PAIRS = 20
"""Number of pairs of the board."""

SHOWN_PAIR = 4
"""Index of the pair shown."""


def rig() -> StereoRig:
    """Return two cameras that toe in slightly, with visible lens distortion."""
    return StereoRig(
        left_matrix=np.array([[530, 0, 325], [0, 532, 237], [0, 0, 1.0]]),
        left_distortion=np.array([-0.28, 0.09, 0, 0, 0]),
        right_matrix=np.array([[533, 0, 313], [0, 534, 244], [0, 0, 1.0]]),
        right_distortion=np.array([-0.27, 0.08, 0, 0, 0]),
        rotation=cv2.Rodrigues(np.array([0.02, -0.03, 0.02]))[0],
        translation=np.array([-0.1, 0.001, 0.002]),
        width=640,
        height=480,
    )


def beside(*pictures: Rgb) -> Rgb:
    """Return pictures of equal height side by side."""
    gap = np.full((pictures[0].shape[0], GAP_PX, 3), 255, np.uint8)
    parts = [part for picture in pictures for part in (gap, picture)]
    return np.concatenate(parts[1:], axis=1)


def below(*pictures: Rgb) -> Rgb:
    """Return pictures of equal width stacked vertically."""
    return np.asarray(beside(*(picture.swapaxes(0, 1) for picture in pictures)).swapaxes(0, 1))


def on_white(picture: npt.NDArray[np.uint8]) -> Rgb:
    """Return a transparent picture, RGBA, on white."""
    opacity = picture[..., 3:] / 255
    return np.rint(255 + (picture[..., :3] - 255.0) * opacity).astype(np.uint8)


def board_pictures() -> dict[str, Rgb]:
    """Return the pictures of a calibration, by name."""
    pairs = list(drawn_pairs(rig(), BOARD, PAIRS, square_m=SQUARE_M, seed=3))
    views = find_boards(pairs, BOARD)
    left, right = pairs[SHOWN_PAIR]
    coverages = [
        on_white(coverage_picture([one for one in corners if one is not None], views.size))
        for corners in (views.left, views.right)
    ]
    rectified = sl.rectify(left, right, sl.calibrate(pairs, BOARD, SQUARE_M))
    return {
        "corners": beside(
            with_corners(left, views.left[SHOWN_PAIR], BOARD), with_corners(right, views.right[SHOWN_PAIR], BOARD)
        ),
        "coverage": beside(*coverages),
        "rows": below(with_row_lines(left, right), with_row_lines(rectified.left, rectified.right)),
    }


def map_pictures() -> dict[str, Rgb]:
    """Return the maps of the road by a matcher with default settings and by presets, by name."""
    road = stereo_pairs()["road"]
    left, right = sl.read_image(road.left), sl.read_image(road.right)
    maps = {name: sl.preset(name, road.num_disparities).compute(left, right) for name in ("fast", "accurate")}
    plain = sl.CorrelationMatcher(window_size=11, search=sl.SearchArea.rectified(road.num_disparities))
    shown = [plain.compute(left, right), maps["fast"], maps["accurate"]]
    pictures = [coloured(one.disparity, 0, road.num_disparities) for one in shown]
    calibration = sl.read_calibration(road.calibration)
    depth = calibration.depth(maps["accurate"].disparity)
    nearest, farthest = 7.0, 70.0
    near_bright = VIRIDIS[::-1]
    metres = coloured(depth, nearest, farthest, near_bright)
    return {
        "presets": below(beside(as_rgb(left), pictures[0]), beside(*pictures[1:])),
        "depth": with_legend(metres, nearest, farthest, near_bright, "depth, m: from near to far"),
    }


def main() -> None:
    """Write all pictures."""
    FOLDER.mkdir(exist_ok=True)
    for name, picture in (board_pictures() | map_pictures()).items():
        Image.fromarray(picture).save(FOLDER / f"{name}.webp", quality=80, method=6)
        print(f"{name}: {picture.shape[1]} × {picture.shape[0]} px")


if __name__ == "__main__":
    main()
