"""The result of a calibration: its figures, weaknesses and coverage, and the downloads."""

from __future__ import annotations

import streamlit as st

from stereolag.figures.boards import coverage_picture
from stereolag.figures.pictures import png
from stereolag.geometry.calibrating import LeftOut, StereoCalibration
from stereolag.io.calibrations import calibration_json, opencv_calibration, ros_calibration
from stereolag.ui import prose
from stereolag.ui.announcements import announce
from stereolag.ui.calibrate.examples import drawn_rig
from stereolag.ui.calibrate.kept import open_depth_page
from stereolag.ui.calibrate.pairs import WHY_LEFT_OUT
from stereolag.ui.calibrate.pictures import KEY, BoardPictures
from stereolag.ui.elements import Number, show_numbers, show_png
from stereolag.ui.private_files import download_button
from stereolag.ui.sentences import percent

ENOUGH_PAIRS = 8
ENOUGH_COVERAGE = 0.6
SURE_FOCAL = 0.01
GOOD_ROWS_PX = 0.5


def show_figures(pictures: BoardPictures, result: StereoCalibration) -> None:
    """Show how good the calibration is, and the figures of the cameras."""
    calibration = result.calibration
    announce(
        f"Calibrated from {len(result.used)} of {len(result.pairs)} pairs: {result.rms:.2f} px reprojection error."
    )
    show_numbers(
        (
            Number("Reprojection error", f"{result.rms:.2f} px", "Distance of detected from predicted corners, RMS."),
            Number("Epipolar error", f"{result.row_error:.2f} px", "Row offset of matching corners, once rectified."),
            Number(
                "Pairs that count", f"{len(result.used)} of {len(result.pairs)}", "Reasons for the others are below."
            ),
            Number("Focal length", f"{calibration.focal_px:,.1f} px", "Of the rectified pair."),
            Number("Baseline", f"{1000 * calibration.baseline_m:.2f} mm", "The distance between the cameras."),
        )
    )
    if pictures.example:
        true = drawn_rig()
        found = calibration.rig
        assert found is not None
        prose.caption(
            f"The camera that drew them: left focal length {true.left_matrix[0, 0]:,.1f} px (found "
            f"{found.left_matrix[0, 0]:,.1f}), right camera {-1000 * true.translation[0]:.1f} mm beside it (found "
            f"{-1000 * found.translation[0]:.1f})."
        )
    sentences = weaknesses(pictures, result)
    if sentences:
        # Nobody has to act on the weaknesses of an example.
        show = prose.info if pictures.example else prose.warning
        show("  \n".join(sentences), icon=":material/info:")


def weaknesses(pictures: BoardPictures, result: StereoCalibration) -> list[str]:
    """Return sentences about the weaknesses of a calibration, and how to mend them."""
    sentences = []
    for reason in LeftOut:
        names = [name for name, pair in zip(pictures.names, result.pairs, strict=True) if pair.left_out is reason]
        if names and reason is not LeftOut.BY_HAND:
            sentences.append(f"Left out: pair {', '.join(names)} – {WHY_LEFT_OUT[reason]}.")
    if len(result.used) < ENOUGH_PAIRS:
        sentences.append(f"{len(result.used)} pairs count: use {ENOUGH_PAIRS} to 40 for a reliable result.")
    least = min(result.left_coverage, result.right_coverage)
    if least < ENOUGH_COVERAGE:
        sentences.append(
            f"The board has covered {percent(least)} of the picture: hold it in the corners too, where the lens "
            "distorts most."
        )
    if result.focal_error > SURE_FOCAL:
        sentences.append(
            f"The focal length is uncertain by {100 * result.focal_error:.1f} %: tilt the board more, to all sides."
        )
    if result.row_error > GOOD_ROWS_PX:
        sentences.append(
            f"Rows are {result.row_error:.2f} px apart on average, enough to disturb matching: is the board flat, are "
            "the pictures sharp, and both taken at the same moment?"
        )
    return sentences


def show_coverage(result: StereoCalibration) -> None:
    """Show where in the pictures the board has been."""
    calibration = result.calibration
    assert calibration.width is not None
    assert calibration.height is not None
    size = calibration.width, calibration.height
    used = [result.pairs[number] for number in result.used]
    sides = (
        ("Left", [pair.left for pair in used if pair.left], result.left_coverage),
        ("Right", [pair.right for pair in used if pair.right], result.right_coverage),
    )
    for column, (side, corners, share) in zip(st.columns(2, gap="small"), sides, strict=True):
        with column:
            said = f"{side}: boards in {percent(share)} of the picture"
            show_png(png(coverage_picture(corners, size)), said)
            prose.caption(said)


def show_downloads(result: StereoCalibration) -> None:
    """Offer the calibration as files, and for use on the depth page."""
    calibration = result.calibration
    with st.container(horizontal=True, gap="small", vertical_alignment="center"):
        if st.button("Use it on the depth page", key=f"{KEY}.use", type="primary", icon=":material/arrow_forward:"):
            open_depth_page(calibration)
        left, right = ros_calibration(calibration)
        for name, label, content in (
            ("stereo.yml", "OpenCV YAML", opencv_calibration(calibration)),
            ("left.yaml", "ROS, left", left),
            ("right.yaml", "ROS, right", right),
            ("calibration.json", "JSON", calibration_json(calibration)),
        ):
            download_button(label, content, name, key=f"{KEY}.download.{name}", icon=":material/download:")
    prose.caption("Lengths are in metres. The calibration is kept in this session only: download it to keep it.")
