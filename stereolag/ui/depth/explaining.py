"""Explanations of a map: the scores of one window, the overlap of windows, and the reasons for blank pixels."""

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
    MAX_MATCH_ERROR_PX,
    NO_EXAMPLE,
    REASONS_EXPLAINED,
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
"""Rows above and below that are scored for the surface of scores, where only the row itself is searched."""
MIN_DRAWN_DIFFERENCE_PX = 1e-4
"""Disparities of a map closer than this to that of the match are not drawn separately, px."""

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
    """Show the window of a pixel, its search area, all scores, and the disparity of each method."""
    matcher, pair = _matcher_to_explain(view), view.pair
    if matcher is None:
        prose.info("Correlation has no result to explain yet.")
        return
    pixel_key = f"{INSPECTION}.pixel.{pair.digest}"
    _offer_examples(pair, matcher, pixel_key)
    height, width = pair.left.shape[:2]
    row, col = st.session_state.get(pixel_key, (height // 2, width // 2))
    pixel = min(row, height - 1), min(col, width - 1)
    match = explain_match(matcher, pair.left, pair.right, *pixel)
    truth = math.nan if pair.truth is None else float(pair.truth[pixel])
    places = {
        "Runner-up": match.runner_up,
        "True place": None if math.isnan(truth) else (0, -round(truth)),
        "Found": match.peak,
    }
    lags = {name: lag for name, lag in places.items() if lag is not None}
    # Above the pictures, so that a phone or a low screen shows them together with the view that follows the pointer.
    if can_follow_pointer(pair, matcher):
        show_hovered_match(pair, matcher, pixel, pictures=INSPECTION)
    else:
        prose.caption(
            "The scores do not follow the pointer here: phase correlation, a very large search or a very large pair "
            "takes too long in the browser. Click a pixel instead."
        )
    _show_places(pair, match, pixel, lags, pixel_key)
    _show_verdict(view, matcher, match, pixel, truth)
    patches, scores = st.columns([1, 1.7], gap="medium")
    with patches:
        _show_patches(pair, match, lags)
    with scores:
        _show_scores(pair, matcher, match, pixel)
    _show_row(view, match, pixel)
    show_overlap(view, matcher, match)


def _show_places(pair: Pair, match: MatchExplanation, pixel: Pixel, lags: Mapping[str, Lag], pixel_key: str) -> None:
    """Show the window in the left image and its places in the right one; a click stores the pixel under `pixel_key`."""
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
                alternative=lambda: f"the window at row {match.window.row}, column {match.window.col}, framed",
            ),
            Picture(
                "Right image: the search area and the matches",
                as_rgb(pair.right),
                photograph=True,
                pickable=False,
                alternative=lambda: scores_in_words(match, "framed places"),
            ),
        ],
        key=INSPECTION,
        columns=2,
        legends=[word_legend("", [*legend.values()], [*legend])],
        marks=[
            _frame(match.search, SEARCH_COLOUR, 1),
            _frame(match.window, WINDOW_COLOUR, 0),
            *(_frame(match.window_at(lag), PLACES[name], 1) for name, lag in lags.items()),
            Mark(*pixel, WINDOW_COLOUR, pictures=(0,)),
        ],
        on_pick=lambda row, col: st.session_state.update({pixel_key: (row, col)}),
    )


MAX_FOLLOWED_PIXELS = 6_000_000
"""Largest image whose pair is sent to the browser, px; that is some megabytes."""

MAX_PRODUCTS_PER_WINDOW = 30_000_000
"""Most products of pixels for one window: as many as the browser can sum within a frame or two."""


def can_follow_pointer(pair: Pair, matcher: CorrelationMatcher) -> bool:
    """Return whether the browser can score windows as fast as the pointer moves."""
    lags = matcher.search.lags(matcher.window_size)
    height, width = pair.left.shape[:2]
    small = height * width <= MAX_FOLLOWED_PIXELS and lags.count * matcher.window_size**2 <= MAX_PRODUCTS_PER_WINDOW
    return small and matcher.score != "phase" and matcher.window_size <= min(height, width)


