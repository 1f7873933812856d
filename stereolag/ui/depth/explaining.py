"""Why this match, and why none: the scores of one window, the overlap of windows, and blank pixels by reason."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import streamlit as st

from stereolag.assess.explaining import (
    Box,
    ExampleKind,
    MatchExplanation,
    MatchKind,
    blank_reasons,
    example_pixel,
    explain_match,
    with_rows_around,
)
from stereolag.core.arrays import ReasonMap
from stereolag.core.typography import typeset
from stereolag.figures.legends import Legend, hexadecimal, word_legend
from stereolag.figures.maps import REASON_COLOURS, reasons_picture, share_of_reasons
from stereolag.figures.match import (
    RUNNER_UP_COLOUR,
    SEARCH_COLOUR,
    TRUTH_COLOUR,
    WINDOW_COLOUR,
    WindowGrid,
    overlap_figure,
    patch_png,
    score_landscape,
    score_map,
    score_row,
    sub_pixel_fit,
    window_grid,
)
from stereolag.figures.pictures import as_rgb
from stereolag.stereo.reasons import Reason
from stereolag.stereo.semi_global.matcher import SemiGlobalMatcher
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.stereo.windows.search import SearchArea
from stereolag.ui import prose
from stereolag.ui.depth.maps import TRUTH, DepthView, settings_key
from stereolag.ui.depth.sentences import (
    BEFORE_OPTIMISATION,
    EXAMPLE_LABELS,
    NO_CORRELATION,
    NO_EXAMPLE,
    NO_FIT,
    RIGHT_PX,
    ROW_FIT,
    SQUARE_FIT,
    TOO_MUCH_TO_FOLLOW,
    all_blanks_in_words,
    blanks_in_words,
    fit_in_words,
    match_verdict,
    scores_in_words,
)
from stereolag.ui.elements import show_png, shown_progress
from stereolag.ui.hovered_match import can_follow, hovered_match
from stereolag.ui.linked_pictures import Mark, linked_pictures
from stereolag.ui.navigation import fragment
from stereolag.ui.packing import Picture, Reading
from stereolag.ui.results import computed
from stereolag.ui.sentences import OPENCV_REASONS, REASON_WORDS, REASONS_EXPLAINED, percent

Pixel = tuple[int, int]


def legend_of(view: DepthView) -> Legend:
    """Return the legend of the frames."""
    colours = [WINDOW_COLOUR, RUNNER_UP_COLOUR, SEARCH_COLOUR]
    words = ["the window, and where it was found", "the runner-up", "the search area"]
    if view.pair.truth is not None:
        colours.insert(1, TRUTH_COLOUR)
        words.insert(1, "the true place")
    return word_legend("", colours, words)


def marks_of(view: DepthView, seen: MatchExplanation, pixel: Pixel) -> list[Mark]:
    """Return the frames: the window at left; the search area and the runner-up, true and found places at right."""
    marks = [_frame(seen.search, SEARCH_COLOUR, 1, area=True), _frame(seen.window, WINDOW_COLOUR, 0)]
    if seen.runner_up:
        marks.append(_frame(moved(seen, seen.runner_up), RUNNER_UP_COLOUR, 1))
    if true := true_lag(view, pixel):
        marks.append(_frame(moved(seen, true), TRUTH_COLOUR, 1, dashed=True))
    if seen.found:
        marks.append(_frame(seen.found, WINDOW_COLOUR, 1))
    return [*marks, Mark(*pixel, WINDOW_COLOUR, pictures=(0,))]


def truth_at(view: DepthView, pixel: Pixel) -> float:
    """Return the ground truth at a pixel, px; NaN if unknown."""
    return math.nan if view.pair.truth is None else float(view.pair.truth[pixel])


def true_lag(view: DepthView, pixel: Pixel) -> tuple[int, int] | None:
    """Return the integer lag (dy, dx) nearest to the ground truth; None if unknown."""
    truth = truth_at(view, pixel)
    return None if math.isnan(truth) else (0, -round(truth))


def _frame(box: Box, colour: str, picture: int, *, area: bool = False, dashed: bool = False) -> Mark:
    return Mark(
        box.row,
        box.col,
        colour,
        height=box.height,
        width=box.width,
        dashed=area or dashed,
        filled=area,
        pictures=(picture,),
    )


def moved(seen: MatchExplanation, lag: tuple[int, int]) -> Box:
    """Return the window moved by (dy, dx)."""
    window = seen.window
    return Box(window.row + lag[0], window.col + lag[1], window.height, window.width)


INSPECTION = "depth.inspection"
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
        hovered_match(view.pair, matcher, (row, col), pictures=INSPECTION)
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
        key=INSPECTION,
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
    return f"{INSPECTION}.pixel.{view.pair.digest}"


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
            if st.button(EXAMPLE_LABELS[kind], icon=icon, key=f"{INSPECTION}.{kind}")
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
    said = match_verdict(seen, truth, visible=visible, reason=fate[0], disparity=fate[1])
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
        key=f"{INSPECTION}.shape",
        label_visibility="collapsed",
    )
    if seen.peak is None:
        prose.caption("There is no score to show.")
        return
    alt = scores_in_words(seen, "The scores of all places")
    if shape == "Surface":
        st.plotly_chart(score_landscape(around, seen), key=f"{INSPECTION}.hill", config=PLAIN_CHART, alt=alt)
    else:
        st.plotly_chart(score_map(around, seen), key=f"{INSPECTION}.above", config=PLAIN_CHART, alt=alt)
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
        st.plotly_chart(score_row(seen, view.pair.right, drawn), key=f"{INSPECTION}.row", config=PLAIN_CHART, alt=along)
    with fit:
        prose.markdown("### Between the pixels")
        if seen.peak is None or np.isnan(seen.fit(0.0)):
            prose.caption(NO_FIT)
        else:
            st.plotly_chart(sub_pixel_fit(seen), key=f"{INSPECTION}.fit", config=PLAIN_CHART, alt=fit_in_words(seen))
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


OVERLAP = "depth.inspection.overlap"


def show_overlap(view: DepthView, matcher: CorrelationMatcher, seen: MatchExplanation) -> None:
    """Show the explained window among its neighbours, and the number of map values there."""
    height, width = view.pair.left.shape[:2]
    grid = window_grid((height, width), seen.window, matcher.step)
    prose.markdown("### How the windows overlap")
    figure, words = st.columns([1.3, 1], gap="medium", vertical_alignment="center")
    said = typeset(overlap_in_words(grid, matcher.overlap))
    with figure:
        st.plotly_chart(overlap_figure(view.pair.left, grid), key=OVERLAP, config={"displayModeBar": False}, alt=said)
    with words:
        prose.markdown(said)


def overlap_in_words(grid: WindowGrid, asked: float) -> str:
    """Return the text beside the figure; `asked` is the overlap in the settings, 0..1."""
    overlap = f"{percent(asked)} overlap"
    if percent(asked) != percent(grid.overlap):
        overlap += f" ({percent(grid.overlap)} in whole pixels)"
    values = "1 value" if grid.values == 1 else f"{grid.values:,} values"
    said = (
        f"{grid.middle.height} px windows, {overlap}: one every {grid.step} px, so {values} in this cut. "
        "Each dot is the centre of a window and becomes one value of the map."
    )
    if grid.every > 1:
        said += f" Only every {_ordinal(grid.every)} window and dot is drawn."
    return said


def _ordinal(number: int) -> str:
    return {2: "second", 3: "third"}.get(number, f"{number}th")


BLANKS = "depth.blanks"


@fragment
def show_blanks(view: DepthView) -> None:
    """Show where each method has no measurement and why, and the share of the image lost to each reason."""
    reasons = {name: reasons_of(view, name) for name in view.results}
    present = [cause for cause in REASON_COLOURS if any((one == cause).any() for one in reasons.values())]
    words = tuple(REASON_WORDS[cause] for cause in Reason)
    linked_pictures(
        [
            Picture(
                name,
                reasons_picture(reason, view.pair.left),
                (Reading(reason, words=words),),
                alternative=partial(blanks_in_words, reason),
            )
            for name, reason in reasons.items()
        ],
        key=BLANKS,
        columns=min(3, len(reasons)),
        legends=[
            word_legend(
                "",
                [hexadecimal(REASON_COLOURS[cause]) for cause in present],
                [REASON_WORDS[cause] for cause in present],
            )
        ],
    )
    st.plotly_chart(
        share_of_reasons(reasons, REASON_WORDS),
        key=f"{BLANKS}.shares",
        config={"displayModeBar": False},
        alt=all_blanks_in_words(reasons),
    )
    prose.markdown(
        "\n".join(f"- **{REASON_WORDS[cause].capitalize()}**: {REASONS_EXPLAINED[cause]}" for cause in present)
    )
    if not all(result.settings.gives_reasons for result in view.results.values()):
        prose.caption(OPENCV_REASONS)


def reasons_of(view: DepthView, name: str) -> ReasonMap:
    """Return the reason for every pixel of one map; OpenCV's reasons are found by matching again."""
    result = view.results[name]
    if result.settings.gives_reasons:
        return result.reason
    return computed(
        "reasons",
        lambda progress: blank_reasons(result, view.pair.left, view.pair.right, progress=progress),
        inputs=view.pair.digest,
        settings=settings_key(result),
        shared=view.pair.shared,
        label=f"Finding the reasons of {name} …",
    )
