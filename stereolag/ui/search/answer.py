"""Result of a template search: the headline, the reason if nothing is found, and the places framed."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import streamlit as st

from stereolag.core.searches import TemplateQuery
from stereolag.figures import templates as figures
from stereolag.templates import TemplateMatch, TemplateSearch
from stereolag.ui import prose
from stereolag.ui.announcements import announce
from stereolag.ui.elements import Number, show_numbers, show_png
from stereolag.ui.pictures import PictureAndTemplate
from stereolag.ui.results import remembered
from stereolag.ui.sentences import duration

EQUAL = 0.005
"""Scores that differ by less are reported as equal."""

CLOSE_UPS = 3
SCORES_TOLD = 5

COUNTED = ("No", "One", "Two", "Three", "Four", "Five", "Six", "Seven", "Eight", "Nine", "Ten")


def show_answer(result: TemplateSearch, inputs: PictureAndTemplate, query: TemplateQuery) -> None:
    """Show the result in words and numbers, with the places framed in the picture and enlarged beside it."""
    prose.header(headline(result), anchor=False)
    announce(f"{headline(result)}. Score {_score(result.best)}.")
    if not result.found:
        prose.warning(why_not_found(result, query), icon=":material/search_off:")
    best, rival = result.best, result.rivals[0] if result.rivals else None
    show_numbers(
        (
            Number(
                "Score", _score(best), "Of the best place: 1 for an exact copy, whatever its brightness and contrast."
            ),
            Number("Best rival", _score(rival), "The best place elsewhere. Found means a clear lead over it."),
            Number("Places found", f"{result.clear}", "Places that fit clearly better than all others."),
            Number("Candidates scored", f"{result.candidates:,}", "Places at which the correlation was computed."),
            Number("Took", duration(result.elapsed_s), "Time of the computation alone, when first run."),
        )
    )
    whole, beside = st.columns([3, 1], gap="medium")
    with whole:
        places = result.matches if result.found else []
        show_png(
            drawn_once(
                "places framed",
                lambda: figures.framed(inputs.picture, places, doubtful(result), template=inputs.template.shape),
                inputs,
                query,
            ),
            framed_in_words(result),
        )
    with beside:
        if not result.found:
            show_png(figures.what_counts(inputs.template, inputs.mask), "The template", "the template")
        for match in (result.matches if result.found else doubtful(result))[:CLOSE_UPS]:
            close_up = partial(
                figures.match_close_up,
                inputs.picture,
                match,
                doubtful=not result.found,
                template=inputs.template.shape,
            )
            drawn = drawn_once(f"close-up at {place(match)}", close_up, inputs, query)
            show_png(drawn, f"The image up close at {place(match)}", place(match))


def drawn_once(what: str, draw: Callable[[], bytes], inputs: PictureAndTemplate, query: TemplateQuery) -> bytes:
    """Return a drawing of a search, cached: the page reruns for other controls too."""
    return remembered(what, draw, inputs=inputs.digest, settings=query.model_dump_json(), shared=inputs.shared)


def framed_in_words(result: TemplateSearch) -> str:
    """Return a text alternative for the framed image."""
    framed = [place(match) for match in (result.matches if result.found else doubtful(result))[:SCORES_TOLD]]
    said = f"The image: {headline(result)}."
    return f"{said} Framed{'' if result.found else ', dashed'}: {'; '.join(framed)}." if framed else said


def doubtful(result: TemplateSearch) -> list[TemplateMatch]:
    """Return the places to frame if nothing is found: the look-alikes, or the best one."""
    if result.found or result.best is None:
        return []
    return result.look_alikes or [result.best]


def headline(result: TemplateSearch) -> str:
    """Return the result in one line."""
    if result.reason == "low_score" or result.best is None:
        return "Not found"
    if result.reason == "look_alikes":
        scores = [one.score for one in result.look_alikes]
        if scores[0] - scores[-1] < EQUAL:
            return f"{_counted(len(scores))} places fit equally well"
        told = " ".join(f"{score:.3f}" for score in scores[:SCORES_TOLD])
        return f"{_counted(len(scores))} look-alikes: {told}{' …' if len(scores) > SCORES_TOLD else ''}"
    if result.reason == "other_colours":
        return "Not found in these colours"
    if result.reason == "mirrored":
        return "Not found, but its mirror image is there"
    if result.clear > 1:
        return f"Found at {_counted(result.clear).lower()} places"
    best = result.matches[0]
    posed = "" if _is_upright(best) else f", {_pose(best)}"
    return f"Found at row {best.row}, column {best.col}{posed}"


def why_not_found(result: TemplateSearch, query: TemplateQuery) -> str:
    """Return why the best place is not good enough, and advice on settings to try."""
    sampled = query.method == "sampled"
    if result.best is None and not sampled:
        return "No place has anything to correlate."
    if result.best is None:
        return (
            "No place in the image has exactly these pixels. “FFT” also finds a template that was dimmed, recoloured "
            "or recompressed."
        )
    score, count = f"The best place scores {result.best.score:.3f}", len(result.look_alikes)
    if count and result.best.score - result.look_alikes[-1].score < EQUAL:
        return f"{score}, and so do the others. With {count} matches wanted, all of them are found."
    if count:
        return f"{score}, the next {result.rivals[0].score:.3f}: no clear lead. {_absent(query)}"
    if result.reason == "other_colours":
        return f"{score}, and clearly more with red, green and blue exchanged: the same shape in other colours."
    if result.reason == "mirrored":
        return f"{score}, and clearly more with left and right exchanged. Mirror the template to find it."
    tip = "“FFT” also finds a template that was dimmed or recompressed." if sampled else _absent(query)
    return f"{score}; the minimum is {query.min_score:.2f}. {tip}"


def _absent(query: TemplateQuery) -> str:
    if query.resized:
        return "The template is not in the image, or it is hidden there."
    return "The template is not in the image, or it is hidden, resized or turned there: try other sizes and angles."


def why_no_score_map(query: TemplateQuery) -> str:
    """Return why a search has no score map."""
    if query.resized:
        return "With other sizes and angles a place has many scores: there is no score map to show."
    return "“Sampled” scores a few places only: there is no score map to show."


def place(match: TemplateMatch) -> str:
    """Return the position and score of a match, and its size and angle if they differ from the template's."""
    posed = "" if _is_upright(match) else f", {_pose(match)}"
    return f"row {match.row}, column {match.col}, score {match.score:.3f}{posed}"


def _is_upright(match: TemplateMatch) -> bool:
    return (match.scale, match.rotation) == (1.0, 0.0)


def _pose(match: TemplateMatch) -> str:
    way = "counter-clockwise" if match.rotation > 0 else "clockwise"
    turned = f"turned {abs(match.rotation):.1f}° {way}" if match.rotation else "upright"
    return f"{match.scale:.2f} × its size, {turned}"


def _score(match: TemplateMatch | None) -> str:
    return "–" if match is None else f"{match.score:.3f}"


def _counted(number: int) -> str:
    return COUNTED[number] if number < len(COUNTED) else f"{number}"
