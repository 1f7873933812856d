"""Result of the search page: the answer with its places framed, its score map, and the files to take away."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import streamlit as st

from stereolag.core.inputs import Image
from stereolag.core.searches import TemplateQuery
from stereolag.figures import templates as figures
from stereolag.figures.verdicts import doubtful, framed_in_words, headline, is_cut_off, place
from stereolag.io.images import image_png, image_tiff
from stereolag.io.programs import find_command, find_script
from stereolag.io.results import matches_csv, matches_json
from stereolag.templates import TemplateMatch, TemplateSearch
from stereolag.ui import prose
from stereolag.ui.downloads import File, take_away
from stereolag.ui.elements import Number, announce, show_line, show_picture
from stereolag.ui.inputs import PictureAndTemplate
from stereolag.ui.results import remembered
from stereolag.ui.search.panels import packed, search_by_hand, show_score_map
from stereolag.ui.search.sentences import (
    found_in_words,
    left_out_in_words,
    nearest_in_words,
    why_no_score_map,
    why_not_found,
)
from stereolag.ui.sentences import duration

CLOSE_UPS = 3

KEY = "template.take"

BYTES_OF_A_PIXEL = 24
"""Memory while the ZIP is made: the image in colour, framed, and both as files."""


def show_answer(result: TemplateSearch, query: TemplateQuery) -> None:
    """Show the result in words and one line of numbers."""
    prose.header(headline(result), anchor=False)
    announce(f"{headline(result)}. Score {_score(result.best)}.")
    best, rival = result.best, result.rivals[0] if result.rivals else None
    meaning = "Of the best place: 1 for an exact copy, whatever its brightness and contrast."
    show_line(
        (
            Number("Score", _score(best), meaning),
            Number("Best rival", _score(rival), "The best place elsewhere."),
            Number("Places found", f"{result.clear}", "Places that show the template."),
            Number("Candidates scored", f"{result.candidates:,}", "Places at which the correlation was computed."),
            Number("Computed in", duration(result.elapsed_s), "Time of the computation alone, when first run."),
        )
    )
    if not result.found:
        prose.warning(why_not_found(result, query), icon=":material/search_off:")
    elif remark := found_in_words(result):
        prose.info(remark, icon=":material/info:")
    for said in filter(None, (nearest_in_words(result), left_out_in_words(result))):
        prose.caption(said)


def drag_it(inputs: PictureAndTemplate, result: TemplateSearch, query: TemplateQuery) -> None:
    """Show the template to drag over the image, and below it the score of every place."""
    search_by_hand(inputs, result, query)
    show_scores(inputs, result, query)


def show_places(inputs: PictureAndTemplate, result: TemplateSearch, query: TemplateQuery) -> None:
    """Show the places framed in the image, and the best ones enlarged beside it."""
    whole, beside = st.columns([3, 1], gap="medium")
    with whole:
        places = result.matches[: result.clear]
        show_picture(
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
            show_picture(figures.what_counts(inputs.template, inputs.mask), "The template", "the template")
        for match in (places or doubtful(result))[:CLOSE_UPS]:
            close_up = partial(
                figures.match_close_up,
                inputs.picture,
                match,
                doubtful=not result.found,
                template=inputs.template.shape,
            )
            drawn = drawn_once(f"close-up at {place(match)}", close_up, inputs, query)
            show_picture(drawn, f"The image up close at {place(match)}", place(match))


def drawn_once(what: str, draw: Callable[[], bytes], inputs: PictureAndTemplate, query: TemplateQuery) -> bytes:
    """Return a drawing of a search, cached: the page reruns for other controls too."""
    return remembered(what, draw, inputs=inputs.digest, settings=query.model_dump_json(), shared=inputs.shared)


def _score(match: TemplateMatch | None) -> str:
    return "–" if match is None else f"{match.score:.3f}"


def show_scores(inputs: PictureAndTemplate, result: TemplateSearch, query: TemplateQuery) -> None:
    """Show the map of scores, one for every position of the template."""
    score_map = result.score_map
    if score_map is None:
        prose.caption(why_no_score_map(query))
        return
    prose.markdown("### How well it fits at every place")
    scores, legend = st.columns([3, 1], gap="medium")
    with scores:
        marked = result.matches[: result.clear] or doubtful(result)
        show_score_map(drawn_once("score map", lambda: packed(score_map, marked), inputs, query))
    alt = "Colours of the scores: dark at 0, yellow at 1."
    legend.plotly_chart(figures.score_legend(), key="score_legend", config={"displayModeBar": False}, alt=alt)
    legend.caption("Each pixel is the score with the template’s top-left corner there. Grey: nothing to correlate.")
    if is_cut_off(result):
        legend.caption("The place found is not on the map: part of it is outside the image.")


def show_match_files(inputs: PictureAndTemplate, result: TemplateSearch, query: TemplateQuery) -> None:
    """Offer the files of a template search."""
    memory = BYTES_OF_A_PIXEL * inputs.picture.shape[0] * inputs.picture.shape[1]
    files, command = match_files(inputs, result, query), find_command(query, *_names(inputs))
    take_away(files, memory, command, "search again", own=inputs.own, by_hand=inputs.by_hand, key=KEY)


def match_files(inputs: PictureAndTemplate, result: TemplateSearch, query: TemplateQuery) -> list[File]:
    """Return the files of a template search, in the order they are offered."""
    names = _names(inputs)
    rows, cols = inputs.picture.shape[:2]
    files = [
        File(
            "Matches CSV",
            "matches.csv",
            partial(matches_csv, result),
            "One line per match, best first; clear is 1 where it can be relied on.",
        ),
        File(
            "Matches JSON",
            "matches.json",
            partial(matches_json, result, query),
            "The matches, figures and settings, with the names of stereolag find --json.",
        ),
        File(
            "Framed PNG",
            "framed.png",
            partial(
                figures.framed,
                inputs.picture,
                result.matches[: result.clear],
                doubtful(result),
                template=inputs.template.shape,
                width=cols,
            ),
            f"The image at full size, {cols} × {rows} pixels, with a frame around every match, dashed where it is "
            "doubtful.",
            "" if result.best else "Nothing was found to frame.",
        ),
        File("Python script", "reproduce.py", partial(find_script, query, *names), "Searches again."),
        _image_file(names[0], inputs.picture, "The image."),
        _image_file(names[1], inputs.template, "The template."),
    ]
    if names[2] is not None and inputs.mask is not None:
        files.append(_image_file(names[2], inputs.mask, "The mask: above 0 where the template counts."))
    return files


def _names(inputs: PictureAndTemplate) -> tuple[str, str, str | None]:
    """Return the file names of the image, the template and its mask, if any."""
    mask = None if inputs.mask is None else _name("mask", inputs.mask)
    return _name("image", inputs.picture), _name("template", inputs.template), mask


def _name(stem: str, image: Image) -> str:
    """Return a file name whose format stores the image without loss."""
    return f"{stem}.tif" if image.dtype.kind == "f" else f"{stem}.png"


def _image_file(name: str, image: Image, meaning: str) -> File:
    return File("", name, partial(image_tiff if image.dtype.kind == "f" else image_png, image), meaning)
