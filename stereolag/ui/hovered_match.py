"""The match of the window under the pointer: the window, the strip searched for it, and the score of every position.

It follows the crosshair of :func:`stereolag.ui.linked_pictures.linked_pictures` in the browser, where the scores are
computed too (``web/hovered_match/scoring.js``), without any request to the server.
"""

from __future__ import annotations

from dataclasses import asdict

import streamlit as st

from stereolag.assess.explaining import AMBIGUOUS_MARGIN, BARE_CONTRAST, POOR_SCORE, RIVAL_SHARE
from stereolag.core.inputs import Image, as_grey
from stereolag.figures.match import RUNNER_UP_COLOUR, SEARCH_COLOUR, TRUTH_COLOUR, WINDOW_COLOUR
from stereolag.figures.pictures import CORRELATION, VIRIDIS
from stereolag.pair import Pair
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.ui.components import component, deliver
from stereolag.ui.depth.sentences import HOVER_WORDS
from stereolag.ui.packing import packed_grey_pair

_panel = component("hovered_match")

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
    settings = browser_settings(matcher, pair.left, pair.right)
    with st.container(gap=None):
        grey = packed_grey_pair(pair.left, pair.right, pair.truth, name=pictures, digest=pair.digest)
        deliver(grey, key=f"{pictures}.pair")
        _panel(
            key=f"{pictures}.hovered",
            data={
                **settings,
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
