"""The values at the cursor (disparity, depth, score and reason) and the distance between two points."""

from __future__ import annotations

import math

import streamlit as st

from stereolag.core.arrays import FloatMap
from stereolag.figures.pictures import PEAK
from stereolag.geometry.calibration import Calibration
from stereolag.geometry.scene import FIELD_OF_VIEW, SeenPoint, calibrated_by, distance_between
from stereolag.pair import Pair
from stereolag.ui import prose
from stereolag.ui.depth.calibrating import KnownDistance, calibration_of, keep_known_distance, known_distance
from stereolag.ui.depth.explaining import Pixel, disparity_in_words, reasons_of
from stereolag.ui.depth.maps import (
    LEFT,
    DepthView,
    all_maps,
    disparity_error,
    map_legends,
    map_picture,
    photograph,
    truth_picture,
)
from stereolag.ui.depth.sentences import length_in_words, markdown_table, metres_in_words, uncertainty_in_words
from stereolag.ui.linked_pictures import Mark, linked_pictures
from stereolag.ui.navigation import fragment

KEY = "depth.readout"


@fragment
def show_readout(view: DepthView) -> None:
    """Show the values of every method at the cursor and at two clicked points, and the distance between the points."""
    points_key = f"{KEY}.points.{view.pair.digest}"
    points: list[Pixel] = st.session_state.get(points_key, [])

    def pick(row: int, col: int) -> None:
        st.session_state[points_key] = [*points, (row, col)] if len(points) == 1 else [(row, col)]

    prose.markdown(_source_of_metres(view))
    line = [Mark(*points[0], PEAK, to=points[1])] if len(points) == 2 else []
    linked_pictures(
        [
            photograph(LEFT, view.pair.left),
            *(map_picture(view, name, reasons_of(view, name)) for name in view.results),
            *truth_picture(view),
        ],
        key=KEY,
        colours=view.colours,
        legends=map_legends(view),
        hint="Click two points to measure the distance between them; a third click starts over.",
        marks=[*line, *(Mark(*point, PEAK, label=letter) for point, letter in zip(points, "AB", strict=False))],
        on_pick=pick,
    )
    if points:
        prose.markdown(markdown_table(_table(view, points)))
        errors = {name: disparity_error(view, name) for name in view.results}
        prose.caption(uncertainty_in_words(errors, measured=view.pair.truth is not None))
    _ask_known_distance(view, points)


def _source_of_metres(view: DepthView) -> str:
    known = known_distance(view.pair)
    place = f"the **{known.metres:g} m** that you entered for row {known.row}, column {known.col}" if known else ""
    return metres_in_words(calibration_of(view.pair), place)


def _table(view: DepthView, points: list[Pixel]) -> list[list[str]]:
    """Return the values of each method at the points, with a line of headings."""
    calibration = calibration_of(view.pair)
    values = ("disparity",) if calibration is None else ("disparity", "depth")
    lines = [["", *(f"{letter}: {value}" for letter in "AB"[: len(points)] for value in values)]]
    apart = calibration is not None and len(points) == 2
    if apart:
        lines[0].append("A to B")
    for name, disparity in all_maps(view).items():
        lines.append([f"**{name}**"])
        for point in points:
            lines[-1].append(disparity_in_words(view, name, point, score=True))
            if calibration is not None:
                lines[-1].append(_depth(view, name, calibration, float(disparity[point])))
        if calibration is not None and apart:
            lines[-1].append(_distance(view, name, calibration, disparity, points))
    return lines


def _depth(view: DepthView, name: str, calibration: Calibration, disparity: float) -> str:
    depth = float(calibration.depth(disparity))
    if math.isnan(depth):
        return "–"
    return length_in_words(depth, float(calibration.depth_uncertainty(disparity, disparity_error(view, name))))


def _distance(view: DepthView, name: str, calibration: Calibration, disparity: FloatMap, points: list[Pixel]) -> str:
    height, width = disparity.shape
    seen = [SeenPoint(*point, float(disparity[point])) for point in points]
    error = disparity_error(view, name)
    apart = distance_between(calibration, seen[0], seen[1], width=width, height=height, disparity_error=error)
    return "–" if math.isnan(apart.metres) else f"**{length_in_words(apart.metres, apart.error)}**"


def _ask_known_distance(view: DepthView, points: list[Pixel]) -> None:
    """Ask for the distance of the last clicked point, and calibrate with it."""
    with st.container(border=True):
        prose.markdown("**Click something whose distance you know**")
        if not points:
            prose.caption("First click the point in one of the images above.")
        else:
            _ask_distance_of(view, points[-1], "AB"[len(points) - 1])
        if known_distance(view.pair):
            st.button("Forget this distance", key=f"{KEY}.forget", on_click=keep_known_distance, args=(view.pair, None))


def _ask_distance_of(view: DepthView, point: Pixel, letter: str) -> None:
    pair = view.pair
    doffs = pair.calibration.doffs_px if pair.calibration else 0.0
    disparities = {name: float(one.disparity[point]) for name, one in view.results.items()}
    near = [name for name, disparity in disparities.items() if disparity + doffs > 0]
    if not near:
        prose.caption(f"No method gives {letter} a finite distance; choose a point where one does.")
        return
    with st.container(horizontal=True, vertical_alignment="bottom"):
        metres = st.number_input(
            f"Distance of {letter} from the camera, m", min_value=0.001, value=None, key=f"{KEY}.metres", width=230
        )
        name = st.selectbox("Disparity there by", near, key=f"{KEY}.method", width=190)
        st.button(
            "Use this distance",
            key=f"{KEY}.use",
            disabled=metres is None,
            type="primary",
            on_click=_use_distance,
            args=(pair, point, disparities[name], metres),
        )
    if pair.calibration is None:
        prose.caption(
            "Depths follow from this one distance. Distances across the image also need the focal length: "
            f"a horizontal field of view of {FIELD_OF_VIEW:g}° is assumed."
        )


def _use_distance(pair: Pair, point: Pixel, disparity: float, metres: float) -> None:
    calibration = calibrated_by(pair.calibration, disparity, metres, width=int(pair.left.shape[1]))
    keep_known_distance(pair, KnownDistance(*point, metres, calibration))
