"""The result of a calibration: figures, pairs one by one, coverage, downloads, and its use on the depth page."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import streamlit as st

from stereolag.core.inputs import as_image
from stereolag.figures.boards import coverage_picture, error_bars, with_corners, with_row_lines
from stereolag.figures.pictures import jpeg, png
from stereolag.geometry.boards import BoardViews
from stereolag.geometry.calibrating import StereoCalibration
from stereolag.geometry.calibration import Calibration
from stereolag.geometry.rectification import rectify
from stereolag.io.calibrations import calibration_json, opencv_calibration, ros_calibration
from stereolag.ui import keys, prose
from stereolag.ui.calibrate.pictures import KEY, BoardPictures, drawn_rig
from stereolag.ui.calibrate.sentences import errors_in_words, pair_in_words, weaknesses
from stereolag.ui.choices import OWN, no_files_yet
from stereolag.ui.downloads import download_button
from stereolag.ui.elements import Number, announce, show_jpeg, show_numbers, show_png, show_refused
from stereolag.ui.results import computed
from stereolag.ui.sentences import percent
from stereolag.ui.uploads import Upload

KEPT = "calibrate.kept"
"""Session-state key of the calibration, stored as an upload."""

DEPTH_PAGE = "pages/3_Depth_maps.py"


@dataclass(frozen=True)
class DrawnPair:
    """Both pictures of a pair with their corners, as JPEGs."""

    left: bytes
    right: bytes


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
    sentences = weaknesses(pictures.names, result)
    if sentences:
        # Nobody has to act on the weaknesses of an example.
        show = prose.info if pictures.example else prose.warning
        show("  \n".join(sentences), icon=":material/info:")


def choose_shown(pictures: BoardPictures, result: StereoCalibration | None) -> int:
    """Show the error of each pair, and return the number of the one to show, picked by its bar or by name."""
    key = f"{KEY}.shown.{pictures.digest}"
    at_first = next((number for number in (result.used if result else ())), 0)
    shown = int(st.session_state.setdefault(key, at_first))
    if result is not None:
        figure = error_bars(
            pictures.names,
            [pair.left_rms for pair in result.pairs],
            [pair.right_rms for pair in result.pairs],
            [pair.left_out is None for pair in result.pairs],
            shown,
        )
        clicks = st.session_state.setdefault(f"{key}.clicks", 0)
        event = st.plotly_chart(
            figure,
            key=f"{key}.bars.{clicks}",
            on_select="rerun",
            selection_mode="points",
            config={"displayModeBar": False},
            alt=errors_in_words(pictures.names, result),
        )
        if event.selection.points:
            # A chart keeps its selection; under a new key it starts without one.
            st.session_state[f"{key}.clicks"] = clicks + 1
            st.session_state[key] = int(event.selection.points[0]["x"])
            st.rerun(scope="fragment")
    return int(
        st.selectbox(
            "Pair shown",
            range(len(pictures.names)),
            format_func=lambda number: pictures.names[number],
            key=key,
            width=260,
        )
    )


def show_pair(pictures: BoardPictures, views: BoardViews, number: int, result: StereoCalibration | None) -> None:
    """Show both pictures of a pair with their corners, its errors, and whether it counts."""
    report = result.pairs[number] if result else None
    left, right = (report.left, report.right) if report else (views.left[number], views.right[number])

    def drawn(_: object) -> DrawnPair:
        both = (as_image(one, "The picture") for one in pictures.pairs[number])
        seen = views.left[number], views.right[number]
        return DrawnPair(*(jpeg(with_corners(*one, views.board)) for one in zip(both, seen, strict=True)))

    shown = computed(
        "corners drawn",
        drawn,
        inputs=pictures.digest,
        settings=f"{views.board!r} {number}",
        shared=pictures.shared,
        label="Drawing the corners …",
    )
    for column, side, picture, corners in zip(
        st.columns(2, gap="small"), ("Left", "Right"), (shown.left, shown.right), (left, right), strict=True
    ):
        with column:
            found = "not found" if corners is None else f"{len(corners)} of {views.board.corners} corners"
            show_jpeg(picture, f"{side} picture of pair {pictures.names[number]}, its corners marked: {found}")
            prose.caption(f"{side}: {found}")
    if report is not None:
        prose.markdown(pair_in_words(report))


def show_rectified(pictures: BoardPictures, number: int, result: StereoCalibration) -> None:
    """Show a pair rectified by the calibration, with lines along its rows."""

    def drawn(_: object) -> bytes:
        left, right = pictures.pairs[number]
        rectified = rectify(left, right, result.calibration)
        return jpeg(with_row_lines(rectified.left, rectified.right))

    try:
        data = computed(
            "rectified",
            drawn,
            inputs=pictures.digest,
            settings=f"{number} {result.board!r} {result.used} {result.square_m}",
            shared=pictures.shared,
            label="Rectifying the pair …",
        )
    except ValueError as error:
        show_refused(error)
        return
    show_jpeg(data, f"Pair {pictures.names[number]}, rectified, with lines along its rows")
    prose.caption(
        f"Pair {pictures.names[number]}, rectified: a point on a line in the left picture lies on it in the right one."
    )


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


def keep_calibration(calibration: Calibration) -> None:
    """Keep a calibration for this session."""
    digest = hashlib.sha256(calibration_json(calibration).encode()).hexdigest()
    st.session_state[KEPT] = Upload(digest, calibration)


def kept_calibration() -> Upload[Calibration] | None:
    """Return the calibration kept in this session, or None."""
    kept: Upload[Calibration] | None = st.session_state.get(KEPT)
    return kept


def forget_calibration() -> None:
    """Stop using the kept calibration."""
    st.session_state.pop(KEPT, None)


def use_kept_calibration() -> Upload[Calibration] | None:
    """Return the kept calibration, and show that it is in use, with a button to stop using it."""
    kept = kept_calibration()
    if kept is not None:
        error = "" if kept.content.rms is None else f", {kept.content.rms:.2f} px"
        with st.container(horizontal=True, vertical_alignment="center"):
            prose.caption(f"In use: the calibration you made on the page Calibrate{error}.", width="content")
            st.button("Remove", key=f"{KEPT}.remove", type="tertiary", on_click=forget_calibration)
    return kept


def open_depth_page(calibration: Calibration) -> None:
    """Keep a calibration, and open the depth page for the visitor's own files, to which it applies."""
    keep_calibration(calibration)
    st.session_state[keys.PAIR] = OWN
    st.session_state.pop(keys.HANDED, None)
    no_files_yet(keys.PAIR)
    st.session_state[keys.FOLD] = True
    st.switch_page(DEPTH_PAGE)
