"""The parts of the search page: the answer, its places and files, panels, and other methods.

The panels are the interactive counterparts of Figs. 1.6, 1.9 and B.2 to B.4 of the report. They run in the browser and
send nothing back.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import asdict, replace
from functools import partial
from typing import Any, Final

import streamlit as st

from stereolag.core.jobs import Estimate
from stereolag.core.searches import TemplateQuery
from stereolag.core.typography import duration
from stereolag.figures import templates as figures
from stereolag.figures.pictures import FRAME, data_url, fitted, jpeg, png
from stereolag.figures.verdicts import doubtful, framed_in_words, headline, is_cut_off, place
from stereolag.io.programs import find_command, find_script
from stereolag.io.results import left_out_in_words, matches_csv, matches_json
from stereolag.templates import TemplateMatch, TemplateSearch, estimate_search
from stereolag.templates.by_hand import Anchor, anchors, reduced_search
from stereolag.templates.following import MAX_SIZE, MIN_SIZE, Followed, Follower
from stereolag.templates.poses import Pose
from stereolag.templates.trials import (
    Degradation,
    Trial,
    degraded_part,
    estimate_opencv,
    is_masked,
    opencv_search,
    part_shape,
    try_methods,
)
from stereolag.ui import prose
from stereolag.ui.components import component, packed_item, packed_score_map, packed_search
from stereolag.ui.controls import adopt_value, control
from stereolag.ui.downloads import File, file_of_image, take_away
from stereolag.ui.elements import Number, announce, in_columns, show_numbers, show_picture
from stereolag.ui.navigation import fragment
from stereolag.ui.results import computed, computed_in_turn, computed_or_refused, kept_for, remembered
from stereolag.ui.search.inputs import MIN_SIDE, PICTURES, PictureAndTemplate, read_box
from stereolag.ui.search.sentences import (
    FOLLOWING_WORDS,
    FUNNEL_WORDS,
    OUTCOMES,
    SCORE_MAP_WORDS,
    differences,
    followed_in_words,
    found_in_words,
    lesson,
    nearest_in_words,
    numbers_of,
    table,
    template_words,
    why_no_score_map,
    why_not_found,
)
from stereolag.ui.streams import Message, Stream, connected, frame, open_stream
from stereolag.ui.uploads import OWN, forget_upload, hand_in_picture

MAX_CLOSE_UPS = 3
"""Number of places shown up close."""

ZIP_BYTES_PER_PIXEL = 24
"""Memory per pixel of the image while the ZIP is made: the image in colour, framed, and both as files."""


def show_answer(result: TemplateSearch, query: TemplateQuery) -> None:
    """Show the result in words and one line of numbers."""
    prose.header(headline(result), anchor=False)
    announce(f"{headline(result)}. Score {_score(result.best)}.")
    best, rival = result.best, result.rivals[0] if result.rivals else None
    show_numbers(
        (
            Number(
                "Score",
                _score(best),
                "Of the best place: 1 for an exact copy, whatever its brightness and contrast.",
            ),
            Number("Best rival", _score(rival), "The best score elsewhere."),
            Number("Places found", f"{result.clear}", "Places that show the template."),
            Number("Candidates scored", f"{result.candidates:,}", "Places at which the correlation was computed."),
            Number("Computed in", duration(result.elapsed_s), "Time of the computation alone, when first run."),
        )
    )
    if not result.found:
        prose.warning(why_not_found(result, query), icon=":material/search_off:")
    elif remark := found_in_words(result):
        prose.info(remark, icon=":material/info:")
    for sentence in filter(None, (nearest_in_words(result), left_out_in_words(result))):
        prose.caption(sentence)


def show_places(inputs: PictureAndTemplate, result: TemplateSearch, query: TemplateQuery) -> None:
    """Show the places framed in the image, with the best ones enlarged beside it."""
    whole, beside = st.columns([3, 1], gap="medium")
    with whole:
        places = result.matches[: result.clear]
        show_picture(
            drawn_once(
                "places framed",
                lambda: png(figures.framed(inputs.picture, places, doubtful(result), template=inputs.template.shape)),
                inputs,
                query,
            ),
            framed_in_words(result),
        )
    with beside:
        if not result.found:
            show_picture(figures.masked_template(inputs.template, inputs.mask), "The template", "the template")
        for match in (places or doubtful(result))[:MAX_CLOSE_UPS]:
            close_up = partial(
                figures.match_close_up,
                inputs.picture,
                match,
                doubtful=not result.found,
                template=inputs.template.shape,
            )
            show_picture(
                drawn_once(f"close-up at {place(match)}", close_up, inputs, query),
                f"The image up close at {place(match)}",
                place(match),
            )


def drawn_once(name: str, draw: Callable[[], bytes], inputs: PictureAndTemplate, query: TemplateQuery) -> bytes:
    """Return a drawing of a search, cached because the page also reruns for other controls."""
    return remembered(name, draw, **kept_for(inputs, query.model_dump_json()))


def _score(match: TemplateMatch | None) -> str:
    return "–" if match is None else f"{match.score:.3f}"


def show_scores(inputs: PictureAndTemplate, result: TemplateSearch, query: TemplateQuery) -> None:
    """Show the score map: one score for every position of the template."""
    score_map = result.score_map
    if score_map is None:
        prose.caption(why_no_score_map(query))
        return
    prose.markdown("### How well it fits at every place")
    scores, legend = st.columns([3, 1], gap="medium")
    with scores:
        marked = result.matches[: result.clear] or doubtful(result)
        component("score_map")(
            key="template.score_map",
            data=drawn_once(
                "score map",
                lambda: packed_score_map(
                    png(figures.score_map_picture(score_map, marked)), score_map, name=PANEL_NAME, words=SCORE_MAP_WORDS
                ),
                inputs,
                query,
            ),
        )
    legend.plotly_chart(
        figures.score_legend(),
        key="score_legend",
        config={"displayModeBar": False},
        alt="Colours of the scores: dark at 0, yellow at 1.",
    )
    legend.caption("Each pixel is the score with the template’s top-left corner there. Grey: nothing to correlate.")
    if is_cut_off(result):
        legend.caption("The place found is not on the map: part of it is outside the image.")


def show_match_files(inputs: PictureAndTemplate, result: TemplateSearch, query: TemplateQuery) -> None:
    """Offer the files of a template search."""
    memory = ZIP_BYTES_PER_PIXEL * inputs.picture.shape[0] * inputs.picture.shape[1]
    files, command = match_files(inputs, result, query), find_command(query, *(one.name for one in _inputs(inputs)))
    take_away(files, memory, command, "search again", own=inputs.own, by_hand=inputs.by_hand, key="template.take")


def match_files(inputs: PictureAndTemplate, result: TemplateSearch, query: TemplateQuery) -> list[File]:
    """Return the files of a template search, in the order they are offered."""
    images, (rows, cols) = _inputs(inputs), inputs.picture.shape[:2]
    framed = partial(
        figures.framed,
        inputs.picture,
        result.matches[: result.clear],
        doubtful(result),
        template=inputs.template.shape,
        width=cols,
    )
    return [
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
            "The matches, figures and settings, under the same names as in stereolag find --json.",
        ),
        File(
            "Framed PNG",
            "framed.png",
            lambda: png(framed()),
            f"The image at full size, {cols} × {rows} pixels, with a frame around every match, dashed where it is "
            "doubtful.",
            "" if result.best else "Nothing was found to frame.",
        ),
        File(
            "Python script",
            "reproduce.py",
            partial(find_script, query, *(one.name for one in images)),
            "Searches again.",
        ),
        *images,
    ]


def _inputs(inputs: PictureAndTemplate) -> list[File]:
    """Return the files of the image, the template and its mask, if any; they are only in the ZIP."""
    images = (
        ("image", inputs.picture, "The image."),
        ("template", inputs.template, "The template."),
        ("mask", inputs.mask, "The mask: above 0 where the template counts."),
    )
    return [
        file_of_image(name, image, meaning)._replace(label="") for name, image, meaning in images if image is not None
    ]


# Panels

PANEL_NAME = "template"
"""Name of the search panel in the browser, to which places clicked on the score map are sent."""


def drag_it(inputs: PictureAndTemplate, result: TemplateSearch, query: TemplateQuery) -> None:
    """Show the picture, with the template to drag over it and the places found framed, and the score of every place.

    The picture is reduced for the browser, aligned so that the best place falls on a pixel.
    """
    best = result.best
    found = [("found", match) for match in result.matches[: result.clear]]

    def pack() -> bytes:
        near = (max(best.row, 0), max(best.col, 0)) if best else None
        search = reduced_search(inputs.picture, inputs.template, inputs.mask, near=near, score_map=result.score_map)
        places = []
        for kind, match in found or [("doubtful", match) for match in doubtful(result)]:
            in_part = replace(match, row=match.row - search.row, col=match.col - search.col)
            places.append(
                {
                    "kind": kind,
                    "corners": figures.corners_of(in_part, 1 / search.factor, 1, inputs.template.shape),
                }
            )
        return packed_search(search, name=PANEL_NAME, words=template_words(search), places=places)

    try:
        data = drawn_once("search by hand", pack, inputs, query)
    except ValueError:
        prose.caption("Too little is left of this template when it is reduced for the browser.")
    else:
        component("template_by_hand")(key="template.by_hand", data=data)
    show_scores(inputs, result, query)


# Step by step

MAX_FUNNEL_WIDTH: Final = 900
"""Width above which the picture behind the dots is reduced, px."""


def show_funnel(inputs: PictureAndTemplate, result: TemplateSearch, query: TemplateQuery) -> None:
    """Show the image pixels that remain after each step of the "sampled" search, for any anchor."""
    try:
        data = computed(
            "funnel",
            lambda _: _funnel_data(inputs),
            **kept_for(inputs),
            label="Looking for rare pixels …",
        )
    except ValueError as error:
        prose.caption(f"“Sampled” cannot search here: {error}")
        return
    component("funnel")(key="template.funnel", data=json.loads(data))


def _funnel_data(inputs: PictureAndTemplate) -> bytes:
    """Return the data for the browser, as JSON."""
    return json.dumps(
        {
            "picture": data_url(jpeg(fitted(inputs.picture, MAX_FUNNEL_WIDTH))),
            "template": data_url(figures.masked_template(inputs.template, inputs.mask)),
            "rows": inputs.picture.shape[0],
            "cols": inputs.picture.shape[1],
            "height": inputs.template.shape[0],
            "width": inputs.template.shape[1],
            "anchors": [_described(anchor) for anchor in anchors(inputs.picture, inputs.template, inputs.mask)],
            "frame": f"rgb{FRAME}",
            "words": FUNNEL_WORDS,
        }
    ).encode()


def _described(anchor: Anchor) -> dict[str, Any]:
    """Return an anchor as data for the browser; the last count is 1, the best of all scored places, if there is one."""
    *counts, scored = anchor.counts
    return asdict(anchor) | {"counts": [*counts, 1 if anchor.best else counts[-1]], "scored": scored}


# Other methods, and a damaged image


DAMAGE: Final = "degrade"

METHODS: Final = {"fft": "FFT", "sampled": "Sampled", "opencv": "OpenCV"}

MARKS: Final = {
    "right": "green[:material/check_circle:",
    "elsewhere": "orange[:material/wrong_location:",
    "missed": "red[:material/cancel:",
    "refused": "gray[:material/block:",
}


@fragment
def show_opencv_beside(inputs: PictureAndTemplate, result: TemplateSearch, query: TemplateQuery) -> None:
    """Search with OpenCV too, and show place, score and time of both."""
    masked = is_masked(inputs.template, inputs.mask)
    theirs = computed_or_refused(
        "template search by OpenCV",
        lambda _: opencv_search(inputs.picture, inputs.template, mask=inputs.mask),
        estimate_opencv(inputs.picture.shape, masked),
        **kept_for(inputs),
        label="Searching with OpenCV …",
    )
    if theirs is None:
        return
    prose.markdown(table(result, theirs, query.method, masked))
    same = " and with the same mask" if masked else ""
    prose.caption(f"OpenCV’s method is `cv2.matchTemplate` with `TM_CCOEFF_NORMED`, on the whole image{same}.")
    for sentence in differences(result, theirs, query.method):
        prose.caption(sentence)


@fragment
def damage_it(inputs: PictureAndTemplate, result: TemplateSearch, query: TemplateQuery) -> None:
    """Offer sliders that damage the image around the template, and show the result of each method.

    If the true place is unknown, the found one is used.
    """
    min_score, place = query.min_score, _place(inputs, result)
    if place is None:
        prose.caption("No place wholly inside the image was found, so there is none to damage.")
        return
    height, width = inputs.template.shape[:2]
    rows, cols = part_shape(inputs.picture.shape, (height, width))[:2]
    prose.caption(
        f"The sliders change the {cols} × {rows} pixels around the template; only these are searched again, so there "
        "are fewer look-alikes than in a larger image. Thin white frame: where it is. Bold frame: where a method found "
        "it, with at least the minimum score."
    )
    degradation = _ask_damage()
    attempts = computed_in_turn(
        "degraded search",
        lambda _: _trials(inputs, place, degradation, min_score),
        _estimate_trials(inputs),
        **kept_for(inputs, f"{degradation.model_dump_json()} {place} {min_score}"),
        label="Searching the damaged image …",
    )
    if attempts is None:
        return
    for trial, picture in in_columns(attempts):
        name, outcome = METHODS[trial.method], OUTCOMES[trial.outcome]
        prose.markdown(f"**{name}** :{MARKS[trial.outcome]} {outcome}]")
        show_picture(picture, f"The damaged image, searched by {name}: {outcome}.")
        prose.caption(numbers_of(trial))
    prose.markdown(lesson([trial for trial, _ in attempts], degradation, min_score))


def _place(inputs: PictureAndTemplate, result: TemplateSearch) -> tuple[int, int] | None:
    if inputs.place is not None or not result.found or is_cut_off(result):
        return inputs.place
    best, (height, width) = result.matches[0], inputs.template.shape[:2]
    # If it was found at another size, keep the centre.
    row, col = best.row + (best.height - height) // 2, best.col + (best.width - width) // 2
    rows, cols = inputs.picture.shape[:2]
    return min(max(row, 0), rows - height), min(max(col, 0), cols - width)


def _ask_damage() -> Degradation:
    values = {}
    columns = st.columns(3, gap="medium")
    for number, name in enumerate(Degradation.model_fields):
        with columns[number // 2]:
            values[name] = control(Degradation, name, key=f"{DAMAGE}.{name}")
    degradation = Degradation(**values)
    st.button(
        "Undo all damage",
        key=f"{DAMAGE}.undo",
        on_click=partial(
            st.session_state.update,
            {f"{DAMAGE}.{name}": field.default for name, field in Degradation.model_fields.items()},
        ),
        disabled=degradation == Degradation(),
        type="tertiary",
    )
    return degradation


def _trials(
    inputs: PictureAndTemplate, place: tuple[int, int], degradation: Degradation, min_score: float
) -> list[tuple[Trial, bytes]]:
    """Return the outcome of each method on the damaged image, and a JPEG of it."""
    shape = inputs.template.shape[0], inputs.template.shape[1]
    part = degraded_part(inputs.picture, place, shape, degradation)
    place_in_part = part.row, part.col
    return [
        (trial, figures.trial_jpeg(part.pixels, trial, place_in_part, shape))
        for trial in try_methods(part.pixels, inputs.template, place_in_part, mask=inputs.mask, min_score=min_score)
    ]


def _estimate_trials(inputs: PictureAndTemplate) -> Estimate:
    masked = is_masked(inputs.template, inputs.mask)
    shape = part_shape(inputs.picture.shape, (inputs.template.shape[0], inputs.template.shape[1]))
    ours = estimate_search(shape, inputs.template.shape, dtype=inputs.picture.dtype, masked=masked)
    theirs = estimate_opencv(shape, masked)
    return Estimate(max(ours.memory, theirs.memory), ours.seconds + theirs.seconds)


# A camera: a box cut from its picture is followed, and a frame can be frozen

FOLLOWING: Final = "template.following"

MIN_SCALE_CHANGE = 0.015
"""Change of size from which a frozen template is searched for at other sizes."""

MIN_ROTATION_DEG = 2.0
"""Angle from which a frozen template is searched for at other angles, degrees."""

SCALE_STEP = 0.05
"""The limits of the sizes to search are multiples of this."""

ROTATION_STEP_DEG = 5.0
"""The limit of the angles to search is a multiple of this, degrees."""


class Frame(Message):
    """A picture, and the box to follow from there on, if there is a new one."""

    parts: tuple[bytes]
    box: dict[str, int] | None = None


def show_following(query: TemplateQuery) -> None:
    """Show the camera, whose next frame uses these settings; once a frame is frozen, rerun the page with it."""
    if st.session_state.pop(f"{FOLLOWING}.frozen", False):
        st.rerun()
    stream = open_stream("search", Frame)
    stream.answer = partial(answer, stream.kept, query)
    component("following")(
        key=FOLLOWING,
        data={**connected(stream, {}), "told": FOLLOWING_WORDS, "least": MIN_SIDE},
        on_frozen_change=partial(_freeze, stream),
    )


def answer(kept: dict[str, Any], query: TemplateQuery, message: Frame) -> bytes:
    """Return the place of the template in a frame; it is cut from this frame if a box comes with it."""
    picture = frame(message.parts[0])
    if message.box is not None:
        box = read_box(message.box, picture.shape)
        kept["template"] = picture[box.slices].copy()
        kept["follower"] = Follower(kept["template"], box.row + box.height / 2, box.col + box.width / 2)
    if "follower" not in kept:
        raise ValueError("Draw a box first.")
    followed: Followed = kept["follower"].follow(picture, query)
    kept["place"], kept["picture"] = followed.place, message.parts[0]
    return packed_item(
        {
            "digest": "followed",
            "shape": kept["template"].shape[:2],
            "state": followed.state,
            "said": FOLLOWING_WORDS["states"][followed.state],
            "figures": followed_in_words(followed),
            "place": None if followed.place is None else asdict(followed.place),
        }
    ).data


def _freeze(stream: Stream) -> None:
    """Make the last frame and the template the files of the page, and set the search to their size and angle."""
    kept = stream.kept
    if "picture" not in kept:
        return
    hand_in_picture(kept["picture"], "The frame you froze is in use.", key=f"{PICTURES}.picture")
    hand_in_picture(
        png(kept["template"]), "Your cut-out from the camera’s picture is in use.", key=f"{PICTURES}.template"
    )
    forget_upload(f"{PICTURES}.mask")
    place: Pose | None = kept["place"]
    if place is not None and abs(place.scale - 1) > MIN_SCALE_CHANGE:
        low, high = math.floor(place.scale / SCALE_STEP) * SCALE_STEP, math.ceil(place.scale / SCALE_STEP) * SCALE_STEP
        adopt_value("template.min_scale", round(max(MIN_SIZE, min(1.0, low)), 2))
        adopt_value("template.max_scale", round(min(MAX_SIZE, max(1.0, high)), 2))
    if place is not None and abs(place.rotation) > MIN_ROTATION_DEG:
        adopt_value(
            "template.max_rotation", min(180.0, math.ceil(abs(place.rotation) / ROTATION_STEP_DEG) * ROTATION_STEP_DEG)
        )
    st.session_state.update({PICTURES: OWN, f"{PICTURES}.from": "given", f"{FOLLOWING}.frozen": True})
