"""Why this match, and why none: the scores of one window, the overlap of windows, and blank pixels by reason."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from functools import partial

import numpy as np
import streamlit as st

from stereolag import CorrelationMatcher, Reason, SearchArea, SemiGlobalMatcher
from stereolag.assess.explaining import (
    AMBIGUOUS_MARGIN,
    BARE_CONTRAST,
    POOR_SCORE,
    RIVAL_SHARE,
    ExampleKind,
    Lag,
    MatchExplanation,
    MatchKind,
    example_pixel,
    explain_match,
    with_rows_around,
)
from stereolag.core.arrays import Box
from stereolag.core.inputs import Image, as_grey
from stereolag.core.typography import percent
from stereolag.figures.legends import hexadecimal, word_legend
from stereolag.figures.maps import REASON_COLOURS, reasons_picture, share_of_reasons
from stereolag.figures.match import (
    RUNNER_UP_COLOUR,
    SEARCH_COLOUR,
    TRUTH_COLOUR,
    WINDOW_COLOUR,
    overlap_figure,
    patch_png,
    score_landscape,
    score_map,
    score_row,
    sub_pixel_fit,
    window_grid,
)
from stereolag.figures.pictures import CORRELATION, VIRIDIS, as_rgb
from stereolag.figures.verdicts import REASON_WORDS, blanks_in_words
from stereolag.pair import Pair
from stereolag.ui import prose
from stereolag.ui.components import component, deliver, packed_grey_pair
from stereolag.ui.depth.maps import disparity_in_words, reasons_of
from stereolag.ui.depth.sentences import (
    EXAMPLE_LABELS,
    HOVER_WORDS,
    NO_EXAMPLE,
    REASONS_EXPLAINED,
    RIGHT_PX,
    all_blanks_in_words,
    fit_in_words,
    markdown_table,
    match_verdict,
    overlap_in_words,
    scores_in_words,
)
from stereolag.ui.depth.view import DepthView, Pixel
from stereolag.ui.elements import show_chart, show_picture, shown_progress
from stereolag.ui.linked_pictures import Mark, Picture, Reading, linked_pictures
from stereolag.ui.navigation import fragment

INSPECTION, BLANKS = "depth.inspection", "depth.blanks"
ROWS_AROUND = 8
SAME_PX = 1e-4
"""Disparities this close to that of the match are not drawn separately, px."""

PLACES = {"Runner-up": RUNNER_UP_COLOUR, "True place": TRUTH_COLOUR, "Found": WINDOW_COLOUR}
"""The places of one match in the right image, and the colours of their frames; later ones are drawn on top."""

EXAMPLE_ICONS = {
    ExampleKind.CLEAR: ":material/check_circle:",
    ExampleKind.REPEATS: ":material/fence:",
    ExampleKind.BARE: ":material/square:",
    ExampleKind.HIDDEN: ":material/visibility_off:",
}


@fragment
def show_inspection(view: DepthView) -> None:
    """Show the window of one pixel, its search area, all scores, and the disparity of each method."""
    matcher, pair = _correlation(view), view.pair
    if matcher is None:
        prose.info("Correlation has no result to explain yet.")
        return
    pixel_key = f"{INSPECTION}.pixel.{pair.digest}"
    _offer_examples(pair, matcher, pixel_key)
    height, width = pair.left.shape[:2]
    row, col = st.session_state.get(pixel_key, (height // 2, width // 2))
    pixel = min(row, height - 1), min(col, width - 1)
    seen = explain_match(matcher, pair.left, pair.right, *pixel)
    truth = math.nan if pair.truth is None else float(pair.truth[pixel])
    true_lag = None if math.isnan(truth) else (0, -round(truth))
    found = {"Runner-up": seen.runner_up, "True place": true_lag, "Found": seen.peak}
    lags = {name: lag for name, lag in found.items() if lag is not None}
    # Above the pictures, so that a phone or a low screen shows them together with the view that follows the pointer.
    if can_follow(pair, matcher):
        hovered_match(pair, matcher, pixel, pictures=INSPECTION)
    else:
        prose.caption(
            "The scores do not follow the pointer here: phase correlation, a very large search or a very large pair "
            "takes too long in the browser. Click a pixel instead."
        )
    legend = {
        "the window, and where it was found": WINDOW_COLOUR,
        **({} if pair.truth is None else {"the true place": TRUTH_COLOUR}),
        "the runner-up": RUNNER_UP_COLOUR,
        "the search area": SEARCH_COLOUR,
    }
    linked_pictures(
        [
            Picture(
                "Left image: point at it, or click",
                as_rgb(pair.left),
                photograph=True,
                alternative=lambda: f"the window at row {seen.window.row}, column {seen.window.col}, framed",
            ),
            Picture(
                "Right image: where it was looked for",
                as_rgb(pair.right),
                photograph=True,
                pickable=False,
                alternative=lambda: scores_in_words(seen, "framed places"),
            ),
        ],
        key=INSPECTION,
        columns=2,
        legends=[word_legend("", [*legend.values()], [*legend])],
        marks=[
            _frame(seen.search, SEARCH_COLOUR, 1),
            _frame(seen.window, WINDOW_COLOUR, 0),
            *(_frame(seen.window_at(lag), PLACES[name], 1) for name, lag in lags.items()),
            Mark(*pixel, WINDOW_COLOUR, pictures=(0,)),
        ],
        on_pick=lambda row, col: st.session_state.update({pixel_key: (row, col)}),
    )
    _show_verdict(view, matcher, seen, pixel, truth)
    patches, hill = st.columns([1, 1.7], gap="medium")
    with patches:
        _show_patches(pair, seen, lags)
    with hill:
        _show_scores(pair, matcher, seen, pixel)
    _show_row(view, seen, pixel)
    show_overlap(view, matcher, seen)


LARGEST_PIXELS = 6_000_000
"""Largest image whose pair is sent to the browser, pixels; that is some megabytes."""

MOST_PRODUCTS = 30_000_000
"""Products of pixels per window that the browser can sum within a frame or two."""


def can_follow(pair: Pair, matcher: CorrelationMatcher) -> bool:
    """Return whether the browser can score windows as fast as a pointer moves."""
    lags = matcher.search.lags(matcher.window_size)
    height, width = pair.left.shape[:2]
    small = height * width <= LARGEST_PIXELS and lags.count * matcher.window_size**2 <= MOST_PRODUCTS
    return small and matcher.score != "phase" and matcher.window_size <= min(height, width)


def hovered_match(pair: Pair, matcher: CorrelationMatcher, pixel: tuple[int, int], *, pictures: str) -> None:
    """Show the match of the window under the crosshair of linked pictures, or at `pixel` while there is none.

    Parameters
    ----------
    pair, matcher
        The pair and its matcher; see :func:`can_follow`.
    pixel
        (row, col) in the left image.
    pictures
        Key of the linked pictures, the left image first, then the right one.
    """
    with st.container(gap=None):
        grey = packed_grey_pair(pair.left, pair.right, pair.truth, name=pictures, digest=pair.digest)
        deliver(grey, key=f"{pictures}.pair")
        component("hovered_match")(
            key=f"{pictures}.hovered",
            data={
                **browser_settings(matcher, pair.left, pair.right),
                "pictures": pictures,
                "digest": pair.digest,
                "pixel": {"row": pixel[0], "col": pixel[1]},
                "colours": {
                    "peak": WINDOW_COLOUR,
                    "runner_up": RUNNER_UP_COLOUR,
                    "truth": TRUTH_COLOUR,
                    "search": SEARCH_COLOUR,
                    "curve": CORRELATION,
                },
                "palette": VIRIDIS[::17].tolist(),
                "words": HOVER_WORDS,
            },
        )


def browser_settings(matcher: CorrelationMatcher, left: Image, right: Image) -> dict[str, object]:
    """Return the settings of a matcher and the constants of its explanation that ``scoring.js`` needs."""
    size = matcher.window_size
    tried = matcher.query(as_grey(left), as_grey(right)).lags
    return {
        "window_size": size,
        "step": matcher.step,
        "score": matcher.score,
        "circular": matcher.search.circular(size),
        "tried": asdict(tried),
        "asked": asdict(matcher.search.lags(size)),
        "ambiguous_margin": AMBIGUOUS_MARGIN,
        "rival_share": RIVAL_SHARE,
        "poor_score": POOR_SCORE,
        "bare_contrast": BARE_CONTRAST,
    }


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


def _offer_examples(pair: Pair, matcher: CorrelationMatcher, pixel_key: str) -> None:
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
            pixel = example_pixel(kind, matcher, pair.left, pair.right, progress=progress)
        if pixel:
            st.session_state[pixel_key] = pixel
        else:
            prose.info(NO_EXAMPLE[kind])


def _frame(box: Box, colour: str, picture: int) -> Mark:
    return Mark(
        box.row,
        box.col,
        colour,
        height=box.height,
        width=box.width,
        dashed=colour in (SEARCH_COLOUR, TRUTH_COLOUR),
        filled=colour == SEARCH_COLOUR,
        pictures=(picture,),
    )


def _show_verdict(
    view: DepthView, matcher: CorrelationMatcher, seen: MatchExplanation, pixel: Pixel, truth: float
) -> None:
    visible = view.pair.visible is None or bool(view.pair.visible[pixel])
    own = next((result for result in view.results.values() if result.settings == matcher), None)
    reason, disparity = (Reason(own.reason[pixel]), float(own.disparity[pixel])) if own else (None, math.nan)
    said = match_verdict(seen, truth, visible=visible, reason=reason, disparity=disparity)
    right = seen.kind is MatchKind.CLEAR and not abs(seen.disparity - truth) > RIGHT_PX
    (prose.success if right else prose.warning)(said)
    if own is None:
        prose.caption(
            "These are the raw scores of the windowed correlation. Semi-global optimisation weighs them, together with "
            "its other costs, against those of the neighbours along eight paths, and may choose another peak."
        )


def _show_patches(pair: Pair, seen: MatchExplanation, lags: Mapping[str, Lag]) -> None:
    """Show the window beside the places found, enlarged."""
    prose.markdown("### The windows compared")
    scores = {"Found": seen.peak_score, "Runner-up": seen.runner_up_score}
    scores |= {"True place": seen.score_at(lags["True place"])} if "True place" in lags else {}
    places = [("Looked for", "", pair.left, seen.window)]
    places += [
        (name, f": **{score:.3f}**", pair.right, seen.window_at(lags[name]))
        for name, score in scores.items()
        if not math.isnan(score)
    ]
    with st.container(horizontal=True, gap="small"):
        for name, score, image, box in places:
            with st.container(width=150):
                show_picture(patch_png(image, box), f"{name}: the window at row {box.row}, column {box.col}, enlarged")
                prose.caption(f"{name}{score}")
    prose.caption(
        "Enlarged, in grey as they are compared, each stretched to full contrast. "
        f"The window actually has {percent(seen.contrast)} of the image’s contrast."
    )


def _show_scores(pair: Pair, matcher: CorrelationMatcher, seen: MatchExplanation, pixel: Pixel) -> None:
    """Show the scores of all lags, and of some rows above and below that were not searched."""
    prose.markdown("### The score of every place")
    around = explain_match(with_rows_around(matcher, ROWS_AROUND), pair.left, pair.right, *pixel)
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
    draw, name = (score_landscape, "hill") if shape == "Surface" else (score_map, "above")
    show_chart(draw(around, seen), f"{INSPECTION}.{name}", scores_in_words(seen, "The scores of all places"))
    if around.dy.size > seen.dy.size:
        prose.caption(
            "A sharp peak is a sure match; along a ridge it can slide, several peaks compete, and a plain has no "
            "match. Only the middle row is searched; the rows above and below are shown for the shape."
        )


def _show_row(view: DepthView, seen: MatchExplanation, pixel: Pixel) -> None:
    """Show the scores along the row, the sub-pixel fit, and the disparity of every method here."""
    maps = view.maps
    drawn = {
        name: float(disparity[pixel])
        for name, disparity in maps.items()
        if -seen.dx[-1] <= disparity[pixel] <= -seen.dx[0] and abs(disparity[pixel] - seen.disparity) > SAME_PX
    }
    row, fit = st.columns([1.7, 1], gap="medium")
    with row:
        prose.markdown("### Along the row")
        show_chart(
            score_row(seen, view.pair.right, drawn),
            f"{INSPECTION}.row",
            scores_in_words(seen, "The scores along the row"),
        )
    with fit:
        prose.markdown("### Between the pixels")
        if seen.peak is None or np.isnan(seen.fit(0.0)):
            prose.caption("A match at the edge has no sub-pixel position: its neighbour on one side is missing.")
        else:
            show_chart(sub_pixel_fit(seen), f"{INSPECTION}.fit", fit_in_words(seen))
            prose.caption(
                "A section through the bell fitted to the best score and its eight neighbours: its peak is the "
                "disparity."
                if len(seen.around) > 1
                else "A bell curve through the best score and its two neighbours: its peak is the disparity."
            )
    prose.markdown("### The disparity by each method")
    lines = [[f"**{name}**", disparity_in_words(view, name, pixel)] for name in maps]
    prose.markdown(markdown_table([["method", "disparity"], *lines]))


def show_overlap(view: DepthView, matcher: CorrelationMatcher, seen: MatchExplanation) -> None:
    """Show the explained window among its neighbours, and the number of map values there."""
    height, width = view.pair.left.shape[:2]
    grid = window_grid((height, width), seen.window, matcher.step)
    prose.markdown("### How the windows overlap")
    figure, words = st.columns([1.3, 1], gap="medium", vertical_alignment="center")
    said = overlap_in_words(grid, matcher.overlap)
    with figure:
        show_chart(overlap_figure(view.pair.left, grid), f"{INSPECTION}.overlap", said)
    with words:
        prose.markdown(said)


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
    show_chart(share_of_reasons(reasons, REASON_WORDS), f"{BLANKS}.shares", all_blanks_in_words(reasons))
    prose.markdown(
        "\n".join(f"- **{REASON_WORDS[cause].capitalize()}**: {REASONS_EXPLAINED[cause]}" for cause in present)
    )
    if not all(result.settings.gives_reasons for result in view.results.values()):
        prose.caption(
            "StereoBM and StereoSGBM do not give reasons. Theirs were found by matching again with one filter after "
            "another switched off: the filter whose absence brings a pixel back had blanked it."
        )