def show_hovered_match(pair: Pair, matcher: CorrelationMatcher, pixel: tuple[int, int], *, pictures: str) -> None:
    """Show the match of the window under the crosshair of linked pictures, or at `pixel` while there is no crosshair.

    Parameters
    ----------
    pair, matcher
        The pair and its matcher; see :func:`can_follow_pointer`.
    pixel
        (row, col) in the left image.
    pictures
        Key of the linked pictures, the left image first, then the right one.
    """
    with st.container(gap=None):
        deliver(
            packed_grey_pair(pair.left, pair.right, pair.truth, name=pictures, digest=pair.digest),
            key=f"{pictures}.pair",
        )
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
    return {
        "window_size": size,
        "step": matcher.step,
        "score": matcher.score,
        "circular": matcher.search.circular(size),
        "tried": asdict(matcher.query(as_grey(left), as_grey(right)).lags),
        "asked": asdict(matcher.search.lags(size)),
        "ambiguous_margin": AMBIGUOUS_MARGIN,
        "rival_share": RIVAL_SHARE,
        "poor_score": POOR_SCORE,
        "bare_contrast": BARE_CONTRAST,
    }


def _matcher_to_explain(view: DepthView) -> CorrelationMatcher | None:
    """Return the correlation of the view or, without one, that whose scores semi-global optimisation starts from."""
    shown = [result.settings for result in view.results.values()]
    correlation = next((matcher for matcher in shown if isinstance(matcher, CorrelationMatcher)), None)
    semi_global = next((matcher for matcher in shown if isinstance(matcher, SemiGlobalMatcher)), None)
    if correlation is not None or semi_global is None:
        return correlation
    return CorrelationMatcher(
        window_size=semi_global.window_size,
        overlap=1 - 1 / semi_global.window_size,
        search=SearchArea.rectified(semi_global.num_disparities, semi_global.min_disparity),
    )


def _offer_examples(pair: Pair, matcher: CorrelationMatcher, pixel_key: str) -> None:
    """Offer to find an example of each kind of match in this pair; it is stored under `pixel_key`."""
    with st.container(horizontal=True, vertical_alignment="center"):
        prose.markdown("Show me", width="content")
        pressed = [
            kind
            for kind, icon in EXAMPLE_ICONS.items()
            if st.button(EXAMPLE_LABELS[kind], icon=icon, key=f"{INSPECTION}.{kind}")
        ]
    for kind in pressed:
        with shown_progress("Looking for an example …") as progress:
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
    view: DepthView, matcher: CorrelationMatcher, match: MatchExplanation, pixel: Pixel, truth: float
) -> None:
    """Show a paragraph about the match, as a success if it is clear and not known to be wrong."""
    visible = view.pair.visible is None or bool(view.pair.visible[pixel])
    result = next((result for result in view.results.values() if result.settings == matcher), None)
    reason, disparity = (Reason(result.reason[pixel]), float(result.disparity[pixel])) if result else (None, math.nan)
    verdict = match_verdict(match, truth, visible=visible, reason=reason, disparity=disparity)
    right = match.kind is MatchKind.CLEAR and not abs(match.disparity - truth) > MAX_MATCH_ERROR_PX
    (prose.success if right else prose.warning)(verdict)
    if result is None:
        prose.caption(
            "These are the raw scores of the windowed correlation. Semi-global optimisation weighs them, together with "
            "its other costs, against those of the neighbours along eight paths, and may choose another peak."
        )


def _show_patches(pair: Pair, match: MatchExplanation, lags: Mapping[str, Lag]) -> None:
    """Show the window and the places it is compared with, enlarged."""
    prose.markdown("### The windows compared")
    scores = {"Found": match.peak_score, "Runner-up": match.runner_up_score}
    if "True place" in lags:
        scores["True place"] = match.score_at(lags["True place"])
    places = [
        ("Left image", "", pair.left, match.window),
        *(
            (name, f": **{score:.3f}**", pair.right, match.window_at(lags[name]))
            for name, score in scores.items()
            if not math.isnan(score)
        ),
    ]
    with st.container(horizontal=True, gap="small"):
        for name, score, image, box in places:
            with st.container(width=150):
                show_picture(patch_png(image, box), f"{name}: the window at row {box.row}, column {box.col}, enlarged")
                prose.caption(f"{name}{score}")
    prose.caption(
        "Enlarged, in grey as they are compared, each stretched to full contrast. "
        f"The window itself has {percent(match.contrast)} of the image’s contrast."
    )


