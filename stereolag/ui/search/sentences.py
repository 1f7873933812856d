"""Sentences of the search page: the answer, the damaged image, the comparison with OpenCV, and the panels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from stereolag.core.searches import TemplateQuery
from stereolag.core.typography import duration, typeset
from stereolag.figures.pictures import FRAME
from stereolag.figures.verdicts import EQUAL_SCORES, is_cut_off, place, remark_on
from stereolag.templates import TemplateSearch
from stereolag.templates.by_hand import ReducedSearch
from stereolag.templates.following import Followed
from stereolag.templates.trials import Degradation, OpenCVSearch, Trial
from stereolag.ui.sentences import TEMPLATE_METHODS

MIN_LOOK_ALIKE_SCORE = 0.7
"""Smallest score of a place reported as a look-alike."""

SCORE_TOLERANCE: Final = 1e-4
"""Difference of two implementations' scores up to which they count as equal."""

OUTCOMES: Final = {
    "right": "found",
    "elsewhere": "found elsewhere",
    "missed": "not found",
    "refused": "cannot search here",
}


def found_by_parts(result: TemplateSearch) -> bool:
    """Return whether the score of the best place found counts only its matching parts, unlike that of the score map."""
    if not result.found or result.score_map is None:
        return False
    best = result.matches[0]
    return is_cut_off(result) or float(result.score_map[best.row, best.col]) != best.score


def found_in_words(result: TemplateSearch) -> str:
    """Return how the best place found differs from the template, as sentences; empty if it does not."""
    remark = remark_on(result.matches[0])
    return f"{remark} The score counts only the others." if found_by_parts(result) else remark


def why_not_found(result: TemplateSearch, query: TemplateQuery) -> str:
    """Return why the best place is not good enough, and advice on settings to try."""
    sampled = query.method == "sampled"
    if result.best is None:
        return (
            "No place in the image has exactly these pixels. “FFT” also finds a template that was dimmed, recoloured "
            "or recompressed."
            if sampled
            else "The image is constant, or has missing values, wherever the template could be: choose another image."
        )
    score, count = f"The best place scores {result.best.score:.3f}", len(result.look_alikes)
    if count and result.best.score - result.look_alikes[-1].score < EQUAL_SCORES:
        return f"{score}, and so do the others. Ask for {count} matches to find all of them."
    if count:
        return f"{score}, the next {result.look_alikes[1].score:.3f}: no clear lead. {_absent(query)}"
    if result.reason == "mirrored":
        return f"{score}; mirrored left to right, all of it agrees. Mirror the template to find it."
    if result.reason != "low_score":
        outlined = " They are outlined in the picture." if result.reason == "differs" else ""
        return f"{score}. {remark_on(result.best)}{outlined}"
    tip = "“FFT” also finds a template that was dimmed or recompressed." if sampled else _absent(query)
    return f"{score}; the minimum is {query.min_score:.2f}. {tip}"


def nearest_in_words(result: TemplateSearch) -> str:
    """Return a sentence about the place most similar to the template among those not found; empty if none is."""
    if not result.found or not result.rivals or result.rivals[0].score < MIN_LOOK_ALIKE_SCORE:
        return ""
    rival = result.rivals[0]
    return f"The nearest look-alike is at {place(rival)}. {remark_on(rival)}".strip()


def _absent(query: TemplateQuery) -> str:
    if query.resized:
        return "The template is not in the image, or it is hidden there."
    return "The template is not in the image, or it is hidden, resized or turned there: try other sizes and angles."


def why_no_score_map(query: TemplateQuery) -> str:
    """Return why a search has no score map."""
    if query.resized:
        return "With other sizes and angles each place has many scores: there is no score map to show."
    return "“Sampled” scores only a few places: there is no score map to show."


def numbers_of(trial: Trial) -> str:
    """Return the score and the time of a method; for a miss, its best score."""
    if trial.refusal:
        return trial.refusal
    if trial.row is None:
        return f"no place with these exact pixels · {duration(trial.elapsed_s)}"
    best = "best score" if trial.outcome == "missed" else "score"
    return f"{best} {trial.score:.3f} · {duration(trial.elapsed_s)}"


PATTERNS_ALONE: Final = (
    "Sampled looks for exact pixel values, and no rare one is left. FFT and OpenCV compare whole patterns: a uniform "
    "change of contrast or brightness costs nothing as long as no value is clipped; other damage lowers the score."
)

FOUND_BY_FFT: Final = {
    "right": "Enough pixels are exactly as they were: even Sampled finds it.",
    "refused": "Enough of it is left to compare whole patterns.",
    "elsewhere": PATTERNS_ALONE,
    "missed": PATTERNS_ALONE,
}
"""Lesson when FFT finds the template, by the outcome of Sampled."""


