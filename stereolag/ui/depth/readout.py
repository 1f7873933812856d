"""The values at the cursor (disparity, depth, score and reason) and the distance between two points."""

from __future__ import annotations

import math

import streamlit as st

from stereolag.core.arrays import FloatMap
from stereolag.figures.pictures import PEAK
from stereolag.geometry.scene import FIELD_OF_VIEW, SeenPoint, calibrated_by, distance_between
from stereolag.pair import Pair
from stereolag.stereo.reasons import Reason
from stereolag.ui import prose
from stereolag.ui.depth.calibrating import KnownDistance, calibration_of, keep_known_distance, known_distance
from stereolag.ui.depth.explaining import reasons_of
from stereolag.ui.depth.maps import (
    TRUTH,
    DepthView,
    disparity_error,
    left_picture,
    map_legends,
    map_picture,
    truth_picture,
)
from stereolag.ui.linked_pictures import Mark, linked_pictures
from stereolag.ui.navigation import fragment
from stereolag.ui.sentences import REASON_WORDS

KEY = "depth.readout"

Pixel = tuple[int, int]


@fragment
def show_readout(view: DepthView) -> None:
    """Show the values of every method at the cursor and at two clicked points, and the distance between the points."""
    points_key = f"{KEY}.points.{view.pair.digest}"
    points: list[Pixel] = st.session_state.get(points_key, [])

    def pick(row: int, col: int) -> None:
        st.session_state[points_key] = [*points, (row, col)] if len(points) == 1 else [(row, col)]

    prose.markdown(_calibration_in_words(view))
    pictures = [left_picture(view)]
    pictures += [map_picture(view, name, reasons_of(view, name)) for name in view.results]
    linked_pictures(
        [*pictures, *truth_picture(view)],
        key=KEY,
        colours=view.colours,
        legends=map_legends(view),
        hint="Click two points to measure the distance between them; a third click starts over.",
        marks=_marks(points),
        on_pick=pick,
    )
    if points:
        prose.markdown(_table(view, points))
        prose.caption(_uncertainty_in_words(view))
    _ask_known_distance(view, points)


def _marks(points: list[Pixel]) -> list[Mark]:
    lines = [Mark(*points[0], PEAK, to=points[1])] if len(points) == 2 else []
    return [*lines, *(Mark(*point, PEAK, label=letter) for point, letter in zip(points, "AB", strict=False))]


def _calibration_in_words(view: DepthView) -> str:
    """Return a sentence about the source of the metres."""
    known, calibration = known_distance(view.pair), calibration_of(view.pair)
    if calibration is None:
        return (
            "**Relative**: without a calibration, disparity tells which point is nearer, but not how many metres away "
            "it is. One known distance is enough: click a point and enter its distance below."
        )
    product = f"focal length × baseline = **{calibration.focal_px * calibration.baseline_m:.4g} px·m**"
    if known:
        place = f"row {known.row}, column {known.col}"
        return f"**Metric**, from the **{known.metres:g} m** that you entered for {place}: {product}."
    factors = f"{calibration.focal_px:.6g} px × {calibration.baseline_m:.4g} m"
    return f"**Metric**, from the pair’s calibration: {factors}, {product}."


def _table(view: DepthView, points: list[Pixel]) -> str:
    """Return the values of each method at the points, as a Markdown table."""
    metric = calibration_of(view.pair) is not None
    heads = [
        "",
        *(f"{letter}: {what}" for letter in "AB"[: len(points)] for what in ("disparity", "depth")[: 1 + metric]),
    ]
    if len(points) == 2 and metric:
        heads.append("A to B")
    lines = [heads, ["---"] * len(heads)]
    maps: dict[str, FloatMap] = {name: result.disparity for name, result in view.results.items()}
    if view.pair.truth is not None:
        maps[TRUTH] = view.pair.truth
    for name, disparity in maps.items():
        cells = [f"**{name}**"]
        for point in points:
            cells.append(_disparity_in_words(view, name, point, float(disparity[point])))
            if metric:
                cells.append(_depth_in_words(view, name, float(disparity[point])))
        if len(points) == 2 and metric:
            cells.append(_distance_in_words(view, name, disparity, points))
        lines.append(cells)
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def _disparity_in_words(view: DepthView, name: str, point: Pixel, disparity: float) -> str:
    """Return the disparity with its score, or why there is none."""
    if math.isnan(disparity):
        return "unknown" if name == TRUTH else f"none: {REASON_WORDS[Reason(reasons_of(view, name)[point])]}"
    said = f"{disparity:.2f} px"
    if name == TRUTH:
        return said
    result = view.results[name]
    if result.reason[point] == Reason.FILLED:
        said += ", filled in"
    score = float(result.score[point])
    return said if math.isnan(score) else f"{said}, score {score:.3f}"


def _depth_in_words(view: DepthView, name: str, disparity: float) -> str:
    calibration = calibration_of(view.pair)
    depth = math.nan if calibration is None else float(calibration.depth(disparity))
    if calibration is None or math.isnan(depth):
        return "–"
    return _metres(depth, float(calibration.depth_uncertainty(disparity, _error(view, name))))


def _distance_in_words(view: DepthView, name: str, disparity: FloatMap, points: list[Pixel]) -> str:
    calibration = calibration_of(view.pair)
    if calibration is None:
        return "–"
    height, width = disparity.shape
    seen = [SeenPoint(*point, float(disparity[point])) for point in points]
    apart = distance_between(
        calibration, seen[0], seen[1], width=width, height=height, disparity_error=_error(view, name)
    )
    return "–" if math.isnan(apart.metres) else f"**{_metres(apart.metres, apart.error)}**"


def _error(view: DepthView, name: str) -> float:
    return 0.0 if name == TRUTH else disparity_error(view, name)


def _metres(metres: float, error: float) -> str:
    """Return a length with its error, to two significant digits of the error and at most 4 decimals."""
    if error == 0:
        return f"{metres:.4g} m"
    decimals = min(max(1 - math.floor(math.log10(error)), 0), 4)
    return f"{metres:.{decimals}f} ± {error:.{decimals}f} m"


def _uncertainty_in_words(view: DepthView) -> str:
    """Return a sentence about the source of the uncertainty."""
    formula = "The uncertainty of a depth is Z² · δd / (f · B)"
    if view.pair.truth is None:
        return f"{formula}, with δd = {disparity_error(view, next(iter(view.results))):g} px, typical of a good match."
    errors = ", ".join(f"{name} {disparity_error(view, name):.2f} px" for name in view.results)
    return f"{formula}, where δd is the median error of each method against the ground truth: {errors}."


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
    doffs = view.pair.calibration.doffs_px if view.pair.calibration else 0.0
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
            args=(view.pair, point, disparities[name], metres),
        )
    if view.pair.calibration is None:
        prose.caption(
            "Depths follow from this one distance. Distances across the image also need the focal length: "
            f"a horizontal field of view of {FIELD_OF_VIEW:g}° is assumed."
        )


def _use_distance(pair: Pair, point: Pixel, disparity: float, metres: float) -> None:
    calibration = calibrated_by(pair.calibration, disparity, metres, width=int(pair.left.shape[1]))
    keep_known_distance(pair, KnownDistance(*point, metres, calibration))
