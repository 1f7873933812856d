"""A disparity map in three dimensions: point cloud and bird's-eye view."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import streamlit as st

from stereolag.core.typography import typeset
from stereolag.figures.clouds import birds_eye, point_cloud
from stereolag.figures.pictures import as_rgb
from stereolag.geometry.calibration import Calibration
from stereolag.geometry.scene import MOST_POINTS, BirdsEyeView, clean_point_cloud, seen_from_above, subsampled
from stereolag.ui import prose
from stereolag.ui.depth.calibrating import calibration_of
from stereolag.ui.depth.maps import DepthView
from stereolag.ui.navigation import fragment
from stereolag.ui.results import computed

KEY = "depth.space"
FAR_BEHIND = 3.0
"""Points farther than this multiple of the median distance are hidden at first."""

VIEWS = {"Left camera": (0, 0), "Left": (-50, 15), "Right": (50, 15), "Above": (0, 60)}
"""Rotation and elevation of each view about the centre of the scene, degrees."""

LEAST_SHARE, MOST_AT_FIRST = 20, 95
CELLS = 280
METRES, BASELINES = "m", "baselines"


@dataclass(frozen=True, eq=False)
class Space:
    """The points of a map up to a given distance.

    Attributes
    ----------
    points, colours
        (n, 3) float32 and uint8: an even subsample, as many points as a browser can rotate.
    kept, flying
        Number of points before subsampling, and of flying pixels left out.
    farthest
        Distance up to which points are shown.
    above
        All points seen from above; None if there are none.
    """

    points: npt.NDArray[np.float32]
    colours: npt.NDArray[np.uint8]
    kept: int
    flying: int
    farthest: float
    above: BirdsEyeView | None


@fragment
def show_space(view: DepthView) -> None:
    """Show a map as a point cloud that can be rotated, and from above."""
    calibration, unit = _cameras(view)
    with st.container(horizontal=True, gap="large", vertical_alignment="bottom"):
        names = list(view.results)
        name = st.segmented_control("Method", names, default=names[0], required=True, key=f"{KEY}.method")
        depth = calibration.depth(view.results[name].disparity)
        if not np.isfinite(depth).any():
            prose.info("This map puts no point in front of the cameras: every disparity is missing or not above zero.")
            return
        nearest = st.slider(
            "Nearest points shown",
            LEAST_SHARE,
            100,
            _worth_showing(depth),
            format="%d %%",
            key=f"{KEY}.nearest.{view.pair.digest}.{name}",
            width=320,
            help="The farthest points are the least certain: their distance grows without bound as the disparity "
            "nears zero. Leaving some of them out brings the rest closer.",
        )
        seen_from = st.segmented_control(
            "Seen from", list(VIEWS), default=next(iter(VIEWS)), required=True, key=f"{KEY}.seen_from"
        )
    space = _space(view, name, calibration, float(np.nanpercentile(depth, nearest)))
    if space.above is None:
        prose.info("Nothing but flying pixels: no surface is larger than a few pixels.")
        return
    nearest_point = float(space.points[:, 2].min())
    reach = typeset(f"from {_distance(nearest_point)} to {_distance(space.farthest)} {unit} away")
    cloud, above = st.columns([3, 2], gap="medium")
    with cloud:
        prose.markdown("**Point cloud**: drag to turn, scroll to come closer")
        turned, raised = VIEWS[seen_from]
        st.plotly_chart(
            point_cloud(space.points, space.colours, unit, turned=turned, raised=raised),
            key=f"{KEY}.cloud.{seen_from}",
            config={"displaylogo": False},
            alt=f"Cloud of {len(space.points):,} points, {reach}.",
        )
    with above:
        prose.markdown("**Bird’s-eye view**, the camera at the bottom")
        st.plotly_chart(
            birds_eye(space.above, unit),
            key=f"{KEY}.above",
            config={"displayModeBar": False, "scrollZoom": True},
            alt=f"The points from above, {reach}.",
        )
    prose.caption(
        f"{len(space.points):,} of {space.kept:,} points, up to {_distance(space.farthest)} {unit} away. Left out: "
        f"{space.flying:,} flying pixels, which hang between the near and the far side of an edge."
    )


def _cameras(view: DepthView) -> tuple[Calibration, str]:
    """Return the calibration and the unit of its distances; without one, say what is assumed."""
    known = calibration_of(view.pair)
    if known is not None:
        return known, METRES
    width = int(view.pair.left.shape[1])
    prose.info(
        f"Without a calibration all distances are **relative**. Assumed: a focal length of {width:,} px, the width of "
        "the image, and a baseline of 1, so distances are multiples of the distance between the cameras. Shapes "
        "may look stretched or squeezed in depth.",
        icon=":material/straighten:",
    )
    return Calibration(float(width), 1.0), BASELINES


def _worth_showing(depth: npt.NDArray[np.float32]) -> int:
    """Return the share of the points to show at first, %: those far behind most of the scene would squeeze the rest."""
    known = depth[np.isfinite(depth)]
    share = 100 * float(np.mean(known <= FAR_BEHIND * np.median(known)))
    return int(np.clip(share, LEAST_SHARE, MOST_AT_FIRST))


def _space(view: DepthView, name: str, calibration: Calibration, farthest: float) -> Space:
    """Return the points of a map up to a distance; from memory if they were computed before."""
    disparity = view.results[name].disparity

    def work_out(_: object) -> Space:
        near_enough = np.where(calibration.depth(disparity) <= farthest, disparity, np.float32(np.nan))
        points, colours = clean_point_cloud(calibration, near_enough, as_rgb(view.pair.left), max_points=None)
        flying = int(np.count_nonzero(np.isfinite(near_enough))) - len(points)
        some, their_colours = subsampled(points, colours, MOST_POINTS)
        above = seen_from_above(points, colours, cells=CELLS) if len(points) else None
        return Space(some, their_colours, len(points), flying, farthest, above)

    return computed(
        "points",
        work_out,
        **view.kept(name, f"{calibration} {farthest}"),
        label="Placing the points …",
    )


def _distance(value: float) -> str:
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"
