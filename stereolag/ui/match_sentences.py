"""Sentences about one match: the shape of its scores, whether it is right, and its fate in the map."""

from __future__ import annotations

import math

from stereolag.assess.explaining import DEEP_VALLEY, ExampleKind, MatchExplanation, MatchKind
from stereolag.stereo.reasons import Reason
from stereolag.ui.sentences import REASON_WORDS, percent

RIGHT_PX = 1.0
"""Largest error of a match called right, px."""

SAME_PX = 0.05
"""Disparities that differ by no more than this are given once, px."""

EXAMPLE_LABELS = {
    ExampleKind.CLEAR: "A clear match",
    ExampleKind.REPEATS: "A pattern that repeats",
    ExampleKind.BARE: "A bare wall",
    ExampleKind.HIDDEN: "Hidden from the right camera",
}
NO_EXAMPLE = {
    ExampleKind.CLEAR: "No window of this pair has one clear peak with these window and search settings.",
    ExampleKind.REPEATS: "Nothing repeats here: no window examined has a second place, away from the peak’s own "
    "slopes, that scores nearly as high as the best.",
    ExampleKind.BARE: "Every window has enough texture with these settings: there is no bare wall.",
    ExampleKind.HIDDEN: "No part of this pair was found to be hidden from the right camera.",
}
NO_CORRELATION = "Correlation has no result to explain yet."
BEFORE_OPTIMISATION = (
    "These are the raw scores of the windowed correlation. Semi-global optimisation weighs them, together with its "
    "other costs, against those of the neighbours along eight paths, and may choose another peak."
)
ROW_FIT = "A bell curve through the best score and its two neighbours: its peak is the disparity."
SQUARE_FIT = "A section through the bell fitted to the best score and its eight neighbours: its peak is the disparity."
NO_FIT = "A match at the edge has no sub-pixel position: its neighbour on one side is missing."
TOO_MUCH_TO_FOLLOW = (
    "The scores do not follow the pointer here: phase correlation, a very large search or a very large pair takes too "
    "long in the browser. Click a pixel instead."
)
HIDDEN_FROM_RIGHT = (
    "The right camera cannot see this point, because something nearer hides it: the window matched the point’s "
    "surroundings."
)

HOVER_WORDS = {
    "title": "The match of the window under the pointer",
    "window": "Window, left",
    "above": "Every score, from above",
    "axis": "The search in the right image, and its scores:  ← nearer    disparity, px    farther →",
    "row": "Row",
    "column": "column",
    "up": "up",
    "down": "down",
    "peak": "best",
    "runner_up": "runner-up",
    "truth": "true place",
    "kinds": {
        MatchKind.CLEAR: "one clear peak",
        MatchKind.REPEATS: "two peaks as good as each other",
        MatchKind.SMOOTH: "one broad peak, too smooth to tell neighbours apart",
        MatchKind.BARE: "a bare wall, mostly noise",
        MatchKind.UNLIKE: "nothing looks like this",
        MatchKind.AT_EDGE: "highest at the edge of the search, perhaps higher beyond",
        MatchKind.NOTHING: "nothing to correlate",
    },
}


def match_in_words(seen: MatchExplanation) -> str:
    """Return a sentence about the match based on its scores alone, whatever the map made of it."""
    match seen.kind:
        case MatchKind.NOTHING:
            return "Nothing to correlate: the window is flat, or every place it could match lies outside the image."
        case MatchKind.AT_EDGE:
            return (
                "The best score is on the edge of the search area or of the image, and a better one may be beyond "
                "it: no disparity is taken from it."
            )
        case MatchKind.BARE:
            return (
                f"A bare wall: the window has {percent(seen.contrast)} of the image’s contrast, and its best score is "
                f"{seen.peak_score:.3f}. It compares mostly noise."
            )
        case MatchKind.UNLIKE:
            return f"Nothing looks like this: the best score is {seen.peak_score:.3f}."
        case MatchKind.REPEATS:
            alike = "the pattern repeats, like a fence" if seen.valley_depth > DEEP_VALLEY else "they look alike"
            return (
                f"Two places fit almost equally well ({seen.peak_score:.3f} and {seen.runner_up_score:.3f}), with "
                f"worse ones between them: {alike}."
            )
        case MatchKind.SMOOTH:
            return (
                f"Neighbouring places fit almost equally well ({seen.peak_score:.3f}, and {seen.flank_score:.3f} "
                "farther than 1 px from it): the window is too smooth to tell them apart."
            )
    if math.isnan(seen.runner_up_score):
        return f"One clear peak: {seen.peak_score:.3f}."
    return f"One clear peak: {seen.peak_score:.3f}; the next one scores {seen.runner_up_score:.3f}."