def lesson(trials: Sequence[Trial], degradation: Degradation, min_score: float) -> str:
    """Return a sentence or two on why the methods succeeded or failed."""
    by_method = {trial.method: trial for trial in trials}
    fft, sampled = by_method["fft"], by_method["sampled"]
    if fft.outcome == "refused":
        return fft.refusal
    if fft.outcome == sampled.outcome == "right" and degradation == Degradation():
        return "Nothing is damaged yet. Move a slider until a method loses it."
    if fft.outcome == "right":
        return FOUND_BY_FFT[sampled.outcome]
    reason = (
        "Another place fits better than the damaged one."
        if fft.outcome == "elsewhere"
        else f"The best score, {fft.score:.3f}, is below the minimum score of {min_score:.2f}."
        if fft.row is not None
        else "Nothing is left to correlate."
    )
    if degradation.turn != 0 or degradation.resize != 1:
        reason += " The template is compared as it is: a turned or resized copy no longer lines up with it."
    return reason


def table(ours: TemplateSearch, theirs: OpenCVSearch, method: str, masked: bool) -> str:
    """Return both results as a Markdown table."""
    best = ours.matches[0] if ours.found else None
    answer = f"row {best.row}, column {best.col} | {best.score:.4f}" if best else "not found | –"
    other = f"row {theirs.row}, column {theirs.col} | {theirs.score:.4f}" if theirs.row >= 0 else "none | –"
    name = "OpenCV `matchTemplate`" + (", masked" if masked else "")
    return "\n".join(
        (
            "| | Best place | Score | Time |",
            "|---|---|--:|--:|",
            f"| {TEMPLATE_METHODS[method]} | {answer} | {duration(ours.elapsed_s)} |",
            f"| {name} | {other} | {duration(theirs.elapsed_s)} |",
        )
    )


def differences(ours: TemplateSearch, theirs: OpenCVSearch, method: str) -> list[str]:
    """Return one sentence for each difference and its cause, or that the results agree."""
    undefined = (
        f"In {theirs.undefined:,} places nothing varies under the template: 0/0. OpenCV’s score there is NaN or "
        "infinite, and `cv2.minMaxLoc` then returns no place at all; these places are skipped here."
    )
    places = _about_places(ours, theirs, method) if theirs.row >= 0 else ""
    return [*filter(None, (undefined if theirs.undefined else "", places))]


def _about_places(ours: TemplateSearch, theirs: OpenCVSearch, method: str) -> str:
    if not ours.found:
        also = " Sampled looks for exact pixels; OpenCV compares patterns, as FFT does." if method == "sampled" else ""
        return f"OpenCV always names a place; it does not say whether the template is there.{also}"
    if found_by_parts(ours):
        return "Ours scores the parts that agree; OpenCV compares all pixels, and only places wholly inside the image."
    best = ours.matches[0]
    apart = abs(best.score - theirs.score)
    if (best.row, best.col) == (theirs.row, theirs.col):
        if apart <= SCORE_TOLERANCE:
            return f"The same place; the scores differ by less than {SCORE_TOLERANCE:.4f}."
        return f"The same place; the scores differ by {apart:.2g}: OpenCV sums in single precision."
    if ours.score_map is None:
        if method == "sampled":
            return "Sampled scores a few places only, and stops at the first that are good enough."
        return "Ours looked for other sizes and angles too, which OpenCV does not try."
    here = float(ours.score_map[theirs.row, theirs.col])
    if np.isnan(here):
        return (
            f"At OpenCV’s place the image is flat: there is nothing to correlate, and its score of {theirs.score:.3f} "
            "is a rounding error divided by another. Ours gives such places no score."
        )
    if abs(here - best.score) <= SCORE_TOLERANCE:
        return "Both places score the same: there are several copies."
    return f"Ours scores {here:.3f} at OpenCV’s place: OpenCV sums in single precision, too coarse for these values."


# Panels

SCORE_MAP_WORDS: Final = {
    "hint": "Hover to read a score; click to compare that place above.",
    "reading": "Row {row}, column {col}: score {score}",
    "flat": "Row {row}, column {col}: flat, no score",
    "stage": "Score map. Arrow keys move the cursor, with Shift by ten; Enter compares that place.",
}


