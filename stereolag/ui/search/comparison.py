"""Methods compared on one search: OpenCV's answer beside ours, and all of them on a damaged image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import streamlit as st

from stereolag.core.jobs import Estimate
from stereolag.core.searches import TemplateQuery
from stereolag.figures.templates import trial_jpeg
from stereolag.figures.verdicts import is_cut_off
from stereolag.templates import TemplateSearch, estimate_search
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
from stereolag.ui.controls import control
from stereolag.ui.elements import show_picture
from stereolag.ui.inputs import PictureAndTemplate
from stereolag.ui.navigation import fragment
from stereolag.ui.results import computed_in_turn, computed_or_refused
from stereolag.ui.search.sentences import OUTCOMES, differences, lesson, numbers_of, table

TASK: Final = "template search by OpenCV"

KEY: Final = "degrade"

NAMES: Final = {"fft": "FFT", "sampled": "Sampled", "opencv": "OpenCV"}

MARKS: Final = {
    "right": "green[:material/check_circle:",
    "elsewhere": "orange[:material/wrong_location:",
    "missed": "red[:material/cancel:",
    "refused": "gray[:material/block:",
}


@dataclass(frozen=True, eq=False)
class Survival:
    """The outcome of each method, and a JPEG for each."""

    trials: tuple[Trial, ...]
    fft: bytes
    sampled: bytes
    opencv: bytes


@fragment
def show_opencv_beside(inputs: PictureAndTemplate, result: TemplateSearch, query: TemplateQuery) -> None:
    """Search with OpenCV too, and show place, score and time of both."""
    masked = is_masked(inputs.template, inputs.mask)
    theirs = computed_or_refused(
        TASK,
        lambda _: opencv_search(inputs.picture, inputs.template, mask=inputs.mask),
        estimate_opencv(inputs.picture.shape, masked),
        inputs=inputs.digest,
        settings="",
        shared=inputs.shared,
        label="Searching with OpenCV …",
    )
    if theirs is None:
        return
    prose.markdown(table(result, theirs, query.method, masked))
    same = " and with the same mask" if masked else ""
    prose.caption(f"OpenCV’s is `cv2.matchTemplate` with `TM_CCOEFF_NORMED`, on the whole image{same}.")
    for sentence in differences(result, theirs, query.method):
        prose.caption(sentence)


@fragment
def damage_it(inputs: PictureAndTemplate, result: TemplateSearch, query: TemplateQuery) -> None:
    """Offer sliders that damage the image around the template, and show the result of each method.

    If the true place is unknown, the one found is taken.
    """
    min_score, place = query.min_score, _place(inputs, result)
    if place is None:
        prose.caption("No place wholly inside the image was found, so there is none to damage.")
        return
    height, width = inputs.template.shape[:2]
    rows, cols = part_shape(inputs.picture.shape, (height, width))[:2]
    prose.caption(
        f"The sliders change the {cols} × {rows} pixels around the template; only these are searched again, so there "
        "are fewer look-alikes than in a larger image. Thin white: where it is. Bold: where a method found it, with "
        "at least the minimum score."
    )
    degradation = _asked()
    survival = computed_in_turn(
        "degraded search",
        lambda _: _tried(inputs, place, degradation, min_score),
        _estimate(inputs),
        inputs=inputs.digest,
        settings=f"{degradation.model_dump_json()} {place} {min_score}",
        shared=inputs.shared,
        label="Searching the damaged image …",
    )
    if survival is None:
        return
    for column, trial in zip(st.columns(len(NAMES), gap="medium"), survival.trials, strict=True):
        with column:
            prose.markdown(f"**{NAMES[trial.method]}** :{MARKS[trial.outcome]} {OUTCOMES[trial.outcome]}]")
            show_picture(
                getattr(survival, trial.method),
                f"The damaged image, searched by {NAMES[trial.method]}: {OUTCOMES[trial.outcome]}.",
            )
            prose.caption(numbers_of(trial))
    prose.markdown(lesson(survival.trials, degradation, min_score))


def _place(inputs: PictureAndTemplate, result: TemplateSearch) -> tuple[int, int] | None:
    if inputs.place is not None or not result.found or is_cut_off(result):
        return inputs.place
    best, (height, width) = result.matches[0], inputs.template.shape[:2]
    # If it was found at another size, keep its centre.
    row, col = best.row + (best.height - height) // 2, best.col + (best.width - width) // 2
    rows, cols = inputs.picture.shape[:2]
    return min(max(row, 0), rows - height), min(max(col, 0), cols - width)


def _asked() -> Degradation:
    values = {}
    columns = st.columns(3, gap="medium")
    for number, name in enumerate(Degradation.model_fields):
        with columns[number // 2]:
            values[name] = control(Degradation, name, key=f"{KEY}.{name}")
    degradation = Degradation(**values)
    st.button(
        "Undo all damage", key=f"{KEY}.undo", on_click=_undo, disabled=degradation == Degradation(), type="tertiary"
    )
    return degradation


def _undo() -> None:
    for name, field in Degradation.model_fields.items():
        st.session_state[f"{KEY}.{name}"] = field.default


def _tried(inputs: PictureAndTemplate, place: tuple[int, int], degradation: Degradation, min_score: float) -> Survival:
    shape = inputs.template.shape[0], inputs.template.shape[1]
    part = degraded_part(inputs.picture, place, shape, degradation)
    here = part.row, part.col
    trials = try_methods(part.pixels, inputs.template, here, mask=inputs.mask, min_score=min_score)
    return Survival(trials, **{trial.method: trial_jpeg(part.pixels, trial, here, shape) for trial in trials})


def _estimate(inputs: PictureAndTemplate) -> Estimate:
    masked = is_masked(inputs.template, inputs.mask)
    shape = part_shape(inputs.picture.shape, (inputs.template.shape[0], inputs.template.shape[1]))
    ours = estimate_search(shape, inputs.template.shape, dtype=inputs.picture.dtype, masked=masked)
    theirs = estimate_opencv(shape, masked)
    return Estimate(max(ours.memory, theirs.memory), ours.seconds + theirs.seconds)
