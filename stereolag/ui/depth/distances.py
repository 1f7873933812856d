"""Values and distances: the disparity and depth of every method at two points, and a map in three dimensions."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import streamlit as st

from stereolag.core.typography import typeset
from stereolag.figures.clouds import Colours, Points, birds_eye, point_cloud
from stereolag.figures.pictures import PEAK, as_rgb
from stereolag.geometry.calibration import Calibration
from stereolag.geometry.scene import (
    ASSUMED_FIELD_OF_VIEW_DEG,
    MAX_POINTS,
    BirdsEyeView,
    ImagePoint,
    birds_eye_view,
    calibration_from_distance,
    clean_point_cloud,
    distance_between,
    subsampled,
)
from stereolag.pair import Pair
from stereolag.ui import prose
from stereolag.ui.depth.maps import (
    choose_map,
    disparity_error,
    disparity_in_words,
    map_legends,
    map_picture,
    photograph,
    reasons_of,
    truth_picture,
)
from stereolag.ui.depth.sentences import length_in_words, markdown_table, metres_in_words, uncertainty_in_words
from stereolag.ui.depth.view import LEFT, DepthView, KnownDistance, Pixel, known_key
from stereolag.ui.linked_pictures import Mark, linked_pictures
from stereolag.ui.navigation import fragment
from stereolag.ui.results import computed

READOUT, SPACE = "depth.readout", "depth.space"
MAX_MEDIAN_DISTANCES = 3.0
"""Points farther than this multiple of the median distance are hidden initially: they would squeeze all others."""

VIEWS = {"Left camera": (0, 0), "Left": (-50, 15), "Right": (50, 15), "Above": (0, 60)}
"""Rotation and elevation of each view about the centre of the scene, degrees."""

MIN_SHOWN_PERCENT = 20
"""Smallest share of the points that can be shown, nearest first, %."""
MAX_INITIAL_PERCENT = 95
"""Largest share shown initially, %."""


# The values at points


@fragment
def show_readout(view: DepthView) -> None:
    """Show the values of every method at the cursor and at two clicked points, and the distance between the points."""
    points_key, known = f"{READOUT}.points.{view.pair.digest}", view.known_distance
    points: list[Pixel] = st.session_state.get(points_key, [])

    def pick(row: int, col: int) -> None:
        st.session_state[points_key] = [*points, (row, col)] if len(points) == 1 else [(row, col)]

    entered = f"the **{known.metres:g} m** that you entered for row {known.row}, column {known.col}" if known else ""
    prose.markdown(metres_in_words(view.calibration, entered))
    connection = [Mark(*points[0], PEAK, to=points[1])] if len(points) == 2 else []
    linked_pictures(
        [
            photograph(LEFT, view.pair.left),
            *(map_picture(view, name, reason=reasons_of(view, name)) for name in view.results),
            *truth_picture(view),
        ],
        key=READOUT,
        colours=view.colours,
        legends=map_legends(view),
        hint="Click two points to measure the distance between them; a third click starts over.",
        marks=[*connection, *(Mark(*point, PEAK, label=letter) for point, letter in zip(points, "AB", strict=False))],
        on_pick=pick,
    )
    if points:
        prose.markdown(markdown_table(_table(view, points)))
        prose.caption(
            uncertainty_in_words(
                {name: disparity_error(view, name) for name in view.results}, measured=view.pair.truth is not None
            )
        )
    with st.container(border=True):
        prose.markdown("**Click something whose distance you know**")
        if points:
            _ask_distance(view, points[-1], "AB"[len(points) - 1])
        else:
            prose.caption("First click the point in one of the images above.")
        if known:
            st.button(
                "Forget this distance",
                key=f"{READOUT}.forget",
                on_click=st.session_state.pop,
                args=(known_key(view.pair.digest), None),
            )


def _table(view: DepthView, points: list[Pixel]) -> list[list[str]]:
    """Return the lines of a table with the values of each method at the points, headings first."""
    calibration, two = view.calibration, len(points) == 2
    values = ("disparity",) if calibration is None else ("disparity", "depth")
    heading = ["", *(f"{letter}: {value}" for letter in "AB"[: len(points)] for value in values)]
    lines = [[*heading, "A to B"] if calibration is not None and two else heading]
    for name, disparity in view.maps.items():
        line, (height, width), error = [f"**{name}**"], disparity.shape, disparity_error(view, name)
        for point in points:
            line.append(disparity_in_words(view, name, point, score=True))
            if calibration is not None:
                value = float(disparity[point])
                depth, uncertainty = calibration.depth(value), calibration.depth_uncertainty(value, error)
                line.append(length_in_words(float(depth), float(uncertainty)))
        if calibration is not None and two:
            first, second = (ImagePoint(*point, float(disparity[point])) for point in points)
            distance = distance_between(calibration, first, second, width=width, height=height, disparity_error=error)
            length = length_in_words(distance.metres, distance.error)
            line.append(length if math.isnan(distance.metres) else f"**{length}**")
        lines.append(line)
    return lines


def _ask_distance(view: DepthView, point: Pixel, letter: str) -> None:
    """Ask for the distance of the last clicked point, and calibrate with it."""
    pair = view.pair
    doffs = pair.calibration.doffs_px if pair.calibration else 0.0
    finite = {
        name: disparity
        for name, result in view.results.items()
        if (disparity := float(result.disparity[point])) + doffs > 0
    }
    if not finite:
        prose.caption(f"No method gives {letter} a finite distance; choose a point where one does.")
        return
    with st.container(horizontal=True, vertical_alignment="bottom"):
        metres = st.number_input(
            f"Distance of {letter} from the camera, m", min_value=0.001, value=None, key=f"{READOUT}.metres", width=230
        )
        name = st.selectbox("Disparity from", [*finite], key=f"{READOUT}.method", width=190)
        st.button(
            "Use this distance",
            key=f"{READOUT}.use",
            disabled=metres is None,
            type="primary",
            on_click=_use_distance,
            args=(pair, point, finite[name], metres),
        )
    if pair.calibration is None:
        prose.caption(
            "Depths follow from this one distance. Distances across the image also need the focal length: "
            f"a horizontal field of view of {ASSUMED_FIELD_OF_VIEW_DEG:g}° is assumed."
        )


def _use_distance(pair: Pair, point: Pixel, disparity: float, metres: float) -> None:
    st.session_state[known_key(pair.digest)] = KnownDistance(
        *point, metres, calibration_from_distance(pair.calibration, disparity, metres, width=int(pair.left.shape[1]))
    )


# In 3-D


@dataclass(frozen=True, eq=False)
class MapPoints:
    """The points of a map up to a given distance.

    Attributes
    ----------
    points, colours
        (n, 3) float32 and uint8: an even subsample of as many points as a browser can rotate.
    count, flying
        Number of points before subsampling, and of flying pixels left out.
    farthest
        Distance up to which points are shown.
    above
        All points seen from above; None if there are none.
    """

    points: Points
    colours: Colours
    count: int
    flying: int
    farthest: float
    above: BirdsEyeView | None


@fragment
def show_space(view: DepthView) -> None:
    """Show a map as a point cloud that can be rotated, and from above."""
    calibration, unit = _cameras(view)
    with st.container(horizontal=True, gap="large", vertical_alignment="bottom"):
        name = choose_map(view, "Method", f"{SPACE}.method")
        depth = calibration.depth(view.results[name].disparity)
        if not np.isfinite(depth).any():
            prose.info("This map puts no point in front of the cameras: every disparity is missing or not above zero.")
            return
        known = depth[np.isfinite(depth)]
        initial = 100 * float(np.mean(known <= MAX_MEDIAN_DISTANCES * np.median(known)))
        nearest = st.slider(
            "Nearest points shown",
            MIN_SHOWN_PERCENT,
            100,
            int(np.clip(initial, MIN_SHOWN_PERCENT, MAX_INITIAL_PERCENT)),
            format="%d %%",
            key=f"{SPACE}.nearest.{view.pair.digest}.{name}",
            width=320,
            help="The farthest points are the least certain: their distance grows without bound as the disparity "
            "approaches zero. Leaving some of them out brings the others closer.",
        )
        seen_from = st.segmented_control(
            "Seen from", list(VIEWS), default=next(iter(VIEWS)), required=True, key=f"{SPACE}.seen_from"
        )
    cloud = _map_points(view, name, calibration, float(np.nanpercentile(depth, nearest)))
    if cloud.above is None:
        prose.info("Nothing but flying pixels: no surface is larger than a few pixels.")
        return
    reach = typeset(f"from {_distance(float(cloud.points[:, 2].min()))} to {_distance(cloud.farthest)} {unit} away")
    in_space, above = st.columns([3, 2], gap="medium")
    with in_space:
        prose.markdown("**Point cloud**: drag to rotate, scroll to zoom")
        turned, raised = VIEWS[seen_from]
        st.plotly_chart(
            point_cloud(cloud.points, cloud.colours, unit, turned=turned, raised=raised),
            key=f"{SPACE}.cloud.{seen_from}",
            config={"displaylogo": False},
            alt=f"Cloud of {len(cloud.points):,} points, {reach}.",
        )
    with above:
        prose.markdown("**Bird’s-eye view**, the camera at the bottom")
        st.plotly_chart(
            birds_eye(cloud.above, unit),
            key=f"{SPACE}.above",
            config={"displayModeBar": False, "scrollZoom": True},
            alt=f"The points from above, {reach}.",
        )
    prose.caption(
        f"{len(cloud.points):,} of {cloud.count:,} points, up to {_distance(cloud.farthest)} {unit} away. Left out: "
        f"{cloud.flying:,} flying pixels, which hang between the near and the far side of an edge."
    )


def _cameras(view: DepthView) -> tuple[Calibration, str]:
    """Return the calibration and the unit of its distances; without a calibration, assume one and say so."""
    if view.calibration is not None:
        return view.calibration, "m"
    width = int(view.pair.left.shape[1])
    prose.info(
        f"Without a calibration all distances are **relative**. Assumed: a focal length of {width:,} px, the width of "
        "the image, and a baseline of 1, so distances are multiples of the distance between the cameras. Shapes "
        "may look stretched or squeezed in depth.",
        icon=":material/straighten:",
    )
    return Calibration(float(width), 1.0), "baselines"


def _map_points(view: DepthView, name: str, calibration: Calibration, farthest: float) -> MapPoints:
    """Return the points of a map up to a distance; from memory if they were computed before."""
    disparity = view.results[name].disparity

    def compute(_: object) -> MapPoints:
        near = np.where(calibration.depth(disparity) <= farthest, disparity, np.float32(np.nan))
        points, colours = clean_point_cloud(calibration, near, as_rgb(view.pair.left), max_points=None)
        flying = int(np.count_nonzero(np.isfinite(near))) - len(points)
        above = birds_eye_view(points, colours, cells=280) if len(points) else None
        return MapPoints(*subsampled(points, colours, MAX_POINTS), len(points), flying, farthest, above)

    return computed(
        "points",
        compute,
        **view.kept(name, f"{calibration} {farthest}"),
        label="Placing the points …",
    )


def _distance(value: float) -> str:
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"
