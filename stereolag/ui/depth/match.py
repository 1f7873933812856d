"""Why this match? One window, all its scores, and why the match is right or could not be."""

from __future__ import annotations

import math

import numpy as np
import streamlit as st

from stereolag.assess.explaining import (
    ExampleKind,
    MatchExplanation,
    MatchKind,
    example_pixel,
    explain_match,
    with_rows_around,
)
from stereolag.figures.linked_pictures import Picture
from stereolag.figures.match import (
    patch_png,
    score_landscape,
    score_map,
    score_row,
    sub_pixel_fit,
)
from stereolag.figures.pictures import as_rgb
from stereolag.stereo.reasons import Reason
from stereolag.stereo.semi_global.matcher import SemiGlobalMatcher
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.stereo.windows.search import SearchArea
from stereolag.ui import prose
from stereolag.ui.depth.alternatives import fit_in_words, scores_in_words
from stereolag.ui.depth.blanks import reasons_of
from stereolag.ui.depth.maps import TRUTH
from stereolag.ui.depth.match_marks import Pixel, legend_of, marks_of, moved, true_lag, truth_at
from stereolag.ui.depth.overlap import show_overlap
from stereolag.ui.depth.view import DepthView
from stereolag.ui.elements import show_png, shown_progress
from stereolag.ui.hovered_match import can_follow, hovered_match
from stereolag.ui.linked_pictures import linked_pictures
from stereolag.ui.match_sentences import (
    BEFORE_OPTIMISATION,
    EXAMPLE_LABELS,
    NO_CORRELATION,
    NO_EXAMPLE,
    NO_FIT,
    RIGHT_PX,
    ROW_FIT,
    SQUARE_FIT,
    TOO_MUCH_TO_FOLLOW,
    verdict,
)
from stereolag.ui.navigation import fragment
from stereolag.ui.sentences import REASON_WORDS, percent

KEY = "depth.inspection"
ROWS_AROUND = 8
SAME_PX = 1e-4
"""Disparities this close to that of the match are not drawn separately, px."""
PLAIN_CHART = {"displayModeBar": False}

EXAMPLE_ICONS = {
    ExampleKind.CLEAR: ":material/check_circle:",
    ExampleKind.REPEATS: ":material/fence:",
    ExampleKind.BARE: ":material/square:",
    ExampleKind.HIDDEN: ":material/visibility_off:",
}


@fragment
def show_inspection(view: DepthView) -> None:
    """Show the window of one pixel, its search area, all scores, and the disparity of each method."""
    matcher = _correlation(view)
    if matcher is None:
        prose.info(NO_CORRELATION)
        return
    _offer_examples(view, matcher)
    row, col = _pixel(view)
    seen = explain_match(matcher, view.pair.left, view.pair.right, row, col)
    # Above the pictures, so that a phone or a low screen shows them together with the view that follows the pointer.
    if can_follow(view.pair, matcher):
        hovered_match(view.pair, matcher, (row, col), pictures=KEY)
    else:
        prose.caption(TOO_MUCH_TO_FOLLOW)
    linked_pictures(
        [
            Picture(
                "Left image: point at it, or click",
                as_rgb(view.pair.left),
                photograph=True,
                alternative=lambda: f"the window at row {seen.window.row}, column {seen.window.col}, framed",
            ),
            Picture(
                "Right image: where it was looked for",
                as_rgb(view.pair.right),
                photograph=True,
                pickable=False,
                alternative=lambda: scores_in_words(seen, "framed places"),
            ),
        ],
        key=KEY,
        columns=2,
        legends=[legend_of(view)],
        marks=marks_of(view, seen, (row, col)),
        on_pick=lambda row, col: st.session_state.update({_pixel_key(view): (row, col)}),
    )
    _show_verdict(view, matcher, seen, (row, col))
    patches, hill = st.columns([1, 1.7], gap="medium")
    with patches:
        _show_patches(view, seen, (row, col))
    with hill:
        _show_scores(view, matcher, seen, (row, col))
    _show_row(view, seen, (row, col))
    show_overlap(view, matcher, seen)


def _correlation(view: DepthView) -> CorrelationMatcher | None:
    """Return the correlation to explain: that of a map shown, or the one from which semi-global optimisation starts."""
    shown = [result.settings for result in view.results.values()]
    own = next((matcher for matcher in shown if isinstance(matcher, CorrelationMatcher)), None)
    optimised = next((matcher for matcher in shown if isinstance(matcher, SemiGlobalMatcher)), None)
    if own is not None or optimised is None:
        return own
    search = SearchArea.rectified(optimised.num_disparities, optimised.min_disparity)
    size = optimised.window_size
    return CorrelationMatcher(window_size=size, overlap=1 - 1 / size, search=search)


def _pixel_key(view: DepthView) -> str:
    return f"{KEY}.pixel.{view.pair.digest}"


