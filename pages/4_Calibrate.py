"""Calibration of a stereo camera from pictures of a chessboard or ChArUco board."""

import streamlit as st

from stereolag.ui import prose
from stereolag.ui.calibrate import (
    BoardPictures,
    ask_board,
    ask_pairs,
    calibrated,
    choose_board_pictures,
    choose_shown,
    found_boards,
    show_coverage,
    show_downloads,
    show_figures,
    show_pair,
    show_rectified,
)
from stereolag.ui.calibrate_live import show_live
from stereolag.ui.navigation import bench, fragment, page, show_parts

PARTS = {
    "Corners": show_pair,
    "Rectified": show_rectified,
    "Where the board has been": show_coverage,
    "Take away": show_downloads,
}


@fragment
def workspace(pictures: BoardPictures) -> None:
    """Ask for the board, find it, calibrate and show; moving a control reruns only this fragment."""
    controls, result_place = bench()
    with controls:
        board_place, pairs_place = st.container(gap="xsmall"), st.container(gap="xsmall")
        prose.caption(pictures.description)
    with board_place:
        asked = ask_board(pictures)
    if asked is None:
        return
    board, square_m = asked
    with result_place:
        views = found_boards(pictures, board)
    if views is None:
        return
    with pairs_place:
        leave_out = ask_pairs(pictures, views)
    with result_place:
        result = calibrated(pictures, views, square_m, leave_out)
        if result is not None:
            show_figures(pictures, result)
        shown = choose_shown(pictures, result, pairs_place)
        if result is None:
            show_pair(pictures, views, shown, None)
        else:
            show_parts("calibrate.part", PARTS, pictures, views, shown, result)


with page("Calibrate"):
    pictures = choose_board_pictures()
    if pictures is None:
        show_live()
    else:
        workspace(pictures)
    with st.expander("How it works, and how to get a good result"):
        prose.markdown(
            "- Hold a chessboard or ChArUco board in front of both cameras, near and far, tilted and in every corner, "
            "and take 8 to 40 pairs of pictures. The positions of its corners give the lens parameters and the pose of "
            "the cameras.\n"
            "- A live camera takes a pair by itself whenever the board is held still in a new way, until it has been "
            "all over the picture, near the cameras, and tilted to all sides.\n"
            "- Print the board large, glue it to something flat, and measure a square: every distance depends on it.\n"
            "- Corners are found by OpenCV’s detectors and refined to a few hundredths of a pixel; each camera is "
            "calibrated alone, then both together (`cv2.stereoCalibrate`).\n"
            "- Pairs that contradict the others about the right camera’s position are left out. If the bars of other "
            "pairs stand out, leave those out with a click.\n"
            "- The lens model is the simplest that predicts pictures it was not fitted to.\n"
            "- Focus, zoom and the mounting of both cameras must not change afterwards."
        )