def template_words(search: ReducedSearch) -> dict[str, Any]:
    """Return all texts and colours of the panel; `texts` maps CSS selectors to their text."""
    lesson = [
        f" The best rival reaches {score:.3f}."
        if at
        else f"The peak is at row {search.row + row * search.factor}, column {search.col + col * search.factor}: "
        f"{score:.3f}."
        for at, (row, col, score) in enumerate(search.leaders[:2])
    ]
    return {
        "frame": f"rgb{FRAME}",
        "stage": "The image with the template over it. Arrow keys move the template, with Shift by ten.",
        "texts": {
            ".try": "Drag the template over the image. At every place its pixels are multiplied by those under it: "
            "warm where they agree, cool where they do not. The mean of the products, the score, is left behind: dark "
            "at 0, yellow at 1. The template is where it peaks.",
            ".template figcaption": "Template",
            ".window figcaption": "Window",
            ".products figcaption": "Products",
            ".sum .label": "Score",
            ".reveal": "Reveal",
            ".clear": "Clear",
            ".hint": "Drag, click, or use the arrow keys (with Shift by ten). The mean of each colour channel is "
            f"subtracted before multiplying; transparent pixels do not count. {scale_of(search)}",
        },
        "where": "Row {row}, column {col}: {score}",
        "lesson": typeset("".join(lesson)) or "The image is flat: there is nothing to correlate.",
        "top": "Peak",
        "rival": "Rival",
        "go": "Compare this place",
    }


def scale_of(search: ReducedSearch) -> str:
    """Return how the picture was reduced, in a sentence."""
    part = "Only part of the image. " if search.part else ""
    if search.factor == 1:
        return f"{part}Shown at full resolution."
    scores = "; scores are those of the whole image" if search.at_full_size else ""
    return f"{part}Reduced for the browser: each pixel is the mean of {search.factor} × {search.factor}{scores}."


FUNNEL_WORDS: Final[dict[str, Any]] = {
    "texts": {
        ".try": "“Sampled” does not score every place. It takes one pixel of the template, the anchor, and looks for "
        "its exact colour. Go through the steps, then pick another pixel: the rarer its colour, the fewer places are "
        "left.",
        ".anchor figcaption": "Anchor and the ends of its run",
        ".colours .name": "How often the template’s colours occur in the image (logarithmic)",
    },
    "steps": ["All pixels", "This colour", "Both ends agree", "Best"],
    "steps_label": "Steps",
    "said": [
        "Every pixel of the image could be the anchor.",
        "Pixels of exactly this colour, where the template has room around them.",
        "There, both ends of the anchor’s opaque run have the right colours too.",
        "These and all places within one pixel of them are scored: {scored} places.",
    ],
    "best": " Best: row {row}, column {col}, score {score}.",
    "none": " None is left: no place has exactly these colours.",
    "many": " Too many to draw; a rarer colour leaves fewer.",
    "some": " {shown} of them are drawn.",
    "picture": "The image with the pixels that are left at this step.",
    "colours": "Pixel of the template, rarest colour first. Arrow keys pick another.",
    "colour": "Row {row}, column {col} of the template: {count} pixels of its colour",
    "hint": "Click on a bar or on the template to pick another pixel; arrow keys work too.",
    "nothing": "Every colour of this template is too common in the image.",
}


# The camera


METHODS_FOLLOWING: Final = {
    "fft": "Scores every place around the last one, and in the whole picture when it is lost.",
    "sampled": "The report’s Appendix B looks for exact pixels. No camera gives the same pixels twice, so this finds "
    "nothing after the first frame.",
    "direct": "The same scores as FFT, but seconds per frame: the camera uses FFT instead.",
}


FOLLOWING_WORDS: Final[dict[str, Any]] = {
    "hint": "Start the camera, then draw a box around something in its picture: it is followed from frame to frame.",
    "choose": "Draw a box around something. With keys: arrows move the box, with Shift by ten, + and − resize it, "
    "Enter follows it.",
    "stage": "Picture of the camera with a box. Arrow keys move it, with Shift by ten; plus and minus resize it; Enter "
    "follows it, and Escape begins anew.",
    "follow": "Follow the box",
    "again": "New box",
    "freeze": "Freeze",
    "freeze_help": "Continue with this frame and your cut-out as your own files",
    "camera": "Camera",
    "states": {
        "found": ["Found", "All of it is there."],
        "partly_seen": ["Partly seen", "The rest is covered, outside the picture or in a reflection."],
        "look_alikes": ["Look-alikes", "Several places look like it. Only its path tells which one it is."],
        "lost": ["Lost", "The whole picture is being searched for it."],
    },
}


def followed_in_words(followed: Followed) -> str:
    """Return the score of the followed template, and its place, size and angle if it was found."""
    place, score = followed.place, "–" if followed.score is None else f"{followed.score:.2f}"
    where = place and (
        f", row {place.row:,.0f}, column {place.col:,.0f}, size {100 * place.scale:.0f} %, "
        f"turned by {place.rotation:z.0f}°"
    )
    return typeset(f"Score {score}{where}" if where else f"Best score {score}")