def _show_scores(pair: Pair, matcher: CorrelationMatcher, match: MatchExplanation, pixel: Pixel) -> None:
    """Show the scores of all lags, including some in rows above and below that were not searched."""
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
    if match.peak is None:
        prose.caption("There is no score to show.")
        return
    draw, name = (score_landscape, "hill") if shape == "Surface" else (score_map, "above")
    show_chart(draw(around, match), f"{INSPECTION}.{name}", scores_in_words(match, "The scores of all places"))
    if around.dy.size > match.dy.size:
        prose.caption(
            "A sharp peak is a sure match; along a ridge it can slide, several peaks compete, and a plain has no "
            "match. Only the middle row is searched; the rows above and below are shown for the shape."
        )


def _show_row(view: DepthView, match: MatchExplanation, pixel: Pixel) -> None:
    """Show the scores along the row, the sub-pixel fit, and the disparity of every method here."""
    maps = view.maps
    drawn = {
        name: float(disparity[pixel])
        for name, disparity in maps.items()
        if -match.dx[-1] <= disparity[pixel] <= -match.dx[0]
        and abs(disparity[pixel] - match.disparity) > MIN_DRAWN_DIFFERENCE_PX
    }
    row, fit = st.columns([1.7, 1], gap="medium")
    with row:
        prose.markdown("### Along the row")
        show_chart(
            score_row(match, view.pair.right, drawn),
            f"{INSPECTION}.row",
            scores_in_words(match, "The scores along the row"),
        )
    with fit:
        prose.markdown("### Between the pixels")
        if match.peak is None or np.isnan(match.fit(0.0)):
            prose.caption("A match at the edge has no sub-pixel position: its neighbour on one side is missing.")
        else:
            show_chart(sub_pixel_fit(match), f"{INSPECTION}.fit", fit_in_words(match))
            prose.caption(
                "A section through the bell fitted to the best score and its eight neighbours: its peak is the "
                "disparity."
                if len(match.around) > 1
                else "A bell curve through the best score and its two neighbours: its peak is the disparity."
            )
    prose.markdown("### The disparity by each method")
    prose.markdown(
        markdown_table(
            [["method", "disparity"], *([f"**{name}**", disparity_in_words(view, name, pixel)] for name in maps)]
        )
    )


def show_overlap(view: DepthView, matcher: CorrelationMatcher, match: MatchExplanation) -> None:
    """Show the explained window among its neighbours, and the number of map values there."""
    height, width = view.pair.left.shape[:2]
    grid = window_grid((height, width), match.window, matcher.step)
    prose.markdown("### How the windows overlap")
    figure, words = st.columns([1.3, 1], gap="medium", vertical_alignment="center")
    description = overlap_in_words(grid, matcher.overlap)
    with figure:
        show_chart(overlap_figure(view.pair.left, grid), f"{INSPECTION}.overlap", description)
    with words:
        prose.markdown(description)


@fragment
def show_blanks(view: DepthView) -> None:
    """Show where each method has no measurement and why, and the share of the image lost to each reason."""
    reasons = {name: reasons_of(view, name) for name in view.results}
    present = [cause for cause in REASON_COLOURS if any((causes == cause).any() for causes in reasons.values())]
    linked_pictures(
        [
            Picture(
                name,
                reasons_picture(causes, view.pair.left),
                (Reading(causes, words=tuple(REASON_WORDS[cause] for cause in Reason)),),
                alternative=partial(blanks_in_words, causes),
            )
            for name, causes in reasons.items()
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
            "StereoBM and StereoSGBM do not give reasons. Theirs were found by matching again, each time with one "
            "filter switched off: a pixel that comes back had been blanked by that filter."
        )