def _pixel(view: DepthView) -> Pixel:
    """Return the chosen pixel; at first, and at another size, the centre of the image."""
    height, width = view.pair.left.shape[:2]
    row, col = st.session_state.get(_pixel_key(view), (height // 2, width // 2))
    return min(row, height - 1), min(col, width - 1)


def _offer_examples(view: DepthView, matcher: CorrelationMatcher) -> None:
    """Offer to find an example of each kind of match on this pair."""
    with st.container(horizontal=True, vertical_alignment="center"):
        prose.markdown("Show me", width="content")
        pressed = [
            kind
            for kind, icon in EXAMPLE_ICONS.items()
            if st.button(EXAMPLE_LABELS[kind], icon=icon, key=f"{KEY}.{kind}")
        ]
    for kind in pressed:
        with shown_progress("Looking for one …") as progress:
            pixel = example_pixel(kind, matcher, view.pair.left, view.pair.right, progress=progress)
        if pixel:
            st.session_state[_pixel_key(view)] = pixel
        else:
            prose.info(NO_EXAMPLE[kind])


def _show_verdict(view: DepthView, matcher: CorrelationMatcher, seen: MatchExplanation, pixel: Pixel) -> None:
    truth = truth_at(view, pixel)
    visible = view.pair.visible is None or bool(view.pair.visible[pixel])
    own = next((result for result in view.results.values() if result.settings == matcher), None)
    fate = (Reason(own.reason[pixel]), float(own.disparity[pixel])) if own else (None, math.nan)
    said = verdict(seen, truth, visible=visible, reason=fate[0], disparity=fate[1])
    wrong = abs(seen.disparity - truth) > RIGHT_PX
    (prose.success if seen.kind is MatchKind.CLEAR and not wrong else prose.warning)(said)
    if own is None:
        prose.caption(BEFORE_OPTIMISATION)


def _show_patches(view: DepthView, seen: MatchExplanation, pixel: Pixel) -> None:
    """Show the window beside the places found, enlarged."""
    prose.markdown("### The windows compared")
    places = [("Looked for", view.pair.left, seen.window, math.nan)]
    if seen.found:
        places.append(("Found", view.pair.right, seen.found, seen.peak_score))
    if seen.runner_up:
        places.append(("Runner-up", view.pair.right, moved(seen, seen.runner_up), seen.runner_up_score))
    true = true_lag(view, pixel)
    if true and not math.isnan(score := seen.score_at(true)):
        places.append(("True place", view.pair.right, moved(seen, true), score))
    with st.container(horizontal=True, gap="small"):
        for name, image, box, its_score in places:
            with st.container(width=150):
                show_png(patch_png(image, box), f"{name}: the window at row {box.row}, column {box.col}, enlarged")
                prose.caption(name if math.isnan(its_score) else f"{name}: **{its_score:.3f}**")
    prose.caption(
        "Enlarged, in grey as they are compared, each stretched to full contrast. "
        f"The window actually has {percent(seen.contrast)} of the image’s contrast."
    )


def _show_scores(view: DepthView, matcher: CorrelationMatcher, seen: MatchExplanation, pixel: Pixel) -> None:
    """Show the scores of all lags, and of some rows above and below that were not searched."""
    prose.markdown("### The score of every place")
    around = explain_match(with_rows_around(matcher, ROWS_AROUND), view.pair.left, view.pair.right, *pixel)
    shape = st.segmented_control(
        "Shape",
        ["Surface", "From above"],
        default="Surface",
        required=True,
        key=f"{KEY}.shape",
        label_visibility="collapsed",
    )
    if seen.peak is None:
        prose.caption("There is no score to show.")
        return
    alt = scores_in_words(seen, "The scores of all places")
    if shape == "Surface":
        st.plotly_chart(score_landscape(around, seen), key=f"{KEY}.hill", config=PLAIN_CHART, alt=alt)
    else:
        st.plotly_chart(score_map(around, seen), key=f"{KEY}.above", config=PLAIN_CHART, alt=alt)
    if around.dy.size > seen.dy.size:
        prose.caption(
            "A sharp peak is a sure match; along a ridge it can slide, several peaks compete, and a plain has no "
            "match. Only the middle row is searched; the rows above and below are shown for the shape."
        )


def _show_row(view: DepthView, seen: MatchExplanation, pixel: Pixel) -> None:
    """Show the scores along the row, the sub-pixel fit, and the disparity of every method here."""
    disparities = _disparities(view, pixel)
    searched = -float(seen.dx[-1]), -float(seen.dx[0])
    drawn = {
        name: value
        for name, (value, _) in disparities.items()
        if searched[0] <= value <= searched[1] and abs(value - seen.disparity) > SAME_PX
    }
    row, fit = st.columns([1.7, 1], gap="medium")
    with row:
        prose.markdown("### Along the row")
        along = scores_in_words(seen, "The scores along the row")
        st.plotly_chart(score_row(seen, view.pair.right, drawn), key=f"{KEY}.row", config=PLAIN_CHART, alt=along)
    with fit:
        prose.markdown("### Between the pixels")
        if seen.peak is None or np.isnan(seen.fit(0.0)):
            prose.caption(NO_FIT)
        else:
            st.plotly_chart(sub_pixel_fit(seen), key=f"{KEY}.fit", config=PLAIN_CHART, alt=fit_in_words(seen))
            prose.caption(SQUARE_FIT if len(seen.around) > 1 else ROW_FIT)
    prose.markdown("### The disparity by each method")
    lines = [f"| **{name}** | {said} |" for name, (_, said) in disparities.items()]
    prose.markdown("\n".join(["| method | disparity |", "|---|---|", *lines]))


def _disparities(view: DepthView, pixel: Pixel) -> dict[str, tuple[float, str]]:
    """Return {name: (disparity or NaN, the same in words)} for the methods, and for the ground truth if known."""
    disparities: dict[str, tuple[float, str]] = {}
    for name, result in view.results.items():
        disparity = float(result.disparity[pixel])
        said = f"{disparity:.2f} px"
        if math.isnan(disparity):
            said = f"none: {REASON_WORDS[Reason(reasons_of(view, name)[pixel])]}"
        elif result.reason[pixel] == Reason.FILLED:
            said += ", filled in"
        disparities[name] = disparity, said
    if view.pair.truth is not None:
        truth = float(view.pair.truth[pixel])
        disparities[TRUTH] = truth, "unknown" if math.isnan(truth) else f"{truth:.2f} px"
    return disparities