def match_against_truth(seen: MatchExplanation, truth: float) -> str:
    """Return a sentence comparing the match with the ground truth, px; "" if there is nothing to say."""
    disparity = seen.disparity
    if math.isnan(disparity):
        return "" if math.isnan(truth) else _truth_alone(seen, truth)
    if math.isnan(truth):
        return f"The disparity is {disparity:.2f} px, and no ground truth is known here." + DOUBT.get(seen.kind, "")
    both = f"{disparity:.2f} px, and the ground truth is {truth:.2f} px"
    error = abs(disparity - truth)
    if error <= RIGHT_PX:
        return f"{FOUND_RIGHT[seen.kind]}: {both}."
    runner_up = math.nan if seen.runner_up is None else -seen.runner_up[1]
    there = " The true place is the runner-up." if abs(runner_up - truth) <= RIGHT_PX else ""
    return f"{FOUND_WRONG[seen.kind]} by {error:.1f} px: {both}.{there}"


FOUND_RIGHT = {
    MatchKind.CLEAR: "It is **right**",
    MatchKind.REPEATS: "The better of the two is **right**",
    MatchKind.SMOOTH: "The best of them is **right**",
    MatchKind.BARE: "Its place is **right** all the same",
    MatchKind.UNLIKE: "Its place is **right** all the same",
}
FOUND_WRONG = {
    MatchKind.CLEAR: "It is **wrong** all the same,",
    MatchKind.REPEATS: "The better of the two is **wrong**",
    MatchKind.SMOOTH: "The best of them is **wrong**",
    MatchKind.BARE: "Its place is **wrong**",
    MatchKind.UNLIKE: "Its place is **wrong**",
}
DOUBT = {
    MatchKind.REPEATS: " The scores cannot tell which of the two is the true place.",
    MatchKind.SMOOTH: " The scores cannot tell how far off it is.",
    MatchKind.BARE: " The score is weak evidence for it.",
    MatchKind.UNLIKE: " The score is weak evidence for it.",
}


def _truth_alone(seen: MatchExplanation, truth: float) -> str:
    least, most = -int(seen.dx[-1]), -int(seen.dx[0])
    beyond = "" if least <= truth <= most else f", outside the search, which runs from {least} to {most} px"
    return f"The ground truth is {truth:.2f} px{beyond}."


def map_in_words(seen: MatchExplanation, truth: float, reason: Reason, disparity: float) -> str:
    """Return a sentence about the fate of the match in the finished map.

    Parameters
    ----------
    seen
        The match, before any check or filter.
    truth
        Ground truth, px; NaN = unknown.
    reason, disparity
        Reason and disparity of the map at the pixel, px; NaN = blank.
    """
    error = abs(seen.disparity - truth)
    if reason == Reason.FILLED:
        return f"The map filled in {disparity:.2f} px from its surroundings."
    if reason == Reason.MEASURED:
        if math.isnan(disparity) or abs(seen.disparity - disparity) <= SAME_PX:
            return "The map keeps it."
        return f"After filtering, the map has {disparity:.2f} px."
    if math.isnan(seen.disparity):
        return "The map is blank here."
    how = "as it should be" if error > RIGHT_PX else "all the same" if error <= RIGHT_PX else ""
    return f"The map is blank here{f', {how}' if how else ''} ({REASON_WORDS[reason]})."


def verdict(
    seen: MatchExplanation,
    truth: float = math.nan,
    *,
    visible: bool = True,
    reason: Reason | None = None,
    disparity: float = math.nan,
) -> str:
    """Return one consistent paragraph about a match.

    Parameters
    ----------
    seen, truth
        The match, and the ground truth at its pixel, px; NaN = unknown.
    visible
        Whether the right camera sees the pixel, as far as is known.
    reason, disparity
        Reason and disparity at the pixel in the finished map of the same matcher; reason is None if there is no map.
    """
    said = [f"**{match_in_words(seen)}**", match_against_truth(seen, truth)]
    if not visible:
        said.append(HIDDEN_FROM_RIGHT)
    if reason is not None:
        said.append(map_in_words(seen, truth, reason, disparity))
    return " ".join(part for part in said if part)
